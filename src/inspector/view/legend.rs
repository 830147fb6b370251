//! What the colours of a view mean: the range, how many values there are of each, and what is no number.

use egui::{Color32, Pos2, Rect, Ui, Vec2};

use super::{Against, Found, Of, View, f64_of};
use crate::inspector::desk::Desk;
use crate::look::channel::Kind;

/// Six digits, without zeros at the end.
fn digits(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e7).contains(&size) {
        return format!("{value:.4e}");
    }
    let whole = if size >= 1.0 { size.log10().floor() as usize + 1 } else { 1 };
    let text = format!("{value:.*}", 6usize.saturating_sub(whole));
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

impl View {
    pub(super) fn legend(&mut self, ui: &mut Ui, desk: &Desk, found: &Found) {
        self.pointed(ui, desk);
        if found.channel.kind == Kind::Colour && !self.is_difference(found) {
            return;
        }
        self.by_reference(ui, desk);
        let Some(seen) = &self.live.seen else { return };
        let tones = self.tones(found);
        let width = ui.available_width().min(420.0);
        let (rect, _) = ui.allocate_exact_size(Vec2::new(width, 34.0), egui::Sense::hover());
        let painter = ui.painter_at(rect);
        let most = seen.histogram.iter().copied().max().unwrap_or(1).max(1) as f32;
        let bins = seen.histogram.len().max(1);
        let each = rect.width() / bins as f32;
        for (at, &count) in seen.histogram.iter().enumerate() {
            let share = (at as f64 + 0.5) / bins as f64;
            // the histogram's range is that of the values, the colours' can have its middle at zero
            let [r, g, b] = tones.colours.at(tones.scaled.share(seen.scaled.value(share)));
            let left = rect.left() + at as f32 * each;
            let strip = Rect::from_min_max(Pos2::new(left, rect.bottom() - 8.0), Pos2::new(left + each, rect.bottom()));
            painter.rect_filled(strip, 0.0, Color32::from_rgb(r, g, b));
            // a root, so that rare values are seen beside frequent ones
            let height = 24.0 * (count as f32 / most).sqrt();
            let bar = Rect::from_min_max(
                Pos2::new(left, rect.bottom() - 9.0 - height),
                Pos2::new(left + each, rect.bottom() - 9.0),
            );
            painter.rect_filled(bar, 0.0, Color32::from_gray(150));
        }
        let unit = found.held.about.unit;
        let statistics = &seen.statistics;
        let number = |value: Option<f64>| value.map_or("none".into(), digits);
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 10.0;
            let [low, high] = [tones.scaled.low, tones.scaled.high].map(|value| digits(value.into()));
            ui.small(format!("colours {low} to {high} {unit}"));
            let [low, high] = [statistics.lowest, statistics.highest].map(|value| number(value.map(f64::from)));
            ui.small(format!("lowest {low}, highest {high}, mean {}", number(statistics.mean)));
            let loud = [
                (statistics.missing, "missing", Color32::from_gray(150)),
                (statistics.nan, "NaN", Color32::from_rgb(255, 80, 255)),
                (statistics.infinite, "infinite", Color32::from_rgb(255, 120, 80)),
                (statistics.minus_infinite, "-infinite", Color32::from_rgb(80, 200, 255)),
            ];
            for (count, name, colour) in loud.into_iter().filter(|(count, ..)| *count > 0) {
                ui.small(egui::RichText::new(format!("{count} {name}")).color(colour));
            }
        });
    }

    /// How far kernels are from their reference, which has a bound for each value.
    fn by_reference(&self, ui: &mut Ui, desk: &Desk) {
        let (Against::F64, Of::Buffer(name)) = (self.against, &self.of) else { return };
        let Some(found) = desk.shown(self.side).and_then(|shown| f64_of(shown, name)) else { return };
        let difference = &found.difference;
        let colour = if difference.beyond > 0 { Color32::LIGHT_RED } else { Color32::from_rgb(150, 200, 130) };
        let text = format!(
            "{} values compared with f64: {} beyond their bounds, largest difference {:.3e} ({:.2} of its bound); {} undecided",
            difference.compared,
            difference.beyond,
            difference.largest,
            difference.largest_of_bound,
            difference.undecided
        );
        ui.small(egui::RichText::new(text).color(colour));
    }

    /// The value under the hand, or at the place where it is in another view.
    fn pointed(&self, ui: &mut Ui, desk: &Desk) {
        let line = desk
            .pointer
            .as_ref()
            .and(desk.probed.as_ref())
            .and_then(|probed| probed.lines.iter().find(|line| line.view == self.id));
        let text = line.map_or(String::new(), |line| {
            let numbers: Vec<String> = line.numbers.iter().map(|(name, text)| format!("{name} {text}")).collect();
            format!("row {}, column {}: {}", line.element.1, line.element.0, numbers.join(", "))
        });
        ui.add(egui::Label::new(egui::RichText::new(text).monospace().size(10.5)).truncate());
    }
}

#[cfg(test)]
mod tests {
    use super::digits;

    #[test]
    fn numbers_have_six_digits_and_no_idle_zeros() {
        let texts = [0.0, 1.0, -0.125, 1.0 / 3.0, 123.456789, 2.5e-9, 7.25e11].map(digits);
        assert_eq!(texts, ["0", "1", "-0.125", "0.33333", "123.457", "2.5000e-9", "7.2500e11"]);
    }
}
