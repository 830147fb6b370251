//! A cell as a job: what is carried out for it, and the identity that follows from that.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Options, Prepared, truth, walk};
use crate::experiment::Cell;
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Gpu;
use crate::plan::{Capacities, Plan};
use crate::report::records::{self, Identity, SceneSummary};
use crate::scene::{HEIGHT, Input, SceneData};

/// A cell, and the plan of the ground truth that it is compared with. Its own plan is made when it is needed: ten thousand of them are large.
pub struct Job {
    pub prepared: Arc<Prepared>,
    /// None if no measure looks at the truth. Jobs over the same frames share it.
    pub truth: Option<Arc<Plan>>,
    options: Arc<Options>,
    /// A plan in the place of the one that follows from the parameters: one with longer lists, for instance.
    own: Option<Arc<Plan>>,
    /// What the user wrote for this cell, on one line: only to say why it runs again.
    parameters: String,
}

/// The jobs of all cells.
pub fn jobs(prepared: Vec<Prepared>, options: &Options) -> Result<Vec<Job>, Diagnostic> {
    let mut truths: BTreeMap<(*const SceneData, String), Arc<Plan>> = BTreeMap::new();
    let options = Arc::new(options.clone());
    let mut jobs = Vec::new();
    for prepared in prepared {
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
        let parameters = parameters(&prepared, &options);
        jobs.push(Job { prepared: Arc::new(prepared), truth, options: options.clone(), own: None, parameters });
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
    let on_cpu = on_cpu(cell, options).map_or(String::new(), |stages| format!(" {stages}"));
    format!("[{stages}] {} [{measures}]{everything}{dump}{on_cpu}", cell.scene_node.canonical())
}

/// The stages of a cell that are computed on the CPU, if there are any.
fn on_cpu(cell: &Cell, options: &Options) -> Option<String> {
    let places = walk::find_stages(cell, &options.on_cpu);
    let names: Vec<String> = places.iter().map(|&at| format!("{at} {}", cell.stages[at].name)).collect();
    (!names.is_empty()).then(|| format!("on the CPU: {}", names.join(", ")))
}

impl Job {
    pub fn plan(&self) -> Result<Arc<Plan>, Diagnostic> {
        match &self.own {
            Some(own) => Ok(own.clone()),
            None => Ok(Arc::new(self.prepared.plan(&self.options, &Capacities::new())?)),
        }
    }

    /// Everything that decides the cell's results, its own plan among it; `hashes` knows those of inputs that were hashed before.
    pub fn identity(&self, plan: &Plan, hashes: &mut InputHashes, gpu: &Gpu) -> Identity {
        let data = &self.prepared.data;
        let looks = self.prepared.measures.iter().any(|chosen| chosen.measure.looks_at_frames());
        let is_used = |name: &str| {
            let uploads = |plan: &Plan| plan.buffers.iter().any(|buffer| buffer.name == name && buffer.is_input());
            uploads(plan) || self.truth.as_deref().is_some_and(uploads)
        };
        // heights are the ground's
        let used = data.inputs.iter().filter(|input| input.name != HEIGHT && is_used(input.name));
        Identity {
            plan: match on_cpu(&self.prepared.cell, &self.options) {
                None => plan.fingerprint(data),
                Some(stages) => format!("{}, {stages}", plan.fingerprint(data)),
            },
            kernels: plan.kernels(),
            truth: self.truth.as_ref().map(|plan| plan.fingerprint(data)),
            truth_kernels: self.truth.as_ref().map_or(Vec::new(), |plan| plan.kernels()),
            // measures look with cameras in f64, of which a plan has what f32 can hold
            frames: looks.then(|| data.fingerprint()),
            measures: self.prepared.measures.iter().map(|chosen| chosen.identity()).collect(),
            terrain: hashes.ground(data),
            inputs: used.map(|input| (input.name.to_string(), hashes.input(input))).collect(),
            adapter: gpu.summary.identity(),
            format: records::FORMAT,
            parameters: self.parameters.clone(),
        }
    }

    /// What the cell looks at.
    pub fn scene(&self, identity: &Identity) -> SceneSummary {
        let data = &self.prepared.data;
        let key = blake3::hash(format!("{} {}", identity.terrain, data.fingerprint()).as_bytes());
        let terrain = self.prepared.cell.scene_node.field("terrain").map(|node| node.canonical());
        SceneSummary {
            key: key.to_hex().as_str()[..16].into(),
            terrain: terrain.unwrap_or_default(),
            viewport: data.scene.viewport,
            frames: data.cameras().len(),
        }
    }

    /// The same job with another plan.
    pub fn with_plan(&self, plan: Plan) -> Job {
        let (prepared, truth, options) = (self.prepared.clone(), self.truth.clone(), self.options.clone());
        Job { prepared, truth, options, own: Some(Arc::new(plan)), parameters: self.parameters.clone() }
    }

    /// Whether two jobs look at the same ground truth, or, if neither looks at one, at the same scene.
    pub fn goes_with(&self, other: &Job) -> bool {
        match (&self.truth, &other.truth) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (None, None) => Arc::ptr_eq(&self.prepared.data, &other.prepared.data),
            _ => false,
        }
    }
}

/// Hashes of grounds and inputs by where they are in memory: cells share them.
#[derive(Default)]
pub struct InputHashes {
    known: BTreeMap<usize, String>,
}

impl InputHashes {
    fn ground(&mut self, data: &SceneData) -> String {
        let at = Arc::as_ptr(&data.ground).cast::<u8>() as usize;
        self.known.entry(at).or_insert_with(|| data.ground.identity()).clone()
    }

    fn input(&mut self, input: &Input) -> String {
        let at = input.bytes().as_ptr() as usize;
        self.known.entry(at).or_insert_with(|| input.identity()).clone()
    }
}
