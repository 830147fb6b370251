//! Meshes and maps over the ground: as a plane figure, from above, in the camera's picture, from any side.

use egui::{Color32, Pos2, Rect, Ui};
use glam::{DMat3, DVec2, DVec3};

use super::image::{Looked, area, cross, fitted, moved};
use super::paint::{What, painted};
use super::{Found, Orbit, View};
use crate::camera::Camera;
use crate::gpu::GpuError;
use crate::inspector::desk::{Action, Desk};
use crate::inspector::probe::Where;
use crate::inspector::wish::{Moment, Shown};
use crate::look::Form;
use crate::run::sight::{Seen, Sight, Style, Through};

impl View {
    pub(super) fn space(&mut self, ui: &mut Ui, desk: &mut Desk, found: &Found) {
        let Some(shown) = desk.shown(self.side).cloned() else { return };
        let (rect, response, pixels) = area(ui, 74.0);
        let find = |id| shown.companion(id);
        let sight = shown.sight(&find);
        let size = sight.whole(found.form, found.part).high;
        let all = fitted(if found.form == Form::View { rect } else { rect.shrink(8.0) }, size.x, size.y);
        let mut looked = Looked { rect, place: self.place.unwrap_or(all) };
        match found.form {
            Form::Orbit => self.turn(ui, &shown, &response),
            _ => {
                looked.place = moved(ui, &response, rect, looked.place, all);
                self.place = (looked.place != all).then_some(looked.place);
            }
        }
        let orbit = self.orbit.unwrap_or_else(|| default_orbit(&shown)).camera(rect);
        let through = sight.through(found.form, &looked.extent(), Some(&orbit));
        match self.paint_space(desk, found, (&shown, &sight), (&looked, &through), pixels) {
            Ok(()) => self.live.trouble = None,
            Err(error) => {
                self.live.trouble = Some(error.to_string());
                return;
            }
        }
        self.put_and_mark(ui, desk, found, &shown, (rect, &through));
        self.point_in_space(desk, found, &response, &looked);
        if response.clicked()
            && let Some(probed) = desk.probed.clone()
        {
            desk.pins.push(probed);
        }
        self.orbit_bar(ui, desk, &shown, found);
        self.legend(ui, desk, found);
    }

    fn paint_space<'a>(
        &mut self,
        desk: &Desk,
        found: &'a Found,
        (shown, sight): (&Shown, &Sight<'a>),
        (looked, through): (&Looked, &Through),
        pixels: (u32, u32),
    ) -> Result<(), GpuError> {
        let extent = looked.extent();
        let style = Style { lines: self.lines, filled: self.filled, tones: self.tones(found) };
        let key = format!("{:?} {:?} {:?} {through:?} {extent:?} {style:?}", self.of, found.form, found.channel);
        let what = What { frame: [shown.number; 2], key, is_costly: true };
        let seen = Seen { held: &found.held, channel: &found.channel, source: found.source };
        let [canvas, _] = &mut self.live.painted;
        painted(canvas, desk, pixels, what, |canvas| {
            sight.paint(&desk.gpu, canvas, &seen, found.form, (&extent, through), &style)
        })
    }

    /// Puts the canvas into the window, with the camera and the places that somebody points at.
    fn put_and_mark(&self, ui: &Ui, desk: &Desk, found: &Found, shown: &Shown, (rect, through): (Rect, &Through)) {
        let painter = ui.painter_at(rect);
        if let Some(painted) = &self.live.painted[0] {
            painter.add(painted.picture.filling(rect));
        }
        let size = DVec2::new(rect.width().into(), rect.height().into());
        let point = |world: DVec3| {
            let at = through.projection.pixel(world - through.origin_m, size)?;
            Some(rect.min + egui::vec2(at.x as f32, at.y as f32))
        };
        if matches!(found.form, Form::Above | Form::Orbit) {
            draw_frustum(&painter, shown, &point);
        }
        if found.form != Form::Figure {
            let marks = desk.pins.iter().map(|pin| (pin, Color32::YELLOW));
            let pointed = desk.pointer.as_ref().and(desk.probed.as_ref()).map(|probed| (probed, Color32::WHITE));
            for (probed, colour) in marks.chain(pointed) {
                if let Some(at) = probed.spot.ground_m.and_then(&point) {
                    cross(&painter, at, colour);
                }
            }
        }
    }

    fn point_in_space(&self, desk: &mut Desk, found: &Found, response: &egui::Response, looked: &Looked) {
        let Some(at) = response.hover_pos().filter(|_| response.hovered()) else { return };
        let [x, y] = looked.element_at(at);
        let place = match found.form {
            Form::Above => {
                let Some(shown) = desk.shown(self.side) else { return };
                let north_m = shown.prepared.data.ground.lattice().extent_m().y;
                Some(Where::Ground(DVec2::new(x, north_m - y)))
            }
            Form::View => Some(Where::Pixel(DVec2::new(x, y))),
            _ => None,
        };
        if let Some(place) = place {
            desk.pointer = Some((self.id, place));
        }
    }

    /// Turns the camera of the hand around what it looks at.
    fn turn(&mut self, ui: &Ui, shown: &Shown, response: &egui::Response) {
        let mut orbit = self.orbit.unwrap_or_else(|| default_orbit(shown));
        if response.double_clicked() {
            orbit = default_orbit(shown);
        }
        let drag = response.drag_delta();
        let is_moved = ui.input(|input| input.modifiers.shift)
            || response.dragged_by(egui::PointerButton::Secondary)
            || response.dragged_by(egui::PointerButton::Middle);
        if response.dragged() && is_moved {
            let yaw = orbit.yaw_deg.to_radians();
            let (right, ahead) = (DVec2::new(yaw.cos(), -yaw.sin()), DVec2::new(yaw.sin(), yaw.cos()));
            let by = (ahead * f64::from(drag.y) - right * f64::from(drag.x)) * orbit.distance_m / 600.0;
            orbit.target_m[0] += by.x;
            orbit.target_m[1] += by.y;
        } else if response.dragged() {
            orbit.yaw_deg += f64::from(drag.x) * 0.3;
            orbit.pitch_deg = (orbit.pitch_deg - f64::from(drag.y) * 0.3).clamp(-89.0, 89.0);
        }
        if response.hovered() {
            let scroll = ui.input(|input| input.smooth_scroll_delta().y);
            orbit.distance_m = (orbit.distance_m * f64::from(-scroll / 300.0).exp()).clamp(1e-3, 1e8);
        }
        self.orbit = (orbit != default_orbit(shown)).then_some(orbit);
    }

    fn orbit_bar(&self, ui: &mut Ui, desk: &mut Desk, shown: &Shown, found: &Found) {
        if found.form != Form::Orbit {
            return;
        }
        ui.horizontal(|ui| {
            ui.small("drag turns, shift and drag moves, the wheel goes nearer; the chain's camera stays where it is");
            if ui.small_button("give the chain this camera").clicked() {
                let orbit = self.orbit.unwrap_or_else(|| default_orbit(shown));
                let camera = orbit.camera(Rect::from_min_size(Pos2::ZERO, egui::vec2(1.0, 1.0)));
                let target = DVec3::from_array(orbit.target_m);
                let camera = Camera::looking_at(camera.eye_m, target, &shown.prepared.cell.scene);
                desk.act(Action::Move(Moment::Live(camera)));
            }
        });
    }
}

impl Orbit {
    /// The camera in a picture of a shape.
    pub fn camera(&self, rect: Rect) -> Camera {
        let (yaw, pitch) = (self.yaw_deg.to_radians(), self.pitch_deg.to_radians());
        let forward = DVec3::new(yaw.sin() * pitch.cos(), yaw.cos() * pitch.cos(), pitch.sin());
        let right = DVec3::new(yaw.cos(), -yaw.sin(), 0.0);
        let half_tan = 0.5;
        Camera {
            eye_m: DVec3::from_array(self.target_m) - forward * self.distance_m,
            world_from_view: DMat3::from_cols(right, right.cross(forward), forward),
            half_tan: DVec2::new(half_tan * f64::from(rect.width() / rect.height().max(1.0)), half_tan),
            viewport: (rect.width().max(1.0) as u32, rect.height().max(1.0) as u32),
        }
    }
}

/// From behind the chain's camera and above it.
fn default_orbit(shown: &Shown) -> Orbit {
    let camera = &shown.camera;
    let forward = camera.forward();
    let extent = shown.prepared.data.ground.lattice().extent_m();
    let ahead_m = extent.max_element() * 0.3;
    let target = camera.eye_m + DVec3::new(forward.x, forward.y, 0.0).normalize_or(DVec3::Y) * ahead_m;
    let ground = shown.prepared.data.ground.surface_at(target);
    Orbit {
        yaw_deg: forward.x.atan2(forward.y).to_degrees(),
        pitch_deg: -35.0,
        distance_m: ahead_m * 2.5,
        target_m: [ground.x, ground.y, ground.z],
    }
}

/// The eye of the chain's camera, and the edges of what it sees.
fn draw_frustum(painter: &egui::Painter, shown: &Shown, point: &dyn Fn(DVec3) -> Option<Pos2>) {
    let camera = &shown.camera;
    let (width, height) = (f64::from(camera.viewport.0), f64::from(camera.viewport.1));
    let far_m = shown.prepared.data.ground.lattice().extent_m().max_element() * 0.25;
    let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)];
    let far = corners.map(|(x, y)| point(camera.eye_m + camera.ray(DVec2::new(x, y)) * far_m));
    let stroke = egui::Stroke::new(1.5, Color32::from_rgb(255, 160, 40));
    let Some(eye) = point(camera.eye_m) else { return };
    for (at, corner) in far.iter().enumerate() {
        if let Some(corner) = corner {
            painter.line_segment([eye, *corner], stroke);
            if let Some(next) = far[(at + 1) % 4] {
                painter.line_segment([*corner, next], stroke);
            }
        }
    }
    painter.circle_filled(eye, 4.0, Color32::from_rgb(255, 160, 40));
}
