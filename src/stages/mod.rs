//! The stages and their registry. A stage is three touches: its kernel file, its Rust file here, its line in
//! [`REGISTRY`]; everything else (validation, numeric tests, benches, `lodlab stages`) loops over the registry.

mod aspect_importance;
mod compact;
mod grid_error;
mod height_pyramid;
mod kernel;
mod lead_rays;
mod plane_pyramid;
mod project;
mod projector;
mod rasterize;
mod ray_cast;
mod ray_fill;
mod roughness;
mod scan;
mod shade;
mod triangle_splitting;
mod vertex_splitting;
mod view_grid;
mod warp;

use std::fmt::Debug;

use crate::experiment::StageCall;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::tree::Node;
use crate::plan::{BufferId, Chain};
use crate::reference::{Buffers, Frame};

/// One step of a chain, with its parameters.
pub trait Stage: Debug + Send + Sync {
    /// States buffers and steps.
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic>;

    /// Buffers it makes that the registry cannot know.
    fn makes(&self) -> Vec<String> {
        Vec::new()
    }

    /// The stage in f64 on the CPU, straight from its formula: reads its inputs from `buffers` and puts its
    /// outputs there, each value with the largest difference that f32 can explain.
    fn reference(&self, frame: &Frame, buffers: &mut Buffers);
}

/// Reads a stage from its place in an experiment.
pub type Read = fn(&Node, &std::path::Path) -> Result<Box<dyn Stage>, Diagnostic>;

/// What the registry knows of a stage.
pub struct Info {
    pub name: &'static str,
    pub summary: &'static str,
    /// The formula it computes, and where that comes from.
    pub formula: &'static str,
    pub source: &'static str,
    pub reads: &'static [&'static str],
    pub writes: &'static [&'static str],
    pub kernels: &'static [&'static str],
    /// Name, default and meaning of each parameter.
    pub params: &'static [(&'static str, &'static str, &'static str)],
    /// Reads the stage as written in an experiment; the folder is the experiment's.
    pub read: Read,
}

pub const REGISTRY: &[Info] = &[
    height_pyramid::INFO,
    plane_pyramid::INFO,
    view_grid::INFO,
    aspect_importance::INFO,
    warp::INFO,
    project::INFO,
    grid_error::INFO,
    roughness::INFO,
    vertex_splitting::INFO,
    triangle_splitting::INFO,
    rasterize::INFO,
    ray_cast::INFO,
    lead_rays::INFO,
    ray_fill::INFO,
    shade::INFO,
    scan::INFO,
    compact::INFO,
    kernel::INFO,
];

pub use height_pyramid::Layout;
pub use shade::RGBA8;

/// The buffers a stage of the registry writes.
pub fn writes(name: &str) -> &'static [&'static str] {
    REGISTRY.iter().find(|info| info.name == name).map_or(&[], |info| info.writes)
}

/// Looks a stage up in the registry and reads its parameters.
pub fn read(call: &StageCall, folder: &std::path::Path) -> Result<Box<dyn Stage>, Diagnostic> {
    match REGISTRY.iter().find(|info| info.name == call.name) {
        Some(info) => (info.read)(&call.node, folder),
        None => Err(Diagnostic::input(format!("there is no stage `{}`", call.name))
            .at(&call.node.origin, "unknown stage")
            .suggest(&call.name, REGISTRY.iter().map(|info| info.name))),
    }
}

/// Reads a stage whose parameters are a plain structure.
fn read_params<S: Stage + serde::de::DeserializeOwned + 'static>(node: &Node) -> Result<Box<dyn Stage>, Diagnostic> {
    Ok(Box::new(node.parse_fields::<S>()?))
}

/// Number of elements of a buffer that a kernel counts in u32.
fn elements(chain: &Chain, buffer: BufferId) -> Result<u32, Diagnostic> {
    let buffer = chain.buffer(buffer);
    let too_many = |_| Diagnostic::input(format!("`{}` has more elements than u32 counts", buffer.name));
    u32::try_from(buffer.elements()).map_err(too_many).map_err(|message| message.at(chain.origin(), "this stage"))
}

/// Largest relative rounding error of one f32 operation.
const EPSILON: f64 = f32::EPSILON as f64 / 2.0;
