//!include lib/motion.wgsl
// Whether the frame is a cut.

struct Params {
    motion: Motion,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> told: array<u32>;

@compute @workgroup_size(1)
fn main() {
    told[0] = params.motion.is_cut;
}
