//! What looking costs: a picture of a large buffer, its statistics, and a parameter that is dragged, each beside a frame of the chain.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use lodlab::gpu::paint::{Image, Part, Tones};
use lodlab::gpu::statistics::Looked;
use lodlab::gpu::{Gpu, Held};
use lodlab::inspector::desk::Action;
use lodlab::inspector::wish::Side;
use lodlab::inspector::{App, Screen};
use lodlab::kernel::Elem;
use lodlab::look::channel::channels;
use lodlab::look::scale::Scaled;
use lodlab::look::{Colours, Scale};
use lodlab::plan::Buffer;

/// Median of a few, in milliseconds.
fn median_ms(mut work: impl FnMut()) -> f64 {
    work();
    let mut times: Vec<f64> = (0..15)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn pictures(gpu: &Arc<Gpu>) {
    const SIDE: u32 = 4096;
    let values: Vec<f32> = (0..SIDE * SIDE).map(|at| (at % 1009) as f32).collect();
    let about = Buffer::new("made", Elem::F32, &[SIDE, SIDE], "", "");
    let held = Held::upload(gpu, about, bytemuck::cast_slice(&values)).expect("a large buffer");
    let channel = &channels(&held.about)[0];
    let part = Part::all(&held);
    let tones = Tones { colours: Colours::Viridis, scaled: Scaled::new(0.0, 1009.0, Scale::Linear), mark_above: None };
    let canvas = gpu.canvas((1024, 768)).expect("a canvas");
    for (what, step) in [("all of it", 5.0), ("a value a pixel", 1.0), ("zoomed in", 0.05)] {
        let ms = median_ms(|| {
            let image = Image { held: &held, channel, minus: None, part, origin: [17.0, 30.0], step: [step; 2], tones };
            gpu.paint_image(&canvas, &image).expect("it is painted");
            gpu.wait().expect("it is done");
        });
        println!("picture of 4096 x 4096 values on 1024 x 768 pixels, {what}: {ms:.2} ms");
    }
    let looked = Looked { held: &held, channel, minus: None, part };
    let ms = median_ms(|| assert!(gpu.statistics(&looked).expect("statistics").numbers > 0));
    println!("lowest, highest, mean and counts of 4096 x 4096 values: {ms:.2} ms");
    let ms = median_ms(|| assert!(!gpu.histogram(&looked, tones).expect("a histogram").is_empty()));
    println!("histogram of 4096 x 4096 values: {ms:.2} ms");
}

fn settle_once(app: &mut App, context: &egui::Context, screen: &Screen) {
    let rect = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(1440.0, 900.0));
    let input = egui::RawInput { screen_rect: Some(rect), ..Default::default() };
    let mut output = context.run_ui(input, |ui| app.ui(ui));
    screen.take(&mut output.textures_delta);
}

/// Draws until nothing is on its way.
fn settle(app: &mut App, context: &egui::Context, screen: &Screen) {
    let mut quiet = 0;
    while quiet < 2 {
        settle_once(app, context, screen);
        quiet = if app.is_settled() { quiet + 1 } else { 0 };
        std::thread::sleep(std::time::Duration::from_micros(100));
    }
}

/// A parameter that changes all the time: from the change to the picture, beside the frame by itself.
fn dragged(gpu: &Arc<Gpu>) {
    let screen = Screen::without_window(gpu);
    // as a window does, it draws when there is something new, and every 30 ms while it waits for that
    let (wake, woken) = std::sync::mpsc::channel();
    let wake = std::sync::Mutex::new(wake);
    let wakes = move || drop(wake.lock().map(|wake| wake.send(())));
    let mut app = App::new(gpu, screen.clone(), Arc::new(wakes), None);
    app.open(Path::new("experiments/quickstart.ron"));
    app.act(Action::Set { side: Side::A, path: "scene.viewport".into(), value: "(1024, 768)".into() });
    let context = egui::Context::default();
    app.time_steps(false);
    settle(&mut app, &context, &screen);
    let ms = median_ms(|| settle_once(&mut app, &context, &screen));
    println!("the window's own work in a frame, without drawing it: {ms:.2} ms");
    let (mut frames, mut made) = (Vec::new(), Vec::new());
    let number = |app: &App| app.desk().shown(Side::A).map(|shown| shown.number);
    let (mut last, start, mut count) = (number(&app), Instant::now(), 0);
    // the hand never rests: whenever the window is drawn, the parameter has another value
    for size in 100.. {
        let value = format!("({size}, 75)");
        app.act(Action::Set { side: Side::A, path: "*.ViewGrid.size".into(), value });
        settle_once(&mut app, &context, &screen);
        assert!(app.refused(Side::A).is_none(), "{:?}", app.refused(Side::A));
        if number(&app) != last {
            last = number(&app);
            count += 1;
            frames.extend(app.desk().shown(Side::A).map(|shown| shown.frame_ms));
            made.extend(app.desk().shown(Side::A).and_then(|shown| shown.made_ms));
        }
        if count == 40 {
            break;
        }
        let _ = woken.recv_timeout(std::time::Duration::from_millis(16));
    }
    let ms = start.elapsed().as_secs_f64() * 1e3 / f64::from(count);
    frames.sort_by(f64::total_cmp);
    made.sort_by(f64::total_cmp);
    let (frame_ms, made_ms) = (frames[frames.len() / 2], made[made.len() / 2]);
    println!(
        "a parameter is dragged, quickstart at 1024 x 768: a new frame every {ms:.2} ms; planning and preparing {made_ms:.2} ms, the chain's own frame {frame_ms:.2} ms"
    );
}

fn main() {
    // criterion's and cargo's flags mean nothing here
    let gpu = Gpu::open(None).expect("an adapter");
    println!("{}", gpu.summary.name);
    pictures(&gpu);
    dragged(&gpu);
}
