//! What is looked at: terrain, camera path, viewport and light, as they are written in an experiment file.
//!
//! World frame: x east, y north, z up, metres, right-handed; the south-west height sample is at (0, 0).

use std::path::PathBuf;

use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

use super::parameters::schema;
use super::tree::Node;

/// What is looked at: terrain, cameras, picture and light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// `Dem(..)`, `Noise(..)` or `Shape(..)`.
    pub terrain: Terrain,
    /// How the surface runs between height samples. Default: `Triangles`.
    #[serde(default)]
    pub surface: Surface,
    /// How adapters hold the height samples. Default: `Auto`.
    #[serde(default)]
    pub held_as: Held,
    /// What the surface does between samples that no sample says.
    #[serde(default)]
    pub detail: Detail,
    /// What the ground looks like, for `Shade`. Default: its height in colours.
    #[serde(default)]
    pub colour: Option<Colour>,
    /// What lies on the ground, for stages that ask for the surface type. Default: nothing says so but the stage `SurfaceType`.
    #[serde(default)]
    pub surface_type: Option<SurfaceTypes>,
    /// `Still(..)`, `Orbit(..)` or `Flight(..)`: the same frames every time.
    pub camera: Camera,
    /// Width and height of the image in pixels. Default: (1024, 768).
    #[serde(default = "default_viewport")]
    pub viewport: (u32, u32),
    /// *Vertical* field of view in degrees. Default: 60.
    #[serde(default = "default_fov_deg")]
    pub fov_deg: f64,
    /// Where the sun stands.
    #[serde(default)]
    pub light: Light,
}

fn default_viewport() -> (u32, u32) {
    (1024, 768)
}

fn default_fov_deg() -> f64 {
    60.0
}

/// The definition of the surface between the samples; ground truth is exact for either.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Surface {
    /// Two triangles a cell; the diagonal joins the north-east and the south-west sample.
    #[default]
    Triangles,
    /// One bilinear patch a cell.
    Bilinear,
}

/// The form of the height samples on the device. What kernels compute does not depend on it, how fast they are does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Held {
    /// An image for kernels that fetch four samples at once, an array for the others; an image for all where an array is too large for some
    /// adapter.
    #[default]
    Auto,
    Array,
    Image,
}

/// Procedural octaves over the surface: noise of frequency 2^k / (2 d0), k = 1, 2, .., d0 the distance of the samples
/// (Dachsbacher, Stamminger 2004, section 4.1). They are part of the ground: ground truth and cameras know all of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Detail {
    /// How many, each with half the wavelength of the one before. Default: 0, nothing is added.
    #[schemars(range(min = 0, max = 30))]
    pub octaves: u32,
    /// The most that the first octave adds or takes, in metres. Default: 1.
    #[schemars(extend("minimum" = 0, "maximum" = 1000000))]
    pub amplitude_m: f64,
    /// Amplitude ratio of neighbouring octaves. Default: 0.5, every octave is as steep as the one before.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub persistence: f64,
    /// Other seeds, other octaves. Default: 0.
    pub seed: u32,
    /// Where the first sample (north-west) is in the octaves, in whole cells to the east and to the south. Default: (0, 0). A part of a
    /// larger terrain has the octaves of the whole with the place it was cut from.
    #[schemars(extend("minimum" = -1000000000, "maximum" = 1000000000))]
    pub origin: (i32, i32),
}

impl Default for Detail {
    fn default() -> Self {
        Self { octaves: 0, amplitude_m: 1.0, persistence: 0.5, seed: 0, origin: (0, 0) }
    }
}

/// A map of colours that lies on the ground; its first and last columns and rows are on the terrain's border.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Colour {
    /// A picture, row 0 in the north.
    Image(GroundImage),
    /// What grows or lies there, from height and slope.
    Cover(Cover),
}

/// A map of surface types that lies on the ground; its first and last columns and rows are on the terrain's border.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum SurfaceTypes {
    /// 8-bit grey, row 0 in the north: the values are the numbers of the types.
    Image(GroundImage),
}

/// A picture that lies on the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroundImage {
    /// Path of a `.png`, relative to the experiment file.
    pub file: PathBuf,
}

/// One colour a sample: rock where it is steep, snow where it is high, and otherwise meadow, which gets thinner with height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cover {
    /// Steeper ground is rock, in degrees. Default: 35.
    pub rock_deg: f64,
    /// Higher ground is under snow, in metres. Default: four fifths of the way from the lowest to the highest sample.
    pub snow_m: Option<f64>,
    /// Lower ground is under water, in metres. Default: none is.
    pub water_m: Option<f64>,
}

impl Default for Cover {
    fn default() -> Self {
        Self { rock_deg: 35.0, snow_m: None, water_m: None }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Terrain {
    Dem(Dem),
    Noise(Noise),
    Shape(Shape),
}

/// An elevation file: `.png` (8 or 16 bit grey), `.tif`/`.tiff` (GeoTIFF), `.hgt`, `.hgt.zip`, `.npy`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dem {
    /// Path of the file, relative to the experiment file.
    pub file: PathBuf,
    /// Metres between samples, one number or (x, y). Default: what the file says; files that say nothing need it.
    #[serde(default)]
    pub cell_m: Option<CellSize>,
    /// Height of the sample values 0 and of the largest the sample type holds (integer samples only).
    /// Excludes `height_offset_m` and `height_scale_m`.
    #[serde(default)]
    pub height_m: Option<(f64, f64)>,
    /// Height of the sample value 0. Default: 0.
    #[serde(default)]
    pub height_offset_m: f64,
    /// Metres a sample step. Default: 1.
    #[serde(default = "one")]
    pub height_scale_m: f64,
    /// The sample value that means "nothing here", if the file does not say it itself. NaN always means it.
    #[serde(default)]
    pub nodata_value: Option<f64>,
    /// What happens to samples without data. Default: `Refuse`.
    #[serde(default)]
    pub nodata: Nodata,
    /// First column, first row (row 0 is north), columns, rows. Default: everything.
    #[serde(default)]
    pub crop: Option<(u32, u32, u32, u32)>,
    /// Columns and rows to resample to (bilinear, both ends kept), after the crop. Default: as it is.
    #[serde(default)]
    pub resample: Option<(u32, u32)>,
    /// Exaggeration, multiplies every height at the end. Default: 1.
    #[serde(default = "one")]
    pub vertical_scale: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Nodata {
    /// A sample without data is an error that says where it is.
    #[default]
    Refuse,
    /// Every such sample gets this height in metres.
    Fill(f64),
    /// Each gap is filled from its border: mean of the known neighbours, ring by ring inwards.
    Interpolate,
}

/// Metres between samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected metres between samples: one number, or (x, y)")]
pub enum CellSize {
    Square(f64),
    Xy(f64, f64),
}

impl CellSize {
    pub fn xy(self) -> (f64, f64) {
        match self {
            CellSize::Square(side) => (side, side),
            CellSize::Xy(x, y) => (x, y),
        }
    }
}

/// Procedural heights from the `noise` crate; the same seed gives the same terrain everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// How octaves are put together.
    pub kind: NoiseKind,
    /// Seeds the lattice and the place in it. Default: 0.
    #[serde(default)]
    pub seed: u64,
    /// Columns and rows. Default: (513, 513).
    #[serde(default = "default_size")]
    pub size: (u32, u32),
    /// Metres between samples, one number or (x, y). Default: 30.
    #[serde(default = "default_cell")]
    pub cell_m: CellSize,
    /// Heights at noise values -1 and 1. Default: (0, 1000).
    #[serde(default = "default_height_m")]
    pub height_m: (f64, f64),
    /// Length of the coarsest octave in metres. Default: 8000.
    #[serde(default = "default_wavelength_m")]
    pub wavelength_m: f64,
    /// Octaves, each finer than the one before. Default: 8.
    #[serde(default = "default_octaves")]
    pub octaves: u32,
    /// Frequency ratio of neighbouring octaves. Default: 2.
    #[serde(default = "default_lacunarity")]
    pub lacunarity: f64,
    /// Amplitude ratio of neighbouring octaves. Default: 0.5. At 0 all octaves but the first are left out.
    #[serde(default = "default_persistence")]
    pub persistence: f64,
    /// How far `DomainWarped` moves a place before it asks for the noise, in metres. Default: 1000.
    #[serde(default = "default_height_top")]
    pub warp_m: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum NoiseKind {
    /// Sum of octaves.
    Fbm,
    /// Octaves folded at zero and turned over: sharp ridges.
    Ridged,
    /// Octaves folded at zero: round hills.
    Billow,
    /// Octaves weighted by those before them: smooth valleys, rough heights.
    Hybrid,
    /// A sum of octaves at places that another noise has moved.
    DomainWarped,
}

/// Exact shapes, for teaching and for tests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// Which shape.
    pub kind: ShapeKind,
    /// Columns and rows. Default: (513, 513).
    #[serde(default = "default_size")]
    pub size: (u32, u32),
    /// Metres between samples, one number or (x, y). Default: 30.
    #[serde(default = "default_cell")]
    pub cell_m: CellSize,
    /// Lowest and highest height in metres. Default: (0, 1000).
    #[serde(default = "default_height_m")]
    pub height_m: (f64, f64),
    /// Cells a period of `Checkerboard` and `Sine`. Default: 16.
    #[serde(default = "default_period_cells")]
    pub period_cells: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum ShapeKind {
    /// The lowest height everywhere.
    Flat,
    /// Rises linearly from west to east.
    Ramp,
    /// A Gaussian hill in the middle; its standard deviation is an eighth of the smaller side.
    GaussianHill,
    /// One sample in the middle at the highest height.
    Spike,
    /// The western half low, the eastern half high, one cell between.
    Cliff,
    /// Low and high squares of half a period.
    Checkerboard,
    /// Product of sines along x and y.
    Sine,
}

fn one() -> f64 {
    1.0
}
fn default_size() -> (u32, u32) {
    (513, 513)
}
fn default_cell() -> CellSize {
    CellSize::Square(30.0)
}
fn default_height_m() -> (f64, f64) {
    (0.0, 1000.0)
}
fn default_height_top() -> f64 {
    1000.0
}
fn default_wavelength_m() -> f64 {
    8000.0
}
fn default_octaves() -> u32 {
    8
}
fn default_lacunarity() -> f64 {
    2.0
}
fn default_persistence() -> f64 {
    0.5
}
fn default_period_cells() -> f64 {
    16.0
}

/// A camera path with a given number of frames: the same frames every time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Camera {
    Still(Still),
    Orbit(Orbit),
    Flight(Flight),
}

impl Camera {
    pub fn frames(&self) -> u32 {
        match self {
            Camera::Still(still) => still.frames,
            Camera::Orbit(orbit) => orbit.frames,
            Camera::Flight(flight) => flight.frames,
        }
    }
}

/// One place, looked from again and again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Still {
    /// How often the same picture is made, for timings. Default: 1.
    #[serde(default = "one_frame")]
    pub frames: u32,
    /// Eye in world metres.
    pub eye: (f64, f64, f64),
    /// The world point in the middle of the picture. Excludes yaw and pitch.
    #[serde(default)]
    pub look_at: Option<(f64, f64, f64)>,
    /// Degrees clockwise from north. Default: 0.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Degrees above the horizon. Default: 0.
    #[serde(default)]
    pub pitch_deg: f64,
    /// Degrees clockwise about the view direction. Default: 0.
    #[serde(default)]
    pub roll_deg: f64,
    /// Lifts the eye to at least this height above the ground. Default: not at all.
    #[serde(default)]
    pub clearance_m: Option<f64>,
}

/// A circle around a point of the ground, looked at from above.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orbit {
    /// Frames of the circle.
    pub frames: u32,
    /// The world point looked at and circled.
    pub center: (f64, f64, f64),
    /// Of the circle, in metres.
    pub radius_m: f64,
    /// Height of the eye above the centre.
    pub height_m: f64,
    /// Where the circle starts, degrees clockwise from north. Default: 180 (south of the centre, looking north).
    #[serde(default = "south")]
    pub start_deg: f64,
    /// Turns over all frames. Default: 1.
    #[serde(default = "one")]
    pub turns: f64,
    /// Lifts the eye to at least this height above the ground. Default: not at all.
    #[serde(default)]
    pub clearance_m: Option<f64>,
}

/// Eye and look-at points joined by Catmull-Rom splines; the keys are evenly spaced in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Flight {
    /// Frames of the flight.
    pub frames: u32,
    /// (eye: (x, y, z), look_at: (x, y, z)), two or more.
    pub keys: Vec<Key>,
    /// Lifts the eye to at least this height above the ground. Default: not at all.
    #[serde(default)]
    pub clearance_m: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Key {
    pub eye: (f64, f64, f64),
    pub look_at: (f64, f64, f64),
}

fn one_frame() -> u32 {
    1
}
fn south() -> f64 {
    180.0
}

/// Where the sun stands; used by `Shade`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Light {
    /// Degrees clockwise from north. Default: 315.
    pub azimuth_deg: f64,
    /// Degrees above the horizon. Default: 40.
    pub elevation_deg: f64,
    /// Share of light that is everywhere. Default: 0.25.
    pub ambient: f64,
}

impl Default for Light {
    fn default() -> Self {
        Self { azimuth_deg: 315.0, elevation_deg: 40.0, ambient: 0.25 }
    }
}

/// A part of a scene whose fields are parameters.
pub struct Part {
    /// Where it is, as paths of sweeps and settings have it.
    pub path: &'static str,
    /// The structure's name in the file; a part without one is what stands at its path.
    pub name: &'static str,
    pub parameters: fn() -> Schema,
}

const fn part(path: &'static str, name: &'static str, parameters: fn() -> Schema) -> Part {
    Part { path, name, parameters }
}

/// All of them, each kind of terrain and camera by its name.
pub const PARTS: &[Part] = &[
    part("scene", "", schema::<Scene>),
    part("scene.terrain", "Dem", schema::<Dem>),
    part("scene.terrain", "Noise", schema::<Noise>),
    part("scene.terrain", "Shape", schema::<Shape>),
    part("scene.detail", "", schema::<Detail>),
    part("scene.colour", "Image", schema::<GroundImage>),
    part("scene.colour", "Cover", schema::<Cover>),
    part("scene.surface_type", "Image", schema::<GroundImage>),
    part("scene.camera", "Still", schema::<Still>),
    part("scene.camera", "Orbit", schema::<Orbit>),
    part("scene.camera", "Flight", schema::<Flight>),
    part("scene.light", "", schema::<Light>),
];

/// The parts that a scene has, each with what is written of it.
pub fn parts(scene: &Node) -> Vec<(&'static Part, Option<&Node>)> {
    let found = |part: &'static Part| {
        let Some(field) = part.path.strip_prefix("scene.") else { return Some((part, Some(scene))) };
        let node = scene.field(field);
        let is_it = part.name.is_empty() || node.and_then(Node::name) == Some(part.name);
        is_it.then_some((part, node))
    };
    PARTS.iter().filter_map(found).collect()
}
