// Density of grid points that there is over the density that was asked for (Dachsbacher, Stamminger 2004, section 3.3, Fig. 6), for each
// cell, along rows and down columns.

struct Params {
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    /// Texels along a side of the importance map.
    texels: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// Grid points a metre that are wanted.
@group(0) @binding(1) var<storage, read> importance: array<f32>;
/// Where grid points are in the square of the map.
@group(0) @binding(2) var<storage, read> grid_point: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read> vertex: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> density_ratio: array<vec2<f32>>;

/// What is no number or less than nothing is nothing, as `Warp` has it.
fn wanted_by(texel: vec2<u32>) -> f32 {
    let wanted = importance[texel.y * params.texels + texel.x];
    return select(0.0, min(wanted, 3e38), wanted > 0.0);
}

/// Bilinear between the middles of texels.
fn wanted_at(place: vec2<f32>) -> f32 {
    let last = params.texels - 1u;
    let at = clamp(place * f32(params.texels) - 0.5, vec2(0.0), vec2(f32(last)));
    let low = min(vec2<u32>(at), vec2(last));
    let high = min(low + 1u, vec2(last));
    let w = at - vec2<f32>(low);
    let north = mix(wanted_by(low), wanted_by(vec2(high.x, low.y)), w.x);
    let south = mix(wanted_by(vec2(low.x, high.y)), wanted_by(high), w.x);
    return mix(north, south, w.y);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = params.grid - 1u;
    if any(id.xy >= cells) {
        return;
    }
    let nw = id.y * params.grid.x + id.x;
    let sw = nw + params.grid.x;
    let middle = 0.25 * (grid_point[nw] + grid_point[nw + 1u] + grid_point[sw] + grid_point[sw + 1u]);
    let along = 0.5 * ((vertex[nw + 1u].xy - vertex[nw].xy) + (vertex[sw + 1u].xy - vertex[sw].xy));
    let down = 0.5 * ((vertex[sw].xy - vertex[nw].xy) + (vertex[sw + 1u].xy - vertex[nw + 1u].xy));
    let sides = max(vec2(length(along), length(down)) * wanted_at(middle), vec2(1e-30));
    density_ratio[id.y * cells.x + id.x] = 1.0 / sides;
}
