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

/// Corner in samples, samples along a texel, texels along the map, of a map of whole nodes.
fn square(ran: &Ran) -> (IVec2, i32, i32) {
    let (first, side, level) = square_samples(ran);
    (first, 1 << level, side >> level)
}

/// First sample, samples along a side, level.
fn square_samples(ran: &Ran) -> (IVec2, i32, i32) {
    let numbers: Vec<i32> = ran.read("sketch_square");
    (IVec2::new(numbers[0], numbers[1]), numbers[2], numbers[3])
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
    // on foot, in the air, in space; over the terrain and beside it
    for (eye, blend) in [
        ((3000.0, 2000.0, 0.0), 0.0),
        ((3000.0, 2000.0, 0.0), 1.0),
        ((900.0, 800.0, 2500.0), 0.0),
        ((900.0, 800.0, 2500.0), 0.3),
        ((3000.0, 2000.0, 1e5), 0.0),
        ((-9000.0, -4000.0, 1500.0), 0.0),
        ((-9000.0, -4000.0, 1500.0), 1.0),
    ] {
        let chain = format!(
            "[HeightPyramid, SketchMap(texels: 32, blend: {blend:?}), SketchImportance, ViewGrid(size: (33, 33)), \
             Warp(rounds: 2), GeometryImage]"
        );
        let scene = format!("terrain: {RELIEF}, camera: {}, viewport: (16, 12)", every_pitch(eye.into()));
        let setup = Setup::chain(&scene, &chain, Path::new("."), Keep::Last).unwrap();
        let ground = &setup.prepared.data.ground;
        let frames = Ran::frames(&gpu, &scene, &chain);
        assert_eq!(frames.len(), 181);
        for (frame, ran) in frames.iter().enumerate() {
            let (corner, side, level) = square_samples(ran);
            let what = format!("{eye:?}, blend {blend}, frame {frame}: {corner} {side}");
            assert!(side >= 32 && level <= 3, "{what}");
            let vertices: Vec<[f32; 4]> = ran.read("vertex");
            assert!(vertices.iter().flatten().all(|number| number.is_finite()), "{what}");
            assert!(is_unfolded(&vertices, 33), "{what}");
            let camera = &setup.prepared.data.cameras()[frame];
            let low = corner.as_dvec2() - 0.5;
            let high = low + f64::from(side);
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
            if let Some(before) = known.insert((side, node.x, node.y), height.to_bits()) {
                again += 1;
                assert_eq!(before, height.to_bits(), "node {node} of {side} samples");
            }
        }
    }
    squares.dedup();
    assert!(squares.len() > 10 && again > 10_000, "{} squares, {again} nodes seen again", squares.len());
    assert!(squares.iter().any(|(_, side)| *side != squares[0].1), "the level never changes");
}

/// The eye rises step by step, so that more and more is seen: at once, the square doubles; blended, it grows with the view. Either way it
/// ends up the same as long as there is room.
#[test]
fn a_blended_change_of_level_does_not_jump() {
    let gpu = Gpu::open(None).unwrap();
    let rise = "Flight(frames: 120, keys: [(eye: (3000, 2300, 1000), look_at: (3000, 2310, 0)), \
                (eye: (3000, 2300, 3500), look_at: (3000, 2310, 0))])";
    let scene = format!("terrain: {RELIEF}, camera: {rise}, viewport: (64, 48)");
    let squares = |blend: f64| {
        let chain = format!("[HeightPyramid, SketchMap(texels: 32, blend: {blend:?})]");
        Ran::frames(&gpu, &scene, &chain).iter().map(square_samples).collect::<Vec<_>>()
    };
    // the largest growth of a side, and move of a corner, from frame to frame
    let jump = |squares: &[(IVec2, i32, i32)]| {
        let of_pair = |pair: &[(IVec2, i32, i32)]| {
            let (a, b) = (pair[0], pair[1]);
            let moved = (a.0 - b.0).abs().max_element().max((a.0 + a.1 - b.0 - b.1).abs().max_element());
            f64::from(moved.max((a.1 - b.1).abs())) / f64::from(a.1)
        };
        squares.windows(2).map(of_pair).fold(0.0, f64::max)
    };
    let at_once = squares(0.0);
    let levels: Vec<i32> = at_once.iter().map(|(.., level)| *level).collect();
    assert!(levels[0] < levels[119], "the level never changes");
    assert!(jump(&at_once) >= 1.0, "{at_once:?}");
    for blend in [0.3, 1.0] {
        let blended = squares(blend);
        // a texel of 32 this way or that, and what the view grows by, the faster the less there is to blend over
        assert!(jump(&blended) < 0.12 + 0.08 / blend, "blend {blend}: {}, {blended:?}", jump(&blended));
        assert!(blended.iter().zip(&levels).all(|(square, level)| square.2 == *level));
        let is_whole = |square: &(IVec2, i32, i32)| square.1 == 32 << square.2;
        let same = at_once.iter().zip(&blended).filter(|(a, b)| is_whole(b) && a == b).count();
        assert_eq!(same, blended.iter().filter(|square| is_whole(square)).count());
        assert!(blended.iter().any(|square| !is_whole(square)));
    }
}

/// Importance that nothing good can be made of.
#[test]
fn stiff_importance_makes_no_fold() {
    let gpu = Gpu::open(None).unwrap();
    let scene = format!(
        "terrain: {RELIEF}, camera: Still(eye: (200, 200, 900), look_at: (3000, 2500, 200)), viewport: (16, 12)"
    );
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
    for (scene, blend, importances) in [
        (
            hill,
            "0",
            &[
                "distance: false, frustum: false, facing: false",
                "frustum: false, facing: false",
                "distance: false, facing: false",
                "distance: false, frustum: false",
                "",
            ][..],
        ),
        (&flight[..], "0", &[""]),
        (&flight[..], "1", &[""]),
    ] {
        for importance in importances {
            let chain = format!(
                "[HeightPyramid, SketchMap(texels: 64, blend: {blend}), SketchImportance({importance}), ViewGrid(size: (65, 65)), Warp, \
                 GeometryImage, Rasterize]"
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
    let scene = format!(
        "terrain: {RELIEF}, camera: Still(eye: (200, 200, 900), look_at: (3000, 2500, 200)), viewport: (64, 48)"
    );
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

/// Rows that follow no others fold so much that no round after the first can be kept; then it is as if there had been none.
#[test]
fn a_round_that_folds_for_good_is_taken_back() {
    let gpu = Gpu::open(None).unwrap();
    let scene = format!(
        "terrain: {RELIEF}, camera: Still(eye: (200, 200, 900), look_at: (3000, 2500, 200)), viewport: (64, 48)"
    );
    let warp = |parameters: &str| {
        let chain = format!(
            "[HeightPyramid, SketchMap(texels: 64), SketchImportance(floor: 0), ViewGrid(size: (33, 33)), Warp({parameters})]"
        );
        Ran::chain(&gpu, &scene, &chain)
    };
    let [once, often] = ["rounds: 1, lead: 0", "rounds: 4, lead: 0, least_gain: 0"].map(warp);
    assert_eq!(once.read::<[u32; 2]>("warp_map"), often.read::<[u32; 2]>("warp_map"));
    let gave_way: Vec<u32> = once.read("warp_gave_way");
    assert!(gave_way.iter().any(|times| *times > 0), "nothing would fold");
    assert_eq!(gave_way, often.read::<u32>("warp_gave_way"), "what is taken back is not counted");
    // led by others they do not fold
    assert_ne!(warp("rounds: 1").read::<[u32; 2]>("warp_map"), warp("rounds: 2").read::<[u32; 2]>("warp_map"));
}

/// What importance is made of, at a sample of a terrain that the map has in full.
fn factors_at(ran: &Ran, sample: (i32, i32)) -> [f64; 4] {
    let (corner, side, texels) = square(ran);
    assert_eq!((side, texels), (1, 32));
    let texel = IVec2::from(sample) - corner;
    assert!(
        texel.min_element() >= 0 && texel.max_element() < 32,
        "sample {sample:?} is not in the map from {corner} on"
    );
    ran.read::<[f32; 4]>("importance_factors")[(texel.y * 32 + texel.x) as usize].map(f64::from)
}

/// Values that are known without either half of the stage: over a plane, from an eye whose place among the texels is known.
#[test]
fn importance_has_the_values_of_its_formulas() {
    let gpu = Gpu::open(None).unwrap();
    // 32 x 32 samples of 100 m in 32 texels; the eye stands over a sample, 1000 m up
    let scene = |kind: &str, height_m: &str| {
        format!(
            "terrain: Shape(kind: {kind}, size: (32, 32), cell_m: 100, height_m: {height_m}), \
             camera: Still(eye: (1500, 1500, 1000), look_at: (1500, 3000, 0)), viewport: (100, 100), fov_deg: 90"
        )
    };
    let factors = |scene: &str, parameters: &str| {
        let chain = format!("[HeightPyramid, SketchMap(texels: 32), SketchImportance(floor: 0, {parameters})]");
        Ran::chain(&gpu, scene, &chain)
    };
    let whole = "frustum: false";
    let flat = factors(&scene("Flat", "(0, 0)"), &format!("{whole}, quad_px: 4"));
    // under the eye it is 1000 m away, and 50 pixels are as wide as they are far away; 1000 m to the east it is 1414 m
    let [iv, sf, sb, _] = factors_at(&flat, (15, 16));
    assert!((iv - 50.0 / (4.0 * 1000.0)).abs() < 1e-7 && (sf, sb) == (1.0, 1.0), "{iv} {sf} {sb}");
    assert!((factors_at(&flat, (25, 16))[0] - 50.0 / (4.0 * 1414.2136)).abs() < 1e-7);
    // a point a texel without distance
    assert!(
        (factors_at(&factors(&scene("Flat", "(0, 0)"), &format!("{whole}, distance: false")), (3, 3))[0] - 0.01).abs()
            < 1e-8
    );
    // of a plane that rises to the east, all that is east of the eye faces it, at the border too; what is far in the west may not
    let ramp = factors(&scene("Ramp", "(-2000, 1100)"), &format!("{whole}, silhouette_deg: 0, fade_deg: 5"));
    assert!((15..32).all(|x| factors_at(&ramp, (x, 16))[2] == 1.0));
    let [border, inside] = [(31, 16), (30, 16)].map(|at| factors_at(&ramp, at)[2]);
    assert_eq!((border, inside), (1.0, 1.0));
}

/// Is by surface type: from slope and altitude, and from a file of any size; a texel of several types has the mean of theirs.
#[test]
fn a_surface_type_has_its_most_points() {
    let gpu = Gpu::open(None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let most_at = |terrain: &str, stages: &str, texels: u32| {
        let scene = format!(
            "terrain: {terrain}, camera: Still(eye: (1600, 1600, 9000), pitch_deg: -90), viewport: (64, 64), fov_deg: 60"
        );
        let chain = format!(
            "[HeightPyramid, SketchMap(texels: {texels}), {stages}SketchImportance(densest_per_m: 7, \
             densest_of_types: (1, 2, 3, 4))]"
        );
        let ran = Ran::chain(&gpu, &scene, &chain);
        let (corner, side, _) = square(&ran);
        let factors: Vec<[f32; 4]> = ran.read("importance_factors");
        move |x: i32, y: i32| {
            let texel = IVec2::new(x, y).div_euclid(IVec2::splat(side)) - corner / side;
            factors[(texel.y * texels as i32 + texel.x) as usize][3]
        }
    };
    // a plateau of 900 m in the east, a cliff along column 16, ground of 100 m in the west
    let cliff = "Shape(kind: Cliff, size: (32, 32), cell_m: 100, height_m: (100, 900))";
    let most = most_at(cliff, "SurfaceType(rock_deg: 60), ", 32);
    assert_eq!([most(3, 8), most(15, 8), most(16, 8), most(28, 30)], [4.0, 2.0, 2.0, 3.0]);
    let most = most_at(cliff, "SurfaceType(rock_deg: 80, water_m: 100, snow_m: 900), ", 32);
    assert_eq!([most(3, 8), most(15, 8), most(16, 8), most(28, 30)], [1.0, 1.0, 4.0, 4.0]);
    // from a file: types 0 and 9 in the north, 3 and 2 in the south
    let file = folder.path().join("types.png");
    image::GrayImage::from_raw(2, 2, vec![0, 9, 3, 2]).unwrap().save(&file).unwrap();
    let flat = |size: u32| {
        format!(
            "Shape(kind: Flat, size: ({size}, {size}), cell_m: 100), surface_type: Image(file: \"{}\")",
            file.display()
        )
    };
    let most = most_at(&flat(32), "", 32);
    assert_eq!([most(0, 0), most(15, 15), most(16, 15), most(15, 16), most(31, 31)], [1.0, 1.0, 7.0, 4.0, 3.0]);
    // a level coarser, four samples are one texel; the columns 16 and 17 are in one, and of two types
    let most = most_at(&flat(34), "", 32);
    assert_eq!([most(2, 2), most(16, 2), most(17, 30), most(18, 30)], [1.0, 4.0, 3.5, 3.0]);
}

/// Seen from straight above, all ground is about as far away, and errors are where a hill is. Points that follow the errors of the frame before
/// go there; in a first frame there are none to follow.
#[test]
fn points_follow_the_errors_of_the_frame_before() {
    let gpu = Gpu::open(None).unwrap();
    let hill = "Shape(kind: GaussianHill, size: (201, 201), cell_m: 30, height_m: (0, 900))";
    let still = "Flight(frames: 8, keys: [(eye: (3000, 3000, 8000), look_at: (3000, 3010, 0)), \
                 (eye: (3001, 3000, 8000), look_at: (3001, 3010, 0))])";
    let scene = format!("terrain: {hill}, camera: {still}, viewport: (64, 64)");
    let frames = |share: f64| {
        let chain = format!(
            "[HeightPyramid, SketchMap(texels: 64), SketchImportance(error_share: {share:?}), ViewGrid(size: (65, 65)), Warp(rounds: 2), \
             GeometryImage, GridError(rule: Estimate, threshold_px: 0.1), ErrorDemand(texels: 32)]"
        );
        Ran::frames(&gpu, &scene, &chain)
    };
    let on_hill = |ran: &Ran| {
        let vertices: Vec<[f32; 4]> = ran.read("vertex");
        vertices.iter().filter(|vertex| f64::from(vertex[0]).hypot(vertex[1].into()) < 1500.0).count()
    };
    let (by_distance, by_errors) = (frames(0.0), frames(1.0));
    let importance = |ran: &Ran| ran.read::<u32>("importance");
    assert_eq!(importance(&by_distance[0]), importance(&by_errors[0]));
    let counts = [&by_distance, &by_errors].map(|frames| frames.iter().map(on_hill).collect::<Vec<_>>());
    assert!((2..8).all(|at| counts[1][at] > counts[0][at] * 5 / 4), "{counts:?}");
    // and they stay there
    assert!((3..8).all(|at| counts[1][at].abs_diff(counts[1][7]) < counts[1][7] / 10), "{counts:?}");
}

/// A wall hides what is behind it and nothing before it, and from beside the terrain nothing hides what is in front.
#[test]
fn a_wall_hides_what_is_behind_it() {
    let gpu = Gpu::open(None).unwrap();
    // from the 17th column on, ground is 300 m high
    let seen = |eye: &str| {
        let scene = format!(
            "terrain: Shape(kind: Cliff, size: (32, 32), cell_m: 100, height_m: (300, 0)), camera: Still(eye: {eye}, look_at: (3000, 1550, 0)), \
             viewport: (64, 64), fov_deg: 100"
        );
        let chain = "[HeightPyramid, SketchMap(texels: 32), SketchImportance(frustum: false, facing: false, occlusion: true, floor: 0)]";
        Ran::chain(&gpu, &scene, chain)
    };
    // 50 m over the plateau in the west, looking east over its edge
    let on_plateau = seen("(500, 1550, 350)");
    assert!((6..15).all(|x| factors_at(&on_plateau, (x, 15))[2] == 1.0));
    assert!(
        (18..21).all(|x| factors_at(&on_plateau, (x, 15))[2] == 0.0),
        "the plateau's edge hides the ground under it"
    );
    // beside the terrain, and as far from it as an eye may be: all of the plateau is in front
    for eye in ["(-900, 1550, 600)", "(-1e9, 1550, 1e9)"] {
        let beside = seen(eye);
        assert!((0..15).all(|x| factors_at(&beside, (x, 15))[2] == 1.0), "{eye}");
    }
    // below the plateau's edge, there is no ground before it that could hide it
    assert_eq!(factors_at(&seen("(-900, 1550, 200)"), (0, 15))[2], 1.0);
}

/// What is farther than asked for is cut off, and a map of an eye that is farther from the terrain than that has four samples at least.
#[test]
fn far_ground_is_not_asked_for() {
    let gpu = Gpu::open(None).unwrap();
    for (eye, most) in [("(3000, 100, 900)", 2 * 40 + 2), ("(-50000, 100, 900)", 4)] {
        let scene =
            format!("terrain: {RELIEF}, camera: Still(eye: {eye}, look_at: (3000, 4000, 0)), viewport: (64, 48)");
        let ran = Ran::chain(&gpu, &scene, "[HeightPyramid, SketchMap(texels: 128, far_m: 1200)]");
        let whole = Ran::chain(&gpu, &scene, "[HeightPyramid, SketchMap(texels: 128)]");
        let ((_, side, texels), (_, whole_side, _)) = (square(&ran), square(&whole));
        assert_eq!((side, texels, whole_side), (1, 128, 2), "{eye}: {most} samples need no coarser level");
        let heights: Vec<f32> = ran.read("sketch_height");
        assert!(heights.iter().all(|height| height.is_finite()));
    }
}
