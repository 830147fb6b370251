//! A ground with octaves over the surface of another one (Dachsbacher, Stamminger 2004, section 4.1).

use std::sync::Arc;
use std::sync::OnceLock;

use glam::{DVec2, DVec3, UVec2};

use super::cast::{self, Nodes};
use super::octaves::Octaves;
use super::{Ground, Lattice, Part, Ray};

/// The surface of a ground and all octaves.
#[derive(Clone, Debug)]
pub struct Detailed {
    base: Arc<dyn Ground>,
    octaves: Octaves,
    parts: Vec<Part>,
    nodes: OnceLock<Nodes>,
}

/// A ray has met the surface where it is no farther from it than this, for each metre of its way. (At a focal length of 10,000 pixels that
/// is a ten-thousandth of a pixel.)
const MET: f64 = 1e-8;

/// No place of the surface is higher over a ray than what [`Detailed::crests`] finds but for this, for each metre of the way, and for a part
/// of how high it is: a 500th of a pixel at a focal length of a thousand, and a 20th of what is measured.
const CREST: f64 = 2e-6;
const CREST_SHARE: f64 = 0.05;
/// Places that are looked at first.
const SOME: u32 = 32;

/// How far over the surface a ray is looked for, or under it where that is negative: metres, and metres for each metre of its way.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gap {
    pub m: f64,
    pub of_way: f64,
}

/// A part of a ray over one formula of the surface between samples: the height over that is f(s), s = 0..1.
struct Stretch {
    from: f64,
    length: f64,
    f0: f64,
    /// The slopes of f at both ends.
    d0: f64,
    d1: f64,
}

impl Stretch {
    fn at(&self, t: f64) -> f64 {
        let s = (t - self.from) / self.length;
        self.f0 + s * (self.d0 + s * 0.5 * (self.d1 - self.d0))
    }

    /// The least that f can be in it.
    fn least(&self) -> f64 {
        self.f0.min(self.at(self.from + self.length)) - 0.125 * (self.d1 - self.d0).abs()
    }

    /// How fast f falls at most, for each metre of the way.
    fn falls(&self) -> f64 {
        (-self.d0).max(-self.d1).max(0.0) / self.length
    }
}

impl Detailed {
    pub fn new(base: Arc<dyn Ground>, octaves: Octaves) -> Self {
        let most = DVec3::Z * octaves.most_m();
        let widened = |part: &Part| Part { low_m: part.low_m - most, high_m: part.high_m + most };
        let parts = base.parts().iter().map(widened).collect();
        Self { base, octaves, parts, nodes: OnceLock::new() }
    }

    pub fn octaves(&self) -> &Octaves {
        &self.octaves
    }

    /// The surface between samples, without octaves.
    pub fn base(&self) -> &dyn Ground {
        self.base.as_ref()
    }

    fn detail_m(&self, place_m: DVec2) -> f64 {
        let last = self.lattice().last().as_dvec2();
        let sample = self.lattice().sample_from_world(place_m).clamp(DVec2::ZERO, last);
        self.octaves.all_m(&self.octaves.place(sample))
    }

    /// The parts of a ray between which the surface without octaves changes its formula, as far as a ray comes from `side`.
    fn stretches(&self, ray: &Ray, (from, to): (f64, f64), side: f64) -> Vec<Stretch> {
        let mut places = self.base.bends(ray, from, to);
        places.extend([from, to]);
        places.sort_by(f64::total_cmp);
        let over_m = |t: f64| side * self.base.above_m(ray.at(t));
        let stretch = |pair: &[f64]| {
            let (from, length) = (pair[0], pair[1] - pair[0]);
            let (f0, middle, f1) = (over_m(from), over_m(from + 0.5 * length), over_m(pair[1]));
            let (d0, d1) = (4.0 * middle - 3.0 * f0 - f1, 3.0 * f1 + f0 - 4.0 * middle);
            (length > 0.0).then_some(Stretch { from, length, f0, d0, d1 })
        };
        places.windows(2).filter_map(stretch).collect()
    }

    /// Where a ray that comes from `side` is for the first time at most a gap over the surface.
    pub fn first_within(&self, ray: &Ray, side: f64, gap: Gap) -> Option<f64> {
        let nodes = self.nodes.get_or_init(|| Nodes::new(self.base.as_ref()));
        let far = self.stay(ray)?.1;
        let beyond_m = self.octaves.most_m() + gap.m.abs() + gap.of_way.abs() * far.min(1e12);
        let in_part =
            |part| self.stretches(ray, part, side).iter().find_map(|stretch| self.march(ray, stretch, side, gap));
        nodes.first_in(self, ray, (side, beyond_m), &in_part)
    }

    /// The first place in a stretch. No step is longer than the surface needs to come to the ray at its steepest.
    fn march(&self, ray: &Ray, stretch: &Stretch, side: f64, gap: Gap) -> Option<f64> {
        let end = stretch.from + stretch.length;
        let widest = gap.m + gap.of_way * if gap.of_way > 0.0 { end } else { stretch.from };
        if stretch.least() > self.octaves.most_m() + widest {
            return None;
        }
        let mut t = stretch.from;
        loop {
            let over_m = stretch.at(t) - gap.m - gap.of_way * t;
            let (step, left_m) = self.step(ray, t, (over_m, stretch.falls() + gap.of_way.max(0.0)), side, end - t);
            if left_m.is_some_and(|left_m| left_m <= 0.5 * MET * t) {
                return Some(t);
            }
            t = (t + step).max(t * (1.0 + f64::EPSILON)).max(f64::EPSILON);
            if t >= end {
                return None;
            }
        }
    }

    /// The top of a wave from a place near it.
    fn climb(&self, from: f64, (least, most): (f64, f64), height: impl Fn(f64) -> f64) -> f64 {
        let (mut t, mut by) = (from, CREST.sqrt() * from);
        while by > CREST * from {
            let beside = [(t - by).max(least), (t + by).min(most)];
            let higher = beside.into_iter().find(|beside| height(*beside) > height(t));
            match higher {
                Some(higher) => t = higher,
                None => by *= 0.5,
            }
        }
        t
    }

    /// How far a ray can go before it can meet the octaves; and, if all that matter were asked, how far it is over them here. Over the surface
    /// without them it is `over_m`, and that falls as fast as is said.
    fn step(&self, ray: &Ray, t: f64, (over_m, falls): (f64, f64), side: f64, enough: f64) -> (f64, Option<f64>) {
        let lattice = self.lattice();
        let direction = lattice.cells_from_world(ray.direction.truncate());
        let place = self.octaves.place(lattice.sample_from_world(ray.at(t).truncate()));
        let mut over = Over { over_m, falls, fastest: falls, bends: 0.0 };
        let mut step = 0.0f64;
        for (k, octave) in self.octaves.each() {
            // without the octaves that are left, the surface is less steep
            step = step.max(over.way(octave.rest_m));
            if step > enough {
                return (step, None);
            }
            // half of what is near enough is for octaves that are too low to matter here
            if octave.rest_m <= 0.5 * MET * t {
                return (step, Some(over.over_m));
            }
            let (height_m, slope) = self.octaves.octave(&place, k);
            over.over_m -= side * height_m;
            over.falls += side * slope.dot(direction);
            over.fastest += direction.length() * octave.steepest;
            over.bends += direction.length_squared() * octave.most_curved;
        }
        (step.max(over.way(0.0)), Some(over.over_m))
    }
}

/// What is known of the height over some octaves, ahead on a ray.
#[derive(Clone, Copy, Debug)]
struct Over {
    over_m: f64,
    /// How fast it falls here, and anywhere.
    falls: f64,
    fastest: f64,
    /// How fast that changes at most.
    bends: f64,
}

impl Over {
    /// How far it is at least until so much is left.
    fn way(&self, rest_m: f64) -> f64 {
        let left_m = self.over_m - rest_m;
        if left_m <= 0.0 {
            return 0.0;
        }
        // a parabola that falls as fast as it is allowed to, or a line
        let root = (self.falls * self.falls + 2.0 * self.bends * left_m).sqrt();
        let parabola = match self.falls > 0.0 {
            true => 2.0 * left_m / (self.falls + root),
            false => (root - self.falls) / self.bends.max(1e-300),
        };
        parabola.max(left_m / self.fastest.max(1e-300))
    }
}

impl Ground for Detailed {
    fn lattice(&self) -> Lattice {
        self.base.lattice()
    }

    fn height_m(&self, sample: UVec2) -> f64 {
        self.base.height_m(sample)
    }

    fn sample_m(&self, sample: UVec2) -> DVec3 {
        self.base.sample_m(sample)
    }

    fn up(&self, point_m: DVec3) -> DVec3 {
        self.base.up(point_m)
    }

    fn surface_at(&self, point_m: DVec3) -> DVec3 {
        self.base.surface_at(point_m) + self.up(point_m) * self.detail_m(point_m.truncate())
    }

    fn margin_m(&self, point_m: DVec3) -> f64 {
        self.base.margin_m(point_m)
    }

    fn stay(&self, ray: &Ray) -> Option<(f64, f64)> {
        let (enter, leave) = self.base.stay(ray)?;
        // straight up or down it ends where the heights do
        let is_vertical = ray.direction.truncate() == DVec2::ZERO;
        let more = if is_vertical { self.octaves.most_m() / ray.direction.z.abs().max(1e-300) } else { 0.0 };
        Some((enter, leave + more))
    }

    fn among_heights(&self, ray: &Ray, part: (f64, f64)) -> (f64, f64) {
        cast::among(self.range_m(), ray, part)
    }

    /// Those of the ground, and even steps between them, four or more to a wave of the finest octave; at most a million.
    fn bends(&self, ray: &Ray, from: f64, to: f64) -> Vec<f64> {
        let mut bends = self.base.bends(ray, from, to);
        let along = self.lattice().cells_from_world(ray.direction.truncate()).length();
        let quarters = along * f64::from(1u32 << self.octaves.count()) * 2.0;
        let count = ((to - from) * quarters).clamp(0.0, 1e6).ceil() as u32;
        bends.extend((1..count).map(|at| from + (to - from) * f64::from(at) / f64::from(count)));
        bends
    }

    /// Found in steps: what cannot come much higher than what was found is passed over.
    fn crests(&self, ray: &Ray, part: (f64, f64), side: f64) -> Vec<f64> {
        let (from, to) = self.among_heights(ray, part);
        // above the ray, as a part of the way; some places say beforehand about how high it comes
        let height = |t: f64| -side * self.above_m(ray.at(t)) / t.max(1e-9);
        let some = (0..=SOME).map(|at| from + (to - from) * f64::from(at) / f64::from(SOME));
        let (mut best, mut highest) = (to, height(to).max(0.0));
        for t in some {
            let height = height(t);
            if height > highest {
                (best, highest) = (t, height);
            }
        }
        for stretch in self.stretches(ray, (from, to), side) {
            if stretch.least() > self.octaves.most_m() {
                continue;
            }
            let end = stretch.from + stretch.length;
            let mut t = stretch.from;
            while t < end {
                let slack = highest * (1.0 + CREST_SHARE) + CREST;
                let over_m = stretch.at(t) + slack * t;
                let (step, left_m) = self.step(ray, t, (over_m, stretch.falls()), side, end - t);
                let height = left_m.map_or(f64::NEG_INFINITY, |left_m| slack - left_m / t.max(1e-9));
                if height > highest {
                    (best, highest) = (t, height);
                }
                t = (t + step).max(t * (1.0 + 1e-9) + 1e-9);
            }
        }
        vec![self.climb(best, (from, to), height)]
    }

    fn first_hit(&self, ray: &Ray) -> Option<f64> {
        self.first_within(ray, cast::side(self, ray, self.stay(ray)?.0), Gap::default())
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn range_m(&self) -> (f64, f64) {
        let (low, high) = self.base.range_m();
        (low - self.octaves.most_m(), high + self.octaves.most_m())
    }

    fn range_over_m(&self, low: DVec2, high: DVec2) -> Option<(f64, f64)> {
        let (low, high) = self.base.range_over_m(low, high)?;
        Some((low - self.octaves.most_m(), high + self.octaves.most_m()))
    }

    fn steepest(&self) -> f64 {
        self.base.steepest() + self.octaves.steepest() / self.lattice().cell_m.min_element()
    }

    fn steepest_seen(&self) -> f64 {
        self.base.steepest_seen() + self.octaves.steepest() / self.lattice().cell_m.min_element()
    }

    fn identity(&self) -> String {
        let text = format!("{} {:?}", self.base.identity(), self.octaves);
        blake3::hash(text.as_bytes()).to_hex().as_str()[..32].to_string()
    }

    fn truth(&self) -> &'static str {
        self.base.truth()
    }

    fn detail(&self) -> Option<&Detailed> {
        Some(self)
    }
}
