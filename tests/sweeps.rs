//! Sweeps as a researcher makes them: what is warned of, what stands apart, shards and lists of cells, reports and comparisons of folders.

mod common;

use std::path::Path;
use std::process::Output;
use std::time::{Duration, Instant};

use common::{errors, lodlab, records, rows, run as run_in, succeeded};
use lodlab::experiment::{Experiment, diagnostic::Source};
use lodlab::gpu::Gpu;
use lodlab::measure::Measured;
use lodlab::plan::Work;
use lodlab::report::standing::{self, Standing};
use lodlab::report::{Record, Results};
use lodlab::run::{self, Options};
use serde_json::Value;

const SCENE: &str = "terrain: Noise(kind: Fbm, size: (65, 65), wavelength_m: 700), \
    camera: Still(frames: 3, eye: (900, -100, 1400), look_at: (900, 900, 400)), viewport: (64, 48)";
const GRID: &str = "HeightPyramid, ViewGrid(size: (12, 9)), Project, Rasterize";
const OPEN: &str = "HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: 8), TriangleSplitting(split: false), Rasterize";

fn experiment(folder: &Path, fields: &str) {
    std::fs::write(folder.join("made.ron"), format!("Experiment(title: \"made\", {fields})")).unwrap();
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).to_string()
}

/// What a record says but for times.
fn timeless(folder: &Path) -> Vec<Value> {
    let mut all: Vec<Value> = std::fs::read_dir(folder.join("cells"))
        .unwrap()
        .map(|entry| serde_json::from_slice(&std::fs::read(entry.unwrap().path()).unwrap()).unwrap())
        .collect();
    for record in &mut all {
        ["timings", "made", "digest"].iter().for_each(|field| {
            record.as_object_mut().unwrap().remove(*field);
        });
    }
    all.sort_by_key(|record| record["hash"].to_string());
    all
}

#[test]
fn a_picture_with_holes_stands_apart() {
    let folder = tempfile::tempdir().unwrap();
    experiment(
        folder.path(),
        &format!(
            "scene: ({SCENE}), chains: {{\"grid\": [{GRID}], \"open\": [{OPEN}]}}, measure: [ScreenError, Mesh, Time]"
        ),
    );
    let output = run_in(folder.path(), &["run", "made.ron", "--out", "out"]);
    succeeded(&output);
    let text = said(&output);
    assert!(text.contains("! open: ") && text.contains("has holes") && text.contains("it is on no front"), "{text}");
    let rows = rows(&folder.path().join("out"));
    assert_eq!(rows[0]["status"], "ok");
    assert_eq!(rows[1]["status"], "faulty");
    // in the table of equal errors, a chain of nothing else reaches nothing
    let line = text.lines().find(|line| line.starts_with("| rms <= 2 px")).unwrap();
    assert_eq!(line.split('|').nth(3).unwrap().trim(), "only faulty", "{text}");
}

#[test]
fn what_does_nothing_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let kernel = "@group(0) @binding(0) var<storage, read> src: array<f32>;
@group(0) @binding(1) var<storage, read_write> dst: array<f32>;
struct Params { size: vec2<u32>, scale: f32 }
@group(0) @binding(2) var<uniform> params: Params;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.size) { let at = id.y * params.size.x + id.x; dst[at] = params.scale * src[at]; }
}";
    std::fs::write(folder.path().join("scale.wgsl"), kernel).unwrap();
    let chain = |name: &str| {
        format!(
            "HeightPyramid, ViewGrid(size: (12, 9)), AspectImportance, Kernel(file: \"scale.wgsl\", bind: {{\"src\": \"importance\", \
             \"dst\": New(name: \"{name}\", of: F32, like: \"importance\")}}, params: (scale: 1), over: \"{name}\"), Warp, Project, Rasterize"
        )
    };
    let fields = |name: &str| {
        format!(
            "scene: ({SCENE}), chains: {{\"mine\": [{}]}}, sweep: {{\"mine.Kernel.params.scale\": [1, 2]}}, measure: [ScreenError]",
            chain(name)
        )
    };
    experiment(folder.path(), &fields("importanc"));
    let text = said(&run_in(folder.path(), &["run", "made.ron", "--out", "out"]));
    assert!(text.contains("`Kernel` does not run in `mine`") && text.contains("did you mean `importance`?"), "{text}");
    assert!(text.contains("the axis `mine.Kernel.params.scale` changes nothing that runs in `mine`"), "{text}");
    experiment(folder.path(), &fields("importance"));
    let text = said(&run_in(folder.path(), &["run", "made.ron", "--out", "out"]));
    assert!(!text.contains("does not run") && !text.contains("changes nothing"), "{text}");
    // and each new buffer has its line
    assert!(text.contains("`importance` after the first frame: "), "{text}");
}

#[test]
fn a_kernel_that_makes_no_numbers_or_only_some_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let kernel = |value: &str| {
        format!(
            "@group(0) @binding(0) var<storage, read_write> x: array<f32>;
@compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{ let zero = f32(id.x) * 0.0; x[id.x] = {value}; }}"
        )
    };
    std::fs::write(folder.path().join("nan.wgsl"), kernel("sqrt(zero - 1.0)")).unwrap();
    std::fs::write(folder.path().join("fine.wgsl"), kernel("zero + 2.5")).unwrap();
    let chain = |name: &str, over: u32| {
        format!(
            "\"{name}\": [Kernel(file: \"{name}.wgsl\", bind: {{\"x\": New(name: \"{name}\", of: F32, size: (6, 1))}}, over: ({over}, 1))]"
        )
    };
    experiment(
        folder.path(),
        &format!("scene: ({SCENE}), chains: {{{}, {}}}, measure: [Time]", chain("nan", 6), chain("fine", 4)),
    );
    let output = run_in(folder.path(), &["run", "made.ron", "--out", "out"]);
    let text = said(&output);
    assert!(text.contains("warning: `nan` after the first frame: no finite number; of 6 elements 6 NaN"), "{text}");
    assert!(
        text.contains("warning: `fine` after the first frame: 2.500000 to 2.500000; of 6 elements 2 never written"),
        "{text}"
    );
    assert!(records(&folder.path().join("out"))[0]["warnings"].to_string().contains("6 NaN"));
}

#[test]
fn what_the_command_line_sets_is_an_axis_of_one_value() {
    let folder = tempfile::tempdir().unwrap();
    let fields = format!(
        "scene: ({SCENE}), chains: {{\"grid\": [{GRID}], \"exact\": [HeightPyramid, RayCast]}}, \
         sweep: {{\"*.ViewGrid.size\": [(8, 6), (12, 9)]}}, measure: [ScreenError, Time]"
    );
    experiment(folder.path(), &fields);
    let set = ["run", "made.ron", "--out", "out", "--frames", "2", "--set", "*.Project.filter=Finest,Trilinear"];
    succeeded(&run_in(folder.path(), &set));
    let rows = rows(&folder.path().join("out"));
    // two sizes and two filters of the grid; the ray cast has neither
    assert_eq!(rows.len(), 5);
    for row in &rows {
        assert_eq!(row["scene.camera.frames"], 2);
        let is_grid = row["chain"] == "grid";
        assert_eq!(
            (row["*.ViewGrid.size.0"].is_u64(), row["*.Project.filter"].is_string()),
            (is_grid, is_grid),
            "{row}"
        );
    }
    let labels: Vec<&str> = rows.iter().map(|row| row["label"].as_str().unwrap()).collect();
    assert!(
        labels.contains(&"grid size=(8,6) frames=2 filter=Finest")
            || labels.contains(&"grid size=(8,6) filter=Finest frames=2"),
        "{labels:?}"
    );
}

#[test]
fn names_of_a_file_are_those_of_its_tables() {
    let folder = tempfile::tempdir().unwrap();
    let flat =
        SCENE.replace("Noise(kind: Fbm, size: (65, 65), wavelength_m: 700)", "Shape(kind: Sine, size: (65, 65))");
    experiment(
        folder.path(),
        &format!(
            "scenes: {{\"hills\": ({SCENE}), \"waves\": ({flat})}}, pieces: {{\"points\": [HeightPyramid, ViewGrid]}}, \
             chains: {{\"a\": [Piece(\"points\"), Project, Rasterize], \"b\": [Piece(\"points\"), Project(filter: Finest), Rasterize]}}, \
             sweep: {{\"points = a.ViewGrid.size, b.ViewGrid.size\": {{\"few\": (8, 6), \"many\": (24, 18)}}}}, \
             baseline: \"b\", measure: [ScreenError, Time]"
        ),
    );
    let output = run_in(folder.path(), &["run", "made.ron", "--out", "out"]);
    succeeded(&output);
    let rows = rows(&folder.path().join("out"));
    let labels: Vec<&str> = rows.iter().map(|row| row["label"].as_str().unwrap()).collect();
    assert_eq!(labels[..3], ["a scene=hills points=few", "a scene=hills points=many", "b scene=hills points=few"]);
    assert_eq!((rows.len(), &rows[0]["points"], &rows[7]["scene"]), (8, &"few".into(), &"waves".into()));
    // no column is there twice
    let header = std::fs::read_to_string(folder.path().join("out/records.csv")).unwrap();
    let columns: Vec<&str> = header.lines().next().unwrap().split(',').collect();
    assert_eq!(columns.iter().filter(|column| **column == "scene").count(), 1, "{columns:?}");
    // who makes the report later knows the baseline
    let later = said(&run_in(folder.path(), &["report", "out"]));
    assert!(later.contains("ratio to `b`"), "{later}");
    // one table a scene, and the ratios are to the chain that is named
    let text = said(&output);
    assert!(text.contains("at equal error (hills)") && text.contains("at equal error (waves)"), "{text}");
    assert!(text.contains("ratio to `b`"), "{text}");
}

/// However the cells are shared out, their records are the same; nothing runs twice.
#[test]
fn shards_come_to_the_same_as_one_process() {
    let folder = tempfile::tempdir().unwrap();
    let fields = format!(
        "scene: ({SCENE}), chains: {{\"grid\": [{GRID}], \"exact\": [HeightPyramid, RayCast]}}, \
         sweep: {{\"*.ViewGrid.size\": [(8, 6), (10, 8), (12, 9), (16, 12)], \"scene.fov_deg\": [40, 60]}}, measure: [ScreenError, Time]"
    );
    experiment(folder.path(), &fields);
    succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "one"]));
    let shards: Vec<_> = (1..=3)
        .map(|number| {
            let shard = format!("{number}/3");
            let mut command = lodlab(folder.path());
            command.args(["run", "made.ron", "--out", "three", "--shard", &shard]).stdout(std::process::Stdio::piped());
            command.spawn().unwrap()
        })
        .collect();
    let ran: usize = shards
        .into_iter()
        .map(|shard| {
            let output = shard.wait_with_output().unwrap();
            succeeded(&output);
            said(&output).lines().filter(|line| line.starts_with("run ")).count()
        })
        .sum();
    assert_eq!(ran, 10);
    let (one, three) = (folder.path().join("one"), folder.path().join("three"));
    assert_eq!(timeless(&one), timeless(&three));
    succeeded(&run_in(folder.path(), &["report", "three"]));
    assert_eq!(rows(&one).len(), rows(&three).len());

    // what is left is listed, and a list is what can be run
    assert_eq!(said(&run_in(folder.path(), &["cells", "made.ron", "--left", "three"])), "");
    std::fs::remove_file(three.join("cells").join(format!("{}.json", rows(&one)[3]["cell"].as_str().unwrap())))
        .unwrap();
    let left = said(&run_in(folder.path(), &["cells", "made.ron", "--left", "three"]));
    assert_eq!(left.lines().count(), 1, "{left}");
    std::fs::write(folder.path().join("left.jsonl"), left).unwrap();
    let again = run_in(folder.path(), &["run", "made.ron", "--out", "three", "--cells", "left.jsonl"]);
    succeeded(&again);
    assert!(said(&again).contains("1 cells run, 0 finished before"), "{}", said(&again));
    assert_eq!(timeless(&one), timeless(&three));
}

/// Two processes that are given the same cells share them out, and harm nobody.
#[test]
fn two_processes_in_one_folder_share_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let sizes: Vec<String> = (8..48).map(|side| format!("({side}, {side})")).collect();
    experiment(
        folder.path(),
        &format!(
            "scene: ({SCENE}), chains: {{\"grid\": [{GRID}]}}, sweep: {{\"*.ViewGrid.size\": [{}]}}, measure: [ScreenError, Time(repeats: 3)]",
            sizes.join(", ")
        ),
    );
    let start = || {
        let mut command = lodlab(folder.path());
        command.args(["run", "made.ron", "--out", "out"]).stdout(std::process::Stdio::piped()).spawn().unwrap()
    };
    let both = [start(), start()].map(|child| {
        let output = child.wait_with_output().unwrap();
        succeeded(&output);
        said(&output).lines().filter(|line| line.starts_with("run ")).count()
    });
    // one that begins late has little left to do; what both begin at the same instant is run twice
    assert!((40..60).contains(&(both[0] + both[1])), "{both:?}");
    let out = folder.path().join("out");
    assert_eq!(timeless(&out).len(), 40);
    assert_eq!(std::fs::read_dir(out.join("claims")).unwrap().count(), 0);
}

/// A value more on an axis runs its cells only.
#[test]
fn a_new_value_runs_the_new_cells() {
    let folder = tempfile::tempdir().unwrap();
    let sized = |sizes: &str| {
        experiment(
            folder.path(),
            &format!(
                "scene: ({SCENE}), chains: {{\"grid\": [{GRID}]}}, sweep: {{\"*.ViewGrid.size\": [{sizes}]}}, measure: [ScreenError]"
            ),
        );
        said(&run_in(folder.path(), &["run", "made.ron", "--out", "out"]))
    };
    assert!(sized("(8, 6), (12, 9)").contains("2 cells run, 0 finished before"));
    assert!(sized("(8, 6), (10, 8), (12, 9)").contains("1 cells run, 2 finished before"));
}

/// Between two cells nothing is said across a third one that is faulty.
#[test]
fn a_curve_ends_at_a_faulty_cell() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = "[(8, 6), (10, 8), (12, 9), (16, 12), (20, 15)]";
    experiment(
        folder.path(),
        &format!(
            "scene: ({SCENE}), chains: {{\"g\": [{GRID}]}}, sweep: {{\"*.ViewGrid.size\": {sizes}}}, measure: [ScreenError, Time]"
        ),
    );
    succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "out"]));
    let read = |record| serde_json::from_value::<Record>(record).unwrap();
    let mut results =
        Results { records: records(&folder.path().join("out")).into_iter().map(read).collect(), ..Results::default() };
    let lengths = |results: &Results| {
        let group = &Standing::of(results).groups[0];
        let points = standing::points(results, group, "error_rms", "method_ms");
        standing::curves(&results.records, &points).iter().map(Vec::len).collect::<Vec<_>>()
    };
    assert_eq!(lengths(&results), [5]);
    results.records[2].measures.push(Measured::new("bound_violations", 1.0, "pixels"));
    assert_eq!(lengths(&results), [2, 2]);
}

/// What is changed and changed back has its first results again, in reports, too.
#[test]
fn a_change_that_is_taken_back_is_what_a_report_shows() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let triangles = |size: &str| {
        experiment(
            folder.path(),
            &format!(
                "scene: ({SCENE}), chains: {{\"g\": [HeightPyramid, ViewGrid(size: {size}), Project, Rasterize]}}, measure: [Mesh]"
            ),
        );
        succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "out"]));
        let ran = rows(&out)[0]["triangles"].clone();
        succeeded(&run_in(folder.path(), &["report", "out"]));
        let reported = rows(&out);
        assert_eq!((reported.len(), &reported[0]["triangles"]), (1, &ran), "{size}");
        ran
    };
    let first = triangles("(8, 6)");
    assert_ne!(triangles("(32, 24)"), first);
    assert_eq!(triangles("(8, 6)"), first);
    // without a record nothing that was made of them before is lost
    std::fs::remove_dir_all(out.join("cells")).unwrap();
    std::fs::create_dir(out.join("cells")).unwrap();
    assert_eq!(run_in(folder.path(), &["report", "out"]).status.code(), Some(2));
    assert_eq!(rows(&out)[0]["triangles"], first);
}

/// Records that are cut off, of another version, changed, or that do not agree.
#[test]
fn records_that_are_not_right_are_named_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let fields = format!(
        "scene: ({SCENE}), chains: {{\"grid\": [{GRID}]}}, sweep: {{\"*.ViewGrid.size\": [(8, 6), (10, 8), (12, 9), (16, 12)]}}, \
         measure: [ScreenError, Time]"
    );
    experiment(folder.path(), &fields);
    succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "out"]));
    let out = folder.path().join("out");
    let cells: Vec<_> =
        rows(&out).iter().map(|row| out.join(format!("cells/{}.json", row["cell"].as_str().unwrap()))).collect();
    let text = |at: usize| std::fs::read_to_string(&cells[at]).unwrap();
    let report = |folders: &[&str]| run_in(folder.path(), &[&["report"], folders].concat());
    succeeded(&report(&["out"]));

    // cut off, of another version, changed
    let whole: Vec<String> = (0..3).map(text).collect();
    std::fs::write(&cells[0], &whole[0][..whole[0].len() / 2]).unwrap();
    std::fs::write(&cells[1], whole[1].replace("\"format\":6", "\"format\":5").replace("\"timings\"", "\"times\""))
        .unwrap();
    std::fs::write(&cells[2], whole[2].replace("\"error_rms\"", "\"error_rmt\"")).unwrap();
    let output = report(&["out"]);
    assert_eq!(output.status.code(), Some(1));
    let message = errors(&output);
    for why in
        ["is no record of this version", "is a record of another version of lodlab", "is not what was written there"]
    {
        assert!(message.contains(why), "{message}");
    }
    assert!(message.contains("3 records are left out"), "{message}");
    assert_eq!(rows(&out).len(), 1);
    (0..3).for_each(|at| std::fs::write(&cells[at], &whole[at]).unwrap());

    // two that say they are one cell, and do not agree
    let other = folder.path().join("other");
    std::fs::create_dir_all(other.join("cells")).unwrap();
    let mut record: Value = serde_json::from_str(&whole[0]).unwrap();
    record["measures"][0]["value"] = 77.25.into();
    record.as_object_mut().unwrap().remove("digest");
    std::fs::write(other.join("cells").join(cells[0].file_name().unwrap()), sealed(&record)).unwrap();
    succeeded(&report(&["other"]));
    let output = report(&["out", "other", "--out", "both"]);
    assert_eq!(output.status.code(), Some(1));
    let message = errors(&output);
    assert!(message.contains("do not agree") && message.contains("77.25"), "{message}");
    assert_eq!(rows(&folder.path().join("both")).len(), 3);

    // what is no folder of results, and names that nobody has
    assert_eq!(report(&["nowhere"]).status.code(), Some(2));
    let output = report(&["out", "--error", "error_rmz"]);
    assert!(errors(&output).contains("did you mean `error_rms`?"), "{}", errors(&output));
    let output = report(&["out", "--baseline", "gird"]);
    assert!(errors(&output).contains("did you mean `grid`?"), "{}", errors(&output));
}

/// A cell that goes wrong while it runs is noted with its reason, and ends no other.
#[test]
fn a_cell_that_fails_ends_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [{GRID}], \"b\": [HeightPyramid, RayCast]}}, measure: [ScreenError, Time])"
    );
    let experiment = Experiment::read(Source::new("made.ron", text), "".into()).unwrap();
    let options = Options::default();
    let mut jobs = run::jobs(run::prepare(&experiment, &[]).unwrap(), &options).unwrap();
    let mut plan = (*jobs[0].plan().unwrap()).clone();
    for step in &mut plan.steps {
        if let Work::Run(run) = &mut step.work {
            run.entry = "nothing".into();
        }
    }
    jobs[0] = jobs[0].with_plan(plan);
    let gpu = Gpu::open(None).unwrap();
    let outcome = run::carry_out("", jobs, &gpu, &folder.path().join("out"), &options, &|_| ()).unwrap();
    let Results { records, failures } = outcome.results;
    assert_eq!(records.iter().map(|record| record.head.chain.as_str()).collect::<Vec<_>>(), ["b"]);
    assert_eq!(failures.len(), 1);
    assert!(failures[0].head.chain == "a" && !failures[0].does_not_fit && !failures[0].why.is_empty());
    // who makes the report later knows it, too
    succeeded(&run_in(folder.path(), &["report", "out"]));
    let rows = rows(&folder.path().join("out"));
    assert_eq!((&rows[1]["chain"], &rows[1]["status"]), (&"a".into(), &"failed".into()));
    // it is tried again, and is finished then
    let again =
        run::run("", run::prepare(&experiment, &[]).unwrap(), &gpu, &folder.path().join("out"), &options, &|_| ());
    assert_eq!(again.unwrap().ran, 1);
    succeeded(&run_in(folder.path(), &["report", "out"]));
    assert!(common::rows(&folder.path().join("out")).iter().all(|row| row["status"] == "ok"));
}

/// The text of a record's file: what is changed on purpose is sealed anew.
fn sealed(record: &Value) -> String {
    let text = record.to_string();
    let rest = &text[1..];
    let digest = &blake3::hash(rest.as_bytes()).to_hex().to_string()[..32];
    format!("{{\"digest\":\"{digest}\",{rest}")
}

#[test]
fn two_folders_are_compared_cell_by_cell() {
    let folder = tempfile::tempdir().unwrap();
    let grid = |filter: &str, size: &str| {
        experiment(
            folder.path(),
            &format!(
                "scene: ({SCENE}), chains: {{\"grid\": [HeightPyramid, ViewGrid(size: {size}), Project(filter: {filter}), Rasterize]}}, \
                 measure: [ScreenError, Time(repeats: 3)]"
            ),
        );
    };
    grid("Trilinear", "(12, 9)");
    succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "before"]));
    let same = run_in(folder.path(), &["compare", "before", "before", "--most-slower", "1.01", "--most-worse", "0"]);
    succeeded(&same);
    assert!(
        said(&same).contains("1 the same, 0 faster, 0 slower, 0 undecided; 0 with other figures"),
        "{}",
        said(&same)
    );

    // a much larger grid is slower and has other errors: smaller ones, so that going back is worse
    grid("Trilinear", "(512, 384)");
    succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "after"]));
    let slower = run_in(folder.path(), &["compare", "before", "after", "--most-slower", "1.5"]);
    assert_eq!(slower.status.code(), Some(1), "{}", said(&slower));
    assert!(said(&slower).contains("1 slower") && said(&slower).contains("grid: error_rms was "), "{}", said(&slower));
    let worse = run_in(folder.path(), &["compare", "after", "before", "--most-worse", "0.01"]);
    assert_eq!(worse.status.code(), Some(1), "{}", said(&worse));
    assert!(errors(&worse).contains("grows by") && said(&worse).contains("1 faster"), "{}", errors(&worse));
    succeeded(&run_in(folder.path(), &["compare", "after", "before"]));

    // a cell that has no results any more is no cell that is left out
    let out = folder.path().join("after");
    let cell = std::fs::read_dir(out.join("cells")).unwrap().next().unwrap().unwrap().path();
    let mut failure: Value = serde_json::from_slice(&std::fs::read(&cell).unwrap()).unwrap();
    failure.as_object_mut().unwrap().remove("digest");
    failure["why"] = "the device was lost".into();
    failure["does_not_fit"] = false.into();
    std::fs::create_dir_all(out.join("failures")).unwrap();
    std::fs::write(out.join("failures").join(cell.file_name().unwrap()), sealed(&failure)).unwrap();
    std::fs::remove_file(&cell).unwrap();
    let failed = run_in(folder.path(), &["compare", "before", "after"]);
    assert_eq!(failed.status.code(), Some(1));
    assert!(errors(&failed).contains("has no results any more: the device was lost"), "{}", errors(&failed));
}

/// The schema has every column of a table that was written, and the types in the Parquet file are those it says.
#[test]
fn the_schema_says_what_each_column_is() {
    use parquet::basic::Type;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    let folder = tempfile::tempdir().unwrap();
    experiment(
        folder.path(),
        &format!(
            "scene: ({SCENE}), chains: {{\"grid\": [{GRID}, Shade]}}, sweep: {{\"*.ViewGrid.size\": [(8, 6), (12, 9)]}}, \
             measure: [ScreenError, DrawnError, Image, Mesh, VertexError, ErrorBuffer, Coverage, Time]"
        ),
    );
    succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "out"]));
    let schema = said(&run_in(folder.path(), &["schema"]));
    let known: Vec<&str> = schema.lines().filter_map(|line| line.split_whitespace().next()).collect();
    let out = folder.path().join("out");
    let rows = rows(&out);
    for name in rows[0].as_object().unwrap().keys() {
        assert!(known.contains(&name.as_str()) || name.starts_with("*."), "{name} is not in the schema");
    }
    let file = SerializedFileReader::new(std::fs::File::open(out.join("records.parquet")).unwrap()).unwrap();
    let fields = file.metadata().file_metadata().schema().get_fields().to_vec();
    let of = |name: &str| fields.iter().find(|field| field.name() == name).unwrap().get_physical_type();
    assert_eq!(of("*.ViewGrid.size.0"), Type::INT64);
    assert_eq!((of("error_rms"), of("cell"), of("bytes")), (Type::DOUBLE, Type::BYTE_ARRAY, Type::INT64));
    // the values are those of the rows
    let read: Vec<_> = file.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(read.len(), 2);
    for (parquet, row) in read.iter().zip(&rows) {
        let field = |name: &str| parquet.get_column_iter().find(|(column, _)| *column == name).unwrap().1;
        assert_eq!(field("error_rms"), &Field::Double(row["error_rms"].as_f64().unwrap()));
        assert_eq!(field("label"), &Field::Str(row["label"].as_str().unwrap().into()));
    }
    // a row for each frame of each cell
    let frames = csv::Reader::from_path(out.join("frames.csv")).unwrap().records().count();
    assert_eq!(frames, 6);
}

#[test]
fn a_path_is_timed_until_its_time_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let timed = |time: &str| {
        experiment(folder.path(), &format!("scene: ({SCENE}), chains: {{\"grid\": [{GRID}]}}, measure: [{time}]"));
        succeeded(&run_in(folder.path(), &["run", "made.ron", "--out", "out", "--force"]));
        let timings = records(&folder.path().join("out"))[0]["timings"].clone();
        (timings["repeats"].as_u64().unwrap(), timings["ended_by"].as_str().unwrap().to_string())
    };
    assert_eq!(timed("Time(repeats: 2)"), (2, "the repeats that were asked for".to_string()));
    let (repeats, why) = timed("Time(until: (noise: 0.5, seconds: 60))");
    assert!(repeats >= 3 && why.starts_with("noise of "), "{repeats} {why}");
    // no clock is as good as that
    let (repeats, why) = timed("Time(until: (noise: 1e-9, seconds: 0.2))");
    assert!(repeats > 3 && why.starts_with("the time limit of 0.2 s"), "{repeats} {why}");
}

/// An interrupt ends the run after its frame: reports are made, and the same command goes on.
#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_its_reports() {
    let folder = tempfile::tempdir().unwrap();
    let sizes: Vec<String> = (8..80).map(|side| format!("({side}, {side})")).collect();
    experiment(
        folder.path(),
        &format!(
            "scene: ({SCENE}), chains: {{\"grid\": [{GRID}]}}, sweep: {{\"*.ViewGrid.size\": [{}]}}, measure: [ScreenError, Time(repeats: 4)]",
            sizes.join(", ")
        ),
    );
    let child = lodlab(folder.path())
        .args(["run", "made.ron", "--out", "out"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let cells = folder.path().join("out/cells");
    let start = Instant::now();
    let finished = || std::fs::read_dir(&cells).map_or(0, Iterator::count);
    while finished() < 3 && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    succeeded(&std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).output().unwrap());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", errors(&output));
    assert!(errors(&output).contains("finished cells are kept in `out`"), "{}", errors(&output));
    let kept = rows(&folder.path().join("out")).len();
    assert!((3..72).contains(&kept), "{kept}");
    let again = run_in(folder.path(), &["run", "made.ron", "--out", "out", "--json"]);
    succeeded(&again);
    let events: Vec<Value> = said(&again).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let count = |kind: &str| events.iter().filter(|event| event["event"] == kind).count();
    assert_eq!(count("cell_done"), 72 - kept);
}
