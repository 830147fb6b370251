//! The experiments that ship, each with a line on what there is to see.

use std::path::{Path, PathBuf};

use egui::{RichText, ScrollArea, Ui};

use crate::experiment::regular;
use crate::inspector::desk::{Action, Desk};

/// An experiment file and the first line of what is said about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Shipped {
    pub path: PathBuf,
    pub about: String,
}

#[derive(Clone, Debug, Default)]
pub struct ExperimentsPane {
    found: Option<Vec<Shipped>>,
    path: String,
}

impl ExperimentsPane {
    pub fn ui(&mut self, ui: &mut Ui, desk: &mut Desk) {
        let found = self.found.get_or_insert_with(|| shipped(&folder()));
        ui.horizontal(|ui| {
            ui.label("file");
            ui.add(egui::TextEdit::singleline(&mut self.path).desired_width(320.0).hint_text("experiments/my.ron"));
            if ui.button("open").clicked() && !self.path.is_empty() {
                desk.act(Action::Open(self.path.clone().into()));
            }
        });
        ui.separator();
        if found.is_empty() {
            ui.weak("there is no folder `experiments` here; open a file by its path");
        }
        ScrollArea::vertical().id_salt("experiments").auto_shrink(false).show(ui, |ui| {
            for experiment in found.iter() {
                let name = experiment.path.display().to_string();
                if ui.link(RichText::new(&name).strong()).clicked() {
                    desk.act(Action::Open(experiment.path.clone()));
                }
                ui.label(&experiment.about);
                ui.add_space(4.0);
            }
        });
    }
}

/// Where the experiments are: here, or where lodlab was built.
fn folder() -> PathBuf {
    let here = PathBuf::from("experiments");
    if here.is_dir() { here } else { Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments") }
}

/// The experiments of a folder and of those in it, the quickstart first.
pub fn shipped(folder: &Path) -> Vec<Shipped> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
            match path.extension().is_some_and(|kind| kind == "ron") {
                true => found.push(Shipped { about: about(&path), path }),
                false if path.is_dir() => folders.push(path),
                false => {}
            }
        }
    }
    let is_first = |path: &Path| path.file_stem().is_some_and(|stem| stem == "quickstart");
    found.sort_by_key(|shipped| (!is_first(&shipped.path), shipped.path.components().count(), shipped.path.clone()));
    found
}

/// The comment at the top of a file.
fn about(path: &Path) -> String {
    let text = regular::read_to_string(path).unwrap_or_default();
    let lines = text.lines().take_while(|line| line.starts_with("//"));
    lines.map(|line| line.trim_start_matches('/').trim()).collect::<Vec<_>>().join(" ")
}
