//! What every kernel should have computed: contents of buffers in f64, and how far f32 may be from them.
//!
//! A stage's reference is written from its formula, in the stage's own folder. Here is what references read and write, and how
//! what a GPU left is compared with it.

use std::sync::Arc;

use glam::UVec2;
use thiserror::Error;

use crate::camera::Camera;
use crate::experiment::scene::Surface;
use crate::ground::cell::Cell;
use crate::ground::{Ground, Lattice, Samples};
use crate::plan::product::{Product, Products};
use crate::scene::SceneData;

/// The f64 half of a stage.
pub trait Reference {
    /// Reads its inputs from `buffers` and puts its outputs there, each value with the largest difference that f32 can explain.
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent>;
}

/// A reference asked for something that no reference before it left. A chain that was planned has all that its stages read, so this is
/// a mistake in a reference, or a reference that is not there (a user's kernel).
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("its reference needs {0}, which no reference before it leaves")]
pub struct Absent(pub String);

/// The frame a reference is computed for.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    pub data: &'a SceneData,
    pub camera: &'a Camera,
    /// The ground that stages find here: the scene's, or one that a kernel has made.
    pub ground: &'a dyn Ground,
    pub is_scene_ground: bool,
    /// What the frame before left; nothing in the first one.
    pub previous: Option<&'a Buffers>,
}

impl<'a> Frame<'a> {
    /// A frame before which there was none, over the scene's ground.
    pub fn first(data: &'a SceneData, camera: &'a Camera) -> Self {
        Self { data, camera, ground: data.ground.as_ref(), is_scene_ground: true, previous: None }
    }

    pub fn lattice(&self) -> Lattice {
        self.ground.lattice()
    }

    /// Every height is the same, as far as a plan can know.
    pub fn is_flat(&self) -> bool {
        self.is_scene_ground && self.ground.is_flat()
    }

    /// An eye can be under the surface or beyond the border, as far as a plan can know.
    pub fn sees_underside(&self) -> bool {
        self.data.sees_underside || !self.is_scene_ground
    }

    /// Heights at the corners of a cell.
    pub fn cell(&self, at: UVec2) -> Cell {
        let height = |x, y| self.ground.height_m(at + UVec2::new(x, y));
        Cell { nw: height(0, 0), ne: height(1, 0), sw: height(0, 1), se: height(1, 1) }
    }
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
    /// A list whose elements may stand in any order.
    pub in_any_order: bool,
}

impl Values {
    pub fn missing(dims: &[u32], components: u32) -> Self {
        let length = dims.iter().map(|&side| side as usize).product::<usize>() * components as usize;
        Self::exact(dims, components, vec![f64::NAN; length])
    }

    pub fn exact(dims: &[u32], components: u32, value: Vec<f64>) -> Self {
        Self { dims: dims.to_vec(), components, bound: vec![0.0; value.len()], value, in_any_order: false }
    }

    pub fn set(&mut self, at: usize, value: f64, bound: f64) {
        self.value[at] = value;
        self.bound[at] = bound;
    }

    /// Nothing is there, and nothing is ever written there: memory holds anything.
    pub fn is_gap(&self, at: usize) -> bool {
        self.value[at].is_nan() && self.bound[at] == 0.0
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValuesId(usize);

/// The buffers of a chain in the order in which they were made, and the products they are part of.
#[derive(Clone, Debug)]
pub struct Buffers {
    all: Vec<(String, Arc<Values>)>,
    products: Products<ValuesId>,
    scene_ground: Arc<dyn Ground>,
    surface: Surface,
    /// The ground that a kernel has made, and which values it is.
    made_ground: Option<(ValuesId, Arc<dyn Ground>)>,
}

impl Buffers {
    /// What the first stage finds: the inputs of the scene.
    pub fn of_scene(data: &SceneData) -> Self {
        let mut buffers = Self {
            all: Vec::new(),
            products: Products::default(),
            scene_ground: data.ground.clone(),
            surface: data.scene.surface,
            made_ground: None,
        };
        for input in &data.inputs {
            let values = input.elem.values(input.packing, input.bytes());
            let components = input.packing.components(input.elem);
            buffers.put(input.name, Values::exact(&[input.size.y, input.size.x], components, values));
        }
        buffers
    }

    /// The ground as it is now.
    pub fn ground(&self) -> Arc<dyn Ground> {
        self.made_ground.as_ref().map_or(&self.scene_ground, |(_, ground)| ground).clone()
    }

    pub fn is_scene_ground(&self) -> bool {
        self.made_ground.is_none()
    }

    /// Makes values the ground of what comes after.
    pub fn change_ground(&mut self, heights: ValuesId) {
        let lattice = self.scene_ground.lattice();
        let ground = Samples::made(lattice, self.values(heights).value.as_slice().into(), self.surface);
        self.made_ground = Some((heights, Arc::new(ground)));
    }

    /// The newest buffer of a name.
    pub fn find(&self, name: &str) -> Option<ValuesId> {
        self.all.iter().rposition(|(known, _)| known == name).map(ValuesId)
    }

    /// The contents of the newest buffer of a name.
    pub fn get(&self, name: &str) -> Result<Arc<Values>, Absent> {
        self.find(name).map(|id| self.values(id)).ok_or_else(|| Absent(format!("the buffer `{name}`")))
    }

    pub fn values(&self, id: ValuesId) -> Arc<Values> {
        self.all[id.0].1.clone()
    }

    /// A new buffer; another one of the same name stays what it is.
    pub fn put(&mut self, name: &str, values: Values) -> ValuesId {
        self.all.push((name.into(), Arc::new(values)));
        ValuesId(self.all.len() - 1)
    }

    /// New contents of a buffer.
    pub fn replace(&mut self, id: ValuesId, values: Values) {
        self.all[id.0].1 = Arc::new(values);
        if self.made_ground.as_ref().is_some_and(|(heights, _)| *heights == id) {
            self.change_ground(id);
        }
    }

    pub fn latest<P: Product<ValuesId>>(&self) -> Result<P, Absent> {
        self.products.latest().ok_or_else(|| Absent(P::WHAT.into()))
    }

    pub fn products(&self) -> &Products<ValuesId> {
        &self.products
    }

    pub fn offer<P: Product<ValuesId>>(&mut self, product: P) {
        self.products.offer(product);
    }
}

/// How a GPU buffer differs from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    pub compared: usize,
    /// Values that hang on a decision rounding can turn, which nothing is said about.
    pub undecided: usize,
    /// Values that the reference says nothing of, because nothing is written there.
    pub gaps: usize,
    /// Values beyond their bound, or present on one side only.
    pub beyond: usize,
    /// Largest difference within what is decided, and the largest as a multiple of its bound.
    pub largest: f64,
    pub largest_of_bound: f64,
}

impl Difference {
    fn add(&mut self, ours: f64, value: f64, bound: f64) {
        if bound.is_infinite() {
            self.undecided += 1;
            return;
        }
        self.compared += 1;
        let off = match (ours.is_nan(), value.is_nan()) {
            (true, true) => 0.0,
            (false, false) => (ours - value).abs(),
            _ => f64::INFINITY,
        };
        let share = if off == 0.0 { 0.0 } else { off / bound };
        let within = share <= 1.0;
        self.beyond += usize::from(!within);
        self.largest = self.largest.max(off);
        if share.is_nan() || share > self.largest_of_bound {
            self.largest_of_bound = share;
        }
    }

    /// Both differences together.
    pub fn merge(&mut self, other: &Difference) {
        self.compared += other.compared;
        self.undecided += other.undecided;
        self.gaps += other.gaps;
        self.beyond += other.beyond;
        self.largest = self.largest.max(other.largest);
        self.largest_of_bound = self.largest_of_bound.max(other.largest_of_bound);
    }

    /// Share of the values that nothing is said about.
    pub fn undecided_share(&self) -> f64 {
        self.undecided as f64 / (self.compared + self.undecided).max(1) as f64
    }
}

/// Compares GPU values (NaN for nothing) with the reference. Different lengths are a difference in every value that one has more.
pub fn compare(gpu: &[f64], reference: &Values) -> Difference {
    let mut difference = Difference::default();
    difference.beyond += gpu.len().abs_diff(reference.value.len());
    if reference.in_any_order {
        compare_sorted(gpu, reference, &mut difference);
        return difference;
    }
    for (at, (&ours, (&value, &bound))) in gpu.iter().zip(reference.value.iter().zip(&reference.bound)).enumerate() {
        match reference.is_gap(at) {
            true => difference.gaps += 1,
            false => difference.add(ours, value, bound),
        }
    }
    difference
}

/// The elements of two lists, each sorted.
fn compare_sorted(gpu: &[f64], reference: &Values, difference: &mut Difference) {
    let components = reference.components as usize;
    let listed = (0..reference.value.len()).step_by(components).take_while(|&at| !reference.is_gap(at)).count();
    let sorted = |values: &[f64]| {
        let mut rows: Vec<Vec<f64>> = values.chunks_exact(components).take(listed).map(<[f64]>::to_vec).collect();
        rows.sort_by(|a, b| {
            a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(a.len().cmp(&b.len()))
        });
        rows.concat()
    };
    // of one list all values have one bound
    let bound = reference.bound[..listed * components].iter().copied().fold(0.0, f64::max);
    for (ours, value) in sorted(gpu).into_iter().zip(sorted(&reference.value)) {
        difference.add(ours, value, bound);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::HeightField;

    #[test]
    fn another_length_is_a_difference() {
        let reference = Values::exact(&[3], 1, vec![1.0, 2.0, 3.0]);
        assert_eq!(compare(&[1.0, 2.0, 3.0], &reference).beyond, 0);
        assert_eq!(compare(&[1.0, 2.0], &reference).beyond, 1);
        assert_eq!(compare(&[1.0, 2.0, 3.0, 4.0, 5.0], &reference).beyond, 2);
    }

    #[test]
    fn a_list_in_any_order_is_compared_as_a_set() {
        let mut reference = Values::missing(&[3], 2);
        [5.0, 6.0, 1.0, 2.0].into_iter().enumerate().for_each(|(at, value)| reference.set(at, value, 0.0));
        reference.in_any_order = true;
        // past the list's end there is anything
        assert_eq!(compare(&[1.0, 2.0, 5.0, 6.0, 9.0, 9.0], &reference).beyond, 0);
        assert_eq!(compare(&[1.0, 6.0, 5.0, 2.0, 9.0, 9.0], &reference).beyond, 2);
    }

    #[test]
    fn what_nobody_left_is_said_to_be_absent() {
        let field = HeightField { size: UVec2::new(2, 2), cell_m: glam::DVec2::ONE, heights_m: vec![0.0; 4] };
        let ground = Arc::new(Samples::new(Arc::new(field), Surface::Triangles));
        let (all, products) = (Vec::new(), Products::default());
        let buffers = Buffers { all, products, scene_ground: ground, surface: Surface::Triangles, made_ground: None };
        assert_eq!(buffers.get("hieght").unwrap_err(), Absent("the buffer `hieght`".into()));
        let no_mesh = buffers.latest::<crate::plan::product::Mesh<ValuesId>>();
        assert!(no_mesh.is_err());
    }
}
