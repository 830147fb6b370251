//!include lib/terrain.wgsl
//!include ground
// Heights from the mean pyramid, at the level that fits an extent (Livny et al. 2008, Eq. 6; Loeffler et al. 2009, Eq. 1).
//
// A kernel that includes this binds `height_mean`, and has in its parameters `terrain: Terrain` and `max_level`, the coarsest level that is
// sampled.

/// Sample the finest level only.
override FINEST: bool = false;
/// Blend the two levels around the wanted one instead of taking the finer.
override BLEND: bool = true;

fn sample(level: u32, at: vec2<i32>) -> f32 {
    if level == 0u {
        return ground_height(vec2<u32>(at));
    }
    return height_mean[pyramid_index(ground_means(), level, vec2<u32>(at))];
}

/// The surface at level 0, bilinear between the nodes of the others; `cells` are relative sample coordinates. A node stands in the middle
/// of its samples; beyond the outermost nodes the height stays as it is there.
fn height_at(level: u32, cells: vec2<f32>) -> f32 {
    let last = vec2<i32>(level_size(params.terrain.size, level)) - 1;
    let whole = vec2<i32>(floor(cells + params.terrain.eye_fraction));
    let fraction = cells + params.terrain.eye_fraction - vec2<f32>(whole);
    let nodes = around(level, whole + params.terrain.eye_cell, fraction, 0.5 * (f32(1u << level) - 1.0), last);
    let w = nodes.w;
    let nw = sample(level, nodes.low);
    let ne = sample(level, vec2(nodes.high.x, nodes.low.y));
    let sw = sample(level, vec2(nodes.low.x, nodes.high.y));
    let se = sample(level, nodes.high);
    let four = vec4(nw, ne, sw, se);
    if level == 0u {
        return ground_surface(four, w);
    }
    return ground_on_patch(four, w);
}

/// Height in metres at relative sample coordinates for a vertex whose farthest neighbour is `extent` cells away, and the pyramid level that
/// it is from. Far outside the terrain the height of its border serves.
fn height_for(cells: vec2<f32>, extent: f32) -> vec2<f32> {
    // the clamp keeps the integers in range
    let origin = vec2<f32>(params.terrain.eye_cell) + params.terrain.eye_fraction;
    let inside = clamp(cells, -origin, vec2<f32>(params.terrain.size - 1u) - origin);
    if FINEST {
        return vec2(height_at(0u, inside), 0.0);
    }
    let level = clamp(log2(max(extent, 1.0)), 0.0, f32(params.max_level));
    let finer = min(u32(level), params.max_level);
    let height_m = height_at(finer, inside);
    if !BLEND {
        return vec2(height_m, level);
    }
    let coarser = min(finer + 1u, params.max_level);
    return vec2(mix(height_m, height_at(coarser, inside), level - f32(finer)), level);
}
