// Uniform grid over the unit square, corner to corner: over the projector's image, it is the persistent grid of Livny et al. 2008; over the
// square of a sketch map, an unwarped geometry image of Dachsbacher and Stamminger 2004.

struct Params {
    /// Columns and rows of grid points.
    size: vec2<u32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> grid_point: array<vec2<f32>>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    // a side of one point has that point at the start; the last of several is exactly 1
    let steps = max(params.size - 1u, vec2(1u));
    grid_point[id.y * params.size.x + id.x] = vec2<f32>(id.xy) / vec2<f32>(steps);
}
