//! The plan walked in f64 on the CPU: what every kernel should have computed, and how far f32 may be from it.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::camera::Camera;
use crate::plan::SceneData;
use crate::stages::Stage;

/// The frame a reference is computed for.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    pub data: &'a SceneData,
    pub camera: &'a Camera,
}

/// Contents of a buffer in f64 with a derived bound for each value.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// C order.
    pub dims: Vec<u32>,
    pub components: u32,
    /// NaN where there is nothing (no surface, a gap in a pyramid's layout).
    pub value: Vec<f64>,
    /// Largest difference that rounding in f32 explains; infinite where the value hangs on a decision that
    /// rounding can turn (a ray that touches a ridge).
    pub bound: Vec<f64>,
}

impl Values {
    pub fn missing(dims: &[u32], components: u32) -> Self {
        let length = dims.iter().map(|&side| side as usize).product::<usize>() * components as usize;
        Self { dims: dims.to_vec(), components, value: vec![f64::NAN; length], bound: vec![0.0; length] }
    }

    pub fn exact(dims: &[u32], components: u32, value: Vec<f64>) -> Self {
        Self { dims: dims.to_vec(), components, bound: vec![0.0; value.len()], value }
    }

    pub fn set(&mut self, at: usize, value: f64, bound: f64) {
        self.value[at] = value;
        self.bound[at] = bound;
    }
}

/// The buffers of a chain by name.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    by_name: BTreeMap<String, Arc<Values>>,
}

impl Buffers {
    /// What the first stage finds: the terrain.
    pub fn of_scene(data: &SceneData) -> Self {
        let size = data.terrain.size;
        let height = data.terrain.heights_m.iter().map(|&height| f64::from(height)).collect();
        let mut buffers = Self::default();
        buffers.put("height", Values::exact(&[size.y, size.x], 1, height));
        buffers
    }

    /// A stage only runs on a chain whose plan found every buffer it reads, so a missing one is empty.
    pub fn get(&self, name: &str) -> Arc<Values> {
        self.by_name.get(name).cloned().unwrap_or_else(|| Arc::new(Values::missing(&[0], 1)))
    }

    pub fn put(&mut self, name: &str, values: Values) {
        self.by_name.insert(name.into(), Arc::new(values));
    }

    pub fn contains(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }
}

/// Runs the stages of a chain in order on one frame: the reference chain.
pub fn walk(stages: &[Box<dyn Stage>], frame: &Frame) -> Buffers {
    let mut buffers = Buffers::of_scene(frame.data);
    for stage in stages {
        stage.reference(frame, &mut buffers);
    }
    buffers
}

/// How a GPU buffer differs from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    pub compared: usize,
    /// Values that hang on a decision rounding can turn, which nothing is said about.
    pub undecided: usize,
    /// Values beyond their bound, or present on one side only.
    pub beyond: usize,
    /// Largest difference within what is decided, and the largest as a multiple of its bound.
    pub largest: f64,
    pub largest_of_bound: f64,
    /// Where the worst one is.
    pub worst: usize,
}

/// Compares GPU values with the reference. `missing` tells which GPU values mean "nothing here".
pub fn compare(gpu: &[f64], reference: &Values, missing: impl Fn(f64) -> bool) -> Difference {
    let mut difference = Difference::default();
    for (at, (&ours, (&value, &bound))) in gpu.iter().zip(reference.value.iter().zip(&reference.bound)).enumerate() {
        if bound.is_infinite() {
            difference.undecided += 1;
            continue;
        }
        // a gap in a layout is never written and holds anything
        if value.is_nan() && bound == 0.0 {
            continue;
        }
        difference.compared += 1;
        let off = match (missing(ours), value.is_nan()) {
            (true, true) => 0.0,
            (false, false) => (ours - value).abs(),
            _ => f64::INFINITY,
        };
        let share = if off == 0.0 { 0.0 } else { off / bound };
        let within = share <= 1.0;
        difference.beyond += usize::from(!within);
        difference.largest = difference.largest.max(off);
        if share.is_nan() || share > difference.largest_of_bound {
            difference.largest_of_bound = share;
            difference.worst = at;
        }
    }
    difference
}
