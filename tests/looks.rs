//! Every buffer that a stage makes can be seen as what it is.

mod common;

use std::path::Path;

use lodlab::experiment::scene::Surface;
use lodlab::gpu::Gpu;
use lodlab::gpu::Held;
use lodlab::gpu::paint::{Image, Part, Tones};
use lodlab::gpu::statistics::Looked;
use lodlab::kernel::{Elem, Packing};
use lodlab::look::channel::channels;
use lodlab::look::scale::Scaled;
use lodlab::look::{Colours, Form, Scale};
use lodlab::plan::{Buffer, BufferId, Spread};
use lodlab::run::{Keep, Setup};
use lodlab::stages::{self, REGISTRY};

const SCENE: &str = "terrain: Noise(kind: Ridged, size: (65, 49), cell_m: 10, height_m: (0, 300), wavelength_m: 300), \
    camera: Still(eye: (100, 20, 400), look_at: (400, 400, 100)), viewport: (48, 36)";

/// A later stage whose buffers nobody can see fails here.
#[test]
fn every_buffer_of_every_stage_has_a_look() {
    let mut seen = std::collections::BTreeSet::new();
    for entry in REGISTRY {
        for example in entry.info.examples {
            let folder = tempfile::tempdir().unwrap();
            for (name, text) in example.files {
                std::fs::write(folder.path().join(name), text).unwrap();
            }
            let surface = match example.only_on {
                Some(Surface::Bilinear) => ", surface: Bilinear",
                _ => "",
            };
            let scene = format!("{SCENE}{surface}");
            let setup = Setup::chain(&scene, example.chain, folder.path(), Keep::Everything).unwrap();
            let plan = &setup.plan;
            let last = setup.prepared.stages.len() - 1;
            let (call, stage) = (&setup.prepared.cell.stages[last], setup.prepared.stages[last].as_ref());
            for name in stages::makes(call, stage) {
                let Ok(id) = plan.find(&name) else { continue };
                let buffer = plan.buffer(id);
                let forms = plan.known().forms(id);
                let what = format!("`{name}` of {} ({:?} {:?})", entry.info.name, buffer.elem, buffer.dims);
                let is_map = buffer.dims.len() == 2 && buffer.dims.iter().all(|side| *side > 1);
                // what is more than a list has a place, and what has several numbers in a word says which
                assert!(!is_map || buffer.spread != Spread::Numbers, "{what} is spread over nothing that is known");
                let is_packed = matches!(buffer.elem, Elem::Vec2U32 | Elem::Vec4U32);
                let is_told = !buffer.parts.is_empty() || buffer.packing != Packing::None;
                assert!(!is_packed || is_told || name.contains("live_count"), "{what} has words that nobody can read");
                assert!(!forms.is_empty() && (!is_map || forms[0] != Form::Table), "{what}: {forms:?}");
                forms.into_iter().for_each(|form| {
                    seen.insert(form.name());
                });
            }
        }
    }
    assert_eq!(seen.len(), Form::ALL.len(), "{seen:?}");
}

fn held(gpu: &Gpu, values: &[f32], columns: u32) -> Held {
    let about = Buffer::new("made", Elem::F32, &[values.len() as u32 / columns, columns], "", "");
    Held::upload(gpu, about, bytemuck::cast_slice(values)).unwrap()
}

/// Lowest, highest, mean and percentiles are those of the values, and what is no number is counted apart.
#[test]
fn statistics_are_those_of_the_values() {
    let gpu = Gpu::open(None).unwrap();
    for length in [1usize, 2, 63, 5000, 70_001] {
        let mut values: Vec<f32> = (0..length).map(|at| ((at * 7919) % 10_007) as f32 * 0.37 - 900.0).collect();
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        let held_plain = held(&gpu, &values, 1);
        let channel = &channels(&held_plain.about)[0];
        let looked = Looked { held: &held_plain, channel, minus: None, part: Part::all(&held_plain) };
        let found = gpu.statistics(&looked).unwrap();
        assert_eq!((found.lowest, found.highest), (Some(sorted[0]), Some(sorted[length - 1])));
        let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / length as f64;
        assert!((found.mean.unwrap() - mean).abs() < 1e-3, "{length}: {found:?} {mean}");
        for share in [0.01, 0.5, 0.99] {
            let rank = ((share * length as f64).ceil() as usize).max(1);
            let value = gpu.percentile(&looked, found.numbers, share).unwrap();
            assert_eq!(value, Some(sorted[rank - 1]), "{length} {share}");
        }
        let tones = Tones {
            colours: Colours::Grey,
            scaled: Scaled::new(sorted[0], sorted[length - 1], Scale::Linear),
            mark_above: None,
        };
        assert_eq!(gpu.histogram(&looked, tones).unwrap().iter().sum::<u32>() as usize, length);
        if length < 63 {
            continue;
        }
        values[3] = f32::NAN;
        values[5] = f32::INFINITY;
        values[7] = f32::NEG_INFINITY;
        let loud = held(&gpu, &values, 1);
        let found = gpu.statistics(&Looked { held: &loud, ..looked }).unwrap();
        assert_eq!((found.nan, found.infinite, found.minus_infinite), (1, 1, 1));
        assert_eq!(found.numbers as usize, length - 3);
    }
}

/// Each element has its colour where it should be, nearest; a NaN shouts, and what is missing is dark.
#[test]
fn an_image_has_the_colours_of_its_elements() {
    let gpu = Gpu::open(None).unwrap();
    let mut held = held(&gpu, &[0.0, 1.0, 2.0, f32::NAN, -3.0, 4.0], 3);
    let channel = channels(&held.about)[0].clone();
    let paint = |held: &Held, channel: &lodlab::look::Channel| {
        let canvas = gpu.canvas((6, 4)).unwrap();
        let tones =
            Tones { colours: Colours::Grey, scaled: Scaled::new(0.0, 4.0, Scale::Linear), mark_above: Some(3.0) };
        let image =
            Image { held, channel, minus: None, part: Part::all(held), origin: [0.0; 2], step: [0.5; 2], tones };
        gpu.paint_image(&canvas, &image).unwrap();
        canvas.read(&gpu).unwrap()
    };
    let rgba = paint(&held, &channel);
    let pixel = |rgba: &[u8], x: usize, y: usize| rgba[4 * (6 * y + x)..][..3].to_vec();
    assert_eq!(pixel(&rgba, 0, 0), [0, 0, 0]);
    assert_eq!(pixel(&rgba, 2, 1), [64, 64, 64]);
    assert_eq!(pixel(&rgba, 5, 0), [128, 128, 128]);
    assert_eq!(pixel(&rgba, 0, 2), [255, 0, 255]);
    // below the range it is as the lowest, above the threshold it is marked
    assert_eq!(pixel(&rgba, 2, 3), [0, 0, 0]);
    assert_eq!(pixel(&rgba, 4, 3), [255, 96, 32]);
    held.about.missing = Some(-1.0);
    let rgba = paint(&held, &channels(&held.about)[0]);
    assert_eq!(pixel(&rgba, 2, 3), [0x30, 0x34, 0x3a]);
}

/// Wherever an image is moved and however it is zoomed: an element in each pixel that is over one, and nothing of what was painted before.
#[test]
fn an_image_is_where_it_was_moved_to() {
    let gpu = Gpu::open(None).unwrap();
    let values: Vec<f32> = (0..15).map(|at| at as f32).collect();
    let held = held(&gpu, &values, 5);
    let channel = &channels(&held.about)[0];
    let canvas = gpu.canvas((70, 30)).unwrap();
    let tones = Tones { colours: Colours::Grey, scaled: Scaled::new(0.0, 14.0, Scale::Linear), mark_above: None };
    let steps = [[0.125, 0.125], [0.0625, 0.25], [1.0, 1.0], [64.0, 0.5], [1.0 / 1024.0; 2], [1e9; 2], [1e-9; 2]];
    let origins =
        [[0.0, 0.0], [-2.0, -1.5], [3.0, 2.0], [-40.0, 1.0], [5.0, 0.0], [2.5, -3.75], [-1e9, 1e9], [4.9375, 2.9375]];
    for (origin, step) in origins.iter().flat_map(|origin| steps.map(|step| (*origin, step))) {
        let image = Image { held: &held, channel, minus: None, part: Part::all(&held), origin, step, tones };
        gpu.paint_image(&canvas, &image).unwrap();
        let rgba = canvas.read(&gpu).unwrap();
        for (at, pixel) in rgba.chunks_exact(4).enumerate() {
            let place = [at % 70, at / 70].map(|at| at as f32 + 0.5);
            let [x, y] = [0, 1].map(|axis| (origin[axis] + place[axis] * step[axis]).floor());
            let inside = (0.0..5.0).contains(&x) && (0.0..3.0).contains(&y);
            let grey = ((5.0 * y + x) / 14.0 * 255.0).round() as u8;
            let expected = if inside { [grey, grey, grey, 255] } else { [0; 4] };
            assert_eq!(pixel, expected, "pixel {at}, from {origin:?} by {step:?}");
        }
    }
}

/// The f64 result of a stage takes the place of its kernels': what a broken one makes is mended, and what comes after it is as if it were right.
#[test]
fn a_stage_on_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = format!(
        "Experiment(scene: ({SCENE}), chains: {{\"a\": [HeightPyramid, ViewGrid(size: (16, 12)), AspectImportance(size: (8, 8)), \
         Warp, Project, Rasterize]}}, measure: [ScreenError])"
    );
    let plain = common::records_of(folder.path(), &experiment, &["--dump", "vertex", "--dump", "grid_point"]);
    let read = |records: &[serde_json::Value], name: &str| -> Vec<f32> {
        let hash = records[0]["hash"].as_str().unwrap();
        let path = folder.path().join("made/dumps").join(hash).join(format!("{name}_0000.npy"));
        npyz::NpyFile::new(&std::fs::read(path).unwrap()[..]).unwrap().into_vec().unwrap()
    };
    let dump = ["--dump", "vertex", "--dump", "grid_point", "--on-cpu", "Warp"];
    let on_cpu = common::records_of(folder.path(), &experiment, &dump);
    assert_ne!(plain[0]["hash"], on_cpu[0]["hash"]);
    let off = |name: &str| {
        let (a, b) = (read(&plain, name), read(&on_cpu, name));
        let off = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        (a != b, off)
    };
    let (is_other, points_off) = off("grid_point");
    // f64 rounds otherwise, but not by much
    assert!(is_other && points_off < 1e-5, "{points_off}");
    assert!(off("vertex").0, "what comes after the stage has its result");
    let warnings = on_cpu[0]["warnings"].to_string();
    assert!(warnings.contains("Warp in f64 on the CPU"), "{warnings}");
    // the same as the reference of the whole chain, to the digits of f32
    let setup = Setup::first(experiment, Path::new("").into(), &[], Keep::Everything).unwrap();
    let id: BufferId = setup.plan.find("grid_point").unwrap();
    assert_eq!(setup.plan.buffer(id).elements() as usize * 2, read(&on_cpu, "grid_point").len());
    let refused = common::run(folder.path(), &["run", "made.ron", "--on-cpu", "Warb"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(common::errors(&refused).contains("did you mean `Warp`?"));
}

/// A stage on the CPU finds what the frame before left, although the walk in f64 ends before the stage that leaves it.
#[test]
fn a_stage_on_the_cpu_remembers() {
    let folder = tempfile::tempdir().unwrap();
    let scene = SCENE.replace("camera: Still(", "camera: Still(frames: 3, ");
    let experiment = format!(
        "Experiment(scene: ({scene}), chains: {{\"a\": [HeightPyramid, SketchMap(texels: 16), SketchImportance(error_share: 0.5), \
         ViewGrid(size: (17, 17)), Warp, GeometryImage, GridError(rule: Estimate, threshold_px: 0.01), ErrorDemand(texels: 8), \
         Rasterize]}}, measure: [ScreenError])"
    );
    let importance = |flags: &[&str]| -> Vec<Vec<f32>> {
        let records = common::records_of(folder.path(), &experiment, &[&["--dump", "importance"], flags].concat());
        let dumps = folder.path().join("made/dumps").join(records[0]["hash"].as_str().unwrap());
        let frame = |at: usize| std::fs::read(dumps.join(format!("importance_{at:04}.npy"))).unwrap();
        (0..3).map(|at| npyz::NpyFile::new(&frame(at)[..]).unwrap().into_vec().unwrap()).collect()
    };
    let (plain, on_cpu) = (importance(&[]), importance(&["--on-cpu", "SketchImportance"]));
    assert_ne!(plain[0], plain[1], "the second frame follows errors");
    for (plain, on_cpu) in plain.iter().zip(&on_cpu) {
        let off = plain.iter().zip(on_cpu).map(|(a, b)| (a - b).abs() / a.max(1e-30)).fold(0.0, f32::max);
        assert!(off < 1e-3, "{off}");
    }
}

/// A picture of a buffer is in the page, after a step as well, and of every frame where that is asked for.
#[test]
fn pictures_of_buffers_are_in_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = format!(
        "Experiment(scene: ({}), chains: {{\"a\": [HeightPyramid, ViewGrid(size: (16, 12)), Project, Rasterize, Shade]}}, measure: [Time])",
        SCENE.replace("camera: Still(", "camera: Still(frames: 3, ")
    );
    let flags = ["--picture", "vertex@Project/project", "--picture", "height_mean", "--every-frame"];
    let records = common::records_of(folder.path(), &experiment, &flags);
    let looks = records[0]["looks"].as_array().unwrap();
    assert_eq!(looks.len(), 6);
    let page = std::fs::read_to_string(folder.path().join("made/report.html")).unwrap();
    assert!(page.contains("vertex@Project/project, frame 2"));
    for look in looks {
        let png = image::open(folder.path().join("made").join(look[1].as_str().unwrap())).unwrap().to_rgb8();
        let first = png.get_pixel(0, 0);
        assert!(png.pixels().any(|pixel| pixel != first), "{look} is one colour");
    }
    let refused = common::run(folder.path(), &["run", "made.ron", "--picture", "vertx"]);
    assert!(common::errors(&refused).contains("did you mean `vertex`?"), "{}", common::errors(&refused));
}
