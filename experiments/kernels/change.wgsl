//!include lib/motion.wgsl
// How much farther each pixel's surface is than it was in the frame before, in metres. Where there is no surface (a
// distance below 0), or no frame before, 0.

struct Params {
    motion: Motion,
    size: vec2<u32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> now: array<f32>;
@group(0) @binding(2) var<storage, read> before: array<f32>;
@group(0) @binding(3) var<storage, read_write> change: array<f32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let at = id.y * params.size.x + id.x;
    let is_known = params.motion.is_cut == 0u && now[at] >= 0.0 && before[at] >= 0.0;
    change[at] = select(0.0, now[at] - before[at], is_known);
}
