mod reference;
mod turbulence;

use glam::{DVec3, UVec2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::parameters::schema;
use crate::experiment::scene;
use crate::kernel::{Elem, Packing};
use crate::plan::product::{Drawn, Mesh, MeshLevel, Picture, what};
use crate::plan::{BufferId, Chain, Spread};
use crate::scene::COLOUR_MAP;
use crate::stages::{Example, Info, Stage, read_as};

pub const INFO: Info = Info {
    name: "Shade",
    summary: "distances to a picture: hypsometric tint or the scene's map of colours, sun, sky",
    formula: "colour = (map or tint(height)) (ambient + (1 - ambient) max(n . sun, 0)); n from central differences and the slopes of octaves",
    source: "deferred shading as in Loeffler et al. 2009, section 4; octaves up to the pixel after Dachsbacher, Stamminger 2004, section 4.1",
    reads: &["mesh_level"],
    writes: &["colour", "turbulence"],
    needs: &[what::<Drawn<()>>()],
    offers: &[what::<Picture<()>>()],
    parameters: schema::<Shade>,
    read: read_as::<Shade>,
    examples: &[
        Example::new("[HeightPyramid, RayCast, Shade]"),
        Example::new("[HeightPyramid, ViewGrid(size: (23, 17)), Project, Rasterize, Shade]")
            .in_benches(&[("ViewGrid.size", "(512, 384)")]),
        Example::new("[HeightPyramid, RayCast, Shade(turbulence: Pixel)]"),
        Example::new(
            "[HeightPyramid, ViewGrid(size: (23, 17)), Project, Rasterize, Shade(turbulence: Texture, octaves: Mesh)]",
        )
        .in_benches(&[("ViewGrid.size", "(512, 384)")]),
    ],
    ..Info::EMPTY
};

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Shade {
    /// the scene's map of colours, where it has one
    map: bool,
    /// colour by height, where there is no map; false is one grey
    tint: bool,
    /// light by the sun; false is flat colour
    sun: bool,
    /// which octaves of the scene's detail turn the normal
    octaves: Light,
    /// how borders in the map of colours are washed out, by turbulence that moves the places where it is looked up
    turbulence: Turbulence,
    /// how far turbulence moves a place at most, in cells
    #[schemars(range(min = 0, max = 10000))]
    turbulence_cells: f64,
}

/// Where turbulence is from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
enum Turbulence {
    /// there is none
    #[default]
    None,
    /// made for each pixel, never the same in two places
    Pixel,
    /// a periodic texture of 512 x 512 texels over 16 x 16 cells, with levels
    Texture,
}

/// Which octaves turn the normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
enum Light {
    /// all with waves of two pixels and more
    #[default]
    Pixels,
    /// those that the mesh holds; of rays, as `Pixels`
    Mesh,
    /// none
    None,
}

impl Default for Shade {
    fn default() -> Self {
        Self {
            map: true,
            tint: true,
            sun: true,
            octaves: Light::default(),
            turbulence: Turbulence::default(),
            turbulence_cells: 2.0,
        }
    }
}

impl Shade {
    /// Octaves can turn the normal; a mesh of samples holds none.
    fn is_lit(&self, is_of_samples: bool) -> bool {
        match self.octaves {
            Light::Pixels => true,
            Light::Mesh => !is_of_samples,
            Light::None => false,
        }
    }

    /// Ambient light alone does not ask where the sun is.
    fn needs_sun(&self, light: &scene::Light) -> bool {
        self.sun && light.ambient < 1.0
    }
}

fn sun_direction(light: &scene::Light) -> DVec3 {
    let (azimuth, elevation) = (light.azimuth_deg.to_radians(), light.elevation_deg.to_radians());
    DVec3::new(azimuth.sin() * elevation.cos(), azimuth.cos() * elevation.cos(), elevation.sin())
}

impl Shade {
    /// Says what a picture does without.
    fn leave_out(&self, chain: &mut Chain, has: &Has) {
        let (width_px, height_px) = chain.data.scene.viewport;
        let pixels = u64::from(width_px) * u64::from(height_px);
        if !has.sun {
            let reason = if self.sun { "the light is all ambient" } else { "`sun: false`" };
            chain.leave_out("normals and sun", reason, 0, pixels);
        }
        if !(has.octaves && has.sun) {
            let reason = match self.octaves {
                _ if chain.octaves().is_none() => "the scene has no detail",
                _ if !has.sun => "nothing is lit by the sun",
                Light::None => "`octaves: None`",
                _ => "the mesh is of samples, and holds none",
            };
            chain.leave_out("octaves in the normals", reason, 0, 0);
        }
        if self.turbulence != Turbulence::None && !has.turbulence {
            let nothing = "there is no map of colours whose borders it could wash out";
            chain.leave_out("turbulence", if has.map { "it moves nothing" } else { nothing }, 0, 0);
        }
        match (has.map, self.tint) {
            (true, true) => chain.leave_out("the colour ramp", "the scene has a map of colours", 0, pixels),
            (_, false) => chain.leave_out("the colour ramp", "`tint: false`", 0, pixels),
            (false, true) => {}
        }
    }
}

/// What a picture has.
struct Has {
    sun: bool,
    /// They turn the normal.
    octaves: bool,
    map: bool,
    turbulence: bool,
}

impl Stage for Shade {
    fn plan(&self, chain: &mut Chain) -> Result<(), Diagnostic> {
        let (width_px, height_px) = chain.data.scene.viewport;
        let Drawn { distance, mesh, .. } = chain.latest()?;
        let light = chain.data.scene.light;
        let level = chain.products().find(|level: &MeshLevel<BufferId>| level.distance == distance);
        let level = level.filter(|_| self.octaves == Light::Mesh).map(|level| level.level);
        let map = chain.input(COLOUR_MAP).filter(|_| self.map);
        let has = Has {
            sun: self.needs_sun(&light),
            octaves: self.is_lit(matches!(mesh, Some(Mesh::List(_)))) && chain.octaves().is_some(),
            map: map.is_some(),
            turbulence: self.turbulence != Turbulence::None && self.turbulence_cells > 0.0 && map.is_some(),
        };
        self.leave_out(chain, &has);
        let texture = match has.turbulence && self.turbulence == Turbulence::Texture {
            true => Some(turbulence::make_texture(chain)?),
            false => None,
        };
        let map_size = map.map_or([1, 1], |map| [chain.buffer(map).dims[1], chain.buffer(map).dims[0]]);
        let colour = chain.make_over("colour", Elem::U32, Spread::Pixels, "rgba8", "picture, red in the lowest byte");
        chain.set_packing(colour, Packing::Bytes);
        let kernel = chain.kernel("picture/shade.wgsl")?;
        chain
            .step("shade", &kernel, "main")
            .bind("distance", distance)
            .bind("colour", colour)
            .bind_or_leave("colour_map", map)
            .bind_or_leave("mesh_level", level)
            .bind_or_leave("turbulence_texture", texture)
            .constant("TURBULENT", f64::from(has.turbulence))
            .constant("BY_TEXTURE", f64::from(texture.is_some()))
            .set("turbulence_cells", self.turbulence_cells as f32)
            .constant("LIT", f64::from(has.octaves))
            .constant("BY_MESH", f64::from(level.is_some()))
            .constant("MAP", f64::from(has.map))
            .constant("TINT", f64::from(self.tint && !has.map))
            .constant("SUN", f64::from(has.sun))
            .set("sun", sun_direction(&light).as_vec3().to_array())
            .set("ambient", light.ambient as f32)
            .set("map_size", map_size)
            .over(UVec2::new(width_px, height_px))?;
        chain.offer(Picture { pixels: colour });
        Ok(())
    }
}
