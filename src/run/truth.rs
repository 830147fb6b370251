//! Ground truth of a scene's frames, computed once and shared by every cell that looks at them.

use std::path::Path;
use std::sync::Arc;

use super::Prepared;
use crate::camera::Camera;
use crate::experiment::diagnostic::{Diagnostic, Source};
use crate::experiment::tree::{Kind, Node};
use crate::experiment::{Cell, StageCall};
use crate::gpu::{Executor, Gpu, GpuError};
use crate::ground::{EXACT_PX, foreground};
use crate::measure::truth::{self, TruthFrame};
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

/// Why rays of the truth are cast in f64 on the CPU, if they are: where rounding in f32 can move their hits by more than the truth is good to.
pub fn in_f64(data: &SceneData) -> Option<String> {
    let rounding_px = data.rounding_px();
    (rounding_px > EXACT_PX).then(|| {
        format!(
            "the ground truth is cast in f64 on the CPU, which takes longer: in f32, rounding can move it by {rounding_px:.2} px \
             with these cameras (the ground rises by up to {:.3e} m in a metre)",
            data.ground.steepest_seen()
        )
    })
}

/// Refuses scenes in which even f64 has too few digits: two roundings to 2^-53 of heights and of places on a slope, seen from how close an
/// eye can be to the surface.
pub fn check(data: &SceneData) -> Result<(), Diagnostic> {
    if data.rounding_px() <= EXACT_PX {
        return Ok(());
    }
    let ground = data.ground.as_ref();
    let (low_m, high_m) = ground.range_m();
    let rounding_px = |camera: &Camera| {
        let eye_m = camera.eye_m;
        let height_m = low_m.abs().max(high_m.abs()).max(eye_m.z.abs());
        let place_m = ground.lattice().extent_m().length().max(eye_m.truncate().length());
        let off_m = f64::EPSILON * (height_m + ground.steepest() * place_m);
        camera.most_px() * off_m / foreground::least_distance_m(ground, eye_m)
    };
    let worst_px = data.cameras().iter().map(rounding_px).fold(0.0, f64::max);
    if worst_px <= EXACT_PX {
        return Ok(());
    }
    Err(Diagnostic::input(format!(
        "the truth cannot be known to {EXACT_PX} px here, not even in f64: the ground rises by up to {:.3e} m in a metre, \
         and the eye is so close to it that rounding can move what it sees by {worst_px:.3} px",
        ground.steepest()
    ))
    .help("larger cells, less height, or an eye farther away from the surface"))
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
        let (ground, camera) = (self.data.ground.as_ref(), &self.data.cameras()[frame]);
        let cast: Vec<f32> = bytemuck::pod_collect_to_vec(&self.executor.read(self.distance)?);
        let mut distance_m: Vec<f64> = cast.into_iter().map(f64::from).collect();
        let mut error_px = camera.rounding_px(ground);
        if error_px <= EXACT_PX {
            error_px = truth::error_px(ground, camera, &distance_m);
        }
        // known beforehand or found out: f32 has too few digits for this frame
        if error_px > EXACT_PX {
            distance_m = truth::cast(ground, camera);
            error_px = truth::error_px(ground, camera, &distance_m);
        }
        let colour: Vec<u32> = bytemuck::pod_collect_to_vec(&self.executor.read(self.colour)?);
        let bytes = size_of_val(&distance_m[..]) + size_of_val(&colour[..]);
        let made = TruthFrame { distance_m, colour, error_px };
        if self.bytes + bytes <= MOST_BYTES {
            self.bytes += bytes;
            self.frames[frame] = Some(made.clone());
        }
        Ok(made)
    }
}
