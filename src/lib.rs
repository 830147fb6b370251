//! lodlab runs experiments with terrain level of detail on the GPU and reports error against run time.
//!
//! The modules in the order in which they build on each other: an [`experiment`] file names a [`terrain`], a [`camera`] path and chains of
//! stages. The [`ground`] says what the surface is. A stage dispatches WGSL from a [`kernel`] file. Ground, inputs and cameras are a [`scene`];
//! what kernels are told of one camera is a [`frame`]. A cell of the experiment's sweep becomes a [`plan`], a pure value: what runs, on
//! which buffers, and what is left out and why. A [`mod@reference`] says in f64 what each buffer should hold. The [`stages`] state both. A [`look`]
//! is a way to see a buffer. The [`gpu`] carries plans out; the buffers that come back are compared with exact ground truth by each [`measure`]. A [`report`] is made of
//! the records that a [`run`] keeps of its cells. The [`check`] holds every stage to its reference.
//!
//! ```
//! use lodlab::experiment::{Experiment, diagnostic::Source};
//! use lodlab::{plan, run};
//!
//! let text = r#"Experiment(
//!     scene: (
//!         terrain: Shape(kind: GaussianHill, size: (65, 65)),
//!         camera: Still(eye: (1000, -500, 900), look_at: (1000, 1000, 300)),
//!     ),
//!     chains: {"grid": [HeightPyramid, ViewGrid(size: (32, 24)), Project, Rasterize, Shade]},
//!     measure: [ScreenError],
//! )"#;
//! let experiment = Experiment::read(Source::new("hill.ron", text), "".into())?;
//! let prepared = run::prepare(&experiment, &[])?;
//! let plan = run::plan(&prepared[0], &run::Options::default())?;
//! // nothing asks for a picture, so it is left out
//! assert!(plan.left_out.iter().any(|left| left.what.starts_with("Shade")));
//! println!("{}", plan::explain(&plan));
//! # Ok::<(), lodlab::experiment::diagnostic::Diagnostic>(())
//! ```

pub mod experiment;
pub mod terrain;
pub mod ground;
pub mod camera;
pub mod kernel;
pub mod scene;
pub mod frame;
pub mod plan;
pub mod reference;
pub mod stages;
pub mod look;
pub mod gpu;
pub mod measure;
pub mod report;
pub mod run;
pub mod check;
pub mod hunt;
#[cfg(feature = "inspector")]
pub mod inspector;
