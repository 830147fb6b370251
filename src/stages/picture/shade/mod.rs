mod reference;

use glam::{DVec3, UVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::experiment::scene::Light;
use crate::kernel::{Elem, Kernel};
use crate::plan::product::{Drawn, Picture, what};
use crate::plan::{Chain, Packing};
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Shade",
    summary: "distances to a picture: hypsometric tint, sun, sky",
    formula: "colour = tint(height) (ambient + (1 - ambient) max(n . sun, 0)); n from central differences",
    source: "deferred shading as in Loeffler et al. 2009, section 4",
    reads: &["height"],
    writes: &["colour"],
    needs: &[what::<Drawn<()>>()],
    offers: &[what::<Picture<()>>()],
    parameters: schema::<Shade>,
    read: read_as::<Shade>,
    examples: &[
        Example::new("[HeightPyramid, RayCast, Shade]"),
        Example::new("[HeightPyramid, ViewGrid(size: (23, 17)), Project, Rasterize, Shade]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Shade {
    /// colour by height; false is one grey
    tint: bool,
    /// light by the sun; false is flat colour
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
        let (width_px, height_px) = chain.data.scene.viewport;
        let samples = chain.data.terrain.size;
        let height = chain.read_as("height", Elem::F32, &[samples.y, samples.x])?;
        let Drawn { distance, .. } = chain.latest()?;
        let light = chain.data.scene.light;
        let pixels = u64::from(width_px) * u64::from(height_px);
        if !self.needs_sun(&light) {
            let reason = if self.sun { "the light is all ambient" } else { "`sun: false`" };
            chain.leave_out("normals and sun", reason, 0, pixels);
        }
        if !self.tint {
            chain.leave_out("the colour ramp", "`tint: false`", 0, pixels);
        }
        let colour =
            chain.make("colour", Elem::U32, &[height_px, width_px], "rgba8", "picture, red in the lowest byte");
        chain.set_packing(colour, Packing::Bytes);
        let kernel = Kernel::built_in("picture/shade.wgsl")?;
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
            .over(UVec2::new(width_px, height_px))?;
        chain.offer(Picture { pixels: colour });
        Ok(())
    }
}
