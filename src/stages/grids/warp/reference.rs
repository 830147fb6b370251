use glam::{DVec2, UVec2};

use super::{RELAXATIONS, Warp};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::stages::shared::rounding::EPSILON;

impl Reference for Warp {
    fn reference(&self, _frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let importance = Map::of(buffers.get("importance")?.as_ref());
        let mut map = importance.identity();
        let mut last = None;
        let corners = [importance.size.y + 1, importance.size.x + 1];
        let mut gave_way = Values::exact(&corners, 1, vec![0.0; (corners[0] * corners[1]) as usize]);
        let mut spreads: Vec<(f64, f64)> = Vec::new();
        let mut is_open = false;
        // there were folds, or there may have been
        let mut folds = (false, false);
        for round in 0..self.rounds {
            let missing = (round > 0).then(|| importance.missing(&map));
            let [along, down] = missing.as_ref().map_or([&importance; 2], |missing| missing.each_ref());
            if round > 0 && self.least_gain > 0.0 {
                let (spread, off) = spread(along, down);
                let (needed, is_known) = self.is_needed((spread, off), spreads.last().copied());
                spreads.push((spread, off));
                is_open |= !is_known;
                if !needed {
                    // no line is walked
                    last = None;
                    continue;
                }
            }
            let rows = self.lines((0..along.size.y).map(|row| along.row(row)).collect());
            let columns = self.lines((0..down.size.x).map(|column| down.warped_column(column, &rows)).collect());
            let before = (map, gave_way.clone());
            map = before.0.composed(&rows, &columns);
            for _ in 0..RELAXATIONS {
                map = map.relaxed(&mut gave_way);
            }
            folds.0 |= gave_way.value.iter().any(|&times| times > 0.0);
            folds.1 |= gave_way.bound.iter().any(|&times| times > 0.0);
            if round > 0 {
                map.taken_back_if_folded(&mut gave_way, before);
            }
            last = Some((rows, columns));
        }
        let points = buffers.get("grid_point")?;
        let share = map.of_points(&points).share(folds);
        let mut warped = Values::missing(&points.dims, 2);
        for at in (0..points.value.len()).step_by(2) {
            let place = DVec2::new(points.value[at], points.value[at + 1]);
            let (goal, off) = map.at(place);
            let off = off + 8.0 * EPSILON + map.steepest() * points.bound[at].max(points.bound[at + 1]);
            let there = place + (goal - place) * share.0;
            warped.set(at, there.x, off + share.1 * (goal.x - place.x).abs());
            warped.set(at + 1, there.y, off + share.1 * (goal.y - place.y).abs());
        }
        let mut made = vec![("warp_map", map.values()), ("warp_gave_way", gave_way), ("grid_point", warped)];
        if let Some((rows, columns)) = &last {
            made.extend([("warp_rows", lines(rows)), ("warp_columns", lines(columns))]);
        } else {
            let missing = |lines: u32, borders: u32| Values::missing(&[lines, borders + 1], 1);
            let size = importance.size;
            made.extend([("warp_rows", missing(size.y, size.x)), ("warp_columns", missing(size.x, size.y))]);
        }
        if !spreads.is_empty() {
            let mut residual = Values::missing(&[spreads.len() as u32], 1);
            spreads.iter().enumerate().for_each(|(at, &(spread, off))| residual.set(at, spread, off));
            made.push(("warp_residual", residual));
        }
        for (name, mut values) in made {
            if is_open {
                values.bound.fill(f64::INFINITY);
            }
            buffers.put(name, values);
        }
        Ok(())
    }
}

impl Warp {
    /// The warps of lines of weights, each led by those beside it.
    fn lines(&self, weights: Vec<Vec<(f64, f64)>>) -> Vec<Line> {
        let lines: Vec<Line> = weights.iter().map(|weights| self.line(weights)).collect();
        if self.lead == 0.0 {
            return lines;
        }
        let decay = f64::from(self.decay(lines.len() as u32));
        let leads = leads(&weights);
        let led = |at: usize| {
            // how much each line leads this one, and by which share rounding may change that: a product a line on the way, and its sum
            let away = |line: usize| at.abs_diff(line) as i32;
            let of_line = |(line, lead): (usize, &(f64, f64))| {
                (lead.0 * decay.powi(away(line)), lead.1 + f64::from(3 * away(line) + 8) * EPSILON)
            };
            let shares: Vec<(f64, f64)> = leads.iter().enumerate().map(of_line).collect();
            let all: f64 = shares.iter().map(|(share, _)| *share).sum();
            let border = |i: usize| {
                let last = lines[at].places.len() - 1;
                if i == 0 || i == last {
                    return lines[at].places[i];
                }
                let of = |line: &Line| line.places[i];
                let mean = lines.iter().zip(&shares).map(|(line, (share, _))| of(line).0 * share / all).sum::<f64>();
                let off = |(line, (share, off)): (&Line, &(f64, f64))| {
                    share / all * (of(line).1 + off * (of(line).0 - mean).abs())
                };
                // twice, since shares are off together with their sum; and everything is between 0 and 1
                (mean, (2.0 * lines.iter().zip(&shares).map(off).sum::<f64>() + 8.0 * EPSILON).min(1.0))
            };
            Line { places: (0..lines[at].places.len()).map(border).collect() }
        };
        (0..lines.len()).map(led).collect()
    }

    /// Whether a round is needed, with what is missing spread by so much, and before the last round by so much; and whether rounding cannot
    /// change the answer.
    fn is_needed(&self, (spread, off): (f64, f64), before: Option<(f64, f64)>) -> (bool, bool) {
        let keep = 1.0 - self.least_gain;
        let (limit, off_limit) = before.map_or((f64::INFINITY, 0.0), |(before, off)| (keep * before, keep * off));
        let off = off + 4.0 * EPSILON * spread;
        let is_not = spread + off < LEAST_SPREAD || spread - off > limit + off_limit;
        let is_surely = spread - off > LEAST_SPREAD && spread + off < limit - off_limit;
        (spread >= LEAST_SPREAD && spread <= limit, is_not || is_surely)
    }

    /// The warp of one line of weights (value, bound).
    fn line(&self, weights: &[(f64, f64)]) -> Line {
        let share = self.uniform_share;
        let sum = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>();
        let total = sum(&mut weights.iter().map(|(weight, _)| *weight));
        let count = weights.len();
        let even = |i: usize| i as f64 / count as f64;
        if total == 0.0 {
            return Line { places: (0..=count).map(|i| (even(i), 2.0 * EPSILON)).collect() };
        }
        let mean = total / count as f64;
        let mixed: Vec<f64> = weights.iter().map(|(weight, _)| weight + (mean - weight) * share).collect();
        let mut sums = vec![0.0];
        mixed.iter().for_each(|weight| sums.push(sums[sums.len() - 1] + weight));
        // the weights' own bounds; then what f32 does to the total, to each share of it and to each sum: the sums are
        // compensated, so it does not grow with their number, but each weight has been divided by the largest one and mixed
        let off = sum(&mut weights.iter().map(|(_, bound)| *bound)) + 16.0 * EPSILON * total;
        let place = |wanted: f64| {
            let wanted = wanted.clamp(0.0, total);
            let k = sums[1..].partition_point(|&sum| sum < wanted).min(count - 1);
            let part = if mixed[k] > 0.0 { ((wanted - sums[k]) / mixed[k]).clamp(0.0, 1.0) } else { 0.0 };
            (k as f64 + part) / count as f64
        };
        let place_and_bound = |i: usize| {
            if i == 0 || i == count {
                return (even(i), 0.0);
            }
            let wanted = total * even(i);
            let (low, high) = (place(wanted - off), place(wanted + off));
            let here = place(wanted).clamp(low, high);
            (here, (here - low).max(high - here) + 8.0 * EPSILON)
        };
        Line { places: (0..=count).map(place_and_bound).collect() }
    }
}

/// What is spread by less than this, in octaves, is left as it is; `LEAST_SPREAD` of the kernel.
const LEAST_SPREAD: f64 = 0.1;

/// A number of a cell, from what is missing along and down it, each with its bound.
type OfCell<'a> = &'a dyn Fn(&(f64, f64), &(f64, f64)) -> f64;

/// By how much what is missing is spread, in octaves: the root of the variances of its logarithms along rows and down columns, weighted by
/// demand; and the bound of that.
fn spread(along: &Map, down: &Map) -> (f64, f64) {
    let cells = || along.weights.iter().zip(&down.weights).filter(|(along, down)| along.0 > 0.0 && down.0 > 0.0);
    let largest = cells().map(|(along, down)| along.0.max(down.0)).fold(1e-37, f64::max);
    let demand = |along: &(f64, f64), down: &(f64, f64)| along.0 / largest * (down.0 / largest);
    let all: f64 = cells().map(|(along, down)| demand(along, down)).sum();
    if all == 0.0 {
        return (0.0, 0.0);
    }
    let mean = |of: OfCell| cells().map(|(along, down)| of(along, down) * demand(along, down)).sum::<f64>() / all;
    let means = [mean(&|along, _| along.0.log2()), mean(&|_, down| down.0.log2())];
    let variance = mean(&|along, down| (along.0.log2() - means[0]).powi(2) + (down.0.log2() - means[1]).powi(2));
    // what either is off by shifts its logarithm and its demand; sums in f32 lose a rounding a term, of squares that are as large as these are
    // from the largest (nothing times infinity would be no number)
    let relative = |(value, bound): &(f64, f64)| (bound / value).min(1e30);
    let from = largest.log2();
    let squares = mean(&|along, down| (along.0.log2() - from).powi(2) + (down.0.log2() - from).powi(2));
    let terms = f64::from(along.size.x + along.size.y) + 16.0;
    let off = mean(&|along, down| {
        let spread = (along.0.log2() - means[0]).abs() + (down.0.log2() - means[1]).abs();
        let off = relative(along) + relative(down) + 2e-6;
        off * (3.0 * spread + 2.0 * spread * spread + off)
    });
    let off = 2.0 * off + 2.0 * terms * EPSILON * squares;
    let spread = variance.sqrt();
    (spread, (variance + off).sqrt() - (variance - off).max(0.0).sqrt() + 8.0 * EPSILON * spread)
}

/// The least that a line leads, as a share of what one with a single weight as large as any does; `LEAST_LEAD` of the kernel.
const LEAST_LEAD: f64 = 1e-12;

/// How much lines lead, and by which share of that rounding may be off: by the sum of the squares of their weights.
fn leads(weights: &[Vec<(f64, f64)>]) -> Vec<(f64, f64)> {
    let largest = weights.iter().flatten().map(|(weight, _)| *weight).fold(1e-37, f64::max);
    let lead = |line: &Vec<(f64, f64)>| {
        let squares: f64 = line.iter().map(|(weight, _)| (weight / largest).powi(2)).sum();
        let off: f64 = line.iter().map(|(weight, bound)| weight / largest * (bound / largest)).sum();
        let lead = squares.max(LEAST_LEAD);
        (lead, 2.0 * off / lead + (2.0 * line.len() as f64 + 16.0) * EPSILON)
    };
    weights.iter().map(lead).collect()
}

/// Where the borders of a line's cells go, and the bound of each.
struct Line {
    places: Vec<(f64, f64)>,
}

fn lines(all: &[Line]) -> Values {
    let mut values = Values::missing(&[all.len() as u32, all[0].places.len() as u32], 1);
    let places = all.iter().flat_map(|line| &line.places);
    places.enumerate().for_each(|(at, &(value, bound))| values.set(at, value, bound));
    values
}

fn mix((a, off_a): (f64, f64), (b, off_b): (f64, f64), w: f64) -> (f64, f64) {
    (a + (b - a) * w, off_a.max(off_b))
}

/// Least sine of a cell's corner; `LEAST` of the kernel.
const LEAST: f64 = 0.02;

/// Least area of a corner, as a share of what it is without warp, where the whole warp gives way; `LEAST_AREA` of the kernel.
const LEAST_AREA: f64 = 0.001;

/// The importance map.
struct Map {
    size: UVec2,
    weights: Vec<(f64, f64)>,
}

impl Map {
    /// NaN, negative numbers and what f32 may flush to zero are no importance.
    fn of(values: &Values) -> Self {
        let weight = |(&value, &bound): (&f64, &f64)| {
            let normal = value >= f64::from(f32::MIN_POSITIVE);
            if normal { (value.min(3e38), bound) } else { (0.0, if bound > 0.0 { bound } else { 0.0 }) }
        };
        let weights = values.value.iter().zip(&values.bound).map(weight).collect();
        Self { size: UVec2::new(values.dims[1], values.dims[0]), weights }
    }

    fn identity(&self) -> Corners {
        let corner = |(y, x): (u32, u32)| (DVec2::new(x.into(), y.into()) / self.size.as_dvec2(), 0.0);
        let places = (0..=self.size.y).flat_map(|y| (0..=self.size.x).map(move |x| (y, x)));
        Corners { size: self.size, corners: places.map(corner).collect() }
    }

    fn weight(&self, x: u32, y: u32) -> (f64, f64) {
        self.weights[(y * self.size.x + x) as usize]
    }

    /// Bilinear between the middles of cells, and how much that changes within `off` of a place.
    fn sample(&self, place: DVec2, off: f64) -> (f64, f64) {
        let last = (self.size - 1).as_dvec2();
        let at = (place * self.size.as_dvec2() - 0.5).clamp(DVec2::ZERO, last);
        let low = at.floor().as_uvec2();
        let high = (low + 1).min(self.size - 1);
        let w = at - low.as_dvec2();
        let north = mix(self.weight(low.x, low.y), self.weight(high.x, low.y), w.x);
        let south = mix(self.weight(low.x, high.y), self.weight(high.x, high.y), w.x);
        let (value, bound) = mix(north, south, w.y);
        // over `off` the value moves between those of the cells that it may be in
        let (mut least, mut most, mut bound) = (value, value, bound);
        let reach = UVec2::splat((off * self.size.max_element() as f64).ceil().min(8192.0) as u32);
        let (first, end) = (low.saturating_sub(reach), (high + reach).min(self.size - 1));
        for (y, x) in (first.y..=end.y).flat_map(|y| (first.x..=end.x).map(move |x| (y, x))) {
            let (near, off) = self.weight(x, y);
            (least, most, bound) = (least.min(near), most.max(near), bound.max(off));
        }
        let cells = off * f64::from(self.size.max_element());
        let slope = (most - least) * (2.0 * cells).min(1.0);
        (value, bound + slope + 8.0 * EPSILON * (value + (most - least)))
    }

    /// The importance where earlier rounds have put each cell, times the size that they have left it: along rows, and down columns.
    fn missing(&self, map: &Corners) -> [Map; 2] {
        let cell = |(y, x): (u32, u32)| {
            let place = (DVec2::new(x.into(), y.into()) + 0.5) / self.size.as_dvec2();
            let (there, off) = map.at(place);
            let (wanted, wanted_off) = self.sample(there, off);
            let wanted = wanted.min(1e30);
            let [nw, ne, sw, se] = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| map.corner(x, y));
            let corner_off = [nw.1, ne.1, sw.1, se.1].into_iter().fold(0.0, f64::max);
            [(ne.0 - nw.0) + (se.0 - sw.0), (sw.0 - nw.0) + (se.0 - ne.0)].map(|sides| {
                let sides = 0.5 * sides * self.size.as_dvec2();
                // four corners, each off along both axes, and what f32 makes of the sums
                let off = (4.0 * corner_off + 8.0 * EPSILON) * f64::from(self.size.max_element());
                let size = sides.length();
                (wanted * size, wanted_off * (size + off) + wanted * (off + 8.0 * EPSILON * size))
            })
        };
        let places = (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| (y, x)));
        let cells: Vec<[(f64, f64); 2]> = places.map(cell).collect();
        [0, 1].map(|way| Map { size: self.size, weights: cells.iter().map(|cell| cell[way]).collect() })
    }

    fn row(&self, row: u32) -> Vec<(f64, f64)> {
        (0..self.size.x).map(|x| self.weight(x, row)).collect()
    }

    /// The importance down a column after the rows' warps.
    fn warped_column(&self, column: u32, rows: &[Line]) -> Vec<(f64, f64)> {
        let weight = |(y, row): (usize, &Line)| {
            let (a, b) = (row.places[column as usize], row.places[column as usize + 1]);
            let middle = DVec2::new(0.5 * (a.0 + b.0), (y as f64 + 0.5) / f64::from(self.size.y));
            let line = Map { size: UVec2::new(self.size.x, 1), weights: self.row(y as u32) };
            line.sample(DVec2::new(middle.x, 0.5), a.1.max(b.1))
        };
        rows.iter().enumerate().map(weight).collect()
    }
}

/// Where the corners of the map's cells go.
struct Corners {
    size: UVec2,
    corners: Vec<(DVec2, f64)>,
}

impl Corners {
    fn values(&self) -> Values {
        let mut values = Values::missing(&[self.size.y + 1, self.size.x + 1], 2);
        for (at, (place, off)) in self.corners.iter().enumerate() {
            values.set(2 * at, place.x, *off);
            values.set(2 * at + 1, place.y, *off);
        }
        values
    }

    fn corner(&self, x: u32, y: u32) -> (DVec2, f64) {
        self.corners[(y * (self.size.x + 1) + x) as usize]
    }

    fn at(&self, place: DVec2) -> (DVec2, f64) {
        let at = place.clamp(DVec2::ZERO, DVec2::ONE) * self.size.as_dvec2();
        let low = at.floor().as_uvec2().min(self.size - 1);
        let w = at - low.as_dvec2();
        let known = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| self.corner(low.x + x, low.y + y));
        let north = known[0].0.lerp(known[1].0, w.x);
        let south = known[2].0.lerp(known[3].0, w.x);
        (north.lerp(south, w.y), known.iter().map(|(_, off)| *off).fold(0.0, f64::max) + 8.0 * EPSILON)
    }

    /// Where the points of a grid go.
    fn of_points(&self, points: &Values) -> Corners {
        let place = |at: usize| {
            let place = DVec2::new(points.value[2 * at], points.value[2 * at + 1]);
            let (there, off) = self.at(place);
            (there, off + self.steepest() * points.bound[2 * at].max(points.bound[2 * at + 1]))
        };
        let size = UVec2::new(points.dims[1], points.dims[0]) - 1;
        Corners { size, corners: (0..points.value.len() / 2).map(place).collect() }
    }

    /// Largest change of a place for a change of 1 in where it came from.
    fn steepest(&self) -> f64 {
        let cells = (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| (x, y)));
        let edge = |(x, y): (u32, u32)| {
            let here = self.corner(x, y).0;
            let along = (self.corner(x + 1, y).0 - here) * f64::from(self.size.x);
            let down = (self.corner(x, y + 1).0 - here) * f64::from(self.size.y);
            along.length() + down.length()
        };
        cells.map(edge).fold(1.0, f64::max)
    }

    fn composed(&self, rows: &[Line], columns: &[Line]) -> Corners {
        let corner = |(y, x): (u32, u32)| {
            let (west, east) = (x.max(1) - 1, x.min(self.size.x - 1));
            let down = mix(columns[west as usize].places[y as usize], columns[east as usize].places[y as usize], 0.5);
            let place = (down.0 * f64::from(self.size.y) - 0.5).clamp(0.0, f64::from(self.size.y - 1));
            let north = place.floor() as usize;
            let south = (north + 1).min(rows.len() - 1);
            let (a, b) = (rows[north].places[x as usize], rows[south].places[x as usize]);
            let along = mix(a, b, place - north as f64);
            // the row it comes to is off by what the column is off by
            let slant = down.1 * f64::from(self.size.y) * self.slant(rows, x as usize, place, down.1);
            let off = along.1 + slant + down.1 + 8.0 * EPSILON;
            let (there, before) = self.at(DVec2::new(along.0, down.0));
            (there, before + off * self.steepest())
        };
        let places = (0..=self.size.y).flat_map(|y| (0..=self.size.x).map(move |x| (y, x)));
        Corners { size: self.size, corners: places.map(corner).collect() }
    }

    /// Largest difference between neighbouring rows at a column border, over the rows that a place may be in.
    fn slant(&self, rows: &[Line], x: usize, place: f64, off: f64) -> f64 {
        let reach = (off * f64::from(self.size.y)).ceil().min(8192.0) as usize + 1;
        let first = (place as usize).saturating_sub(reach);
        let last = (place as usize + reach + 1).min(rows.len() - 1);
        rows[first..=last].windows(2).map(|pair| (pair[0].places[x].0 - pair[1].places[x].0).abs()).fold(0.0, f64::max)
    }

    /// The corners of folded cells in the middle of their neighbours, counted. Where it is not known whether a cell is folded, both places may
    /// be right.
    fn relaxed(&self, gave_way: &mut Values) -> Corners {
        let corner = |(y, x): (u32, u32)| {
            let at = (y * (self.size.x + 1) + x) as usize;
            let (place, off) = self.corners[at];
            let cells = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(left, up)| (x.wrapping_sub(left), y.wrapping_sub(up)));
            let is_cell = |(x, y): &(u32, u32)| *x < self.size.x && *y < self.size.y;
            let sines = cells.into_iter().filter(is_cell).map(|(x, y)| self.least_sine(x, y));
            let (low, high) = sines.fold((1.0f64, 1.0f64), |least, sine| (least.0.min(sine.0), least.1.min(sine.1)));
            let inside = (x > 0 && x < self.size.x, y > 0 && y < self.size.y);
            if low >= LEAST || inside == (false, false) {
                return (place, off);
            }
            let along = || [self.corner(x - 1, y), self.corner(x + 1, y)];
            let down = || [self.corner(x, y - 1), self.corner(x, y + 1)];
            let neighbours = match inside {
                (true, true) => [along(), down()].concat(),
                (true, false) => along().to_vec(),
                _ => down().to_vec(),
            };
            let middle = neighbours.iter().map(|(place, _)| *place).sum::<DVec2>() / neighbours.len() as f64;
            let middle_off = neighbours.iter().map(|(_, off)| *off).fold(0.0, f64::max) + 4.0 * EPSILON;
            if high < LEAST {
                gave_way.value[at] += 1.0;
                return (middle, middle_off);
            }
            gave_way.bound[at] += 1.0;
            (place, off.max((middle - place).abs().max_element() + middle_off))
        };
        let places = (0..=self.size.y).flat_map(|y| (0..=self.size.x).map(move |x| (y, x)));
        Corners { size: self.size, corners: places.map(corner).collect() }
    }

    /// All corners where they were before, and as often as they had given way by then, if a cell is still folded.
    fn taken_back_if_folded(&mut self, gave_way: &mut Values, (before, gave_before): (Corners, Values)) {
        let (low, high) = self.least_of_all();
        if high < LEAST {
            (*self, *gave_way) = (before, gave_before);
        } else if low < LEAST {
            // either may be right
            for (own, before) in self.corners.iter_mut().zip(&before.corners) {
                own.1 = own.1.max((own.0 - before.0).abs().max_element() + before.1);
            }
            for (at, bound) in gave_way.bound.iter_mut().enumerate() {
                *bound = bound.max((gave_way.value[at] - gave_before.value[at]).abs() + gave_before.bound[at]);
            }
        }
    }

    /// The least sine of all cells: what it may be, from and to, but no more than 1.
    fn least_of_all(&self) -> (f64, f64) {
        let cells = (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| (x, y)));
        let sines = cells.map(|(x, y)| self.least_sine(x, y));
        sines.fold((1.0f64, 1.0f64), |least, sine| (least.0.min(sine.0), least.1.min(sine.1)))
    }

    /// Of the four corners of a cell, the least sine: what it may be, from and to.
    fn least_sine(&self, x: u32, y: u32) -> (f64, f64) {
        let [nw, ne, sw, se] = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| self.corner(x, y));
        let cells = self.size.as_dvec2();
        let off = [nw.1, ne.1, sw.1, se.1].into_iter().fold(0.0, f64::max);
        let off = (2.0 * off + 4.0 * EPSILON) * f64::from(self.size.max_element());
        let (mut low, mut high) = (f64::INFINITY, f64::INFINITY);
        for along in [(ne.0 - nw.0) * cells, (se.0 - sw.0) * cells] {
            for down in [(sw.0 - nw.0) * cells, (se.0 - ne.0) * cells] {
                let sine = along.perp_dot(down) / (along.length() * down.length()).max(1e-30);
                // an edge that is off by its own length may point anywhere
                let slack = 2.0 * off / along.length() + 2.0 * off / down.length() + 16.0 * EPSILON;
                let slack = if slack < 1.0 { slack } else { 2.0 };
                (low, high) = (low.min(sine - slack), high.min(sine + slack));
            }
        }
        (low, high)
    }

    /// How much of the warp these points of a grid go, with a bound: all of it if no round has folded anything and no cell folds.
    fn share(&self, (folds, may_fold): (bool, bool)) -> (f64, f64) {
        let (low, high) = self.least_of_all();
        if !(folds || may_fold) || low >= LEAST {
            return (1.0, 1e-6);
        }
        let (share, bound) = self.convex_share();
        if folds && high < LEAST { (share, bound) } else { (share, bound + (1.0 - share)) }
    }

    /// How much of the warp keeps every corner of every cell turning the same way, with a bound.
    fn convex_share(&self) -> (f64, f64) {
        let moved = |x: u32, y: u32| {
            let (place, off) = self.corner(x, y);
            (place * self.size.as_dvec2() - DVec2::new(x.into(), y.into()), off)
        };
        let (mut share, mut low, mut high) = (1.0f64, 1.0f64, 1.0f64);
        for (y, x) in (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| (y, x))) {
            let (nw, ne, sw, se) = (moved(x, y), moved(x + 1, y), moved(x, y + 1), moved(x + 1, y + 1));
            let off = [nw.1, ne.1, sw.1, se.1].into_iter().fold(0.0, f64::max) * f64::from(self.size.max_element());
            for along in [ne.0 - nw.0, se.0 - sw.0] {
                for down in [sw.0 - nw.0, se.0 - ne.0] {
                    // edges of up to `longest` cells, each off by twice a corner
                    let longest = 1.0 + along.length().max(down.length());
                    let slack = 8.0 * (off + 16.0 * EPSILON * f64::from(self.size.max_element())) * longest;
                    let until = |least: f64| convex_until(along, down, least);
                    share = share.min(until(LEAST_AREA));
                    low = low.min(until(LEAST_AREA + slack));
                    high = high.min(until(LEAST_AREA - slack));
                }
            }
        }
        let shrink = |share: f64| if share < 1.0 { 0.999 * share } else { 1.0 };
        (shrink(share), (shrink(share) - shrink(low)).max(shrink(high) - shrink(share)) + 1e-6)
    }
}

/// Smallest t in (0, 1) at which the parallelogram of (1, 0) + t along and (0, 1) + t down has the area `least`; 1 if none.
fn convex_until(along: DVec2, down: DVec2, least: f64) -> f64 {
    let (a, b, c) = (along.perp_dot(down), along.x + down.y, 1.0 - least);
    if c <= 0.0 {
        return 0.0;
    }
    let area = |t: f64| c + b * t + a * t * t;
    let turn = if a > 0.0 { (-b / (2.0 * a)).clamp(0.0, 1.0) } else { 1.0 };
    let lowest = if area(turn) <= 0.0 { turn } else { 1.0 };
    if area(lowest) > 0.0 {
        return 1.0;
    }
    // area falls from c > 0 to there
    let (mut low, mut high) = (0.0, lowest);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if area(middle) > 0.0 { low = middle } else { high = middle }
    }
    low
}
