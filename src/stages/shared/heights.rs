//! Heights from the mean pyramid, at the level that fits a cell's extent (`kernels/lib/means.wgsl`).

use std::sync::Arc;

use glam::{DVec2, UVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rounding::EPSILON;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::ground::cell::Cell;
use crate::ground::pyramid::Layout;
use crate::kernel::Elem;
use crate::plan::{BufferId, Chain, StepBuilder};
use crate::reference::{Absent, Buffers, Frame, Values};

/// How heights are taken from the mean pyramid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
pub enum Filter {
    /// blends two levels
    #[default]
    Trilinear,
    /// takes the finer of two levels
    Bilinear,
    /// takes the surface itself, and no pyramid
    Finest,
}

impl Filter {
    /// On a flat terrain every level holds the same height.
    fn is_finest(self, is_flat: bool) -> bool {
        self == Filter::Finest || is_flat
    }
}

/// The coarsest level that is sampled, of those that were `made`.
fn top(max_level: Option<u32>, made: u32) -> u32 {
    max_level.unwrap_or(made).min(made)
}

/// What a step binds and sets to take heights.
pub struct Means {
    pyramid: Option<BufferId>,
    blend: bool,
    max_level: u32,
}

impl Means {
    pub fn find(chain: &mut Chain, filter: Filter, max_level: Option<u32>) -> Result<Self, Diagnostic> {
        let layout = chain.lattice().means();
        let pyramid = match filter.is_finest(chain.is_flat()) {
            true => None,
            false => Some(chain.read_of_ground("height_mean", Elem::F32, &layout.dims())?),
        };
        if chain.is_flat() && filter != Filter::Finest {
            chain.leave_out("the mean pyramid", "the terrain is flat, every level is the same", 0, 0);
        }
        let made = pyramid.and_then(|means| chain.buffer(means).top_level).unwrap_or(layout.top);
        Ok(Self { pyramid, blend: filter == Filter::Trilinear, max_level: top(max_level, made) })
    }

    /// The coarsest level of the pyramid, if one is needed.
    pub fn top_level(&self, chain: &Chain) -> Option<u32> {
        self.pyramid.and_then(|means| chain.buffer(means).top_level)
    }

    pub fn bind<'c, 'a>(&self, step: StepBuilder<'c, 'a>) -> StepBuilder<'c, 'a> {
        step.bind_or_leave("height_mean", self.pyramid)
            .constant("FINEST", f64::from(self.pyramid.is_none()))
            .constant("BLEND", f64::from(self.blend))
            .set("max_level", self.max_level)
    }
}

/// The surface and, above it, bilinear sampling of the mean pyramid, in f64.
pub struct Heights {
    height: Arc<Values>,
    means: Arc<Values>,
    size: UVec2,
    cell_m: DVec2,
    layout: Layout,
    /// The coarsest level that is sampled.
    top: u32,
    range_m: (f64, f64),
    surface: Surface,
    filter: Filter,
    finest: bool,
}

impl Heights {
    pub fn new(frame: &Frame, buffers: &Buffers, filter: Filter, max_level: Option<u32>) -> Result<Self, Absent> {
        let height = buffers.get("height")?;
        let finest = filter.is_finest(frame.is_flat());
        let means = if finest { height.clone() } else { buffers.get("height_mean")? };
        let lattice = frame.lattice();
        let layout = lattice.means();
        let is_made = |level: &u32| means.value.get(layout.index(*level, 0, 0)).is_some_and(|mean| !mean.is_nan());
        let made = (1..=layout.top).take_while(is_made).last().unwrap_or(0);
        let (size, cell_m) = (lattice.size, lattice.cell_m);
        let (range_m, surface) = (frame.ground.range_m(), frame.data.scene.surface);
        Ok(Self { height, means, size, cell_m, layout, top: top(max_level, made), range_m, surface, filter, finest })
    }

    /// Height and level, each with its bound, at sample coordinates that are off by `off_m` at most, for a vertex whose farthest neighbour is
    /// `extent` cells away, give or take `off_extent`.
    pub fn at(&self, sample: DVec2, off_m: f64, (extent, off_extent): (f64, f64)) -> [(f64, f64); 2] {
        let last = (self.size - UVec2::ONE).as_dvec2();
        let sample = sample.clamp(DVec2::ZERO, last);
        let off_cells = off_m / self.cell_m.min_element() + 8.0 * EPSILON * last.max_element();
        if self.finest {
            return [self.height(0, sample, off_cells), (0.0, 0.0)];
        }
        // (nothing times infinity is no number)
        let off_extent = off_extent.min(1e30);
        let level = extent.max(1.0).log2().clamp(0.0, f64::from(self.top));
        // d log2(e) = de / (e ln 2); Vulkan allows log2 an absolute error of 2^-21 near 1 and 3 ulp elsewhere
        let off_level = off_extent / (extent.max(1.0) * std::f64::consts::LN_2) + 5e-7 + 8.0 * EPSILON * level;
        let finer = level.floor();
        let (fine_m, fine_off) = self.height(finer as u32, sample, off_cells);
        let (coarse_m, coarse_off) = self.height((finer as u32 + 1).min(self.top), sample, off_cells);
        let found = match self.filter {
            Filter::Trilinear => {
                // across a whole level the blend goes on where the one before ended: the difference to the next is enough
                let off_by_level = match off_level <= 1.0 {
                    true => off_level * self.step_m(finer as u32, sample, off_cells),
                    false => self.range_m.1 - self.range_m.0,
                };
                (fine_m + (coarse_m - fine_m) * (level - finer), fine_off.max(coarse_off) + off_by_level)
            }
            // the level jumps at whole numbers
            _ if (level - level.round()).abs() <= off_level && extent > 1.0 - off_extent => (fine_m, f64::INFINITY),
            _ => (fine_m, fine_off),
        };
        [found, (level, off_level)]
    }

    fn node(&self, level: u32, x: f64, y: f64) -> f64 {
        let last = if level == 0 { self.size - 1 } else { self.layout.size(level) - 1 };
        let x = x.clamp(0.0, f64::from(last.x)) as u32;
        let y = y.clamp(0.0, f64::from(last.y)) as u32;
        match level {
            0 => self.height.value[(y * self.size.x + x) as usize],
            _ => self.means.value[self.layout.index(level, x, y)],
        }
    }

    /// Height and its bound for a sample position that is known to `off` cells.
    fn height(&self, level: u32, sample: DVec2, off: f64) -> (f64, f64) {
        let side = f64::from(1u32 << level);
        let place = (sample - (side - 1.0) / 2.0) / side;
        let low = place.floor();
        let w = place - low;
        let node = |dx: f64, dy: f64| self.node(level, low.x + dx, low.y + dy);
        let (nw, ne, sw, se) = (node(0.0, 0.0), node(1.0, 0.0), node(0.0, 1.0), node(1.0, 1.0));
        let surface = if level == 0 { self.surface } else { Surface::Bilinear };
        let height = Cell { nw, ne, sw, se }.surface_m(w, surface);
        // a place that is off by `off` meets the steepest slope around, neighbours of the cell included
        let around = (-1..=2).flat_map(|dy| (-1..=2).map(move |dx| (f64::from(dx), f64::from(dy))));
        let heights = around.map(|(dx, dy)| node(dx, dy));
        let (lowest, highest) = heights.fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h)));
        let largest = self.range_m.0.abs().max(self.range_m.1.abs());
        // means are themselves rounded: six operations a level
        let rounding = (12.0 + 6.0 * f64::from(level)) * EPSILON * largest;
        // and a place that may be among other cells can have any height
        let reach_m = match off <= side {
            true => 2.0 * (highest - lowest) * off / side,
            false => self.range_m.1 - self.range_m.0,
        };
        (height, reach_m + rounding)
    }

    /// Largest height difference between neighbouring levels around `level`.
    fn step_m(&self, level: u32, sample: DVec2, off: f64) -> f64 {
        let at = |level: u32| self.height(level.min(self.top), sample, off).0;
        let middle = at(level);
        let next = at(level + 1);
        (middle - next).abs().max((at(level.saturating_sub(1)) - middle).abs()).max((at(level + 2) - next).abs())
    }
}
