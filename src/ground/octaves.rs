//! Octaves of noise that are added to a ground: what the surface does between samples and no sample says (Dachsbacher, Stamminger 2004,
//! section 4.1). The other half is `kernels/ground/octaves.wgsl`.
//!
//! Octave k = 1, 2, .. has the frequency 2^k / (2 d0), d0 the distance of the samples, along columns and along rows. Each node of a lattice
//! whose sides are two waves long has two waves of its own, with a direction and a phase each; a place sees those of the four nodes around it,
//! faded into each other. So an octave is bounded in frequency on both sides: below half its frequency is less than a hundredth of its
//! energy, and above twice its frequency, too. (Of gradient noise a third is below.)

use glam::{DVec2, I64Vec2};

use crate::experiment::scene::Detail;

/// A place on the ground, counted from the octaves' origin: its cell, and where in it from the north-west corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    pub cell: I64Vec2,
    /// In [0, 1)^2.
    pub fraction: DVec2,
}

impl Place {
    /// The place of sample coordinates; `origin` is the first sample.
    pub fn new(sample: DVec2, origin: I64Vec2) -> Self {
        // what is a hair's breadth below a whole number is one in f64
        let cell = sample.floor();
        let next = (sample - cell).cmpge(DVec2::ONE);
        let cell = cell + DVec2::new(f64::from(next.x), f64::from(next.y));
        Self { cell: cell.as_i64vec2() + origin, fraction: (sample - cell).max(DVec2::ZERO) }
    }
}

/// The octaves of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Octaves {
    /// Of octave 1 in metres, and of each further one as a part of the one before.
    pub amplitude_m: f64,
    pub persistence: f64,
    pub seed: u32,
    /// The ground's first sample, in whole cells from the origin of the octaves.
    pub origin: I64Vec2,
    each: Vec<Octave>,
}

/// What is known of an octave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Octave {
    /// The most that it adds to the surface or takes from it.
    pub amplitude_m: f64,
    /// It is nowhere steeper, in metres a cell.
    pub steepest: f64,
    /// Its slope changes nowhere faster, in metres a cell for each cell.
    pub most_curved: f64,
    /// The most that it and all after it add or take.
    pub rest_m: f64,
}

/// More octaves than that have no place in the 64 bits of a lattice's numbers.
pub const MOST: u32 = 30;

/// The largest of a wave is 1.
const WAVE: f64 = 6.2625;
/// No octave is steeper than its amplitude times this, for each side of a cell of its lattice: a wave goes up and down twice there, and
/// between two nodes one wave fades into another.
pub const STEEPEST: f64 = 2.0 * WAVE + FADING;
/// Nor is its slope anywhere faster to change than the amplitude times this: by the waves' own curvature, which is a little more than that of a
/// sine (39.64), by how two waves fade while they rise, and by how fading itself changes.
pub const MOST_CURVED: f64 = 4.0 * 39.64 + 2.0 * FADING * 2.0 * WAVE + 2.0 * 5.774 + 4.0 * 1.875 * 1.875;
/// How fast the weights of four nodes change at most, all together.
const FADING: f64 = 2.0 * 1.875 * std::f64::consts::SQRT_2;

impl Octaves {
    /// None if nothing would be added.
    pub fn new(detail: &Detail) -> Option<Self> {
        let Detail { octaves, amplitude_m, persistence, seed, origin } = *detail;
        let amplitudes_m = (0..octaves.min(MOST)).map(|k| amplitude_m * persistence.powi(k as i32));
        let amplitudes_m: Vec<f64> = amplitudes_m.take_while(|amplitude_m| *amplitude_m > 0.0).collect();
        let octave = |k: u32| Octave {
            amplitude_m: amplitudes_m[k as usize],
            steepest: amplitudes_m[k as usize] * STEEPEST * lattice_cells(k + 1),
            most_curved: amplitudes_m[k as usize] * MOST_CURVED * lattice_cells(k + 1).powi(2),
            rest_m: amplitudes_m[k as usize..].iter().sum(),
        };
        let each: Vec<Octave> = (0..amplitudes_m.len() as u32).map(octave).collect();
        let origin = I64Vec2::new(origin.0.into(), origin.1.into());
        (!each.is_empty()).then_some(Self { amplitude_m, persistence, seed, origin, each })
    }

    /// Octaves 1, 2, ..
    pub fn each(&self) -> impl Iterator<Item = (u32, &Octave)> {
        (1..).zip(&self.each)
    }

    pub fn count(&self) -> u32 {
        self.each.len() as u32
    }

    /// The most that all octaves after the first few add or take.
    pub fn sum_after_m(&self, first: u32) -> f64 {
        self.each.get(first as usize).map_or(0.0, |octave| octave.rest_m)
    }

    pub fn most_m(&self) -> f64 {
        self.sum_after_m(0)
    }

    /// All octaves together are nowhere steeper, in metres a cell.
    pub fn steepest(&self) -> f64 {
        self.each.iter().map(|octave| octave.steepest).sum()
    }

    /// The place of sample coordinates.
    pub fn place(&self, sample: DVec2) -> Place {
        Place::new(sample, self.origin)
    }

    /// Height of octave k in metres, and its slope in metres for each cell to the east and to the south.
    pub fn octave(&self, place: &Place, k: u32) -> (f64, DVec2) {
        let (value, slope) = noise(place, k, self.seed, EVERYWHERE);
        let amplitude_m = self.each[k as usize - 1].amplitude_m;
        (amplitude_m * value, amplitude_m * lattice_cells(k) * slope)
    }

    /// Height of octave k in metres.
    pub fn octave_m(&self, place: &Place, k: u32) -> f64 {
        self.each[k as usize - 1].amplitude_m * noise(place, k, self.seed, EVERYWHERE).0
    }

    /// The sum of all octaves in metres.
    pub fn all_m(&self, place: &Place) -> f64 {
        (1..=self.count()).map(|k| self.octave_m(place, k)).sum()
    }

    /// The sum of octaves that count by a weight each, and its slope.
    pub fn weighted(&self, place: &Place, weight: impl Fn(u32) -> f64) -> (f64, DVec2) {
        let octave = |k: u32| {
            let (height_m, slope) = self.octave(place, k);
            (weight(k) * height_m, weight(k) * slope)
        };
        let counts = (1..=self.count()).filter(|k| weight(*k) > 0.0);
        counts.map(octave).fold((0.0, DVec2::ZERO), |sum, octave| (sum.0 + octave.0, sum.1 + octave.1))
    }
}

/// Cells of octave k's lattice along a cell of the ground: 2^(k - 2).
pub fn lattice_cells(k: u32) -> f64 {
    f64::from(k as i32 - 2).exp2()
}

/// The node of octave k's lattice to the north-west of a place, and where the place is from there.
fn node(place: &Place, k: u32) -> (I64Vec2, DVec2) {
    let Some(shift) = k.checked_sub(2) else {
        let odd = (place.cell & 1).as_dvec2();
        return (place.cell >> 1, 0.5 * (odd + place.fraction));
    };
    let finer = place.fraction * f64::from(shift).exp2();
    ((place.cell << shift) + finer.floor().as_i64vec2(), finer - finer.floor())
}

/// The bits of a node's number that count: all of them, so that no node is there twice.
pub const EVERYWHERE: i64 = -1;

/// Octave k with the amplitude 1, and its slope for each side of a cell of its lattice. With fewer bits of a node's number it is periodic.
#[inline(always)]
pub fn noise(place: &Place, k: u32, seed: u32, bits: i64) -> (f64, DVec2) {
    let (first, from_first) = node(place, k);
    let seed = mixed(seed.wrapping_add(k.wrapping_mul(GOLDEN)));
    let (fade, fade_slope) = (from_first.map(fade), from_first.map(fade_slope));
    let (mut height, mut slope) = (0.0, DVec2::ZERO);
    for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let corner = I64Vec2::new(x, y);
        let (wave, wave_slope) = waves_of(hash((first + corner) & bits, seed), from_first - corner.as_dvec2());
        let weight = |axis: usize| if corner[axis] == 1 { fade[axis] } else { 1.0 - fade[axis] };
        let weight_slope = |axis: usize| if corner[axis] == 1 { fade_slope[axis] } else { -fade_slope[axis] };
        height += weight(0) * weight(1) * wave;
        slope += wave * DVec2::new(weight_slope(0) * weight(1), weight(0) * weight_slope(1));
        slope += weight(0) * weight(1) * wave_slope;
    }
    (height, slope)
}

/// The waves of a node, two across a side of the lattice: the mean of two, so that no place looks combed.
#[inline(always)]
fn waves_of(hash: u32, from_node: DVec2) -> (f64, DVec2) {
    let (first, second) = (wave_of(hash & 0xffff, from_node), wave_of(hash >> 16, from_node));
    (0.5 * (first.0 + second.0), 0.5 * (first.1 + second.1))
}

/// A wave whose direction and phase are 16 bits.
#[inline(always)]
fn wave_of(bits: u32, from_node: DVec2) -> (f64, DVec2) {
    // half a turn of directions; the phase makes up for the other half
    let t = (2.0 * f64::from(bits & 63) - 63.0) / 64.0;
    let direction = DVec2::new(1.0 - t * t, 2.0 * t) / (1.0 + t * t);
    let phase = f64::from(bits >> 6) / 1024.0;
    let (value, slope) = wave(2.0 * direction.dot(from_node) + phase);
    (value, 2.0 * slope * direction)
}

/// All but a sine of period 1: a polynomial, so that it is the same in every precision. Its curvature has no step.
fn wave(x: f64) -> (f64, f64) {
    let x = x - x.round();
    let s = x * x;
    let value = x * (1.0 + s * (-6.5 + s * (12.0 - 8.0 * s)));
    let slope = 1.0 + s * (-19.5 + s * (60.0 - 56.0 * s));
    (WAVE * value, WAVE * slope)
}

fn fade(x: f64) -> f64 {
    x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
}

fn fade_slope(x: f64) -> f64 {
    30.0 * x * x * (x - 1.0) * (x - 1.0)
}

const GOLDEN: u32 = 0x9e37_79b9;

/// A number for a node, none of whose bits goes with another's.
fn hash(node: I64Vec2, seed: u32) -> u32 {
    let of_axis = |number: i64, seed: u32| mixed(number as u32 ^ mixed((number >> 32) as u32 ^ seed));
    let (column, row) = (of_axis(node.x, seed), of_axis(node.y, !seed));
    mixed(column.wrapping_add(row.wrapping_mul(GOLDEN)))
}

/// A permutation of 32 bits in which each bit hangs on all.
fn mixed(bits: u32) -> u32 {
    let bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d);
    let bits = (bits ^ (bits >> 15)).wrapping_mul(0x846c_a68b);
    bits ^ (bits >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octaves(octaves: u32) -> Octaves {
        let detail = Detail { octaves, amplitude_m: 1.0, persistence: 0.5, seed: 7, origin: (0, 0) };
        Octaves::new(&detail).unwrap()
    }

    /// Frequencies in waves of octave k, and the energy that a square of samples has at each.
    fn spectrum(k: u32, side: usize, samples_a_wave: f64) -> Vec<(f64, f64)> {
        let octaves = octaves(k);
        // waves of octave k are 2 / 2^k cells long
        let step = 2.0 / f64::from(1u32 << k) / samples_a_wave;
        let window = |i: usize| 0.5 - 0.5 * (std::f64::consts::TAU * i as f64 / side as f64).cos();
        let height = |x: usize, y: usize| {
            let place = octaves.place(DVec2::new(x as f64, y as f64) * step + 11.3);
            octaves.octave_m(&place, k) / octaves.each[k as usize - 1].amplitude_m * window(x) * window(y)
        };
        let rows: Vec<Vec<f64>> = (0..side).map(|y| (0..side).map(|x| height(x, y)).collect()).collect();
        // a transform of rows, and of columns after that
        let turn = |i: usize, f: usize| (std::f64::consts::TAU * ((i * f) % side) as f64 / side as f64).sin_cos();
        let turns: Vec<(f64, f64)> = (0..side).map(|i| turn(1, i)).collect();
        let transformed = |line: &dyn Fn(usize) -> (f64, f64), f: usize| {
            (0..side).fold((0.0, 0.0), |sum, i| {
                let ((re, im), (sin, cos)) = (line(i), turns[(i * f) % side]);
                (sum.0 + re * cos + im * sin, sum.1 + im * cos - re * sin)
            })
        };
        let by_rows: Vec<Vec<(f64, f64)>> =
            rows.iter().map(|row| (0..side).map(|f| transformed(&|i| (row[i], 0.0), f)).collect()).collect();
        let frequency = |f: usize| f.min(side - f) as f64 / side as f64 * samples_a_wave;
        let places = (0..side).flat_map(|f| (0..side).map(move |g| (f, g)));
        places
            .map(|(f, g)| {
                let (re, im) = transformed(&|i| by_rows[i][f], g);
                (frequency(f).hypot(frequency(g)), re * re + im * im)
            })
            .collect()
    }

    /// The paper's condition for fading octaves out: nothing of an octave is as coarse as what was faded out before.
    #[test]
    fn an_octave_is_bounded_in_frequency_on_both_sides() {
        for k in [1, 4] {
            let spectrum = spectrum(k, 128, 8.0);
            let sum = |is_in: &dyn Fn(f64) -> bool| -> f64 {
                spectrum.iter().filter(|(frequency, _)| is_in(*frequency)).map(|(_, energy)| energy).sum()
            };
            let all = sum(&|_| true);
            let (below, above) = (sum(&|f| f < 0.5) / all, sum(&|f| f > 2.0) / all);
            assert!(below < 0.01 && above < 0.01, "octave {k}: {below} of its energy below half, {above} above twice");
            assert!(sum(&|f| (0.7..1.4).contains(&f)) / all > 0.9);
        }
    }

    #[test]
    fn no_octave_is_higher_or_steeper_than_it_is_said_to_be() {
        let octaves = octaves(9);
        let (mut highest, mut steepest) = (0.0f64, 0.0f64);
        for i in 0..200_000 {
            let at = DVec2::new((f64::from(i) * 0.618_033_988_7).fract(), (f64::from(i) * 0.754_877_666_2).fract());
            let place = octaves.place(at * 500.0 - 200.0);
            let k = 1 + i % 9;
            let (height, slope) = octaves.weighted(&place, |other| f64::from(other == k as u32));
            let octave = octaves.each[k as usize - 1];
            highest = highest.max(height.abs() / octave.amplitude_m);
            steepest = steepest.max(slope.length() / octave.steepest);
        }
        assert!((0.8..=1.0).contains(&highest), "{highest}");
        assert!((0.5..=1.0).contains(&steepest), "{steepest}");
    }

    /// Between two places, slopes differ by no more than what they are apart times the most curvature, and somewhere by a good part of that.
    #[test]
    fn no_octave_is_more_curved_than_it_is_said_to_be() {
        let octaves = octaves(5);
        let mut most = 0.0f64;
        for i in 0..100_000 {
            let at = DVec2::new((f64::from(i) * 0.618_033_988_7).fract(), (f64::from(i) * 0.754_877_666_2).fract());
            let (k, by) = (1 + i as u32 % 5, DVec2::from_angle(f64::from(i)) * 1e-4);
            let slope = |place: DVec2| octaves.octave(&octaves.place(place), k).1;
            let change = (slope(at * 200.0 + by) - slope(at * 200.0)).length();
            most = most.max(change / (1e-4 * octaves.each[k as usize - 1].most_curved));
        }
        assert!((0.3..=1.0).contains(&most), "{most}");
    }

    /// The slope is the height's own, over the lines of the lattice, too, and far from the origin.
    #[test]
    fn slopes_are_those_of_the_heights() {
        for i in 0..400 {
            let origin = [0, 10_000_000, -999_999_999][i as usize % 3];
            let octaves = Octaves { origin: I64Vec2::new(origin, -origin), ..octaves(6) };
            let at = DVec2::new(f64::from(i) * 0.37, f64::from(i % 20) * 0.5);
            let height = |by: DVec2| octaves.all_m(&octaves.place(at + by));
            let off = 1e-5;
            let seen = DVec2::new(
                height(DVec2::X * off) - height(DVec2::X * -off),
                height(DVec2::Y * off) - height(DVec2::Y * -off),
            ) / (2.0 * off);
            let slope = octaves.weighted(&octaves.place(at), |_| 1.0).1;
            assert!((seen - slope).length() < 1e-5 * octaves.steepest(), "{at}: {seen} {slope}");
        }
    }

    /// The kernel's constants are not below those that are proven here.
    #[test]
    fn kernels_have_the_same_bounds() {
        let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/kernels/lib/waves.wgsl"));
        let constant = |name: &str| -> f64 {
            let line = text.lines().find(|line| line.starts_with(&format!("const {name}: f32 = "))).unwrap();
            line.split([' ', ';']).nth(4).unwrap().parse().unwrap()
        };
        assert_eq!(constant("OCTAVE_WAVE"), WAVE);
        assert!((STEEPEST..1.01 * STEEPEST).contains(&constant("OCTAVE_STEEPEST")));
        assert!((MOST_CURVED..1.01 * MOST_CURVED).contains(&constant("OCTAVE_CURVED")));
    }

    /// Whole cells further, with the origin as far back, there is the same.
    #[test]
    fn the_origin_can_be_anywhere() {
        let near = octaves(30);
        for origin in [1i64, 100_000, 10_000_000, -1_000_000_001] {
            let far = Octaves { origin: I64Vec2::new(origin, -origin), ..near.clone() };
            let farther = Octaves { origin: I64Vec2::new(origin - 17, -origin + 5), ..near.clone() };
            let mut unlike = 0;
            for i in 0..100 {
                let at = DVec2::new(f64::from(i) / 64.0, f64::from(i) / 32.0);
                let there = at + DVec2::new(17.0, -5.0);
                assert_eq!(far.all_m(&far.place(at)), farther.all_m(&farther.place(there)));
                unlike += usize::from(far.all_m(&far.place(at)) != near.all_m(&near.place(at)));
            }
            assert!(unlike > 90, "{unlike}");
        }
    }
}
