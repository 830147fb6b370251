//! Camera and time: the path's frames, or a flight by hand.

use egui::{Key, RichText, Sense, Ui, Vec2};
use glam::{DMat3, DVec3};

use crate::camera::Camera;
use crate::inspector::desk::{Action, Desk};
use crate::inspector::wish::{Moment, Shown, Side};

#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CameraPane {
    /// Metres a second; 0 is a hundredth of the terrain's side.
    speed: f64,
    #[serde(skip)]
    plays: bool,
}

impl Default for CameraPane {
    fn default() -> Self {
        Self { speed: 0.0, plays: false }
    }
}

impl CameraPane {
    pub fn ui(&mut self, ui: &mut Ui, desk: &mut Desk) {
        let Some(shown) = desk.shown(Side::A).cloned() else {
            ui.weak("nothing is shown yet");
            return;
        };
        self.path(ui, desk, &shown);
        ui.separator();
        self.flight(ui, desk, &shown);
        ui.separator();
        self.error(ui, desk, &shown);
    }

    fn path(&mut self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        let last = shown.frames.saturating_sub(1);
        let now = match shown.wish.moment {
            Moment::Frame(frame) => Some(frame),
            Moment::Live(_) => None,
        };
        let mut frame = now.unwrap_or(0);
        ui.horizontal(|ui| {
            ui.label("frame of the path");
            let before = frame;
            if ui.small_button("<").on_hover_text("the frame before").clicked() {
                frame = frame.saturating_sub(1);
            }
            ui.add(egui::Slider::new(&mut frame, 0..=last));
            if ui.small_button(">").on_hover_text("the next frame").clicked() {
                frame = (frame + 1).min(last);
            }
            ui.toggle_value(&mut self.plays, "play");
            if frame != before {
                desk.act(Action::Move(Moment::Frame(frame)));
            }
        });
        if self.plays && !desk.worker.is_busy() {
            let next = if frame >= last { 0 } else { frame + 1 };
            desk.act(Action::Move(Moment::Frame(next)));
            ui.ctx().request_repaint();
        }
    }

    fn flight(&mut self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        let extent_m = shown.prepared.data.ground.lattice().extent_m().max_element();
        if self.speed <= 0.0 {
            self.speed = extent_m / 100.0;
        }
        let mut flies = matches!(shown.wish.moment, Moment::Live(_));
        ui.horizontal(|ui| {
            if ui.checkbox(&mut flies, "fly by hand").changed() {
                let moment = if flies { Moment::Live(shown.camera) } else { Moment::Frame(0) };
                desk.act(Action::Move(moment));
            }
            let pace = self.speed / 50.0;
            ui.add(egui::DragValue::new(&mut self.speed).speed(pace).range(1e-3..=1e7).suffix(" m/s"));
        });
        let (rect, response) =
            ui.allocate_exact_size(Vec2::new(ui.available_width().min(320.0), 70.0), Sense::click_and_drag());
        ui.painter().rect_filled(rect, 4.0, ui.visuals().extreme_bg_color);
        let text = "drag here to look around; W A S D, Q and E move while the hand is here";
        ui.painter().text(
            rect.center(),
            egui::Align2::CENTER_CENTER,
            text,
            egui::FontId::proportional(10.0),
            ui.visuals().weak_text_color(),
        );
        let is_here = response.hovered() || response.dragged();
        if let Some(camera) = is_here.then(|| self.moved(ui, shown, &response)).flatten() {
            desk.act(Action::Move(Moment::Live(camera)));
        }
        self.numbers(ui, desk, shown);
    }

    /// The camera after what hand and keys have done since the frame before.
    fn moved(&self, ui: &Ui, shown: &Shown, response: &egui::Response) -> Option<Camera> {
        let camera = shown.camera;
        let drag = if response.dragged() { response.drag_delta() } else { Vec2::ZERO };
        let (keys, seconds) = ui.input(|input| {
            let down = |key| f64::from(u8::from(input.key_down(key)));
            let keys =
                DVec3::new(down(Key::D) - down(Key::A), down(Key::E) - down(Key::Q), down(Key::W) - down(Key::S));
            (keys, f64::from(input.stable_dt.min(0.1)))
        });
        if keys != DVec3::ZERO {
            ui.ctx().request_repaint();
        }
        if drag == Vec2::ZERO && keys == DVec3::ZERO {
            return None;
        }
        let forward = camera.forward();
        let per_pixel = 0.003;
        let yaw = forward.x.atan2(forward.y) + f64::from(drag.x) * per_pixel;
        let pitch = (forward.z.clamp(-1.0, 1.0).asin() - f64::from(drag.y) * per_pixel).clamp(-1.55, 1.55);
        let forward = DVec3::new(yaw.sin() * pitch.cos(), yaw.cos() * pitch.cos(), pitch.sin());
        let right = DVec3::new(yaw.cos(), -yaw.sin(), 0.0);
        let axes = DMat3::from_cols(right, right.cross(forward), forward);
        Some(Camera { eye_m: camera.eye_m + axes * keys * self.speed * seconds, world_from_view: axes, ..camera })
    }

    fn numbers(&self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        let camera = shown.camera;
        let mut eye = camera.eye_m;
        ui.horizontal(|ui| {
            ui.label("eye");
            for (part, name) in [(&mut eye.x, "east "), (&mut eye.y, "north "), (&mut eye.z, "up ")] {
                ui.add(egui::DragValue::new(part).speed(self.speed / 100.0).prefix(name).suffix(" m"));
            }
        });
        if eye != camera.eye_m {
            desk.act(Action::Move(Moment::Live(Camera { eye_m: eye, ..camera })));
        }
        let forward = camera.forward();
        let over_m = shown.prepared.data.ground.above_m(camera.eye_m);
        ui.small(format!(
            "looks {:.1} degrees from north and {:.1} above the horizon, from {over_m:.2} m above the ground",
            forward.x.atan2(forward.y).to_degrees().rem_euclid(360.0),
            forward.z.clamp(-1.0, 1.0).asin().to_degrees(),
        ));
        if ui.small_button("copy as RON").clicked() {
            let (eye, at) = (camera.eye_m, camera.eye_m + forward * 1000.0);
            let triple = |point: DVec3| format!("({}, {}, {})", point.x, point.y, point.z);
            ui.ctx().copy_text(format!("Still(eye: {}, look_at: {})", triple(eye), triple(at)));
        }
    }

    fn error(&self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        let mut truth = desk.truth;
        if ui.checkbox(&mut truth, "measure the error of each frame that is shown").changed() {
            desk.act(Action::Truth(truth));
        }
        let Some(truth) = &shown.truth else { return };
        egui::Grid::new("figures").num_columns(2).show(ui, |ui| {
            for figure in &truth.figures {
                ui.label(&figure.name);
                let value = figure.value.map_or("not measured".into(), |value| format!("{value:.6}"));
                ui.label(RichText::new(format!("{value} {}", figure.unit)).monospace());
                ui.end_row();
            }
        });
    }
}
