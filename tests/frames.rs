//! Frames that come: a camera that the plan has not seen, what the frame before left, and what need not be computed again.

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use lodlab::camera::Camera;
use lodlab::check::{self, cases::Case};
use lodlab::frame::FrameInput;
use lodlab::gpu::submit::SubmissionTime;
use lodlab::gpu::{Executor, Gpu};
use lodlab::plan::{BufferId, Capacities, Demand, Plan};
use lodlab::run::{Keep, Setup};
use lodlab::stages::Example;

const TERRAIN: &str =
    "terrain: Noise(kind: Ridged, seed: 3, size: (129, 97), cell_m: 20, height_m: (0, 600), wavelength_m: 900)";
const PATH: &str = "Flight(frames: 6, clearance_m: 30, keys: [(eye: (200, 100, 900), look_at: (1300, 1500, 200)), \
                    (eye: (900, 700, 700), look_at: (2000, 900, 100))])";
const GRID: &str = "[HeightPyramid, PlanePyramid, ViewGrid(size: (33, 25)), AspectImportance(size: (16, 16)), Warp, Project(filter: Finest), \
                    GridError(rule: Proven), LeadRays, Rasterize, Compact, RayFill, Shade]";
const TREE: &str =
    "[HeightPyramid, Roughness, VertexSplitting(threshold_px: 2, start: LastFrame), TriangleSplitting, Rasterize]";

fn setup(camera: &str, chain: &str, keep: Keep) -> Setup {
    let scene = format!("{TERRAIN}, camera: {camera}, viewport: (80, 60)");
    let folder = Path::new(common::ROOT).join("experiments");
    Setup::chain(&scene, chain, &folder, keep).unwrap_or_else(|error| panic!("{error}"))
}

fn gpu() -> Arc<Gpu> {
    Gpu::open(None).unwrap()
}

/// The plan's outputs by name, as the last frame left them.
fn outputs(executor: &Executor) -> BTreeMap<String, Vec<u8>> {
    let plan = executor.plan();
    let read = |&id: &BufferId| (plan.buffer(id).name.clone(), executor.read(id).unwrap());
    plan.outputs.iter().map(read).collect()
}

/// The first elements of a list, as many as it has, in order of their bits: the order in the list is anybody's.
fn leaves(executor: &Executor) -> Vec<[u32; 2]> {
    let read = |name: &str| executor.read(executor.plan().find(name).unwrap()).unwrap();
    let count: Vec<u32> = bytemuck::pod_collect_to_vec(&read("leaf_count"));
    let mut leaves: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read("leaf"));
    leaves.truncate(count[3] as usize);
    leaves.sort_unstable();
    leaves
}

/// A camera that comes by itself has the bits that it has in a plan made for it.
#[test]
fn a_camera_that_the_plan_has_not_seen() {
    let gpu = gpu();
    for chain in [GRID, "[HeightPyramid, ViewGrid, Project, GridError, Rasterize]", "[HeightPyramid, RayCast, Shade]"] {
        let planned = setup(PATH, chain, Keep::Last);
        let other = setup("Still(eye: (1500, 100, 2000), look_at: (900, 900, 0))", chain, Keep::Last);
        let mut expected = planned.executor(&gpu).unwrap();
        let mut live = other.executor(&gpu).unwrap();
        live.frame(0).unwrap();
        let mut before: Option<FrameInput> = None;
        for (number, camera) in planned.prepared.data.cameras().iter().enumerate() {
            expected.frame(number).unwrap();
            let data = &other.prepared.data;
            let frame = before.map_or(FrameInput::first(data, *camera), |before| before.next(*camera));
            live.begin_live_frame(&frame).unwrap();
            live.submit_frame().unwrap();
            assert!(outputs(&live) == outputs(&expected), "{chain}, frame {number}");
            before = Some(frame);
        }
    }
}

/// A frame goes into an encoder that somebody else made and submits, and a plan can be for any view there is.
#[test]
fn a_plan_for_any_view_and_an_encoder_of_ones_own() {
    let gpu = gpu();
    let mut any = setup(PATH, "[HeightPyramid, RayCast]", Keep::Last);
    any.prepared.data = Arc::new(any.prepared.data.with_any_view());
    let chain = any.prepared.chain(&Capacities::new()).unwrap();
    let outputs_of_chain = chain.last_made();
    let demand = Demand { outputs: outputs_of_chain, keep_everything: false, reuse: false };
    any.plan = Arc::new(Plan::finish(chain, &demand));
    assert_eq!((any.plan.frames, any.plan.sees_underside), (0, true));
    let mut live = any.executor(&gpu).unwrap();
    assert!(live.frame(0).is_err(), "there is no path");
    // one above, one under the ground, one beside it
    for eye in [DVec3::new(900.0, 700.0, 900.0), DVec3::new(900.0, 700.0, -50.0), DVec3::new(-300.0, -200.0, 800.0)] {
        let look_at = DVec3::new(1300.0, 1000.0, 200.0);
        let [a, b] = [eye, look_at].map(|p| format!("({}, {}, {})", p.x, p.y, p.z));
        let planned = setup(&format!("Still(eye: {a}, look_at: {b})"), "[HeightPyramid, RayCast]", Keep::Last);
        let mut expected = planned.executor(&gpu).unwrap();
        expected.frame(0).unwrap();
        let camera = Camera::looking_at(eye, look_at, &any.prepared.data.scene);
        live.begin_live_frame(&FrameInput::first(&any.prepared.data, camera)).unwrap();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        live.encode_frame(&mut encoder).unwrap();
        gpu.queue.submit([encoder.finish()]);
        gpu.wait().unwrap();
        let floats = |executor: &Executor| -> Vec<f32> {
            bytemuck::pod_collect_to_vec(&executor.read(executor.plan().outputs[0]).unwrap())
        };
        // rays start nearer where nothing was known before: the same surface to the last digits
        let (ours, theirs) = (floats(&live), floats(&expected));
        assert!(ours.iter().any(|distance| *distance > 0.0), "{eye}");
        let differs = |(a, b): &(&f32, &f32)| (**a - **b).abs() > 1e-4 * b.abs();
        assert_eq!(ours.iter().zip(&theirs).filter(differs).count(), 0, "{eye}");
    }
}

/// A device that a window has made, with the least that any adapter has, gives the bits of one's own.
#[test]
fn a_device_of_somebody_else() {
    fn goes_anywhere<T: Send>() {}
    goes_anywhere::<Executor>();
    let setup = setup(PATH, "[HeightPyramid, RayCast, Shade]", Keep::Last);
    let own = gpu();
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let adapters = pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(wgpu::Backends::PRIMARY));
    let adapter = adapters.iter().find(|adapter| adapter.get_info().name == own.summary.name).unwrap();
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap();
    let adopted = Gpu::adopt(adapter, device, queue).unwrap();
    let [ours, theirs] = [own, adopted].map(|gpu| {
        let mut executor = setup.executor(&gpu).unwrap();
        executor.frame(2).unwrap();
        outputs(&executor)
    });
    assert!(ours == theirs);
}

/// A plan that leaves out the way under the surface refuses a camera there.
#[test]
fn a_camera_where_the_plan_is_not_for() {
    let planned = setup(PATH, "[HeightPyramid, RayCast]", Keep::Last);
    let mut executor = planned.executor(&gpu()).unwrap();
    let data = &planned.prepared.data;
    let camera = Camera::looking_at(DVec3::new(900.0, 700.0, -50.0), DVec3::new(900.0, 900.0, 0.0), &data.scene);
    let refused = executor.begin_live_frame(&FrameInput::first(data, camera)).unwrap_err();
    assert!(refused.to_string().contains("under the surface"), "{refused}");
}

/// The tree of the frame before gives the leaves that the root gives: on the path, after jumps, after resets, for a camera that comes
/// from elsewhere, and when the path goes on.
#[test]
fn a_tree_goes_through_cuts_and_resets() {
    let gpu = gpu();
    let kept = setup(PATH, TREE, Keep::Everything);
    let plain = setup(PATH, &TREE.replace("LastFrame", "Root"), Keep::Everything);
    assert!(kept.plan.remembers() && !plain.plan.remembers());
    let mut tree = kept.executor(&gpu).unwrap();
    let mut root = plain.executor(&gpu).unwrap();
    let mut seen = Vec::new();
    // -1 is a reset, and 100 a camera that is not on the path
    for step in [0, 1, 2, 2, 5, 0, -1, 3, 4, 100, 1, 2, -1, -1, 2] {
        match step {
            -1 => {
                tree.reset_history();
                continue;
            }
            100 => {
                let camera = kept.prepared.data.cameras()[3];
                for (executor, setup) in [(&mut tree, &kept), (&mut root, &plain)] {
                    let frame =
                        FrameInput::first(&setup.prepared.data, Camera { eye_m: camera.eye_m + 50.0, ..camera });
                    executor.begin_live_frame(&frame).unwrap();
                    executor.submit_frame().unwrap();
                }
            }
            frame => {
                tree.frame(frame as usize).unwrap();
                root.frame(frame as usize).unwrap();
            }
        }
        assert_eq!(leaves(&tree), leaves(&root), "{step} after {seen:?}");
        seen.push(step);
    }
    // cameras that come from elsewhere, near where the first one was: nobody knows the way between them
    let data = &kept.prepared.data;
    let near = data.cameras()[1];
    let by = |metres: f64| Camera { eye_m: near.eye_m + metres, ..near };
    let first = FrameInput::first(data, by(0.0));
    for frame in [first, first.next(by(0.5)), FrameInput::first(data, by(700.0)), FrameInput::first(data, by(20.0))] {
        tree.begin_live_frame(&frame).unwrap();
        tree.submit_frame().unwrap();
        root.begin_live_frame(&FrameInput { data: &plain.prepared.data, ..frame }).unwrap();
        root.submit_frame().unwrap();
        assert_eq!(leaves(&tree), leaves(&root), "{:?}", frame.camera.eye_m);
    }
    // what was kept is used: a frame begins with the nodes that the one before has left, and after a reset with none
    let nodes = |tree: &Executor, name: &str| -> u32 {
        bytemuck::pod_collect_to_vec(&tree.read(kept.plan.find(name).unwrap()).unwrap())[3]
    };
    tree.frame(3).unwrap();
    let left = nodes(&tree, "tree_count");
    assert!(left > 100);
    tree.frame(4).unwrap();
    assert_eq!(nodes(&tree, "tree_count.last"), left);
    tree.reset_history();
    tree.frame(5).unwrap();
    assert_eq!(nodes(&tree, "tree_count.last"), 0);
    assert!(nodes(&tree, "tree_count") > 100);
}

/// After a reset a frame finds zeros, and is told that it is a cut.
#[test]
fn a_reset_forgets() {
    let chain = "[HeightPyramid, RayCast, Kernel(file: \"kernels/change.wgsl\", bind: {\"now\": \"distance\", \"before\": Last(\"distance\"), \
                 \"change\": New(name: \"change\", of: F32, like: \"distance\")}, over: \"change\")]";
    let setup = setup(PATH, chain, Keep::Everything);
    let mut executor = setup.executor(&gpu()).unwrap();
    let change = |executor: &Executor| -> f32 {
        let bytes = executor.read(setup.plan.find("change").unwrap()).unwrap();
        bytemuck::pod_collect_to_vec::<u8, f32>(&bytes).into_iter().fold(0.0, |most, change| most.max(change.abs()))
    };
    let mut after = |frame: usize, resets: bool| {
        if resets {
            executor.reset_history();
        }
        executor.frame(frame).unwrap();
        change(&executor)
    };
    assert_eq!(after(0, false), 0.0, "before the first frame there was none");
    assert!(after(1, false) > 1.0);
    assert_eq!(after(1, false), 0.0, "the same frame again changes nothing");
    assert_eq!(after(2, true), 0.0, "nothing is left after a reset");
    assert!(after(3, false) > 1.0);
    assert_eq!(after(1, false), 0.0, "a jump is a cut");
}

/// A stage reads what a later stage left in the frame before, and its reference does the same.
#[test]
fn a_stage_reads_what_a_later_one_left() {
    // the first kernel compares heights with what the second, which comes after it, made of that comparison in the frame before
    const CHANGE: &str = include_str!("../experiments/kernels/change.wgsl");
    const CURVATURE: &str = include_str!("../experiments/kernels/curvature.wgsl");
    static FEEDBACK: [Example; 1] = [Example::new(
        "[Kernel(file: \"change.wgsl\", bind: {\"now\": \"height\", \"before\": Last(\"curvature\"), \
         \"change\": New(name: \"change\", of: F32, like: \"height\")}, over: \"change\"), \
         Kernel(file: \"curvature.wgsl\", bind: {\"src\": \"change\", \"dst\": New(name: \"curvature\", of: F32, like: \"height\")}, \
         params: (scale: 300), over: \"curvature\")]",
    )
    .with_files(&[("change.wgsl", CHANGE), ("curvature.wgsl", CURVATURE)])];
    let scene = format!("{TERRAIN}, camera: {PATH}, viewport: (67, 45)");
    let case = Case { name: "feedback".into(), scene, examples: FEEDBACK.iter().collect() };
    let outcomes = check::run_case(&gpu(), &case).unwrap();
    let compared: Vec<&str> = outcomes.iter().map(|outcome| outcome.buffer.as_str()).collect();
    assert_eq!(compared, ["change", "curvature"]);
    for outcome in &outcomes {
        assert!(outcome.passed(), "{outcome}");
        assert_eq!(outcome.local.compared, 6 * 129 * 97, "{outcome}");
        // the loop is not one of zeros
        assert!(outcome.local.largest > 0.0 && outcome.accumulated.largest > 0.0, "{outcome}");
    }
}

/// An output that is made only where somebody wants it is wanted by who reads it in the next frame.
#[test]
fn the_next_frame_wants_what_nobody_reads_in_this_one() {
    let chain = "[Slope, Kernel(file: \"kernels/smooth.wgsl\", bind: {\"src\": Last(\"slope\"), \"dst\": New(name: \"smooth\", of: F32, \
                 like: \"slope\")}, over: \"smooth\")]";
    let setup = setup(PATH, chain, Keep::Last);
    let mut executor = setup.executor(&gpu()).unwrap();
    let steepest = |executor: &Executor| -> f32 {
        let bytes = executor.read(setup.plan.outputs[0]).unwrap();
        bytemuck::pod_collect_to_vec::<u8, f32>(&bytes).into_iter().fold(0.0, f32::max)
    };
    executor.frame(0).unwrap();
    assert_eq!(steepest(&executor), 0.0);
    executor.frame(1).unwrap();
    assert!(steepest(&executor) > 10.0);
}

/// What a frame was told of a cut is not taken over by the next one, which is none.
#[test]
fn a_cut_is_not_taken_over() {
    let scene = format!(
        "{TERRAIN}, camera: Still(frames: 4, eye: (200, 100, 900), look_at: (1300, 1500, 200)), viewport: (80, 60)"
    );
    let chain =
        "[Kernel(file: \"cut.wgsl\", bind: {\"told\": New(name: \"told\", of: U32, size: (1, 1))}, over: (1, 1))]";
    let folder = Path::new(common::ROOT).join("tests/kernels_of_tests");
    let mut setup = Setup::chain(&scene, chain, &folder, Keep::Last).unwrap();
    let stated = setup.prepared.chain(&Capacities::new()).unwrap();
    let demand = Demand { outputs: stated.last_made(), keep_everything: false, reuse: true };
    let plan = Plan::finish(stated, &demand);
    assert_eq!(plan.reused.len(), 3);
    setup.plan = Arc::new(plan);
    let mut executor = setup.executor(&gpu()).unwrap();
    let mut told = |frame: usize| {
        let steps = executor.frame(frame).unwrap().steps.len();
        (executor.read(setup.plan.outputs[0]).unwrap()[0], steps)
    };
    assert_eq!([0, 1, 2, 0, 1, 2].map(&mut told), [(1, 1), (0, 1), (0, 0), (1, 1), (0, 1), (0, 0)]);
}

/// What the time of the method is of: all steps of a frame but those that the drawn surface does not depend on.
#[test]
fn the_method_is_timed_without_its_picture() {
    let setup = setup(PATH, GRID, Keep::Last);
    let mut executor = setup.executor(&gpu()).unwrap();
    let stages = |time: SubmissionTime| -> Vec<String> {
        time.steps.iter().map(|time| setup.plan.steps[time.step].stage.clone()).collect()
    };
    let mut whole = stages(executor.timed_frame(0).unwrap());
    let method = stages(executor.timed_method(1).unwrap());
    assert!(method.iter().any(|stage| stage == "RayFill"), "{method:?}");
    assert_eq!(whole.pop().as_deref(), Some("Shade"));
    assert_eq!(whole, method);
}

/// A frame with the camera of the one before leaves out what depends on nothing else, and no bit changes.
#[test]
fn a_step_whose_inputs_are_as_before_is_left_out() {
    let gpu = gpu();
    // stands still twice
    let keys = "keys: [(eye: (200, 100, 900), look_at: (1300, 1500, 200)), (eye: (200, 100, 900), look_at: (1300, 1500, 200)), \
                (eye: (200, 100, 900), look_at: (1300, 1500, 200)), (eye: (900, 700, 700), look_at: (2000, 900, 100)), \
                (eye: (900, 700, 700), look_at: (2000, 900, 100)), (eye: (900, 700, 700), look_at: (2000, 900, 100))]";
    let path = format!("Flight(frames: 6, {keys})");
    for chain in [GRID, TREE] {
        let mut reused = setup(&path, chain, Keep::Last);
        let chain_of = reused.prepared.chain(&Capacities::new()).unwrap();
        let demand = Demand { outputs: chain_of.last_made(), keep_everything: false, reuse: true };
        let plan = Plan::finish(chain_of, &demand);
        reused.plan = Arc::new(plan);
        let plain = setup(&path, chain, Keep::Last);
        assert!(plain.plan.reused.is_empty());
        let frames: Vec<usize> = reused.plan.reused.keys().copied().collect();
        let mut again = reused.executor(&gpu).unwrap();
        let mut all = plain.executor(&gpu).unwrap();
        for frame in [0, 1, 2, 3, 4, 5, 2, 4, 5, 0, 1] {
            let steps = again.frame(frame).unwrap().steps.len();
            let every = all.frame(frame).unwrap().steps.len();
            // history is never left out, and everything else in a frame that follows one like it
            assert!(steps <= every, "{chain}: {steps} of {every}");
            assert!(outputs(&again) == outputs(&all), "{chain}, frame {frame}");
        }
        match chain {
            GRID => assert_eq!(frames, [1, 2, 4, 5]),
            _ => assert!(reused.plan.remembers()),
        }
        // a jump onto such a frame runs all of it
        again.frame(0).unwrap();
        let jumped = again.frame(5).unwrap().steps.len();
        assert_eq!(jumped, all.frame(5).unwrap().steps.len(), "{chain}");
    }
}

/// What is dumped after a step is what the buffer holds there, and dumping changes no bit of anything else.
#[test]
fn a_buffer_after_any_step() {
    let folder = tempfile::tempdir().unwrap();
    let scene =
        format!("{TERRAIN}, camera: Still(eye: (200, 100, 900), look_at: (1300, 1500, 200)), viewport: (80, 60)");
    let chain = GRID.replace(", Shade", "");
    let text = format!("Experiment(scene: ({scene}), chains: {{\"grid\": {chain}}}, measure: [ScreenError])");
    std::fs::write(folder.path().join("taps.ron"), text).unwrap();
    let dumps =
        ["vertex@Project", "vertex@GridError/raise", "vertex", "distance@Rasterize", "distance", "grid_point@grid"];
    let mut arguments = vec!["run", "taps.ron", "--out", "tapped"];
    dumps.iter().for_each(|dump| arguments.extend(["--dump", dump]));
    common::succeeded(&common::run(folder.path(), &arguments));
    common::succeeded(&common::run(folder.path(), &["run", "taps.ron", "--out", "plain"]));
    let [tapped, plain] = ["tapped", "plain"].map(|out| common::records(&folder.path().join(out)).remove(0));
    assert_eq!(tapped["measures"], plain["measures"]);
    let hash = |name: &str| {
        let buffers = tapped["buffers"].as_array().unwrap();
        let named = buffers.iter().find(|buffer| buffer[0] == name).unwrap_or_else(|| panic!("{name}: {buffers:?}"));
        named[1].as_str().unwrap().to_string()
    };
    // before the grid is raised it is another one; after its last step it is what is left
    assert_ne!(hash("vertex@Project"), hash("vertex"));
    assert_eq!(hash("vertex@GridError/raise"), hash("vertex"));
    // rays have filled in what the mesh did not show well enough
    assert_ne!(hash("distance@Rasterize"), hash("distance"));
    let cell = tapped["hash"].as_str().unwrap();
    let dumped = folder.path().join("tapped/dumps").join(cell).join("vertex@GridError_raise_0000.npy");
    assert!(dumped.is_file(), "{}", dumped.display());
}

/// Frames of a path beyond what is packed ahead have their own parameters.
#[test]
fn a_path_longer_than_what_is_packed() {
    let gpu = gpu();
    let long = PATH.replace("frames: 6", "frames: 700");
    let setup = setup(&long, "[HeightPyramid, RayCast]", Keep::Last);
    let mut executor = setup.executor(&gpu).unwrap();
    for frame in [0, 255, 256, 511, 512, 699, 3] {
        executor.frame(frame).unwrap();
        let ours = outputs(&executor);
        let mut live = setup.executor(&gpu).unwrap();
        live.begin_live_frame(&FrameInput::of_path(&setup.prepared.data, frame).unwrap()).unwrap();
        live.submit_frame().unwrap();
        assert!(ours == outputs(&live), "frame {frame}");
    }
    assert!(executor.frame(700).is_err());
}

/// A frame whose parameters go to the device alone is the frame whose parameters were packed ahead, in a row and after a jump.
#[test]
fn a_frame_of_the_path_by_itself() {
    let gpu = gpu();
    for chain in [GRID, TREE] {
        let setup = setup(PATH, chain, Keep::Last);
        let mut packed = setup.executor(&gpu).unwrap();
        let mut single = setup.executor(&gpu).unwrap();
        for frame in [0, 1, 2, 2, 5, 3, 4] {
            packed.frame(frame).unwrap();
            single.begin_single_path_frame(frame).unwrap();
            single.submit_frame().unwrap();
            match chain {
                TREE => assert!(leaves(&single) == leaves(&packed), "{chain}, frame {frame}"),
                _ => assert!(outputs(&single) == outputs(&packed), "{chain}, frame {frame}"),
            }
        }
        assert!(single.begin_single_path_frame(6).is_err(), "the path has six frames");
    }
}
