//! A scene in memory: the ground, what is uploaded of it, and the cameras that look at it.

use std::sync::Arc;

use glam::{DVec3, UVec2};

use crate::camera::{self, Camera};
use crate::experiment::scene::Scene;
use crate::ground::{Ground, foreground};
use crate::kernel::{Elem, Packing};
use crate::terrain::{ColourMap, HeightField, TypeMap};

/// Everything about a scene that a plan is made for.
#[derive(Clone, Debug)]
pub struct SceneData {
    pub scene: Scene,
    pub ground: Arc<dyn Ground>,
    /// What kernels read that no kernel makes.
    pub inputs: Vec<Input>,
    pub views: Views,
    /// An eye can be under the surface or outside the terrain, so that rays can run under the surface.
    pub sees_underside: bool,
    /// An eye can be so close to the surface that kernels need the formulas of the cells around it.
    pub has_foreground: bool,
}

/// The cameras that a plan has to do for.
#[derive(Clone, Debug)]
pub enum Views {
    /// The frames of a path, in order.
    Path(Path),
    /// Wherever somebody may fly: nothing is known beforehand.
    Any,
}

/// Cameras, and how far each is from the first along the path.
#[derive(Clone, Debug)]
pub struct Path {
    pub cameras: Vec<Camera>,
    /// The way of the eye in metres, and what the camera has turned in radians. From one frame to any other it is at most the difference.
    pub travelled_m: Vec<f64>,
    pub turned: Vec<f64>,
}

impl Path {
    pub fn new(cameras: Vec<Camera>) -> Self {
        let sums = |motion: fn(&Camera, &Camera) -> f64| {
            let mut sum = 0.0;
            let steps = cameras.windows(2).map(|pair| motion(&pair[0], &pair[1]));
            let sums = std::iter::once(0.0).chain(steps).map(|step| {
                sum += step;
                sum
            });
            sums.collect()
        };
        Self { travelled_m: sums(|a, b| a.eye_m.distance(b.eye_m)), turned: sums(turn), cameras }
    }
}

/// The angle in radians between two cameras.
pub fn turn(a: &Camera, b: &Camera) -> f64 {
    let between = a.world_from_view.transpose() * b.world_from_view;
    let trace = between.x_axis.x + between.y_axis.y + between.z_axis.z;
    // next to no turn, the cosine has no digits: the sine has
    let axis = DVec3::new(
        between.y_axis.z - between.z_axis.y,
        between.z_axis.x - between.x_axis.z,
        between.x_axis.y - between.y_axis.x,
    );
    (axis.length() / 2.0).atan2((trace - 1.0) / 2.0)
}

/// A map over the ground that is uploaded before anything runs. Row 0 is north.
#[derive(Clone, Debug)]
pub struct Input {
    /// What kernels and `--dump` call it.
    pub name: &'static str,
    pub elem: Elem,
    pub packing: Packing,
    /// Columns and rows.
    pub size: UVec2,
    pub unit: &'static str,
    pub meaning: &'static str,
    pub source: InputSource,
}

/// Where the bytes of an input are.
#[derive(Clone, Debug)]
pub enum InputSource {
    Heights(Arc<HeightField>),
    Colours(Arc<ColourMap>),
    Types(Arc<TypeMap>),
}

/// The input that the ground's samples are.
pub const HEIGHT: &str = "height";
/// The input that is a colour for each place.
pub const COLOUR_MAP: &str = "colour_map";
/// The input that is the number of a surface type for each sample; a stage may make it as well.
pub const SURFACE_TYPE: &str = "surface_type";

impl Input {
    pub fn heights(field: Arc<HeightField>) -> Self {
        Self {
            name: HEIGHT,
            elem: Elem::F32,
            packing: Packing::None,
            size: field.size,
            unit: "m",
            meaning: "height samples, row 0 is north",
            source: InputSource::Heights(field),
        }
    }

    pub fn colours(map: Arc<ColourMap>) -> Self {
        Self {
            name: COLOUR_MAP,
            elem: Elem::U32,
            packing: Packing::Bytes,
            size: map.size,
            unit: "",
            meaning: "colour of the ground, red in the lowest byte; row 0 is north",
            source: InputSource::Colours(map),
        }
    }

    pub fn types(map: Arc<TypeMap>) -> Self {
        Self {
            name: SURFACE_TYPE,
            elem: Elem::U32,
            packing: Packing::None,
            size: map.size,
            unit: "",
            meaning: "number of what lies on the ground, row 0 is north",
            source: InputSource::Types(map),
        }
    }

    /// It has an element for each of the terrain's samples.
    pub fn is_of_samples(&self) -> bool {
        !matches!(self.source, InputSource::Colours(_))
    }

    pub fn bytes(&self) -> &[u8] {
        match &self.source {
            InputSource::Heights(field) => bytemuck::cast_slice(&field.heights_m),
            InputSource::Colours(map) => bytemuck::cast_slice(&map.pixels),
            InputSource::Types(map) => bytemuck::cast_slice(&map.numbers),
        }
    }

    /// Its contents in 32 hexadecimal digits.
    pub fn identity(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(bytemuck::bytes_of(&self.size.to_array()));
        hasher.update(self.bytes());
        hasher.finalize().to_hex().as_str()[..32].to_string()
    }
}

impl SceneData {
    /// A scene with the cameras of its path; the ground is that of the terrain.
    pub fn new(scene: Scene, ground: Arc<dyn Ground>, inputs: Vec<Input>) -> Self {
        let cameras = camera::path(&scene, ground.as_ref());
        let views = Views::Any;
        Self { scene, ground, inputs, views, sees_underside: true, has_foreground: true }.with_cameras(cameras)
    }

    /// The same scene for a camera that comes from anywhere.
    pub fn with_any_view(&self) -> Self {
        Self { views: Views::Any, sees_underside: true, has_foreground: true, ..self.clone() }
    }

    /// The same scene with other cameras.
    pub fn with_cameras(&self, cameras: Vec<Camera>) -> Self {
        let ground = self.ground.as_ref();
        let sees_underside = cameras.iter().any(|camera| ground.can_see_underside(camera.eye_m));
        let has_foreground =
            cameras.iter().any(|camera| foreground::is_needed(ground, camera.eye_m, camera.focal_px()));
        Self { views: Views::Path(Path::new(cameras)), sees_underside, has_foreground, ..self.clone() }
    }

    /// The cameras of the path; none if any camera may come.
    pub fn cameras(&self) -> &[Camera] {
        match &self.views {
            Views::Path(path) => &path.cameras,
            Views::Any => &[],
        }
    }

    /// By how much rounding in f32 can move what a ray of these cameras meets, in pixels; see [`Camera::rounding_px`].
    pub fn rounding_px(&self) -> f64 {
        self.cameras().iter().map(|camera| camera.rounding_px(self.ground.as_ref())).fold(0.0, f64::max)
    }

    pub fn input(&self, name: &str) -> Option<&Input> {
        self.inputs.iter().find(|input| input.name == name)
    }

    /// The frames that measures look at, as one hash: cameras in f64, viewport, surface and octaves.
    pub fn fingerprint(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        for camera in self.cameras() {
            let numbers = camera.world_from_view.to_cols_array().into_iter();
            let numbers = numbers.chain(camera.eye_m.to_array()).chain(camera.half_tan.to_array());
            numbers.for_each(|number| {
                hasher.update(&number.to_le_bytes());
            });
            hasher.update(&camera.viewport.0.to_le_bytes());
            hasher.update(&camera.viewport.1.to_le_bytes());
        }
        hasher.update(&[self.scene.surface as u8]);
        if let Some(detail) = self.ground.detail() {
            hasher.update(detail.identity().as_bytes());
        }
        hasher.finalize().to_hex().as_str()[..32].to_string()
    }
}
