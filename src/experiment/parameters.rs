//! Parameters from one structure: serde reads it, its JSON schema says what is known of each field (default, range,
//! meaning), and both the range checks and the documentation come from that schema.

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::diagnostic::Diagnostic;
use super::tree::Node;

/// What is known of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pub name: String,
    /// As it is written in an experiment; `None` for one that has to be given.
    pub default: Option<String>,
    /// The numbers that are accepted, for one that has limits.
    pub range: Option<String>,
    /// The names that are accepted, for one that is a choice, with what each means.
    pub choices: Vec<(String, String)>,
    pub meaning: String,
    pub kind: ParameterKind,
}

/// What a parameter is, for somebody who has to offer a way to change it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ParameterKind {
    /// So many numbers (one, or a tuple), each within the limits.
    Numbers {
        count: usize,
        is_whole: bool,
        limits: Limits,
    },
    Flag,
    /// One of the choices.
    Choice,
    /// Whatever its RON is.
    #[default]
    Other,
}

impl ParameterKind {
    fn of(field: &Value, has_choices: bool) -> Self {
        let is = |field: &Value, kind: &str| match field.get("type") {
            Some(Value::Array(kinds)) => kinds.iter().any(|known| known == kind),
            Some(known) => known == kind,
            None => false,
        };
        let number = |field: &Value| is(field, "integer") || is(field, "number");
        let limits = Limits::of(field);
        let items: Vec<&Value> = field.get("prefixItems").and_then(Value::as_array).into_iter().flatten().collect();
        match () {
            () if has_choices => ParameterKind::Choice,
            () if is(field, "boolean") => ParameterKind::Flag,
            () if number(field) => ParameterKind::Numbers { count: 1, is_whole: is(field, "integer"), limits },
            () if !items.is_empty() && items.iter().all(|item| number(item)) => {
                let is_whole = items.iter().all(|item| is(item, "integer"));
                ParameterKind::Numbers { count: items.len(), is_whole, limits }
            }
            () => ParameterKind::Other,
        }
    }
}

/// The JSON schema of a structure of parameters; `fn` pointers to this are what registries hold.
pub fn schema<P: JsonSchema>() -> Schema {
    SchemaGenerator::default().into_root_schema_for::<P>()
}

/// Reads the fields of a stage or a measure, and refuses numbers outside the ranges of the schema.
pub fn read<P: DeserializeOwned + Serialize + JsonSchema>(node: &Node) -> Result<P, Diagnostic> {
    let parameters: P = node.parse_fields()?;
    // every structure of parameters consists of what JSON has
    let values = serde_json::to_value(&parameters).unwrap_or_default();
    check_ranges(&values, &schema::<P>(), node)?;
    Ok(parameters)
}

/// Compares numbers with the limits that a schema states for their fields.
pub fn check_ranges(values: &Value, schema: &Schema, node: &Node) -> Result<(), Diagnostic> {
    let Some(fields) = schema.get("properties").and_then(Value::as_object) else { return Ok(()) };
    for (name, field) in fields {
        let limits = Limits::of(field);
        let Some(value) = values.get(name) else { continue };
        let numbers = match value {
            Value::Array(items) => items.clone(),
            one => vec![one.clone()],
        };
        // JSON has no infinity and no NaN, and writes both as null
        let is_number = field.get("type").is_some_and(|kind| kind == "number");
        let is_bad = |number: &Value| match number.as_f64() {
            Some(number) => !limits.hold(number),
            None => is_number && number.is_null(),
        };
        if numbers.iter().any(is_bad) {
            let written = node.field(name).unwrap_or(node);
            let each = if numbers.len() > 1 { " each" } else { "" };
            let expected = limits.text().unwrap_or_else(|| "a finite number".into());
            // what has no name of its own is a part of the scene
            let described = node.name().map_or("a scene".into(), |name| format!("`{name}`"));
            return Err(Diagnostic::input(format!("{described} cannot have `{name}: {}`", written.canonical()))
                .at(&written.origin, format!("expected {expected}{each}")));
        }
    }
    Ok(())
}

/// What the schema says of every field, in the order of the structure.
pub fn describe(schema: &Schema) -> Vec<Parameter> {
    let Some(fields) = schema.get("properties").and_then(Value::as_object) else { return Vec::new() };
    let definition = |field: &Value| {
        let name = field.get("$ref")?.as_str()?.rsplit('/').next()?.to_string();
        schema.get("$defs")?.get(name).cloned()
    };
    let parameter = |(name, field): (&String, &Value)| {
        let definition = definition(field);
        let choices = definition.as_ref().map(choices).unwrap_or_default();
        let meaning = field.get("description").and_then(Value::as_str).unwrap_or_default();
        Parameter {
            name: name.clone(),
            default: field.get("default").map(|value| as_written(value, !choices.is_empty())),
            range: Limits::of(field).text(),
            kind: ParameterKind::of(field, !choices.is_empty()),
            choices,
            meaning: meaning.split_whitespace().collect::<Vec<_>>().join(" "),
        }
    };
    fields.iter().map(parameter).collect()
}

/// Names and meanings of the variants of an enumeration.
fn choices(definition: &Value) -> Vec<(String, String)> {
    let named = |variant: &Value| {
        let name = variant.get("const")?.as_str()?.to_string();
        let meaning = variant.get("description").and_then(Value::as_str).unwrap_or_default();
        Some((name, meaning.split_whitespace().collect::<Vec<_>>().join(" ")))
    };
    let of = |list: &str| definition.get(list).and_then(Value::as_array);
    match (of("oneOf"), of("enum")) {
        (Some(variants), _) => variants.iter().filter_map(named).collect(),
        (None, Some(names)) => {
            names.iter().filter_map(Value::as_str).map(|name| (name.to_string(), String::new())).collect()
        }
        _ => Vec::new(),
    }
}

/// A JSON value as RON writes it.
fn as_written(value: &Value, is_choice: bool) -> String {
    match value {
        Value::Null => "None".into(),
        Value::String(text) if is_choice => text.clone(),
        Value::String(text) => format!("{text:?}"),
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(|item| as_written(item, false)).collect();
            format!("({})", items.join(", "))
        }
        other => other.to_string(),
    }
}

/// The numbers that a field accepts. Of a tuple of numbers, each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    pub least: Option<f64>,
    pub above: Option<f64>,
    pub most: Option<f64>,
}

impl Limits {
    fn of(field: &Value) -> Self {
        let number = |name: &str| field.get(name).and_then(Value::as_f64);
        // that an unsigned number is not negative goes without saying
        let is_unsigned = field.get("format").and_then(Value::as_str).is_some_and(|format| format.starts_with("uint"));
        let least = number("minimum").filter(|least| !(is_unsigned && *least == 0.0));
        Self { least, above: number("exclusiveMinimum"), most: number("maximum") }
    }

    fn hold(&self, number: f64) -> bool {
        self.least.is_none_or(|least| number >= least)
            && self.above.is_none_or(|above| number > above)
            && self.most.is_none_or(|most| number <= most)
    }

    fn text(&self) -> Option<String> {
        match (self.least, self.above, self.most) {
            (Some(least), _, Some(most)) => Some(format!("{least} to {most}")),
            (_, Some(above), Some(most)) => Some(format!("more than {above}, at most {most}")),
            (Some(least), _, None) => Some(format!("{least} or more")),
            (_, Some(above), None) => Some(format!("more than {above}")),
            (None, None, Some(most)) => Some(format!("at most {most}")),
            (None, None, None) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;
    use crate::experiment::diagnostic::Source;

    #[derive(Debug, Deserialize, Serialize, JsonSchema, PartialEq)]
    #[serde(deny_unknown_fields, default)]
    struct Made {
        /// how many
        #[schemars(range(min = 1, max = 8))]
        count: u32,
        /// how much
        #[schemars(extend("exclusiveMinimum" = 0))]
        share: f64,
        /// two of them
        #[schemars(extend("minimum" = 2))]
        size: (u32, u32),
        /// which
        kind: Kind,
    }

    #[derive(Debug, Deserialize, Serialize, JsonSchema, PartialEq)]
    enum Kind {
        /// the first
        First,
    }

    impl Default for Made {
        fn default() -> Self {
            Self { count: 3, share: 0.5, size: (4, 5), kind: Kind::First }
        }
    }

    fn made(text: &str) -> Result<Made, Diagnostic> {
        read(&Node::read(&Source::new("test", text))?)
    }

    #[test]
    fn numbers_outside_their_range_are_refused_where_they_stand() {
        assert_eq!(made("Made(count: 8)").unwrap().count, 8);
        for (text, place) in [
            ("Made(count: 0)", "0"),
            ("Made(count: 9)", "9"),
            ("Made(share: 0)", "0"),
            ("Made(share: NaN)", "NaN"),
            ("Made(share: inf)", "inf"),
            ("Made(size: (7, 1))", "(7, 1)"),
        ] {
            let error = made(text).unwrap_err();
            assert_eq!(error.labels[0].0.text(), place, "{error}");
        }
    }

    #[test]
    fn the_schema_says_what_is_documented() {
        let known = describe(&schema::<Made>());
        let line = |p: &Parameter| (p.name.clone(), p.default.clone().unwrap(), p.range.clone(), p.meaning.clone());
        let lines: Vec<_> = known.iter().map(line).collect();
        let expected = [
            ("count", "3", Some("1 to 8"), "how many"),
            ("share", "0.5", Some("more than 0"), "how much"),
            ("size", "(4, 5)", Some("2 or more"), "two of them"),
            ("kind", "First", None, "which"),
        ];
        let expected =
            expected.map(|(n, d, r, m)| (n.to_string(), d.to_string(), r.map(str::to_string), m.to_string()));
        assert_eq!(lines, expected);
        assert_eq!(known[3].choices, [("First".to_string(), "the first".to_string())]);
    }
}
