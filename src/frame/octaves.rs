//! The octaves over the ground, seen from the eye: `Octaves` of `kernels/ground/octaves.wgsl`.

use glam::I64Vec2;

use super::Block;
use crate::camera::Camera;
use crate::ground::octaves::Place;
use crate::ground::{Detailed, Ground, foreground};
use crate::kernel::FieldKind::{F32, I32, U32};

pub const BLOCK: Block = Block {
    name: "Octaves",
    fields: &[
        ("eye_cell", I32(2)),
        ("eye_high", U32(2)),
        ("eye_low", U32(2)),
        ("count", U32(1)),
        ("seed", U32(1)),
        ("amplitude_m", F32(1)),
        ("persistence", F32(1)),
        ("most_m", F32(1)),
        ("near", F32(1)),
        ("for_meshes", U32(1)),
        ("for_light", U32(1)),
    ],
    changes: true,
    fill: |frame, values| {
        let ground = frame.data.ground.as_ref();
        let origin = ground.detail().map_or(I64Vec2::ZERO, |detail| detail.octaves().origin);
        let eye = Place::new(ground.lattice().sample_from_world(frame.camera.eye_m.truncate()), origin);
        let high = (eye.fraction * 2f64.powi(32)).floor();
        let low = (eye.fraction * 2f64.powi(32) - high) * 2f64.powi(32);
        values
            // (cells are counted modulo 2^32: no terrain is so large)
            .add(eye.cell.to_array().map(|cell| cell as i32))
            .add(high.to_array().map(|high| high as u32))
            .add(low.to_array().map(|low| low as u32));
        let Some(detail) = ground.detail() else {
            values.add(0u32).add(0u32).add(0.0f32).add(0.0f32).add(0.0f32).add(0.0f32).add(0u32).add(0u32);
            return;
        };
        let octaves = detail.octaves();
        values
            .add(octaves.count())
            .add(octaves.seed)
            .add(octaves.amplitude_m as f32)
            .add(octaves.persistence as f32)
            .add((octaves.most_m() * WIDER) as f32)
            .add(near(&frame.camera) as f32)
            .add(for_meshes(detail, &frame.camera))
            .add(for_light(detail, &frame.camera));
    },
};

/// More than f32 takes from any sum of amplitudes, or from what is left of it.
const WIDER: f64 = 1.0 + 4e-6;

/// How near to the surface a ray has to come to have met it, in pixels: a fifth of what the ground truth is good to.
const NEAR_PX: f64 = 0.002;

/// The same in metres for each metre along the view direction.
pub fn near(camera: &Camera) -> f64 {
    NEAR_PX / camera.most_px()
}

/// What is lower than this many pixels, everywhere in view, is not put into a mesh.
const UNSEEN_PX: f64 = 0.25;

/// No surface is closer to an eye, in metres.
fn nearest_m(detail: &Detailed, camera: &Camera) -> f64 {
    foreground::least_distance_m(detail, camera.eye_m).max(camera.eye_m.z - detail.range_m().1)
}

/// Octaves of which meshes are made: those after them, all together, are nowhere in view higher than a quarter of a pixel.
pub fn for_meshes(detail: &Detailed, camera: &Camera) -> u32 {
    let nearest_m = nearest_m(detail, camera);
    let octaves = detail.octaves();
    let is_seen = |first: &u32| octaves.sum_after_m(*first) * camera.most_px() > UNSEEN_PX * nearest_m;
    (0..octaves.count()).take_while(is_seen).count() as u32
}

/// The octave with waves of two pixels, as the logarithm of cells over the size of a pixel at a depth in metres.
pub fn octave_of_pixels(cell_m: f64, camera: &Camera, depth_m: f64) -> f64 {
    (cell_m * camera.focal_px() / depth_m.max(1e-9)).log2()
}

/// Octaves that light pixels: those after them have no wave of more than two pixels anywhere in view. (Never by their height: they are as
/// steep as the others.)
pub fn for_light(detail: &Detailed, camera: &Camera) -> u32 {
    let depth_m = nearest_m(detail, camera) / camera.most_of(|ray| ray.length());
    let finest = octave_of_pixels(detail.lattice().cell_m.max_element(), camera, depth_m);
    (finest.ceil().max(0.0) as u32).min(detail.octaves().count())
}
