//! Chains that promise a bound, over any scene.

use super::{measure, records, run, succeeded};

/// Runs a Proven chain over scenes, grids and thresholds, and asserts that no pixel breaks its bound. `rows` is how many pixels may
/// share a ray, on a uniform and on a warped grid.
pub fn proven_holds(name: &str, terrain: &str, camera: &str, viewport: &str, surface: &str, rows: (u32, u32)) {
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

/// Runs chains over scenes as a user does, and hands out each record with its name.
pub fn measured(
    terrain: &str,
    camera: &str,
    viewport: &str,
    chains: &str,
    sweep: &str,
    check: impl Fn(&str, &serde_json::Value),
) {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "Experiment(scene: (terrain: {terrain}, camera: {camera}, viewport: {viewport}), chains: {{ {chains} }}, \
         sweep: {{ {sweep} }}, measure: [ScreenError, Mesh])"
    );
    std::fs::write(folder.path().join("split.ron"), text).unwrap();
    succeeded(&run(folder.path(), &["run", "split.ron", "--out", "out"]));
    for record in records(&folder.path().join("out")) {
        check(&format!("{} {} on {terrain} from {camera}", record["chain"], record["settings"]), &record);
    }
}

pub const BOUNDED: &str =
    "\"proven\": [HeightPyramid, Roughness(error: Proven), VertexSplitting, TriangleSplitting, Rasterize]";
pub const BOTH: &str = "\"paper\": [HeightPyramid, Roughness, VertexSplitting, TriangleSplitting, Rasterize], \
    \"proven\": [HeightPyramid, Roughness(error: Proven), VertexSplitting, TriangleSplitting, Rasterize]";

/// Runs splitting chains over a scene and three thresholds, and asserts that there are no gaps and no broken bounds.
pub fn splitting_holds(terrain: &str, camera: &str, viewport: &str, chains: &str) {
    let sweep = "\"*.VertexSplitting.threshold_px\": [0.5, 1, 3]";
    measured(terrain, camera, viewport, chains, sweep, |what, record| {
        assert_eq!(measure(record, "cracks"), Some(0.0), "{what}");
        assert_eq!(measure(record, "pinholes"), Some(0.0), "{what}");
        assert_eq!(measure(record, "folded"), Some(0.0), "{what}");
        let violations = measure(record, "bound_violations").unwrap();
        if record["chain"] == "proven" {
            assert_eq!(violations, 0.0, "{what}, worst {:?} px", measure(record, "bound_worst"));
        }
    });
}
