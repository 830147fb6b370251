//! Ground truth of a scene's frames, computed once and shared by every cell that looks at them.

use std::path::Path;

use crate::experiment::diagnostic::{Diagnostic, Source};
use crate::experiment::tree::Node;
use crate::experiment::{Cell, StageCall};
use crate::gpu::{Executor, Gpu, GpuError};
use crate::plan::{Chain, Demand, Plan, SceneData};
use crate::stages;

use super::Prepared;

/// Exact distances and their shaded picture for one frame.
#[derive(Clone, Debug)]
pub struct TruthFrame {
    pub distance_m: Vec<f32>,
    pub colour: Vec<u32>,
}

/// Frames are kept up to this many bytes; beyond that they are cast again when they are needed.
const KEPT_BYTES: usize = 2 << 30;

pub struct Truth<'a> {
    executor: Executor<'a>,
    plan: &'a Plan,
    frames: Vec<Option<TruthFrame>>,
    kept_bytes: usize,
}

pub fn wanted(cell: &Cell) -> bool {
    ["ScreenError", "Image", "Coverage", "Mesh"].iter().any(|name| cell.wants(name))
}

/// The picture of the truth is shaded like the cell's own; cells that shade alike share it.
pub fn shading(cell: &Cell) -> String {
    own_shade(cell).map_or(String::new(), |call| call.node.canonical())
}

fn own_shade(cell: &Cell) -> Option<&StageCall> {
    cell.stages.iter().rfind(|call| call.name == "Shade")
}

/// The chain that makes the truth: the exact ray cast, shaded like the cell shades.
pub fn plan(data: &SceneData, prepared: &Prepared) -> Result<Plan, Diagnostic> {
    let source = Source::new("ground truth", "[HeightPyramid, RayCast, Shade]");
    let node = Node::read(&source)?;
    let crate::experiment::tree::Kind::List(nodes) = &node.kind else {
        return Err(Diagnostic::run("the ground truth is a list of stages"));
    };
    let mut chain = Chain::new("ground truth", data, &node.origin);
    for (index, node) in nodes.iter().enumerate() {
        let name = node.name().unwrap_or_default().to_string();
        let own = if name == "Shade" { own_shade(&prepared.cell).cloned() } else { None };
        let call = own.unwrap_or(StageCall { name, node: node.clone() });
        chain.begin_stage(&call.name, index, &call.node.origin);
        stages::read(&call, Path::new(""))?.plan(&mut chain)?;
    }
    Plan::finish(chain, &Demand { outputs: vec!["distance".into(), "colour".into()], keep_everything: false })
}

impl<'a> Truth<'a> {
    pub fn new(gpu: &'a Gpu, plan: &'a Plan, data: &SceneData) -> Result<Self, GpuError> {
        let executor = Executor::new(gpu, plan, data)?;
        executor.setup()?;
        Ok(Self { executor, plan, frames: vec![None; plan.frames], kept_bytes: 0 })
    }

    pub fn frame(&mut self, frame: usize) -> Result<TruthFrame, GpuError> {
        if let Some(kept) = &self.frames[frame] {
            return Ok(kept.clone());
        }
        self.executor.frame(frame)?;
        let [distance, colour] = self.plan.outputs[..] else {
            return Err(GpuError::Lost("the truth has two outputs".into()));
        };
        let made = TruthFrame {
            distance_m: bytemuck::pod_collect_to_vec(&self.executor.read(distance)?),
            colour: bytemuck::pod_collect_to_vec(&self.executor.read(colour)?),
        };
        let bytes = 8 * made.colour.len();
        if self.kept_bytes + bytes <= KEPT_BYTES {
            self.kept_bytes += bytes;
            self.frames[frame] = Some(made.clone());
        }
        Ok(made)
    }
}
