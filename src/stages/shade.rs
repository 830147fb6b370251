use glam::{DVec2, DVec3, UVec2};
use serde::Deserialize;

use super::{EPSILON, Info, Stage};
use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Light;
use crate::kernel::{Elem, Kernel};
use crate::plan::Chain;
use crate::reference::{Buffers, Frame, Values};

pub const INFO: Info = Info {
    name: "Shade",
    summary: "distances to a picture: hypsometric tint, sun, sky",
    formula: "colour = tint(height) (ambient + (1 - ambient) max(n . sun, 0)); n from central differences",
    source: "deferred shading as in Loeffler et al. 2009, section 4",
    reads: &["height", "distance"],
    writes: &["colour"],
    kernels: &["shade.wgsl"],
    params: &[
        ("tint", "true", "colour by height; false is one grey"),
        ("sun", "true", "light by the sun; false is flat colour"),
    ],
    read: |node, _| Ok(Box::new(node.parse_fields::<Shade>()?)),
};

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Shade {
    tint: bool,
    sun: bool,
}

impl Default for Shade {
    fn default() -> Self {
        Self { tint: true, sun: true }
    }
}

impl Shade {
    /// Ambient light alone does not ask where the sun is.
    fn needs_sun(&self, light: &Light) -> bool {
        self.sun && light.ambient < 1.0
    }
}

/// A flat terrain has one colour, not a division by zero.
fn height_range_m(low: f64, high: f64) -> f64 {
    if high > low { high - low } else { 1.0 }
}

fn sun_direction(light: &Light) -> DVec3 {
    let (azimuth, elevation) = (light.azimuth_deg.to_radians(), light.elevation_deg.to_radians());
    DVec3::new(azimuth.sin() * elevation.cos(), azimuth.cos() * elevation.cos(), elevation.sin())
}

impl Stage for Shade {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (width, tall) = chain.data.scene.viewport;
        let samples = chain.data.terrain.size;
        let height = chain.read_as("height", Elem::F32, &[samples.y, samples.x])?;
        let distance = chain.read_as("distance", Elem::F32, &[tall, width])?;
        let light = chain.data.scene.light;
        let pixels = u64::from(width) * u64::from(tall);
        if !self.needs_sun(&light) {
            let reason = if self.sun { "the light is all ambient" } else { "`sun: false`" };
            chain.leave_out("normals and sun", reason, 0, pixels);
        }
        if !self.tint {
            chain.leave_out("the colour ramp", "`tint: false`", 0, pixels);
        }
        let colour = chain.make("colour", Elem::U32, &[tall, width], RGBA8, "picture, red in the lowest byte");
        let kernel = Kernel::built_in("shade.wgsl")?;
        let (low, high) = chain.data.range_m;
        chain
            .step("shade", &kernel, "main")
            .bind("height", height)
            .bind("distance", distance)
            .bind("colour", colour)
            .constant("TINT", f64::from(self.tint))
            .constant("SUN", f64::from(self.needs_sun(&light)))
            .set_camera()
            .set_terrain()
            .set("sun", sun_direction(&light).as_vec3().to_array())
            .set("ambient", light.ambient as f32)
            .set_per_frame("low_m", |camera| (low - camera.eye_m.z) as f32)
            .set("range_m", height_range_m(low, high) as f32)
            .over(UVec2::new(width, tall))
    }

    fn reference(&self, frame: &Frame, buffers: &mut Buffers) {
        let distance = buffers.get("distance");
        let (width, tall) = frame.camera.viewport;
        let mut colour = Values::missing(&[tall, width], 4);
        for y in 0..tall {
            for x in 0..width {
                let at = (y * width + x) as usize;
                let ray = frame.camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                let (here, spread) = match distance.value[at] {
                    t if t.is_nan() => (sky(ray), DVec3::ZERO),
                    t => self.ground(frame, ray, t, distance.bound[at]),
                };
                for channel in 0..4 {
                    let (value, off) = if channel < 3 { (here[channel], spread[channel]) } else { (1.0, 0.0) };
                    // rounding to 8 bits may fall either way
                    let bound = if distance.bound[at].is_infinite() { f64::INFINITY } else { 1.0 + 255.0 * off };
                    colour.set(4 * at + channel, (value.clamp(0.0, 1.0) * 255.0).round(), bound);
                }
            }
        }
        buffers.put("colour", colour);
    }
}

/// The unit of a buffer of pixels with four bytes each.
pub const RGBA8: &str = "rgba8";

impl Shade {
    /// Colour at a distance, and how much it changes within the reach of rounding.
    fn ground(&self, frame: &Frame, ray: DVec3, t: f64, bound: f64) -> (DVec3, DVec3) {
        let here = self.colour(frame, ray * t);
        let origin = frame.data.terrain.sample_from_world(frame.camera.eye_m.truncate()).abs().max_element();
        let cell = frame.data.terrain.cell_m.max_element();
        let off = bound + 16.0 * EPSILON * (t + frame.camera.eye_m.z.abs() + (origin.fract() + 1.0) * cell);
        let around = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis * off, -axis * off]);
        let spread = around.map(|by| (self.colour(frame, ray * t + by) - here).abs()).fold(DVec3::ZERO, DVec3::max);
        // a slope of s turns the normal by at most the rounding of s; heights are rounded once
        let steepest = (frame.data.range_m.1 - frame.data.range_m.0) / frame.data.terrain.cell_m.min_element();
        (here, 2.0 * spread + 64.0 * EPSILON * (1.0 + steepest))
    }

    fn colour(&self, frame: &Frame, point: DVec3) -> DVec3 {
        let light = &frame.data.scene.light;
        let world = point + frame.camera.eye_m;
        let (low, high) = frame.data.range_m;
        let mut colour = DVec3::splat(0.75);
        if self.tint {
            colour = tint((world.z - low) / height_range_m(low, high));
        }
        if self.needs_sun(light) {
            let lit = normal(frame, world.truncate()).dot(sun_direction(light)).max(0.0);
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

fn normal(frame: &Frame, position_m: DVec2) -> DVec3 {
    let terrain = &frame.data.terrain;
    let place = terrain.sample_from_world(position_m);
    let low = place.floor();
    let w = place - low;
    let height = |x: f64, y: f64| {
        let x = x.clamp(0.0, f64::from(terrain.size.x - 1)) as u32;
        let y = y.clamp(0.0, f64::from(terrain.size.y - 1)) as u32;
        f64::from(terrain.height_m(x, y))
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
    let slope = north.lerp(south, w.y) / terrain.cell_m;
    DVec3::new(-slope.x, slope.y, 1.0).normalize()
}
