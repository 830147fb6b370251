//! A record's identity is what is carried out: what changes that runs cells again and says why, and nothing else does.

mod common;

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::Source;
use lodlab::experiment::tree::Node;
use lodlab::gpu::Gpu;
use lodlab::kernel::Kernel;
use lodlab::plan::{Plan, Run, Work};
use lodlab::run::{self, Event, Job, Options, Prepared};
use lodlab::{experiment::StageCall, stages};

const CHAIN: &str = "HeightPyramid, ViewGrid(size: (8, 8)), Project, Rasterize";

fn experiment(chain: &str, measure: &str) -> Experiment {
    let text = format!(
        "Experiment(title: \"identity\", scene: (terrain: Shape(kind: Sine, size: (33, 33)), \
         camera: Still(eye: (400, -300, 1500), look_at: (400, 500, 0)), viewport: (32, 24)), \
         chains: {{\"grid\": [{chain}]}}, measure: [{measure}])"
    );
    Experiment::read(Source::new("identity.ron", text), "".into()).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs what an experiment comes to after a change that no text shows; the reasons of the cells that ran.
fn reasons(
    folder: &Path,
    experiment: &Experiment,
    stages: impl Fn(&mut Prepared),
    plans: impl Fn(&mut Job),
) -> Vec<String> {
    let gpu = Gpu::open(None).unwrap();
    let options = Options::default();
    let mut prepared = run::prepare(experiment, &[]).unwrap();
    prepared.iter_mut().for_each(stages);
    let mut jobs = run::jobs(prepared, &options).unwrap();
    jobs.iter_mut().for_each(plans);
    let reasons = RefCell::new(Vec::new());
    let tell = |event| {
        if let Event::CellStarted { reason, .. } = event {
            reasons.borrow_mut().push(reason);
        }
    };
    run::carry_out("identity", jobs, &gpu, folder, &options, &tell).unwrap_or_else(|error| panic!("{error}"));
    reasons.into_inner()
}

fn unchanged(_: &mut Prepared) {}
fn as_planned(_: &mut Job) {}

fn stage(text: &str) -> Box<dyn stages::Stage> {
    let node = Node::read(&Source::new("test", text)).unwrap();
    let call = StageCall { name: node.name().unwrap().to_string(), node };
    stages::read(&call, Path::new("")).unwrap()
}

fn runs(plan: &mut Plan) -> impl Iterator<Item = &mut Run> {
    plan.steps.iter_mut().filter_map(|step| match &mut step.work {
        Work::Run(run) => Some(run.as_mut()),
        _ => None,
    })
}

#[test]
fn a_changed_default_runs_cells_again() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = experiment(CHAIN, "ScreenError");
    assert_eq!(reasons(folder.path(), &experiment, unchanged, as_planned), ["new"]);
    assert_eq!(reasons(folder.path(), &experiment, unchanged, as_planned), [""; 0]);
    // the text still says `Project`, and a program with another default reads it like this
    let other_default = |prepared: &mut Prepared| prepared.stages[2] = stage("Project(filter: Finest)");
    let changed = reasons(folder.path(), &experiment, other_default, as_planned);
    assert_eq!(changed, ["changed: what lodlab makes of the same parameters"]);
}

#[test]
fn a_changed_constant_in_planning_code_runs_cells_again() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = experiment(CHAIN, "ScreenError");
    reasons(folder.path(), &experiment, unchanged, as_planned);
    let coarser = |job: &mut Job| {
        let mut plan = (*job.plan().unwrap()).clone();
        for run in runs(&mut plan) {
            let snap = run.params.iter_mut().filter(|(name, _)| name == "snap_px");
            snap.for_each(|(_, value)| *value = 0.2f32.into());
        }
        *job = job.with_plan(plan);
    };
    let changed = reasons(folder.path(), &experiment, unchanged, coarser);
    assert_eq!(changed, ["changed: what lodlab makes of the same parameters"]);
}

/// The plan with another text of one kernel.
fn with_kernel(plan: &Plan, name: &str, change: (&str, &str)) -> Plan {
    let mut plan = plan.clone();
    for run in runs(&mut plan).filter(|run| run.kernel.name == name) {
        let source = &run.kernel.assembled.main;
        assert!(source.text.contains(change.0), "{name} has no `{}`", change.0);
        let text = source.text.replace(change.0, change.1);
        run.kernel = Kernel::from_source(Source::new(source.name.clone(), text), true, None).unwrap();
    }
    plan
}

#[test]
fn a_changed_kernel_of_the_ground_truth_runs_cells_again() {
    let folder = tempfile::tempdir().unwrap();
    let change = ("// ", "// changed: ");
    let other_truth = |job: &mut Job| {
        let truth = job.truth.as_deref().map(|plan| Arc::new(with_kernel(plan, "ray_cast.wgsl", change)));
        job.truth = truth;
    };
    let measured = experiment(CHAIN, "ScreenError");
    reasons(folder.path(), &measured, unchanged, as_planned);
    let changed = reasons(folder.path(), &measured, unchanged, other_truth);
    assert_eq!(changed, ["changed: kernel ray_cast.wgsl of the ground truth"]);
    // whoever does not look at the truth does not care
    let timed = experiment(CHAIN, "Time");
    reasons(folder.path(), &timed, unchanged, as_planned);
    assert_eq!(reasons(folder.path(), &timed, unchanged, other_truth), [""; 0]);
    let own = |job: &mut Job| *job = job.with_plan(with_kernel(&job.plan().unwrap(), "project.wgsl", change));
    assert_eq!(reasons(folder.path(), &timed, unchanged, own), ["changed: kernel project.wgsl"]);
}

#[test]
fn what_is_measured_is_part_of_a_cell() {
    let folder = tempfile::tempdir().unwrap();
    reasons(folder.path(), &experiment(CHAIN, "ScreenError"), unchanged, as_planned);
    let other = experiment(CHAIN, "ScreenError(threshold_px: 2)");
    let changed = reasons(folder.path(), &other, unchanged, as_planned);
    assert!(changed.len() == 1 && changed[0].contains("measure ScreenError/"), "{changed:?}");
}

#[test]
fn how_it_is_written_is_no_part_of_a_cell() {
    let folder = tempfile::tempdir().unwrap();
    reasons(folder.path(), &experiment(CHAIN, "ScreenError, Time"), unchanged, as_planned);
    let written =
        "HeightPyramid(), /* points */ ViewGrid(size: (8, 8)), Project(filter: Trilinear, max_level: None), Rasterize";
    let same = experiment(written, "ScreenError(threshold_px: 1), Time(warmup: 2)");
    assert_eq!(reasons(folder.path(), &same, unchanged, as_planned), [""; 0]);
    // a stage that is left out does nothing
    let more = experiment(&format!("{CHAIN}, Shade"), "ScreenError, Time");
    assert_eq!(reasons(folder.path(), &more, unchanged, as_planned), [""; 0]);
}

/// Two chains that come to the same are one cell, under both names.
#[test]
fn cells_that_compute_the_same_run_once() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "Experiment(scene: (terrain: Shape(kind: Sine, size: (33, 33)), camera: Still(eye: (400, -300, 1500), \
         look_at: (400, 500, 0)), viewport: (64, 48)), chains: {{ \"a\": [{CHAIN}], \"b\": [{}] }}, measure: [ScreenError])",
        CHAIN.replace("Project", "Project(filter: Trilinear)")
    );
    common::records_of(folder.path(), &text, &[]);
    let chains = |rows: &[serde_json::Value]| rows.iter().map(|row| row["chain"].to_string()).collect::<Vec<_>>();
    let rows = common::rows(&folder.path().join("made"));
    assert_eq!(chains(&rows), ["\"a\"", "\"b\""]);
    assert_eq!(rows[0]["error_mean"], rows[1]["error_mean"]);
    assert_eq!(std::fs::read_dir(folder.path().join("made/cells")).unwrap().count(), 1);
    // neither is left, and whoever makes the reports again knows both names
    let left = common::run(folder.path(), &["cells", "made.ron", "--left", "made"]);
    assert_eq!(String::from_utf8_lossy(&left.stdout), "");
    common::succeeded(&common::run(folder.path(), &["report", "made"]));
    assert_eq!(chains(&common::rows(&folder.path().join("made"))), ["\"a\"", "\"b\""]);
}

/// Buffers that nobody touches, and names, change nothing; sizes do.
#[test]
fn a_fingerprint_is_of_what_is_carried_out() {
    let plan = |chain: &str| {
        let experiment = experiment(chain, "ScreenError");
        let prepared = run::prepare(&experiment, &[]).unwrap();
        run::plan(&prepared[0], &Options::default()).unwrap().fingerprint(&prepared[0].data)
    };
    let own = plan(CHAIN);
    assert_eq!(own, plan(&CHAIN.replace("Project", "PlanePyramid, Project")));
    assert_ne!(own, plan(&CHAIN.replace("(8, 8)", "(8, 9)")));
}
