//!include ground
//!include lib/sketch.wgsl
//!include lib/visible_ground.wgsl
// The part of the terrain in view, copied out of the mean pyramid (Dachsbacher, Stamminger 2004, section 1): whole nodes of one level, the
// finest at which the map holds all of them. A node's height does not change while the camera moves.

struct Params {
    terrain: Terrain,
    visible: VisibleGround,
    /// Texels along a side of the map.
    texels: u32,
    /// Nothing farther from the sample nearest to the eye is in the map but for what fills it, in samples by columns and by rows.
    far: vec2<i32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> height_mean: array<f32>;
/// Column and row of the node that the north-west texel is, their level, texels along a side.
@group(0) @binding(2) var<storage, read_write> sketch_square: array<i32>;
@group(0) @binding(3) var<storage, read_write> sketch_height: array<f32>;

/// Samples are all that the map can have.
override FINEST: bool = false;

/// Samples along a side that a map has at least.
const LEAST: i32 = 4;

/// The finest level at which the map holds all nodes in view; they are in its middle.
fn square_in_view() -> Square {
    let last = vec2<i32>(ground_size()) - 1;
    // an eye far outside would overflow
    let eye = clamp(params.terrain.eye_cell, vec2(-(1 << 29)), vec2(1 << 29));
    let low = clamp(max(params.visible.low, eye - params.far), vec2(0), max(last - (LEAST - 1), vec2(0)));
    let high = max(min(params.visible.high, eye + params.far), low + (LEAST - 1));
    let texels = vec2(i32(params.texels));
    var level = 0u;
    while any((high >> vec2(level)) - (low >> vec2(level)) >= texels) {
        level++;
    }
    let nodes = (high >> vec2(level)) - (low >> vec2(level)) + 1;
    return Square((low >> vec2(level)) - (texels - nodes) / 2, level);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.texels)) {
        return;
    }
    let square = square_in_view();
    if all(id.xy == vec2(0u)) {
        sketch_square[0] = square.corner.x;
        sketch_square[1] = square.corner.y;
        sketch_square[2] = i32(square.level);
        sketch_square[3] = i32(params.texels);
    }
    // beyond the border the height stays as it is there
    let last = vec2<i32>(level_size(ground_size(), square.level)) - 1;
    let node = vec2<u32>(clamp(square.corner + vec2<i32>(id.xy), vec2(0), last));
    let index = id.y * params.texels + id.x;
    if FINEST || square.level == 0u {
        sketch_height[index] = ground_height(min(node << vec2(square.level), ground_size() - 1u));
    } else {
        sketch_height[index] = height_mean[pyramid_index(ground_means(), square.level, node)];
    }
}
