//! What the surface is between height samples, in f64. Nothing else in Rust knows it; its half in WGSL is `kernels/ground/surface.wgsl`.

use glam::{DVec2, DVec4, Vec4};

use crate::experiment::scene::Surface;

/// Heights at the corners of a cell in metres. A place in a cell is in [0, 1]^2 from its north-west corner: columns to the east, rows to
/// the south.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    pub nw: f64,
    pub ne: f64,
    pub sw: f64,
    pub se: f64,
}

/// The surface of a cell as a formula of the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Formula {
    /// At the origin.
    pub height: f64,
    /// For each cell to the east and to the south.
    pub slope: DVec2,
    /// Of a patch, its twist; of a triangle, where the diagonal is, as the sum of a place's columns and rows.
    pub last: f64,
}

impl Formula {
    pub fn as_vec4(&self) -> Vec4 {
        DVec4::new(self.height, self.slope.x, self.slope.y, self.last).as_vec4()
    }
}

/// Which of a cell's two triangles a place is on: they meet on the diagonal from north-east to south-west, which belongs to this one.
pub fn is_north_west(place: DVec2) -> bool {
    place.x + place.y <= 1.0
}

/// A number that is whole where a place in sample coordinates is on the diagonal of a cell.
fn across_diagonals(sample: DVec2) -> f64 {
    sample.x + sample.y
}

/// Where a ray crosses columns, rows and diagonals between two of its places: all that a surface can bend at. (A patch has its largest
/// distance from its edges on its diagonal.) The ray begins at `origin`; it and `direction` are in sample coordinates.
pub fn bends(origin: DVec2, direction: DVec2, from: f64, to: f64) -> Vec<f64> {
    let lines =
        [(origin.x, direction.x), (origin.y, direction.y), (across_diagonals(origin), across_diagonals(direction))];
    let crossings = lines.into_iter().flat_map(|(start, speed)| {
        let (a, b) = (start + speed * from, start + speed * to);
        let (low, high) = (a.min(b).ceil(), a.max(b).floor());
        let is_crossed = speed != 0.0 && high - low < MOST_LINES;
        let lines = (low as i64..=high as i64).take_while(move |_| is_crossed);
        lines.map(move |line| (line as f64 - start) / speed).filter(move |t| (from..=to).contains(t))
    });
    crossings.collect()
}

/// Lines of one direction that a ray is followed over; more than any terrain has.
const MOST_LINES: f64 = 1e6;

impl Cell {
    /// Height of the surface at a place.
    pub fn surface_m(&self, place: DVec2, surface: Surface) -> f64 {
        let Cell { nw, ne, sw, se } = *self;
        let (u, v) = (place.x, place.y);
        match surface {
            Surface::Bilinear => (nw * (1.0 - u) + ne * u) * (1.0 - v) + (sw * (1.0 - u) + se * u) * v,
            Surface::Triangles if is_north_west(place) => nw + (ne - nw) * u + (sw - nw) * v,
            Surface::Triangles => se + (sw - se) * (1.0 - u) + (ne - se) * (1.0 - v),
        }
    }

    /// Slope of one of the two triangles, in metres a cell.
    pub fn slope(&self, is_north_west: bool) -> DVec2 {
        let Cell { nw, ne, sw, se } = *self;
        if is_north_west { DVec2::new(ne - nw, sw - nw) } else { DVec2::new(se - sw, se - ne) }
    }

    /// The surface of the cell over places that are counted from another origin, of which the cell's north-west corner is at `corner`.
    pub fn formula(&self, corner: DVec2, surface: Surface, is_north_west: bool) -> Formula {
        let Cell { nw, se, .. } = *self;
        match surface {
            Surface::Bilinear => {
                let (slope, twist) = (self.slope(true), self.twist());
                Formula {
                    height: nw - slope.dot(corner) + twist * corner.x * corner.y,
                    slope: slope - twist * DVec2::new(corner.y, corner.x),
                    last: twist,
                }
            }
            Surface::Triangles => {
                let slope = self.slope(is_north_west);
                let height = if is_north_west { nw - slope.dot(corner) } else { se - slope.dot(corner + 1.0) };
                Formula { height, slope, last: corner.x + corner.y + 1.0 }
            }
        }
    }

    /// The steepest slope of the surface, as a tangent.
    pub fn steepest(&self, cell_m: DVec2, surface: Surface) -> f64 {
        let (first, second) = (self.slope(true) / cell_m, self.slope(false) / cell_m);
        match surface {
            Surface::Triangles => first.length().max(second.length()),
            Surface::Bilinear => first.abs().max(second.abs()).length(),
        }
    }

    /// Lowest and highest corner.
    pub fn range(&self) -> (f64, f64) {
        let Cell { nw, ne, sw, se } = *self;
        (nw.min(ne).min(sw).min(se), nw.max(ne).max(sw).max(se))
    }

    /// The corner that is farthest from the height 0.
    pub fn largest(&self) -> f64 {
        let (low, high) = self.range();
        low.abs().max(high.abs())
    }

    /// By how much the cell is not flat: what a patch is twisted by, and twice the distance of the two diagonals.
    pub fn twist(&self) -> f64 {
        self.nw - self.ne - self.sw + self.se
    }
}
