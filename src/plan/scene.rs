//! The scene that a plan is made for, in memory.

use std::sync::Arc;

use glam::UVec2;

use crate::camera::Camera;
use crate::experiment::scene::Scene;
use crate::terrain::HeightField;

/// A scene with its terrain in memory and the cameras of all frames.
#[derive(Clone, Debug)]
pub struct SceneData {
    pub scene: Scene,
    pub terrain: Arc<HeightField>,
    pub cameras: Vec<Camera>,
    /// Lowest and highest height of the terrain in metres.
    pub range_m: (f64, f64),
    /// The terrain in at most 16 x 16 parts, each with its own lowest and highest height.
    pub parts: Vec<Part>,
    /// A frame's eye is under the surface or outside the terrain, so that rays can run under the surface.
    pub sees_underside: bool,
}

/// Samples `columns.0..=columns.1`, `rows.0..=rows.1` and their height range in metres.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub columns: (u32, u32),
    pub rows: (u32, u32),
    pub low_m: f32,
    pub high_m: f32,
}

/// Parts a side.
const PARTS: u32 = 16;

fn parts(terrain: &HeightField) -> Vec<Part> {
    let last = terrain.size - UVec2::ONE;
    let count = last.min(UVec2::splat(PARTS));
    let cut = |at: u32, last: u32, count: u32| (last * at / count, last * (at + 1) / count);
    let mut parts = Vec::new();
    for y in 0..count.y {
        for x in 0..count.x {
            let (columns, rows) = (cut(x, last.x, count.x), cut(y, last.y, count.y));
            let heights = (rows.0..=rows.1).flat_map(|row| {
                let start = (row * terrain.size.x) as usize;
                &terrain.heights_m[start + columns.0 as usize..=start + columns.1 as usize]
            });
            let (low_m, high_m) = heights.fold((f32::MAX, f32::MIN), |(low, high), &h| (low.min(h), high.max(h)));
            parts.push(Part { columns, rows, low_m, high_m });
        }
    }
    parts
}

impl SceneData {
    pub fn new(scene: Scene, terrain: Arc<HeightField>) -> Self {
        let cameras = crate::camera::path(&scene, &terrain);
        let extent_m = terrain.extent_m();
        let sees_underside = cameras.iter().any(|camera| {
            let ground = camera.eye_m.truncate();
            ground.cmplt(glam::DVec2::ZERO).any()
                || ground.cmpgt(extent_m).any()
                || camera.eye_m.z < terrain.surface_m(ground, scene.surface)
        });
        Self { range_m: terrain.range_m(), parts: parts(&terrain), scene, terrain, cameras, sees_underside }
    }

    /// The frames that measures look at, as one hash: cameras in f64, viewport and surface.
    pub fn fingerprint(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for camera in &self.cameras {
            let numbers = camera.world_from_view.to_cols_array().into_iter();
            let numbers = numbers.chain(camera.eye_m.to_array()).chain(camera.half_tan.to_array());
            numbers.for_each(|number| {
                hasher.update(&number.to_le_bytes());
            });
            hasher.update(&camera.viewport.0.to_le_bytes());
            hasher.update(&camera.viewport.1.to_le_bytes());
        }
        hasher.update(&[self.scene.surface as u8]);
        hasher.finalize().to_hex().as_str()[..32].to_string()
    }

    /// The steepest slope of the surface, as a tangent.
    pub fn steepest(&self) -> f64 {
        self.terrain.steepest(self.scene.surface)
    }

    /// Every height is the same.
    pub fn is_flat(&self) -> bool {
        self.range_m.0 == self.range_m.1
    }
}
