//! The choices above a view.

use egui::{ComboBox, Ui};

use super::{Against, Found, Mode, Of, View};
use crate::inspector::ask::Ask;
use crate::inspector::desk::{Action, Desk};
use crate::inspector::wish::{Shown, Side};
use crate::look::{Colours, Form, Range, Scale};
use crate::plan::step_names;

impl View {
    pub(super) fn bar(&mut self, ui: &mut Ui, desk: &mut Desk) {
        let Some(shown) = desk.shown(self.side).cloned() else { return };
        ui.horizontal_wrapped(|ui| {
            self.choose_buffer(ui, desk, &shown);
            if let Ok(found) = self.found(desk) {
                self.choose_form(ui, &found);
                self.choose_numbers(ui, &found);
                self.choose_second(ui, desk);
                self.export(ui, desk, &found);
            }
        });
        if let Ok(found) = self.found(desk) {
            let about = &found.held.about;
            let unit = if about.unit.is_empty() { String::new() } else { format!(" [{}]", about.unit) };
            let (columns, rows) = found.held.size();
            ui.weak(format!("{}{unit}, {columns} x {rows}, {:?}", about.meaning, about.elem));
        }
    }

    fn choose_buffer(&mut self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        if desk.compares {
            for side in Side::BOTH {
                ui.selectable_value(&mut self.side, side, if side == Side::A { "A" } else { "B" });
            }
        }
        let (name, step) = match &self.of {
            Of::Buffer(name) => match name.split_once('@') {
                Some((buffer, step)) => (buffer.to_string(), Some(step.to_string())),
                None => (name.clone(), None),
            },
            other => (other.name().to_string(), None),
        };
        let mut chosen: Option<Of> = None;
        let combo = ComboBox::from_id_salt(("buffer", self.id)).selected_text(&name).height(500.0);
        let response = combo.show_ui(ui, |ui| {
            for buffer in names(shown) {
                if ui.selectable_label(buffer == name, &buffer).clicked() {
                    chosen = Some(Of::Buffer(buffer));
                }
            }
            ui.separator();
            for of in [Of::TruthPicture, Of::TruthDistance, Of::ScreenError] {
                if ui.selectable_label(self.of == of, of.name()).clicked() {
                    chosen = Some(of);
                }
            }
        });
        response.response.on_hover_text("which buffer");
        if matches!(self.of, Of::Buffer(_)) {
            let text = step.clone().unwrap_or_else(|| "at the end".into());
            ComboBox::from_id_salt(("step", self.id)).selected_text(text).height(500.0).show_ui(ui, |ui| {
                if ui.selectable_label(step.is_none(), "at the end").clicked() {
                    chosen = Some(Of::Buffer(name.clone()));
                }
                for after in writers(shown, &name) {
                    if ui.selectable_label(step.as_ref() == Some(&after), format!("after {after}")).clicked() {
                        chosen = Some(Of::Buffer(format!("{name}@{after}")));
                    }
                }
            });
        }
        if let Some(of) = chosen {
            let same = of.name().split('@').next() == Some(&name);
            match same {
                // another step of the same buffer is seen as this one is
                true => self.of = of,
                false => self.turn_to(self.side, of),
            }
        }
    }

    fn choose_form(&mut self, ui: &mut Ui, found: &Found) {
        if found.forms.len() < 2 {
            return;
        }
        for &form in &found.forms {
            if ui.selectable_label(form == found.form, form.name()).clicked() {
                self.form = Some(form);
                self.place = None;
            }
        }
        if found.form == Form::Levels {
            let levels = found.held.about.spread.levels(found.held.about.top_level);
            let text = levels.get(self.level).map_or(String::new(), |level| format!("level {}", level.level));
            ComboBox::from_id_salt(("level", self.id)).selected_text(text).show_ui(ui, |ui| {
                for (at, level) in levels.iter().enumerate() {
                    let text = format!("level {}: {} x {}", level.level, level.columns, level.rows);
                    if ui.selectable_label(at == self.level, text).clicked() {
                        (self.level, self.place) = (at, None);
                    }
                }
            });
        }
        if found.form.is_in_space() || found.form == Form::Figure {
            ui.checkbox(&mut self.lines, "lines");
            ui.checkbox(&mut self.filled, "filled");
        }
    }

    fn choose_numbers(&mut self, ui: &mut Ui, found: &Found) {
        if found.channels.len() > 1 {
            let text = found.channel.name.clone();
            ComboBox::from_id_salt(("channel", self.id)).selected_text(text).show_ui(ui, |ui| {
                for (at, channel) in found.channels.iter().enumerate() {
                    ui.selectable_value(&mut self.channel, Some(at), &channel.name);
                }
            });
        }
        ui.menu_button("colours", |ui| self.colours_menu(ui));
    }

    fn colours_menu(&mut self, ui: &mut Ui) {
        ui.label("map");
        ui.selectable_value(&mut self.colours, None, "as usual");
        for colours in Colours::ALL {
            ui.selectable_value(&mut self.colours, Some(colours), format!("{colours:?}"));
        }
        ui.separator();
        ui.label("range");
        ui.selectable_value(&mut self.range, Range::Auto, "lowest to highest");
        ui.selectable_value(&mut self.range, Range::Percentile, "1st to 99th percentile");
        let manual = match (self.range, &self.live.seen) {
            (Range::Manual(low, high), _) => (low, high),
            (_, Some(seen)) => (seen.scaled.low, seen.scaled.high),
            _ => (0.0, 1.0),
        };
        ui.horizontal(|ui| {
            let (mut low, mut high) = manual;
            let speed = f64::from((high - low).abs()).max(1e-6) / 200.0;
            let mut changed = ui.add(egui::DragValue::new(&mut low).speed(speed)).changed();
            ui.label("to");
            changed |= ui.add(egui::DragValue::new(&mut high).speed(speed)).changed();
            if changed || ui.selectable_label(matches!(self.range, Range::Manual(..)), "by hand").clicked() {
                self.range = Range::Manual(low, high);
            }
        });
        ui.separator();
        ui.label("scale");
        for (scale, name) in Scale::ALL.into_iter().zip(["linear", "logarithm", "symmetric logarithm"]) {
            ui.selectable_value(&mut self.scale, scale, name);
        }
        ui.separator();
        ui.checkbox(&mut self.marks, "mark what is over its threshold");
    }

    fn choose_second(&mut self, ui: &mut Ui, desk: &mut Desk) {
        let names = [
            (Against::Nothing, "nothing"),
            (Against::F64, "f64"),
            (Against::Other, "the other side"),
            (Against::Truth, "ground truth"),
        ];
        let text = names.iter().find(|(against, _)| *against == self.against).map_or("", |(_, name)| name);
        let text = if self.against == Against::Nothing { "compare".to_string() } else { format!("against {text}") };
        ComboBox::from_id_salt(("against", self.id)).selected_text(text).show_ui(ui, |ui| {
            for (against, name) in names {
                if against == Against::Other && !desk.compares {
                    continue;
                }
                ui.selectable_value(&mut self.against, against, name);
            }
        });
        match self.against {
            Against::F64 if !desk.in_f64 => desk.act(Action::InF64(true)),
            Against::Truth if !desk.truth => desk.act(Action::Truth(true)),
            _ => {}
        }
        if self.against != Against::Nothing {
            ComboBox::from_id_salt(("mode", self.id)).selected_text(self.mode.name()).show_ui(ui, |ui| {
                for mode in Mode::ALL {
                    ui.selectable_value(&mut self.mode, mode, mode.name());
                }
            });
            if self.mode == Mode::Wipe {
                ui.add(egui::Slider::new(&mut self.wipe, 0.0..=1.0).show_value(false).text("wipe"));
            }
        }
    }

    fn export(&self, ui: &mut Ui, desk: &mut Desk, found: &Found) {
        ui.menu_button("export", |ui| {
            let stem = self.of.name().replace(['/', ' ', ':', '@', '#'], "_");
            for kind in ["npy", "csv"] {
                let path = format!("{stem}.{kind}");
                if ui.button(format!("values as {path}")).clicked() {
                    desk.ask(Ask::Export { held: found.held.clone(), path: path.into() });
                    ui.close();
                }
            }
            let painted = self.live.painted[0].as_ref();
            if let Some(painted) = painted.filter(|_| ui.button(format!("picture as {stem}.png")).clicked()) {
                desk.ask(Ask::Picture { canvas: painted.canvas.clone(), path: format!("{stem}.png").into() });
                ui.close();
            }
        });
    }
}

/// The buffers of a chain by name, in the order in which they are made.
pub fn names(shown: &Shown) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for buffer in shown.run_plan.buffers.iter().filter(|buffer| !buffer.name.contains('@')) {
        if !names.contains(&buffer.name) {
            names.push(buffer.name.clone());
        }
    }
    names
}

/// The steps after which a buffer is another one than before.
pub fn writers(shown: &Shown, buffer: &str) -> Vec<String> {
    let plan = &shown.run_plan;
    let names = step_names(&plan.steps);
    let writes = |at: &usize| {
        let step = &plan.steps[*at];
        step.run().is_some() && step.writes.iter().any(|id| plan.buffer(*id).name == buffer)
    };
    (0..plan.steps.len()).filter(writes).map(|at| names[at].clone()).collect()
}
