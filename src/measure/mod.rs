//! What a picture, a mesh and a run time are worth.
//!
//! A measure is a file and a word in the list below. It says which buffers it needs, looks at every frame, and gives figures with units;
//! it has no device. Run, reports and `lodlab stages` loop over the list.

mod distribution;
pub mod figures;
mod missed;
pub mod pinholes;
mod relaxation;
pub mod triangles;
pub mod truth;

use std::collections::BTreeMap;
use std::fmt::Debug;

use schemars::{JsonSchema, Schema};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::camera::Camera;
use crate::experiment::MeasureCall;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters;
use crate::experiment::tree::Node;
use crate::plan::{BufferId, Chain, Plan};
use crate::scene::SceneData;

pub use figures::{Column, Figures, Kind, Known, Measured, Picture, Show, faults, known};
pub use truth::TruthFrame;

/// Makes the modules and the registry of one list.
macro_rules! measures {
    ($($measure:ident),* $(,)?) => {
        $(pub mod $measure;)*

        /// All measures, in the order of their columns in tables.
        pub const REGISTRY: &[&Info] = &[$(&$measure::INFO),*];
    };
}

measures! {
    screen_error,
    drawn_error,
    image,
    time,
    mesh,
    vertex_error,
    error_buffer,
    coverage,
    density,
    swimming,
}

/// What the registry knows of a measure.
pub struct Info {
    pub name: &'static str,
    pub summary: &'static str,
    /// Raised whenever its figures would mean something else than before, so that finished cells are measured again.
    pub version: u32,
    /// What is known of its parameters; see [`parameters::describe`].
    pub parameters: fn() -> Schema,
    pub read: fn(&Node) -> Result<Read, Diagnostic>,
    /// Every figure that it can give.
    pub figures: &'static [Known],
    /// What tables show of it.
    pub columns: &'static [Column],
}

/// A measure as it was read, with all of its parameters as text, those that are not written among them.
pub type Read = (Box<dyn Measure>, String);

/// A measure with its parameters.
pub trait Measure: Debug + Send + Sync {
    /// The buffers that it looks at in every frame; an error says what the chain is missing.
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic>;

    /// It compares with the ground truth.
    fn wants_truth(&self) -> bool {
        false
    }

    /// It looks at frames; otherwise only at the clock.
    fn looks_at_frames(&self) -> bool {
        true
    }

    /// How often frames are timed, if it says that.
    fn sampling(&self) -> Option<Sampling> {
        None
    }

    /// Nothing seen yet.
    fn begin(&self) -> Box<dyn Tally>;
}

/// What a measure sums up over the frames of a cell.
pub trait Tally {
    /// Looks at a frame; the figures of this frame alone.
    fn frame(&mut self, seen: &Seen) -> Vec<Measured>;

    fn finish(self: Box<Self>) -> Figures;
}

/// Sums to which each frame adds its own.
pub trait Sums {
    /// Those of one frame, with the parameters of these.
    fn of_frame(&self, seen: &Seen) -> Self
    where
        Self: Sized;

    fn add(&mut self, frame: Self)
    where
        Self: Sized;

    fn measured(&self) -> Vec<Measured>;

    /// The figures with what else there is to show and to say.
    fn figures(self) -> Figures
    where
        Self: Sized,
    {
        self.measured().into()
    }
}

impl<S: Sums> Tally for S {
    fn frame(&mut self, seen: &Seen) -> Vec<Measured> {
        let frame = self.of_frame(seen);
        let measured = frame.measured();
        self.add(frame);
        measured
    }

    fn finish(self: Box<Self>) -> Figures {
        self.figures()
    }
}

/// Frames before the first that counts, and how often the path is timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    pub warmup: u32,
    /// At least.
    pub repeats: u32,
    pub until: Option<time::Until>,
}

/// A frame that is over.
pub struct Seen<'a> {
    pub plan: &'a Plan,
    pub data: &'a SceneData,
    pub frame: usize,
    /// What was read back.
    pub buffers: &'a BTreeMap<BufferId, Vec<u8>>,
    /// There for measures that want it.
    pub truth: Option<&'a TruthFrame>,
}

impl Seen<'_> {
    pub fn camera(&self) -> &Camera {
        &self.data.cameras()[self.frame]
    }

    /// The elements of a buffer; none of one that was not asked for.
    pub fn read<T: bytemuck::Pod>(&self, id: BufferId) -> Vec<T> {
        self.buffers.get(&id).map_or(Vec::new(), |bytes| bytemuck::pod_collect_to_vec(bytes))
    }

    /// The frame in the middle of the path is the one that pictures are made of.
    pub fn is_pictured(&self) -> bool {
        self.frame == self.plan.frames / 2
    }
}

/// A measure of an experiment.
pub struct Chosen {
    pub info: &'static Info,
    pub measure: Box<dyn Measure>,
    /// All of its parameters, those that are not written among them.
    pub parameters: String,
}

impl Chosen {
    /// What decides its figures besides what it looks at.
    pub fn identity(&self) -> String {
        format!("{}/{} {}", self.info.name, self.info.version, self.parameters)
    }
}

/// Looks a measure up in the registry and reads its parameters.
pub fn read(call: &MeasureCall) -> Result<Chosen, Diagnostic> {
    let Some(info) = REGISTRY.iter().find(|info| info.name == call.name) else {
        return Err(Diagnostic::input(format!("there is no measure `{}`", call.name))
            .at(&call.node.origin, "unknown measure")
            .suggest(&call.name, REGISTRY.iter().map(|info| info.name)));
    };
    let (measure, parameters) = (info.read)(&call.node)?;
    Ok(Chosen { info, measure, parameters })
}

/// Reads a measure whose parameters are one structure.
fn read_as<M>(node: &Node) -> Result<Read, Diagnostic>
where
    M: Measure + DeserializeOwned + Serialize + JsonSchema + 'static,
{
    let measure: M = parameters::read(node)?;
    let written = serde_json::to_string(&measure)
        .map_err(|error| Diagnostic::run(error.to_string()).at(&node.origin, "this measure"))?;
    Ok((Box::new(measure), written))
}
