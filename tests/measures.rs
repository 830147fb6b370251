//! Measures as a user meets them: what was drawn is what is measured, what is missing is said, and each count can be other than zero.

mod common;

use common::{errors, lodlab, measure, records_of, run};
use glam::{DVec2, DVec3};
use lodlab::experiment::parameters::describe;
use lodlab::measure::{pinholes, triangles::Triangles};
use lodlab::run::{Keep, Setup};

/// Chains over one scene.
fn experiment(chains: &str, measures: &str) -> String {
    format!(
        "Experiment(scene: (terrain: Noise(kind: Ridged, seed: 4, size: (129, 129), height_m: (0, 1500)), \
         camera: Still(eye: (1500, -200, 2600), look_at: (1500, 2000, 300)), viewport: (128, 96)), \
         chains: {{ {chains} }}, measure: [{measures}])"
    )
}

const LIST: &str = "HeightPyramid, Roughness, VertexSplitting, TriangleSplitting";
const GRID: &str = "ViewGrid(size: (16, 12)), Project, Rasterize";

#[test]
fn the_mesh_is_the_one_that_was_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let chains = format!(
        "\"both\": [{LIST}, {GRID}], \"undrawn\": [{LIST}], \"grid\": [HeightPyramid, {GRID}], \"list\": [{LIST}, Rasterize], \
         \"rays\": [HeightPyramid, RayCast]"
    );
    let records = records_of(folder.path(), &experiment(&chains, "Mesh, Time(warmup: 0)"), &[]);
    let triangles: Vec<f64> = records.iter().map(|record| measure(record, "triangles").unwrap()).collect();
    assert_eq!((triangles[0], triangles[2], triangles[4]), (330.0, 330.0, 0.0));
    assert!(triangles[3] > 1000.0, "{triangles:?}");
    assert_eq!(triangles[1], triangles[3], "a list has as many triangles, drawn or not");
    let says = |at: usize| records[at]["warnings"].to_string().contains("that no stage draws");
    assert_eq!([0, 1, 2, 3, 4].map(says), [false, true, false, false, false]);
    assert!(measure(&records[3], "pinholes").is_some() && measure(&records[1], "pinholes").is_none());
}

#[test]
fn what_there_is_not_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for measures in ["ErrorBuffer", "Mesh", "ScreenError", "Image", "Coverage", "Density", "Swimming"] {
        std::fs::write(folder.path().join("none.ron"), experiment("\"none\": [HeightPyramid]", measures)).unwrap();
        let output = run(folder.path(), &["plan", "none.ron"]);
        assert_eq!(output.status.code(), Some(2), "{measures}");
        let said = errors(&output);
        assert!(said.contains(measures) && said.contains("none.ron:1:") && said.contains("help: "), "{said}");
    }
    // rays have no mesh and no errors of their own, which is something to say
    let records =
        records_of(folder.path(), &experiment("\"rays\": [HeightPyramid, RayCast]", "ErrorBuffer, Mesh"), &[]);
    assert_eq!((measure(&records[0], "flagged"), measure(&records[0], "triangles")), (None, Some(0.0)));
}

/// Every measure of the registry, over each kind of mesh and over rays: what it finds has units, and is the same twice.
#[test]
fn every_measure_measures_what_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let chains = format!(
        "\"grid\": [HeightPyramid, ViewGrid(size: (16, 12)), Project, GridError, Rasterize, Shade], \
         \"list\": [{LIST}, Rasterize, Shade], \"rays\": [HeightPyramid, RayCast, Shade], \
         \"image\": [HeightPyramid, SketchMap(texels: 9), SketchImportance, ViewGrid(size: (16, 12)), Warp, GeometryImage, Rasterize, Shade]"
    );
    for info in lodlab::measure::REGISTRY {
        assert!(info.version > 0 && !info.summary.is_empty(), "{}", info.name);
        for parameter in describe(&(info.parameters)()) {
            assert!(
                parameter.default.is_some() && !parameter.meaning.is_empty(),
                "`{}` of {}",
                parameter.name,
                info.name
            );
        }
        let text = experiment(&chains, info.name);
        let figures = |extra: &[&str]| {
            records_of(folder.path(), &text, extra)
                .into_iter()
                .map(|record| record["measures"].clone())
                .collect::<Vec<_>>()
        };
        let first = figures(&[]);
        assert_eq!(first, figures(&["--force"]), "{}", info.name);
        let is_measured = |measures: &serde_json::Value| measures.as_array().is_some_and(|all| !all.is_empty());
        assert_eq!(first.iter().any(is_measured), info.name != "Time", "{}", info.name);
        // what a measure gives is what it has said that it gives
        for figure in first.iter().filter_map(|measures| measures.as_array()).flatten() {
            let known = info.figures.iter().find(|known| figure["name"] == known.name);
            let known = known.unwrap_or_else(|| panic!("{} has not said that it gives {figure}", info.name));
            assert!(figure["unit"] == known.unit && !known.meaning.is_empty(), "{figure}");
        }
        for column in info.columns.iter().filter(|column| info.name != "Time" || !column.figure.ends_with("_ms")) {
            let has = |measures: &serde_json::Value| measures.to_string().contains(column.figure);
            assert!(first.iter().any(has), "the column `{}` shows no figure of {}", column.heading, info.name);
        }
    }
}

/// A user's kernel that makes distances, under a name of its own and offered as such.
#[test]
fn a_user_s_kernel_offers_what_stages_and_measures_need() {
    let folder = tempfile::tempdir().unwrap();
    let halve = "struct Params { size: vec2<u32> }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> far: array<f32>;
@group(0) @binding(2) var<storage, read_write> near: array<f32>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.size) { near[id.y * params.size.x + id.x] = 0.5 * far[id.y * params.size.x + id.x]; }
}";
    std::fs::write(folder.path().join("halve.wgsl"), halve).unwrap();
    let kernel = |offered: &str| {
        format!(
            "\"half\": [HeightPyramid, RayCast, Kernel(file: \"halve.wgsl\", bind: {{\"far\": \"distance\", \"near\": \
             New(name: \"half\", of: F32, like: \"distance\"{offered})}}, over: \"half\"), Shade]"
        )
    };
    // without a word, it is a buffer like any other, and what was drawn is what the rays hit
    let plain = records_of(folder.path(), &experiment(&kernel(""), "ScreenError, Image"), &[]);
    assert!(measure(&plain[0], "error_mean").unwrap() < 1e-3);
    let offered = records_of(folder.path(), &experiment(&kernel(", as: Distance"), "ScreenError, Image"), &[]);
    assert!(measure(&offered[0], "error_mean").unwrap() > 10.0);
    assert!(measure(&offered[0], "psnr").is_some());
}

/// A picture of a wall in front of the camera, with and without a hole.
#[test]
fn a_pinhole_is_seen() {
    let scene = "terrain: Shape(kind: Flat, size: (9, 9)), camera: Still(eye: (100, -50, 300), yaw_deg: 0, pitch_deg: 0), viewport: (32, 24)";
    let setup = Setup::chain(scene, "[HeightPyramid]", "".as_ref(), Keep::Last).unwrap();
    let camera = &setup.prepared.data.cameras()[0];
    let corner = |x: f32, z: f32| [x, 100.0, z];
    let (a, b, c, d) = (corner(-400.0, -400.0), corner(400.0, -400.0), corner(-400.0, 400.0), corner(400.0, 400.0));
    let wall = Triangles { corners: vec![[a, b, c], [d, c, b]], border: Vec::new() };
    let count = |mesh: &Triangles, gaps: &Triangles, drawn_m: &[f32], true_m: &[f32]| {
        let true_m: Vec<f64> = true_m.iter().map(|&distance_m| distance_m.into()).collect();
        pinholes::count(mesh, gaps, camera, drawn_m, &true_m)
    };
    let distance = |at: u32| {
        let ray: DVec3 = camera.ray(DVec2::new(f64::from(at % 32) + 0.5, f64::from(at / 32) + 0.5));
        (100.0 / ray.y) as f32
    };
    let whole: Vec<f32> = (0..32 * 24).map(distance).collect();
    let closed = Triangles::default();
    assert_eq!(count(&wall, &closed, &whole, &whole), 0);
    // sky, and something farther away, seen through it
    for seen in [-1.0, 500.0] {
        let mut holed = whole.clone();
        holed[12 * 32 + 16] = seen;
        assert_eq!(count(&wall, &closed, &holed, &whole), 1, "{seen}");
    }
    // beside the wall there is nothing to see through
    let narrow = Triangles {
        corners: vec![[corner(-10.0, -10.0), corner(10.0, -10.0), corner(-10.0, 10.0)]],
        border: Vec::new(),
    };
    let sky = vec![-1.0; whole.len()];
    assert!(count(&narrow, &closed, &sky, &whole) > 0, "the triangle itself was not drawn");
    let nothing = Triangles::default();
    assert_eq!(count(&nothing, &closed, &sky, &whole), 0);
    // through a gap one sees what is behind it, and be it the truth
    let behind: Vec<f32> = whole.iter().map(|distance_m| 2.0 * distance_m).collect();
    let seen_through = count(&nothing, &wall, &behind, &behind);
    assert_eq!(seen_through, whole.len(), "the gap is as large as the picture");
    let before: Vec<f32> = whole.iter().map(|distance_m| 0.5 * distance_m).collect();
    assert_eq!(count(&nothing, &wall, &before, &before), 0, "something hides the gap");
}

/// The driver has nothing to say in front of a user's first table.
#[test]
fn nothing_but_our_own_words_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = lodlab(folder.path());
    for name in ["NODEVICE_SELECT", "DISPLAY", "WAYLAND_DISPLAY", "XDG_RUNTIME_DIR"] {
        command.env_remove(name);
    }
    let output = command.arg("devices").output().unwrap();
    assert!(output.status.success());
    assert_eq!(errors(&output), "");
}
