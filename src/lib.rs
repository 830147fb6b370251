#![doc = include_str!("../README.md")]

pub mod experiment;
pub mod terrain;
pub mod camera;
pub mod kernel;
pub mod stages;
pub mod plan;
pub mod gpu;
pub mod reference;
pub mod measure;
pub mod report;
pub mod run;
pub mod check;
