//! What the geometry image promises: its sketch map holds the view from anywhere and does not move the ground under it, its warp does not fold,
//! and more rounds serve the demand no worse.

mod common;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use common::{Ran, measure};
use glam::{DVec2, DVec3, IVec2};
use lodlab::gpu::Gpu;
use lodlab::ground::Ray;
use lodlab::run::{Keep, Setup};

const RELIEF: &str =
    "Noise(kind: Ridged, seed: 4, size: (201, 157), cell_m: 30, height_m: (0, 900), wavelength_m: 2500)";

/// A camera that looks up degree by degree, from straight down to straight up.
fn every_pitch(eye: DVec3) -> String {
    let mut keys = String::new();
    for degrees in -90..=90 {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let at = eye + 1000.0 * DVec3::new(0.6 * cos, 0.8 * cos, sin);
        write!(keys, "(eye: ({}, {}, {}), look_at: ({}, {}, {})), ", eye.x, eye.y, eye.z, at.x, at.y, at.z).unwrap();
    }
    format!("Flight(frames: 181, clearance_m: 1, keys: [{keys}])")
}

/// Corner in samples, samples along a texel, texels along the map.
fn square(ran: &Ran) -> (IVec2, i32, i32) {
    let numbers: Vec<i32> = ran.read("sketch_square");
    let side = 1 << numbers[2];
    (IVec2::new(numbers[0], numbers[1]) * side, side, numbers[3])
}

/// Two triangles a cell, none of them turned over.
fn is_unfolded(vertices: &[[f32; 4]], columns: usize) -> bool {
    let at = |x: usize, y: usize| DVec2::new(vertices[y * columns + x][0].into(), vertices[y * columns + x][1].into());
    let cells = (1..vertices.len() / columns).flat_map(|y| (1..columns).map(move |x| (x, y)));
    let turns = |(x, y): (usize, usize)| {
        let [nw, ne, sw, se] = [at(x - 1, y - 1), at(x, y - 1), at(x - 1, y), at(x, y)];
        [(sw - nw).perp_dot(ne - nw), (se - sw).perp_dot(ne - sw)]
    };
    cells.flat_map(turns).all(|turn| turn >= 0.0)
}

#[test]
fn every_pitch_has_a_square_that_holds_what_is_seen() {
    let gpu = Gpu::open(None).unwrap();
    let chain =
        "[HeightPyramid, SketchMap(texels: 32), SketchImportance, ViewGrid(size: (33, 33)), Warp(rounds: 2), GeometryImage]";
    // on foot, in the air, in space; over the terrain and beside it
    for eye in [(3000.0, 2000.0, 0.0), (900.0, 800.0, 2500.0), (3000.0, 2000.0, 1e5), (-9000.0, -4000.0, 1500.0)] {
        let scene = format!("terrain: {RELIEF}, camera: {}, viewport: (16, 12)", every_pitch(eye.into()));
        let setup = Setup::chain(&scene, chain, Path::new("."), Keep::Last).unwrap();
        let ground = &setup.prepared.data.ground;
        let frames = Ran::frames(&gpu, &scene, chain);
        assert_eq!(frames.len(), 181);
        for (frame, ran) in frames.iter().enumerate() {
            let (corner, side, texels) = square(ran);
            let what = format!("{eye:?}, frame {frame}: {corner} {side}");
            assert!(side * texels >= 4 && side <= 256, "{what}");
            let vertices: Vec<[f32; 4]> = ran.read("vertex");
            assert!(vertices.iter().flatten().all(|number| number.is_finite()), "{what}");
            assert!(is_unfolded(&vertices, 33), "{what}");
            let camera = &setup.prepared.data.cameras()[frame];
            let low = corner.as_dvec2() - 0.5;
            let high = low + f64::from(side * texels);
            for (x, y) in (0..=4).flat_map(|y| (0..=4).map(move |x| (4.0 * f64::from(x), 3.0 * f64::from(y)))) {
                let [right, down, first] = camera.pixel_basis();
                let ray = Ray { eye_m: camera.eye_m, direction: (first + right * x + down * y).normalize() };
                let Some(hit) = ground.first_hit(&ray) else { continue };
                let sample = ground.lattice().sample_from_world(ray.at(hit).truncate());
                assert!(sample.cmpge(low).all() && sample.cmple(high).all(), "{what}: {sample} is seen");
            }
        }
    }
}

/// Texels are nodes of the pyramid: as long as the level stays, a node has the same height in every frame, bit for bit.
#[test]
fn a_node_keeps_its_height_while_the_camera_moves() {
    let gpu = Gpu::open(None).unwrap();
    let flight = "Flight(frames: 40, clearance_m: 30, keys: [(eye: (200, 200, 900), look_at: (3000, 2500, 200)), \
                  (eye: (2500, 1800, 500), look_at: (4500, 4000, 200)), (eye: (5000, 3500, 700), look_at: (1000, 500, 0))])";
    let scene = format!("terrain: {RELIEF}, camera: {flight}, viewport: (64, 48)");
    let mut known: BTreeMap<(i32, i32, i32), u32> = BTreeMap::new();
    let (mut again, mut squares) = (0, Vec::new());
    for ran in Ran::frames(&gpu, &scene, "[HeightPyramid, SketchMap(texels: 40)]") {
        let (corner, side, texels) = square(&ran);
        squares.push((corner, side));
        let heights: Vec<f32> = ran.read("sketch_height");
        for (at, height) in heights.iter().enumerate() {
            let node = corner / side + IVec2::new(at as i32 % texels, at as i32 / texels);
            match known.insert((side, node.x, node.y), height.to_bits()) {
                Some(before) => {
                    again += 1;
                    assert_eq!(before, height.to_bits(), "node {node} of {side} samples");
                }
                None => {}
            }
        }
    }
    squares.dedup();
    assert!(squares.len() > 10 && again > 10_000, "{} squares, {again} nodes seen again", squares.len());
    assert!(squares.iter().any(|(_, side)| *side != squares[0].1), "the level never changes");
}

/// Importance that nothing good can be made of.
#[test]
fn stiff_importance_makes_no_fold() {
    let gpu = Gpu::open(None).unwrap();
    let scene = format!("terrain: {RELIEF}, camera: Still(eye: (200, 200, 900), look_at: (3000, 2500, 200)), viewport: (16, 12)");
    for kind in 0..9 {
        for (points, rounds) in [(9, 1), (33, 2), (64, 3), (101, 8)] {
            let chain = format!(
                "[HeightPyramid, SketchMap(texels: 32), Kernel(file: \"pattern.wgsl\", entry: \"weights\", \
                 bind: {{\"importance\": New(name: \"importance\", of: F32, size: (32, 32))}}, params: (kind: {kind}), over: (1024, 1)), \
                 ViewGrid(size: ({points}, {points})), Warp(rounds: {rounds}), GeometryImage]"
            );
            let vertices: Vec<[f32; 4]> = Ran::chain(&gpu, &scene, &chain).read("vertex");
            assert!(vertices.iter().flatten().all(|number| number.is_finite()), "{chain}");
            assert!(is_unfolded(&vertices, points), "{chain}");
        }
    }
}

/// Their Fig. 3 at eight headings, and a flight.
#[test]
fn more_rounds_serve_the_demand_no_worse() {
    let hill = "terrain: Shape(kind: GaussianHill, size: (253, 253), cell_m: 40, height_m: (0, 1500)), \
                camera: Orbit(frames: 8, center: (5080, 5080, 300), radius_m: 4500, height_m: 900), viewport: (64, 64)";
    let flight = format!(
        "terrain: {RELIEF}, camera: Flight(frames: 8, clearance_m: 30, keys: [(eye: (200, 200, 900), look_at: (3000, 2500, 200)), \
         (eye: (2500, 1800, 500), look_at: (4500, 4000, 200)), (eye: (3000, 2500, 700), look_at: (6000, 4000, 0))]), viewport: (64, 48)"
    );
    for (scene, importances) in [
        (
            hill,
            &[
                "distance: false, frustum: false, facing: false",
                "frustum: false, facing: false",
                "distance: false, facing: false",
                "distance: false, frustum: false",
                "",
            ][..],
        ),
        (&flight[..], &[""]),
    ] {
        for importance in importances {
            let chain = format!(
                "[HeightPyramid, SketchMap(texels: 64), SketchImportance({importance}), ViewGrid(size: (65, 65)), Warp, GeometryImage, Rasterize]"
            );
            let text = format!(
                "Experiment(scene: ({scene}), chains: {{\"image\": {chain}}}, sweep: {{\"*.Warp.rounds\": [1, 2, 4, 8]}}, measure: [Density, Mesh])"
            );
            let folder = tempfile::tempdir().unwrap();
            let mut served = Vec::new();
            for record in common::records_of(folder.path(), &text, &[]) {
                let figure = |name: &str| measure(&record, name).unwrap();
                assert_eq!(figure("folded"), 0.0, "{importance}");
                assert!(figure("kept_way") >= 0.99, "{importance}: {}", figure("kept_way"));
                served.push(figure("served"));
            }
            println!("{importance}: {served:.3?}");
            assert_eq!(served.len(), 4);
            assert!(served.windows(2).all(|pair| pair[1] > pair[0] - 0.01), "{importance}: {served:?}");
            assert!(served[0] > 0.55, "{importance}: {served:?}");
        }
    }
}

/// What a round would give is known before it begins; a round that is not needed leaves the map as it was.
#[test]
fn a_round_that_is_not_needed_changes_nothing() {
    let gpu = Gpu::open(None).unwrap();
    let scene = format!("terrain: {RELIEF}, camera: Still(eye: (200, 200, 900), look_at: (3000, 2500, 200)), viewport: (64, 48)");
    let warp = |parameters: &str| {
        let chain = format!(
            "[HeightPyramid, SketchMap(texels: 32), SketchImportance, ViewGrid(size: (33, 33)), Warp({parameters})]"
        );
        Ran::chain(&gpu, &scene, &chain)
    };
    let residual: Vec<f32> = warp("rounds: 4, least_gain: 0.0001").read("warp_residual");
    assert!(residual[1] < 0.95 * residual[0] && residual[2] > 0.5 * residual[1], "{residual:?}");
    let points = |ran: &Ran| ran.read::<[u32; 2]>("grid_point");
    // the second round gains something, and not half
    let ended = warp("rounds: 4, least_gain: 0.5");
    assert_eq!(points(&ended), points(&warp("rounds: 2, least_gain: 0")), "the third round was not needed");
    assert_ne!(points(&ended), points(&warp("rounds: 1")));
    assert_ne!(points(&ended), points(&warp("rounds: 3, least_gain: 0")));
}
