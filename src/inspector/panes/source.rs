//! The text of a kernel, with the line at which it does not compile.

use egui::{Color32, ComboBox, RichText, ScrollArea, Ui};

use crate::experiment::diagnostic::{Diagnostic, Source};
use crate::inspector::desk::Desk;
use crate::inspector::wish::Side;
use crate::kernel::Kernel;

#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct SourcePane {
    /// The kernel's name.
    pub kernel: String,
}

impl SourcePane {
    pub fn ui(&mut self, ui: &mut Ui, desk: &Desk, refused: Option<&Diagnostic>) {
        let Some(shown) = desk.shown(Side::A) else {
            ui.weak("nothing is shown yet");
            return;
        };
        let mut kernels: Vec<&Kernel> = Vec::new();
        for run in shown.plan.steps.iter().filter_map(|step| step.run()) {
            if kernels.iter().all(|known| known.name != run.kernel.name) {
                kernels.push(&run.kernel);
            }
        }
        ComboBox::from_id_salt("kernel").selected_text(&self.kernel).height(500.0).show_ui(ui, |ui| {
            for kernel in &kernels {
                ui.selectable_value(&mut self.kernel, kernel.name.clone(), &kernel.name);
            }
        });
        let Some(kernel) = kernels.iter().find(|kernel| kernel.name == self.kernel).or(kernels.first()) else {
            ui.weak("no kernel runs");
            return;
        };
        let main = &kernel.assembled.main;
        // a text that does not compile is newer than the one that runs
        let broken = refused.and_then(|error| {
            let (origin, label) = error.labels.first()?;
            (origin.source.name == main.name).then(|| (origin.clone(), label.clone(), error.message.clone()))
        });
        ui.small(&main.name);
        match &broken {
            Some((origin, label, message)) => {
                ui.colored_label(Color32::LIGHT_RED, format!("{message}: {label}"));
                ui.weak("what is shown was made by the last text that compiled");
                text(ui, &origin.source, Some(origin.line_column().0));
            }
            None => text(ui, main, None),
        }
    }
}

fn text(ui: &mut Ui, source: &Source, marked: Option<usize>) {
    let lines: Vec<&str> = source.text.lines().collect();
    let height = ui.text_style_height(&egui::TextStyle::Monospace);
    let mut area = ScrollArea::both().id_salt("source").auto_shrink(false);
    if let Some(marked) = marked {
        area = area.vertical_scroll_offset((marked.saturating_sub(6)) as f32 * (height + ui.spacing().item_spacing.y));
    }
    area.show_rows(ui, height, lines.len(), |ui, range| {
        for at in range {
            let text = RichText::new(format!("{:>4}  {}", at + 1, lines[at])).monospace();
            let text = match (marked == Some(at + 1), lines[at].trim_start().starts_with("//")) {
                (true, _) => text.background_color(Color32::from_rgb(110, 30, 30)).color(Color32::WHITE),
                (false, true) => text.color(Color32::from_rgb(120, 150, 120)),
                _ => text,
            };
            ui.add(egui::Label::new(text).extend());
        }
    });
}
