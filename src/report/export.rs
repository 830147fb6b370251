//! Columns as files that other programs read: CSV, JSON and Parquet.

use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, Repetition, Type as PhysicalType};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use super::data::{Column, Values};
use crate::experiment::diagnostic::Diagnostic;

fn rows(columns: &[Column]) -> usize {
    columns.first().map_or(0, |column| column.values.count())
}

/// One line a row under the names of the columns; what was not measured is empty.
pub fn csv(columns: &[Column]) -> Result<Vec<u8>, Diagnostic> {
    let refuse = |error: csv::Error| Diagnostic::run(format!("a table cannot be made: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns.iter().map(|column| &column.name)).map_err(refuse)?;
    for row in 0..rows(columns) {
        writer.write_record(columns.iter().map(|column| column.values.text(row))).map_err(refuse)?;
    }
    writer.into_inner().map_err(|error| Diagnostic::run(format!("a table cannot be made: {error}")))
}

/// One object a row, with the names of the columns; what was not measured is null.
pub fn json(columns: &[Column]) -> String {
    let row = |row: usize| {
        let fields = columns.iter().map(|column| (column.name.clone(), column.values.json(row)));
        serde_json::Value::Object(fields.collect()).to_string()
    };
    format!("[\n{}\n]\n", (0..rows(columns)).map(row).collect::<Vec<_>>().join(",\n"))
}

/// The same with the type of each column.
pub fn parquet(columns: &[Column]) -> Result<Vec<u8>, Diagnostic> {
    write_parquet(columns).map_err(|error| Diagnostic::run(format!("a Parquet file cannot be made: {error}")))
}

fn write_parquet(columns: &[Column]) -> Result<Vec<u8>, ParquetError> {
    let fields = columns.iter().map(field).collect::<Result<Vec<TypePtr>, _>>()?;
    let schema = Arc::new(Type::group_type_builder("records").with_fields(fields).build()?);
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    for column in columns {
        match &column.values {
            Values::Number(values) => write_column::<DoubleType>(&mut group, values.iter().copied())?,
            Values::Integer(values) => write_column::<Int64Type>(&mut group, values.iter().copied())?,
            Values::Flag(values) => write_column::<BoolType>(&mut group, values.iter().copied())?,
            Values::Text(values) => {
                let texts = values.iter().map(|text| text.as_ref().map(|text| ByteArray::from(text.as_str())));
                write_column::<ByteArrayType>(&mut group, texts)?;
            }
        }
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

fn field(column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, converted) = match column.values {
        Values::Number(_) => (PhysicalType::DOUBLE, ConvertedType::NONE),
        Values::Integer(_) => (PhysicalType::INT64, ConvertedType::NONE),
        Values::Flag(_) => (PhysicalType::BOOLEAN, ConvertedType::NONE),
        Values::Text(_) => (PhysicalType::BYTE_ARRAY, ConvertedType::UTF8),
    };
    let field = Type::primitive_type_builder(&column.name, physical)
        .with_converted_type(converted)
        .with_repetition(Repetition::OPTIONAL);
    Ok(Arc::new(field.build()?))
}

/// Values with the levels that say which are there.
fn write_column<T: DataType>(
    group: &mut SerializedRowGroupWriter<&mut Vec<u8>>,
    values: impl Iterator<Item = Option<T::T>>,
) -> Result<(), ParquetError> {
    let values: Vec<Option<T::T>> = values.collect();
    let levels: Vec<i16> = values.iter().map(|value| value.is_some().into()).collect();
    let there: Vec<T::T> = values.into_iter().flatten().collect();
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("there is no such column".into()));
    };
    column.typed::<T>().write_batch(&there, Some(&levels), None)?;
    column.close()
}
