//! lodlab runs experiments with terrain level of detail on the GPU and reports error against run time.
//!
//! Read the modules in this order: an [`experiment`] file names a [`terrain`], a [`camera`] path and chains of
//! [`stages`], each of which dispatches a WGSL [`kernel`]. A cell of its sweep becomes a [`plan`], a pure value:
//! what runs, on which buffers, and what is left out and why. The plan is carried out on the [`gpu`], or walked
//! in f64 by the [`mod@reference`]. The buffers that come back are compared with exact ground truth ([`measure`]);
//! a [`run`] keeps a record of each cell and makes a [`report`]. [`check`] holds every stage to its reference.
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
pub mod camera;
pub mod kernel;
pub mod plan;
pub mod reference;
pub mod stages;
pub mod gpu;
pub mod measure;
pub mod report;
pub mod run;
pub mod check;
