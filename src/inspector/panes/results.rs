//! A finished run: error against time, its table, and the cell behind a point.

use std::path::PathBuf;

use egui::{RichText, ScrollArea, Ui};
use egui_plot::{GridMark, MarkerShape, Plot, PlotPoints, Points};

use crate::experiment::diagnostic::Diagnostic;
use crate::inspector::desk::{Action, Desk};
use crate::inspector::wish::{CellName, Side};
use crate::report::folders;
use crate::report::records::Record;
use crate::report::table;

#[derive(Default)]
pub struct ResultsPane {
    folder: String,
    records: Vec<Record>,
    error: Option<Diagnostic>,
    chosen: Option<usize>,
    picture: Option<(String, egui::TextureHandle)>,
    /// Where the point of each cell is in the window.
    points: Vec<(usize, egui::Pos2)>,
}

/// Lines at 1, 2 and 5 of each decade, where there is room for them.
fn marks(input: egui_plot::GridInput) -> Vec<GridMark> {
    let (from, to) = input.bounds;
    let decades = (from.floor() as i32).max(-300)..=(to.ceil() as i32).min(300);
    let each: &[f64] = match to - from {
        span if span < 1.0 => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        span if span < 6.0 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let mark = |decade: i32, digit: f64| GridMark { value: f64::from(decade) + digit.log10(), step_size: 1.0 };
    decades.flat_map(|decade| each.iter().map(move |digit| mark(decade, *digit))).collect()
}

impl ResultsPane {
    /// The cell that was chosen.
    pub fn chosen(&self) -> Option<&Record> {
        self.chosen.and_then(|at| self.records.get(at))
    }

    /// The cells that the plot has, and where.
    pub fn points(&self) -> Vec<(&Record, egui::Pos2)> {
        self.points.iter().map(|(at, point)| (&self.records[*at], *point)).collect()
    }

    /// Reads the records of a folder.
    pub fn open(&mut self, folder: &std::path::Path) {
        self.folder = folder.display().to_string();
        self.chosen = None;
        self.picture = None;
        match folders::read(&[folder.to_path_buf()]) {
            Ok(found) => {
                self.error = None;
                self.records = found.results.records;
            }
            Err(error) => self.error = Some(error),
        }
    }

    pub fn ui(&mut self, ui: &mut Ui, desk: &mut Desk) {
        ui.horizontal(|ui| {
            ui.label("folder");
            ui.add(egui::TextEdit::singleline(&mut self.folder).desired_width(240.0).hint_text("out/quickstart"));
            if ui.button("open").clicked() {
                desk.act(Action::OpenResults(PathBuf::from(&self.folder)));
            }
        });
        if let Some(error) = &self.error {
            ui.colored_label(egui::Color32::LIGHT_RED, error.to_string());
        }
        if self.records.is_empty() {
            ui.weak("a folder of results is what `lodlab run` leaves: open one to see error against time");
            return;
        }
        ScrollArea::vertical().id_salt("results").auto_shrink(false).show(ui, |ui| {
            self.plot(ui);
            self.cell(ui, desk);
        });
    }

    /// Mean error over the time of the method, both as logarithms, since the plot has no other way to show them.
    fn plot(&mut self, ui: &mut Ui) {
        let place = |record: &Record| {
            let (time, error) = (record.method_ms()?, record.measure("error_mean")?);
            (time > 0.0 && error > 0.0).then(|| [time.log10(), error.log10()])
        };
        let places: Vec<(usize, [f64; 2])> =
            self.records.iter().enumerate().filter_map(|(at, record)| Some((at, place(record)?))).collect();
        let label = |mark: GridMark| {
            let value = 10f64.powf(mark.value);
            // a rounded logarithm leads back to a rounded value
            if (1e-3..1e4).contains(&value) {
                format!("{}", (value * 1e6).round() / 1e6)
            } else {
                format!("{value:.0e}")
            }
        };
        let mut chains: Vec<&str> = self.records.iter().map(|record| record.head.chain.as_str()).collect();
        chains.dedup();
        let chosen = self.chosen;
        let response = Plot::new("results")
            .height(260.0)
            .legend(egui_plot::Legend::default())
            .x_axis_label("ms of the method")
            .y_axis_label("mean error, px")
            .x_grid_spacer(marks)
            .y_grid_spacer(marks)
            .x_axis_formatter(move |mark, _| label(mark))
            .y_axis_formatter(move |mark, _| label(mark))
            .show(ui, |plot| {
                for chain in &chains {
                    let own =
                        places.iter().filter(|(at, _)| self.records[*at].head.chain == **chain).map(|(_, at)| *at);
                    plot.points(Points::new(*chain, own.collect::<PlotPoints>()).radius(5.0));
                }
                if let Some((_, at)) = places.iter().find(|(at, _)| Some(*at) == chosen) {
                    let mark = Points::new("chosen", vec![*at]).radius(9.0).filled(false).shape(MarkerShape::Circle);
                    plot.points(mark);
                }
                plot.response().clicked().then(|| plot.pointer_coordinate()).flatten().map(|at| {
                    let bounds = plot.plot_bounds();
                    let off = |place: &[f64; 2]| {
                        ((place[0] - at.x) / bounds.width()).hypot((place[1] - at.y) / bounds.height())
                    };
                    places.iter().min_by(|a, b| off(&a.1).total_cmp(&off(&b.1))).map(|(at, _)| *at)
                })
            });
        let on_screen =
            |at: &[f64; 2]| response.transform.position_from_point(&egui_plot::PlotPoint::new(at[0], at[1]));
        self.points = places.iter().map(|(at, place)| (*at, on_screen(place))).collect();
        if let Some(Some(at)) = response.inner {
            self.choose(at);
        }
        let left_out = self.records.len() - places.len();
        if left_out > 0 {
            ui.weak(format!("{left_out} cells have no error or no time, or an error of 0, and are not in the plot"));
        }
    }

    pub fn choose(&mut self, at: usize) {
        self.chosen = Some(at);
        self.picture = None;
    }

    fn cell(&mut self, ui: &mut Ui, desk: &mut Desk) {
        let columns = table::columns(&self.records);
        let rows = table::rows(&columns, &self.records);
        egui::Grid::new("records").striped(true).show(ui, |ui| {
            for name in table::header(&columns) {
                ui.small(RichText::new(name).strong());
            }
            ui.end_row();
            for (at, row) in rows.iter().enumerate() {
                for (column, text) in row.iter().enumerate() {
                    let is_chosen = self.chosen == Some(at);
                    match column {
                        0 => {
                            if ui.selectable_label(is_chosen, text).clicked() {
                                self.chosen = Some(at);
                                self.picture = None;
                            }
                        }
                        _ => {
                            ui.small(text);
                        }
                    }
                }
                ui.end_row();
            }
        });
        let Some(record) = self.chosen.and_then(|at| self.records.get(at)).cloned() else { return };
        ui.separator();
        ui.horizontal(|ui| {
            ui.strong(record.label());
            if ui.button("show this cell").clicked() {
                let cell = CellName { chain: record.head.chain.clone(), settings: record.head.settings.clone() };
                desk.act(Action::Choose { side: Side::A, cell });
            }
        });
        ui.small(format!("{} on {} ({})", record.head.hash, record.head.adapter.name, record.head.adapter.driver));
        self.show_picture(ui, &record);
        egui::Grid::new("figures of a cell").num_columns(2).show(ui, |ui| {
            for figure in &record.measures {
                ui.small(&figure.name);
                ui.small(figure.value.map_or("not measured".into(), |value| format!("{value} {}", figure.unit)));
                ui.end_row();
            }
        });
        record.warnings.iter().for_each(|warning| {
            ui.colored_label(egui::Color32::from_rgb(255, 190, 90), warning);
        });
    }

    fn show_picture(&mut self, ui: &mut Ui, record: &Record) {
        if self.picture.as_ref().is_none_or(|(hash, _)| *hash != record.head.hash) {
            let path = PathBuf::from(&self.folder).join(format!("pictures/{}_image.png", record.head.hash));
            let Ok(picture) = image::open(&path) else { return };
            let rgba = picture.to_rgba8();
            let size = [rgba.width() as usize, rgba.height() as usize];
            let picture = egui::ColorImage::from_rgba_unmultiplied(size, rgba.as_raw());
            let texture = ui.ctx().load_texture(&record.head.hash, picture, egui::TextureOptions::LINEAR);
            self.picture = Some((record.head.hash.clone(), texture));
        }
        if let Some((_, texture)) = &self.picture {
            let width = ui.available_width().min(480.0);
            ui.add(egui::Image::new(texture).max_width(width));
        }
    }
}
