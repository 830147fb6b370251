//! Ground truth beside Embree: same height field, same views, same cores, one run.
//!
//! Needs `../shared` (elevation data and the peer's source), g++ and Debian's libembree-dev; without them it says
//! what is missing and ends. `cargo bench --bench peer`; `-- --adapter NAME` chooses the adapter.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::gpu::submit::SubmissionTime;
use lodlab::gpu::{Executor, Gpu};
use lodlab::plan::Plan;
use lodlab::run::{Keep, Setup};
use lodlab::scene::{HEIGHT, SceneData};

struct View {
    name: &'static str,
    dem: &'static str,
    eye: [f64; 3],
    target: [f64; 3],
}

const VIEWS: [View; 7] = [
    View {
        name: "puget: lowland to Cascades",
        dem: "puget_sound_cascades_2049x1025",
        eye: [60e3, 20e3, 4000.0],
        target: [120e3, 50e3, 500.0],
    },
    View {
        name: "puget: among peaks",
        dem: "puget_sound_cascades_2049x1025",
        eye: [150e3, 40e3, 2400.0],
        target: [160e3, 50e3, 1500.0],
    },
    View {
        name: "puget: from under the surface",
        dem: "puget_sound_cascades_2049x1025",
        eye: [150e3, 40e3, 900.0],
        target: [160e3, 50e3, 1500.0],
    },
    View {
        name: "puget: steep down",
        dem: "puget_sound_cascades_2049x1025",
        eye: [140e3, 45e3, 15000.0],
        target: [146e3, 52e3, 0.0],
    },
    View {
        name: "moon: over the massifs",
        dem: "moon_apennines_4096",
        eye: [60e3, 120e3, 9000.0],
        target: [160e3, 240e3, -1000.0],
    },
    View {
        name: "moon: mare, low",
        dem: "moon_apennines_4096",
        eye: [100e3, 300e3, 500.0],
        target: [200e3, 350e3, -1500.0],
    },
    View { name: "moon: whole", dem: "moon_apennines_4096", eye: [225e3, -120e3, 250e3], target: [225e3, 230e3, 0.0] },
];

const SIZE: (u32, u32) = (1024, 768);
const FOV_DEG: f64 = 60.0;

struct Peer {
    build_ms: f64,
    single_ms: f64,
    packet_ms: f64,
    distance_m: Vec<f32>,
}

fn main() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let missing = ["dem", "peers/embree_heightfield.cpp"].into_iter().find(|name| !shared.join(name).exists());
    if let Some(name) = missing {
        println!("skipped: no shared data ({name})");
        return;
    }
    let folder = match tempfile::tempdir() {
        Ok(folder) => folder,
        Err(error) => return println!("skipped: no place for temporary files ({error})"),
    };
    let Some(peer) = build_peer(&shared.join("peers/embree_heightfield.cpp"), folder.path()) else {
        println!("skipped: the peer does not build; it needs g++ and libembree-dev");
        return;
    };
    let adapter = std::env::args().skip_while(|argument| argument != "--adapter").nth(1);
    match compare(&peer, &shared, folder.path(), adapter.as_deref()) {
        Ok(table) => println!("{table}"),
        Err(error) => println!("{error}"),
    }
}

fn build_peer(source: &Path, folder: &Path) -> Option<PathBuf> {
    let program = folder.join("embree_heightfield");
    let mut compiler = Command::new("g++");
    compiler.args(["-O3", "-march=native"]).arg(source).arg("-o").arg(&program).args(["-lembree3", "-lpthread"]);
    compiler.status().ok()?.success().then_some(program)
}

fn compare(peer: &Path, shared: &Path, folder: &Path, adapter: Option<&str>) -> Result<String, Diagnostic> {
    let gpu = Gpu::open(adapter)?;
    println!("{} {}", gpu.summary.name, gpu.summary.driver);
    let mut table = String::from(
        "| view | Embree build ms | pyramid ms | ratio | Embree single ms | packet ms | ray cast ms | rate / single | outside kernels | hit differs | beyond 1e-5 | pinholes |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for view in &VIEWS {
        let setup = Setup::chain(&scene(view, shared), "[HeightPyramid, RayCast]", &shared.join("dem"), Keep::Last)?;
        let Setup { prepared, plan } = &setup;
        let mut executor = Executor::new(&gpu, plan, &prepared.data)?;
        let theirs = run_peer(peer, folder, view, &prepared.data);
        let build_ms = median(9, || Ok(without_uploads(&executor.setup()?, plan)))?;
        let cast_ms = median(9, || Ok(executor.frame(0)?.wall_ms))?;
        let Some(theirs) = theirs else { return Ok("skipped: the peer does not run".into()) };
        let ours: Vec<f32> = bytemuck::pod_collect_to_vec(&executor.read(plan.outputs[0])?);
        let agreement = agree(&ours, &theirs.distance_m);
        let outside = outside(&mut executor)?;
        // writing to a String cannot fail
        let _ = writeln!(
            table,
            "| {} | {:.1} | {:.2} | {:.1} | {:.1} | {:.1} | {:.1} | {:.2} | {:.1} % | {} of {} | {} | {} |",
            view.name,
            theirs.build_ms,
            build_ms,
            theirs.build_ms / build_ms,
            theirs.single_ms,
            theirs.packet_ms,
            cast_ms,
            theirs.single_ms / cast_ms,
            100.0 * outside,
            agreement.hit_differs,
            ours.len(),
            agreement.beyond,
            agreement.pinholes,
        );
    }
    Ok(table)
}

fn scene(view: &View, shared: &Path) -> String {
    let meta = std::fs::read_to_string(shared.join(format!("dem/{}.json", view.dem))).unwrap_or_default();
    let number = |name: &str| {
        let value: Option<serde_json::Value> = serde_json::from_str(&meta).ok();
        value.and_then(|value| value.get(name)?.as_f64()).unwrap_or(1.0)
    };
    let ([ex, ey, ez], [tx, ty, tz]) = (view.eye, view.target);
    format!(
        "terrain: Dem(file: \"{}.png\", cell_m: ({}, {}), height_offset_m: {}, height_scale_m: {}), \
         camera: Still(eye: ({ex}, {ey}, {ez}), look_at: ({tx}, {ty}, {tz})), viewport: {SIZE:?}, fov_deg: {FOV_DEG}",
        view.dem,
        number("cell_size_x_m"),
        number("cell_size_y_m"),
        number("height_offset_m"),
        number("height_scale_m"),
    )
}

fn run_peer(peer: &Path, folder: &Path, view: &View, data: &SceneData) -> Option<Peer> {
    let (heights, out) = (folder.join("heights.f32"), folder.join("out.f32"));
    std::fs::write(&heights, data.input(HEIGHT)?.bytes()).ok()?;
    let terrain = data.ground.lattice();
    let numbers = [f64::from(terrain.size.x), f64::from(terrain.size.y), terrain.cell_m.x, terrain.cell_m.y];
    let numbers = numbers.into_iter().chain(view.eye).chain(view.target).chain([FOV_DEG, SIZE.0.into(), SIZE.1.into()]);
    let output =
        Command::new(peer).arg(&heights).args(numbers.map(|number| number.to_string())).arg(&out).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let number = |name: &str| text.split_whitespace().skip_while(|word| *word != name).nth(1)?.parse().ok();
    let distance_m = bytemuck::pod_collect_to_vec(&std::fs::read(&out).ok()?);
    Some(Peer {
        build_ms: number("build_ms")?,
        single_ms: number("single_ms")?,
        packet_ms: number("packet8_ms")?,
        distance_m,
    })
}

/// What is left of setting up when the terrain is on the device: the peer has it in memory, too.
fn without_uploads(setup: &SubmissionTime, plan: &Plan) -> f64 {
    let uploads = setup.steps.iter().filter(|time| plan.steps[time.step].run().is_none());
    setup.wall_ms - uploads.filter_map(|time| time.ms).sum::<f64>()
}

struct Agreement {
    hit_differs: usize,
    /// Hits of both whose distances differ by more than 1e-5.
    beyond: usize,
    /// Pixels of ours without a hit whose four neighbours all have one within 1 % of each other.
    pinholes: usize,
}

fn agree(ours: &[f32], theirs: &[f32]) -> Agreement {
    let width = SIZE.0 as usize;
    let pairs = || ours.iter().zip(theirs);
    let beyond = |(ours, theirs): &(&f32, &f32)| {
        **ours >= 0.0 && !theirs.is_nan() && (*ours - *theirs).abs() > 1e-5 * theirs.abs()
    };
    let is_pinhole = |&at: &usize| {
        let around = [at - 1, at + 1, at - width, at + width].map(|at| ours[at]);
        let (low, high) = around.iter().fold((f32::MAX, f32::MIN), |(low, high), &t| (low.min(t), high.max(t)));
        low >= 0.0 && high < low * 1.01 && (ours[at] < 0.0 || ours[at] > high * 1.01)
    };
    let inner = (1..SIZE.1 as usize - 1).flat_map(|y| (1..width - 1).map(move |x| y * width + x));
    Agreement {
        hit_differs: pairs().filter(|(ours, theirs)| (**ours < 0.0) != theirs.is_nan()).count(),
        beyond: pairs().filter(beyond).count(),
        pinholes: inner.filter(is_pinhole).count(),
    }
}

/// Share of a frame outside its kernels: a frame against the same kernels, each by itself on the clock less what
/// an empty submission takes. In pairs, since a machine is not equally fast all the time.
fn outside(executor: &mut Executor) -> Result<f64, Diagnostic> {
    let pair = || {
        let frame_ms = executor.frame(0)?.wall_ms;
        let inside_ms: f64 = executor.frame_by_steps(0)?.steps.iter().filter_map(|time| time.ms).sum();
        Ok(1.0 - inside_ms / frame_ms)
    };
    Ok(median(15, pair)?.max(0.0))
}

fn median(samples: usize, mut sample: impl FnMut() -> Result<f64, Diagnostic>) -> Result<f64, Diagnostic> {
    let start = Instant::now();
    let mut values = Vec::new();
    // one to warm up; slow adapters need no more than a few
    sample()?;
    while values.len() < samples && (values.len() < 3 || start.elapsed().as_secs() < 20) {
        values.push(sample()?);
    }
    values.sort_by(f64::total_cmp);
    Ok(values[values.len() / 2])
}
