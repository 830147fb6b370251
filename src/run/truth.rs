//! Ground truth of a scene's frames, computed once and shared by every cell that looks at them.

use std::path::Path;
use std::sync::Arc;

use super::Prepared;
use crate::experiment::diagnostic::{Diagnostic, Source};
use crate::experiment::tree::{Kind, Node};
use crate::experiment::{Cell, StageCall};
use crate::gpu::{Executor, Gpu, GpuError};
use crate::measure::{TruthFrame, truth};
use crate::plan::product::{Drawn, Picture};
use crate::plan::{BufferId, Capacities, Demand, Plan};
use crate::scene::SceneData;
use crate::stages::{self, picture::shade};

/// Frames are kept up to this many bytes; beyond that they are cast again when they are needed.
const MOST_BYTES: usize = 2 << 30;

pub struct Truth {
    executor: Executor,
    data: Arc<SceneData>,
    distance: BufferId,
    colour: BufferId,
    frames: Vec<Option<TruthFrame>>,
    bytes: usize,
}

/// The picture of the truth is shaded like the cell's own; cells that shade alike share it.
pub fn shading(cell: &Cell) -> String {
    own_shade(cell).map_or(String::new(), |call| call.node.canonical())
}

fn own_shade(cell: &Cell) -> Option<&StageCall> {
    cell.stages.iter().rfind(|call| call.name == shade::INFO.name)
}

/// The chain that makes the truth: the one that draws the scene's ground exactly, shaded like the cell shades.
pub fn plan(prepared: &Prepared) -> Result<Plan, Diagnostic> {
    let source = Source::new("ground truth", prepared.data.ground.truth());
    let node = Node::read(&source)?;
    let Kind::List(nodes) = &node.kind else {
        return Err(Diagnostic::run("the ground truth is a list of stages"));
    };
    let call = |node: &Node| {
        let name = node.name().unwrap_or_default().to_string();
        let own = if name == shade::INFO.name { own_shade(&prepared.cell).cloned() } else { None };
        own.unwrap_or(StageCall { name, node: node.clone() })
    };
    let calls: Vec<StageCall> = nodes.iter().map(call).collect();
    let read = |call: &StageCall| stages::read(call, Path::new(""));
    let made = calls.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let stated: Vec<_> = calls.iter().zip(made.iter().map(AsRef::as_ref)).collect();
    let chain = stages::state("ground truth", &prepared.data, &node.origin, &stated, &Capacities::new())?;
    let (drawn, picture): (Drawn<BufferId>, Picture<BufferId>) = (chain.latest()?, chain.latest()?);
    Ok(Plan::finish(
        chain,
        &Demand { outputs: vec![drawn.distance, picture.pixels], keep_everything: false, reuse: false },
    ))
}

impl Truth {
    pub fn new(gpu: &Arc<Gpu>, plan: &Arc<Plan>, prepared: &Prepared) -> Result<Self, GpuError> {
        let [distance, colour] = plan.outputs[..] else {
            return Err(GpuError::Plan("the ground truth has two outputs".into()));
        };
        let mut executor = Executor::new(gpu, plan, &prepared.data)?;
        executor.setup()?;
        Ok(Self { executor, data: prepared.data.clone(), distance, colour, frames: vec![None; plan.frames], bytes: 0 })
    }

    pub fn frame(&mut self, frame: usize) -> Result<TruthFrame, GpuError> {
        if let Some(known) = &self.frames[frame] {
            return Ok(known.clone());
        }
        self.executor.frame(frame)?;
        let distance_m: Vec<f32> = bytemuck::pod_collect_to_vec(&self.executor.read(self.distance)?);
        let error_px = truth::error_px(self.data.ground.as_ref(), &self.data.cameras()[frame], &distance_m);
        let colour = bytemuck::pod_collect_to_vec(&self.executor.read(self.colour)?);
        let made = TruthFrame { distance_m, colour, error_px };
        let bytes = 8 * made.colour.len();
        if self.bytes + bytes <= MOST_BYTES {
            self.bytes += bytes;
            self.frames[frame] = Some(made.clone());
        }
        Ok(made)
    }
}
