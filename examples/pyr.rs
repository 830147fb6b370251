use lodlab::experiment::{Experiment, diagnostic::Source};
use lodlab::gpu::{Executor, Gpu};
use lodlab::run::{self, Options};
fn main() {
    let gpu = Gpu::open(None).unwrap();
    let text = "Experiment(scene: (terrain: Dem(file: \"puget_sound_cascades_2049x1025.png\", cell_m: 90, height_scale_m: 0.125), camera: Still(eye: (150e3, 40e3, 1900), look_at: (160e3, 50e3, 1500))), chains: {\"cast\": [HeightPyramid, RayCast]}, measure: [Time])";
    let e = Experiment::read(Source::new("x", text), "/work/shared/dem".into()).unwrap();
    let p = run::prepare(&e, &[]).unwrap().remove(0);
    let plan = run::plan(&p, &Options::default()).unwrap();
    let ex = Executor::new(&gpu, &plan, &p.data).unwrap();
    for _ in 0..4 {
        let t = ex.setup_by_steps().unwrap();
        println!("setup {:?}", t.steps.iter().map(|s| s.ms.unwrap()).collect::<Vec<_>>());
        let t = ex.frame_by_steps(0).unwrap();
        println!("frame {:?}", t.steps.iter().map(|s| s.ms.unwrap()).collect::<Vec<_>>());
        println!("wall setup {} frame {}", ex.setup().unwrap().wall_ms, ex.frame(0).unwrap().wall_ms);
    }
}
