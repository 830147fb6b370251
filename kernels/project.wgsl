//!include lib/terrain.wgsl
//!include lib/pyramid.wgsl
// Grid points to terrain vertices: ray to the base plane (Livny et al. 2008, Eq. 1), height from the mean
// pyramid at the level that fits the cell's extent (their Eq. 6; Loeffler et al. 2009, Eq. 1).

struct Params {
    terrain: Terrain,
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    /// The projector's eye and the base plane, relative to the camera's eye, metres.
    projector_m: vec3<f32>,
    base_m: f32,
    /// Ray of grid point (u, v): corner + u right + v down.
    corner: vec3<f32>,
    right: vec3<f32>,
    down: vec3<f32>,
    stride: u32,
    tall: u32,
    /// Coarsest level that is sampled.
    max_level: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> grid_point: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> height: array<f32>;
@group(0) @binding(3) var<storage, read> height_mean: array<f32>;
@group(0) @binding(4) var<storage, read_write> vertex: array<vec4<f32>>;

/// Sample the finest level only.
override FINEST: bool = false;
/// The surface between samples is bilinear patches and not triangles.
override BILINEAR: bool = false;
/// Blend the two levels around the wanted one instead of taking the finer.
override BLEND: bool = true;

/// Where the ray through a grid point meets the base plane, in metres from the camera's eye.
fn ground(at: vec2<u32>) -> vec2<f32> {
    let uv = grid_point[at.y * params.grid.x + at.x];
    let ray = params.corner + uv.x * params.right + uv.y * params.down;
    // the projector never looks at or above the horizon, so ray.z < 0
    let s = (params.base_m - params.projector_m.z) / ray.z;
    return params.projector_m.xy + s * ray.xy;
}

fn sample(level: u32, at: vec2<i32>) -> f32 {
    if level == 0u {
        return height[u32(at.y) * params.terrain.size.x + u32(at.x)];
    }
    return height_mean[pyramid_index(params.stride, params.tall, level, vec2<u32>(at))];
}

/// The surface at level 0, bilinear between the nodes of the others; `cells` are relative sample coordinates. A node stands in the middle
/// of its samples; beyond the outermost nodes the height stays as it is there.
fn height_at(level: u32, cells: vec2<f32>) -> f32 {
    let scale = 1.0 / f32(1u << level);
    let last = vec2<i32>(level_size(params.terrain.size, level)) - 1;
    let middle = 0.5 * (f32(1u << level) - 1.0);
    // whole cells and fraction apart: far from the origin a sum of both would lose the fraction
    let whole = vec2<i32>(floor(cells + params.terrain.eye_fraction));
    let fraction = cells + params.terrain.eye_fraction - vec2<f32>(whole);
    let absolute = whole + params.terrain.eye_cell;
    let node = (absolute - vec2(i32(middle))) >> vec2(level);
    let inside = vec2<f32>(absolute - (node << vec2(level))) - middle;
    let place = (inside + fraction) * scale;
    let carry = vec2<i32>(floor(place));
    let w = place - vec2<f32>(carry);
    let low = node + carry;
    let a = clamp(low, vec2(0), last);
    let b = clamp(low + 1, vec2(0), last);
    let nw = sample(level, a);
    let ne = sample(level, vec2(b.x, a.y));
    let sw = sample(level, vec2(a.x, b.y));
    let se = sample(level, b);
    if level == 0u && !BILINEAR {
        // the surface itself: two triangles, the diagonal from north-east to south-west
        let north_west = nw + (ne - nw) * w.x + (sw - nw) * w.y;
        let south_east = se + (sw - se) * (1.0 - w.x) + (ne - se) * (1.0 - w.y);
        return select(south_east, north_west, w.x + w.y <= 1.0);
    }
    return mix(mix(nw, ne, w.x), mix(sw, se, w.x), w.y);
}

/// Distance to the farthest grid neighbour on the base plane, in cells.
fn extent(at: vec2<u32>, here: vec2<f32>) -> f32 {
    let last = params.grid - 1u;
    var farthest = 0.0;
    let neighbours = array(
        vec2(at.x - min(at.x, 1u), at.y),
        vec2(min(at.x + 1u, last.x), at.y),
        vec2(at.x, at.y - min(at.y, 1u)),
        vec2(at.x, min(at.y + 1u, last.y)),
    );
    for (var i = 0; i < 4; i++) {
        let step = cells_from_world(params.terrain, ground(neighbours[i]) - here);
        farthest = max(farthest, length(step));
    }
    return farthest;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid) {
        return;
    }
    let here = ground(id.xy);
    // far outside the terrain the height of its border serves; the clamp keeps the integers in range
    let origin = vec2<f32>(params.terrain.eye_cell) + params.terrain.eye_fraction;
    let cells = clamp(cells_from_world(params.terrain, here), -origin, vec2<f32>(params.terrain.size - 1u) - origin);
    var level = 0.0;
    var height_m: f32;
    if FINEST {
        height_m = height_at(0u, cells);
    } else {
        level = clamp(log2(max(extent(id.xy, here), 1.0)), 0.0, f32(params.max_level));
        let finer = u32(level);
        height_m = height_at(finer, cells);
        if BLEND {
            let coarser = min(finer + 1u, params.max_level);
            height_m = mix(height_m, height_at(coarser, cells), level - f32(finer));
        }
    }
    vertex[id.y * params.grid.x + id.x] = vec4(here, relative_height(params.terrain, height_m), level);
}
