//! Octaves over another ground: waves of frequency 2^k / (2 d0), d0 the spacing of the ground's samples.

use std::sync::Arc;

use glam::{DVec2, DVec3, UVec2};
use lodlab::ground::{Ground, Lattice, Part, Ray};

#[derive(Debug)]
pub struct Detail {
    base: Arc<dyn Ground>,
    /// Metres of each octave, k = 1, 2, ..
    amplitudes_m: Vec<f64>,
    parts: Vec<Part>,
}

impl Detail {
    pub fn new(base: Arc<dyn Ground>, amplitudes_m: Vec<f64>) -> Self {
        let most = DVec3::Z * amplitudes_m.iter().sum::<f64>();
        let widened = |part: &Part| Part { low_m: part.low_m - most, high_m: part.high_m + most };
        Self { parts: base.parts().iter().map(widened).collect(), base, amplitudes_m }
    }

    /// Waves a metre of each octave.
    fn octaves(&self) -> impl Iterator<Item = (f64, f64)> {
        let spacing_m = self.base.lattice().cell_m.max_element();
        self.amplitudes_m.iter().zip(1..).map(move |(amplitude, k)| (*amplitude, 2f64.powi(k) / (2.0 * spacing_m)))
    }

    fn detail_m(&self, place: DVec2) -> f64 {
        let wave = |place: f64, frequency: f64| (std::f64::consts::TAU * place * frequency).sin();
        self.octaves()
            .map(|(amplitude, frequency)| amplitude * wave(place.x, frequency) * wave(place.y, frequency))
            .sum()
    }

    fn most_m(&self) -> f64 {
        self.amplitudes_m.iter().sum()
    }
}

impl Ground for Detail {
    fn lattice(&self) -> Lattice {
        self.base.lattice()
    }
    fn height_m(&self, sample: UVec2) -> f64 {
        self.base.height_m(sample)
    }
    fn sample_m(&self, sample: UVec2) -> DVec3 {
        self.surface_at(self.base.sample_m(sample))
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
        self.base.stay(ray)
    }
    /// Those of the ground, and a quarter of each wave: between two of them it goes one way.
    fn bends(&self, ray: &Ray, from: f64, to: f64) -> Vec<f64> {
        let mut bends = self.base.bends(ray, from, to);
        for (_, frequency) in self.octaves() {
            for (start, speed) in [(ray.eye_m.x, ray.direction.x), (ray.eye_m.y, ray.direction.y)] {
                let (a, b) = (4.0 * frequency * (start + speed * from), 4.0 * frequency * (start + speed * to));
                let lines = a.min(b).ceil() as i64..=a.max(b).floor() as i64;
                bends.extend(
                    lines.map(|line| (line as f64 / (4.0 * frequency) - start) / speed).filter(|t| t.is_finite()),
                );
            }
        }
        bends.retain(|t| (from..=to).contains(t));
        bends
    }
    fn parts(&self) -> &[Part] {
        &self.parts
    }
    fn range_m(&self) -> (f64, f64) {
        let (low, high) = self.base.range_m();
        (low - self.most_m(), high + self.most_m())
    }
    fn range_over_m(&self, low: DVec2, high: DVec2) -> Option<(f64, f64)> {
        let (low, high) = self.base.range_over_m(low, high)?;
        Some((low - self.most_m(), high + self.most_m()))
    }
    fn steepest(&self) -> f64 {
        let octaves = self.octaves().map(|(amplitude, frequency)| amplitude * std::f64::consts::TAU * frequency);
        self.base.steepest() + octaves.sum::<f64>() * 2f64.sqrt()
    }
    fn identity(&self) -> String {
        let text = format!("{} {:?}", self.base.identity(), self.amplitudes_m);
        blake3::hash(text.as_bytes()).to_hex().as_str()[..32].to_string()
    }
    fn truth(&self) -> &'static str {
        "[HeightPyramid, DetailCast, Shade]"
    }
}
