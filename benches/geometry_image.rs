//! Importance, warp and zoom of a geometry image on the GPU, beside the same on one processor core and on all of them, as Dachsbacher and
//! Stamminger had it: `cargo bench --bench geometry_image`.
//!
//! The processor's version is plain f32, row by row as in their Fig. 5; what it makes is compared with what the GPU made. Importance is by
//! distance, which folds nothing, so that both come to the same. The GPU's time is that of a frame: its copy of the sketch map, its uniform grid and
//! its look for folds are in it, which the processor is spared. It is by stamps where the adapter has them, and else by the clock.

use std::path::Path;
use std::time::Instant;

use glam::{Vec2, Vec3};
use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::gpu::{Executor, Gpu};
use lodlab::plan::{BufferId, Often};
use lodlab::run::{Keep, Setup};
use rayon::prelude::*;

const SCENE: &str = "terrain: Noise(kind: Ridged, seed: 4, size: (2049, 2049), cell_m: 30, height_m: (0, 1500)), \
     camera: Still(eye: (30000, 20000, 2600), look_at: (31000, 40000, 300), clearance_m: 200), viewport: (1024, 768)";
const QUAD_PX: f32 = 4.0;
const ROUNDS: usize = 15;

/// What the processor starts from.
struct Sketch {
    texels: usize,
    heights_m: Vec<f32>,
    /// Of the north-west texel's middle from the eye, and between texels; y runs south.
    first_m: Vec2,
    step_m: Vec2,
    eye_height_m: f32,
    focal_px: f32,
}

impl Sketch {
    fn of(setup: &Setup, executor: &Executor) -> Result<Self, Diagnostic> {
        let square: Vec<i32> = bytemuck::pod_collect_to_vec(&executor.read(id(setup, "sketch_square"))?);
        let heights_m = bytemuck::pod_collect_to_vec(&executor.read(id(setup, "sketch_height"))?);
        let (lattice, camera) = (setup.prepared.data.ground.lattice(), setup.prepared.data.cameras()[0]);
        let samples = f64::from(1u32 << square[3]);
        let first = glam::DVec2::new(square[0].into(), square[1].into()) + 0.5 * (samples - 1.0);
        let first_m = lattice.world_from_sample(first) - camera.eye_m.truncate();
        Ok(Self {
            texels: (square[2] >> square[3]) as usize,
            heights_m,
            first_m: first_m.as_vec2(),
            step_m: (samples * lattice.cell_m).as_vec2() * Vec2::new(1.0, -1.0),
            eye_height_m: camera.eye_m.z as f32,
            focal_px: camera.focal_px() as f32,
        })
    }

    fn importance(&self, at: usize) -> f32 {
        let texel = Vec2::new((at % self.texels) as f32, (at / self.texels) as f32);
        let place_m = (self.first_m + texel * self.step_m).extend(self.heights_m[at] - self.eye_height_m);
        let near_m = 0.25 * (self.step_m.x.abs() + self.step_m.y.abs());
        self.focal_px / (QUAD_PX * Vec3::length(place_m).max(near_m))
    }

    /// The places of a square grid of so many points, from importance, rows and columns; by `threads` or not.
    fn points(&self, points: usize, in_parallel: bool) -> Vec<Vec2> {
        let n = self.texels;
        let importance = make(n * n, in_parallel, |at| self.importance(at));
        let rows = lines(n, in_parallel, |row, weights| weights.copy_from_slice(&importance[row * n..(row + 1) * n]));
        let columns = lines(n, in_parallel, |column, weights| {
            for (row, weight) in weights.iter_mut().enumerate() {
                let first = row * (n + 1) + column;
                let middle = 0.5 * (rows[first] + rows[first + 1]);
                *weight = sampled(&importance[row * n..(row + 1) * n], middle * n as f32 - 0.5);
            }
        });
        let corner = |at: usize| {
            let (x, y) = (at % (n + 1), at / (n + 1));
            let down = 0.5 * (columns[(x.max(1) - 1) * (n + 1) + y] + columns[x.min(n - 1) * (n + 1) + y]);
            let place = (down * n as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let (north, share) = (place as usize, place.fract());
            let south = (north + 1).min(n - 1);
            let (a, b) = (rows[north * (n + 1) + x], rows[south * (n + 1) + x]);
            Vec2::new(a + (b - a) * share, down)
        };
        let map = make((n + 1) * (n + 1), in_parallel, corner);
        let zoomed = |at: usize| {
            let place = Vec2::new((at % points) as f32, (at / points) as f32) / (points - 1) as f32 * n as f32;
            let low = place.floor().min(Vec2::splat((n - 1) as f32));
            let share = place - low;
            let first = low.y as usize * (n + 1) + low.x as usize;
            let north = map[first].lerp(map[first + 1], share.x);
            north.lerp(map[first + n + 1].lerp(map[first + n + 2], share.x), share.y)
        };
        make(points * points, in_parallel, zoomed)
    }
}

/// Linear between the middles of cells.
fn sampled(line: &[f32], at: f32) -> f32 {
    let at = at.clamp(0.0, (line.len() - 1) as f32);
    let (a, b) = (line[at as usize], line[(at as usize + 1).min(line.len() - 1)]);
    a + (b - a) * at.fract()
}

fn make<T: Send>(count: usize, in_parallel: bool, of: impl Fn(usize) -> T + Sync) -> Vec<T> {
    match in_parallel {
        true => (0..count).into_par_iter().with_min_len(1024).map(&of).collect(),
        false => (0..count).map(of).collect(),
    }
}

/// Where the borders of each of `n` lines of `n` weights go.
fn lines(n: usize, in_parallel: bool, weigh: impl Fn(usize, &mut [f32]) + Sync) -> Vec<f32> {
    let mut places = vec![0.0; n * (n + 1)];
    let line = |(line, places): (usize, &mut [f32])| {
        let mut weights = vec![0.0; n];
        weigh(line, &mut weights);
        let total: f32 = weights.iter().sum();
        let (mut k, mut before) = (0, 0.0);
        for (i, place) in places.iter_mut().enumerate() {
            let wanted = total * i as f32 / n as f32;
            while k + 1 < n && before + weights[k] < wanted {
                before += weights[k];
                k += 1;
            }
            *place = ((k as f32 + (wanted - before) / weights[k]) / n as f32).clamp(0.0, 1.0);
        }
    };
    match in_parallel {
        true => places.par_chunks_mut(n + 1).enumerate().for_each(line),
        false => places.chunks_mut(n + 1).enumerate().for_each(line),
    }
    places
}

fn id(setup: &Setup, name: &str) -> BufferId {
    let named = setup.plan.outputs.iter().rfind(|id| setup.plan.buffer(**id).name == name);
    *named.unwrap_or_else(|| panic!("`{name}` is made"))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn compare() -> Result<(), Diagnostic> {
    let gpu = Gpu::open(None)?;
    println!("{} {}; {} processor threads", gpu.summary.name, gpu.summary.driver, rayon::current_num_threads());
    println!("texels points  one core ms  all cores ms  GPU ms  one core/GPU  all cores/GPU  GPU MB  farthest apart");
    for texels in [32, 64, 128, 256, 512, 1024] {
        let points = 4 * texels;
        let chain = format!(
            "[HeightPyramid, SketchMap(texels: {texels}, far_m: 15000), SketchImportance(frustum: false, facing: false, floor: 0, quad_px: {QUAD_PX}), \
             ViewGrid(size: ({points}, {points})), Warp(lead: 0)]"
        );
        let setup = Setup::chain(SCENE, &chain, Path::new("."), Keep::Everything)?;
        let mut executor = setup.executor(&gpu)?;
        executor.frame(0)?;
        let sketch = Sketch::of(&setup, &executor)?;
        let made: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&executor.read(id(&setup, "grid_point"))?);
        let apart =
            sketch.points(points, false).iter().zip(&made).map(|(a, b)| a.distance(Vec2::from(*b))).fold(0.0, f32::max);
        if apart > 1e-4 {
            return Err(Diagnostic::run(format!("the two are {apart} of the square apart at {texels} texels")));
        }
        let mut samples = [Vec::new(), Vec::new(), Vec::new()];
        for _ in 0..ROUNDS {
            for (way, in_parallel) in [(0, false), (1, true)] {
                let start = Instant::now();
                std::hint::black_box(sketch.points(points, in_parallel));
                samples[way].push(start.elapsed().as_secs_f64() * 1e3);
            }
            let frame = executor.timed_frame(0)?;
            samples[2].push(frame.gpu_ms.unwrap_or(frame.wall_ms));
        }
        let [one, all, on_gpu] = samples.map(median);
        let is_of_frame = |step: &&lodlab::plan::Step| step.often == Often::EveryFrame;
        let mut buffers: Vec<BufferId> =
            setup.plan.steps.iter().filter(is_of_frame).flat_map(|step| step.writes.clone()).collect();
        buffers.sort_unstable();
        buffers.dedup();
        let bytes: u64 = buffers.iter().map(|id| setup.plan.buffer(*id).bytes()).sum();
        println!(
            "{texels:6} {points:6} {one:12.2} {all:13.2} {on_gpu:7.3} {:13.2} {:14.2} {:7.2} {apart:14.1e}",
            one / on_gpu,
            all / on_gpu,
            bytes as f64 / 1e6
        );
    }
    Ok(())
}

fn main() {
    if let Err(error) = compare() {
        println!("{error}");
        std::process::exit(1);
    }
}
