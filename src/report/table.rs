//! The table a run ends with.

use comfy_table::{CellAlignment, Table, presets};

use super::Record;

pub const HEADER: [&str; 10] =
    ["cell", "error mean px", "rms", "p99", "max", "over %", "sky miss %", "psnr dB", "frame ms", "triangles"];

/// One row a record; a dash is "not measured".
pub fn rows(records: &[Record]) -> Vec<Vec<String>> {
    let row = |record: &Record| {
        let shown = |name: &str| record.measure(name).map_or("-".into(), digits);
        let percent = |name: &str| record.measure(name).map_or("-".into(), |share| digits(share * 100.0));
        vec![
            record.label(),
            shown("error_mean"),
            shown("error_rms"),
            shown("error_p99"),
            shown("error_max"),
            percent("over_threshold"),
            percent("silhouette_misses"),
            if record.measure("equal_pictures") == Some(1.0) { "equal".into() } else { shown("psnr") },
            record.frame_ms().map_or("-".into(), digits),
            record.measure("triangles").map_or("-".into(), |count| count.to_string()),
        ]
    };
    records.iter().map(row).collect()
}

pub fn table(records: &[Record]) -> String {
    let mut table = Table::new();
    table.load_preset(presets::ASCII_MARKDOWN).set_header(HEADER);
    table.add_rows(rows(records));
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

/// Three significant digits.
fn digits(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        1.0.. => format!("{value:.2}"),
        0.001.. => format!("{value:.4}"),
        _ => format!("{value:.1e}"),
    }
}
