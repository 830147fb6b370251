//! Values over their numbers.

use egui::Ui;
use egui_plot::{Line, Plot, PlotPoints};

use super::{Found, View};
use crate::inspector::desk::Desk;
use crate::look::channel::Number;

/// So many values are drawn at most, from the first on.
const MOST: u32 = 1 << 16;

impl View {
    pub(super) fn plot(&mut self, ui: &mut Ui, desk: &mut Desk, found: &Found) {
        let (columns, rows) = found.held.size();
        let elements = (columns * rows).min(MOST);
        if elements == 0 {
            ui.weak("the list is empty");
            return;
        }
        let words = found.held.about.elem.components() as usize;
        let block = self.live.rows.of(desk, found, self.side, (0, 0), (elements - 1, 0));
        let Some(block) = block else { return };
        let value = |at: u32| match found.channel.number(block.words(at, 0, words)?) {
            Number::Is(value) if value.is_finite() => Some([f64::from(at), value]),
            _ => None,
        };
        let points: PlotPoints = (0..elements).filter_map(value).collect();
        if elements < columns * rows {
            ui.weak(format!("the first {elements} of {}", columns * rows));
        }
        Plot::new(("plot", self.id)).x_axis_label("number").y_axis_label(found.held.about.unit).show(ui, |plot| {
            plot.line(Line::new(&found.channel.name, points));
        });
    }
}
