//!include lib/means.wgsl
//!include lib/sketch.wgsl
//!include lib/visible_ground.wgsl
// The part of the terrain in view, copied out of the mean pyramid (Dachsbacher, Stamminger 2004, section 1): whole nodes of one level, the
// finest at which the map holds all of them. A node's height does not change while the camera moves.
//
// Where a change to that level is blended, the square grows from that of the finer level to its own as the view does, and heights are blended
// as much.

struct Params {
    terrain: Terrain,
    visible: VisibleGround,
    /// Texels along a side of the map.
    texels: u32,
    /// Coarsest level that is sampled.
    max_level: u32,
    /// Nothing farther from the sample nearest to the eye is in the map but for what fills it, in samples by columns and by rows.
    far: vec2<i32>,
    /// Share of a level's range over which the change to it is blended, in parts of `STEPS`.
    blend: i32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> height_mean: array<f32>;
/// Column and row of the north-west sample, samples along a side, level of the nodes.
@group(0) @binding(2) var<storage, read_write> sketch_square: array<i32>;
@group(0) @binding(3) var<storage, read_write> sketch_height: array<f32>;

/// Changes of the level are blended.
override BLENDED: bool = false;

/// Samples along a side that a map has at least.
const LEAST: i32 = 4;
/// Parts of what is blended: a power of two, with room for numbers of samples beside it in 32 bits.
const STEPS: i32 = 1024;

/// The first and the last sample that the map has to hold.
struct InView {
    low: vec2<i32>,
    high: vec2<i32>,
}

fn in_view() -> InView {
    let last = vec2<i32>(ground_size()) - 1;
    // an eye far outside would overflow
    let eye = clamp(params.terrain.eye_cell, vec2(-(1 << 29)), vec2(1 << 29));
    let low = clamp(max(params.visible.low, eye - params.far), vec2(0), max(last - (LEAST - 1), vec2(0)));
    return InView(low, max(min(params.visible.high, eye + params.far), low + (LEAST - 1)));
}

/// Nodes of a level that the view needs.
fn nodes(view: InView, level: u32) -> vec2<i32> {
    return (view.high >> vec2(level)) - (view.low >> vec2(level)) + 1;
}

/// The first sample of a map of a level, with the view in its middle.
fn first_of(view: InView, level: u32) -> vec2<i32> {
    let corner = (view.low >> vec2(level)) - (vec2(i32(params.texels)) - nodes(view, level)) / 2;
    return corner << vec2(level);
}

/// The finest level at which the map holds all nodes in view.
fn square_in_view() -> Square {
    let view = in_view();
    var level = 0u;
    while any(nodes(view, level) > vec2(i32(params.texels))) {
        level++;
    }
    let whole = Square(first_of(view, level), i32(params.texels << level), level);
    if !BLENDED || level == 0u {
        return whole;
    }
    return blended(whole, view);
}

/// Between the square of the finer level and a level's own, by how much of it the view needs.
fn blended(whole: Square, view: InView) -> Square {
    let half = whole.side / 2;
    let seen = view.high - view.low + 1;
    let needed = max(seen.x, seen.y);
    let grown = (needed - half) * STEPS / params.blend;
    let side = clamp(half + grown, max(half, needed), whole.side);
    let share = (side - half) * STEPS / half;
    let finer = first_of(view, whole.level - 1u);
    let first = finer + (whole.first - finer) * share / STEPS;
    return Square(clamp(first, view.high + 1 - side, view.low), side, whole.level);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.texels)) {
        return;
    }
    let square = square_in_view();
    if all(id.xy == vec2(0u)) {
        sketch_square[0] = square.first.x;
        sketch_square[1] = square.first.y;
        sketch_square[2] = square.side;
        sketch_square[3] = i32(square.level);
    }
    let texel = vec2<i32>(id.xy);
    let index = id.y * params.texels + id.x;
    if BLENDED && square.side < i32(params.texels << square.level) {
        sketch_height[index] = height_for(texel_middle(square, texel), texel_samples(square)).x;
        return;
    }
    // beyond the border the height stays as it is there
    let last = vec2<i32>(level_size(ground_size(), square.level)) - 1;
    let node = vec2<u32>(clamp((square.first >> vec2(square.level)) + texel, vec2(0), last));
    if FINEST || square.level == 0u {
        sketch_height[index] = ground_height(min(node << vec2(square.level), ground_size() - 1u));
    } else {
        sketch_height[index] = height_mean[pyramid_index(ground_means(), square.level, node)];
    }
}
