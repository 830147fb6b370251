//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/relief.wgsl
//!include ground as image
//!include ground/octaves.wgsl
//!include lib/turbulence.wgsl
// Distances to a picture: hypsometric tint or a map of colours, sun on the normal of the full-resolution terrain, sky.

struct Params {
    camera: Camera,
    terrain: Terrain,
    octaves: Octaves,
    relief: Relief,
    /// Unit vector to the sun.
    sun: vec3<f32>,
    ambient: f32,
    /// Columns and rows of the map of colours.
    map_size: vec2<u32>,
    /// How far turbulence moves a place in it at most.
    turbulence_cells: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> distance: array<f32>;
@group(0) @binding(2) var<storage, read_write> colour: array<u32>;

/// Colours of the ground, red in the lowest byte; the first and last columns and rows are on the terrain's border.
@group(0) @binding(3) var<storage, read> colour_map: array<u32>;

/// Pyramid level of the mesh at each pixel, or minus its split octave.
@group(0) @binding(4) var<storage, read> mesh_level: array<f32>;

/// A periodic texture of turbulence, its levels one after the other; east in the lowest byte, south in the next.
@group(0) @binding(5) var<storage, read> turbulence_texture: array<u32>;

/// Turbulence moves the place in the map of colours,
override TURBULENT: bool = false;
/// and is looked up in the texture.
override BY_TEXTURE: bool = false;
/// The finest octave of turbulence that is made for each pixel.
const TURBULENCE_FINEST: u32 = 8u;

/// Octaves turn the normal,
override LIT: bool = false;
/// and only those that the mesh holds.
override BY_MESH: bool = false;
/// The ground has a colour of its own.
override MAP: bool = false;
override TINT: bool = true;
override SUN: bool = true;

/// Lowland green, yellow, brown, rock, snow.
fn tint(share: f32) -> vec3<f32> {
    // from stop to stop, each of which is reached whole before the next one begins: an array that is indexed is slow on software adapters
    let at = clamp(share, 0.0, 1.0) * 4.0;
    let low = mix(vec3(0.27, 0.47, 0.30), vec3(0.58, 0.65, 0.36), min(at, 1.0));
    let middle = mix(low, vec3(0.70, 0.57, 0.37), clamp(at - 1.0, 0.0, 1.0));
    let high = mix(middle, vec3(0.55, 0.48, 0.43), clamp(at - 2.0, 0.0, 1.0));
    return mix(high, vec3(0.97, 0.97, 0.98), clamp(at - 3.0, 0.0, 1.0));
}

/// Slope of the octaves below a split, and of the one it is in by its fraction, in metres a cell.
fn octaves_slope(cells: vec2<f32>, split: f32) -> vec2<f32> {
    var slope = vec2(0.0);
    let place = octave_place(cells);
    var amplitude_m = params.octaves.amplitude_m;
    for (var k = 1u; k <= params.octaves.for_light && f32(k) < split; k++) {
        let weight = min(split - f32(k), 1.0) * amplitude_m * octave_cells(k);
        slope += weight * octave_noise(place, k).yz;
        amplitude_m *= params.octaves.persistence;
    }
    return slope;
}

/// Unit normal in the world, from central differences blended bilinearly between the four samples around, and octaves up to a split.
fn normal(position_m: vec2<f32>, split: f32) -> vec3<f32> {
    let cells = cells_from_world(params.terrain, position_m);
    let place = cells + params.terrain.eye_fraction;
    let whole = vec2<i32>(floor(place));
    let w = place - vec2<f32>(whole);
    let at = whole + params.terrain.eye_cell;
    // the four samples and those around them, four at a time
    let nw = ground_four(at - 1);
    let ne = ground_four(at + vec2(1, -1));
    let sw = ground_four(at + vec2(-1, 1));
    let se = ground_four(at + 1);
    // metres a cell; upper left, upper right, lower left, lower right as in `ground_four`
    let east = 0.5 * (vec4(ne.z, ne.w, se.x, se.y) - vec4(nw.z, nw.w, sw.x, sw.y));
    let south = 0.5 * (vec4(sw.y, se.x, sw.w, se.z) - vec4(nw.y, ne.x, nw.w, ne.z));
    var rise = vec2(blend(east, w), blend(south, w));
    if LIT {
        rise += octaves_slope(cells, split);
    }
    let slope = rise / params.terrain.cell_m;
    // rows run south, y runs north
    return normalize(vec3(-slope.x, slope.y, 1.0));
}

/// Between the values of four neighbours.
fn blend(four: vec4<f32>, w: vec2<f32>) -> f32 {
    return mix(mix(four.x, four.y, w.x), mix(four.z, four.w, w.x), w.y);
}

fn map_texel(at: vec2<u32>) -> vec3<f32> {
    return unpack4x8unorm(colour_map[at.y * params.map_size.x + at.x]).xyz;
}

fn turbulence_texel(level: u32, at: vec2<u32>) -> vec2<f32> {
    let side = TURBULENCE_TEXELS >> level;
    let texel = at & vec2(side - 1u);
    return 2.0 * unpack4x8unorm(turbulence_texture[turbulence_start(level) + texel.y * side + texel.x]).xy - 1.0;
}

/// A level of the texture, blended bilinearly; beyond the coarsest there is nothing.
fn turbulence_level(level: u32, place: OctavePlace) -> vec2<f32> {
    let finest = min(level, TURBULENCE_LEVELS - 1u);
    let part = vec2<f32>(place.high >> vec2(8u)) / 16777216.0;
    let cells = vec2<f32>(place.cell & vec2(i32(TURBULENCE_PERIOD - 1u))) + part;
    let at = cells * (f32(TURBULENCE_TEXELS >> finest) / f32(TURBULENCE_PERIOD)) - 0.5;
    let low = vec2<u32>(vec2<i32>(floor(at)));
    let w = at - floor(at);
    let north = mix(turbulence_texel(finest, low), turbulence_texel(finest, low + vec2(1u, 0u)), w.x);
    let south = mix(turbulence_texel(finest, low + vec2(0u, 1u)), turbulence_texel(finest, low + 1u), w.x);
    return select(mix(north, south, w.y), vec2(0.0), level >= TURBULENCE_LEVELS);
}

/// How far a place is moved, as a part of the most; `split` is the octave with waves of two pixels.
fn moved_by_turbulence(place: OctavePlace, split: f32) -> vec2<f32> {
    if !BY_TEXTURE {
        return turbulence(place, split, TURBULENCE_FINEST, 0u);
    }
    // where a texel is as large as a pixel: 2^-5 of a cell at the finest level
    let level = clamp(5.0 - split, 0.0, f32(TURBULENCE_LEVELS));
    let finer = min(u32(level), TURBULENCE_LEVELS - 1u);
    return mix(turbulence_level(finer, place), turbulence_level(finer + 1u, place), level - f32(finer));
}

/// Colour of the ground, blended bilinearly.
fn map_colour(position_m: vec2<f32>, split: f32) -> vec3<f32> {
    let cells = cells_from_world(params.terrain, position_m);
    var place = cells + params.terrain.eye_fraction;
    if TURBULENT {
        place += params.turbulence_cells * moved_by_turbulence(octave_place(cells), split);
    }
    let last = vec2<f32>(params.map_size - 1u);
    let scale = last / vec2<f32>(params.terrain.size - 1u);
    let at = clamp((vec2<f32>(params.terrain.eye_cell) + place) * scale, vec2(0.0), last);
    let low = vec2<u32>(at);
    let high = min(low + 1u, params.map_size - 1u);
    let w = at - vec2<f32>(low);
    let north = mix(map_texel(low), map_texel(vec2(high.x, low.y)), w.x);
    let south = mix(map_texel(vec2(low.x, high.y)), map_texel(high), w.x);
    return mix(north, south, w.y);
}

fn sky(ray: vec3<f32>) -> vec3<f32> {
    return mix(vec3(0.80, 0.87, 0.93), vec3(0.33, 0.55, 0.83), clamp(ray.z * 2.0, 0.0, 1.0));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.camera.viewport) {
        return;
    }
    let index = id.y * params.camera.viewport.x + id.x;
    let ray = normalize(view_ray_of_pixel(params.camera, id.xy));
    let along = distance[index];
    var shade = sky(ray);
    if along >= 0.0 {
        let position_m = ray * along;
        shade = vec3(0.75);
        if TINT {
            shade = tint((position_m.z - params.relief.low_m) / params.relief.range_m);
        }
        var split = 0.0;
        if LIT || TURBULENT {
            // waves of two pixels, whose size is the depth times what a step of a pixel is at the depth 1
            let depth = along / length(view_ray_of_pixel(params.camera, id.xy));
            let pixel_m = length(params.camera.right_hi + params.camera.right_lo) * depth;
            split = log2(max(params.terrain.cell_m.x, params.terrain.cell_m.y) / max(pixel_m, 1e-12));
        }
        if MAP {
            shade = map_colour(position_m.xy, split);
        }
        if SUN {
            if BY_MESH {
                split = -mesh_level[index];
            }
            let light = max(dot(normal(position_m.xy, split), params.sun), 0.0);
            shade *= params.ambient + (1.0 - params.ambient) * light;
        }
    }
    colour[index] = pack4x8unorm(vec4(shade, 1.0));
}
