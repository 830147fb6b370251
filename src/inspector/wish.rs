//! What somebody wants to see, and what there is to see of it: all that passes between the window and its worker.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::document::Document;
use crate::camera::Camera;
use crate::experiment::Experiment;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::sweep::Varied;
use crate::gpu::Held;
use crate::measure::Measured;
use crate::plan::{BufferId, Plan};
use crate::reference::{Difference, Values};
use crate::run::Prepared;
use crate::run::sight::Sight;

/// Which of two things that are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub enum Side {
    #[default]
    A,
    B,
}

impl Side {
    pub const BOTH: [Side; 2] = [Side::A, Side::B];
}

/// A cell of an experiment: its chain, and the values that are swept in it.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct CellName {
    pub chain: String,
    pub settings: Vec<Varied>,
}

/// The frame that is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moment {
    /// Of the path.
    Frame(usize),
    /// From a camera that somebody flies.
    Live(Camera),
}

/// One of the two sides, as it is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    pub document: Document,
    pub cell: CellName,
    pub moment: Moment,
    /// Buffers as `--dump` names them: `BUFFER`, or `BUFFER@STAGE/STEP`.
    pub buffers: Vec<String>,
    /// Stages that are computed on the CPU.
    pub on_cpu: Vec<String>,
    /// The f64 result of every stage beside that of its kernels.
    pub in_f64: bool,
    /// Ground truth, and the screen-space error against it.
    pub truth: bool,
    /// Each step is timed.
    pub times: bool,
    /// Changes when a kernel's file has changed.
    pub kernels: u64,
}

/// What was made of a wish.
pub struct Shown {
    pub wish: Wish,
    pub experiment: Arc<Experiment>,
    /// All of its cells.
    pub cells: Vec<CellName>,
    pub prepared: Arc<Prepared>,
    /// What a run carries out, and leaves out.
    pub run_plan: Arc<Plan>,
    /// What was carried out for the window: the same, and what it looks at.
    pub plan: Arc<Plan>,
    /// A name for each step of the plan.
    pub step_names: Vec<String>,
    pub camera: Camera,
    pub frames: usize,
    /// Those of the wish by their names, with their numbers in the plan.
    pub buffers: BTreeMap<String, (BufferId, Held)>,
    /// Those that go with them.
    pub companions: BTreeMap<BufferId, Held>,
    /// What a frame took on the clock, and each step of the plan if that was asked for.
    pub frame_ms: f64,
    /// What reading, planning and preparing took, if this was made anew.
    pub made_ms: Option<f64>,
    pub step_ms: BTreeMap<usize, f64>,
    pub truth: Option<Arc<TruthShown>>,
    /// By the names of the buffers.
    pub in_f64: BTreeMap<String, Arc<F64Shown>>,
    pub notes: Vec<String>,
    /// What somebody has pointed at before, on the host.
    pub copies: super::probe::Copies,
    /// Different for everything that was ever shown.
    pub number: u64,
}

/// Ground truth of a frame, and how far the chain is from it.
pub struct TruthShown {
    pub distance: Held,
    pub picture: Held,
    pub error: Held,
    pub figures: Vec<Measured>,
}

/// What a reference makes of what its kernels were given.
pub struct F64Shown {
    pub values: Arc<Values>,
    pub held: Held,
    pub difference: Difference,
}

impl Shown {
    /// A buffer by the name that the wish has for it.
    pub fn held(&self, name: &str) -> Option<&Held> {
        self.buffers.get(name).map(|(_, held)| held)
    }

    /// What a buffer is, or of what it is a copy.
    pub fn source(&self, name: &str) -> Option<BufferId> {
        self.buffers.get(name).map(|(id, _)| self.plan.source_of(*id))
    }

    /// The frame as one that can be drawn.
    pub fn sight<'a>(&'a self, held: &'a dyn Fn(BufferId) -> Option<&'a Held>) -> Sight<'a> {
        let Self { plan, prepared, camera, truth, .. } = self;
        let other_picture = truth.as_ref().map(|truth| &truth.picture);
        Sight { plan, data: &prepared.data, camera, held, other_picture }
    }

    /// A buffer of the plan that is held under any name.
    pub fn companion(&self, id: BufferId) -> Option<&Held> {
        let own = self.buffers.values().find(|(own, _)| *own == id).map(|(_, held)| held);
        own.or_else(|| self.companions.get(&id))
    }
}

/// What the worker has to say.
pub enum Told {
    Shown(Side, Arc<Shown>),
    /// A wish that cannot be fulfilled; what was shown stays.
    Refused(Side, Box<Wish>, Diagnostic),
    Working {
        what: String,
        share: Option<f32>,
    },
    /// It has done everything of so many messages.
    Idle(usize),
    Answer(u64, Answer),
}

/// What was asked about a buffer.
pub enum Answer {
    Statistics(Result<super::ask::Seen, Diagnostic>),
    Bytes(Result<Vec<u8>, Diagnostic>),
    Probed(Result<super::probe::Probed, Diagnostic>),
    Done(Result<String, Diagnostic>),
}
