// What the kernels of a warp have in common: how its map is looked up.
//
// A kernel that includes this binds `warp_map`, and has `size`, columns and rows of the importance map, in its parameters.

/// Where the share stands in `grid_work`.
const SHARE: u32 = 3u;

/// The end of an interpolation is exact.
fn between(a: f32, b: f32, w: f32) -> f32 {
    return select(a + (b - a) * w, b, w >= 1.0);
}

fn interpolate(nw: vec2<f32>, ne: vec2<f32>, sw: vec2<f32>, se: vec2<f32>, w: vec2<f32>) -> vec2<f32> {
    let north = vec2(between(nw.x, ne.x, w.x), between(nw.y, ne.y, w.x));
    let south = vec2(between(sw.x, se.x, w.x), between(sw.y, se.y, w.x));
    return vec2(between(north.x, south.x, w.y), between(north.y, south.y, w.y));
}

/// Bilinear in the finished map.
fn warped_place(place: vec2<f32>) -> vec2<f32> {
    let at = clamp(place, vec2(0.0), vec2(1.0)) * vec2<f32>(params.size);
    let low = min(vec2<u32>(at), params.size - 1u);
    let first = low.y * (params.size.x + 1u) + low.x;
    let south = first + params.size.x + 1u;
    return interpolate(warp_map[first], warp_map[first + 1u], warp_map[south], warp_map[south + 1u], at - vec2<f32>(low));
}
