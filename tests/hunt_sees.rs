//! Former defects, each brought back by a damaged kernel: the hunt finds every one of them. A test alone in its program, since kernels are read
//! from the folder that the program stands in.

use std::path::Path;
use std::sync::Arc;

use lodlab::gpu::Gpu;
use lodlab::hunt::{self, Found, Hunt, Summary};
use lodlab::kernel::{Kernel, read_from_checkout};

/// What a kernel said before it was mended.
struct Defect {
    what: &'static str,
    file: &'static str,
    /// What stands there now, and what stood there or does the same.
    now: &'static str,
    before: &'static str,
    /// The chains that are looked at.
    stage: &'static str,
    seed: u64,
    /// The promises that it may break.
    promises: &'static [&'static str],
}

const DEFECTS: &[Defect] = &[
    Defect {
        what: "next to the eye, heights are interpolated in f32",
        file: "lib/traverse.wgsl",
        now: "if HAS_FOREGROUND {",
        before: "if false {",
        stage: "RayCast",
        seed: 1,
        promises: &["bound"],
    },
    Defect {
        what: "a ray that comes in at a corner of a cell takes one triangle's plane for the other's",
        file: "lib/traverse.wgsl",
        now: "select(along * (0.5 * (t0 + t1)) <= first.w, along > 0.0, crosses)",
        before: "along * (0.5 * (t0 + tm)) <= first.w",
        stage: "RayCast",
        seed: 4,
        promises: &["bound"],
    },
    Defect {
        what: "a ray that starts under the raised grid and leaves it beside an edge starts at what is behind",
        file: "picture/rasterize_grid.wgsl",
        now: "seen.y = select(1.0, seen.y, is_within);",
        before: "",
        stage: "RayFill",
        seed: 1,
        promises: &["bound"],
    },
    Defect {
        what: "the mesh of blocks is drawn as it is, and a near triangle loses pixels at its silhouette",
        file: "picture/rasterize_list.wgsl",
        now: "const LARGER_PX: f32 = 0.0625;",
        before: "const LARGER_PX: f32 = 0.0;",
        stage: "TriangleSplitting",
        seed: 3,
        promises: &["bound", "pinholes"],
    },
    Defect {
        what: "a triangle that is seen edge-on is met where its plane is, far behind it",
        file: "picture/rasterize_list.wgsl",
        now: "let beside = !(is_known && all(weights > rim));",
        before: "let beside = false;",
        stage: "TriangleSplitting",
        seed: 2,
        promises: &["bound", "pinholes"],
    },
    Defect {
        what: "nothing is drawn that is nearer than a tenth of a metre",
        file: "picture/rasterize_list.wgsl",
        now: "params.near_m, view.z)",
        before: "0.1, view.z)",
        stage: "TriangleSplitting",
        seed: 1,
        promises: &["bound", "pinholes"],
    },
    Defect {
        what: "blocks of another size next to each other do not share their vertices",
        file: "quadtree/triangle_splitting.wgsl",
        now: "let is_there = (edge.side != NORTH",
        before: "let is_there = level > 2u && (edge.side != NORTH",
        stage: "TriangleSplitting",
        seed: 1,
        promises: &["bound", "pinholes", "cracks"],
    },
    Defect {
        what: "what was found about a block in a frame holds for good",
        file: "lib/outlook.wgsl",
        now: "return way_m < 0.25 * known.x && turn",
        before: "return true || turn",
        stage: "VertexSplitting",
        seed: 1,
        promises: &["same bits"],
    },
];

/// A folder with lodlab's kernels, of which one is damaged.
fn damage(folder: &Path, defect: &Defect) -> impl FnOnce() {
    let file = folder.join("kernels").join(defect.file);
    let text = std::fs::read_to_string(&file).unwrap();
    let damaged = text.replace(defect.now, defect.before);
    assert_ne!(text, damaged, "{}: `{}` is not in {}", defect.what, defect.now, defect.file);
    std::fs::write(&file, damaged).unwrap();
    Kernel::forget_built_in();
    move || std::fs::write(&file, text).unwrap()
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        match entry.file_type().unwrap().is_dir() {
            true => copy(&entry.path(), &target),
            false => drop(std::fs::copy(entry.path(), target).unwrap()),
        }
    }
}

/// The first promise that is found broken. A parameter more, and a seed draws other scenes: with three others it is looked for as well.
fn first(gpu: &Arc<Gpu>, defect: &Defect) -> (Summary, Option<Found>) {
    let from = |seed: u64| {
        let stage = Some(defect.stage.to_string());
        let hunt = Hunt { seed, frames: 2000, finds: Some(1), stage, ..Hunt::default() };
        let mut found = None;
        let summary = hunt::hunt(gpu, &hunt, &mut |broken| found = Some(broken), &|_| ()).unwrap();
        (summary, found)
    };
    let mut last = from(defect.seed);
    for seed in defect.seed + 1..defect.seed + 4 {
        if last.1.is_none() {
            last = from(seed);
        }
    }
    last
}

#[test]
fn every_former_defect_is_found() {
    let folder = tempfile::tempdir().unwrap();
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("kernels"), &folder.path().join("kernels"));
    std::env::set_current_dir(folder.path()).unwrap();
    read_from_checkout();
    let gpu = Gpu::open(None).unwrap();
    for defect in DEFECTS {
        let mend = damage(folder.path(), defect);
        let (summary, found) = first(&gpu, defect);
        let found = found.unwrap_or_else(|| panic!("{}: not found in {} frames", defect.what, summary.frames));
        println!("{}: {} after {} frames of {}", defect.what, found.promise, summary.frames, defect.stage);
        assert!(defect.promises.contains(&found.promise), "{}: {}", defect.what, found.promise);
        mend();
        Kernel::forget_built_in();
    }
}
