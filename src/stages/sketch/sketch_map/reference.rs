use glam::{IVec2, UVec2};

use super::{LEAST, STEPS, SketchMap};
use crate::frame::visible_ground;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::heights::{Filter, Heights};
use crate::stages::shared::rounding::EPSILON;
use crate::stages::shared::sketch::Square;

impl Reference for SketchMap {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let view = View::of(self, frame);
        let square = match self.blend() {
            0 => view.square(),
            blend => view.blended(view.square(), blend),
        };
        let map = match square.is_of_nodes() {
            true => self.nodes(square, frame, buffers)?,
            false => between_nodes(square, frame, buffers)?,
        };
        buffers.put("sketch_square", square.values());
        buffers.put("sketch_height", map);
        Ok(())
    }
}

impl SketchMap {
    /// Heights of whole nodes, copied as they are.
    fn nodes(&self, square: Square, frame: &Frame, buffers: &Buffers) -> Result<Values, Absent> {
        let (lattice, level) = (frame.lattice(), square.level);
        let is_finest = self.top(lattice) == 0 || frame.is_flat() || level == 0;
        let (heights, layout) = (buffers.get("height")?, lattice.means());
        let means = if is_finest { heights.clone() } else { buffers.get("height_mean")? };
        let corner = square.first >> level as i32;
        let mut map = Values::missing(&[self.texels; 2], 1);
        for (y, x) in (0..self.texels).flat_map(|y| (0..self.texels).map(move |x| (y, x))) {
            let node = (corner + IVec2::new(x as i32, y as i32)).max(IVec2::ZERO).as_uvec2();
            let at = (y * self.texels + x) as usize;
            if is_finest {
                // of a flat terrain every sample is a node
                let sample = (node << level).min(lattice.last());
                map.set(at, heights.value[(sample.y * lattice.size.x + sample.x) as usize], 0.0);
            } else {
                let node = node.min(layout.size(level) - UVec2::ONE);
                let from = layout.index(level, node.x, node.y);
                map.set(at, means.value[from], means.bound[from]);
            }
        }
        Ok(map)
    }
}

/// Heights between nodes of the level and of the finer one.
fn between_nodes(square: Square, frame: &Frame, buffers: &Buffers) -> Result<Values, Absent> {
    let heights = Heights::new(frame, buffers, Filter::default(), None)?;
    let (lattice, samples) = (frame.lattice(), square.texel_samples());
    let eye = lattice.sample_from_world(frame.camera.eye_m.truncate());
    let mut map = Values::missing(&[square.texels; 2], 1);
    for (y, x) in (0..square.texels).flat_map(|y| (0..square.texels).map(move |x| (y, x))) {
        let middle = square.middle(IVec2::new(x as i32, y as i32));
        // the way of whole cells, half a texel by two operations and a division, their sum and one more
        let off_cells = EPSILON * (4.0 * (middle - eye).abs().max_element() + 8.0 * (samples + 1.0));
        let off_m = off_cells * lattice.cell_m.min_element();
        let [(height_m, off_height), _] = heights.at(middle, off_m, (samples, 8.0 * EPSILON * samples));
        map.set((y * square.texels + x) as usize, height_m, off_height);
    }
    Ok(map)
}

/// The first and the last sample that a map of so many texels has to hold.
struct View {
    low: IVec2,
    high: IVec2,
    texels: i32,
}

impl View {
    fn of(map: &SketchMap, frame: &Frame) -> Self {
        let lattice = frame.lattice();
        let (seen_low, seen_high) = visible_ground::samples(frame.data, frame.camera);
        let eye = lattice.sample_from_world(frame.camera.eye_m.truncate()).round().as_ivec2();
        let eye = eye.clamp(IVec2::splat(-(1 << 29)), IVec2::splat(1 << 29));
        let far = map.far(lattice);
        let room = (lattice.last().as_ivec2() - (LEAST - 1)).max(IVec2::ZERO);
        let low = seen_low.max(eye - far).clamp(IVec2::ZERO, room);
        Self { low, high: seen_high.min(eye + far).max(low + (LEAST - 1)), texels: map.texels as i32 }
    }

    fn nodes(&self, level: u32) -> IVec2 {
        (self.high >> level as i32) - (self.low >> level as i32) + 1
    }

    /// The first sample of a map of a level, with the view in its middle.
    fn first(&self, level: u32) -> IVec2 {
        let corner = (self.low >> level as i32) - (IVec2::splat(self.texels) - self.nodes(level)) / 2;
        corner << level as i32
    }

    /// The map of the finest level whose nodes in view are no more than it has texels.
    fn square(&self) -> Square {
        let level = (0..31).find(|&level| self.nodes(level).max_element() <= self.texels).unwrap_or(31);
        Square { first: self.first(level), side: self.texels << level, level, texels: self.texels as u32 }
    }

    /// From the map of the finer level to that of its own, as the view grows.
    fn blended(&self, whole: Square, blend: i32) -> Square {
        if whole.level == 0 {
            return whole;
        }
        let half = whole.side / 2;
        let needed = (self.high - self.low + 1).max_element();
        let side = (half + (needed - half) * STEPS / blend).clamp(half.max(needed), whole.side);
        let finer = self.first(whole.level - 1);
        let first = finer + (whole.first - finer) * ((side - half) * STEPS / half) / STEPS;
        Square { first: first.clamp(self.high + 1 - side, self.low), side, ..whole }
    }
}
