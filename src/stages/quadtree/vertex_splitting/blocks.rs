//! Vertex splitting in f64, round by round as the paper has it, and whether rounding could have turned a decision.

use glam::{DVec3, UVec2};

use super::VertexSplitting;
use crate::frame::view::sides;
use crate::ground::pyramid::Layout;
use crate::reference::{Frame, Values};

/// The quadtree in f64.
pub(super) struct Quadtree<'a> {
    pub frame: &'a Frame<'a>,
    pub layout: Layout,
    pub low: &'a Values,
    pub high: &'a Values,
    pub roughness: &'a Values,
    pub stage: &'a VertexSplitting,
    pub proven: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Culled,
    Leaf,
    Split,
}

#[derive(Default)]
pub(super) struct Found {
    pub leaves: Vec<(u32, UVec2)>,
    /// Places of the blocks that are split.
    pub split: Vec<usize>,
    /// No decision was so near that rounding could turn it.
    pub is_sure: bool,
}

impl Quadtree<'_> {
    /// Round by round, as the paper has it.
    pub fn split_all(&self) -> Found {
        let mut found = Found { is_sure: true, ..Found::default() };
        let mut live = vec![(self.layout.top, UVec2::ZERO)];
        for round in 0..self.layout.top {
            let mut next = Vec::new();
            for (level, at) in std::mem::take(&mut live) {
                let (fate, is_sure) = self.fate(level, at);
                found.is_sure &= is_sure;
                match fate {
                    Fate::Culled => {}
                    Fate::Leaf if !self.stage.carry_flag && round + 1 < self.layout.top => next.push((level, at)),
                    Fate::Leaf => found.leaves.push((level, at)),
                    Fate::Split => {
                        found.split.push(self.layout.index(level, at.x, at.y));
                        let children = children(self.layout, level, at);
                        if level == 1 { found.leaves.extend(children) } else { next.extend(children) }
                    }
                }
            }
            live = next;
        }
        found
    }

    /// What becomes of a block, and whether rounding could not turn that.
    fn fate(&self, level: u32, at: UVec2) -> (Fate, bool) {
        let index = self.layout.index(level, at.x, at.y);
        let (low, high) = self.extent(level, at, index);
        let mut is_sure = true;
        let mut decide = |value: f64, scale: f64| {
            is_sure &= value.abs() > 1e-5 * scale;
            value >= 0.0
        };
        let mut visible = true;
        if self.stage.cull {
            for normal in sides(self.frame.camera).into_iter().chain([self.frame.camera.forward()]) {
                let far = (normal * low).max(normal * high);
                visible &= decide(far.element_sum(), far.abs().element_sum());
            }
        }
        if !visible {
            return (Fate::Culled, is_sure);
        }
        let (rise_m, off_m) = (self.roughness.value[index], self.roughness.bound[index]);
        if rise_m <= off_m {
            // as good as flat; whether it is exactly that is the kernel's rounding
            return (Fate::Leaf, is_sure && rise_m == 0.0 && off_m == 0.0);
        }
        let (excess, scale) = match self.proven {
            true => self.proven_excess(low, high, rise_m, off_m),
            false => self.paper_excess(level, at, low, high, rise_m, off_m),
        };
        (if decide(excess, scale) { Fate::Split } else { Fate::Leaf }, is_sure)
    }

    /// A block's box relative to the eye.
    fn extent(&self, level: u32, at: UVec2, index: usize) -> (DVec3, DVec3) {
        let terrain = self.frame.lattice();
        let last = terrain.last();
        let (nw, se) = (at << level, ((at + 1) << level).min(last));
        let world = |sample: UVec2| terrain.world_from_sample(sample.as_dvec2());
        let (a, b) = (world(nw), world(se));
        let eye_m = self.frame.camera.eye_m;
        let low = DVec3::new(a.x, b.y, self.low.value[index]) - eye_m;
        let high = DVec3::new(b.x, a.y, self.high.value[index]) - eye_m;
        (low, high)
    }

    /// Eq. 2 as a number that is at least 0 where the block is split, and what to measure it by.
    fn paper_excess(&self, level: u32, at: UVec2, low: DVec3, high: DVec3, rise_m: f64, off_m: f64) -> (f64, f64) {
        let camera = self.frame.camera;
        let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0);
        let inside = half.length_squared() - centre.length_squared();
        if inside > 0.0 {
            return (inside, half.length_squared());
        }
        let terrain = self.frame.lattice();
        let last = terrain.last();
        let nw = at << level;
        let (mid, se) = ((nw + (1 << level) / 2).min(last), (nw + (1 << level)).min(last));
        let points =
            [mid, UVec2::new(mid.x, nw.y), UVec2::new(mid.x, se.y), UVec2::new(nw.x, mid.y), UVec2::new(se.x, mid.y)];
        let off = |sample: UVec2| {
            let point = self.frame.ground.sample_m(sample) - camera.eye_m;
            let view = |point: DVec3| camera.world_from_view.transpose() * point;
            let (a, b) = (view(point), view(point + DVec3::Z * rise_m));
            let error_px = camera.focal_px() * (a.truncate() / a.z - b.truncate() / b.z).length();
            // seen from the side, depth loses its digits
            let steep = 1.0 + point.length() / a.z.abs() + point.length() / b.z.abs();
            (error_px, error_px * (steep + off_m / rise_m * 1e5))
        };
        let all = points.map(off);
        let most = all.iter().map(|(error, _)| *error).fold(0.0, f64::max);
        let scale = all.iter().map(|(_, scale)| *scale).fold(0.0, f64::max);
        let near_sphere = if -inside < 1e-5 * half.length_squared() { f64::INFINITY } else { 0.0 };
        (most - self.stage.threshold_px, scale + self.stage.threshold_px * f64::from(most > 0.0) + near_sphere)
    }

    /// The same for the bound.
    fn proven_excess(&self, low: DVec3, high: DVec3, rise_m: f64, off_m: f64) -> (f64, f64) {
        let camera = self.frame.camera;
        let forward = camera.forward();
        let near = (forward * low).min(forward * high);
        let beside = low.max(-high).max(DVec3::ZERO).length();
        let depth = near.element_sum().max(beside / camera.most_of(|ray| ray.length()));
        let room = depth - rise_m * forward.z.abs();
        let tilt = camera.most_of(|ray| (ray * forward.z - DVec3::Z).length());
        let told_px = self.stage.promise(true).told_px(self.frame.data);
        let allowed_px = (told_px - SLACK_PX).max(0.5 * told_px);
        let moved = camera.focal_px() * tilt;
        // the kernel's depth is a hundred-thousandth short of this one
        let scale = (moved * rise_m + allowed_px * (near.abs().element_sum() + beside + rise_m)) * 3.0;
        (moved * rise_m - allowed_px * room, scale + 1e5 * off_m * (moved + allowed_px))
    }
}

/// `SLACK_PX` of the kernel.
const SLACK_PX: f64 = 0.02;

/// Blocks below a block that are on the terrain; under the finest, its cells.
fn children(layout: Layout, level: u32, at: UVec2) -> impl Iterator<Item = (u32, UVec2)> {
    let below = if level == 1 { layout.base } else { layout.size(level - 1) };
    let all = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| at * 2 + UVec2::new(x, y));
    all.into_iter().filter(move |child| child.cmplt(below).all()).map(move |child| (level - 1, child))
}
