use glam::{DVec2, IVec2, UVec2};

use super::{GeometryImage, Source};
use crate::plan::product::{Demand, Grid, Mesh, Wanted};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::heights::Heights;
use crate::stages::shared::octaves::{self, in_mesh};
use crate::stages::shared::rounding::EPSILON;
use crate::stages::shared::sketch::Square;

impl Reference for GeometryImage {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let points = buffers.find("grid_point").ok_or_else(|| Absent("the buffer `grid_point`".into()))?;
        let in_square = buffers.find("sketch_square").ok_or_else(|| Absent("the buffer `sketch_square`".into()))?;
        let square = buffers.values(in_square);
        let sketch = buffers.get("sketch_height")?;
        let source = match self.heights {
            Source::Atlas => HeightsOf::Atlas(Heights::new(frame, buffers, self.filter, self.max_level)?),
            Source::SketchMap => HeightsOf::Sketch(&sketch),
        };
        let square = Square::of(&square, sketch.dims[0]);
        let image = Image {
            places: &buffers.values(points),
            start: square.first.as_dvec2() - 0.5,
            side: square.side.into(),
            level: square.texel_level(),
            source,
            bias: self.bias,
        };
        let [rows, columns] = [image.places.dims[0], image.places.dims[1]];
        let mut vertices = Values::missing(&[rows, columns], 4);
        for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            let at = 4 * (y * columns + x) as usize;
            let vertex = image.vertex(frame, UVec2::new(x, y));
            vertex.into_iter().enumerate().for_each(|(part, (value, bound))| vertices.set(at + part, value, bound));
        }
        let vertex = buffers.put("vertex", vertices);
        buffers.offer(Mesh::Grid(Grid { vertex, cell_bound: None, promise: None }));
        let wanted = buffers.products().find(|wanted: &Wanted<_>| wanted.square == in_square);
        if let Some(Wanted { importance, .. }) = wanted {
            buffers.offer(Demand { importance, places: points, vertex, square: in_square });
        }
        Ok(())
    }
}

enum HeightsOf<'a> {
    Atlas(Heights),
    Sketch(&'a Values),
}

struct Image<'a> {
    places: &'a Values,
    /// Sample coordinates of the square's north-west corner, and samples along its sides.
    start: DVec2,
    side: f64,
    /// Of the texels of the sketch map, and its bound.
    level: (f64, f64),
    source: HeightsOf<'a>,
    bias: f64,
}

impl Image<'_> {
    /// Where a grid point is in the square, and how far it is from there.
    fn place(&self, at: UVec2) -> (DVec2, f64) {
        let first = 2 * (at.y * self.places.dims[1] + at.x) as usize;
        let off = self.places.bound[first].max(self.places.bound[first + 1]);
        (DVec2::new(self.places.value[first], self.places.value[first + 1]), off)
    }

    /// Value and bound of x, y, z and level.
    fn vertex(&self, frame: &Frame, at: UVec2) -> [(f64, f64); 4] {
        let (lattice, eye_m) = (frame.lattice(), frame.camera.eye_m);
        let (place, off_place) = self.place(at);
        let sample = self.start + place * self.side;
        let cells = sample - lattice.sample_from_world(eye_m.truncate());
        // the corner from the eye is a sum of three numbers, the way from it a product, and there is one more sum
        let corner = cells.abs().max_element() + self.side + 1.0;
        let off_cells = off_place * self.side + 6.0 * EPSILON * corner;
        let off_m = off_cells * lattice.cell_m.max_element();
        let here = lattice.world_from_sample(sample) - eye_m.truncate();
        let extent = self.extent(at);
        let [(height_m, off_height), level] = match &self.source {
            HeightsOf::Atlas(heights) => heights.at(sample, off_cells * lattice.cell_m.min_element(), extent),
            HeightsOf::Sketch(map) => {
                let (place, off_place) = self.place(at);
                [sketch_at(map, place, off_place), self.level]
            }
        };
        let [added, split] = in_mesh(frame, self.bias, (sample, off_cells), extent);
        let above_m = height_m + added.0 - eye_m.z;
        let off_z = off_height + added.1 + 4.0 * EPSILON * above_m.abs();
        [(here.x, off_m), (here.y, off_m), (above_m, off_z), octaves::level(level, split)]
    }

    /// How far the farthest neighbour is away, in cells, and the bound of that.
    fn extent(&self, at: UVec2) -> (f64, f64) {
        let (place, off_place) = self.place(at);
        let last = UVec2::new(self.places.dims[1], self.places.dims[0]) - 1;
        let neighbours = [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|(x, y)| {
            let there = (at.as_ivec2() + IVec2::new(x, y)).max(IVec2::ZERO).as_uvec2().min(last);
            let (there, off) = self.place(there);
            (there.distance(place), off + off_place)
        });
        let (reach, off) = neighbours.into_iter().fold((0.0f64, 0.0f64), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        // a difference of two places, its length
        let off = 1.5 * off + 4.0 * EPSILON + 8.0 * EPSILON * reach;
        (self.side * reach, self.side * off)
    }
}

/// Height between the texels of a sketch map, and its bound.
fn sketch_at(map: &Values, place: DVec2, off_place: f64) -> (f64, f64) {
    let texels = f64::from(map.dims[0]);
    let last = map.dims[0] - 1;
    let at = (place * texels - 0.5).clamp(DVec2::ZERO, DVec2::splat(f64::from(last)));
    let off = (off_place + 4.0 * EPSILON) * texels;
    let low = at.floor().as_uvec2();
    let height = |x: u32, y: u32| {
        let at = (y.min(last) * (last + 1) + x.min(last)) as usize;
        (map.value[at], map.bound[at])
    };
    let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| height(low.x + x, low.y + y));
    let w = at - low.as_dvec2();
    let between = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let value = between(between(four[0].0, four[1].0, w.x), between(four[2].0, four[3].0, w.x), w.y);
    // within `off` it meets the steepest slope around, neighbours included
    let reach = off.ceil() as u32 + 1;
    let near = (low.y.saturating_sub(reach)..=low.y + reach + 1)
        .flat_map(|y| (low.x.saturating_sub(reach)..=low.x + reach + 1).map(move |x| (x, y)))
        .map(|(x, y)| height(x, y));
    let (least, most, bound) = near.fold((f64::MAX, f64::MIN, 0.0f64), |(least, most, bound), (height, off)| {
        (least.min(height), most.max(height), bound.max(off))
    });
    let largest = least.abs().max(most.abs());
    (value, bound + 2.0 * (most - least) * off.min(1.0) + 8.0 * EPSILON * largest)
}
