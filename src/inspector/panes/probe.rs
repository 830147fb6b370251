//! The place under the hand in everything that is shown, and places that were pinned.

use egui::{RichText, ScrollArea, Ui};

use crate::inspector::desk::Desk;

pub fn ui(ui: &mut Ui, desk: &mut Desk) {
    ui.small("point at a view: the same place is marked in all others; a click pins it");
    ScrollArea::both().id_salt("probe").auto_shrink(false).show(ui, |ui| {
        if let Some(probed) = &desk.probed {
            ui.label(RichText::new(probed.text()).monospace());
        }
        let mut gone = None;
        for (at, pin) in desk.pins.iter().enumerate() {
            ui.separator();
            ui.horizontal(|ui| {
                ui.strong(format!("pin {}", at + 1));
                if ui.small_button("copy").clicked() {
                    ui.ctx().copy_text(pin.text());
                }
                if ui.small_button("drop").clicked() {
                    gone = Some(at);
                }
            });
            ui.label(RichText::new(pin.text()).monospace());
        }
        if let Some(at) = gone {
            desk.pins.remove(at);
        }
    });
}
