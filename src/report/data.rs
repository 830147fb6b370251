//! Records as data: a row a cell, a column a figure, each with its type, unit and meaning. Files, page and `lodlab schema` are made of
//! these columns.

use serde::Serialize;

use super::records::{Head, Record, Results};
use super::standing::Standing;
use crate::experiment::sweep::Varied;
use crate::measure::time::Spread;
use crate::measure::{self, Kind, Known};

/// What a column is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Says which cell a row is of.
    Id,
    /// What was varied.
    Axis,
    /// How far off a picture is.
    Error,
    /// What it takes to make it.
    Cost,
    /// The quartiles of a cost.
    Spread,
    Figure,
    /// Where, when and on what.
    About,
}

/// The values of all rows. What was not measured has none.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    Number(Vec<Option<f64>>),
    Integer(Vec<Option<i64>>),
    Text(Vec<Option<String>>),
    Flag(Vec<Option<bool>>),
}

impl Values {
    /// What the schema calls the type.
    pub fn kind(&self) -> &'static str {
        match self {
            Values::Number(_) => "number",
            Values::Integer(_) => "integer",
            Values::Text(_) => "text",
            Values::Flag(_) => "flag",
        }
    }

    /// Rows.
    pub fn count(&self) -> usize {
        match self {
            Values::Number(values) => values.len(),
            Values::Integer(values) => values.len(),
            Values::Text(values) => values.len(),
            Values::Flag(values) => values.len(),
        }
    }

    /// A value as text, and nothing for none.
    pub fn text(&self, row: usize) -> String {
        fn shown<T: ToString>(values: &[Option<T>], row: usize) -> String {
            values[row].as_ref().map_or(String::new(), T::to_string)
        }
        match self {
            Values::Number(values) => shown(values, row),
            Values::Integer(values) => shown(values, row),
            Values::Text(values) => shown(values, row),
            Values::Flag(values) => shown(values, row),
        }
    }

    pub fn json(&self, row: usize) -> serde_json::Value {
        match self {
            // JSON has no infinity
            Values::Number(values) => match values[row] {
                Some(value) if !value.is_finite() => value.to_string().into(),
                value => value.into(),
            },
            Values::Integer(values) => values[row].into(),
            Values::Text(values) => values[row].clone().into(),
            Values::Flag(values) => values[row].into(),
        }
    }
}

#[derive(Clone, Debug)]
pub struct Column {
    pub name: String,
    pub unit: &'static str,
    pub meaning: String,
    pub role: Role,
    /// Of an error: it is better the more there is of it.
    pub more_is_better: bool,
    pub values: Values,
}

/// Columns as they are made, row by row.
struct Rows<'a> {
    results: &'a Results,
    columns: Vec<Column>,
}

/// All columns of these results: the rows are first the records and then the failures.
pub fn columns(results: &Results) -> Vec<Column> {
    let standing = Standing::of(results);
    let mut rows = Rows { results, columns: Vec::new() };
    rows.identify(&standing);
    rows.axes();
    rows.figures();
    rows.times();
    rows.about();
    rows.columns
}

impl Rows<'_> {
    fn push(&mut self, name: impl Into<String>, unit: &'static str, role: Role, meaning: &str, values: Values) {
        let (name, meaning) = (name.into(), meaning.to_string());
        self.columns.push(Column { name, unit, meaning, role, more_is_better: false, values });
    }

    fn text(&mut self, name: &str, role: Role, meaning: &str, of: impl Fn(&Head) -> String) {
        let values = self.results.heads().map(|head| Some(of(head))).collect();
        self.push(name, "", role, meaning, Values::Text(values));
    }

    /// A number that only cells with a record have.
    fn number(
        &mut self,
        name: &str,
        unit: &'static str,
        role: Role,
        meaning: &str,
        of: impl Fn(&Record) -> Option<f64>,
    ) {
        let values = self.results.records.iter().map(of);
        let values = values.chain(self.results.failures.iter().map(|_| None)).collect();
        self.push(name, unit, role, meaning, Values::Number(values));
    }

    fn integer(&mut self, name: &str, unit: &'static str, role: Role, meaning: &str, of: impl Fn(&Record) -> u64) {
        let values = self.results.records.iter().map(|record| i64::try_from(of(record)).ok());
        let values = values.chain(self.results.failures.iter().map(|_| None)).collect();
        self.push(name, unit, role, meaning, Values::Integer(values));
    }

    /// A whole number that is known of all cells.
    fn count(&mut self, name: &str, unit: &'static str, meaning: &str, of: impl Fn(&Head) -> u64) {
        let values = self.results.heads().map(|head| i64::try_from(of(head)).ok()).collect();
        self.push(name, unit, Role::About, meaning, Values::Integer(values));
    }

    fn identify(&mut self, standing: &Standing) {
        self.text("cell", Role::Id, "hash of everything that decides the results", |head| head.hash.clone());
        self.text("experiment", Role::Id, "title of the experiment", |head| head.experiment.clone());
        self.text("chain", Role::Id, "name of the chain", |head| head.chain.clone());
        let scenes = self.results.heads().map(|head| Some(standing.scene_label(head).to_string())).collect();
        self.push(
            "scene",
            "",
            Role::Id,
            "what is looked at, by what tells it from the other scenes: only cells of one scene can be compared",
            Values::Text(scenes),
        );
        self.text("adapter", Role::Id, "name of the adapter", |head| head.adapter.name.clone());
        self.text("label", Role::Id, "chain and what was varied", Head::label);
        let results = self.results;
        let faults: Vec<String> = results.records.iter().map(|record| record.faults().join("; ")).collect();
        let status = faults.iter().map(|faults| if faults.is_empty() { "ok" } else { "faulty" });
        let status = status.chain(results.failures.iter().map(|_| "failed")).map(|status| Some(status.into()));
        let status = Values::Text(status.collect());
        let meaning = "`ok`; `faulty`: it broke a bound or has holes, and is on no front; `failed`: it has no figures";
        self.push("status", "", Role::Id, meaning, status);
        let why = faults.into_iter().map(|faults| Some(faults).filter(|faults| !faults.is_empty()));
        let why = why.chain(results.failures.iter().map(|failure| Some(failure.why.clone()))).collect();
        self.push("why", "", Role::Id, "what is wrong with it", Values::Text(why));
    }

    fn axes(&mut self) {
        let mut keys: Vec<String> = Vec::new();
        // which of several named scenes is looked at is a column already
        let settings = self.results.heads().flat_map(|head| &head.settings).filter(|setting| setting.path != "scene");
        for setting in settings {
            let key = column_of(setting);
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        for key in keys {
            let of = |head: &Head| head.settings.iter().find(|setting| column_of(setting) == key).cloned();
            let settings: Vec<Option<Varied>> = self.results.heads().map(of).collect();
            let paths = settings.iter().flatten().next().map_or(String::new(), |setting| setting.axis.clone());
            for (name, values) in typed(&key, &settings) {
                let name = if is_taken(&key) { format!("axis.{name}") } else { name };
                self.push(name, "", Role::Axis, &format!("what was varied or set: {paths}"), values);
            }
        }
    }

    fn figures(&mut self) {
        let mut names: Vec<(&str, &str)> = Vec::new();
        for figure in self.results.records.iter().flat_map(|record| &record.measures) {
            if names.iter().all(|(name, _)| *name != figure.name) {
                names.push((&figure.name, &figure.unit));
            }
        }
        for (name, _) in names {
            let Some(known) = measure::known(name) else { continue };
            self.number(name, known.unit, role(known), known.meaning, |record| record.measure(name));
            if let (Kind::Likeness, Some(column)) = (known.kind, self.columns.last_mut()) {
                column.more_is_better = true;
            }
        }
    }

    fn times(&mut self) {
        for time in TIMES {
            self.number(time.name, "ms", time.role, time.meaning, |record| {
                (time.of)(record).map(|spread| spread.median)
            });
            let [q1, q3] = ["q1", "q3"].map(|quartile| format!("{}_{quartile}", time.name));
            self.number(&q1, "ms", Role::Spread, "lower quartile", |record| Some((time.of)(record)?.lower_quartile));
            self.number(&q3, "ms", Role::Spread, "upper quartile", |record| Some((time.of)(record)?.upper_quartile));
        }
        let samples = |record: &Record| record.timings.frame_wall_ms.as_ref().map_or(0, |spread| spread.samples as u64);
        self.integer("samples", "", Role::About, "timed frames", samples);
        self.integer("repeats", "", Role::About, "how often the path was timed", |record| {
            record.timings.repeats.into()
        });
        let meaning = "what runs once a terrain, on the clock: pyramids, uploads";
        self.number("once_ms", "ms", Role::Cost, meaning, |record| Some(record.timings.once_ms));
        let meaning = "making buffers and pipelines, once a cell";
        self.number("prepare_ms", "ms", Role::Cost, meaning, |record| Some(record.timings.prepare_ms));
        self.integer("bytes", "B", Role::Cost, "memory that the plan asks for", |record| record.bytes);
    }

    fn about(&mut self) {
        self.text("terrain", Role::About, "the terrain as it is written", |head| head.scene.terrain.clone());
        let meaning = "of the picture";
        self.count("viewport_columns", "px", meaning, |head| head.scene.viewport.0.into());
        self.count("viewport_rows", "px", meaning, |head| head.scene.viewport.1.into());
        self.count("frames", "", "frames of the camera path", |head| head.scene.frames as u64);
        self.text("driver", Role::About, "driver of the adapter", |head| head.adapter.driver.clone());
        self.text("backend", Role::About, "what wgpu reaches the adapter through", |head| head.adapter.backend.clone());
        self.text("date", Role::About, "when the cell was run, coordinated universal time", |head| {
            head.made.date.clone()
        });
        self.text("lodlab", Role::About, "version of lodlab", |head| head.made.lodlab.clone());
    }
}

/// Whether something else has a column of that name.
fn is_taken(name: &str) -> bool {
    const OTHERS: [&str; 21] = [
        "cell",
        "experiment",
        "chain",
        "scene",
        "adapter",
        "label",
        "status",
        "why",
        "samples",
        "repeats",
        "once_ms",
        "prepare_ms",
        "bytes",
        "terrain",
        "viewport_columns",
        "viewport_rows",
        "frames",
        "driver",
        "backend",
        "date",
        "lodlab",
    ];
    let is_time = |time: &TimeColumn| name.strip_prefix(time.name).is_some_and(|end| ["", "_q1", "_q3"].contains(&end));
    OTHERS.contains(&name) || measure::known(name).is_some() || TIMES.iter().any(is_time)
}

/// The name of the column of what was varied.
fn column_of(setting: &Varied) -> String {
    setting.axis_name.clone().unwrap_or_else(|| setting.path.clone())
}

fn role(known: &Known) -> Role {
    match known.kind {
        Kind::Error | Kind::Likeness => Role::Error,
        Kind::Cost => Role::Cost,
        Kind::Fault(_) | Kind::Other => Role::Figure,
    }
}

/// A time with its quartiles.
pub struct TimeColumn {
    pub name: &'static str,
    pub role: Role,
    pub meaning: &'static str,
    pub of: fn(&Record) -> Option<&Spread>,
}

/// All times that have quartiles.
pub const TIMES: &[TimeColumn] = &[
    TimeColumn {
        name: "method_ms",
        role: Role::Cost,
        meaning: "median time of what makes the drawn surface, by the adapter's stamps if they are to be believed, else by the clock",
        of: Record::method,
    },
    TimeColumn {
        name: "frame_ms",
        role: Role::Cost,
        meaning: "median time of a whole frame, by the adapter's stamps if they are to be believed, else by the clock",
        of: Record::frame,
    },
    TimeColumn {
        name: "method_gpu_ms",
        role: Role::Figure,
        meaning: "the method by the adapter's stamps",
        of: |record| record.timings.method_gpu_ms.as_ref(),
    },
    TimeColumn {
        name: "method_wall_ms",
        role: Role::Figure,
        meaning: "the method by the clock",
        of: |record| record.timings.method_wall_ms.as_ref(),
    },
    TimeColumn {
        name: "frame_gpu_ms",
        role: Role::Figure,
        meaning: "a whole frame by the adapter's stamps",
        of: |record| record.timings.frame_gpu_ms.as_ref(),
    },
    TimeColumn {
        name: "frame_wall_ms",
        role: Role::Figure,
        meaning: "a whole frame by the clock",
        of: |record| record.timings.frame_wall_ms.as_ref(),
    },
    TimeColumn {
        name: "after_surface_ms",
        role: Role::Figure,
        meaning: "the steps that the drawn surface does not depend on, such as shading",
        of: |record| record.timings.after_surface_ms.as_ref(),
    },
];

/// The columns of what was varied under one name, of the type that all of its values have; tuples of numbers have a column for each.
fn typed(name: &str, settings: &[Option<Varied>]) -> Vec<(String, Values)> {
    let numbers: Vec<Option<Vec<f64>>> = settings.iter().map(|setting| setting.as_ref()?.numbers()).collect();
    let are_numbers = settings.iter().zip(&numbers).all(|(setting, numbers)| setting.is_some() == numbers.is_some());
    let parts = numbers.iter().flatten().map(Vec::len).max().unwrap_or(0);
    if are_numbers && parts > 0 && numbers.iter().flatten().all(|numbers| numbers.len() == parts) {
        let name = |part: usize| if parts == 1 { name.to_string() } else { format!("{name}.{part}") };
        let part = |part: usize| numbers.iter().map(|numbers| Some(numbers.as_ref()?[part])).collect();
        return (0..parts).map(|at| (name(at), as_integers(part(at)))).collect();
    }
    let texts: Vec<Option<String>> = settings.iter().map(|setting| Some(plain_text(setting.as_ref()?))).collect();
    let flags: Vec<Option<bool>> = texts.iter().map(|text| text.as_ref()?.parse().ok()).collect();
    let are_flags = texts.iter().zip(&flags).all(|(text, flag)| text.is_some() == flag.is_some());
    vec![(name.to_string(), if are_flags { Values::Flag(flags) } else { Values::Text(texts) })]
}

/// Whole numbers as such.
fn as_integers(numbers: Vec<Option<f64>>) -> Values {
    let is_whole = |number: &f64| number.fract() == 0.0 && number.abs() < 2f64.powi(53);
    match numbers.iter().flatten().all(is_whole) {
        true => Values::Integer(numbers.into_iter().map(|number| Some(number? as i64)).collect()),
        false => Values::Number(numbers),
    }
}

fn plain_text(setting: &Varied) -> String {
    let text = setting.value_name.as_deref().unwrap_or(&setting.value);
    text.strip_prefix('"').and_then(|text| text.strip_suffix('"')).unwrap_or(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn varied(value: &str) -> Option<Varied> {
        let path = "*.ViewGrid.size".to_string();
        Some(Varied { axis: path.clone(), path, value: value.into(), axis_name: None, value_name: None })
    }

    #[test]
    fn axes_have_the_type_of_their_values() {
        let kinds = |values: &[&str]| {
            let mut settings: Vec<Option<Varied>> = values.iter().map(|value| varied(value)).collect();
            settings.push(None);
            let columns = typed("a", &settings);
            columns.into_iter().map(|(name, values)| format!("{name} {}", values.kind())).collect::<Vec<_>>()
        };
        assert_eq!(kinds(&["(16,12)", "(32,24)"]), ["a.0 integer", "a.1 integer"]);
        assert_eq!(kinds(&["0.5", "1", "2"]), ["a number"]);
        assert_eq!(kinds(&["1", "2"]), ["a integer"]);
        assert_eq!(kinds(&["true", "false"]), ["a flag"]);
        assert_eq!(kinds(&["Paper", "Proven"]), ["a text"]);
        // of mixed values none is lost
        assert_eq!(kinds(&["1", "(1,2)"]), ["a text"]);
        assert_eq!(kinds(&["1", "Dem(file:\"a.png\",)"]), ["a text"]);
    }
}
