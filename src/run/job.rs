//! A cell as a job: what is carried out for it, and the identity that follows from that.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Options, Prepared, truth};
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Gpu;
use crate::plan::{Capacities, Plan, SceneData};
use crate::report::records::{self, Identity};

/// A cell, its plan and the plan of the ground truth that it is compared with.
pub struct Job {
    pub prepared: Arc<Prepared>,
    pub plan: Plan,
    /// None if no measure looks at the truth. Jobs over the same frames share it.
    pub truth: Option<Arc<Plan>>,
    /// What the user wrote for this cell, on one line: only to say why it runs again.
    parameters: String,
}

/// Plans all cells.
pub fn jobs(prepared: Vec<Prepared>, options: &Options) -> Result<Vec<Job>, Diagnostic> {
    let mut truths: BTreeMap<(*const SceneData, String), Arc<Plan>> = BTreeMap::new();
    let mut jobs = Vec::new();
    for prepared in prepared {
        let plan = prepared.plan(options, &Capacities::new())?;
        let truth = match prepared.wants_truth() {
            false => None,
            true => {
                let key = (Arc::as_ptr(&prepared.data), truth::shading(&prepared.cell));
                if !truths.contains_key(&key) {
                    truths.insert(key.clone(), Arc::new(truth::plan(&prepared)?));
                }
                truths.get(&key).cloned()
            }
        };
        let parameters = parameters(&prepared, options);
        jobs.push(Job { prepared: Arc::new(prepared), plan, truth, parameters });
    }
    Ok(jobs)
}

fn parameters(prepared: &Prepared, options: &Options) -> String {
    let cell = &prepared.cell;
    let stages: Vec<String> = cell.stages.iter().map(|call| call.node.canonical()).collect();
    let measures: Vec<String> = cell.measures.iter().map(|call| call.node.canonical()).collect();
    let (stages, measures) = (stages.join(", "), measures.join(", "));
    let everything = if options.keep_everything { " everything" } else { "" };
    let dump = if options.dump.is_empty() { String::new() } else { format!(" dump {}", options.dump.join(", ")) };
    format!("[{stages}] {} [{measures}]{everything}{dump}", cell.scene_node.canonical())
}

impl Job {
    /// Everything that decides the cell's results; `terrain` is the hash of its heights.
    pub fn identity(&self, terrain: &str, gpu: &Gpu) -> Identity {
        let looks = self.prepared.measures.iter().any(|chosen| chosen.measure.looks_at_frames());
        Identity {
            plan: self.plan.fingerprint(),
            kernels: self.plan.kernels(),
            truth: self.truth.as_ref().map(|plan| plan.fingerprint()),
            truth_kernels: self.truth.as_ref().map_or(Vec::new(), |plan| plan.kernels()),
            // measures look with cameras in f64, of which a plan has what f32 can hold
            frames: looks.then(|| self.prepared.data.fingerprint()),
            measures: self.prepared.measures.iter().map(|chosen| chosen.identity()).collect(),
            terrain: terrain.into(),
            adapter: gpu.summary.identity(),
            format: records::FORMAT,
            parameters: self.parameters.clone(),
        }
    }

    /// The same job with longer lists.
    pub fn with_plan(&self, plan: Plan) -> Job {
        Job { prepared: self.prepared.clone(), plan, truth: self.truth.clone(), parameters: self.parameters.clone() }
    }

    /// Whether two jobs look at the same ground truth.
    pub fn shares_truth(&self, other: &Job) -> bool {
        match (&self.truth, &other.truth) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            _ => false,
        }
    }
}
