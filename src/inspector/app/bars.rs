//! What stands above the tiles, to choose cells and frames, and what stands below them, to be told.

use egui::{Color32, RichText, Ui};

use super::layout::default_layout;
use super::{App, Moment};
use crate::inspector::view::Of;
use crate::inspector::wish::{CellName, Side};

impl App {
    pub(super) fn top(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            if ui.button("experiments").clicked() {
                self.wanted.iter_mut().for_each(|wanted| wanted.document = None);
            }
            if self.wanted[0].document.is_none() {
                return;
            }
            for (side, name) in Side::BOTH.into_iter().zip(["A", "B"]) {
                if side == Side::B && !self.desk.compares {
                    continue;
                }
                self.cells(ui, side, name);
            }
            let mut compares = self.desk.compares;
            if ui.checkbox(&mut compares, "compare two cells").changed() {
                self.desk.compares = compares;
                if compares {
                    self.wanted[1].document = self.wanted[0].document.clone();
                    self.wanted[1].cell = self.wanted[0].cell.clone();
                }
            }
            ui.checkbox(&mut self.desk.in_f64, "f64 of every stage")
                .on_hover_text("each stage's reference, given what its kernels were given");
            ui.checkbox(&mut self.desk.truth, "ground truth");
            ui.checkbox(&mut self.times, "time the steps");
            if let Some(shown) = self.desk.shown(Side::A).cloned() {
                let last = shown.frames.saturating_sub(1);
                if self.desk.compares {
                    let second = &mut self.wanted[1].frame;
                    let mut apart = second.is_some();
                    let own = if let Moment::Frame(frame) = self.moment { frame } else { 0 };
                    if ui.checkbox(&mut apart, "B at").on_hover_text("another frame on the second side").changed() {
                        *second = apart.then_some(own);
                    }
                    if let Some(frame) = second {
                        ui.add(egui::DragValue::new(frame).range(0..=last).speed(0.1));
                    }
                }
                if let Moment::Frame(frame) = self.moment {
                    let mut frame = frame.min(last);
                    if last > 0 && ui.add(egui::Slider::new(&mut frame, 0..=last).text("frame")).changed() {
                        self.moment = Moment::Frame(frame);
                    }
                }
            }
            if ui.button("new view").clicked() {
                let of = self.views_mut().last().map(|view| view.of.clone()).unwrap_or(Of::TruthPicture);
                self.see(Side::A, of, true);
            }
            if ui.button("usual layout").clicked() {
                self.layout = default_layout();
            }
        });
    }

    fn cells(&mut self, ui: &mut Ui, side: Side, name: &str) {
        let label = |cell: &CellName| crate::experiment::label(&cell.chain, &cell.settings);
        let wanted = &mut self.wanted[side as usize];
        let text = format!("{name}: {}", label(&wanted.cell));
        egui::ComboBox::from_id_salt(("cell", name)).selected_text(text).width(280.0).truncate().height(600.0).show_ui(
            ui,
            |ui| {
                let Some(shown) = &self.desk.shown[side as usize] else { return };
                for cell in &shown.cells {
                    ui.selectable_value(&mut wanted.cell, cell.clone(), label(cell));
                }
            },
        );
    }

    fn progress(&self, ui: &mut Ui) {
        match &self.working {
            Some((what, share)) if self.desk.worker.is_busy() => {
                ui.spinner();
                ui.label(what);
                if let Some(share) = share {
                    ui.add(egui::ProgressBar::new(*share).desired_width(160.0));
                }
                if ui.button("cancel").clicked() {
                    self.desk.worker.cancel();
                }
            }
            _ => {
                ui.weak(&self.desk.gpu.summary.name);
            }
        }
    }

    pub(super) fn bottom(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            // whether something works or not, nothing else moves
            ui.set_min_height(ui.spacing().interact_size.y + 4.0);
            self.progress(ui);
        });
        for side in Side::BOTH {
            if let Some(error) = &self.wanted[side as usize].refused {
                ui.colored_label(Color32::LIGHT_RED, RichText::new(error.to_string()).monospace().size(10.5));
                ui.weak("what is shown is what was right before");
            }
        }
        let notes = self.desk.shown(Side::A).map(|shown| shown.notes.clone()).unwrap_or_default();
        notes.iter().for_each(|note| {
            ui.colored_label(Color32::from_rgb(255, 190, 90), note);
        });
        match &self.said {
            Some(Ok(text)) => {
                ui.label(text);
            }
            Some(Err(error)) => {
                ui.colored_label(Color32::LIGHT_RED, RichText::new(error.to_string()).monospace().size(10.5));
            }
            None => {}
        }
    }
}
