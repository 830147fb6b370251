//! One door to the ground: kernels find the same bits in each of its forms, a kernel's own heights are one, and grounds that are not an array
//! of samples answer everything that cameras, measures and references ask. Windows and the sphere are thrown away; ARCHITECTURE says what is to
//! become of them.

mod common;
#[path = "grounds/sphere.rs"]
mod sphere;
#[path = "grounds/window.rs"]
mod window;

use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, DVec3, UVec2};
use lodlab::camera::{self, Camera};
use lodlab::check::{self, cases::Case};
use lodlab::experiment::diagnostic::Source;
use lodlab::experiment::scene::Detail;
use lodlab::experiment::scene::{Scene, Surface};
use lodlab::experiment::tree::Node;
use lodlab::gpu::Gpu;
use lodlab::ground::octaves::Octaves;
use lodlab::ground::{Detailed, Ground, Ray, Samples};
use lodlab::measure::screen_error::{self, SKY};
use lodlab::measure::triangles::{Triangles, folds};
use lodlab::reference::Frame;
use lodlab::run::{Keep, Setup};
use lodlab::stages::{Example, shared::first_hit::first_hit};
use lodlab::terrain::HeightField;
use sphere::Sphere;
use window::Window;

const TERRAIN: &str =
    "Noise(kind: Ridged, seed: 3, size: (65, 49), cell_m: (20, 25), height_m: (100, 500), wavelength_m: 700)";

fn scene(camera: &str) -> Scene {
    let text = format!("(terrain: {TERRAIN}, camera: {camera}, viewport: (48, 36))");
    Node::read(&Source::new("test", text)).unwrap().parse().unwrap()
}

fn field() -> Arc<HeightField> {
    let scene = scene("Still(eye: (0, 0, 0))");
    Arc::new(HeightField::load(&scene.terrain, Path::new("")).unwrap())
}

fn plane(surface: Surface) -> Arc<Samples> {
    Arc::new(Samples::new(field(), surface))
}

/// A sphere of 6000 m with hills of up to 400 m.
fn planet() -> Sphere {
    let size = UVec2::new(64, 33);
    let height = |at: UVec2| {
        let (lon, lat) =
            (f64::from(at.x) / 64.0 * std::f64::consts::TAU, f64::from(at.y) / 32.0 * std::f64::consts::PI);
        // all samples of a pole's row are one place
        200.0 + 200.0 * lat.sin() * (3.0 * lon).cos()
    };
    Sphere::new(6000.0, size, height)
}

/// The first hit of a ray, by nothing but what a ground answers: between two bends the surface is smooth, and so often halved that it is all
/// but straight.
fn cast(ground: &dyn Ground, ray: &Ray) -> Option<f64> {
    let (enter, leave) = ground.stay(ray)?;
    let mut places = ground.bends(ray, enter, leave);
    places.extend([enter, leave]);
    places.sort_by(f64::total_cmp);
    let above = |t: f64| ground.above_m(ray.at(t));
    let side = above(enter).signum();
    for pair in places.windows(2) {
        let steps = 16;
        for step in 0..steps {
            let at = |step: i32| pair[0] + (pair[1] - pair[0]) * f64::from(step) / f64::from(steps);
            let (mut low, mut high) = (at(step), at(step + 1));
            if side * above(high) > 0.0 {
                continue;
            }
            for _ in 0..80 {
                let middle = 0.5 * (low + high);
                if side * above(middle) > 0.0 { low = middle } else { high = middle }
            }
            return Some(high);
        }
    }
    None
}

/// What every ground has to be: consistent with itself wherever it is asked.
fn is_consistent(ground: &dyn Ground, places: &[DVec3]) {
    let (low, high) = ground.range_m();
    assert!(low < high && ground.steepest() > 0.0);
    assert_eq!(ground.identity().len(), 32);
    for &place in places {
        let (up, surface) = (ground.up(place), ground.surface_at(place));
        assert!((up.length() - 1.0).abs() < 1e-12);
        assert!(ground.above_m(surface).abs() < 1e-6, "{place}: {}", ground.above_m(surface));
        assert!((ground.above_m(surface + up * 7.0) - 7.0).abs() < 1e-6);
        // the surface is in one of the parts, and where it is said to be
        let slack = DVec3::splat(1e-6);
        let holds = |part: &lodlab::ground::Part| {
            surface.cmpge(part.low_m - slack).all() && surface.cmple(part.high_m + slack).all()
        };
        assert!(ground.margin_m(place) < 0.0 || ground.parts().iter().any(holds), "{place}");
        // who asks for a clearance gets it, and who stands on the ground stands above it
        assert!((ground.above_m(ground.stand(surface, Some(20.0))) - 20.0).abs() < 1e-6);
        let standing = ground.above_m(ground.stand(surface, None));
        assert!(ground.margin_m(place) < 0.0 || (standing - 0.01).abs() < 1e-6, "{standing}");
        assert!(ground.can_see_underside(surface - up * 3.0));
    }
}

/// Looks at a ground through a camera: an exact picture of it has no error, one that is off is off, and what is not shown is missed.
fn is_measured(ground: &dyn Ground, camera: &Camera) {
    let (width, height) = camera.viewport;
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)));
    let rays: Vec<Ray> = pixels.map(|pixel| Ray { eye_m: camera.eye_m, direction: camera.ray(pixel) }).collect();
    let true_m: Vec<f64> = rays.iter().map(|ray| cast(ground, ray).unwrap_or(-1.0)).collect();
    for (ray, true_m) in rays.iter().zip(&true_m) {
        let hit_m = ground.first_hit(ray).unwrap_or(-1.0);
        // over octaves, a ray is followed until it is 1e-8 of its way over the surface, which it can come to at a hundredth of its speed
        let off = if ground.detail().is_some() { 1e-6 } else { 1e-9 };
        assert!((hit_m - true_m).abs() <= off * true_m.abs(), "{hit_m} for {true_m}");
    }
    let hits: Vec<f32> = true_m.iter().map(|&hit_m| hit_m as f32).collect();
    let hit = hits.iter().filter(|hit| **hit > 0.0).count();
    assert!(hit > hits.len() / 4, "{hit} of {} pixels show the ground", hits.len());
    let exact = screen_error::frame(ground, camera, &hits, &true_m, Some(0.01));
    let worst = exact.error_px.iter().filter(|error| !error.is_nan()).fold(0.0f32, |worst, error| worst.max(*error));
    assert!(worst < 1e-2, "{worst}");
    assert_eq!(exact.broken.unwrap().pixels, 0);
    // nearer by a tenth: the true surface is under, or behind, what is shown
    let nearer: Vec<f32> = hits.iter().map(|hit| if *hit > 0.0 { 0.9 * hit } else { *hit }).collect();
    let off = screen_error::frame(ground, camera, &nearer, &true_m, None);
    assert!(off.error_px.iter().filter(|error| !error.is_nan()).all(|error| *error > 0.0));
    // nothing at all where there is ground
    let sky = vec![-1.0; hits.len()];
    let missed = screen_error::frame(ground, camera, &sky, &true_m, Some(0.5));
    let is_sky = |(hit, error): (&f32, &f32)| error.is_nan() == (SKY.is_nan() && *hit < 0.0);
    assert!(hits.iter().zip(&missed.error_px).all(is_sky), "what should have been shown is no sky");
    // (what sticks out towards the eye sticks out of no ray: seen from above, little does)
    assert!(missed.broken.unwrap().pixels > hit / 4, "{:?} of {hit}", missed.broken);
}

fn places_of_plane(ground: &dyn Ground) -> Vec<DVec3> {
    let extent = ground.lattice().extent_m();
    (0..200)
        .map(|i| (extent * DVec2::new((f64::from(i) * 0.618).fract(), (f64::from(i) * 0.414).fract())).extend(900.0))
        .collect()
}

fn camera_of_plane(ground: &dyn Ground) -> Camera {
    let scene = scene("Still(eye: (400, 60, 0), look_at: (900, 900, 250), clearance_m: 150)");
    camera::path(&scene, ground)[0]
}

#[test]
fn samples_are_a_ground() {
    for surface in [Surface::Triangles, Surface::Bilinear] {
        let ground = plane(surface);
        is_consistent(ground.as_ref(), &places_of_plane(ground.as_ref()));
        is_measured(ground.as_ref(), &camera_of_plane(ground.as_ref()));
    }
}

/// Octaves over another ground: a property of the scene's terrain that nobody above the ground has to know.
#[test]
fn detail_over_a_ground_is_a_ground() {
    let base = plane(Surface::Triangles);
    let octaves = Octaves::new(&Detail { octaves: 3, amplitude_m: 6.0, ..Detail::default() }).unwrap();
    let detail = Detailed::new(base.clone(), octaves);
    is_consistent(&detail, &places_of_plane(&detail));
    is_measured(&detail, &camera_of_plane(&detail));
    let places = places_of_plane(base.as_ref());
    assert!(places.iter().any(|place| (detail.above_m(*place) - base.above_m(*place)).abs() > 1.0));
    assert_ne!(base.identity(), detail.identity());
}

/// Windows of a terrain that is not in memory: tiles are read when they are asked for, and answer to the bit what the whole does.
#[test]
fn windows_of_a_terrain_are_a_ground() {
    let (whole, field) = (plane(Surface::Triangles), field());
    let window = Window::new(whole.lattice(), 4, move |at| field.height_m(at.x, at.y).into());
    is_consistent(&window, &places_of_plane(&window));
    is_measured(&window, &camera_of_plane(&window));
    let scene_camera = camera_of_plane(whole.as_ref());
    for place in places_of_plane(whole.as_ref()) {
        assert_eq!(window.surface_at(place), whole.surface_at(place));
        let ray = Ray { eye_m: scene_camera.eye_m, direction: place - scene_camera.eye_m };
        assert_eq!(window.stay(&ray), whole.stay(&ray));
        assert_eq!(window.bends(&ray, 0.0, 2.0), whole.bends(&ray, 0.0, 2.0));
        let sample = whole.lattice().sample_from_world(place.truncate());
        assert_eq!(window.range_over_m(sample - 3.0, sample + 3.0), whole.range_over_m(sample - 3.0, sample + 3.0));
    }
    assert!(window.tiles_read() > 16, "{}", window.tiles_read());
    // the references of stages ask a ground and do not know which
    let setup = Setup::chain(
        &format!("terrain: {TERRAIN}, camera: Still(eye: (400, 60, 0), look_at: (900, 900, 250), clearance_m: 150), viewport: (48, 36)"),
        "[HeightPyramid, RayCast]",
        Path::new(""),
        Keep::Last,
    )
    .unwrap();
    let data = &setup.prepared.data;
    let of_whole = Frame::first(data, &data.cameras()[0]);
    let of_window = Frame { ground: &window, ..of_whole };
    for pixel in [DVec2::new(24.5, 30.5), DVec2::new(3.5, 20.5), DVec2::new(40.5, 2.5)] {
        assert_eq!(first_hit(&of_whole, pixel).0.to_bits(), first_hit(&of_window, pixel).0.to_bits());
    }
}

/// A sphere whose longitude wraps: up is not z, there is no border, and a ray meets it on both sides of the date line and over the poles.
#[test]
fn a_sphere_is_a_ground() {
    let planet = planet();
    let around = |i: i32| {
        let (z, turn) = (1.0 - 2.0 * (f64::from(i) + 0.5) / 300.0, f64::from(i) * 2.399_963);
        DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z) * 7000.0
    };
    let mut places: Vec<DVec3> = (0..300).map(around).collect();
    // both poles, and both sides of the date line
    places.extend([
        DVec3::Z * 7000.0,
        DVec3::NEG_Z * 7000.0,
        DVec3::new(-7000.0, 1e-3, 5.0),
        DVec3::new(-7000.0, -1e-3, 5.0),
    ]);
    is_consistent(&planet, &places);
    let [east, west] = [places[302], places[303]].map(|place| planet.surface_at(place));
    assert!(east.distance(west) < 1.0, "the surface is one across the date line");
    let scene = scene("Still(eye: (0, 0, 0))");
    // over the north pole, under the south pole, on the equator behind the date line
    for eye in [DVec3::new(300.0, -200.0, 9000.0), DVec3::new(100.0, 0.0, -8000.0), DVec3::new(-9000.0, 100.0, 200.0)] {
        is_measured(&planet, &Camera::looking_at(eye, DVec3::ZERO, &scene));
    }
    // triangles that face away from the ground are right side up, also where that is down
    let outwards = |at: DVec3| {
        let (a, b) = at.normalize().any_orthonormal_pair();
        let corners = [at, at + a * 100.0, at + b * 100.0];
        let turned = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(at) > 0.0;
        let [p, q, r] = corners.map(|corner| corner.as_vec3().to_array());
        if turned { [p, q, r] } else { [p, r, q] }
    };
    let mesh = Triangles { corners: places.iter().map(|place| outwards(*place)).collect(), border: Vec::new() };
    assert_eq!(folds(&mesh, &planet, DVec3::ZERO), 0);
    assert!(folds(&mesh, plane(Surface::Triangles).as_ref(), DVec3::ZERO) > 100, "on a plane half of them are");
}

/// An array and an image are the same ground: every kernel has the same bits in either form.
#[test]
fn the_forms_of_the_ground_have_the_same_bits() {
    let gpu = Gpu::open(None).unwrap();
    let chains = [
        "[HeightPyramid, PlanePyramid, ViewGrid(size: (33, 25)), Project, GridError, Rasterize, Compact, RayFill, Shade]",
        "[HeightPyramid, PlanePyramid, ViewGrid(size: (33, 25)), Project(filter: Finest), GridError(rule: Proven), LeadRays, Rasterize, \
         Compact(rows: 2), RayFill]",
        "[HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: 2), TriangleSplitting, Rasterize, Slope]",
        "[HeightPyramid, RayCast, Shade]",
    ];
    let camera = "Still(eye: (400, 60, 0), look_at: (900, 900, 250), clearance_m: 90)";
    for (chain, surface) in chains.iter().flat_map(|chain| [(chain, "Triangles"), (chain, "Bilinear")]) {
        if chain.contains("Roughness(error: Proven)") && surface == "Bilinear" {
            continue;
        }
        let outputs = |held: &str| {
            let scene = format!(
                "terrain: {TERRAIN}, surface: {surface}, held_as: {held}, camera: {camera}, viewport: (64, 48)"
            );
            let setup = Setup::chain(&scene, chain, Path::new(""), Keep::Everything).unwrap();
            let mut executor = setup.executor(&gpu).unwrap();
            executor.frame(0).unwrap();
            let (array, image) = setup.plan.bound_as(setup.plan.find("height").unwrap());
            let read = |&id| {
                let bytes: Vec<u8> = executor.read(id).unwrap();
                (setup.plan.buffer(id).name.clone(), blake3::hash(&bytes))
            };
            let buffers: Vec<(String, blake3::Hash)> = setup.plan.outputs.iter().map(read).collect();
            (buffers, array, image)
        };
        let (auto, array, image) = (outputs("Auto"), outputs("Array"), outputs("Image"));
        assert_eq!((array.1, array.2, image.2), (true, false, true), "{chain}");
        assert!(auto.0 == array.0 && auto.0 == image.0, "{chain} {surface}");
    }
}

/// What a kernel makes of the heights is the ground of the stages after it, as if it had been the terrain; the truth stays the scene's.
#[test]
fn a_kernel_makes_a_ground() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(Path::new(common::ROOT).join("experiments/kernels/smooth.wgsl"), folder.path().join("smooth.wgsl"))
        .unwrap();
    let smooth = "Kernel(file: \"smooth.wgsl\", bind: {\"src\": \"height\", \"dst\": New(name: \"height\", of: F32, like: \"height\")}, \
                  over: \"height\", repeat: 4, ping_pong: (\"src\", \"dst\"))";
    let experiment = |terrain: &str, before: &str| {
        format!(
            "Experiment(scene: (terrain: {terrain}, camera: Still(eye: (400, 60, 700), look_at: (900, 900, 250)), viewport: (64, 48)), \
             chains: {{\"cast\": [{before} HeightPyramid, RayCast], \"tree\": [{before} HeightPyramid, Roughness, VertexSplitting, \
             TriangleSplitting, Rasterize]}}, measure: [ScreenError])"
        )
    };
    let own = common::records_of(folder.path(), &experiment(TERRAIN, &format!("{smooth},")), &["--dump", "height"]);
    // the heights that it made, as a terrain of their own
    let dumped = format!("made/dumps/{}/height_0000.npy", own[0]["hash"].as_str().unwrap());
    std::fs::copy(folder.path().join(dumped), folder.path().join("smoothed.npy")).unwrap();
    let terrain = "Dem(file: \"smoothed.npy\", cell_m: (20, 25))";
    let as_terrain = common::records_of(folder.path(), &experiment(terrain, ""), &[]);
    for (own, as_terrain) in own.iter().zip(&as_terrain) {
        let distance = |record: &serde_json::Value| {
            let buffers = record["buffers"].as_array().unwrap();
            buffers.iter().find(|buffer| buffer[0] == "distance").unwrap()[1].clone()
        };
        assert_eq!(distance(own), distance(as_terrain), "{}", own["chain"]);
        // against the scene's own surface it is off by what was smoothed away, and against itself by nothing
        assert!(common::measure(own, "error_mean").unwrap() > 0.1);
        assert!(common::measure(as_terrain, "error_mean").unwrap() < common::measure(own, "error_mean").unwrap() / 2.0);
    }
}

/// Stages over heights that a kernel has made, against their references over the same heights.
#[test]
fn stages_over_a_made_ground_meet_their_references() {
    const SMOOTH: &str = include_str!("../experiments/kernels/smooth.wgsl");
    static CHAINS: [Example; 2] = [
        Example::new(
            "[Kernel(file: \"smooth.wgsl\", bind: {\"src\": \"height\", \"dst\": New(name: \"height\", of: F32, like: \"height\")}, \
             over: \"height\", repeat: 2, ping_pong: (\"src\", \"dst\")), HeightPyramid, Slope, Roughness, ViewGrid(size: (17, 13)), Project, \
             Rasterize, Shade]",
        )
        .with_files(&[("smooth.wgsl", SMOOTH)]),
        Example::new(
            "[Kernel(file: \"smooth.wgsl\", bind: {\"src\": \"height\", \"dst\": New(name: \"height\", of: F32, like: \"height\")}, \
             over: \"height\"), HeightPyramid, RayCast, Shade]",
        )
        .with_files(&[("smooth.wgsl", SMOOTH)]),
    ];
    let gpu = Gpu::open(None).unwrap();
    for surface in ["Triangles", "Bilinear"] {
        let scene = format!(
            "terrain: {TERRAIN}, surface: {surface}, camera: Still(eye: (400, 60, 700), look_at: (900, 900, 250)), viewport: (67, 45)"
        );
        let case = Case { name: surface.into(), scene, examples: CHAINS.iter().collect() };
        let outcomes = check::run_case(&gpu, &case).unwrap();
        assert!(outcomes.len() > 10);
        for outcome in outcomes {
            assert!(outcome.passed(), "{outcome}");
        }
    }
}

/// A map of colours of any size lies on the ground, and is not uploaded where nobody shades.
#[test]
fn a_map_of_colours_is_shown() {
    static SHADED: [Example; 1] = [Example::new("[HeightPyramid, RayCast, Shade]")];
    let folder = tempfile::tempdir().unwrap();
    let gpu = Gpu::open(None).unwrap();
    let colours = |columns: u32, rows: u32| {
        let name = folder.path().join(format!("{columns}x{rows}.png"));
        let pixel = |x: u32, y: u32| image::Rgb([(x * 37 % 256) as u8, (y * 91 % 256) as u8, ((x + y) % 7 * 30) as u8]);
        image::RgbImage::from_fn(columns, rows, pixel).save(&name).unwrap();
        format!("Image(file: \"{}\")", name.display())
    };
    let maps = [
        colours(1, 1),
        colours(2, 3),
        colours(65, 49),
        colours(200, 17),
        "Cover()".into(),
        "Cover(rock_deg: 10, water_m: 150)".into(),
    ];
    for (map, surface) in maps.iter().flat_map(|map| [(map, "Triangles"), (map, "Bilinear")]) {
        for camera in [
            "Still(eye: (400, 60, 700), look_at: (900, 900, 250))",
            "Still(eye: (-40000, -30000, 9000), look_at: (600, 600, 250))",
        ] {
            let scene =
                format!("terrain: {TERRAIN}, surface: {surface}, colour: {map}, camera: {camera}, viewport: (67, 45)");
            let case = Case { name: map.clone(), scene, examples: SHADED.iter().collect() };
            for outcome in check::run_case(&gpu, &case).unwrap() {
                assert!(outcome.passed(), "{outcome}");
            }
        }
    }
    let plan = |chain: &str| {
        let scene = format!(
            "terrain: {TERRAIN}, colour: Cover(), camera: Still(eye: (400, 60, 700), look_at: (900, 900, 250))"
        );
        Setup::chain(&scene, chain, Path::new(""), Keep::Last).unwrap().plan
    };
    let uploads = |chain: &str| plan(chain).steps.iter().any(|step| step.label == "upload colour_map");
    assert!(uploads("[HeightPyramid, RayCast, Shade]"));
    for unshaded in ["[HeightPyramid, RayCast]", "[HeightPyramid, RayCast, Shade(map: false)]"] {
        assert!(!uploads(unshaded), "{unshaded}");
        assert!(plan(unshaded).left_out.iter().any(|left| left.what == "scene: upload colour_map"), "{unshaded}");
    }
}
