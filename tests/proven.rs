//! `rule: Proven` is a guarantee: no pixel is off by more than it says, on any terrain and from anywhere.

mod common;

use common::bounds::proven_holds as holds;
use common::{SHAPES, VIEWS, measure, records, run, succeeded};

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

/// Eyes close to the ground, under the mesh that is raised above it: places where the bound was once broken by rays that pass a hundredth of
/// a pixel beside the triangle that hides what they meet.
#[test]
fn on_foot_under_the_raised_mesh() {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");
    let dem = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/dem/jacksboro_403x344.png");
    let noise = format!("Dem(file: \"{data}/ridges_on_foot_128.npy\", cell_m: (30, 30))");
    let narrow = format!("Dem(file: \"{data}/narrow_cells_128.npy\", cell_m: (1, 100))");
    let jacksboro = format!("Dem(file: \"{dem}\", cell_m: (74.5, 92.6), height_offset_m: 236)");
    let cases = [
        (
            noise,
            "Still(eye: (1678.08, 2346.24, 379.39471166992115), yaw_deg: 33, pitch_deg: -1)",
            "(240, 180)",
            "ViewGrid(size: (96, 72)), Project(filter: Finest)",
            1,
        ),
        (
            narrow,
            "Still(eye: (55.936, 7820.8, 130.15582373046874), yaw_deg: 33, pitch_deg: -1)",
            "(240, 180)",
            "ViewGrid(size: (48, 36)), AspectImportance, Warp, Project",
            4,
        ),
        (
            jacksboro,
            "Still(eye: (13432.908218258774, 9439.77289418627, 750.0839230374278), \
             look_at: (14377.677277702724, 8737.977731098239, 634.2246888489308))",
            "(320, 240)",
            "ViewGrid(size: (48, 36)), AspectImportance, Warp, Project",
            1,
        ),
    ];
    for (terrain, camera, viewport, grid, rows) in cases {
        let folder = tempfile::tempdir().unwrap();
        let text = format!(
            "Experiment(scene: (terrain: {terrain}, camera: {camera}, viewport: {viewport}), chains: {{ \"c\": [HeightPyramid, PlanePyramid, \
             {grid}, GridError(rule: Proven, threshold_px: 1), LeadRays, Rasterize, Compact(rows: {rows}), RayFill] }}, measure: [ScreenError])"
        );
        std::fs::write(folder.path().join("foot.ron"), text).unwrap();
        succeeded(&run(folder.path(), &["run", "foot.ron", "--out", "out"]));
        let record = &records(&folder.path().join("out"))[0];
        let worst = measure(record, "bound_worst");
        assert_eq!(measure(record, "bound_violations"), Some(0.0), "{terrain}: {worst:?} px");
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
