// One round of a 3 x 3 binomial filter; borders repeat.

struct Params {
    size: vec2<u32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> src: array<f32>;
@group(0) @binding(2) var<storage, read_write> dst: array<f32>;

fn at(x: i32, y: i32) -> f32 {
    let last = vec2<i32>(params.size) - 1;
    let p = clamp(vec2(x, y), vec2(0), last);
    return src[u32(p.y) * params.size.x + u32(p.x)];
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let x = i32(id.x);
    let y = i32(id.y);
    var sum = 0.0;
    for (var j = -1; j <= 1; j++) {
        sum += f32(2 - abs(j)) * (at(x - 1, y + j) + 2.0 * at(x, y + j) + at(x + 1, y + j));
    }
    dst[id.y * params.size.x + id.x] = sum / 16.0;
}
