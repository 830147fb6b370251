use glam::{DVec2, UVec2};

use super::DensityRatio;
use crate::plan::product::Demand;
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

/// The kernel divides by no less.
const LEAST: f64 = 1e-30;

impl Reference for DensityRatio {
    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let Demand { importance, places, vertex, .. } = buffers.latest()?;
        let [importance, places, vertex] = [importance, places, vertex].map(|id| buffers.values(id));
        let columns = places.dims[1];
        let cells = UVec2::new(columns, places.dims[0]) - 1;
        let mut ratios = Values::missing(&[cells.y, cells.x], 2);
        for (y, x) in (0..cells.y).flat_map(|y| (0..cells.x).map(move |x| (y, x))) {
            let corners = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| (y * columns + x) as usize);
            let [nw, ne, sw, se] = corners.map(|at| DVec2::new(vertex.value[4 * at], vertex.value[4 * at + 1]));
            let middle =
                corners.map(|at| DVec2::new(places.value[2 * at], places.value[2 * at + 1])).iter().sum::<DVec2>()
                    / 4.0;
            let off_places = corners.map(|at| places.bound[2 * at].max(places.bound[2 * at + 1]));
            let (wanted, off_wanted) = wanted_at(&importance, middle, most(off_places) + 4.0 * EPSILON);
            // two differences of places, their sum, and what they are off by themselves
            let largest = [nw, ne, sw, se].map(|at| at.abs().max_element());
            let off_m = 2.0 * most(corners.map(|at| vertex.bound[4 * at].max(vertex.bound[4 * at + 1])));
            let off_side = 1.5 * (off_m + 4.0 * EPSILON * most(largest));
            let sides = [0.5 * ((ne - nw) + (se - sw)), 0.5 * ((sw - nw) + (se - ne))];
            for (part, side) in sides.into_iter().enumerate() {
                let (length, at) = (side.length(), 2 * (y * cells.x + x) as usize + part);
                let points = length * wanted;
                let off = off_side * (wanted + off_wanted) + length * off_wanted + 8.0 * EPSILON * points;
                match (points + off < LEAST, points - off > LEAST) {
                    (true, _) => ratios.set(at, 1.0 / LEAST, 8.0 * EPSILON / LEAST),
                    (_, true) => {
                        ratios.set(at, 1.0 / points, 1.0 / (points - off) - 1.0 / points + 8.0 * EPSILON / points)
                    }
                    // what is next to nothing can be anything
                    _ => ratios.set(at, 1.0 / LEAST, f64::INFINITY),
                }
            }
        }
        buffers.put("density_ratio", ratios);
        Ok(())
    }
}

fn most(values: [f64; 4]) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

/// The importance between the middles of texels and its bound, at a place that is off by so much of the square.
fn wanted_at(importance: &Values, place: DVec2, off_place: f64) -> (f64, f64) {
    let last = importance.dims[0] - 1;
    let at = (place * f64::from(importance.dims[0]) - 0.5).clamp(DVec2::ZERO, DVec2::splat(last.into()));
    let (low, w) = (at.floor().as_uvec2(), at - at.floor());
    let texel = |x: u32, y: u32| {
        let at = ((low.y + y).min(last) * (last + 1) + (low.x + x).min(last)) as usize;
        let value = importance.value[at];
        (if value > 0.0 { value.min(3e38) } else { 0.0 }, importance.bound[at])
    };
    let four = [texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1)];
    let between = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let value = between(between(four[0].0, four[1].0, w.x), between(four[2].0, four[3].0, w.x), w.y);
    // within what the place is off, texels beside these four can be met
    let beside = (low.y.saturating_sub(1)..=(low.y + 2).min(last))
        .flat_map(|y| (low.x.saturating_sub(1)..=(low.x + 2).min(last)).map(move |x| (x, y)));
    let around = beside.map(|(x, y)| importance.value[(y * (last + 1) + x) as usize]);
    let (least, largest) = around.fold((f64::MAX, 0.0f64), |(least, most), value| (least.min(value), most.max(value)));
    let off = off_place * f64::from(importance.dims[0]);
    (value, most(four.map(|(_, bound)| bound)) + 2.0 * (largest - least) * off + 8.0 * EPSILON * largest)
}
