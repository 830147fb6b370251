//!include lib/terrain.wgsl
// Curvature of the height field: the Laplacian by central differences, 1/m. Borders are 0.

struct Params {
    terrain: Terrain,
    /// Filled in by lodlab: columns and rows this kernel runs over.
    size: vec2<u32>,
    /// From the experiment file.
    scale: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> src: array<f32>;
@group(0) @binding(2) var<storage, read_write> dst: array<f32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = params.size;
    if any(id.xy >= size) {
        return;
    }
    let at = id.y * size.x + id.x;
    if any(id.xy == vec2(0u)) || any(id.xy == size - 1u) {
        dst[at] = 0.0;
        return;
    }
    let across = (src[at - 1u] - 2.0 * src[at] + src[at + 1u]) / (params.terrain.cell_m.x * params.terrain.cell_m.x);
    let along = (src[at - size.x] - 2.0 * src[at] + src[at + size.x]) / (params.terrain.cell_m.y * params.terrain.cell_m.y);
    dst[at] = params.scale * (across + along);
}
