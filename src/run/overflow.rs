//! Lists whose length only the GPU knows, and that turn out to be too short.

use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::{Executor, GpuError};
use crate::plan::Plan;

/// A list that a frame needed longer.
#[derive(Clone, Debug)]
pub struct Overflow {
    pub list: String,
    pub capacity: u32,
    pub needed: u32,
}

impl Overflow {
    /// The first such list of the frame that was just drawn.
    pub fn after_frame(executor: &Executor, plan: &Plan) -> Result<Option<Self>, Diagnostic> {
        for guard in &plan.guards {
            let needed: Vec<u32> = bytemuck::pod_collect_to_vec(&executor.read(guard.needed)?);
            let Some(&needed) = needed.get(guard.at) else {
                return Err(GpuError::Plan(format!("nothing says how long the list `{}` has to be", guard.list)).into());
            };
            if needed > guard.capacity {
                return Ok(Some(Self { list: guard.list.clone(), capacity: guard.capacity, needed }));
            }
        }
        Ok(None)
    }
}
