//! What looking costs: a picture of a large buffer, its statistics, and a parameter that is dragged, each beside a frame of the chain.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use lodlab::experiment::sweep::read_setting;
use lodlab::gpu::paint::{Image, Part, Tones};
use lodlab::gpu::statistics::Looked;
use lodlab::gpu::{Gpu, Held};
use lodlab::inspector::desk::Action;
use lodlab::inspector::wish::{Shown, Side};
use lodlab::inspector::{App, Screen};
use lodlab::kernel::Elem;
use lodlab::look::channel::channels;
use lodlab::look::scale::Scaled;
use lodlab::look::{Colours, Scale};
use lodlab::plan::Buffer;
use lodlab::run::{Keep, Setup};

fn middle(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

/// Median of a few, in milliseconds.
fn median_ms(mut work: impl FnMut()) -> f64 {
    work();
    let time = |_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e3
    };
    middle((0..15).map(time).collect())
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

/// The inspector, and what stands for the window that it is in.
struct Window {
    app: App,
    context: egui::Context,
    screen: Screen,
    woken: Receiver<()>,
    /// What egui puts out is drawn as well, as in a window on a screen.
    target: Option<wgpu::Texture>,
}

impl Window {
    fn open(gpu: &Arc<Gpu>) -> Self {
        let screen = Screen::without_window(gpu);
        // as a window does, it draws when there is something new, and with every move of the hand
        let (wake, woken) = channel();
        let wake = std::sync::Mutex::new(wake);
        let wakes = move || drop(wake.lock().map(|wake| wake.send(())));
        let mut app = App::new(gpu, screen.clone(), Arc::new(wakes), None);
        app.open(Path::new(EXPERIMENT));
        app.act(Action::Set { side: Side::A, path: "scene.viewport".into(), value: "(1024, 768)".into() });
        app.time_steps(false);
        let mut window = Self { app, context: egui::Context::default(), screen, woken, target: None };
        window.settle();
        window
    }

    fn frame(&mut self) {
        let rect = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(1440.0, 900.0));
        let input = egui::RawInput { screen_rect: Some(rect), ..Default::default() };
        let mut output = self.context.run_ui(input, |ui| self.app.ui(ui));
        self.screen.take(&mut output.textures_delta);
        if let Some(target) = &self.target {
            self.screen.draw(&self.context, output, target);
        }
    }

    /// Draws until nothing is on its way.
    fn settle(&mut self) {
        let mut quiet = 0;
        while quiet < 2 {
            self.frame();
            quiet = if self.app.is_settled() { quiet + 1 } else { 0 };
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    fn shown(&self) -> Option<Arc<Shown>> {
        self.app.desk().shown(Side::A).cloned()
    }
}

const EXPERIMENT: &str = "experiments/quickstart.ron";
/// Columns of the grid while they are dragged.
const COLUMNS: std::ops::Range<u32> = 100..140;

/// The frame that is shown while a parameter is dragged, by itself: prepared, and run again and again.
fn alone_ms(gpu: &Arc<Gpu>) -> f64 {
    let text = std::fs::read_to_string(EXPERIMENT).expect("the quickstart");
    let mut times = Vec::new();
    for columns in COLUMNS.step_by(5) {
        let settings = ["scene.viewport=(1024, 768)".to_string(), format!("*.ViewGrid.size=({columns}, 75)")];
        let settings = settings.map(|setting| read_setting(&setting).expect("a setting"));
        let setup = Setup::first(text.clone(), "experiments".into(), &settings, Keep::Last).expect("it is planned");
        let mut executor = setup.executor(gpu).expect("it is prepared");
        executor.frame(0).expect("it runs");
        times.extend((0..5).map(|_| executor.frame(0).expect("it runs").wall_ms));
    }
    middle(times)
}

/// The rate of frames while a parameter changes all the time.
struct Dragged {
    interval_ms: f64,
    made_ms: f64,
}

fn drag(window: &mut Window) -> Dragged {
    let number = |window: &Window| window.shown().map(|shown| shown.number);
    let (mut made, mut last, start) = (Vec::new(), number(window), Instant::now());
    // the hand never rests: whenever the window is drawn, the parameter has another value
    for columns in COLUMNS.cycle() {
        let value = format!("({columns}, 75)");
        window.app.act(Action::Set { side: Side::A, path: "*.ViewGrid.size".into(), value });
        window.frame();
        assert!(window.app.refused(Side::A).is_none(), "{:?}", window.app.refused(Side::A));
        if number(window) != last {
            last = number(window);
            made.extend(window.shown().and_then(|shown| shown.made_ms));
        }
        if made.len() == 20 {
            break;
        }
        let _ = window.woken.recv_timeout(Duration::from_millis(16));
    }
    let interval_ms = start.elapsed().as_secs_f64() * 1e3 / made.len() as f64;
    Dragged { interval_ms, made_ms: middle(made) }
}

/// A parameter that is dragged, beside the same frame by itself, in turn.
fn dragged(gpu: &Arc<Gpu>) {
    let mut window = Window::open(gpu);
    for is_drawn in [false, true] {
        window.target = is_drawn.then(|| window.screen.target(&window.context));
        let ms = median_ms(|| {
            window.frame();
            gpu.wait().expect("it is done");
        });
        let rounds: Vec<(f64, Dragged)> = (0..9)
            .map(|_| {
                window.settle();
                (alone_ms(gpu), drag(&mut window))
            })
            .collect();
        let of = |number: &dyn Fn(&(f64, Dragged)) -> f64| middle(rounds.iter().map(number).collect());
        let what = if is_drawn { "with drawing it" } else { "without drawing it" };
        println!("the window's own work in a frame, {what}: {ms:.2} ms");
        println!(
            "a parameter is dragged, quickstart at 1024 x 768, {what}: a new frame every {:.1} ms, planning and preparing {:.1} ms of it; the frame by itself {:.1} ms; {:.1} ms more (medians of {} rounds)",
            of(&|(_, dragged)| dragged.interval_ms),
            of(&|(_, dragged)| dragged.made_ms),
            of(&|(alone_ms, _)| *alone_ms),
            of(&|(alone_ms, dragged)| dragged.interval_ms - alone_ms),
            rounds.len()
        );
    }
}

fn main() {
    // criterion's and cargo's flags mean nothing here
    let gpu = Gpu::open(None).expect("an adapter");
    println!("{}", gpu.summary.name);
    pictures(&gpu);
    dragged(&gpu);
}
