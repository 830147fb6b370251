//! The ground: what the surface is, in f64. Cameras, truth, measures, the projector and the references ask it and nothing else.
//!
//! Its other half is what kernels include, `kernels/ground/`. ARCHITECTURE says what each kind of ground has to answer.

pub mod cast;
pub mod cell;
mod detail;
pub mod foreground;
mod lattice;
pub mod octaves;
pub mod pyramid;
mod samples;

use std::fmt::Debug;

use glam::{DVec2, DVec3, UVec2};

pub use detail::{Detailed, Gap};
pub use lattice::Lattice;
pub use samples::Samples;

/// A line of sight: `eye_m + t direction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    pub eye_m: DVec3,
    pub direction: DVec3,
}

impl Ray {
    pub fn at(&self, t: f64) -> DVec3 {
        self.eye_m + self.direction * t
    }
}

/// A box in the world with everything of the surface that is over (or under, or behind) its part of the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    pub low_m: DVec3,
    pub high_m: DVec3,
}

/// A surface, over a lattice of samples. All positions are in world metres.
pub trait Ground: Debug + Send + Sync {
    /// The finest samples.
    fn lattice(&self) -> Lattice;

    /// Height of a sample. Not of the surface there, where octaves are added between samples and at them.
    fn height_m(&self, sample: UVec2) -> f64;

    /// Where a sample is.
    fn sample_m(&self, sample: UVec2) -> DVec3;

    /// The unit vector away from the ground at a place.
    fn up(&self, point_m: DVec3) -> DVec3;

    /// The point of the surface at the same place on the ground; of a point beyond the border, at the border's height.
    fn surface_at(&self, point_m: DVec3) -> DVec3;

    /// How far a point is above the surface; negative under it.
    fn above_m(&self, point_m: DVec3) -> f64 {
        (point_m - self.surface_at(point_m)).dot(self.up(point_m))
    }

    /// How far the place of a point is inside the border, on the ground; negative beyond it, infinite where there is none.
    fn margin_m(&self, point_m: DVec3) -> f64;

    /// From where to where a ray is over the ground and can meet it; `None` if it never is.
    fn stay(&self, ray: &Ray) -> Option<(f64, f64)>;

    /// Of a part of a ray, what is not over all of the surface or under all of it; or more than that.
    fn among_heights(&self, _ray: &Ray, part: (f64, f64)) -> (f64, f64) {
        part
    }

    /// Where between two places on a ray the surface under it changes its formula, in no order. Between two such places it is smooth.
    fn bends(&self, ray: &Ray, from: f64, to: f64) -> Vec<f64>;

    /// Places in a part of a ray: the surface comes nowhere farther over it than at one of them (or, with a `side` of -1, under it). Over
    /// octaves, by no more than a 20th of that and 2e-6 of the way.
    fn crests(&self, ray: &Ray, part: (f64, f64), _side: f64) -> Vec<f64> {
        let (from, to) = self.among_heights(ray, part);
        let mut places = self.bends(ray, from, to);
        places.push(to);
        places
    }

    /// Where a ray first meets the surface.
    fn first_hit(&self, ray: &Ray) -> Option<f64> {
        let part = self.stay(ray)?;
        cast::first_hit_in(self, ray, part, cast::side(self, ray, part.0))
    }

    /// Boxes that hold all of the surface, at most a few hundred.
    fn parts(&self) -> &[Part];

    /// Lowest and highest of the surface in metres.
    fn range_m(&self) -> (f64, f64);

    /// No part of the surface over a rectangle of sample coordinates is lower or higher; `None` if none of it is on the ground.
    fn range_over_m(&self, low: DVec2, high: DVec2) -> Option<(f64, f64)>;

    /// The steepest slope of the surface anywhere, as a tangent: nowhere do its heights differ by more than this times the distance.
    fn steepest(&self) -> f64;

    /// The steepest that kernels have to tell heights apart on: a slope, or how much the heights of one cell differ over the least distance
    /// from which formulas in f32 are made for it.
    fn steepest_seen(&self) -> f64 {
        self.steepest()
    }

    /// What this is, if it has octaves over the surface between its samples.
    fn detail(&self) -> Option<&Detailed> {
        None
    }

    /// Everything that decides what it answers, in 32 hexadecimal digits.
    fn identity(&self) -> String;

    /// The chain that draws it exactly: what a picture of it is compared with.
    fn truth(&self) -> &'static str;

    /// Where an eye stands that asks for this place and this clearance. One that is closer to the surface than [`STANDING_M`] stands that
    /// much above it.
    fn stand(&self, eye_m: DVec3, clearance_m: Option<f64>) -> DVec3 {
        let (surface, up) = (self.surface_at(eye_m), self.up(eye_m));
        let above_m = self.above_m(eye_m);
        let lifted = clearance_m.filter(|clearance_m| above_m < *clearance_m);
        let eye_m = lifted.map_or(eye_m, |clearance_m| surface + up * clearance_m);
        // beyond the border there is surface within that distance, too
        let is_standing = self.margin_m(eye_m) > -STANDING_M && self.above_m(eye_m).abs() < STANDING_M;
        if is_standing { surface + up * STANDING_M } else { eye_m }
    }

    /// An eye at this place can see the surface from below: it is under it, or beyond the border.
    fn can_see_underside(&self, eye_m: DVec3) -> bool {
        self.margin_m(eye_m) < 0.0 || self.above_m(eye_m) < 0.0
    }

    /// Every height is the same.
    fn is_flat(&self) -> bool {
        let (low, high) = self.range_m();
        low == high
    }
}

/// What is off by no more than this counts as exact, in pixels.
pub const EXACT_PX: f64 = 0.01;

/// An eye that is placed less than this from the surface is moved to this height above it, so that "above or below" has an answer.
pub const STANDING_M: f64 = 0.01;
