//! Runs as a user makes them: records, resuming after a kill, repeatability, kernels of one's own.

mod common;

use std::path::Path;
use std::time::{Duration, Instant};

use common::{errors, lodlab, measure, records, run, succeeded};
use lodlab::experiment::{Experiment, diagnostic::Source};
use lodlab::measure::time::Spread;
use lodlab::report::plot::{self, Axes};
use lodlab::report::{Record, Results};
use lodlab::run::{Event, Keep, Setup};

const SWEEP: &str = r#"
Experiment(
    title: "a sweep to be killed",
    scene: (
        terrain: Noise(kind: Fbm, size: (129, 129), wavelength_m: 1500),
        camera: Still(frames: 6, eye: (1900, 100, 900), look_at: (1900, 3000, 300)),
        viewport: (200, 150),
    ),
    chains: {"grid": [HeightPyramid, ViewGrid, Project, Rasterize, Shade]},
    sweep: {"*.ViewGrid.size": [(8, 8), (16, 16), (32, 32), (64, 64), (96, 96), (128, 128)]},
    measure: [ScreenError, Image, Mesh, Time],
)"#;

/// What does not depend on the clock.
fn timeless(folder: &Path) -> Vec<serde_json::Value> {
    let strip = |mut record: serde_json::Value| {
        let record_fields = record.as_object_mut().unwrap();
        record_fields.remove("timings");
        record_fields.remove("made");
        record_fields.remove("digest");
        record
    };
    records(folder).into_iter().map(strip).collect()
}

#[test]
fn a_killed_sweep_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sweep.ron"), SWEEP).unwrap();
    let cells = folder.path().join("killed/cells");
    let finished = || {
        std::fs::read_dir(&cells).map_or(0, |entries| {
            entries.flatten().filter(|entry| entry.path().extension().is_some_and(|kind| kind == "json")).count()
        })
    };
    let mut child = lodlab(folder.path()).args(["run", "sweep.ron", "--out", "killed"]).spawn().unwrap();
    let start = Instant::now();
    while finished() < 2 && start.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(2));
    }
    // kill(2) with SIGKILL: nothing in the program gets a chance to tidy up
    child.kill().unwrap();
    child.wait().unwrap();
    let before = finished();
    assert!((2..6).contains(&before), "killed after {before} of 6 cells");

    let resumed = run(folder.path(), &["run", "sweep.ron", "--out", "killed"]);
    succeeded(&resumed);
    let text = String::from_utf8_lossy(&resumed.stdout).to_string();
    assert_eq!(text.lines().filter(|line| line.starts_with("run ")).count(), 6 - before, "{text}");

    succeeded(&run(folder.path(), &["run", "sweep.ron", "--out", "undisturbed"]));
    assert_eq!(timeless(&folder.path().join("killed")), timeless(&folder.path().join("undisturbed")));
}

#[test]
fn two_runs_give_the_same_bits_and_a_changed_kernel_is_the_reason_to_run_again() {
    let folder = tempfile::tempdir().unwrap();
    let experiments = Path::new(common::ROOT).join("experiments");
    for name in ["custom_kernel.ron", "kernels/curvature.wgsl", "kernels/smooth.wgsl", "dem/jacksboro_403x344.png"] {
        let to = folder.path().join(name);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(experiments.join(name), to).unwrap();
    }
    let arguments = ["run", "custom_kernel.ron", "--out", "out"];
    succeeded(&run(folder.path(), &arguments));
    let first = timeless(&folder.path().join("out"));
    succeeded(&run(folder.path(), &[&arguments[..], &["--force"]].concat()));
    assert_eq!(first, timeless(&folder.path().join("out")));
    assert!(first[0]["buffers"][0][1].as_str().is_some_and(|hash| hash.len() == 32));

    let again = run(folder.path(), &arguments);
    assert!(String::from_utf8_lossy(&again.stdout).contains("0 cells run, 2 finished before"));

    let kernel = folder.path().join("kernels/curvature.wgsl");
    let text = std::fs::read_to_string(&kernel).unwrap();
    std::fs::write(&kernel, text.replace("2.0 * src[at]", "2.5 * src[at]")).unwrap();
    let changed = run(folder.path(), &arguments);
    let text = String::from_utf8_lossy(&changed.stdout).to_string();
    assert!(text.contains("changed: kernel curvature.wgsl"), "{text}");

    // an error planted in it is reported at its line
    let text = std::fs::read_to_string(&kernel).unwrap();
    let line = text.lines().position(|line| line.contains("let across")).unwrap() + 1;
    std::fs::write(&kernel, text.replace("let across = ", "let across = not_a_name + ")).unwrap();
    let broken = run(folder.path(), &arguments);
    assert_eq!(broken.status.code(), Some(2));
    let message = errors(&broken);
    assert!(
        message.contains("not_a_name") && message.contains(&format!("kernels/curvature.wgsl:{line}:")),
        "{message}"
    );
    // what was computed before is still there
    assert_eq!(records(&folder.path().join("out")).len(), 2);
}

/// `--dump` of a user's kernel against the same formula in f64.
#[test]
fn a_dumped_curvature_is_right() {
    let out = tempfile::tempdir().unwrap();
    let out_text = out.path().display().to_string();
    let experiment = format!("{}/experiments/custom_kernel.ron", common::ROOT);
    succeeded(&run(out.path(), &["run", &experiment, "--out", &out_text, "--frames", "1", "--dump", "curvature"]));
    let record = records(out.path()).into_iter().find(|record| record["chain"] == "plain").unwrap();
    let file = out.path().join(format!("dumps/{}/curvature_0000.npy", record["hash"].as_str().unwrap()));
    let npy = npyz::NpyFile::new(std::fs::File::open(file).unwrap()).unwrap();
    assert_eq!(npy.shape(), [344, 403]);
    let ours: Vec<f32> = npy.into_vec().unwrap();

    let image = image::open(format!("{}/experiments/dem/jacksboro_403x344.png", common::ROOT)).unwrap().into_luma16();
    let height = |x: u32, y: u32| 236.0 + f64::from(image.get_pixel(x, y).0[0]);
    let (dx, dy) = (74.48435336104538f64, 92.61f64);
    for y in 0..344 {
        for x in 0..403 {
            let inside = x > 0 && y > 0 && x < 402 && y < 343;
            let expected = if inside {
                (height(x - 1, y) - 2.0 * height(x, y) + height(x + 1, y)) / (dx * dx)
                    + (height(x, y - 1) - 2.0 * height(x, y) + height(x, y + 1)) / (dy * dy)
            } else {
                0.0
            };
            // sums of whole metres are exact; squares, quotients and the sum round
            let bound = 8.0 * f64::from(f32::EPSILON) * (expected.abs() + 0.5);
            let off = (f64::from(ours[(y * 403 + x) as usize]) - expected).abs();
            assert!(off <= bound, "({x}, {y}): {off} is beyond {bound}");
        }
    }
}

#[test]
fn what_the_plan_leaves_out_changes_no_measured_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let mut left_out = std::collections::BTreeSet::new();
    for name in ["quickstart", "stability/flat", "stability/cliff_and_spike"] {
        let experiment = format!("{}/experiments/{name}.ron", common::ROOT);
        let base = ["run", &experiment, "--frames", "2", "--set", "scene.viewport=(160, 120)"];
        let pruned = folder.path().join("pruned").join(name);
        let whole = folder.path().join("whole").join(name);
        let (pruned_text, whole_text) = (pruned.display().to_string(), whole.display().to_string());
        succeeded(&run(folder.path(), &[&base[..], &["--out", &pruned_text]].concat()));
        succeeded(&run(folder.path(), &[&base[..], &["--out", &whole_text, "--keep-everything"]].concat()));
        let (pruned, whole) = (records(&pruned), records(&whole));
        assert_eq!(pruned.len(), whole.len());
        for (pruned, whole) in pruned.iter().zip(&whole) {
            assert_eq!(pruned["buffers"], whole["buffers"], "{name}");
            let here = pruned["left_out"].as_array().unwrap();
            left_out.extend(here.iter().map(|left| left["what"].as_str().unwrap().to_string()));
            assert!(pruned["bytes"].as_u64() < whole["bytes"].as_u64(), "{name}");
        }
    }
    assert!(left_out.len() >= 5, "{left_out:?}");
}

/// A kernel that runs over as many workgroups as another one writes on the GPU, zero among them.
#[test]
fn a_kernel_can_be_dispatched_indirectly() {
    let folder = tempfile::tempdir().unwrap();
    let counts = |groups: u32| {
        format!(
            "@group(0) @binding(0) var<storage, read_write> groups: array<u32>;\n@compute @workgroup_size(1) fn main() {{ groups[0] = {groups}u; groups[1] = 1u; groups[2] = 1u; }}\n"
        )
    };
    let mark = "@group(0) @binding(0) var<storage, read_write> marks: array<u32>;
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3<u32>) { marks[id.x] = 7u; }";
    std::fs::write(folder.path().join("mark.wgsl"), mark).unwrap();
    std::fs::write(
        folder.path().join("indirect.ron"),
        r#"Experiment(
            scene: (terrain: Shape(kind: Flat, size: (9, 9)), camera: Still(eye: (0, 0, 50))),
            chains: {"mark": [
                Kernel(file: "counts.wgsl", bind: {"groups": New(name: "groups", of: U32, size: (3, 1))}, over: (1, 1)),
                Kernel(file: "mark.wgsl", bind: {"marks": New(name: "marks", of: U32, size: (16, 1))}, over: Indirect("groups")),
            ]},
            measure: [Time],
        )"#,
    )
    .unwrap();
    for groups in [0usize, 1, 3] {
        std::fs::write(folder.path().join("counts.wgsl"), counts(groups as u32)).unwrap();
        succeeded(&run(folder.path(), &["run", "indirect.ron", "--out", "out", "--dump", "marks"]));
        let hash = records(&folder.path().join("out"))[0]["hash"].as_str().unwrap().to_string();
        let file = std::fs::File::open(folder.path().join(format!("out/dumps/{hash}/marks_0000.npy"))).unwrap();
        let marks: Vec<u32> = npyz::NpyFile::new(file).unwrap().into_vec().unwrap();
        let expected: Vec<u32> = (0..16).map(|at| if at < 4 * groups { 7 } else { 0 }).collect();
        assert_eq!(marks, expected, "{groups} groups");
    }
}

/// Runs an experiment made of parts and returns its records.
fn records_of(folder: &Path, chains: &str, rest: &str, extra: &[&str]) -> Vec<serde_json::Value> {
    let text = format!(
        "Experiment(scene: (terrain: Noise(kind: Fbm, size: (65, 65), wavelength_m: 700), \
         camera: Still(frames: 3, eye: (900, -100, 1400), look_at: (900, 900, 400)), viewport: (64, 48)), \
         chains: {{{chains}}}, {rest})"
    );
    common::records_of(folder, &text, extra)
}

/// A kernel that changes a buffer in place runs in every frame if what it changes is made in every frame.
#[test]
fn a_kernel_in_place_belongs_to_its_frame() {
    let folder = tempfile::tempdir().unwrap();
    let halve = "struct Params { size: vec2<u32> }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> d: array<f32>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.size) { d[id.y * params.size.x + id.x] *= 0.5; }
}";
    std::fs::write(folder.path().join("halve.wgsl"), halve).unwrap();
    let plain = "\"plain\": [HeightPyramid, RayCast]";
    let halved = "\"halved\": [HeightPyramid, RayCast, Kernel(file: \"halve.wgsl\", bind: {\"d\": \"distance\"}, over: \"distance\")]";
    let made = records_of(folder.path(), &format!("{plain}, {halved}"), "measure: [ScreenError]", &[]);
    assert!(measure(&made[0], "error_mean").unwrap() < 1e-3);
    assert!(measure(&made[1], "error_mean").unwrap() > 10.0, "{}", made[1]["plan"]);
}

/// A dump adds to what runs and never takes away from it, and its cell is another one.
#[test]
fn a_dump_does_not_change_a_finished_cell() {
    let folder = tempfile::tempdir().unwrap();
    let chain = "\"cast\": [HeightPyramid, RayCast]";
    let dumped = records_of(folder.path(), chain, "measure: [Time]", &["--dump", "height_max"]);
    assert!(dumped[0]["plan"].as_str().unwrap().contains("cast"));
    let steps = |record: &serde_json::Value| record["timings"]["kernels"].as_array().unwrap().len();
    let plain = records_of(folder.path(), chain, "measure: [Time]", &[]);
    assert_eq!(steps(&dumped[0]), steps(&plain[0]));
    assert_ne!(dumped[0]["hash"], plain[0]["hash"]);
}

#[test]
fn the_smallest_pictures_are_read_back_whole() {
    let folder = tempfile::tempdir().unwrap();
    let chain = "\"cast\": [HeightPyramid, RayCast, Shade(tint: false), Shade]";
    for size in ["(1, 1)", "(3, 1)", "(1, 2)"] {
        let set = format!("scene.viewport={size}");
        let made = records_of(folder.path(), chain, "measure: [ScreenError, Image]", &["--set", &set]);
        assert!(measure(&made[0], "error_max").unwrap() < 0.02, "{size}");
        // the truth is shaded like the last of two shades
        assert_eq!(measure(&made[0], "equal_pictures"), Some(1.0), "{size}");
    }
}

/// The grid samples no level that the pyramid does not have.
#[test]
fn a_low_pyramid_is_sampled_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let chain = |name: &str, pyramid: &str, project: &str| {
        format!("\"{name}\": [HeightPyramid{pyramid}, ViewGrid(size: (4, 4)), Project{project}, Rasterize]")
    };
    let both = [chain("made", "(max_level: 1)", ""), chain("sampled", "", "(max_level: 1)")].join(", ");
    let made = records_of(folder.path(), &both, "measure: [ScreenError]", &[]);
    assert_eq!(measure(&made[0], "error_mean"), measure(&made[1], "error_mean"));
}

#[test]
fn a_stored_cell_is_called_what_this_run_calls_it() {
    let folder = tempfile::tempdir().unwrap();
    let chain = "\"cast\": [HeightPyramid, RayCast]";
    records_of(folder.path(), chain, "measure: [Time]", &[]);
    records_of(folder.path(), chain, "sweep: {\"scene.fov_deg\": [60, 50]}, measure: [Time]", &[]);
    let labels: Vec<_> = common::rows(&folder.path().join("made")).iter().map(|row| row["label"].to_string()).collect();
    assert_eq!(labels, ["\"cast fov_deg=60\"", "\"cast fov_deg=50\""]);
}

/// Cameras that change together with something else still have the frames that the command line asks for.
#[test]
fn frames_go_on_top_of_a_swept_camera() {
    let folder = tempfile::tempdir().unwrap();
    let sweep = "sweep: {\"scene.camera, scene.fov_deg\": [(Still(frames: 5, eye: (900, -100, 1400), look_at: (900, 900, 400)), 50), \
                 (Orbit(frames: 7, center: (900, 900, 0), radius_m: 900, height_m: 700), 60)]}, measure: [Time]";
    let swept = records_of(folder.path(), "\"cast\": [HeightPyramid, RayCast]", sweep, &["--frames", "2"]);
    assert_eq!(swept.len(), 2);
    for record in swept {
        assert!(record["plan"].as_str().unwrap().contains("2 frame(s)"), "{}", record["plan"]);
    }
}

/// What stands in `cells/` and is no record is named, and its cell runs again.
#[test]
fn a_record_that_does_not_parse_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let chain = "\"cast\": [HeightPyramid, RayCast]";
    let record = records_of(folder.path(), chain, "measure: [Time]", &[]).remove(0);
    let cell = folder.path().join(format!("made/cells/{}.json", record["hash"].as_str().unwrap()));
    let whole = std::fs::read_to_string(&cell).unwrap();
    std::fs::write(&cell, &whole[..whole.len() / 2]).unwrap();
    let again = run(folder.path(), &["run", "made.ron", "--out", "made"]);
    succeeded(&again);
    let said = String::from_utf8_lossy(&again.stdout).to_string();
    assert!(said.contains("is no record of this version") && said.contains("1 cells run"), "{said}");
}

/// What was read to see whether an experiment is in order is what runs: a large terrain is not read again.
#[test]
fn a_terrain_is_read_once_a_run() {
    let folder = tempfile::tempdir().unwrap();
    image::GrayImage::from_fn(9, 9, |x, y| image::Luma([(x * y) as u8])).save(folder.path().join("dem.png")).unwrap();
    let text = "Experiment(scene: (terrain: Dem(file: \"dem.png\", cell_m: 10), camera: Still(eye: (40, -30, 90), look_at: (40, 40, 0)), \
                viewport: (16, 12)), chains: {\"cast\": [HeightPyramid, RayCast]}, measure: [ScreenError])";
    let experiment = Experiment::read(Source::new("test", text), folder.path().to_path_buf()).unwrap();
    let prepared = lodlab::run::prepare(&experiment, &[]).unwrap();
    std::fs::remove_file(folder.path().join("dem.png")).unwrap();
    let gpu = lodlab::gpu::Gpu::open(None).unwrap();
    let outcome = lodlab::run::run("once", prepared, &gpu, &folder.path().join("out"), &Default::default(), &|_| ());
    assert_eq!(outcome.unwrap().ran, 1);
}

/// A record whose contents are not those that were written under its name is named, and its cell runs again; so is what is no file.
#[test]
fn a_record_that_somebody_changed_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let chains =
        "\"cast\": [HeightPyramid, RayCast], \"grid\": [HeightPyramid, ViewGrid(size: (8, 8)), Project, Rasterize]";
    let made = records_of(folder.path(), chains, "measure: [ScreenError, Time]", &[]);
    let path = |record: &serde_json::Value| {
        folder.path().join(format!("made/cells/{}.json", record["hash"].as_str().unwrap()))
    };
    let (cast, grid) = (path(&made[0]), path(&made[1]));
    let whole = std::fs::read_to_string(&cast).unwrap();
    let again = |what: &str| {
        let again = run(folder.path(), &["run", "made.ron", "--out", "made"]);
        succeeded(&again);
        let said = String::from_utf8_lossy(&again.stdout).to_string();
        assert!(said.contains("cells run, 1 finished before") && said.contains(what), "{said}");
        assert_eq!(said.matches("1 cells run").count(), 1, "{said}");
    };
    let adapter = made[0]["identity"]["adapter"].as_str().unwrap();
    let terrain = made[0]["identity"]["terrain"].as_str().unwrap();
    for (was, is) in [("\"cast\"", "\"fast\""), ("error_max", "error_min"), (adapter, "another"), (terrain, "another")]
    {
        let changed = whole.replace(was, is);
        assert_ne!(changed, whole, "{was}");
        std::fs::write(&cast, changed).unwrap();
        again("is not what was written there, so its cell counts as not run");
    }
    // the record of another cell
    std::fs::copy(&grid, &cast).unwrap();
    again("is not what was written there");
    // a record without its digest, as earlier versions wrote it
    let unsealed = whole.lines().filter(|line| !line.contains("\"digest\"")).collect::<Vec<_>>().join("\n");
    std::fs::write(&cast, unsealed).unwrap();
    again("is no record of this version");
    #[cfg(unix)]
    {
        std::fs::remove_file(&cast).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&cast).status().unwrap().success());
        again("cannot be read as a file");
        std::os::unix::fs::symlink("/dev/zero", folder.path().join("made/cells/zero.json")).unwrap();
        std::fs::remove_file(&cast).unwrap();
        again("zero.json` cannot be read as a file");
    }
}

/// What a run has written is there when it says that it is done.
#[test]
fn files_that_vanish_during_a_run_are_missed() {
    let text = "Experiment(scene: (terrain: Shape(kind: Sine, size: (9, 9)), camera: Still(eye: (40, -30, 90), look_at: (40, 40, 0)), \
                viewport: (16, 12)), chains: {\"cast\": [HeightPyramid, RayCast]}, sweep: {\"scene.fov_deg\": [40, 50, 60]}, \
                measure: [ScreenError])";
    let experiment = Experiment::read(Source::new("test", text), "".into()).unwrap();
    let gpu = lodlab::gpu::Gpu::open(None).unwrap();
    let run_and = |folder: &Path, after_a_cell: &dyn Fn(usize)| {
        let prepared = lodlab::run::prepare(&experiment, &[]).unwrap();
        let done = std::cell::Cell::new(0);
        let tell = |event: Event| {
            if matches!(event, Event::CellDone { .. }) {
                done.set(done.get() + 1);
                after_a_cell(done.get());
            }
        };
        lodlab::run::run("vanishing", prepared, &gpu, folder, &Default::default(), &tell).map(|outcome| outcome.ran)
    };
    let cells = |folder: &Path| {
        std::fs::read_dir(folder.join("cells")).unwrap().flatten().map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let home = tempfile::tempdir().unwrap();
    let (out, moved) = (home.path().join("out"), home.path().join("moved"));
    let renamed = run_and(&out, &|done| {
        if done == 2 {
            std::fs::rename(&out, &moved).unwrap()
        }
    })
    .unwrap_err();
    assert_eq!(renamed.exit_code(), 1);
    assert!(renamed.message.contains("files of this run are gone") && renamed.message.contains("cells/"), "{renamed}");
    assert_eq!((cells(&moved).len(), cells(&out).len()), (2, 1));
    // what is missing runs again, and a finished cell that goes meanwhile is missed as well
    let deleted = run_and(&out, &|done| {
        if done == 1 {
            std::fs::remove_dir_all(out.join("cells")).unwrap()
        }
    })
    .unwrap_err();
    assert!(deleted.message.starts_with("2 files "), "{deleted}");
    let changed = run_and(&out, &|done| {
        if done == 1 {
            std::fs::write(&cells(&out)[0], "another").unwrap();
        }
    });
    assert!(changed.unwrap_err().message.starts_with("1 files "));
    assert_eq!(run_and(&out, &|_| ()).unwrap(), 1);
    assert_eq!(run_and(&out, &|_| ()).unwrap(), 0);
}

/// A cell that is more than the adapter can do is named and recorded, and the others run.
#[test]
fn a_cell_that_does_not_fit_stops_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let kernel = "@group(0) @binding(0) var<storage, read_write> d: array<f32>;\n\
                  @group(0) @binding(1) var<storage, read_write> e: array<f32>;\n\
                  @compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3<u32>) { e[0] = 1.0; d[id.x] *= 0.5; }";
    std::fs::write(folder.path().join("two.wgsl"), kernel).unwrap();
    // the largest of these is more than four gigabytes
    let experiment = |sizes: [u32; 3]| {
        let bind =
            |size: u32| format!("{{\"d\": \"distance\", \"e\": New(name: \"e\", of: F32, size: ({size}, 26000))}}");
        let values = sizes.map(bind).join(", ");
        format!(
            "Experiment(scene: (terrain: Shape(kind: Sine, size: (9, 9)), camera: Still(eye: (40, -30, 90), look_at: (40, 40, 0)), \
             viewport: (16, 12)), chains: {{\"cast\": [HeightPyramid, RayCast, Kernel(file: \"two.wgsl\", bind: {}, over: \"distance\")]}}, \
             sweep: {{\"*.Kernel.bind\": [{values}]}}, measure: [ScreenError])",
            bind(1)
        )
    };
    std::fs::write(folder.path().join("sweep.ron"), experiment([1, 43_000, 2])).unwrap();
    let out = folder.path().join("out");
    let failed = || common::rows(&out).into_iter().filter(|row| row["status"] == "failed").collect::<Vec<_>>();
    for summary in
        ["2 cells run, 0 finished before, 1 without results", "0 cells run, 2 finished before, 1 without results"]
    {
        let output = run(folder.path(), &["run", "sweep.ron", "--out", "out"]);
        let said = String::from_utf8_lossy(&output.stdout).to_string();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(summary) && said.contains("(it does not fit: "), "{said}");
        let message = errors(&output);
        assert!(message.contains("does not fit: ") && message.contains("4472000000"), "{message}");
        assert_eq!(records(&out).len(), 2);
        let left = failed();
        assert_eq!(left.len(), 1);
        assert!(left[0]["*.Kernel.bind"].as_str().unwrap().contains("43000"), "{left:?}");
        assert!(left[0]["why"].as_str().unwrap().contains("4472000000"), "{left:?}");
    }
    // when all of them fit, there is no such row any more
    std::fs::write(folder.path().join("sweep.ron"), experiment([1, 3, 2])).unwrap();
    succeeded(&run(folder.path(), &["run", "sweep.ron", "--out", "out"]));
    assert!(failed().is_empty());
}

/// Figures are the same in JSON, CSV and the page.
#[test]
fn reports_agree() {
    let folder = tempfile::tempdir().unwrap();
    let chains = "\"grid\": [HeightPyramid, ViewGrid(size: (16, 12)), Project, Rasterize, Shade]";
    let record = records_of(folder.path(), chains, "measure: [ScreenError, Image, Mesh, Time]", &[]).remove(0);
    let mut csv = csv::Reader::from_path(folder.path().join("made/records.csv")).unwrap();
    let header = csv.headers().unwrap().clone();
    let row = csv.records().next().unwrap().unwrap();
    for name in ["error_max", "error_mean", "psnr", "ssim", "triangles", "largest_cell"] {
        let at = header.iter().position(|column| column == name).unwrap();
        assert_eq!(row[at].parse::<f64>().ok(), measure(&record, name), "{name}");
    }
    let page = std::fs::read_to_string(folder.path().join("made/report.html")).unwrap();
    let data = page.split("id=\"data\">").nth(1).unwrap().split("</script>").next().unwrap();
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    let column = |name: &str| {
        let columns = data["columns"].as_array().unwrap();
        columns.iter().find(|column| column["name"] == name).unwrap()["values"][0].clone()
    };
    assert_eq!(column("triangles").as_f64(), measure(&record, "triangles"));
    assert_eq!(column("cell"), record["hash"]);
    let pictures = data["details"][0]["pictures"].as_array().unwrap();
    assert!(pictures.len() == 2 && pictures[0][1].as_str().unwrap().starts_with("data:image/png;base64,"));
}

/// What is plotted against error is the time of the method, which is timed as often as whole frames; an older record is measured again.
#[test]
fn the_time_that_is_plotted_is_the_method_s() {
    let folder = tempfile::tempdir().unwrap();
    let chains = "\"grid\": [HeightPyramid, ViewGrid(size: (16, 12)), Project, Rasterize, Shade]";
    let found = records_of(folder.path(), chains, "measure: [ScreenError, Image, Time]", &[]).remove(0);
    let record: Record = serde_json::from_value(found.clone()).unwrap();
    let kernels = record.timings.kernels.iter().filter(|time| time.after_surface);
    assert_eq!(kernels.map(|time| time.stage.as_str()).collect::<Vec<_>>(), ["Shade"]);
    let samples = |spread: &Option<Spread>| spread.as_ref().map_or(0, |spread| spread.samples);
    let whole = samples(&record.timings.frame_wall_ms);
    assert!(whole > 0);
    assert_eq!(samples(&record.timings.method_wall_ms), whole);
    // not the samples of the whole frame under another name
    assert_ne!(record.timings.method_wall_ms, record.timings.frame_wall_ms);

    let plot = |method_ms: f64, frame_ms: f64| {
        let spread = |ms| Some(Spread { median: ms, lower_quartile: ms, upper_quartile: ms, samples: 1 });
        let mut record = record.clone();
        record.timings.method_gpu_ms = spread(method_ms);
        record.timings.frame_gpu_ms = spread(frame_ms);
        let axes = Axes { error: "error_rms", error_title: "", cost: "method_ms", cost_title: "", target: None };
        plot::svg("", &Results { records: vec![record], ..Results::default() }, &axes).unwrap().unwrap()
    };
    assert_eq!(plot(1.0, 2.0), plot(1.0, 400.0));
    assert_ne!(plot(1.0, 400.0), plot(100.0, 400.0));
    let made = |name: &str| std::fs::read_to_string(folder.path().join("made").join(name)).unwrap();
    assert!(made("pareto.svg").contains("time of the method without shading, ms"));
    let mut csv = csv::Reader::from_path(folder.path().join("made/records.csv")).unwrap();
    let at = csv.headers().unwrap().iter().position(|column| column == "method_wall_ms").unwrap();
    let written = csv.records().next().unwrap().unwrap()[at].parse::<f64>().ok();
    assert_eq!(written, record.timings.method_wall_ms.as_ref().map(|spread| spread.median));
}

/// Several adapters can have one name: each is opened by its place.
#[test]
fn adapters_are_opened_one_by_one() {
    let known = lodlab::gpu::device::list();
    for (at, adapter) in known.iter().enumerate() {
        let opened = lodlab::gpu::Gpu::open_nth(at).unwrap().summary.clone();
        assert_eq!((&opened.name, &opened.backend), (&adapter.name, &adapter.backend));
        assert!(opened.identity().contains(&adapter.backend));
    }
    assert!(lodlab::gpu::Gpu::open_nth(known.len()).is_err());
}

/// A buffer that the plan gave no memory is an error to read, and not a buffer of nothing.
#[test]
fn what_has_no_memory_is_not_read_as_nothing() {
    let gpu = lodlab::gpu::Gpu::open(None).unwrap();
    let scene = "terrain: Shape(kind: Flat, size: (9, 9)), camera: Still(eye: (100, 10, 50)), viewport: (8, 8)";
    let setup = Setup::chain(scene, "[HeightPyramid, RayCast, ViewGrid]", "".as_ref(), Keep::Last).unwrap();
    let executor = setup.executor(&gpu).unwrap();
    let left_out = setup.plan.find("distance").unwrap();
    assert!(!setup.plan.lives(left_out));
    assert!(matches!(executor.read(left_out), Err(lodlab::gpu::GpuError::Plan(_))));
    assert!(executor.read(setup.plan.find("grid_point").unwrap()).is_ok());
}

/// An adapter says how often the loops of a thread may turn, and a kernel with longer ones is warned of where it runs.
#[test]
fn loops_that_an_adapter_ends_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    for (name, turns) in [("short", "30000u"), ("long", "150000u"), ("told", "params.turns")] {
        let kernel = format!(
            "struct Params {{ turns: u32 }}
@group(0) @binding(0) var<storage, read_write> x: array<u32>;
@group(0) @binding(1) var<uniform> params: Params;
@compute @workgroup_size(1) fn main() {{
    var turns = params.turns & 0u;
    for (var k = 0u; k < {turns}; k++) {{ turns += 1u + (x[1] & 0u); }}
    x[0] = turns;
}}"
        );
        std::fs::write(folder.path().join(format!("{name}.wgsl")), kernel).unwrap();
    }
    let chain = |name: &str| {
        format!(
            "\"{name}\": [Kernel(file: \"{name}.wgsl\", bind: {{\"x\": New(name: \"x\", of: U32, size: (2, 1))}}, params: (turns: 150000), over: (1, 1))]"
        )
    };
    let chains = ["short", "long", "told"].map(chain).join(", ");
    for record in records_of(folder.path(), &chains, "measure: [Time(warmup: 0)]", &["--dump", "x"]) {
        let name = record["chain"].as_str().unwrap();
        let dumps = folder.path().join("made/dumps").join(record["hash"].as_str().unwrap());
        let npy = std::fs::read(dumps.join("x_0000.npy")).unwrap();
        let found = u32::from_le_bytes(npy[npy.len() - 8..npy.len() - 4].try_into().unwrap());
        let is_ended = name != "short" && !record["adapter"]["loop_turns"].is_null();
        let wanted = if name == "short" { 30_000 } else { 150_000 };
        assert_eq!(found < wanted, is_ended, "{name}: {found}");
        let warnings = record["warnings"].as_array().unwrap();
        let is_warned =
            warnings.iter().any(|warning| warning.as_str().unwrap().contains(&format!("`main` ({name}.wgsl)")));
        assert_eq!(is_warned, is_ended, "{name}: {warnings:?}");
    }
}

/// Mesa's software driver takes minutes for a table of twenty thousand numbers, and cannot be interrupted.
#[test]
fn a_driver_that_takes_too_long_is_named_and_ends_the_run() {
    let is_it = lodlab::gpu::Gpu::open(None).unwrap().summary.name.contains("llvmpipe");
    let folder = tempfile::tempdir().unwrap();
    let table = vec!["1.0"; 20_000].join(", ");
    let kernel = format!(
        "@group(0) @binding(0) var<storage, read_write> x: array<f32>;
@compute @workgroup_size(1) fn main() {{ var table = array({table}); x[0] = table[u32(x[1]) % 20000u]; }}"
    );
    std::fs::write(folder.path().join("table.wgsl"), kernel).unwrap();
    let text = "Experiment(scene: (terrain: Shape(kind: Flat, size: (9, 9)), camera: Still(eye: (100, 10, 50)), viewport: (8, 8)), \
        chains: {\"first\": [HeightPyramid, RayCast], \
        \"table\": [Kernel(file: \"table.wgsl\", bind: {\"x\": New(name: \"x\", of: F32, size: (2, 1))}, over: (1, 1))]}, \
        measure: [Time(warmup: 0)])";
    std::fs::write(folder.path().join("slow.ron"), text).unwrap();
    if is_it {
        let ended = run(folder.path(), &["run", "slow.ron", "--out", "out", "--patience", "1"]);
        assert_eq!(ended.status.code(), Some(1));
        assert!(errors(&ended).contains("the pipeline of `table.wgsl`"), "{}", errors(&ended));
        assert_eq!(std::fs::read_dir(folder.path().join("out/cells")).unwrap().count(), 1);
    }
}
