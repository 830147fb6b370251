//!include lib/turbulence.wgsl
// A periodic texture of turbulence with its levels: each has the octaves that its texels can hold, four texels a wave and more.

@group(0) @binding(0) var<storage, read_write> turbulence_texture: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= turbulence_start(TURBULENCE_LEVELS) {
        return;
    }
    var level = 0u;
    while at >= turbulence_start(level + 1u) {
        level += 1u;
    }
    let side = TURBULENCE_TEXELS >> level;
    let number = at - turbulence_start(level);
    let texel = vec2(number % side, number / side);
    // the middle of a texel, whose side is a power of two
    let cells = (vec2<f32>(texel) + 0.5) * (f32(TURBULENCE_PERIOD) / f32(side));
    let place = OctavePlace(vec2<i32>(cells), vec2<u32>(fract(cells) * 4294967296.0), vec2(0u));
    let moved = turbulence(place, f32(TURBULENCE_LEVELS - level) + 1.0, TURBULENCE_LEVELS, TURBULENCE_PERIOD);
    turbulence_texture[at] = pack4x8unorm(vec4(0.5 + 0.5 * moved, 0.0, 0.0));
}
