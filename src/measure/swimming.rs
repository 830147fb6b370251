//! How far a mesh moves over ground that stays where it is, from frame to frame, and how far it is from the surface there.

use glam::{DVec2, DVec3, IVec2, UVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::distribution::Distribution;
use super::mesh::Subject;
use super::triangles::{Listed, Triangles, grid_triangles};
use super::{Column, Info, Kind, Known, Measure, Measured, Seen, Show, Sums, Tally, read_as};
use crate::camera::Camera;
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::plan::product::Mesh;
use crate::plan::{BufferId, Chain};

pub const INFO: Info = Info {
    name: "Swimming",
    summary: "how far a mesh moves over points of the ground that stay where they are, from frame to frame; and how far it is from the surface there",
    version: 1,
    parameters: schema::<Swimming>,
    read: read_as::<Swimming>,
    figures: &[
        Known::new(
            "swimming_max",
            "px",
            Kind::Error,
            "largest change of height between two frames, in the picture of the second",
        ),
        Known::new("swimming_mean", "px", Kind::Error, "mean of it"),
        Known::new("swimming_rms", "px", Kind::Error, "root of its mean square"),
        Known::new("swimming_p50", "px", Kind::Error, "median of it"),
        Known::new("swimming_p95", "px", Kind::Error, "95th percentile of it"),
        Known::new("swimming_p99", "px", Kind::Error, "99th percentile of it"),
        Known::new(
            "height_rms",
            "m",
            Kind::Error,
            "root of the mean square of mesh minus surface at the points in the picture",
        ),
        Known::new("height_max", "m", Kind::Error, "largest of it, without its sign"),
        Known::new(
            "points_seen",
            "of points",
            Kind::Other,
            "share of the points that are in the picture, hidden ones too",
        ),
    ],
    columns: &[
        Column { heading: "swim rms px", figure: "swimming_rms", show: Show::Number },
        Column { heading: "height rms m", figure: "height_rms", show: Show::Number },
    ],
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Swimming {
    /// points along each side of the terrain
    #[schemars(range(min = 2, max = 4096))]
    points: u32,
}

impl Default for Swimming {
    fn default() -> Self {
        Self { points: 256 }
    }
}

impl Measure for Swimming {
    fn needs(&self, chain: &Chain) -> Result<Vec<BufferId>, Diagnostic> {
        Subject::of(chain.products()).buffers(chain)
    }

    fn begin(&self) -> Box<dyn Tally> {
        Box::new(Summary { points: self.points, ..Summary::default() })
    }
}

/// Over the frames.
#[derive(Clone, Debug, Default)]
struct Summary {
    points: u32,
    swimming: Distribution,
    /// Points in the picture, of all, and the squares of mesh minus surface.
    seen: usize,
    all: usize,
    squares: f64,
    largest_m: f64,
    /// The last frame, and the mesh's height over each point in it.
    last: Option<(usize, Vec<f64>)>,
}

impl Sums for Summary {
    fn of_frame(&self, seen: &Seen) -> Self {
        let mut own = Self { points: self.points, ..Self::default() };
        let (ground, camera) = (seen.data.ground.as_ref(), seen.camera());
        let triangles = match Subject::of(&seen.plan.products).mesh {
            None => return own,
            Some(Mesh::Grid(grid)) => {
                let columns = seen.plan.buffer(grid.vertex).dims[1] as usize;
                grid_triangles(&seen.read(grid.vertex), columns)
            }
            Some(Mesh::List(list)) => {
                let corners = seen.read::<u32>(list.count).first().copied().unwrap_or(0);
                Listed::new(&seen.read(list.triangle), corners).placed(ground, camera)
            }
        };
        let points = Points { side: self.points, extent_m: ground.lattice().extent_m() };
        let heights_m = points.heights_m(&triangles, camera.eye_m);
        let before = self.last.as_ref().filter(|(frame, _)| frame + 1 == seen.frame).map(|(_, heights_m)| heights_m);
        for (at, height_m) in heights_m.iter().enumerate().filter(|(_, height_m)| !height_m.is_nan()) {
            let point_m = points.at_m(at).extend(*height_m);
            if !is_in_picture(camera, point_m) {
                continue;
            }
            let off_m = (height_m - ground.surface_at(point_m).z).abs();
            own.seen += 1;
            own.squares += off_m * off_m;
            own.largest_m = own.largest_m.max(off_m);
            let moved_px = before.and_then(|before| moved_px(camera, point_m, before[at]));
            moved_px.into_iter().for_each(|moved_px| own.swimming.count(moved_px));
        }
        own.all = heights_m.len();
        own.last = Some((seen.frame, heights_m));
        own
    }

    fn add(&mut self, frame: Self) {
        self.swimming.merge(&frame.swimming);
        self.seen += frame.seen;
        self.all += frame.all;
        self.squares += frame.squares;
        self.largest_m = self.largest_m.max(frame.largest_m);
        self.last = frame.last;
    }

    fn measured(&self) -> Vec<Measured> {
        let is_seen = self.seen > 0;
        let mut measured = self.swimming.named("swimming");
        measured.extend([
            Measured::new("height_rms", is_seen.then(|| (self.squares / self.seen as f64).sqrt()), "m"),
            Measured::new("height_max", is_seen.then_some(self.largest_m), "m"),
            Measured::new("points_seen", (self.all > 0).then(|| self.seen as f64 / self.all as f64), "of points"),
        ]);
        measured
    }
}

fn size_px(camera: &Camera) -> DVec2 {
    DVec2::new(camera.viewport.0.into(), camera.viewport.1.into())
}

fn is_in_picture(camera: &Camera, point_m: DVec3) -> bool {
    let inside = |pixel: DVec2| pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(size_px(camera)).all();
    camera.pixel(point_m).is_some_and(inside)
}

/// How far in the picture a point is from where it was, at another height in the frame before; `None` if there was no mesh.
fn moved_px(camera: &Camera, point_m: DVec3, before_m: f64) -> Option<f64> {
    let size = size_px(camera);
    let now = camera.pixel(point_m)?;
    if before_m.is_nan() {
        return None;
    }
    // what was behind the eye was as far away as anything in the picture can be
    let then = camera.pixel(point_m.truncate().extend(before_m));
    Some(then.map_or(size.length(), |then| then.distance(now).min(size.length())))
}

/// Points in rows and columns over the terrain.
struct Points {
    side: u32,
    extent_m: DVec2,
}

impl Points {
    /// In the middles of equal parts, so that none is on the border.
    fn at_m(&self, at: usize) -> DVec2 {
        let place = UVec2::new(at as u32 % self.side, at as u32 / self.side).as_dvec2() + 0.5;
        place / f64::from(self.side) * self.extent_m
    }

    /// Height of a mesh over each point; NaN where there is none. Where a mesh is folded it has the highest.
    fn heights_m(&self, mesh: &Triangles, eye_m: DVec3) -> Vec<f64> {
        let mut heights_m = vec![f64::NAN; (self.side * self.side) as usize];
        let part_m = self.extent_m / f64::from(self.side);
        for corners in &mesh.corners {
            let corners = corners.map(|corner| DVec3::from(corner.map(f64::from)) + eye_m);
            let [a, b, c] = corners;
            let place = |corner: DVec3| corner.truncate() / part_m - 0.5;
            let low = corners.map(place).into_iter().fold(DVec2::MAX, DVec2::min).ceil().max(DVec2::ZERO);
            let most = DVec2::splat(f64::from(self.side - 1));
            let high = corners.map(place).into_iter().fold(DVec2::MIN, DVec2::max).floor().min(most);
            let (low, high) = (low.as_ivec2(), high.as_ivec2());
            let normal = (b - a).cross(c - a);
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let at = (IVec2::new(x, y).as_dvec2() + 0.5) * part_m;
                    let side = |from: DVec3, to: DVec3| (to - from).truncate().perp_dot(at - from.truncate());
                    let sides = [side(a, b), side(b, c), side(c, a)];
                    let is_over = sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0);
                    if is_over && normal.z != 0.0 {
                        let height_m = a.z - normal.truncate().dot(at - a.truncate()) / normal.z;
                        let known = &mut heights_m[(y as u32 * self.side + x as u32) as usize];
                        *known = known.max(height_m);
                    }
                }
            }
        }
        heights_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles over a square of 100 m whose height is x + 2 y.
    fn slope() -> Triangles {
        let corner = |x: f32, y: f32| [x, y, x + 2.0 * y];
        let [nw, ne, sw, se] = [corner(0.0, 100.0), corner(100.0, 100.0), corner(0.0, 0.0), corner(100.0, 0.0)];
        Triangles { corners: vec![[nw, sw, ne], [ne, sw, se]], border: Vec::new() }
    }

    #[test]
    fn heights_are_those_of_the_plane_and_nothing_is_beside_it() {
        let points = Points { side: 8, extent_m: DVec2::new(200.0, 100.0) };
        let heights_m = points.heights_m(&slope(), DVec3::ZERO);
        for (at, height_m) in heights_m.into_iter().enumerate() {
            let place = points.at_m(at);
            match place.x < 100.0 {
                true => assert!((height_m - (place.x + 2.0 * place.y)).abs() < 1e-9, "{place} {height_m}"),
                false => assert!(height_m.is_nan(), "{place} {height_m}"),
            }
        }
    }

    #[test]
    fn what_is_raised_moves_by_that_in_the_picture() {
        let scene = "(terrain: Shape(kind: Flat, size: (33, 33), cell_m: 10, height_m: (50, 50)), camera: Still(eye: (160, 0, 50)), \
                     viewport: (200, 100), fov_deg: 90)";
        let scene: crate::experiment::scene::Scene =
            crate::experiment::tree::Node::read(&crate::experiment::diagnostic::Source::new("test", scene))
                .unwrap()
                .parse()
                .unwrap();
        let camera = Camera::looking_at(DVec3::new(160.0, 0.0, 50.0), DVec3::new(160.0, 100.0, 50.0), &scene);
        // 100 m away, half of 100 rows are 100 m: half a pixel a metre
        assert_eq!(moved_px(&camera, DVec3::new(160.0, 100.0, 56.0), 50.0), Some(3.0));
        assert_eq!(moved_px(&camera, DVec3::new(160.0, 100.0, 56.0), f64::NAN), None);
        assert_eq!(moved_px(&camera, DVec3::new(160.0, -100.0, 56.0), 50.0), None);
    }
}
