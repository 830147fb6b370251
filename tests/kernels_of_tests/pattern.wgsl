// Inputs for the tests of Scan, Compact and Warp.

struct Params {
    /// Which pattern.
    kind: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> importance: array<f32>;

fn hash(value: u32) -> u32 {
    let a = (value ^ (value >> 16u)) * 0x7feb352du;
    let b = (a ^ (a >> 15u)) * 0x846ca68bu;
    return b ^ (b >> 16u);
}

@compute @workgroup_size(64)
fn numbers(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= arrayLength(&counts) {
        return;
    }
    // 0: all zero, 1: all one, 2: one in a hundred, 3: anything, wrapping around
    switch params.kind {
        case 0u: { counts[at] = 0u; }
        case 1u: { counts[at] = 1u; }
        case 2u: { counts[at] = u32(hash(at) % 100u == 0u); }
        default: { counts[at] = hash(at); }
    }
}

@compute @workgroup_size(64)
fn weights(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    if at >= arrayLength(&importance) {
        return;
    }
    switch params.kind {
        // all zero
        case 0u: { importance[at] = 0.0; }
        // one spike of 1e30 in zeros
        case 1u: { importance[at] = select(0.0, 1e30, at == arrayLength(&importance) / 2u); }
        // 24 decades
        case 2u: { importance[at] = exp2(f32(hash(at) % 80u) - 40.0); }
        // denormals only
        case 3u: { importance[at] = bitcast<f32>(1u + hash(at) % 0x7fffffu); }
        // 0 and 1
        case 4u: { importance[at] = f32(at & 1u); }
        // of rows of 64, a few whose importance is to the left and a few where it is to the right
        case 8u: {
            let place = vec2(at % 64u, at / 64u);
            let is_there = place.y >= 20u && place.y < 28u && ((place.x < 32u) == (place.y < 24u));
            importance[at] = select(1.0, 12.0, is_there && place.x >= 28u && place.x < 36u);
        }
        // NaN, infinity, negative numbers among ordinary ones
        case 5u: {
            let odd = array(0x7fc00000u, 0x7f800000u, 0xbf800000u, 0x3f800000u, 0x40000000u);
            importance[at] = bitcast<f32>(odd[hash(at) % 5u]);
        }
        // rows of 8192 with all of it in the first and the last column, in each row in other shares
        case 7u: {
            let share = f32((at / 8192u) % 8u + 1u) / 9.0;
            importance[at] = select(select(0.0, 1.0 - share, at % 8192u == 8191u), share, at % 8192u == 0u);
        }
        // each addition to the sum of these rounds the same way for a long time
        default: { importance[at] = select(0.7, 1.0, at == 0u); }
    }
}
