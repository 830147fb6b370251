use glam::{DVec2, DVec3, I64Vec2, UVec2};

use super::turbulence::{self, Turbulent};
use super::{Light, Shade, Turbulence, sun_direction};
use crate::frame::octaves::{for_light, octave_of_pixels};
use crate::frame::relief::height_range_m;
use crate::ground::octaves::{Octaves, Place};
use crate::plan::product::{Drawn, Mesh, MeshLevel, Picture};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::scene::COLOUR_MAP;
use crate::stages::shared::rounding::EPSILON;

impl Reference for Shade {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let drawn: Drawn<_> = buffers.latest()?;
        let map = if self.map { buffers.find(COLOUR_MAP).map(|id| buffers.values(id)) } else { None };
        let map = map.as_deref();
        let is_turbulent = self.turbulence != Turbulence::None && self.turbulence_cells > 0.0 && map.is_some();
        let texture = (is_turbulent && self.turbulence == Turbulence::Texture).then(|| {
            let texture = buffers.put("turbulence", turbulence::texture());
            buffers.values(texture)
        });
        let turbulent = texture.as_deref().map_or(Turbulent::ByPixel, Turbulent::ByTexture);
        let distance = buffers.values(drawn.distance);
        let by_octaves = self.is_lit(matches!(drawn.mesh, Some(Mesh::List(_))));
        let level = buffers.products().find(|level: &MeshLevel<_>| level.distance == drawn.distance);
        let level = level.filter(|_| self.octaves == Light::Mesh).map(|level| buffers.values(level.level));
        let (width_px, height_px) = frame.camera.viewport;
        let mut colour = Values::missing(&[height_px, width_px], 4);
        for y in 0..height_px {
            for x in 0..width_px {
                let at = (y * width_px + x) as usize;
                let ray = frame.camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                let (here, spread) = match distance.value[at] {
                    t if t.is_nan() => (sky(ray), DVec3::ZERO),
                    t => {
                        let depth_m = t * ray.dot(frame.camera.forward());
                        let of_pixels = octave_of_pixels(frame.lattice().cell_m.max_element(), frame.camera, depth_m);
                        let split = match &level {
                            Some(level) => (-level.value[at], level.bound[at]),
                            None => (of_pixels, 1e-6),
                        };
                        let turbulent = is_turbulent.then_some((&turbulent, of_pixels));
                        self.ground(&Lit { frame, map, by_octaves, split, turbulent }, ray, t, distance.bound[at])
                    }
                };
                for channel in 0..4 {
                    let (value, off) = if channel < 3 { (here[channel], spread[channel]) } else { (1.0, 0.0) };
                    // rounding to 8 bits may fall either way
                    let is_open = distance.bound[at].is_infinite()
                        || level.as_ref().is_some_and(|level| level.bound[at].is_infinite());
                    let bound = if is_open { f64::INFINITY } else { 1.0 + 255.0 * off };
                    colour.set(4 * at + channel, (value.clamp(0.0, 1.0) * 255.0).round(), bound);
                }
            }
        }
        let pixels = buffers.put("colour", colour);
        buffers.offer(Picture { pixels });
        Ok(())
    }
}

/// What a pixel is lit by.
struct Lit<'a> {
    frame: &'a Frame<'a>,
    map: Option<&'a Values>,
    /// Octaves turn the normal.
    by_octaves: bool,
    /// The octaves below it turn the normal; how far rounding may move it.
    split: (f64, f64),
    /// What moves places in the map, and the octave with waves of two pixels.
    turbulent: Option<(&'a Turbulent<'a>, f64)>,
}

impl Lit<'_> {
    /// Where the map of colours is looked up, in sample coordinates.
    fn sample(&self, position_m: DVec2, most_cells: f64) -> DVec2 {
        let sample = self.frame.lattice().sample_from_world(position_m);
        let Some((turbulent, split)) = &self.turbulent else { return sample };
        let origin = self.frame.ground.detail().map_or(I64Vec2::ZERO, |detail| detail.octaves().origin);
        sample + most_cells * turbulent.moved(&Place::new(sample, origin), *split)
    }

    fn weight(&self, k: u32, seen: u32) -> f64 {
        if k <= seen { (self.split.0 - f64::from(k)).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The steepest that the octaves can be that may count, in metres a cell.
    fn steepest(&self, octaves: &Octaves) -> f64 {
        let may_count = octaves.each().filter(|(k, _)| f64::from(*k) < self.split.0 + self.split.1 + 1.0);
        may_count.map(|(_, octave)| octave.steepest).sum()
    }
}

impl Shade {
    /// Slope of the octaves at a place, in metres a cell.
    fn octaves_slope(&self, lit: &Lit, position_m: DVec2) -> DVec2 {
        match lit.frame.ground.detail() {
            Some(detail) if lit.by_octaves => {
                let (octaves, seen) = (detail.octaves(), for_light(detail, lit.frame.camera));
                let place = octaves.place(lit.frame.lattice().sample_from_world(position_m));
                octaves.weighted(&place, |k| lit.weight(k, seen)).1
            }
            _ => DVec2::ZERO,
        }
    }

    /// Colour at a distance, and how much it changes within the reach of rounding.
    fn ground(&self, lit: &Lit, ray: DVec3, t: f64, bound: f64) -> (DVec3, DVec3) {
        let Lit { frame, map, .. } = *lit;
        let here = self.colour(lit, ray * t);
        let origin = frame.lattice().sample_from_world(frame.camera.eye_m.truncate()).abs().max_element();
        let cell = frame.lattice().cell_m.max_element();
        let off = bound + 16.0 * EPSILON * (t + frame.camera.eye_m.z.abs() + (origin.fract() + 1.0) * cell);
        // a place in the map is a product of its place on the terrain
        let off = off + map.map_or(0.0, |_| 8.0 * EPSILON * frame.lattice().extent_m().max_element());
        // turbulence moves it by what is rounded, too, and by where the pixel's size is
        let off = off
            + lit.turbulent.as_ref().map_or(0.0, |(turbulent, _)| {
                let off_split = (1e-6 + 2.0 * bound / t.max(1e-9)).min(1.0);
                self.turbulence_cells * cell * (turbulent.off() + 300.0 * EPSILON + 2.0 * off_split)
            });
        let around = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis * off, -axis * off]);
        let spread = around.map(|by| (self.colour(lit, ray * t + by) - here).abs()).fold(DVec3::ZERO, DVec3::max);
        let of_octaves = match frame.ground.detail() {
            Some(detail) if lit.by_octaves => {
                // the distance is what the size of a pixel hangs on, too
                let off_split = lit.split.1 + 2.0 * bound / t.max(1e-9);
                let off = 300.0 * EPSILON + off_split.min(1.0);
                off * lit.steepest(detail.octaves()) / frame.lattice().cell_m.min_element()
            }
            _ => 0.0,
        };
        // a slope of s turns the normal by at most the rounding of s; heights are rounded once
        let (low, high) = frame.ground.range_m();
        let steepest = (high - low) / frame.lattice().cell_m.min_element();
        (here, 2.0 * spread + 64.0 * EPSILON * (1.0 + steepest) + of_octaves)
    }

    fn colour(&self, lit: &Lit, point: DVec3) -> DVec3 {
        let Lit { frame, map, .. } = *lit;
        let light = &frame.data.scene.light;
        let world = point + frame.camera.eye_m;
        // tints are of the scene's heights, whatever a kernel has made of them
        let (low, high) = frame.data.ground.range_m();
        let mut colour = DVec3::splat(0.75);
        if let Some(map) = map {
            colour = map_colour(frame, map, lit.sample(world.truncate(), self.turbulence_cells));
        } else if self.tint {
            colour = tint((world.z - low) / height_range_m(low, high));
        }
        if self.needs_sun(light) {
            let normal = normal(frame, world.truncate(), self.octaves_slope(lit, world.truncate()));
            let lit = normal.dot(sun_direction(light)).max(0.0);
            colour *= light.ambient + (1.0 - light.ambient) * lit;
        }
        colour
    }
}

fn sky(ray: DVec3) -> DVec3 {
    DVec3::new(0.80, 0.87, 0.93).lerp(DVec3::new(0.33, 0.55, 0.83), (ray.z * 2.0).clamp(0.0, 1.0))
}

fn tint(share: f64) -> DVec3 {
    const STOPS: [DVec3; 5] = [
        DVec3::new(0.27, 0.47, 0.30),
        DVec3::new(0.58, 0.65, 0.36),
        DVec3::new(0.70, 0.57, 0.37),
        DVec3::new(0.55, 0.48, 0.43),
        DVec3::new(0.97, 0.97, 0.98),
    ];
    let at = share.clamp(0.0, 1.0) * 4.0;
    let low = at.floor().min(3.0);
    STOPS[low as usize].lerp(STOPS[low as usize + 1], at - low)
}

/// The map's colour over a place, bilinear; its first and last columns and rows are on the terrain's border.
fn map_colour(frame: &Frame, map: &Values, sample: DVec2) -> DVec3 {
    let last = DVec2::new((map.dims[1] - 1).into(), (map.dims[0] - 1).into());
    let lattice = frame.lattice();
    let at = sample / lattice.last().as_dvec2() * last;
    let at = at.clamp(DVec2::ZERO, last);
    let (low, w) = (at.floor(), at - at.floor());
    let texel = |dx: f64, dy: f64| {
        let texel = (low + DVec2::new(dx, dy)).min(last);
        let first = 4 * (texel.y as usize * map.dims[1] as usize + texel.x as usize);
        DVec3::from_slice(&map.value[first..]) / 255.0
    };
    let north = texel(0.0, 0.0).lerp(texel(1.0, 0.0), w.x);
    let south = texel(0.0, 1.0).lerp(texel(1.0, 1.0), w.x);
    north.lerp(south, w.y)
}

fn normal(frame: &Frame, position_m: DVec2, of_octaves: DVec2) -> DVec3 {
    let terrain = frame.lattice();
    let place = terrain.sample_from_world(position_m);
    let low = place.floor();
    let w = place - low;
    let height = |x: f64, y: f64| {
        let x = x.clamp(0.0, f64::from(terrain.size.x - 1)) as u32;
        let y = y.clamp(0.0, f64::from(terrain.size.y - 1)) as u32;
        frame.ground.height_m(UVec2::new(x, y))
    };
    let gradient = |dx: f64, dy: f64| {
        let at = low + DVec2::new(dx, dy);
        DVec2::new(
            height(at.x + 1.0, at.y) - height(at.x - 1.0, at.y),
            height(at.x, at.y + 1.0) - height(at.x, at.y - 1.0),
        ) / 2.0
    };
    let north = gradient(0.0, 0.0).lerp(gradient(1.0, 0.0), w.x);
    let south = gradient(0.0, 1.0).lerp(gradient(1.0, 1.0), w.x);
    let slope = (north.lerp(south, w.y) + of_octaves) / terrain.cell_m;
    DVec3::new(-slope.x, slope.y, 1.0).normalize()
}
