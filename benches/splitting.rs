//! Leaves a second: geometry splitting on the GPU, alone and with crack removal, from the root and from the frame before, against a
//! plain quadtree of the same rule (Lee, Shin 2011, Eq. 2) on all cores: `cargo bench --bench splitting`.
//!
//! All of them go over the same slow flight, 5 m a frame, frame by frame beside each other; the medians of many such rows are compared.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::Instant;

use glam::{UVec2, Vec2, Vec3};
use lodlab::camera::Camera;
use lodlab::experiment::diagnostic::Diagnostic;
use lodlab::gpu::Gpu;
use lodlab::ground::pyramid::Layout;
use lodlab::run::{self, Keep, Options, Setup};
use lodlab::scene::HEIGHT;
use rayon::prelude::*;

const THRESHOLD_PX: f32 = 1.0;

fn set_up(chain: &str, wanted: &[&str]) -> Result<Setup, Diagnostic> {
    let puget = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/dem/puget_sound_cascades_2049x1025.png");
    let terrain = match puget.is_file() {
        true => format!("Dem(file: {puget:?}, cell_m: 90, height_scale_m: 0.125)"),
        false => {
            "Noise(kind: Fbm, seed: 1, size: (2049, 1025), cell_m: 90, height_m: (0, 2800), wavelength_m: 60000)".into()
        }
    };
    let camera = "Flight(frames: 12, clearance_m: 200, keys: [(eye: (90000, 42000, 2500), look_at: (150000, 50000, 1200)), \
                  (eye: (90060, 42010, 2500), look_at: (150060, 50000, 1200))])";
    let scene = format!("terrain: {terrain}, camera: {camera}, viewport: (1024, 768)");
    let chain = format!("[HeightPyramid, Roughness, {chain}]");
    let mut setup = Setup::chain(&scene, &chain, "".as_ref(), Keep::Last)?;
    let dump = wanted.iter().map(|name| name.to_string()).collect();
    setup.plan = Arc::new(run::plan(&setup.prepared, &Options { dump, ..Default::default() })?);
    Ok(setup)
}

/// Blocks and what is known of them, on the CPU.
struct Quadtree {
    layout: Layout,
    size: UVec2,
    cell_m: Vec2,
    heights_m: Vec<f32>,
    low_m: Vec<f32>,
    high_m: Vec<f32>,
    roughness_m: Vec<f32>,
    split: Vec<AtomicU32>,
}

/// A camera with the eye's place, for one frame.
struct View {
    eye_m: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    sides: [Vec3; 4],
    focal_px: f32,
}

impl View {
    fn new(camera: &Camera) -> Self {
        let [right, up, forward] = [camera.world_from_view.x_axis, camera.world_from_view.y_axis, camera.forward()];
        let (across, tall) = (forward * camera.half_tan.x, forward * camera.half_tan.y);
        let sides = [right + across, across - right, tall - up, up + tall].map(|side| side.as_vec3());
        Self {
            eye_m: camera.eye_m.as_vec3(),
            right: right.as_vec3(),
            up: up.as_vec3(),
            forward: forward.as_vec3(),
            sides,
            focal_px: camera.focal_px() as f32,
        }
    }

    fn error_px(&self, point: Vec3, rise_m: f32) -> f32 {
        let p = Vec3::new(self.right.dot(point), self.up.dot(point), self.forward.dot(point));
        let up = Vec3::new(self.right.z, self.up.z, self.forward.z);
        let moved = (p.truncate() * up.z - up.truncate() * p.z).length() * rise_m;
        self.focal_px * moved / (p.z * (p.z + rise_m * up.z)).abs()
    }
}

impl Quadtree {
    fn point(&self, view: &View, sample: UVec2) -> Vec3 {
        let height = self.heights_m[(sample.y * self.size.x + sample.x) as usize];
        let ground = Vec2::new(sample.x as f32, (self.size.y - 1 - sample.y) as f32) * self.cell_m;
        ground.extend(height) - view.eye_m
    }

    fn corners(&self, level: u32, at: UVec2) -> (UVec2, UVec2, UVec2) {
        let last = self.size - 1;
        let low = at << level;
        (low, (low + (1 << level) / 2).min(last), (low + (1 << level)).min(last))
    }

    /// None for a block outside the picture.
    fn is_split(&self, view: &View, level: u32, at: UVec2) -> Option<bool> {
        let index = self.layout.index(level, at.x, at.y);
        let (nw, mid, se) = self.corners(level, at);
        let (a, b) = (self.point(view, nw), self.point(view, se));
        let low = Vec3::new(a.x, b.y, self.low_m[index] - view.eye_m.z);
        let high = Vec3::new(b.x, a.y, self.high_m[index] - view.eye_m.z);
        let is_visible = |normal: Vec3| (normal * low).max(normal * high).element_sum() >= 0.0;
        if !view.sides.into_iter().chain([view.forward]).all(is_visible) {
            return None;
        }
        let rise_m = self.roughness_m[index];
        let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0);
        if rise_m == 0.0 || centre.length_squared() < half.length_squared() {
            return Some(rise_m != 0.0);
        }
        let points =
            [mid, UVec2::new(mid.x, nw.y), UVec2::new(mid.x, se.y), UVec2::new(nw.x, mid.y), UVec2::new(se.x, mid.y)];
        let most = points.map(|sample| view.error_px(self.point(view, sample), rise_m)).into_iter().fold(0.0, f32::max);
        Some(most >= THRESHOLD_PX)
    }

    fn descend(&self, view: &View, level: u32, at: UVec2) -> Vec<(u32, UVec2)> {
        let mut leaves = Vec::new();
        if level + 6 <= self.layout.top || level <= 1 {
            self.collect(view, level, at, &mut leaves);
            return leaves;
        }
        match self.is_split(view, level, at) {
            None => leaves,
            Some(false) => vec![(level, at)],
            Some(true) => {
                self.mark(level, at);
                let children: Vec<UVec2> = self.children(level, at).collect();
                children.par_iter().flat_map_iter(|&child| self.descend(view, level - 1, child)).collect()
            }
        }
    }

    fn collect(&self, view: &View, level: u32, at: UVec2, leaves: &mut Vec<(u32, UVec2)>) {
        match self.is_split(view, level, at) {
            None => {}
            Some(false) => leaves.push((level, at)),
            Some(true) => {
                self.mark(level, at);
                for child in self.children(level, at) {
                    if level == 1 { leaves.push((0, child)) } else { self.collect(view, level - 1, child, leaves) }
                }
            }
        }
    }

    fn children(&self, level: u32, at: UVec2) -> impl Iterator<Item = UVec2> {
        let below = if level == 1 { self.size - 1 } else { self.layout.size(level - 1) };
        let all = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| at * 2 + UVec2::new(x, y));
        all.into_iter().filter(move |child| child.cmplt(below).all())
    }

    fn mark(&self, level: u32, at: UVec2) {
        let index = self.layout.index(level, at.x, at.y);
        self.split[index / 32].fetch_or(1 << (index % 32), Relaxed);
    }

    fn is_marked(&self, level: u32, at: UVec2) -> bool {
        let index = self.layout.index(level, at.x, at.y);
        self.split[index / 32].load(Relaxed) >> (index % 32) & 1 != 0
    }

    /// Triangles without cracks, as `TriangleSplitting` makes them.
    fn triangles(&self, leaves: &[(u32, UVec2)]) -> Vec<[UVec2; 3]> {
        leaves.par_iter().with_min_len(256).flat_map_iter(|&(level, at)| self.fan(level, at)).collect()
    }

    fn fan(&self, level: u32, at: UVec2) -> Vec<[UVec2; 3]> {
        let (low, mid, high) = self.corners(level, at);
        let (ne, sw) = (UVec2::new(high.x, low.y), UVec2::new(low.x, high.y));
        if level == 0 {
            return vec![[low, sw, ne], [high, ne, sw]];
        }
        let mut triangles = Vec::new();
        let side = 1 << level;
        let start = at << level;
        let edges = [
            (start, UVec2::X, glam::IVec2::new(0, -1), true),
            (start, UVec2::Y, glam::IVec2::new(-1, 0), false),
            (start + UVec2::Y * side, UVec2::X, glam::IVec2::ZERO, false),
            (start + UVec2::X * side, UVec2::Y, glam::IVec2::ZERO, true),
        ];
        for (start, step, beyond, is_turned) in edges {
            let mut from = 0;
            while from < side {
                let mut part = level.min(from.trailing_zeros());
                let is_split = |part: u32| {
                    let node = ((start + step * from) >> part).as_ivec2() + beyond;
                    node.min_element() >= 0
                        && node.as_uvec2().cmplt(self.layout.size(part)).all()
                        && self.is_marked(part, node.as_uvec2())
                };
                while part > 0 && is_split(part) {
                    part -= 1;
                }
                let to = from + (1 << part);
                let last = self.size - 1;
                let (mut a, mut b) = ((start + step * from).min(last), (start + step * to).min(last));
                if is_turned {
                    (a, b) = (b, a);
                }
                let is_flat = (b.as_ivec2() - a.as_ivec2()).perp_dot(mid.as_ivec2() - a.as_ivec2()) == 0;
                if !is_flat {
                    triangles.push([a, b, mid]);
                }
                from = to;
            }
        }
        triangles
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn compare() -> Result<(), Diagnostic> {
    let gpu = Gpu::open(None)?;
    println!("{} {}, {} threads on the CPU", gpu.summary.name, gpu.summary.driver, rayon::current_num_threads());
    let chains = [
        ("splitting from the root", "VertexSplitting"),
        ("splitting from the frame before", "VertexSplitting(start: LastFrame)"),
        ("from the root, without cracks", "VertexSplitting, TriangleSplitting"),
        ("from the frame before, without cracks", "VertexSplitting(start: LastFrame), TriangleSplitting"),
    ];
    let wanted = ["leaf", "leaf_count", "roughness", "height_min", "height_max"];
    let setups = chains.iter().map(|(_, chain)| set_up(chain, &wanted)).collect::<Result<Vec<_>, _>>()?;
    let mut executors = setups.iter().map(|setup| setup.executor(&gpu)).collect::<Result<Vec<_>, _>>()?;
    let Setup { prepared, plan } = &setups[0];
    let floats = |name: &str| -> Result<Vec<f32>, Diagnostic> {
        Ok(bytemuck::pod_collect_to_vec(&executors[0].read(plan.find(name)?)?))
    };
    let terrain = prepared.data.ground.lattice();
    let roughness_m = floats("roughness")?;
    let quadtree = Quadtree {
        layout: terrain.cells(),
        size: terrain.size,
        cell_m: terrain.cell_m.as_vec2(),
        heights_m: prepared.data.input(HEIGHT).map_or(Vec::new(), |input| bytemuck::pod_collect_to_vec(input.bytes())),
        low_m: floats("height_min")?,
        high_m: floats("height_max")?,
        split: roughness_m.chunks(32).map(|_| AtomicU32::new(0)).collect(),
        roughness_m,
    };
    // milliseconds of the four chains, and of the CPU alone and without cracks
    let mut rows: Vec<[f64; 6]> = Vec::new();
    let mut leaves = [0.0, 0.0];
    for round in 0..6 {
        for (frame, camera) in prepared.data.cameras().iter().enumerate() {
            let mut row = [0.0; 6];
            for (at, executor) in executors.iter_mut().enumerate() {
                row[at] = executor.frame(frame)?.wall_ms;
            }
            let view = View::new(camera);
            let start = Instant::now();
            quadtree.split.par_iter().for_each(|word| word.store(0, Relaxed));
            let found = quadtree.descend(&view, quadtree.layout.top, UVec2::ZERO);
            row[4] = start.elapsed().as_secs_f64() * 1e3;
            let triangles = quadtree.triangles(&found);
            row[5] = start.elapsed().as_secs_f64() * 1e3;
            assert!(triangles.len() > found.len());
            let counted: Vec<u32> = bytemuck::pod_collect_to_vec(&executors[0].read(plan.find("leaf_count")?)?);
            leaves = [f64::from(counted[3]), found.len() as f64];
            if round > 0 {
                rows.push(row);
            }
        }
    }
    println!("{} leaves on the GPU, {} on the CPU (f32 rounds a few decisions differently)", leaves[0], leaves[1]);
    let names =
        chains.map(|(name, _)| name).into_iter().chain(["quadtree on the CPU", "quadtree on the CPU, without cracks"]);
    for (at, name) in names.enumerate() {
        let ms = median(rows.iter().map(|row| row[at]).collect());
        let (of_root, of_cpu) = if matches!(at, 2 | 3 | 5) { (2, 5) } else { (0, 4) };
        let ratio = |to: usize| median(rows.iter().map(|row| row[to] / row[at]).collect());
        println!(
            "{name:<38} {ms:7.2} ms, {:6.2} M leaves/s, {:5.2} of the root's rate, {:5.2} of the CPU's",
            leaves[0] / ms / 1e3,
            ratio(of_root),
            ratio(of_cpu)
        );
    }
    Ok(())
}

fn main() {
    if let Err(error) = compare() {
        println!("{error}");
    }
}
