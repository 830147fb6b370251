//! `rule: Proven` is a guarantee: no pixel is off by more than it says, on any terrain and from anywhere.

mod common;

use common::{SHAPES, VIEWS, measure, records, run, shared_dem, succeeded};

/// Runs a Proven chain over scenes, grids and thresholds, and asserts that no pixel breaks its bound. `rows` is how many pixels may
/// share a ray, on a uniform and on a warped grid.
fn holds(name: &str, terrain: &str, camera: &str, viewport: &str, surface: &str, rows: (u32, u32)) {
    let folder = tempfile::tempdir().unwrap();
    let proven = |rows: u32| format!("GridError(rule: Proven), LeadRays, Rasterize, Compact(rows: {rows}), RayFill");
    let (uniform, warped) = (proven(rows.0), proven(rows.1));
    let text = format!(
        "Experiment(scene: (terrain: {terrain}, camera: {camera}, viewport: {viewport}, surface: {surface}), chains: {{ \
         \"uniform\": [HeightPyramid, PlanePyramid, ViewGrid, Project(filter: Finest), {uniform}], \
         \"warped\": [HeightPyramid, PlanePyramid, ViewGrid, AspectImportance(size: (16, 16)), Warp, Project, {warped}] }}, \
         sweep: {{\"*.ViewGrid.size\": [(16, 12), (64, 48)], \"*.GridError.threshold_px\": [0.5, 1, 2]}}, measure: [ScreenError])"
    );
    std::fs::write(folder.path().join("proven.ron"), text).unwrap();
    succeeded(&run(folder.path(), &["run", "proven.ron", "--out", "out"]));
    let records = records(&folder.path().join("out"));
    assert_eq!(records.len(), 12);
    for record in records {
        let what = format!(
            "{name}: {} {}, worst {:?} px",
            record["chain"],
            record["settings"],
            measure(&record, "bound_worst")
        );
        assert_eq!(measure(&record, "bound_violations"), Some(0.0), "{what}");
    }
}

#[test]
fn on_exact_shapes_from_everywhere() {
    // each view with each of them on other shapes
    let mut rows = [(4, 1), (1, 2), (2, 4)].into_iter().cycle();
    for (shape, terrain) in SHAPES {
        for ((view, camera), rows) in VIEWS.into_iter().zip(&mut rows) {
            holds(&format!("{shape}, {view}, {rows:?} rows"), terrain, camera, "(160, 120)", "Triangles", rows);
        }
    }
}

/// Rays all but along the terrain's border, where one leaves it and the one beside it has a way to go.
#[test]
fn along_the_border() {
    let camera = "Flight(frames: 24, clearance_m: 12, \
                  keys: [(eye: (3, 60, 100), look_at: (366, 1000, 0)), (eye: (3, 120, 100), look_at: (366, 1060, 0))])";
    for surface in ["Triangles", "Bilinear"] {
        holds("along the border", SHAPES[2].1, camera, "(160, 120)", surface, (2, 4));
    }
}

#[test]
fn on_bilinear_patches() {
    for (shape, terrain) in [SHAPES[2], SHAPES[3]] {
        holds(&format!("{shape}, bilinear"), terrain, VIEWS[0].1, "(160, 120)", "Bilinear", (4, 2));
    }
}

#[test]
fn on_real_terrain() {
    let Some(dem) = shared_dem() else { return };
    let scenes = [
        (
            "puget_sound_cascades_2049x1025.png\", cell_m: 90, height_scale_m: 0.125",
            "Flight(frames: 2, clearance_m: 200, keys: [(eye: (90000, 42000, 2500), look_at: (150000, 50000, 1200)), (eye: (130000, 46000, 2600), look_at: (180000, 60000, 1500))])",
        ),
        (
            "jacksboro_403x344.png\", cell_m: (74.48, 92.61), height_offset_m: 236",
            "Flight(frames: 2, clearance_m: 150, keys: [(eye: (3000, 2000, 2600), look_at: (14000, 16000, 900)), (eye: (15000, 17000, 2300), look_at: (24000, 28000, 1200))])",
        ),
    ];
    for (file, camera) in scenes {
        let terrain = format!("Dem(file: \"{}/{file})", dem.display());
        holds(file, &terrain, camera, "(320, 240)", "Triangles", (2, 1));
    }
}

/// The picture of a Proven chain with lists of single pixels, and of blocks of rows: are they the same?
fn shares(terrain: &str, camera: &str, threshold_px: f64, rows: u32) -> bool {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "Experiment(scene: (terrain: {terrain}, camera: {camera}, viewport: (161, 121)), chains: {{ \"proven\": \
         [HeightPyramid, PlanePyramid, ViewGrid(size: (16, 12)), Project(filter: Finest), \
         GridError(rule: Proven, threshold_px: {threshold_px}), LeadRays, Rasterize, Compact, RayFill] }}, \
         sweep: {{\"proven.Compact.rows\": [1, {rows}]}}, measure: [ScreenError])"
    );
    std::fs::write(folder.path().join("shared.ron"), text).unwrap();
    succeeded(&run(folder.path(), &["run", "shared.ron", "--out", "out"]));
    let records = records(&folder.path().join("out"));
    for record in &records {
        assert_eq!(measure(record, "bound_violations"), Some(0.0), "{}", record["settings"]);
    }
    let mean: Vec<_> = records.iter().map(|record| measure(record, "error_mean")).collect();
    assert_eq!(mean.len(), 2);
    mean[0] != mean[1]
}

#[test]
fn pixels_share_a_ray_where_the_bound_has_room_for_it() {
    let gentle = "Noise(kind: Billow, seed: 5, size: (151, 150), cell_m: 10.0, height_m: (0, 150), wavelength_m: 300)";
    let along = |roll_deg: u32| {
        format!("Still(eye: (700, 50, 0), yaw_deg: 5, pitch_deg: -4, roll_deg: {roll_deg}, clearance_m: 60)")
    };
    assert!(shares(gentle, &along(0), 1.0, 2));
    assert!(shares(gentle, &along(180), 1.0, 2), "upside down, the rows' order is the other one");
    assert!(shares(gentle, &along(0), 2.0, 3));
    assert!(!shares(gentle, &along(0), 0.5, 2), "half a pixel is all of the bound");
    assert!(!shares(gentle, &along(90), 1.0, 2), "pixels of a column are beside each other");
}

/// The estimates of the paper are not bounds; a count that is always zero would say nothing.
#[test]
fn the_count_of_violations_sees_them() {
    let folder = tempfile::tempdir().unwrap();
    let fill = "GridError, Rasterize, Compact, RayFill";
    let text = format!(
        "Experiment(scene: (terrain: {}, camera: {}, viewport: (160, 120)), chains: {{ \
         \"paper\": [HeightPyramid, ViewGrid(size: (160, 120)), Project, {fill}], \
         \"finest\": [HeightPyramid, ViewGrid(size: (32, 24)), Project(filter: Finest), {fill}] }}, measure: [ScreenError])",
        SHAPES[3].1, VIEWS[0].1
    );
    std::fs::write(folder.path().join("paper.ron"), text).unwrap();
    succeeded(&run(folder.path(), &["run", "paper.ron", "--out", "out"]));
    for record in records(&folder.path().join("out")) {
        let violations = measure(&record, "bound_violations").unwrap();
        assert!(
            violations > 0.0 && measure(&record, "bound_worst").unwrap() > 1.0,
            "{}: {violations}",
            record["chain"]
        );
    }
}
