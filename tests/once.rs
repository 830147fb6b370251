//! What runs once, from one plan to the next: a frame after results that another plan has left is the frame after one's own.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use lodlab::gpu::{Executor, Gpu};
use lodlab::plan::once::{Shared, shared};
use lodlab::plan::{BufferId, Capacities, Often, Plan};
use lodlab::run::{Keep, Options, Setup, Tapped};
use lodlab::scene::SceneData;

const SCENE: &str = "terrain: Noise(kind: Ridged, seed: 3, size: (129, 97), cell_m: 20, height_m: (0, 600), wavelength_m: 900), \
                     camera: Still(eye: (200, 100, 900), look_at: (1300, 1500, 200)), viewport: (80, 60)";
const GRID: &str = "[HeightPyramid, ViewGrid(size: (33, 25)), Project, Rasterize, Shade]";
const CHAINS: [&str; 6] = [
    GRID,
    "[HeightPyramid, ViewGrid(size: (34, 25)), Project, Rasterize, Shade]",
    "[HeightPyramid, PlanePyramid, ViewGrid(size: (33, 25)), Project(filter: Finest), GridError(rule: Proven), LeadRays, \
     Rasterize, Compact, RayFill, Shade]",
    "[HeightPyramid, RayCast, Shade]",
    "[HeightPyramid, Roughness, VertexSplitting(threshold_px: 2), TriangleSplitting, Rasterize]",
    "[HeightPyramid, Roughness(error: Paper), VertexSplitting(threshold_px: 2), TriangleSplitting, Rasterize]",
];

fn setup(chain: &str) -> Setup {
    Setup::chain(SCENE, chain, Path::new(common::ROOT), Keep::Last).unwrap_or_else(|error| panic!("{error}"))
}

/// The plan's outputs by name, but for lists, whose order is anybody's.
fn outputs(executor: &Executor) -> BTreeMap<String, Vec<u8>> {
    let plan = executor.plan();
    let is_list = |id: &BufferId| plan.products.length_of(plan.source_of(*id)).is_some();
    let read = |&id: &BufferId| (plan.buffer(id).name.clone(), executor.read(id).unwrap());
    plan.outputs.iter().filter(|id| !is_list(id)).map(read).collect()
}

/// The first frame of a plan after what another has left, or after its own.
fn first_frame(gpu: &Arc<Gpu>, plan: &Arc<Plan>, data: &Arc<SceneData>, before: Option<&Executor>) -> Executor {
    let mut executor = Executor::without_waiting(gpu, plan, data, before).unwrap();
    executor.submit_setup().unwrap();
    executor.frame(0).unwrap();
    executor
}

/// The names of the buffers that are there already.
fn names(plan: &Plan, shared: &Shared) -> BTreeSet<String> {
    shared.buffers.keys().map(|id| plan.buffer(*id).name.clone()).collect()
}

#[test]
fn what_a_change_leaves_as_it_was_is_not_made_again() {
    let [grid, wider] = [CHAINS[0], CHAINS[1]].map(setup);
    let data = &grid.prepared.data;
    let own = shared((&grid.plan, data), (&grid.plan, data));
    let once = (0..grid.plan.steps.len()).filter(|at| grid.plan.steps[*at].often == Often::Once);
    assert_eq!(own.steps, once.collect(), "a plan has made all of its own");
    let found = shared((&grid.plan, data), (&wider.plan, data));
    assert_eq!(names(&wider.plan, &found), ["height", "height_mean"].map(String::from).into());
    let left: Vec<&str> = wider
        .plan
        .steps
        .iter()
        .enumerate()
        .filter(|(at, step)| step.often == Often::Once && !found.steps.contains(at))
        .map(|(_, step)| step.stage.as_str())
        .collect();
    assert_eq!(left, ["ViewGrid"]);
    // another terrain has another pyramid, though it may be as large; the grid is over the view
    let found = shared((&grid.plan, data), (&grid.plan, &wider.prepared.data));
    assert_eq!(names(&grid.plan, &found), ["grid_point"].map(String::from).into());
}

#[test]
fn frames_after_what_another_plan_has_left() {
    let gpu = Gpu::open(None).unwrap();
    let plain = CHAINS.map(setup);
    // copies of buffers after every stage are of what is there for a while only
    let tapped = CHAINS[..4].iter().map(|chain| Tapped::chain(SCENE, chain, Path::new(common::ROOT)).unwrap().setup);
    let tapped: Vec<Setup> = tapped.collect();
    let all: Vec<&Setup> = plain.iter().chain(&tapped).collect();
    let data = &all[0].prepared.data;
    for new in &all {
        let expected = outputs(&first_frame(&gpu, &new.plan, data, None));
        for old in &all {
            let found = shared((&old.plan, data), (&new.plan, data));
            assert!(names(&new.plan, &found).contains("height"), "{}", new.plan.chain);
            if std::ptr::eq(*old, *new) {
                let once = |at: &usize| new.plan.steps[*at].often == Often::Once;
                assert_eq!(found.steps, (0..new.plan.steps.len()).filter(once).collect(), "{}", texts(new));
            }
            let before = first_frame(&gpu, &old.plan, data, None);
            let after = first_frame(&gpu, &new.plan, data, Some(&before));
            // who was before may go
            drop(before);
            let frames = [outputs(&after), once_more(after)];
            for (name, bytes) in frames.iter().flatten() {
                assert!(expected[name] == *bytes, "{name} of {} after {}", texts(new), texts(old));
            }
        }
    }
}

/// The outputs of the frame when it is run once more, with each step that runs once as well.
fn once_more(mut executor: Executor) -> BTreeMap<String, Vec<u8>> {
    executor.setup_by_steps().unwrap();
    executor.frame(0).unwrap();
    outputs(&executor)
}

fn texts(setup: &Setup) -> String {
    setup.prepared.cell.stages.iter().map(|call| call.node.canonical()).collect::<Vec<_>>().join(", ")
}

const ADDING: &str = "
struct Params { size: vec2<u32> }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> src: array<f32>;
@group(0) @binding(2) var<storage, read_write> sum: array<f32>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.size) {
        let at = id.y * params.size.x + id.x;
        sum[at] += src[at];
    }
}
";

/// A kernel of one's own that adds to what is there may have run more than once: neither its result nor what comes of it is taken over.
#[test]
fn what_may_have_run_twice_is_made_again() {
    let gpu = Gpu::open(None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("adding.wgsl"), ADDING).unwrap();
    let kernel = |src: &str, sum: &str| {
        format!(
            "Kernel(file: \"adding.wgsl\", bind: {{\"src\": \"{src}\", \"sum\": New(name: \"{sum}\", of: F32, like: \"height\")}}, \
             over: \"{sum}\")"
        )
    };
    let chain = format!("[HeightPyramid, {}, {}, RayCast]", kernel("height", "once"), kernel("once", "twice"));
    let setup = Setup::chain(SCENE, &chain, folder.path(), Keep::Everything).unwrap_or_else(|error| panic!("{error}"));
    let (plan, data) = (&setup.plan, &setup.prepared.data);
    let once = |name: &str| plan.buffer(plan.find(name).unwrap()).often;
    assert_eq!([once("once"), once("twice")], [Often::Once; 2]);
    let found = names(plan, &shared((plan, data), (plan, data)));
    assert!(found.contains("height_max") && !found.contains("once") && !found.contains("twice"), "{found:?}");
    let mut before = first_frame(&gpu, plan, data, None);
    let expected = outputs(&before);
    before.setup_by_steps().unwrap();
    assert!(before.read(plan.find("once").unwrap()).unwrap() != expected["once"], "it has added up");
    assert!(outputs(&first_frame(&gpu, plan, data, Some(&before))) == expected);
}

/// Stages that make the same twice make two buffers of it, of which each may be looked at and replaced.
#[test]
fn what_is_made_twice_is_not_one() {
    let chain = "[HeightPyramid, HeightPyramid, ViewGrid(size: (33, 25)), Project, Rasterize, Shade]";
    let setup = Setup::chain(SCENE, chain, Path::new(common::ROOT), Keep::Everything).unwrap();
    let (plan, data) = (&*setup.plan, &*setup.prepared.data);
    let found = shared((plan, data), (plan, data));
    let olds: BTreeSet<BufferId> = found.buffers.values().copied().collect();
    assert_eq!(olds.len(), found.buffers.len());
    let pyramids = found.buffers.keys().filter(|id| plan.buffer(**id).name == "height_mean").count();
    assert_eq!(pyramids, 1, "the other one is made again");
}

/// What never ran has left nothing.
#[test]
fn what_never_ran_is_made() {
    let gpu = Gpu::open(None).unwrap();
    let setup = setup(GRID);
    let (plan, data) = (&setup.plan, &setup.prepared.data);
    let expected = outputs(&first_frame(&gpu, plan, data, None));
    let before = Executor::without_waiting(&gpu, plan, data, None).unwrap();
    assert!(outputs(&first_frame(&gpu, plan, data, Some(&before))) == expected);
}

/// Who looks at a buffer between two steps that write it has to see it made.
#[test]
fn what_is_seen_half_done_is_made_again() {
    let gpu = Gpu::open(None).unwrap();
    let setup = setup(GRID);
    let data = &setup.prepared.data;
    let dump = vec!["height_mean@HeightPyramid/levels 1 to 3".to_string()];
    let options = Options { dump, ..Options::default() };
    let plan = Arc::new(setup.prepared.plan(&options, &Capacities::new()).unwrap());
    let expected = outputs(&first_frame(&gpu, &plan, data, None));
    let before = first_frame(&gpu, &setup.plan, data, None);
    let found = names(&plan, &shared((&setup.plan, data), (&plan, data)));
    assert_eq!(found, ["height", "grid_point"].map(String::from).into());
    assert!(outputs(&first_frame(&gpu, &plan, data, Some(&before))) == expected);
}

/// Contents that somebody has put into a buffer are not what its steps make.
#[test]
fn what_was_replaced_is_made_again() {
    let gpu = Gpu::open(None).unwrap();
    let setup = setup(GRID);
    let (plan, data) = (&setup.plan, &setup.prepared.data);
    let mut before = first_frame(&gpu, plan, data, None);
    let expected = outputs(&before);
    let mean = plan.find("height_mean").unwrap();
    before.replace(mean, &vec![0; plan.buffer(mean).bytes() as usize]).unwrap();
    before.frame(0).unwrap();
    assert!(outputs(&before) != expected, "the pyramid matters");
    assert!(outputs(&first_frame(&gpu, plan, data, Some(&before))) == expected);
}
