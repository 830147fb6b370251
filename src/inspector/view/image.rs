//! Elements as an image: nearest, moved and zoomed by hand, down to a value printed in each.

use egui::{Color32, Pos2, Rect, Sense, Ui, Vec2};

use super::paint::{What, painted};
use super::{Found, Mode, Place, View};
use crate::gpu::paint::Image;
use crate::inspector::ask::Ask;
use crate::inspector::desk::Desk;
use crate::inspector::probe::Where;
use crate::inspector::wish::Answer;
use crate::look::Form;
use crate::look::channel::Kind;
use crate::run::sight::Extent;

/// From so many points of the screen an element on, its value is printed in it.
const PRINTED: f64 = 44.0;
/// A flicker changes sides so often a second.
const FLICKERS: f64 = 1.5;

/// A rectangle of the screen, and the elements that are seen in it.
pub struct Looked {
    pub rect: Rect,
    pub place: Place,
}

impl Looked {
    pub fn element_at(&self, at: Pos2) -> [f64; 2] {
        let off = at - self.rect.center();
        let [x, y] = self.place.centre;
        [x + f64::from(off.x) / self.place.scale, y + f64::from(off.y) / self.place.scale]
    }

    pub fn point_of(&self, element: [f64; 2]) -> Pos2 {
        let off = |at: usize| ((element[at] - self.place.centre[at]) * self.place.scale) as f32;
        self.rect.center() + Vec2::new(off(0), off(1))
    }

    /// The part of the plane that is seen.
    pub fn extent(&self) -> Extent {
        let [low, high] = [self.rect.min, self.rect.max].map(|corner| self.element_at(corner).into());
        Extent { low, high }
    }

    /// Where the canvas' corner is, in elements, and elements a pixel of it.
    fn origin_and_step(&self, pixels_per_point: f32) -> ([f32; 2], [f32; 2]) {
        let [x, y] = self.element_at(self.rect.min);
        let step = (1.0 / self.place.scale) as f32 / pixels_per_point;
        ([x as f32, y as f32], [step; 2])
    }
}

/// The part of the view that is drawn on, in whole pixels.
pub fn area(ui: &mut Ui, height_left: f32) -> (Rect, egui::Response, (u32, u32)) {
    let scale = ui.pixels_per_point();
    let size = ui.available_size() - Vec2::new(0.0, height_left);
    let (rect, response) = ui.allocate_exact_size(size.max(Vec2::splat(16.0)), Sense::click_and_drag());
    let snap = |at: f32| (at * scale).round() / scale;
    let rect = Rect::from_min_max(
        Pos2::new(snap(rect.min.x), snap(rect.min.y)),
        Pos2::new(snap(rect.max.x), snap(rect.max.y)),
    );
    let pixels = (rect.size() * scale).round();
    (rect, response, (pixels.x.max(1.0) as u32, pixels.y.max(1.0) as u32))
}

/// Moves and zooms a plane by hand; a double click shows all of it.
pub fn moved(ui: &Ui, response: &egui::Response, rect: Rect, place: Place, all: Place) -> Place {
    let mut place = place;
    if response.double_clicked() {
        return all;
    }
    if response.dragged() {
        let drag = response.drag_delta();
        place.centre[0] -= f64::from(drag.x) / place.scale;
        place.centre[1] -= f64::from(drag.y) / place.scale;
    }
    if let Some(hover) = response.hover_pos() {
        let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
        let factor = f64::from(pinch) * f64::from(scroll / 200.0).exp();
        if factor != 1.0 {
            let looked = Looked { rect, place };
            let under = looked.element_at(hover);
            place.scale = (place.scale * factor).clamp(1e-9, 1e9);
            let now = Looked { rect, place }.element_at(hover);
            (0..2).for_each(|at| place.centre[at] += under[at] - now[at]);
        }
    }
    place
}

/// All of a plane of so many elements.
pub fn fitted(rect: Rect, columns: f64, rows: f64) -> Place {
    let scale = (f64::from(rect.width()) / columns).min(f64::from(rect.height()) / rows);
    Place { centre: [columns / 2.0, rows / 2.0], scale: scale.max(1e-9) }
}

impl View {
    pub(super) fn image(&mut self, ui: &mut Ui, desk: &mut Desk, found: &Found) {
        let is_picture = found.channel.kind == Kind::Colour && !self.is_difference(found);
        let told = if self.against == super::Against::F64 { 18.0 } else { 0.0 };
        let (rect, response, pixels) = area(ui, told + if is_picture { 18.0 } else { 74.0 });
        let all = fitted(rect, found.part.columns.into(), found.part.rows.into());
        let place = moved(ui, &response, rect, self.place.unwrap_or(all), all);
        // what fits stays fitted when the window changes
        self.place = (place != all).then_some(place);
        let beside = found.second.is_some() && self.mode == Mode::Beside;
        let looked = Looked { rect: if beside { halves(rect, ui.pixels_per_point())[0] } else { rect }, place };
        if let Err(error) = self.paint(desk, found, &looked, pixels, ui.pixels_per_point()) {
            self.live.trouble = Some(error.to_string());
            return;
        }
        self.live.trouble = None;
        self.put(ui, found, rect);
        if response.hovered()
            && let Some(at) = response.hover_pos()
        {
            let element = looked.element_at(at);
            let inside = (0.0..f64::from(found.part.columns)).contains(&element[0])
                && (0.0..f64::from(found.part.rows)).contains(&element[1]);
            desk.pointer = inside.then_some((self.id, Where::Element(element[0] as u32, element[1] as u32)));
        }
        if response.clicked()
            && let Some(probed) = desk.probed.clone()
        {
            desk.pins.push(probed);
        }
        let painter = ui.painter_at(rect);
        self.print_values(ui, desk, found, &looked);
        let second = beside.then(|| halves(rect, ui.pixels_per_point())[1].min - looked.rect.min);
        self.mark_pointed(&painter, desk, &looked, second);
        self.live.looked = Some(looked);
        self.legend(ui, desk, found);
    }

    fn paint(
        &mut self,
        desk: &Desk,
        found: &Found,
        looked: &Looked,
        pixels: (u32, u32),
        pixels_per_point: f32,
    ) -> Result<(), crate::gpu::GpuError> {
        let mut tones = self.tones(found);
        if self.marks && !self.is_difference(found) {
            tones.mark_above = self.threshold(desk, found);
        }
        let (origin, step) = looked.origin_and_step(pixels_per_point);
        let beside = found.second.is_some() && self.mode == Mode::Beside;
        let pixels = if beside { (pixels.0 / 2, pixels.1) } else { pixels };
        let second = found.second.as_ref().map(|(held, channel)| (held, channel));
        let minus = second.filter(|_| self.is_difference(found));
        let what = |which: usize| {
            let parts = (&self.of, &found.channel, found.part, origin, step, tones, self.against, self.mode);
            let frame = super::Side::BOTH.map(|side| desk.shown(side).map_or(0, |shown| shown.number));
            What { frame, key: format!("{which} {} {parts:?}", found.form.name()), is_costly: false }
        };
        let part = found.part;
        let first = Image { held: &found.held, channel: &found.channel, minus, part, origin, step, tones };
        let [first_canvas, second_canvas] = &mut self.live.painted;
        painted(first_canvas, desk, pixels, what(0), |canvas| desk.gpu.paint_image(canvas, &first))?;
        if let Some((held, channel)) = second.filter(|_| minus.is_none()) {
            let second = Image { held, channel, minus: None, ..first };
            painted(second_canvas, desk, pixels, what(1), |canvas| desk.gpu.paint_image(canvas, &second))?;
        }
        Ok(())
    }

    /// The value above which elements are listed, or are over what the chain promised.
    fn threshold(&self, desk: &Desk, found: &Found) -> Option<f32> {
        let shown = desk.shown(self.side)?;
        let listed = found.source.and_then(|id| shown.plan.known().listed_above(id));
        if let Some(above) = listed {
            return Some(above as f32);
        }
        let own = shown.prepared.measures.iter().find(|chosen| chosen.info.name == "ScreenError");
        let is_error = self.of == super::Of::ScreenError;
        own.filter(|_| is_error).and_then(|chosen| {
            let parameters: serde_json::Value = serde_json::from_str(&chosen.parameters).ok()?;
            parameters.get("threshold_px")?.as_f64().map(|threshold| threshold as f32)
        })
    }

    /// Puts the canvases into the window.
    fn put(&self, ui: &Ui, found: &Found, rect: Rect) {
        let painter = ui.painter_at(rect);
        // all of a picture in a rectangle, of which a part is seen
        let put = |which: usize, rect: Rect, part: Rect| {
            if let Some(painted) = &self.live.painted[which] {
                ui.painter_at(part).add(painted.picture.filling(rect));
            }
        };
        match (found.second.is_some(), self.mode) {
            (false, _) | (true, Mode::Difference) => put(0, rect, rect),
            (true, Mode::Second) => put(1, rect, rect),
            (true, Mode::Beside) => {
                let [left, right] = halves(rect, ui.pixels_per_point());
                put(0, left, left);
                put(1, right, right);
                painter.vline(right.min.x, rect.y_range(), (1.0, Color32::WHITE));
            }
            (true, Mode::Wipe) => {
                put(0, rect, rect);
                let at = rect.left() + rect.width() * self.wipe;
                put(1, rect, Rect::from_min_max(Pos2::new(at, rect.top()), rect.max));
                painter.vline(at, rect.y_range(), (1.0, Color32::WHITE));
            }
            (true, Mode::Flicker) => {
                let time = ui.input(|input| input.time);
                put(usize::from((time * FLICKERS * 2.0) as u64 % 2 == 1), rect, rect);
                ui.ctx().request_repaint_after(std::time::Duration::from_secs_f64(0.5 / FLICKERS));
            }
        }
    }

    /// The digits of each element, where there is room for them.
    fn print_values(&mut self, ui: &Ui, desk: &mut Desk, found: &Found, looked: &Looked) {
        if looked.place.scale < PRINTED {
            return;
        }
        let clamp = |at: f64, most: u32| at.floor().clamp(0.0, f64::from(most.saturating_sub(1))) as u32;
        let ([left, top], [right, bottom]) = (looked.element_at(looked.rect.min), looked.element_at(looked.rect.max));
        let (first, last) = (
            (clamp(left, found.part.columns), clamp(top, found.part.rows)),
            (clamp(right, found.part.columns), clamp(bottom, found.part.rows)),
        );
        let rows = self.live.rows.of(desk, found, self.side, first, last);
        let Some(rows) = rows else { return };
        let painter = ui.painter_at(looked.rect);
        let words = found.held.about.elem.components() as usize;
        for row in first.1..=last.1 {
            for column in first.0..=last.0 {
                let Some(element) = rows.words(column, row, words) else { continue };
                let at = looked.point_of([f64::from(column) + 0.5, f64::from(row) + 0.5]);
                let text = found.channel.text(element);
                let font = egui::FontId::monospace((looked.place.scale as f32 / 6.0).clamp(8.0, 14.0));
                for (off, colour) in [(1.0, Color32::BLACK), (0.0, Color32::WHITE)] {
                    let at = at + Vec2::splat(off);
                    painter.text(at, egui::Align2::CENTER_CENTER, &text, font.clone(), colour);
                }
            }
        }
    }

    /// The element that is at the place where somebody points in another view, and those that are pinned; beside each other, in both.
    fn mark_pointed(&self, painter: &egui::Painter, desk: &Desk, looked: &Looked, second: Option<Vec2>) {
        let mark = |probed: &crate::inspector::probe::Probed, colour: Color32| {
            let Some(line) = probed.lines.iter().find(|line| line.view == self.id) else { return };
            let at = looked.point_of([f64::from(line.element.0) + 0.5, f64::from(line.element.1) + 0.5]);
            cross(painter, at, colour);
            second.into_iter().for_each(|off| cross(painter, at + off, colour));
        };
        desk.pins.iter().for_each(|pin| mark(pin, Color32::YELLOW));
        if desk.pointer.is_some()
            && let Some(probed) = &desk.probed
        {
            mark(probed, Color32::WHITE);
        }
    }
}

/// A cross with a dark rim, which is seen on every colour.
pub fn cross(painter: &egui::Painter, at: Pos2, colour: Color32) {
    for (width, colour) in [(3.0, Color32::BLACK), (1.0, colour)] {
        painter.line_segment([at - Vec2::new(7.0, 0.0), at + Vec2::new(7.0, 0.0)], (width, colour));
        painter.line_segment([at - Vec2::new(0.0, 7.0), at + Vec2::new(0.0, 7.0)], (width, colour));
    }
}

/// Left and right of a rectangle, as wide as each other and of whole pixels.
fn halves(rect: Rect, pixels_per_point: f32) -> [Rect; 2] {
    let width = (rect.width() * pixels_per_point / 2.0 + 0.01).floor() / pixels_per_point;
    let size = Vec2::new(width, rect.height());
    [Rect::from_min_size(rect.min, size), Rect::from_min_size(Pos2::new(rect.max.x - width, rect.min.y), size)]
}

/// What is printed or stands in a table is asked for by rows.
pub(super) fn ask_rows(desk: &mut Desk, found: &Found, first: (u32, u32), last: (u32, u32)) -> u64 {
    let held = &found.held;
    let row = if found.form == Form::Levels { found.part.row } else { 0 };
    let elements = (last.1 - first.1) * held.stride + (last.0 - first.0) + 1;
    desk.ask(Ask::Bytes { held: held.clone(), at: (first.0, first.1 + row), elements })
}

pub(super) fn bytes_of(answer: Answer) -> Option<Vec<u8>> {
    match answer {
        Answer::Bytes(Ok(bytes)) => Some(bytes),
        _ => None,
    }
}
