//! Every parameter of the scene and of every stage and measure, with its default, its range and its meaning: all from where the registry has them.

use std::collections::BTreeMap;
use std::rc::Rc;

use egui::{Color32, ComboBox, DragValue, RichText, ScrollArea, Ui};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::{Parameter, ParameterKind, describe};
use crate::experiment::scene;
use crate::experiment::tree::Node;
use crate::inspector::desk::{Action, Desk};
use crate::inspector::wish::{Shown, Side};
use crate::{measure, stages};

#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct ParametersPane {
    pub side: Side,
    /// Texts that are being written, by path.
    #[serde(skip)]
    written: BTreeMap<String, String>,
    /// What the registries say, by stage, part of the scene and measure: made once, since the window is drawn again and again.
    #[serde(skip)]
    described: BTreeMap<String, Rc<[Parameter]>>,
    save_as: String,
}

/// A group of parameters: a stage, a measure, a part of the scene.
struct Group<'a> {
    title: String,
    path: String,
    parameters: Rc<[Parameter]>,
    node: Option<&'a Node>,
}

impl ParametersPane {
    pub fn ui(&mut self, ui: &mut Ui, desk: &mut Desk, refused: Option<&Diagnostic>) {
        if desk.compares {
            ui.horizontal(|ui| {
                for (side, name) in Side::BOTH.into_iter().zip(["A", "B"]) {
                    ui.selectable_value(&mut self.side, side, name);
                }
            });
        }
        let Some(shown) = desk.shown(self.side).cloned() else {
            ui.weak("nothing is shown yet");
            return;
        };
        self.document_bar(ui, desk, &shown);
        if let Some(error) = refused {
            ui.colored_label(Color32::LIGHT_RED, RichText::new(error.to_string()).monospace());
            ui.weak("what is shown is what was right before");
        }
        ScrollArea::both().id_salt("parameters").auto_shrink(false).show(ui, |ui| {
            for group in self.groups(&shown) {
                if group.parameters.is_empty() {
                    continue;
                }
                egui::CollapsingHeader::new(&group.title).id_salt(&group.path).default_open(true).show(ui, |ui| {
                    egui::Grid::new(("parameters", &group.path)).num_columns(3).show(ui, |ui| {
                        for parameter in group.parameters.iter() {
                            self.parameter(ui, desk, &shown, &group, parameter);
                            ui.end_row();
                            let path = path_of(&shown, &format!("{}.{}", group.path, parameter.name));
                            if let Some(error) = refused.filter(|error| is_about(error, &path)) {
                                ui.label("");
                                let text = format!("{}: {}", error.message, error.labels[0].1);
                                ui.colored_label(Color32::LIGHT_RED, RichText::new(text).small());
                                ui.end_row();
                            }
                        }
                    });
                });
            }
        });
    }

    fn document_bar(&mut self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        let document = &shown.wish.document;
        ui.horizontal_wrapped(|ui| {
            ui.small(document.path.display().to_string());
            ui.small(match document.changed.len() {
                0 => "as it was read".to_string(),
                count => format!("{count} changed"),
            });
            if !document.changed.is_empty() {
                let all: Vec<String> =
                    document.changed.iter().map(|(path, value)| format!("--set '{path}={value}'")).collect();
                if ui.small_button("reset all").on_hover_text(all.join("\n")).clicked() {
                    self.written.clear();
                    desk.act(Action::Reset { side: self.side, path: None });
                }
                if ui.small_button("copy as RON").clicked() {
                    match document.text() {
                        Ok(text) => ui.ctx().copy_text(text),
                        Err(error) => desk.act(Action::Say(Err(error))),
                    }
                }
                if self.save_as.is_empty() {
                    let stem = document.path.file_stem().unwrap_or_default().to_string_lossy();
                    self.save_as = document.path.with_file_name(format!("{stem}_changed.ron")).display().to_string();
                }
                ui.add(egui::TextEdit::singleline(&mut self.save_as).desired_width(180.0).hint_text("save as"));
                if ui.small_button("save").clicked() {
                    desk.act(Action::SaveAs(self.save_as.clone().into()));
                }
            }
        });
    }

    fn parameter(&mut self, ui: &mut Ui, desk: &mut Desk, shown: &Shown, group: &Group, parameter: &Parameter) {
        let path = path_of(shown, &format!("{}.{}", group.path, parameter.name));
        let written = group.node.and_then(|node| node.field(&parameter.name)).map(|node| node.canonical());
        let value = written.clone().or(parameter.default.clone()).unwrap_or_default();
        let is_changed = shown.wish.document.changed.contains_key(&path);
        let name = RichText::new(&parameter.name);
        let name = if is_changed { name.color(Color32::from_rgb(255, 190, 90)) } else { name };
        let default = parameter.default.as_ref().map_or("has to be given".into(), |value| format!("default {value}"));
        let range = parameter.range.as_ref().map_or(String::new(), |range| format!(", {range}"));
        let label = ui.label(name).on_hover_text(format!("{}\n{default}{range}\n{path}", parameter.meaning));
        if let Some(new) = self.widget(ui, parameter, (&path, label.id), &value) {
            desk.act(Action::Set { side: self.side, path: path.clone(), value: new });
        }
        ui.horizontal(|ui| {
            if is_changed && ui.small_button("reset").clicked() {
                self.written.remove(&path);
                desk.act(Action::Reset { side: self.side, path: Some(path.clone()) });
            }
            ui.small(RichText::new(format!("{default}{range}")).weak());
        });
    }

    /// A way to change a value; the new one, if it was changed.
    fn widget(
        &mut self,
        ui: &mut Ui,
        parameter: &Parameter,
        (path, label): (&str, egui::Id),
        value: &str,
    ) -> Option<String> {
        match parameter.kind {
            ParameterKind::Flag => {
                let mut on = value == "true";
                ui.checkbox(&mut on, "").labelled_by(label).changed().then(|| on.to_string())
            }
            ParameterKind::Choice => {
                let mut chosen = value.to_string();
                let combo = ComboBox::from_id_salt(path).selected_text(value).show_ui(ui, |ui| {
                    for (name, meaning) in &parameter.choices {
                        ui.selectable_value(&mut chosen, name.clone(), name).on_hover_text(meaning);
                    }
                });
                combo.response.labelled_by(label);
                (chosen != value).then_some(chosen)
            }
            ParameterKind::Numbers { count, is_whole, limits } => {
                let numbers: Vec<f64> = value
                    .trim_matches(|letter| letter == '(' || letter == ')')
                    .split(',')
                    .filter_map(|part| part.trim().parse().ok())
                    .collect();
                if numbers.len() != count {
                    return self.text(ui, (path, label), value);
                }
                let mut new = numbers.clone();
                ui.horizontal(|ui| {
                    for number in &mut new {
                        let speed = if is_whole { 0.25 } else { number.abs().max(1e-3) / 100.0 };
                        let low = limits.least.or(limits.above).unwrap_or(f64::NEG_INFINITY);
                        let range = low..=limits.most.unwrap_or(f64::INFINITY);
                        let mut drag = DragValue::new(number).speed(speed).range(range).update_while_editing(false);
                        if is_whole {
                            drag = drag.fixed_decimals(0);
                        }
                        ui.add(drag).labelled_by(label);
                    }
                });
                let text = |number: &f64| if is_whole { format!("{number:.0}") } else { number.to_string() };
                let texts: Vec<String> = new.iter().map(text).collect();
                let joined = if count == 1 { texts[0].clone() } else { format!("({})", texts.join(",")) };
                (new != numbers).then_some(joined)
            }
            ParameterKind::Other => self.text(ui, (path, label), value),
        }
    }

    fn groups<'a>(&mut self, shown: &'a Shown) -> Vec<Group<'a>> {
        let cell = &shown.prepared.cell;
        let mut groups = Vec::new();
        for (at, call) in cell.stages.iter().enumerate() {
            let number = cell.stages[..=at].iter().filter(|other| other.name == call.name).count();
            let title = if number == 1 { call.name.clone() } else { format!("{}#{number}", call.name) };
            let path = format!("{}.{title}", cell.chain);
            let parameters = self.described(&call.name, || {
                stages::find(&call.name).map(|entry| describe(&(entry.info.parameters)())).unwrap_or_default()
            });
            groups.push(Group { title, path, parameters, node: Some(&call.node) });
        }
        for (part, node) in scene::parts(&cell.scene_node) {
            let title = format!("{} {}", part.path, part.name);
            let parameters = self.described(&title, || own_parameters(part));
            groups.push(Group { title, path: part.path.into(), parameters, node });
        }
        for call in &cell.measures {
            let path = format!("measure.{}", call.name);
            let parameters = self.described(&path, || {
                let info = measure::REGISTRY.iter().find(|info| info.name == call.name);
                info.map(|info| describe(&(info.parameters)())).unwrap_or_default()
            });
            groups.push(Group { title: format!("measure {}", call.name), path, parameters, node: Some(&call.node) });
        }
        groups
    }

    fn described(&mut self, of: &str, describe: impl FnOnce() -> Vec<Parameter>) -> Rc<[Parameter]> {
        if let Some(known) = self.described.get(of) {
            return known.clone();
        }
        let described: Rc<[Parameter]> = describe().into();
        self.described.insert(of.to_string(), described.clone());
        described
    }

    /// RON by hand, taken over by enter.
    fn text(&mut self, ui: &mut Ui, (path, label): (&str, egui::Id), value: &str) -> Option<String> {
        let text = self.written.entry(path.to_string()).or_insert_with(|| value.to_string());
        let edit = egui::TextEdit::singleline(text).desired_width(220.0).code_editor().id_salt(path);
        let response = ui.add(edit).labelled_by(label);
        let is_done = response.lost_focus() && text.as_str() != value;
        if !response.has_focus() && !is_done {
            *text = value.to_string();
        }
        is_done.then(|| text.clone())
    }
}

/// A mistake in the value that a change gave.
fn is_about(error: &Diagnostic, path: &str) -> bool {
    error.labels.first().is_some_and(|(origin, _)| origin.source.text.split('=').next() == Some(path))
}

/// The parameters of a part of the scene; the scene's own parts have groups of their own.
fn own_parameters(part: &scene::Part) -> Vec<Parameter> {
    let is_part = |name: &str| scene::PARTS.iter().any(|part| part.path.strip_prefix("scene.") == Some(name));
    let all = describe(&(part.parameters)()).into_iter();
    all.filter(|parameter| part.path != "scene" || !is_part(&parameter.name)).collect()
}

/// The path that a change has: that of the axis which varies it, if there is one.
fn path_of(shown: &Shown, path: &str) -> String {
    let chain = &shown.wish.cell.chain;
    let chain = if chain.is_empty() { &shown.prepared.cell.chain } else { chain };
    shown.experiment.axis_over(chain, path).unwrap_or(path).to_string()
}
