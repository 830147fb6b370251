use glam::{IVec2, UVec2};

use super::{LEAST, SketchMap};
use crate::frame::visible_ground;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};

impl Reference for SketchMap {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let lattice = frame.lattice();
        let is_finest = self.top(lattice) == 0 || frame.is_flat();
        let heights = buffers.get("height")?;
        let means = if is_finest { heights.clone() } else { buffers.get("height_mean")? };
        let (corner, level) = self.square(frame);
        let numbers = [corner.x, corner.y, level as i32, self.texels as i32].map(f64::from);
        buffers.put("sketch_square", Values::exact(&[4], 1, numbers.to_vec()));
        let layout = lattice.means();
        let mut map = Values::missing(&[self.texels; 2], 1);
        for (y, x) in (0..self.texels).flat_map(|y| (0..self.texels).map(move |x| (y, x))) {
            let node = (corner + IVec2::new(x as i32, y as i32)).max(IVec2::ZERO).as_uvec2();
            let at = (y * self.texels + x) as usize;
            if is_finest || level == 0 {
                // of a flat terrain every sample is a node
                let sample = (node << level).min(lattice.last());
                map.set(at, heights.value[(sample.y * lattice.size.x + sample.x) as usize], 0.0);
            } else {
                let node = node.min(layout.size(level) - UVec2::ONE);
                let from = layout.index(level, node.x, node.y);
                // copied as it is
                map.set(at, means.value[from], means.bound[from]);
            }
        }
        buffers.put("sketch_height", map);
        Ok(())
    }
}

impl SketchMap {
    /// The first node of the map, and the level of its nodes: the finest at which those in view are no more than the map has texels.
    fn square(&self, frame: &Frame) -> (IVec2, u32) {
        let lattice = frame.lattice();
        let (seen_low, seen_high) = visible_ground::samples(frame.data, frame.camera);
        let eye = lattice.sample_from_world(frame.camera.eye_m.truncate()).round().as_ivec2();
        let eye = eye.clamp(IVec2::splat(-(1 << 29)), IVec2::splat(1 << 29));
        let far = self.far(lattice);
        let room = (lattice.last().as_ivec2() - (LEAST - 1)).max(IVec2::ZERO);
        let low = seen_low.max(eye - far).clamp(IVec2::ZERO, room);
        let high = seen_high.min(eye + far).max(low + (LEAST - 1));
        let nodes = |level: i32| (high >> level) - (low >> level) + 1;
        let level = (0..31).find(|&level| nodes(level).max_element() <= self.texels as i32).unwrap_or(31);
        ((low >> level) - (IVec2::splat(self.texels as i32) - nodes(level)) / 2, level as u32)
    }
}
