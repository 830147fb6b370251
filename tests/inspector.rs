//! The inspector as somebody uses it: what is shown equals what a run dumps, and hands and keys do what they should.

mod common;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui_kittest::kittest::Queryable;
use egui_kittest::{Harness, TestRenderer};
use lodlab::experiment::sweep::Varied;
use lodlab::gpu::Gpu;
use lodlab::inspector::desk::Action;
use lodlab::inspector::probe::{Probed, Where};
use lodlab::inspector::view::{Against, Mode, Of};
use lodlab::inspector::wish::{CellName, Moment, Side};
use lodlab::inspector::{App, Screen};
use lodlab::look::Form;

/// Takes in the textures of the window, which a test only needs for pictures.
struct Into(Screen);

impl TestRenderer for Into {
    fn handle_delta(&mut self, delta: &mut egui::TexturesDelta) {
        self.0.take(delta);
    }
}

struct Window {
    harness: Harness<'static, App>,
    screen: Screen,
}

impl Window {
    fn open(file: &Path) -> Self {
        let gpu = Gpu::open(None).unwrap();
        let screen = Screen::without_window(&gpu);
        let mut app = App::new(&gpu, screen.clone(), Arc::new(|| ()), None);
        app.open(file);
        let harness = Harness::builder()
            .with_size(egui::vec2(1400.0, 900.0))
            .with_accessibility_check(false)
            .with_step_dt(1.0 / 60.0)
            .renderer(Into(screen.clone()))
            .build_ui_state(|ui, app: &mut App| app.ui(ui), app);
        let mut window = Self { harness, screen };
        window.settle();
        window
    }

    /// Draws until nothing is on its way.
    fn settle(&mut self) {
        let start = Instant::now();
        let mut quiet = 0;
        while quiet < 4 {
            self.harness.step();
            quiet = if self.harness.state().is_settled() { quiet + 1 } else { 0 };
            assert!(start.elapsed() < Duration::from_secs(120), "it does not come to rest");
            if quiet == 0 {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    }

    fn act(&mut self, action: Action) {
        self.harness.state_mut().act(action);
        self.settle();
    }

    fn see(&mut self, of: Of) -> u64 {
        self.act(Action::See { side: Side::A, of, in_new: true });
        self.harness.state_mut().views_mut().last().unwrap().id
    }

    fn probe(&mut self, view: u64, at: Where) -> Probed {
        self.harness.state_mut().point(view, at).unwrap()
    }

    fn picture(&mut self) -> Vec<u8> {
        let output = self.harness.output().clone();
        self.screen.picture(&self.harness.ctx, output).unwrap().1
    }

    fn shown(&self) -> Arc<lodlab::inspector::wish::Shown> {
        self.harness.state().desk().shown(Side::A).unwrap().clone()
    }
}

/// An experiment in a folder of its own.
fn experiment(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.ron");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

const SCENE: &str = "terrain: Noise(kind: Ridged, size: (65, 49), cell_m: 10, height_m: (0, 300), wavelength_m: 300), \
    camera: Still(frames: 3, eye: (100, 20, 400), look_at: (400, 400, 100)), viewport: (64, 48)";

const COUNTING: &str = "
struct Params { size: vec2<u32> }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> counted: array<i32>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < params.size) {
        counted[id.y * params.size.x + id.x] = i32(id.x) * 3 - i32(id.y) * 5;
    }
}
";

/// Words of an element as a run dumps them, unpacked as the `.npy` has them.
fn dumped(folder: &Path, hash: &str, name: &str, element: usize) -> Vec<String> {
    let path = folder.join("made/dumps").join(hash).join(format!("{name}_0000.npy"));
    let bytes = std::fs::read(path).unwrap();
    let open = || npyz::NpyFile::new(&bytes[..]).unwrap();
    let shape = open().shape().to_vec();
    let plain = shape.len() as u64 - u64::from(name_has_numbers(name));
    let each: usize = shape[plain as usize..].iter().product::<u64>() as usize;
    let text = |value: f32| if value.is_nan() { "missing".into() } else { value.to_string() };
    let range = element * each..(element + 1) * each;
    match open().dtype().descr().as_str() {
        "'<f4'" => open().into_vec::<f32>().unwrap()[range].iter().map(|value| text(*value)).collect(),
        "'<i4'" => open().into_vec::<i32>().unwrap()[range].iter().map(i32::to_string).collect(),
        "'|u1'" => open().into_vec::<u8>().unwrap()[range].iter().map(u8::to_string).collect(),
        _ => open().into_vec::<u32>().unwrap()[range].iter().map(u32::to_string).collect(),
    }
}

/// Buffers of the test below whose elements have several numbers.
fn name_has_numbers(name: &str) -> bool {
    !["distance", "distance@Rasterize", "height", "counted", "leaf_count"].contains(&name)
}

/// The value that is probed equals the one that is dumped without a window, for every type of element and in the middle of a frame.
/// A path that is swept, at one of its values.
fn varied(path: &str, value: &str) -> Varied {
    Varied { path: path.into(), value: value.into(), axis: path.into(), axis_name: None, value_name: None }
}

#[test]
fn what_is_probed_is_what_is_dumped() {
    let (folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"grid\": [HeightPyramid, PlanePyramid, ViewGrid(size: (16, 12)), Project, Rasterize, Shade, \
         Kernel(file: \"counting.wgsl\", bind: {{\"counted\": New(name: \"counted\", of: I32, like: \"distance\")}}, over: \"counted\")], \
         \"tree\": [HeightPyramid, Roughness, VertexSplitting, TriangleSplitting, Rasterize], \
         \"shares memory\": [HeightPyramid, PlanePyramid, ViewGrid(size: (16, 12)), AspectImportance(size: (8, 8)), Warp, Project, \
         GridError(rule: Proven), Rasterize, Compact, RayFill]}}, measure: [Time])"
    ));
    std::fs::write(folder.path().join("counting.wgsl"), COUNTING).unwrap();
    let chains: [(&str, &[&str]); 3] = [
        (
            "grid",
            &[
                "distance",
                "vertex",
                "grid_point",
                "colour",
                "height",
                "plane_slope",
                "counted",
                "vertex@Project/project",
            ],
        ),
        ("tree", &["leaf", "triangle", "leaf_count", "distance"]),
        // looked at in the middle of a frame, and not what later steps put into the same memory
        ("shares memory", &["vertex@Project/project", "grid_point@Warp", "distance@Rasterize", "vertex", "grid_point"]),
    ];
    for (chain, names) in chains {
        let dumps: Vec<&str> = names.iter().flat_map(|name| ["--dump", name]).collect();
        common::succeeded(&common::run(folder.path(), &[&["run", "made.ron", "--out", "made"], &dumps[..]].concat()));
        let records = common::records(&folder.path().join("made"));
        let record = records.iter().find(|record| record["chain"] == chain).unwrap();
        let hash = record["hash"].as_str().unwrap().to_string();
        let mut window = Window::open(&path);
        window.act(Action::Choose { side: Side::A, cell: CellName { chain: chain.into(), settings: Vec::new() } });
        for name in names {
            let view = window.see(Of::Buffer(name.to_string()));
            // of a pyramid all that its buffer holds, and not a level
            window.harness.state_mut().views_mut().last_mut().unwrap().form = Some(Form::Image);
            let told = window.harness.state().refused(Side::A).map(ToString::to_string);
            let held = window.shown().held(name).unwrap_or_else(|| panic!("{name}: {told:?}")).clone();
            let (columns, rows) = held.size();
            for (column, row) in [(0, 0), (columns / 2, rows / 2), (columns - 1, rows - 1)] {
                let probed = window.probe(view, Where::Element(column, row));
                let line = probed.lines.iter().find(|line| line.view == view).unwrap();
                let is_plain = |name: &str| name != "colour" && !name.ends_with("as f32");
                let ours: Vec<&String> =
                    line.numbers.iter().filter(|(name, _)| is_plain(name)).map(|(_, text)| text).collect();
                let file = name.replace('/', "_");
                let theirs = dumped(folder.path(), &hash, &file, (row * columns + column) as usize);
                assert_eq!(ours, theirs.iter().collect::<Vec<_>>(), "{name} [{row}, {column}]");
            }
        }
    }
}

/// A place has all of its names, whichever view somebody points at.
#[test]
fn one_place_in_every_view() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"grid\": [HeightPyramid, ViewGrid(size: (64, 48)), Project, Rasterize, Shade]}}, \
         measure: [Time])"
    ));
    let mut window = Window::open(&path);
    let distance = window.see(Of::Buffer("distance".into()));
    let height = window.see(Of::Buffer("height".into()));
    let vertex = window.see(Of::Buffer("vertex".into()));
    let by_pixel = window.probe(distance, Where::Element(32, 40));
    let ground = by_pixel.spot.ground_m.unwrap();
    let at = |probed: &Probed, view: u64| probed.lines.iter().find(|line| line.view == view).unwrap().element;
    // the sample is the one that the ground of the pixel is nearest to
    let sample = at(&by_pixel, height);
    let off = glam::DVec2::new(f64::from(sample.0) * 10.0, f64::from(48 - sample.1) * 10.0) - ground.truncate();
    assert!(off.abs().max_element() <= 5.0 + 1e-6, "{off}");
    // and back: that sample is seen at the same pixel, to within a sample
    let by_sample = window.probe(height, Where::Element(sample.0, sample.1));
    let pixel = at(&by_sample, distance);
    assert!(pixel.0.abs_diff(32) <= 2 && pixel.1.abs_diff(40) <= 2, "{pixel:?}");
    // the grid point is near by, as the grid's own cells go
    let grid = at(&by_pixel, vertex);
    let by_point = window.probe(vertex, Where::Element(grid.0, grid.1));
    assert!(by_point.spot.ground_m.unwrap().truncate().distance(ground.truncate()) < 20.0);
    assert!(by_point.text().contains("grid point column"));
}

#[test]
fn a_hand_points_and_pins() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, RayCast, Shade]}}, measure: [Time])"
    ));
    let mut window = Window::open(&path);
    window.act(Action::See { side: Side::A, of: Of::Buffer("distance".into()), in_new: false });
    window.settle();
    let point = window.harness.state_mut().views_mut()[0].point_of((10, 40)).unwrap();
    window.harness.hover_at(point);
    window.settle();
    let probed = window.harness.state().desk().probed.clone().unwrap();
    assert_eq!(probed.lines[0].element, (10, 40));
    window.harness.drag_at(point);
    window.harness.drop_at(point);
    window.settle();
    assert_eq!(window.harness.state().desk().pins.len(), 1);
}

/// A parameter is changed by keys; what is shown changes, and a wrong value leaves it as it was, with the message of the command line.
#[test]
fn parameters_are_changed_and_mistakes_are_told() {
    let (folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, ViewGrid(size: (16, 12)), Project, Rasterize, Shade]}}, \
         measure: [Time]) // as it was"
    ));
    let mut window = Window::open(&path);
    assert_eq!(window.shown().plan.buffer(window.shown().plan.find("vertex").unwrap()).dims, [12, 16]);
    let before = window.picture();
    let field = window.harness.get_all_by_role_and_label(egui::accesskit::Role::SpinButton, "size").next().unwrap();
    field.click();
    window.harness.step();
    window.harness.event(egui::Event::Text("32".into()));
    window.harness.step();
    window.harness.key_press(egui::Key::Enter);
    window.settle();
    assert_eq!(window.shown().plan.buffer(window.shown().plan.find("vertex").unwrap()).dims, [12, 32]);
    assert!(window.picture() != before);
    // what the range of a widget would not let through
    let bad = Action::Set { side: Side::A, path: "a.ViewGrid.size".into(), value: "(1, 12)".into() };
    window.act(bad);
    let told = window.harness.state().refused(Side::A).unwrap().to_string();
    let output = common::run(folder.path(), &["plan", "made.ron", "--set", "a.ViewGrid.size=(1, 12)"]);
    assert_eq!(told, common::errors(&output));
    assert_eq!(window.shown().plan.buffer(window.shown().plan.find("vertex").unwrap()).dims, [12, 32]);
    window.act(Action::Reset { side: Side::A, path: Some("a.ViewGrid.size".into()) });
    assert!(window.harness.state().refused(Side::A).is_none());
    // saved, it is an experiment that runs, with what stood around the value
    window.act(Action::Set { side: Side::A, path: "a.ViewGrid.size".into(), value: "(8, 9)".into() });
    window.act(Action::SaveAs(folder.path().join("saved.ron")));
    let saved = std::fs::read_to_string(folder.path().join("saved.ron")).unwrap();
    assert!(saved.contains("ViewGrid(size: (8, 9))") && saved.ends_with("// as it was"), "{saved}");
    common::succeeded(&common::run(folder.path(), &["plan", "saved.ron"]));
}

/// What is uploaded goes on from one plan to the next, and never from one terrain to another.
#[test]
fn another_terrain_has_other_heights() {
    let chain = "{\"a\": [HeightPyramid, ViewGrid(size: (16, 12)), Project, Rasterize, Shade]}";
    let (_folder, path) = experiment(&format!("Experiment(scene: ({SCENE}), chains: {chain}, measure: [Time])"));
    let mut window = Window::open(&path);
    window.see(Of::Buffer("height".into()));
    let heights = |window: &Window| {
        let shown = window.shown();
        shown.held("height").unwrap().read_all(&window.harness.state().desk().gpu).unwrap()
    };
    let before = heights(&window);
    window.act(Action::Set { side: Side::A, path: "a.ViewGrid.size".into(), value: "(17, 12)".into() });
    assert!(heights(&window) == before);
    let seed = "scene.terrain.seed";
    window.act(Action::Set { side: Side::A, path: seed.into(), value: "77".into() });
    assert!(window.harness.state().refused(Side::A).is_none(), "{:?}", window.harness.state().refused(Side::A));
    let other = heights(&window);
    assert!(other != before && other.len() == before.len());
    window.act(Action::Reset { side: Side::A, path: Some(seed.into()) });
    assert!(heights(&window) == before);
}

/// A kernel that is broken while it is looked at leaves the last picture and says where; mended, it runs again.
#[test]
fn a_kernel_is_broken_and_mended() {
    let (folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, RayCast, \
         Kernel(file: \"counting.wgsl\", bind: {{\"counted\": New(name: \"counted\", of: I32, like: \"distance\")}}, over: \"counted\")]}}, \
         measure: [Time])"
    ));
    let file = folder.path().join("counting.wgsl");
    std::fs::write(&file, COUNTING).unwrap();
    let mut window = Window::open(&path);
    let view = window.see(Of::Buffer("counted".into()));
    let of_view = |window: &mut Window| {
        let probed = window.probe(view, Where::Element(7, 2));
        probed.lines.iter().find(|line| line.view == view).unwrap().numbers[0].1.clone()
    };
    assert_eq!(of_view(&mut window), "11");
    let write = |window: &mut Window, text: &str| {
        std::fs::write(&file, text).unwrap();
        // file systems count time coarsely
        let later = std::time::SystemTime::now() + Duration::from_secs(rand_second());
        std::fs::File::options().write(true).open(&file).unwrap().set_modified(later).unwrap();
        for _ in 0..60 {
            window.harness.step();
        }
        window.settle();
    };
    write(&mut window, &COUNTING.replace("* 3", "* three"));
    let told = window.harness.state().refused(Side::A).unwrap().clone();
    assert_eq!(told.labels[0].0.text(), "three", "{told}");
    assert_eq!(of_view(&mut window), "11");
    write(&mut window, &COUNTING.replace("* 3", "* 4"));
    assert!(window.harness.state().refused(Side::A).is_none());
    assert_eq!(of_view(&mut window), "18");
}

/// Another number each time.
fn rand_second() -> u64 {
    use std::sync::atomic::{AtomicU64, Ordering};
    static NEXT: AtomicU64 = AtomicU64::new(10);
    NEXT.fetch_add(10, Ordering::Relaxed)
}

/// Every stage beside its reference, and a stage whose f64 result goes on.
#[test]
fn kernels_beside_their_references() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, ViewGrid(size: (16, 12)), AspectImportance(size: (8, 8)), Warp, \
         Project, Rasterize, Shade]}}, measure: [Time])"
    ));
    let mut window = Window::open(&path);
    window.act(Action::InF64(true));
    let shown = window.shown();
    for name in ["height_mean", "importance", "grid_point", "vertex", "distance"] {
        let found = &shown.in_f64[name];
        assert!(found.difference.compared > 50 && found.difference.beyond == 0, "{name}: {:?}", found.difference);
    }
    let view = window.see(Of::Buffer("vertex".into()));
    for view in window.harness.state_mut().views_mut().into_iter().filter(|own| own.id == view) {
        view.against = Against::F64;
        view.form = Some(Form::Image);
    }
    window.settle();
    assert!(window.harness.query_by_label_contains("beyond their bounds").is_some());
    let before = window.probe(view, Where::Element(5, 5));
    window.act(Action::OnCpu { stage: "Warp".into(), on: true });
    let after = window.probe(view, Where::Element(5, 5));
    let number = |probed: &Probed| -> f64 {
        probed.lines.iter().find(|line| line.view == view).unwrap().numbers[0].1.parse().unwrap()
    };
    assert!((number(&before) - number(&after)).abs() < 0.05, "{} {}", number(&before), number(&after));
}

/// With history, a frame in the middle of the path is what a run makes of it, whichever way somebody gets there.
#[test]
fn frames_of_a_chain_that_remembers() {
    let file = Path::new(common::ROOT).join("experiments/change.ron");
    let mut window = Window::open(&file);
    let view = window.see(Of::Buffer("change".into()));
    let values = |window: &mut Window| {
        [(10, 100), (200, 200), (300, 230)].map(|(column, row)| {
            let probed = window.probe(view, Where::Element(column, row));
            probed.lines.into_iter().find(|line| line.view == view).unwrap().numbers[0].1.clone()
        })
    };
    window.act(Action::Move(Moment::Frame(2)));
    let forward = values(&mut window);
    window.act(Action::Move(Moment::Frame(4)));
    // back: from the first frame on again
    window.act(Action::Move(Moment::Frame(2)));
    assert_eq!(values(&mut window), forward);
    assert!(forward.iter().any(|value| value != "0" && value != "missing"), "{forward:?}");
}

/// A camera that is flown sees what a path's camera at that place sees.
#[test]
fn a_flight_by_hand() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, ViewGrid(size: (32, 24)), Project, Rasterize, Shade]}}, \
         measure: [ScreenError, Time])"
    ));
    let mut window = Window::open(&path);
    let view = window.see(Of::Buffer("colour".into()));
    let planned = window.probe(view, Where::Element(30, 30)).text();
    let camera = window.shown().camera;
    window.act(Action::Move(Moment::Live(camera)));
    assert_eq!(window.probe(view, Where::Element(30, 30)).text(), planned);
    let higher = lodlab::camera::Camera { eye_m: camera.eye_m + glam::DVec3::Z * 100.0, ..camera };
    window.act(Action::Move(Moment::Live(higher)));
    assert_ne!(window.probe(view, Where::Element(30, 30)).text(), planned);
    // the error of that very view
    window.act(Action::Truth(true));
    let truth = window.shown().truth.clone().unwrap();
    let mean = truth.figures.iter().find(|figure| figure.name == "error_mean").unwrap().value.unwrap();
    assert!(mean > 0.0 && mean < 10.0, "{mean}");
}

/// A folder of results: a click on a point chooses its cell, which can then be shown.
#[test]
fn results_are_opened_and_a_point_is_clicked() {
    // far apart in time: a slow and bad one would be under the plot's legend
    let (folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, ViewGrid, Project, Rasterize, Shade]}}, \
         sweep: {{\"a.ViewGrid.size\": [(8, 6), (64, 48), (256, 192)]}}, measure: [ScreenError, Image, Time])"
    ));
    common::succeeded(&common::run(folder.path(), &["run", "made.ron", "--out", "made"]));
    let mut window = Window::open(&path);
    window.harness.get_by_label("results").click();
    window.settle();
    window.act(Action::OpenResults(folder.path().join("made")));
    let points: Vec<(String, egui::Pos2)> =
        window.harness.state().results().points().iter().map(|(record, at)| (record.label(), *at)).collect();
    assert_eq!(points.len(), 3);
    for (label, at) in points {
        window.harness.hover_at(at);
        window.settle();
        window.harness.drag_at(at);
        window.harness.step();
        window.harness.drop_at(at);
        window.settle();
        assert_eq!(window.harness.state().results().chosen().unwrap().label(), label);
    }
    window.act(Action::Choose {
        side: Side::A,
        cell: CellName { chain: "a".into(), settings: vec![varied("a.ViewGrid.size", "(64,48)")] },
    });
    assert_eq!(window.shown().plan.buffer(window.shown().plan.find("vertex").unwrap()).dims, [48, 64]);
    window.act(Action::OpenResults(folder.path().join("nothing")));
    assert!(window.harness.query_by_label_contains("is no folder of results").is_some());
}

/// Two cells side by side, their difference, and what the picture of the window is: it is drawn, and not empty.
#[test]
fn two_cells_are_compared() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, ViewGrid(size: (16, 12)), Project, Rasterize, Shade], \
         \"b\": [HeightPyramid, RayCast, Shade]}}, measure: [Time])"
    ));
    let mut window = Window::open(&path);
    window.harness.get_by_label("compare two cells").click();
    window.settle();
    window.act(Action::Choose { side: Side::B, cell: CellName { chain: "b".into(), settings: Vec::new() } });
    let view = window.see(Of::Buffer("distance".into()));
    for view in window.harness.state_mut().views_mut().into_iter().filter(|own| own.id == view) {
        view.against = Against::Other;
    }
    window.settle();
    let app = window.harness.state();
    let dims = |side: Side| app.desk().shown(side).unwrap().held("distance").unwrap().about.dims.clone();
    assert_eq!(dims(Side::A), dims(Side::B));
    assert!(window.harness.query_all_by_label_contains("mean").next().is_some());
    let pixels = window.picture();
    assert!(pixels.chunks_exact(4).any(|pixel| pixel != &pixels[..4]));
}

/// A picture stands in the window pixel by pixel, and beside a wipe's line is that of the ground truth.
#[test]
fn a_picture_in_the_window_is_the_buffer() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, ViewGrid(size: (6, 5)), Project, Rasterize, Shade]}}, \
         measure: [Time])"
    ));
    let mut window = Window::open(&path);
    window.act(Action::Truth(true));
    let id = window.see(Of::Buffer("colour".into()));
    for mode in [Mode::Second, Mode::Wipe, Mode::Beside] {
        for view in window.harness.state_mut().views_mut().into_iter().filter(|own| own.id == id) {
            (view.against, view.mode, view.wipe) = (Against::Truth, mode, 0.5);
        }
        window.settle();
        let pixels = window.picture();
        let shown = window.shown();
        let gpu = window.harness.state().desk().gpu.clone();
        let own = shown.held("colour").unwrap().read_all(&gpu).unwrap();
        let truth = shown.truth.as_ref().unwrap().picture.read_all(&gpu).unwrap();
        assert_ne!(own, truth);
        let app = window.harness.state_mut();
        let view = app.views_mut().into_iter().find(|own| own.id == id).unwrap();
        for (x, y) in (0..64).flat_map(|x| (0..48).map(move |y| (x, y))) {
            let point = view.point_of((x, y)).unwrap();
            let seen = &pixels[4 * (point.y as usize * 1400 + point.x as usize)..][..3];
            // the line itself is over the middle
            let of = match mode {
                Mode::Beside => &own,
                Mode::Wipe if x < 31 => &own,
                Mode::Wipe if x < 33 => continue,
                _ => &truth,
            };
            assert_eq!(seen, &of[4 * (y * 64 + x) as usize..][..3], "{mode:?}, {x} {y}");
        }
    }
}

/// A terrain that cannot be loaded, an experiment that is none, a size that comes and goes: each is told, and the window lives.
#[test]
fn mistakes_leave_the_window_alive() {
    let (folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, RayCast, Shade]}}, measure: [Time])"
    ));
    let mut window = Window::open(&path);
    window.act(Action::Set { side: Side::A, path: "scene.terrain".into(), value: "Dem(file: \"gone.png\")".into() });
    assert!(window.harness.state().refused(Side::A).unwrap().message.contains("gone.png"));
    window.act(Action::Reset { side: Side::A, path: None });
    assert!(window.harness.state().refused(Side::A).is_none());
    window.act(Action::Open(folder.path().join("nothing.ron")));
    assert!(window.harness.state().said().unwrap().is_err());
    for size in [(40.0, 30.0), (1.0, 1.0), (2000.0, 200.0), (1400.0, 900.0)] {
        window.harness.set_size(size.into());
        window.settle();
    }
    assert!(window.harness.state().desk().gpu.check().is_ok());
}

/// Everything that ships opens.
#[test]
fn every_experiment_that_ships_is_shown() {
    let mut window: Option<Window> = None;
    let folder = Path::new(common::ROOT).join("experiments");
    let has_shared = common::shared_dem().is_dir();
    for shipped in lodlab::inspector::shipped(&folder) {
        assert!(!shipped.about.is_empty(), "{} does not say what there is to see", shipped.path.display());
        let text = std::fs::read_to_string(&shipped.path).unwrap();
        if text.contains("shared/dem") && !has_shared {
            continue;
        }
        match &mut window {
            None => window = Some(Window::open(&shipped.path)),
            Some(window) => window.act(Action::Open(shipped.path.clone())),
        }
        let window = window.as_ref().unwrap();
        assert!(window.harness.state().refused(Side::A).is_none(), "{}", shipped.path.display());
        assert!(window.harness.state().desk().shown(Side::A).is_some(), "{}", shipped.path.display());
    }
}

/// What takes long says how far it is, and ends when it is told to; what was shown stays.
#[test]
fn long_work_is_cancelled() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({}), chains: {{\"a\": [HeightPyramid, Roughness, VertexSplitting(start: LastFrame), TriangleSplitting, Rasterize]}}, \
         measure: [Time])",
        SCENE.replace("frames: 3", "frames: 50000")
    ));
    let mut window = Window::open(&path);
    let before = window.shown().number;
    window.harness.state_mut().act(Action::Move(Moment::Frame(49_999)));
    let start = Instant::now();
    while window.harness.query_by_label("cancel").is_none() {
        window.harness.step();
        assert!(start.elapsed() < Duration::from_secs(60), "nothing says that it works");
    }
    window.harness.get_by_label("cancel").click();
    window.settle();
    assert_eq!(window.harness.state().refused(Side::A).unwrap().message, "cancelled");
    assert_eq!(window.shown().number, before);
    window.act(Action::Move(Moment::Frame(1)));
    assert!(window.harness.state().refused(Side::A).is_none());
}

/// A device that is gone is told, and the window is still there.
#[test]
fn a_lost_device() {
    let (_folder, path) = experiment(&format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, RayCast, Shade]}}, measure: [Time])"
    ));
    let mut window = Window::open(&path);
    window.harness.state().desk().gpu.device.destroy();
    window.harness.state_mut().act(Action::Set { side: Side::A, path: "scene.fov_deg".into(), value: "40".into() });
    for _ in 0..60 {
        window.harness.step();
        std::thread::sleep(Duration::from_millis(5));
    }
    let app = window.harness.state();
    let told = app.refused(Side::A).is_some() || app.said().is_some_and(Result::is_err);
    assert!(told, "nobody says that the device is gone");
    assert!(app.desk().shown(Side::A).is_some());
}
