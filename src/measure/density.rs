//! How densely a grid has its points where they were asked for: what was obtained over what was demanded (Dachsbacher, Stamminger 2004,
//! section 3.3 and Fig. 6).

use glam::{DVec2, UVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::relaxation::relaxed;
use super::{Column, Figures, Info, Kind, Known, Measure, Measured, Picture, Seen, Show, Sums, Tally, read_as};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::kernel::Elem;
use crate::look::Colours;
use crate::plan::product::{Demand, Drawn, Warped};
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "Density",
    summary: "density of a grid's points over the importance that asked for it, along rows and down columns",
    version: 1,
    parameters: schema::<Density>,
    read: read_as::<Density>,
    figures: &[
        Known::new(
            "served_along",
            "of demand",
            Kind::Likeness,
            "share of the demand (points that were asked for) whose density along rows is 0.5 to 1 of it, with one factor for the whole grid",
        ),
        Known::new("served_down", "of demand", Kind::Likeness, "the same down columns"),
        Known::new("served", "of demand", Kind::Likeness, "mean of both"),
        Known::new(
            "served_vertices",
            "of cells",
            Kind::Other,
            "the same by cells instead of by demand, with a factor of its own: a uniform grid scores as well as a warped one",
        ),
        Known::new(
            "served_relaxed",
            "of demand",
            Kind::Other,
            "what a grid of springs reaches with the same importance",
        ),
        Known::new("gave_way", "of corners", Kind::Other, "share of the warp's corners that gave way to a fold"),
        Known::new(
            "kept_way",
            "of cells",
            Kind::Other,
            "share of the warp's cells that keep at least 0.9 of their way",
        ),
    ],
    columns: &[
        Column { heading: "served %", figure: "served", show: Show::Percent },
        Column { heading: "kept way %", figure: "kept_way", show: Show::Percent },
    ],
};

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Density {
    /// how often a grid of springs is relaxed over the importance, for comparison (Sloan et al. 1998); 0 is never
    #[schemars(range(min = 0, max = 100_000))]
    relaxations: u32,
}

impl Measure for Density {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        let demand: Option<Demand<BufferId>> = chain.products().latest();
        let Some(Demand { importance, places, vertex, .. }) = demand else {
            // of what was drawn without a demand there is nothing to say
            let drawn: Option<Drawn<BufferId>> = chain.products().latest();
            return drawn.map(|_| Vec::new()).ok_or_else(|| chain.missing::<Demand<BufferId>>());
        };
        chain.grid_size(vertex, Elem::Vec4F32)?;
        chain.check_own(importance)?;
        let mut needed = vec![importance, places, vertex];
        if let Some(Warped { gave_way, share }) = chain.products().latest() {
            needed.extend([gave_way, share]);
        }
        Ok(needed)
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Summary { relaxations: self.relaxations, ..Summary::default() })
    }
}

/// Means over the frames.
#[derive(Clone, Debug, Default)]
struct Summary {
    relaxations: u32,
    /// Sum and number of each figure.
    sums: Vec<(&'static str, &'static str, f64, usize)>,
    picture: Option<Picture>,
}

impl Summary {
    /// The figure of a frame; a frame in which nothing was asked for has none.
    fn note(&mut self, name: &'static str, unit: &'static str, value: Option<f64>) {
        self.sums.push((name, unit, value.unwrap_or(0.0), usize::from(value.is_some())));
    }
}

impl Sums for Summary {
    fn of_frame(&self, seen: &Seen) -> Self {
        let mut own = Self { relaxations: self.relaxations, ..Self::default() };
        let products = &seen.plan.products;
        let Some(demand): Option<Demand<BufferId>> = products.latest() else { return own };
        let importance = Importance::of(seen, demand.importance);
        let size = |id: BufferId| match seen.plan.buffer(id).dims[..] {
            [rows, columns] => UVec2::new(columns, rows),
            _ => UVec2::ZERO,
        };
        let grid = Grid {
            size: size(demand.vertex),
            at_m: seen
                .read::<[f32; 4]>(demand.vertex)
                .iter()
                .map(|&[x, y, ..]| DVec2::new(x.into(), y.into()))
                .collect(),
            places: seen.read::<[f32; 2]>(demand.places).iter().map(|&[x, y]| DVec2::new(x.into(), y.into())).collect(),
        };
        let cells = grid.cells(&importance);
        let factor = best_factor(&cells, |cell| cell.demand);
        let by_demand = served(&cells, factor, |cell| cell.demand);
        let by_cells = served(&cells, best_factor(&cells, |_| 1.0), |_| 1.0);
        own.note("served_along", "of demand", by_demand.map(|both| both[0]));
        own.note("served_down", "of demand", by_demand.map(|both| both[1]));
        own.note("served", "of demand", by_demand.map(mean));
        own.note("served_vertices", "of cells", by_cells.map(mean));
        if self.relaxations > 0 {
            let relaxed = relaxed(&grid, &importance, self.relaxations).cells(&importance);
            let by_demand = served(&relaxed, best_factor(&relaxed, |cell| cell.demand), |cell| cell.demand);
            own.note("served_relaxed", "of demand", by_demand.map(mean));
        }
        if let Some(Warped { gave_way, share }) = products.latest() {
            let (gave, kept) = kept(&seen.read(gave_way), size(gave_way), seen.read::<u32>(share)[3]);
            own.note("gave_way", "of corners", Some(gave));
            own.note("kept_way", "of cells", Some(kept));
        }
        own.picture = seen.is_pictured().then(|| picture(&cells, grid.size.x - 1, factor));
        own
    }

    fn add(&mut self, frame: Self) {
        for (name, unit, value, count) in frame.sums {
            match self.sums.iter_mut().find(|known| known.0 == name) {
                Some(known) => (known.2, known.3) = (known.2 + value, known.3 + count),
                None => self.sums.push((name, unit, value, count)),
            }
        }
        self.picture = frame.picture.or(self.picture.take());
    }

    fn measured(&self) -> Vec<Measured> {
        self.sums
            .iter()
            .map(|&(name, unit, sum, count)| Measured::new(name, (count > 0).then(|| sum / count as f64), unit))
            .collect()
    }

    fn figures(self) -> Figures {
        Figures { measured: self.measured(), pictures: self.picture.into_iter().collect(), warnings: Vec::new() }
    }
}

/// Grid points a metre that are wanted, over equal parts of the unit square.
pub struct Importance {
    size: UVec2,
    per_m: Vec<f32>,
}

impl Importance {
    fn of(seen: &Seen, id: BufferId) -> Self {
        let size = match seen.plan.buffer(id).dims[..] {
            [rows, columns] => UVec2::new(columns, rows),
            _ => UVec2::ONE,
        };
        // as `Warp` reads it: what is no number, or less than nothing, is nothing, and nothing is infinite
        let clean = |per_m: f32| if per_m > 0.0 { per_m.min(3e38) } else { 0.0 };
        Self { size, per_m: seen.read::<f32>(id).into_iter().map(clean).collect() }
    }

    /// Bilinear between the middles of parts.
    pub fn at(&self, place: DVec2) -> f64 {
        let last = self.size - 1;
        let at = (place * self.size.as_dvec2() - 0.5).clamp(DVec2::ZERO, last.as_dvec2());
        let low = at.floor().as_uvec2();
        let w = at - low.as_dvec2();
        let value = |x: u32, y: u32| {
            let at = (low + UVec2::new(x, y)).min(last);
            f64::from(self.per_m[(at.y * self.size.x + at.x) as usize])
        };
        let between = |a: f64, b: f64, w: f64| a + (b - a) * w;
        between(between(value(0, 0), value(1, 0), w.x), between(value(0, 1), value(1, 1), w.x), w.y)
    }
}

/// A grid over a square of ground.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Columns and rows of points.
    pub size: UVec2,
    /// Where the points are, in metres.
    pub at_m: Vec<DVec2>,
    /// Where they are in the square.
    pub places: Vec<DVec2>,
}

/// A cell of it.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Obtained over demanded density, along rows and down columns.
    ratio: [f64; 2],
    /// Points that were asked for in it.
    demand: f64,
}

impl Grid {
    pub fn index(&self, x: u32, y: u32) -> usize {
        (y * self.size.x + x) as usize
    }

    fn cells(&self, importance: &Importance) -> Vec<Cell> {
        let cells = (0..self.size.y - 1).flat_map(|y| (0..self.size.x - 1).map(move |x| (x, y)));
        let cell = |(x, y): (u32, u32)| {
            let corners = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| self.index(x, y));
            let [nw, ne, sw, se] = corners.map(|at| self.at_m[at]);
            let middle = corners.iter().map(|&at| self.places[at]).sum::<DVec2>() / 4.0;
            let wanted = importance.at(middle);
            let (along, down) = (0.5 * ((ne - nw) + (se - sw)), 0.5 * ((sw - nw) + (se - ne)));
            let ratio = [along, down].map(|side| 1.0 / (side.length() * wanted).max(1e-300));
            Cell { ratio, demand: wanted * wanted * along.perp_dot(down).abs() }
        };
        cells.map(cell).collect()
    }
}

/// The factor by which to multiply ratios so that the largest share of them, by weight, is in 0.5..=1.
fn best_factor(cells: &[Cell], weight: impl Fn(&Cell) -> f64) -> f64 {
    let mut ratios: Vec<(f64, f64)> =
        cells.iter().flat_map(|cell| cell.ratio.map(|ratio| (ratio, weight(cell)))).collect();
    ratios.retain(|(ratio, weight)| ratio.is_finite() && *weight > 0.0);
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut first, mut inside, mut best, mut factor) = (0, 0.0, 0.0, 1.0);
    for &(ratio, weight) in &ratios {
        inside += weight;
        while ratios[first].0 < 0.5 * ratio {
            inside -= ratios[first].1;
            first += 1;
        }
        if inside > best {
            (best, factor) = (inside, 1.0 / ratio);
        }
    }
    factor
}

fn mean([along, down]: [f64; 2]) -> f64 {
    0.5 * (along + down)
}

/// The shares, by weight, of ratios in 0.5..=1, along rows and down columns; none of nothing.
fn served(cells: &[Cell], factor: f64, weight: impl Fn(&Cell) -> f64) -> Option<[f64; 2]> {
    let all: f64 = cells.iter().map(&weight).sum();
    let shares = [0, 1].map(|way| {
        // the cell that the factor is from is in it, whatever the product is rounded to
        let is_served = |cell: &&Cell| (0.5 - 1e-12..=1.0 + 1e-12).contains(&(factor * cell.ratio[way]));
        cells.iter().filter(is_served).map(&weight).sum::<f64>() / all
    });
    (all > 0.0).then_some(shares)
}

/// The share of the map's corners that gave way, and the share of its cells that keep nine tenths of their way: none of their corners gave
/// way, and the warp as a whole goes so far.
fn kept(gave_way: &[u32], corners: UVec2, share: u32) -> (f64, f64) {
    let moved = gave_way.iter().filter(|times| **times > 0).count();
    let at = |x: u32, y: u32| gave_way[(y * corners.x + x) as usize] > 0;
    let cells = (0..corners.y - 1).flat_map(|y| (0..corners.x - 1).map(move |x| (x, y)));
    let (mut all, mut whole) = (0, 0);
    for (x, y) in cells {
        all += 1;
        whole += usize::from(!(at(x, y) || at(x + 1, y) || at(x, y + 1) || at(x + 1, y + 1)));
    }
    let goes_far = f32::from_bits(share) >= 0.9;
    (moved as f64 / gave_way.len() as f64, if goes_far { f64::from(whole as u32) / f64::from(all) } else { 0.0 })
}

/// A pixel for each cell, along rows at the left and down columns at the right: white in the middle of what is served, blue where there are
/// fewer points than asked for, red where there are more; from an eighth to four times the demand.
fn picture(cells: &[Cell], columns: u32, factor: f64) -> Picture {
    let colour = |ratio: f64| Colours::RedBlue.at((((factor * ratio).log2() + 0.5) / 5.0 + 0.5).clamp(0.0, 1.0));
    let rows = cells.chunks_exact(columns as usize);
    let both = rows.flat_map(|row| [0, 1].map(|way| row.iter().map(move |cell| colour(cell.ratio[way]))));
    Picture { kind: "density", width: 2 * columns, rgb: both.flatten().flatten().collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 100 m with `side` x `side` points.
    fn uniform(side: u32) -> Grid {
        let size = UVec2::splat(side);
        let place = |at: u32| DVec2::new((at % side).into(), (at / side).into()) / f64::from(side - 1);
        let places: Vec<DVec2> = (0..side * side).map(place).collect();
        Grid { size, at_m: places.iter().map(|place| *place * 100.0).collect(), places }
    }

    fn importance(of: impl Fn(f64, f64) -> f64) -> Importance {
        let middle = |at: u32| (f64::from(at) + 0.5) / 32.0;
        let per_m = (0..32 * 32).map(|at| of(middle(at % 32), middle(at / 32)) as f32).collect();
        Importance { size: UVec2::splat(32), per_m }
    }

    #[test]
    fn a_uniform_grid_serves_a_uniform_demand_whatever_its_size() {
        for wanted in [1e-3, 1.0, 1e3] {
            let cells = uniform(9).cells(&importance(|_, _| wanted));
            let factor = best_factor(&cells, |cell| cell.demand);
            assert_eq!(served(&cells, factor, |cell| cell.demand), Some([1.0, 1.0]));
        }
    }

    /// Half of the square wants four times the density: a uniform grid serves the half that wants more, which is 16 of 17 parts of the
    /// demand, and half of its cells.
    #[test]
    fn demand_counts_and_not_cells() {
        let cells = uniform(33).cells(&importance(|x, _| if x < 0.5 { 4.0 } else { 1.0 }));
        let by_demand = served(&cells, best_factor(&cells, |cell| cell.demand), |cell| cell.demand);
        let by_cells = served(&cells, best_factor(&cells, |_| 1.0), |_| 1.0);
        let (by_demand, by_cells) = (by_demand.unwrap(), by_cells.unwrap());
        assert!((by_demand[0] - 16.0 / 17.0).abs() < 0.03, "{by_demand:?}");
        assert!((by_cells[0] - 0.5).abs() < 0.04, "{by_cells:?}");
    }

    #[test]
    fn nothing_is_served_where_nothing_is_asked_for() {
        let cells = uniform(9).cells(&importance(|_, _| 0.0));
        assert_eq!(served(&cells, best_factor(&cells, |cell| cell.demand), |cell| cell.demand), None);
    }

    #[test]
    fn springs_serve_what_a_uniform_grid_does_not() {
        let wanted = importance(|x, y| 1.0 / (0.02 + x + 0.1 * y));
        let share = |grid: &Grid| {
            let cells = grid.cells(&wanted);
            served(&cells, best_factor(&cells, |cell| cell.demand), |cell| cell.demand).unwrap()[0]
        };
        let (before, after) = (share(&uniform(17)), share(&relaxed(&uniform(17), &wanted, 2000)));
        assert!(after > 0.9 && before < 0.7, "{before} {after}");
    }

    #[test]
    fn a_cell_keeps_its_way_if_no_corner_of_it_gives_way() {
        let mut gave_way = vec![0; 16];
        gave_way[0] = 3;
        assert_eq!(kept(&gave_way, UVec2::splat(4), 1.0f32.to_bits()), (1.0 / 16.0, 8.0 / 9.0));
        assert_eq!(kept(&gave_way, UVec2::splat(4), 0.5f32.to_bits()), (1.0 / 16.0, 0.0));
    }
}
