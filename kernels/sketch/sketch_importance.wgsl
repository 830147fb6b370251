//!include lib/sketch.wgsl
//!include lib/view.wgsl
// Importance of the texels of a sketch map: how many grid points a metre are wanted there (Dachsbacher, Stamminger 2004, section 3.1),
// I = min(Iv Sf Sb, Is). Beyond the paper, So takes away what the sketch map hides, and Iv may follow what the errors of the frame before asked
// for.

struct Params {
    terrain: Terrain,
    view: View,
    /// Texels along a side of the map.
    texels: u32,
    /// Largest side of a quad in pixels.
    quad_px: f32,
    /// Sine of the angle beside the picture over which importance fades to nothing.
    safety: f32,
    /// Sine of the angle by which ground may face away and still be a silhouette, and of that over which importance then fades.
    silhouette: f32,
    fade: f32,
    /// Slope by which the way to the eye may go under ground and still be open, and that over which importance then fades.
    clear: f32,
    hidden: f32,
    /// The most grid points a metre.
    densest: f32,
    /// Those of the first four surface types.
    densest_of: vec4<f32>,
    /// Least importance, as a share of the largest.
    floor: f32,
    /// How far importance follows errors instead of distance, 0 to 1.
    error_share: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> sketch_square: array<i32>;
@group(0) @binding(2) var<storage, read> sketch_height: array<f32>;
@group(0) @binding(3) var<storage, read_write> largest: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> importance: array<f32>;
/// The four of them: by distance (or errors), in the picture, seen from the eye (facing it and not hidden), the most.
@group(0) @binding(5) var<storage, read_write> factors: array<vec4<f32>>;
/// A number for each of the terrain's samples.
@group(0) @binding(6) var<storage, read> surface_type: array<u32>;
/// What the errors of the frame before asked for, over its square, in points a metre; zeros if there was none.
@group(0) @binding(7) var<storage, read> asked: array<f32>;
/// Column and row of that square's north-west sample, samples along a side, level.
@group(0) @binding(8) var<storage, read> asked_square: array<i32>;
/// Of each texel whose errors are known, and of each row of them: importance by distance, and by errors.
@group(0) @binding(9) var<storage, read_write> texel_sums: array<vec2<f32>>;
@group(0) @binding(12) var<storage, read_write> row_sums: array<vec2<f32>>;
/// The same square without its level, and in its place all importance by distance over all importance by errors, as the bits of an f32.
@group(0) @binding(10) var<storage, read_write> asked_frame_out: array<i32>;
@group(0) @binding(11) var<storage, read> asked_frame: array<i32>;

override DISTANCE: bool = true;
override FRUSTUM: bool = true;
override FACING: bool = true;
override OCCLUSION: bool = false;
override BY_TYPE: bool = false;
override BY_ERROR: bool = false;
override HAS_FLOOR: bool = true;
override WRITE_FACTORS: bool = false;

fn height_of(texel: vec2<i32>) -> f32 {
    let at = vec2<u32>(clamp(texel, vec2(0), vec2(i32(params.texels) - 1)));
    return sketch_height[at.y * params.texels + at.x];
}

/// From 1 at 0 and below to 0 at `width` and above.
fn fading(x: f32, width: f32) -> f32 {
    let t = clamp(x / width, 0.0, 1.0);
    return 1.0 - t * t * (3.0 - 2.0 * t);
}

/// How much of a texel's importance is left beside the picture: `sides_m` is its size, `away_m` how far it is.
fn in_frustum(place_m: vec3<f32>, away_m: f32, sides_m: vec2<f32>) -> f32 {
    let beside = max(max(-dot(params.view.side_left, place_m), -dot(params.view.side_right, place_m)),
                     max(-dot(params.view.side_top, place_m), -dot(params.view.side_bottom, place_m)));
    // of a texel on the border there is half in the picture
    return fading((beside - 0.5 * length(sides_m)) / away_m, params.safety);
}

/// How much is left of the importance of ground that faces away.
fn facing(texel: vec2<i32>, place_m: vec3<f32>, away_m: f32, sides_m: vec2<f32>) -> f32 {
    // at the border of the map, and of the terrain, one of two neighbours is the texel itself
    let low = max(texel - 1, first_terrain(square()));
    let high = min(texel + 1, last_terrain(square()));
    let between_m = vec2<f32>(max(high - low, vec2(1))) * sides_m;
    let east = (height_of(vec2(high.x, texel.y)) - height_of(vec2(low.x, texel.y))) / between_m.x;
    let south = (height_of(vec2(texel.x, high.y)) - height_of(vec2(texel.x, low.y))) / between_m.y;
    let up = vec3(-east, south, 1.0);
    return fading(dot(up, place_m) / (length(up) * away_m) - params.silhouette, params.fade);
}

/// Height between texels, bilinear.
fn height_between(at: vec2<f32>) -> f32 {
    let low = vec2<i32>(floor(at));
    let w = at - floor(at);
    let north = mix(height_of(low), height_of(low + vec2(1, 0)), w.x);
    return mix(north, mix(height_of(low + vec2(0, 1)), height_of(low + vec2(1, 1)), w.x), w.y);
}

/// How much is left of the importance of ground that other ground hides: the steepest slope, seen from the eye, on the way to the texel is
/// compared with the texel's own. The way is looked at once a texel, as far as the map has terrain; what is beyond hides nothing.
fn unhidden(texel: vec2<i32>, place_m: vec3<f32>, sides_m: vec2<f32>) -> f32 {
    let way = vec2(place_m.x, -place_m.y) / sides_m;
    let texels = max(abs(way.x), abs(way.y));
    let step = way / max(texels, 1.0);
    let low = vec2<f32>(first_terrain(square()));
    let high = vec2<f32>(last_terrain(square()));
    var steepest = -1e30;
    for (var i = 1u; i < params.texels; i++) {
        let at = vec2<f32>(texel) - f32(i) * step;
        // nothing within a texel of the eye hides anything
        if f32(i) >= texels - 1.0 || any(at < low) || any(at > high) {
            break;
        }
        let height_m = relative_height(params.terrain, height_between(at));
        steepest = max(steepest, height_m / (1.0 - f32(i) / texels));
    }
    // slopes for the texel's whole distance, and what is left when they are divided by it
    let excess = (steepest - place_m.z) / max(length(place_m.xy), 0.5 * min(sides_m.x, sides_m.y));
    return fading(excess - params.clear, params.hidden);
}

/// Places along a texel that are asked for their surface type.
const PLACES: i32 = 4;

/// The most grid points a metre that a texel may have: the mean over places in it, each of which has that of its surface type.
fn densest(square: Square, texel: vec2<i32>) -> f32 {
    if !BY_TYPE {
        return params.densest;
    }
    let texels = i32(params.texels);
    let first = texel_first(square, texel);
    let rest = texel * square.side - (first - square.first) * texels;
    let last = vec2<i32>(params.terrain.size) - 1;
    var sum = 0.0;
    for (var i = 0; i < PLACES * PLACES; i++) {
        // the sample around a place in the middle of its share of the texel
        let share = vec2(2 * (i % PLACES) + 1, 2 * (i / PLACES) + 1);
        let within = (2 * PLACES * rest + share * square.side) / (2 * PLACES * texels);
        let sample = vec2<u32>(clamp(first + within, vec2(0), last));
        let number = surface_type[sample.y * params.terrain.size.x + sample.x];
        sum += select(params.densest, params.densest_of[min(number, 3u)], number < 4u) / f32(PLACES * PLACES);
    }
    return sum;
}

/// Errors ask for at most so many times as many points as distance does, and for no fewer than one in so many.
const FARTHEST: f32 = 1024.0;

/// Points a metre that the errors of the frame before asked for in the middle of a texel, bilinear; 0 where its square was not.
fn asked_at(square: Square, texel: vec2<i32>, before: Square) -> f32 {
    let first = texel_first(square, texel);
    let rest = texel * square.side - (first - square.first) * i32(params.texels);
    // from the corner of that square, half a sample before its first one
    let cells = vec2<f32>(first - before.first) + (vec2<f32>(rest) + 0.5 * f32(square.side)) / f32(params.texels);
    if any(cells < vec2(0.0)) || any(cells > vec2(f32(before.side))) || before.side == 0 {
        return 0.0;
    }
    let texels = u32(sqrt(f32(arrayLength(&asked))) + 0.5);
    let at = clamp(cells / f32(before.side) * f32(texels) - 0.5, vec2(0.0), vec2(f32(texels - 1u)));
    let low = min(vec2<u32>(at), vec2(texels - 1u));
    let high = min(low + 1u, vec2(texels - 1u));
    let w = at - vec2<f32>(low);
    let north = mix(asked[low.y * texels + low.x], asked[low.y * texels + high.x], w.x);
    return mix(north, mix(asked[high.y * texels + low.x], asked[high.y * texels + high.x], w.x), w.y);
}

@compute @workgroup_size(1)
fn begin() {
    atomicStore(&largest[0], 0u);
}

/// By distance, in the picture, seen from the eye, the most.
fn factors_of(square: Square, texel: vec2<i32>) -> vec4<f32> {
    let index = u32(texel.y) * params.texels + u32(texel.x);
    let first = texel_first(square, texel);
    let middle = texel_middle(square, texel);
    let place_m = vec3(world_from_cells(params.terrain, middle), relative_height(params.terrain, sketch_height[index]));
    let sides_m = texel_samples(square) * params.terrain.cell_m;
    // a texel is not seen from nearer than a quarter of the sum of its sides, which is half of one
    let near_m = 0.25 * (sides_m.x + sides_m.y);
    let away_m = max(length(place_m), near_m);
    // without distance, one point for each texel
    var found = vec4(0.5 / near_m, 1.0, 1.0, densest(square, texel));
    if DISTANCE {
        found.x = params.view.focal_px / (params.quad_px * away_m);
    }
    if FRUSTUM {
        found.y = in_frustum(place_m, away_m, sides_m);
    }
    if FACING {
        found.z = facing(texel, place_m, away_m, sides_m);
    }
    if OCCLUSION {
        found.z *= unhidden(texel, place_m, sides_m);
    }
    // where there is no terrain, nothing is wanted
    if any(first < vec2(0)) || any(first >= vec2<i32>(params.terrain.size)) {
        found.x = 0.0;
    }
    return found;
}

/// What distance and what errors want, so that one can stand for the other: texel by texel, then summed up by rows.
@compute @workgroup_size(8, 8)
fn survey(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.texels)) {
        return;
    }
    let square = square();
    let texel = vec2<i32>(id.xy);
    let asked = asked_at(square, texel, Square(vec2(asked_square[0], asked_square[1]), asked_square[2], 0u));
    let found = factors_of(square, texel);
    let is_known = asked > 0.0 && found.x > 0.0;
    texel_sums[id.y * params.texels + id.x] = select(vec2(0.0), vec2(found.x, asked) * (found.y * found.z), is_known);
}

@compute @workgroup_size(64)
fn sum_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.texels {
        return;
    }
    var sums = vec2(0.0);
    for (var x = 0u; x < params.texels; x++) {
        sums += texel_sums[id.x * params.texels + x];
    }
    row_sums[id.x] = sums;
}

@compute @workgroup_size(1)
fn compare() {
    var sums = vec2(0.0);
    for (var y = 0u; y < params.texels; y++) {
        sums += row_sums[y];
    }
    for (var i = 0; i < 3; i++) {
        asked_frame_out[i] = asked_square[i];
    }
    asked_frame_out[3] = bitcast<i32>(select(0.0, sums.x / sums.y, sums.y > 0.0));
}

@compute @workgroup_size(8, 8)
fn weigh(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= vec2(params.texels)) {
        return;
    }
    let square = square();
    let texel = vec2<i32>(id.xy);
    let index = id.y * params.texels + id.x;
    var found = factors_of(square, texel);
    if BY_ERROR {
        let before = Square(vec2(asked_frame[0], asked_frame[1]), asked_frame[2], 0u);
        let by_errors = bitcast<f32>(asked_frame[3]) * asked_at(square, texel, before);
        if by_errors > 0.0 && found.x > 0.0 {
            found.x *= pow(clamp(by_errors / found.x, 1.0 / FARTHEST, FARTHEST), params.error_share);
        }
    }
    let wanted = min(found.x * found.y * found.z, found.w);
    importance[index] = wanted;
    if WRITE_FACTORS {
        factors[index] = found;
    }
    if HAS_FLOOR {
        // positive floats are ordered like their bits
        atomicMax(&largest[0], bitcast<u32>(wanted));
    }
}

@compute @workgroup_size(8, 8)
fn raise(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < vec2(params.texels)) {
        let index = id.y * params.texels + id.x;
        importance[index] = max(importance[index], params.floor * bitcast<f32>(atomicLoad(&largest[0])));
    }
}
