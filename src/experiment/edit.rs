//! An experiment's text with other values in it: what was written stays as it was written, comments too.

use std::ops::Range;

use super::Experiment;
use super::diagnostic::{Diagnostic, Source};
use super::sweep::Setting;
use super::tree::{Field, Kind, Node};

impl Experiment {
    /// The text with settings written into it. A swept path gets one value in its axis; a field that is not written is added.
    pub fn text_with(&self, settings: &[Setting]) -> Result<String, Diagnostic> {
        let mut experiment = self.clone();
        for setting in settings {
            for (range, text) in experiment.splices(setting)?.into_iter().rev() {
                let mut all = experiment.source.text.clone();
                all.replace_range(range, &text);
                experiment = Experiment::read(Source::new(self.source.name.clone(), all), self.folder.clone())?;
            }
        }
        Ok(experiment.source.text.clone())
    }

    /// The path of the axis that varies what a path names in a chain, as the axis has it.
    pub fn axis_over(&self, chain: &str, path: &str) -> Option<&str> {
        let own = self.resolve(chain, path)?;
        let paths = self.axes.iter().flat_map(|axis| &axis.paths);
        paths.into_iter().find(|other| self.resolve(chain, other).as_ref() == Some(&own)).map(String::as_str)
    }

    /// What is replaced by what, in the order of the text.
    fn splices(&self, setting: &Setting) -> Result<Vec<(Range<usize>, String)>, Diagnostic> {
        let value = setting.value.origin.text();
        let axis = self.axes.iter().find(|axis| axis.paths == [setting.path.clone()]);
        if let Some(axis) = axis
            && let Some(Kind::Map(entries)) = self.root.field("sweep").map(|sweep| &sweep.kind)
            && let Some((_, values)) = entries.iter().find(|(key, _)| key.origin == axis.key)
        {
            return Ok(vec![(values.origin.range.clone(), format!("[{value}]"))]);
        }
        let mut places: Vec<Vec<String>> = Vec::new();
        for chain in &self.chain_names {
            if let Some(place) = self.resolve(chain, &setting.path)
                && !places.contains(&place)
            {
                places.push(place);
            }
        }
        if places.is_empty() {
            return Err(self.no_match(&setting.path, &setting.key));
        }
        let mut splices = places
            .iter()
            .map(|place| splice(&self.root, place, value).ok_or_else(|| self.no_match(&setting.path, &setting.key)))
            .collect::<Result<Vec<_>, _>>()?;
        splices.sort_by_key(|(range, _)| range.start);
        Ok(splices)
    }
}

/// The change that gives the node at a path another value.
fn splice(node: &Node, path: &[String], value: &str) -> Option<(Range<usize>, String)> {
    let Some((first, rest)) = path.split_first() else { return Some((node.origin.range.clone(), value.into())) };
    if node.name() == Some(first.as_str()) && node.field(first).is_none() {
        return splice(node, rest, value);
    }
    let end = node.origin.range.end;
    match &node.kind {
        Kind::Struct { fields, .. } => match fields.iter().find(|field| field.name == *first) {
            Some(field) => splice(&field.value, rest, value),
            None if rest.is_empty() => Some(added(node, fields, first, value)),
            None => None,
        },
        Kind::Leaf if node.name().is_some() && rest.is_empty() => Some((end..end, format!("({first}: {value})"))),
        Kind::Tuple { items, .. } if items.is_empty() && rest.is_empty() => {
            Some((end - 1..end - 1, format!("{first}: {value}")))
        }
        Kind::Tuple { items, .. } | Kind::List(items) => splice(items.get(first.parse::<usize>().ok()?)?, rest, value),
        Kind::Map(entries) => {
            let found = entries.iter().find(|(key, _)| key.origin.text().trim_matches('"') == first)?;
            splice(&found.1, rest, value)
        }
        Kind::Leaf => None,
    }
}

/// A field behind those that are written, on a line of its own if they are.
fn added(node: &Node, fields: &[Field], name: &str, value: &str) -> (Range<usize>, String) {
    let source = &node.origin.source.text;
    let Some(last) = fields.last() else {
        let end = node.origin.range.end - 1;
        return (end..end, format!("{name}: {value}"));
    };
    let end = last.value.origin.range.end;
    let before = &source[..last.origin.range.start];
    let line = &before[before.rfind('\n').map_or(0, |at| at + 1)..];
    let separator = if line.trim().is_empty() && before.contains('\n') { format!(",\n{line}") } else { ", ".into() };
    (end..end, format!("{separator}{name}: {value}"))
}

#[cfg(test)]
mod tests {
    use super::super::sweep::read_setting;
    use super::*;

    const TEXT: &str = r#"Experiment(
    // what is seen
    scene: (terrain: Shape(kind: Flat), camera: Still(
        eye: (0, 0, 9), // up there
    )),
    chains: {"a": [ViewGrid, Warp(rounds: 2), RayCast()], "b": [Warp]},
    sweep: {"*.Warp.sums": [Plain, Compensated]},
)"#;

    fn changed(settings: &[&str]) -> String {
        let experiment = Experiment::read(Source::new("test", TEXT), "".into()).unwrap();
        let settings: Vec<Setting> = settings.iter().map(|setting| read_setting(setting).unwrap()).collect();
        experiment.text_with(&settings).unwrap()
    }

    #[test]
    fn a_value_is_replaced_where_it_stands_and_the_rest_stays() {
        assert_eq!(changed(&["a.Warp.rounds=3"]), TEXT.replace("rounds: 2", "rounds: 3"));
        assert_eq!(changed(&["scene.terrain.kind=Ramp"]), TEXT.replace("Flat", "Ramp"));
        assert_eq!(changed(&["scene.camera.eye=(1, 2, 3)"]), TEXT.replace("(0, 0, 9)", "(1, 2, 3)"));
    }

    #[test]
    fn what_is_not_written_is_added() {
        assert_eq!(changed(&["a.ViewGrid.size=(8, 8)"]), TEXT.replace("[ViewGrid,", "[ViewGrid(size: (8, 8)),"));
        assert_eq!(changed(&["a.RayCast.x=1"]), TEXT.replace("RayCast()", "RayCast(x: 1)"));
        let two = changed(&["b.Warp.rounds=4", "b.Warp.uniform_share=0.5"]);
        assert_eq!(two, TEXT.replace("\"b\": [Warp]", "\"b\": [Warp(rounds: 4, uniform_share: 0.5)]"));
        let line = changed(&["scene.camera.pitch_deg=-3"]);
        assert_eq!(line, TEXT.replace("(0, 0, 9), // up", "(0, 0, 9),\n        pitch_deg: -3, // up"));
    }

    #[test]
    fn of_a_swept_path_the_axis_is_left_with_one_value() {
        assert_eq!(changed(&["*.Warp.sums=Plain"]), TEXT.replace("[Plain, Compensated]", "[Plain]"));
        let experiment = Experiment::read(Source::new("test", TEXT), "".into()).unwrap();
        assert_eq!(experiment.axis_over("b", "b.Warp.sums"), Some("*.Warp.sums"));
        assert_eq!(experiment.axis_over("b", "b.Warp.rounds"), None);
    }
}
