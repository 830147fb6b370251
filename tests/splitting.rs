//! Geometry splitting: the same quadtree from the root and from the frame before, no cracks, bounds that hold, lists that grow.

mod common;

use std::collections::BTreeSet;

use common::bounds::{BOTH, BOUNDED, measured, splitting_holds as holds};
use common::{Ran, SHAPES, VIEWS, errors, measure, records, run, succeeded};
use lodlab::gpu::Gpu;
use lodlab::measure::triangles::Listed;

/// Level, column and row of each block.
fn leaves(ran: &Ran) -> Vec<(u32, u32, u32)> {
    let count = ran.read::<u32>("leaf_count")[3] as usize;
    let leaves = ran.read::<[u32; 2]>("leaf");
    let block = |&[centre, carried]: &[u32; 2]| {
        let level = carried >> 1;
        (level, (centre & 0xffff) >> (level + 1), (centre >> 16) >> (level + 1))
    };
    leaves[..count].iter().map(block).collect()
}

fn mesh(ran: &Ran) -> Listed {
    Listed::new(&ran.read::<[u32; 4]>("triangle"), ran.read::<u32>("triangle_count")[0])
}

fn scene(terrain: &str, camera: &str) -> String {
    format!("terrain: {terrain}, camera: {camera}, viewport: (160, 120)")
}

fn chain(error: &str, splitting: &str) -> String {
    format!("[HeightPyramid, Roughness(error: {error}), VertexSplitting({splitting}), TriangleSplitting]")
}

const ROUGH: &str = "Noise(kind: Ridged, seed: 5, size: (129, 129), cell_m: 10, height_m: (0, 500), wavelength_m: 600)";
const RULES: [&str; 2] = ["Paper", "Proven"];

#[test]
fn with_no_error_allowed_all_cells_are_there() {
    let gpu = Gpu::open(None).unwrap();
    // the fewest, a row of them, and sizes that are no power of two
    for (columns, rows) in [(2, 2), (2, 9), (3, 2), (17, 17), (37, 53), (129, 65)] {
        let terrain = format!("Noise(kind: Fbm, seed: 2, size: ({columns}, {rows}), cell_m: 10, height_m: (0, 90))");
        let down = scene(&terrain, "Still(eye: (300, 300, 900), pitch_deg: -90)");
        // none can be promised, but all but none
        for (rule, threshold_px) in [("Paper", "0"), ("Proven", "0.0005")] {
            let ran = Ran::chain(&gpu, &down, &chain(rule, &format!("threshold_px: {threshold_px}, cull: false")));
            let all: BTreeSet<(u32, u32, u32)> =
                (0..rows - 1).flat_map(|y| (0..columns - 1).map(move |x| (0, x, y))).collect();
            let found = leaves(&ran);
            assert_eq!(found.len(), all.len(), "{rule} {columns} x {rows}");
            assert_eq!(BTreeSet::from_iter(found), all, "{rule} {columns} x {rows}");
            assert_eq!(mesh(&ran).corners.len(), 2 * all.len());
        }
    }
}

/// In the picture there are cells only; what is culled is out of it.
#[test]
fn culling_leaves_what_is_seen() {
    let gpu = Gpu::open(None).unwrap();
    let terrain = "Noise(kind: Fbm, seed: 2, size: (129, 129), cell_m: 10, height_m: (0, 400), wavelength_m: 900)";
    for (name, camera) in VIEWS {
        let scene = scene(terrain, camera);
        let all = Ran::chain(&gpu, &scene, &chain("Paper", "threshold_px: 0, cull: false"));
        let seen = Ran::chain(&gpu, &scene, &chain("Paper", "threshold_px: 0"));
        let (all, seen) = (leaves(&all), leaves(&seen));
        assert!(seen.iter().all(|&(level, ..)| level == 0), "{name}: {:?}", seen.iter().find(|(level, ..)| *level > 0));
        assert!(
            seen.len() < all.len() || name == "straight down" || name == "from outside",
            "{name}: nothing was culled"
        );
        assert!(BTreeSet::from_iter(all).is_superset(&BTreeSet::from_iter(seen)), "{name}");
    }
}

#[test]
fn with_any_error_allowed_there_is_one_block() {
    let gpu = Gpu::open(None).unwrap();
    let far = scene(ROUGH, "Still(eye: (-3000, -3000, 3000), look_at: (640, 640, 0))");
    for rule in RULES {
        assert_eq!(leaves(&Ran::chain(&gpu, &far, &chain(rule, "threshold_px: 1e6"))), [(7, 0, 0)], "{rule}");
    }
}

#[test]
fn a_flat_terrain_is_one_block() {
    let gpu = Gpu::open(None).unwrap();
    for (name, camera) in VIEWS {
        let flat = scene("Shape(kind: Flat, size: (100, 77), height_m: (40, 40))", camera);
        for (rule, threshold_px) in [("Paper", 0.0), ("Proven", 0.001), ("Paper", 1.0), ("Proven", 1.0)] {
            let ran = Ran::chain(&gpu, &flat, &chain(rule, &format!("threshold_px: {threshold_px}, cull: false")));
            assert_eq!(leaves(&ran), [(7, 0, 0)], "{rule}, {name}");
        }
    }
}

const PATHS: [(&str, &str); 5] = [
    // most of what was found about a node holds for several frames
    (
        "slower",
        "Flight(frames: 20, clearance_m: 20, keys: [(eye: (200, 200, 500), look_at: (900, 900, 100)), (eye: (220, 212, 495), look_at: (960, 880, 120))])",
    ),
    ("turning", "Orbit(frames: 16, center: (640, 640, 100), radius_m: 2000, height_m: 500, turns: 0.03)"),
    (
        "slow",
        "Flight(frames: 6, clearance_m: 20, keys: [(eye: (200, 200, 500), look_at: (900, 900, 100)), (eye: (230, 215, 490), look_at: (905, 910, 100))])",
    ),
    ("round", "Orbit(frames: 5, center: (640, 640, 100), radius_m: 500, height_m: 200, clearance_m: 20)"),
    // two frames far apart: nothing of the first is left in the second
    (
        "cut",
        "Flight(frames: 2, clearance_m: 20, keys: [(eye: (200, 200, 300), look_at: (300, 900, 100)), (eye: (1100, 1000, 900), look_at: (1200, 100, 100))])",
    ),
];

#[test]
fn the_frame_before_leads_to_the_same_leaves() {
    let gpu = Gpu::open(None).unwrap();
    let odd = "Noise(kind: Billow, seed: 1, size: (203, 90), cell_m: 8, height_m: (0, 300), wavelength_m: 500)";
    for (terrain, (path, camera)) in [ROUGH, odd, SHAPES[0].1].into_iter().flat_map(|t| PATHS.map(|path| (t, path))) {
        for (rule, switches) in
            [("Paper", ""), ("Proven", ""), ("Paper", ", carry_flag: false"), ("Proven", ", cull: false")]
        {
            let scene = scene(terrain, camera);
            let root = Ran::frames(&gpu, &scene, &chain(rule, &format!("threshold_px: 1{switches}")));
            let last = Ran::frames(&gpu, &scene, &chain(rule, &format!("threshold_px: 1, start: LastFrame{switches}")));
            for (number, (root, last)) in root.iter().zip(&last).enumerate() {
                let what = format!("{path}, {rule}{switches}, frame {number}");
                let (root, last) = (leaves(root), leaves(last));
                assert_eq!(root.len(), last.len(), "{what}");
                assert!(root.len() > 1, "{what}");
                assert_eq!(BTreeSet::from_iter(root), BTreeSet::from_iter(last), "{what}");
            }
        }
    }
}

/// The root of this terrain has 512 x 512 regions. One corner of it is rough, and the eye goes away from it until the root is not split:
/// then nothing is left of the blocks in the last rows of regions, which were leaves all the time.
#[test]
fn a_root_that_is_split_no_more_leaves_nothing_below_it() {
    let gpu = Gpu::open(None).unwrap();
    let terrain = "Shape(kind: GaussianHill, size: (1025, 1025), cell_m: 1, height_m: (0, 100))";
    let away = "Flight(frames: 12, keys: [(eye: (512, 512, 600), look_at: (512, 500, 0)), (eye: (512, 512, 30000), look_at: (512, 500, 0))])";
    let scene = scene(terrain, away);
    for rule in RULES {
        let frames = |start: &str| {
            let splitting = format!("threshold_px: 1, cull: false, start: {start}");
            Ran::frames(&gpu, &scene, &chain(rule, &splitting)).iter().map(leaves).collect::<Vec<_>>()
        };
        let (root, last) = (frames("Root"), frames("LastFrame"));
        println!(
            "{rule}: {:?} {:?}",
            root.iter().map(Vec::len).collect::<Vec<_>>(),
            last.iter().map(Vec::len).collect::<Vec<_>>()
        );
        for (root, last) in root.into_iter().zip(last) {
            assert_eq!(BTreeSet::from_iter(root), BTreeSet::from_iter(last), "{rule}");
        }
    }
}

/// What a vertex carries changes how often it is looked at, and nothing else.
#[test]
fn what_a_vertex_carries_changes_nothing() {
    let gpu = Gpu::open(None).unwrap();
    let scene = scene(ROUGH, PATHS[1].1);
    let found =
        ["", "carry_flag: false", "carry_size: false", "carry_flag: false, carry_size: false"].map(|switches| {
            let frames = Ran::frames(&gpu, &scene, &chain("Paper", switches));
            frames.iter().map(|ran| BTreeSet::from_iter(leaves(ran))).collect::<Vec<_>>()
        });
    assert!(found.iter().all(|leaves| *leaves == found[0]));
}

#[test]
fn no_cracks_where_neighbours_differ_by_many_levels() {
    let gpu = Gpu::open(None).unwrap();
    // flat up to a cliff
    let cliff = "Shape(kind: Cliff, size: (514, 514), cell_m: 10, height_m: (0, 800))";
    let camera = "Orbit(frames: 4, center: (2560, 2560, 100), radius_m: 2500, height_m: 900, clearance_m: 20)";
    let mut apart = 0;
    for ran in Ran::frames(&gpu, &scene(cliff, camera), &chain("Proven", "threshold_px: 1")) {
        let mesh = mesh(&ran);
        assert_eq!(mesh.cracks(), 0);
        // corners of finer blocks along an edge of a coarser one
        let keys = ran.read::<[u32; 4]>("triangle");
        for (corners, level) in mesh.corners.iter().zip(keys.iter().map(|keys| keys[3])) {
            let edge = (corners[0].as_ivec2() - corners[1].as_ivec2()).abs().max_element() as u32;
            apart = apart.max(level.saturating_sub(edge.max(1).ilog2()));
        }
    }
    assert!(apart >= 4, "neighbours differ by {apart} levels only");
}

#[test]
fn a_measure_of_cracks_sees_them() {
    let key = |(x, y): (u32, u32)| x | y << 16;
    let listed = |triangles: &[[(u32, u32); 3]]| {
        let keys: Vec<[u32; 4]> = triangles.iter().map(|&[a, b, c]| [key(a), key(b), key(c), 0]).collect();
        Listed::new(&keys, 3 * keys.len() as u32)
    };
    let square = |(x, y): (u32, u32), side: u32| {
        let (nw, ne, sw, se) = ((x, y), (x + side, y), (x, y + side), (x + side, y + side));
        [[nw, sw, ne], [se, ne, sw]]
    };
    let coarse = square((0, 0), 4);
    let fine = [square((4, 0), 2), square((4, 2), 2)].concat();
    assert_eq!(listed(&coarse).cracks(), 0);
    assert_eq!(listed(&fine).cracks(), 0);
    // a vertex of the finer ones lies inside the edge from (4, 0) to (4, 4)
    let together = [&coarse[..], &fine].concat();
    assert!(listed(&together).cracks() > 0);
    // split there, it does not any more
    let halves = [coarse[0], [(4, 2), (4, 0), (0, 4)], [(4, 4), (4, 2), (0, 4)]];
    assert_eq!(listed(&[&halves[..], &fine].concat()).cracks(), 0);
    // a triangle that is there twice, and one that is not there
    assert!(listed(&[coarse[0], coarse[0]]).cracks() > 0);
    assert!(listed(&coarse[..1]).cracks() > 0);
}

#[test]
fn bounds_hold_on_exact_shapes_from_everywhere() {
    for (_, terrain) in SHAPES {
        for (_, camera) in VIEWS {
            holds(terrain, camera, "(160, 120)", BOUNDED);
        }
    }
}

#[test]
fn an_eye_may_be_anywhere() {
    let eyes = [
        "Still(eye: (300, 300, 0), yaw_deg: 40, pitch_deg: -5, clearance_m: 0)",
        "Still(eye: (300, 300, 0), yaw_deg: 40, pitch_deg: -85, clearance_m: 0)",
        "Still(eye: (300, 300, -200), yaw_deg: 10, pitch_deg: 30)",
        "Still(eye: (300, 300, -200), yaw_deg: 10, pitch_deg: -30)",
        "Still(eye: (0, 0, 0), yaw_deg: 45, pitch_deg: -5, clearance_m: 2)",
        "Still(eye: (1280, 1280, 0), yaw_deg: 225, pitch_deg: 0, clearance_m: 0)",
        "Still(eye: (640, 640, 250), yaw_deg: 90, pitch_deg: 0, clearance_m: 1)",
    ];
    for camera in eyes {
        holds(ROUGH, camera, "(160, 120)", BOTH);
    }
}

#[test]
fn without_triangle_splitting_there_are_cracks() {
    let chains = "\"open\": [HeightPyramid, Roughness, VertexSplitting, TriangleSplitting(split: false), Rasterize]";
    measured(ROUGH, VIEWS[0].1, "(160, 120)", chains, "", |what, record| {
        assert!(measure(record, "cracks").unwrap() > 100.0, "{what}");
        assert!(measure(record, "bound_violations").unwrap() > 0.0, "{what}");
    });
}

/// Lists that are too short are made longer between frames, and the mesh is the same.
#[test]
fn a_list_that_overflows_grows() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "Experiment(scene: ({}), chains: {{ \
         \"long\": [HeightPyramid, Roughness, VertexSplitting, TriangleSplitting, Rasterize], \
         \"short\": [HeightPyramid, Roughness, VertexSplitting(capacity: 1), TriangleSplitting(capacity: 1), Rasterize], \
         \"kept\": [HeightPyramid, Roughness, VertexSplitting(capacity: 1, start: LastFrame), TriangleSplitting(capacity: 1), Rasterize] \
         }}, measure: [ScreenError, Mesh])",
        scene(ROUGH, PATHS[1].1)
    );
    std::fs::write(folder.path().join("grow.ron"), text).unwrap();
    let output = run(folder.path(), &["run", "grow.ron", "--out", "out"]);
    succeeded(&output);
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &errors(&output);
    for list in ["leaf", "live", "triangle", "tree"] {
        assert!(said.contains(&format!("the list `{list}` holds")), "{list}: {said}");
    }
    let records = records(&folder.path().join("out"));
    assert_eq!(records[0]["buffers"], records[1]["buffers"]);
    // the same triangles in another order
    for name in ["triangles", "cracks", "error_max", "bound_violations"] {
        assert_eq!(measure(&records[0], name), measure(&records[2], name), "{name}");
    }
}

/// What a rasterizer's moved corners did: at the silhouette of a cliff a near triangle lost a pixel, and what was shown there was behind it, by
/// up to 44.7 px. The last eye stands on a cliff, on no side of its mesh that f32 could tell.
#[test]
fn a_bound_holds_beside_cliffs() {
    let cliffs = "Shape(kind: Checkerboard, height_m: (0, 2000), period_cells: 8, size: (33, 33), cell_m:";
    let needles = "Noise(kind: Ridged, seed: 2683, size: (200, 129), cell_m: (1.0045, 0.1217), height_m: (3000, 3411), \
                   wavelength_m: 19.99, octaves: 4)";
    let views = [
        (
            format!("{cliffs} 5)"),
            "(265, 465, 500), look_at: (82.5, 82.5, 1000), clearance_m: 5",
            "(96, 64), fov_deg: 100",
        ),
        (format!("{cliffs} 10)"), "(-500, -100, 500), look_at: (165, 165, 0), clearance_m: 5", "(96, 64), fov_deg: 60"),
        (
            needles.into(),
            "(99.94775, 7.7888, 0), yaw_deg: 180, pitch_deg: -1, clearance_m: 0",
            "(121, 81), fov_deg: 20",
        ),
    ];
    for (terrain, eye, viewport) in views {
        holds(&terrain, &format!("Still(eye: {eye})"), viewport, BOUNDED);
    }
}

/// Meshes in which pixels showed nothing: triangles beside the eye whose plane is so close to it that, drawn larger, they would be all around it,
/// seen from below and from above; and one so large, and so close below the eye, that clipping moved its rim by a pixel.
#[test]
fn a_mesh_is_closed_all_around_an_eye() {
    let views = [
        (
            "Noise(kind: Hybrid, seed: 98251, size: (5, 64), cell_m: (56, 1), height_m: (0, 2819), wavelength_m: 113.69404121408995, octaves: 4)",
            "(70, -50, 0), clearance_m: 0.05, pitch_deg: -67",
            "(64, 48), fov_deg: 60",
        ),
        (
            "Noise(kind: Fbm, seed: 27477, size: (100, 32), cell_m: 1, height_m: (0, 34191), wavelength_m: 99, octaves: 1)",
            "(109.1, -0.78044, -5000), clearance_m: 0.05, pitch_deg: 60.609",
            "(64, 48), fov_deg: 60",
        ),
        (
            "Shape(kind: Sine, size: (64, 200), cell_m: (0.40181, 0.018475), height_m: (0, 1), period_cells: 2)",
            "(5.2638, 1.2933, -0.023458), clearance_m: 0.05, yaw_deg: 46.534, pitch_deg: 10",
            "(64, 48), fov_deg: 60",
        ),
        (
            "Shape(kind: Spike, size: (2, 33), cell_m: (253, 10501), height_m: (0, 1), period_cells: 8)",
            "(133, 115990, 0), clearance_m: 0, yaw_deg: -156, pitch_deg: -90",
            "(64, 48), fov_deg: 60",
        ),
    ];
    for (terrain, eye, viewport) in views {
        holds(terrain, &format!("Still(eye: {eye})"), viewport, BOUNDED);
    }
}
