//! What kernels are told of a frame, made when the frame comes.
//!
//! A *block* is a WGSL structure and a function that fills it for one frame. A kernel that has the structure among its parameters gets it.
//! Frames come from a path, which is known ahead, or one by one from a camera that somebody flies.

mod camera;
mod foreground;
mod motion;
pub mod octaves;
pub mod projector;
mod pyramid;
pub mod relief;
mod terrain;
pub mod view;
pub mod visible_ground;

use glam::DVec3;

use crate::camera::Camera;
use crate::kernel::{FieldKind, Value};
use crate::scene::{self, SceneData, Views};

/// One frame: all that its parameters depend on.
#[derive(Clone, Copy, Debug)]
pub struct FrameInput<'a> {
    pub data: &'a SceneData,
    pub camera: Camera,
    /// The way of the eye since the first frame in metres, and what the camera has turned in radians.
    pub travelled_m: f64,
    pub turned: f64,
    /// The frame before is not what was there a moment ago: nothing of it counts.
    pub is_cut: bool,
}

impl<'a> FrameInput<'a> {
    /// A frame of the path; `None` beyond its end, or if there is no path.
    pub fn of_path(data: &'a SceneData, frame: usize) -> Option<Self> {
        let Views::Path(path) = &data.views else { return None };
        let camera = *path.cameras.get(frame)?;
        let (travelled_m, turned) = (path.travelled_m[frame], path.turned[frame]);
        Some(Self { data, camera, travelled_m, turned, is_cut: false })
    }

    /// For what is the same in all frames: the camera is any.
    pub fn of_scene(data: &'a SceneData) -> Self {
        Self::first(data, Camera::looking_at(DVec3::ZERO, DVec3::Y, &data.scene))
    }

    /// A camera that comes by itself.
    pub fn first(data: &'a SceneData, camera: Camera) -> Self {
        Self { data, camera, travelled_m: 0.0, turned: 0.0, is_cut: true }
    }

    /// The camera that comes after this one.
    pub fn next(&self, camera: Camera) -> Self {
        let travelled_m = self.travelled_m + self.camera.eye_m.distance(camera.eye_m);
        let turned = self.turned + scene::turn(&self.camera, &camera);
        Self { camera, travelled_m, turned, is_cut: false, ..*self }
    }
}

/// A WGSL structure that is filled for each frame, or once.
#[derive(Debug)]
pub struct Block {
    /// The structure's name in WGSL.
    pub name: &'static str,
    /// Its fields, those of structures in it with dots.
    pub fields: &'static [(&'static str, FieldKind)],
    /// What it says depends on the frame, and not only on the scene.
    pub changes: bool,
    /// One value for each field, in their order.
    pub fill: fn(&FrameInput, &mut Filled),
}

/// The values of a block as they are stated.
#[derive(Clone, Debug, Default)]
pub struct Filled(Vec<Value>);

impl Filled {
    /// The value of the next field.
    pub fn add(&mut self, value: impl Into<Value>) -> &mut Self {
        self.0.push(value.into());
        self
    }
}

/// All blocks. One that is added here can be used by every kernel, a user's too.
pub const BLOCKS: &[Block] = &[
    camera::BLOCK,
    view::BLOCK,
    terrain::BLOCK,
    projector::BLOCK,
    motion::BLOCK,
    relief::BLOCK,
    pyramid::BLOCK,
    foreground::BLOCK,
    octaves::BLOCK,
    visible_ground::BLOCK,
];

/// The block of a WGSL structure.
pub fn block(name: &str) -> Option<&'static Block> {
    BLOCKS.iter().find(|block| block.name == name)
}

impl Block {
    /// Its values in one frame, in the order of its fields.
    pub fn values(&self, frame: &FrameInput) -> Vec<Value> {
        let mut filled = Filled::default();
        (self.fill)(frame, &mut filled);
        filled.0
    }
}

impl PartialEq for Block {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}
