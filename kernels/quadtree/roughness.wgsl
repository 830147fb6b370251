//!include ground
//!include lib/block.wgsl
// How far the surface is from a block's triangles, for every block of the quadtree: by the paper's five heights of a block
// (Lee, Shin 2011, Eq. 3), or as a bound over everything that the block's triangles can be drawn instead of.

struct Params {
    level: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> roughness: array<f32>;
/// For each block of a level: how far the samples on its north, west, south and east edge are from a straight line.
@group(0) @binding(2) var<storage, read_write> edge_off: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> edge_off_in: array<vec4<f32>>;
/// The largest distance over a tile of samples, for each tile.
@group(0) @binding(4) var<storage, read_write> tile_off: array<f32>;
@group(0) @binding(5) var<storage, read> tile_off_in: array<f32>;
/// The largest of a row of a block's tiles, for each row of tiles and each block of a row.
@group(0) @binding(6) var<storage, read_write> row_off: array<f32>;
@group(0) @binding(7) var<storage, read> row_off_in: array<f32>;

/// Cells a side of a tile, as a power of two.
const TILE_LEVEL: u32 = 4u;
/// What rounding adds to a distance, as a part of the largest height difference in it: eight roundings of half a digit.
const ROUNDING: f32 = 5.0e-7;

fn base() -> vec2<u32> {
    return ground_size() - 1u;
}

fn height_at(x: u32, y: u32) -> f32 {
    return ground_height(vec2(x, y));
}

/// The largest of the four blocks under a block; 0 under the finest.
fn largest_below(at: vec2<u32>) -> f32 {
    var largest = 0.0;
    if params.level > 1u {
        let below = level_size(base(), params.level - 1u);
        for (var i = 0u; i < 4u; i++) {
            let child = min(2u * at + vec2(i & 1u, i >> 1u), below - 1u);
            largest = max(largest, roughness[ground_node(params.level - 1u, child)]);
        }
    }
    return largest;
}

fn put(at: vec2<u32>, value: f32) {
    roughness[ground_node(params.level, at)] = value;
}

/// Height in the middle of an edge against the line between its ends, `t` of the way along it.
fn off_line(middle: f32, a: f32, b: f32, t: f32) -> f32 {
    return abs((middle - a) - (b - a) * t);
}

/// The largest of the five errors of a block (and, where the border cuts it down to a cell or two, of the first cell's middle), and at least twice that of the blocks below.
@compute @workgroup_size(8, 8)
fn nested(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= level_size(base(), params.level)) {
        return;
    }
    let block = block_of(params.level, id.xy, base());
    let low = block.low;
    let mid = block.middle;
    let high = block.high;
    let t = vec2<f32>(mid - low) / vec2<f32>(high - low);
    let nw = height_at(low.x, low.y);
    let ne = height_at(high.x, low.y);
    let sw = height_at(low.x, high.y);
    let se = height_at(high.x, high.y);
    let edges = max(max(off_line(height_at(mid.x, low.y), nw, ne, t.x), off_line(height_at(mid.x, high.y), sw, se, t.x)),
                    max(off_line(height_at(low.x, mid.y), nw, sw, t.y), off_line(height_at(high.x, mid.y), ne, se, t.y)));
    // the block's own two triangles meet on the diagonal of the surface's
    let upper = (ne - nw) * t.x + (sw - nw) * t.y;
    let lower = (se - nw) + (sw - se) * (1.0 - t.x) + (ne - se) * (1.0 - t.y);
    let centre = abs((height_at(mid.x, mid.y) - nw) - select(lower, upper, ground_is_north_west(t)));
    var own = max(edges, centre);
    if params.level == 1u && is_clamped(block) {
        // of the middles above none may be inside: the block is split the other way than its cell
        let cell = min(low + 1u, base());
        own = max(own, 0.5 * abs((height_at(cell.x, low.y) - nw) + (height_at(low.x, cell.y) - height_at(cell.x, cell.y))));
    }
    put(id.xy, max(own, 2.0 * largest_below(id.xy)));
}

/// A row or column of samples, against the line between its ends.
struct Line {
    start: vec2<u32>,
    step: vec2<u32>,
    cells: u32,
    first_m: f32,
    rise_m: f32,
    /// The largest distance from the line, and the largest height difference, so far.
    off: f32,
    largest: f32,
}

fn line_from(start: vec2<u32>, step: vec2<u32>, cells: u32) -> Line {
    let end = start + step * cells;
    let first_m = height_at(start.x, start.y);
    let rise_m = height_at(end.x, end.y) - first_m;
    return Line(start, step, cells, first_m, rise_m, 0.0, abs(rise_m));
}

fn look_at_sample(line: Line, i: u32) -> Line {
    var seen = line;
    if i < line.cells {
        let place = line.start + line.step * i;
        let own = height_at(place.x, place.y) - line.first_m;
        seen.off = max(line.off, abs(own - line.rise_m * (f32(i) / f32(line.cells))));
        seen.largest = max(line.largest, abs(own));
    }
    return seen;
}

fn off_line_with_rounding(line: Line) -> f32 {
    return line.off + select(0.0, ROUNDING * line.largest, line.off > 0.0);
}

/// (One loop for all four edges: an adapter may end the loops of a thread after some ten thousand turns in all.)
@compute @workgroup_size(8, 8)
fn edges(@builtin(global_invocation_id) id: vec3<u32>) {
    let blocks = level_size(base(), params.level);
    if any(id.xy >= blocks) {
        return;
    }
    let block = block_of(params.level, id.xy, base());
    let side = block.high - block.low;
    var north = line_from(block.low, vec2(1u, 0u), side.x);
    var west = line_from(block.low, vec2(0u, 1u), side.y);
    var south = line_from(vec2(block.low.x, block.high.y), vec2(1u, 0u), side.x);
    var east = line_from(vec2(block.high.x, block.low.y), vec2(0u, 1u), side.y);
    for (var i = 1u; i < max(side.x, side.y); i++) {
        north = look_at_sample(north, i);
        west = look_at_sample(west, i);
        south = look_at_sample(south, i);
        east = look_at_sample(east, i);
    }
    edge_off[id.y * blocks.x + id.x] = vec4(
        off_line_with_rounding(north),
        off_line_with_rounding(west),
        off_line_with_rounding(south),
        off_line_with_rounding(east),
    );
}

/// Heights of a block's centre (first) and, relative to it, its corners: north-west, north-east, south-west, south-east.
struct Fan {
    centre_m: f32,
    corners: vec4<f32>,
}

/// A place on the four triangles around a block's centre.
struct Place {
    /// Above the centre, in metres.
    height_m: f32,
    /// How far from the centre (0) to the edge (1) it is, times how far that edge may be drawn from its line.
    edge_off: f32,
}

/// `offset` is in cells from the block's centre; the fan's triangles are apart where the two shares are equal.
fn on_fan(block: Block, fan: Fan, off: vec4<f32>, offset: vec2<f32>) -> Place {
    let near = vec2<f32>(block.middle - block.low);
    let far = vec2<f32>(block.high - block.middle);
    let reach = select(far, near, offset < vec2(0.0));
    let share = select(abs(offset) / reach, vec2(0.0), reach == vec2(0.0));
    let c = fan.corners;
    // the ends of the edge: to the north or south if that share is larger
    let upright = select(vec2(c.z, c.w), vec2(c.x, c.y), offset.y < 0.0);
    let sideways = select(vec2(c.y, c.w), vec2(c.x, c.z), offset.x < 0.0);
    let is_upright = share.y >= share.x;
    let ends = select(sideways, upright, is_upright);
    let along = select(offset.y, offset.x, is_upright);
    let before = select(near.y, near.x, is_upright);
    let after = select(far.y, far.x, is_upright);
    let part = max(share.x, share.y);
    let weights = vec2(after * part - along, before * part + along) / (before + after);
    let off_upright = select(off.z, off.x, offset.y < 0.0);
    let off_sideways = select(off.w, off.y, offset.x < 0.0);
    let own = select(off_sideways, off_upright, is_upright);
    // on a ridge of the fan both edges count, whichever side rounding puts it on
    let is_ridge = abs(share.x - share.y) < 1.0e-6;
    return Place(dot(ends, weights), part * select(own, max(off_upright, off_sideways), is_ridge));
}

fn is_clamped(block: Block) -> bool {
    return any(block.high - block.low != vec2(1u << params.level));
}

/// Largest difference between the slopes of the fan's triangles, in metres a cell, each counted by its steepest direction: between
/// the samples of a cell that a ridge of the fan crosses, the surface can be off by that times half the cell's diagonal.
fn ridges(block: Block, fan: Fan) -> f32 {
    let near = vec2<f32>(block.middle - block.low);
    let far = vec2<f32>(block.high - block.middle);
    let c = fan.corners;
    let width = near.x + far.x;
    let tall = near.y + far.y;
    let along_x = vec2(c.y - c.x, c.w - c.z) / width;
    let along_y = vec2(c.z - c.x, c.w - c.y) / tall;
    // height of each edge's line over against the centre, and how steep the fan is towards it
    let north = -(c.x + along_x.x * near.x) / near.y;
    let west = -(c.x + along_y.x * near.y) / near.x;
    let south = (c.z + along_x.y * near.x) / max(far.y, 1.0);
    let east = (c.y + along_y.y * near.y) / max(far.x, 1.0);
    let slopes = array<vec2<f32>, 4>(vec2(along_x.x, north), vec2(west, along_y.x), vec2(along_x.y, south), vec2(east, along_y.y));
    let is_there = vec4(true, true, far.y > 0.0, far.x > 0.0);
    var most = 0.0;
    for (var i = 0u; i < 4u; i++) {
        for (var j = 0u; j < i; j++) {
            most = max(most, select(0.0, length(slopes[i] - slopes[j]), is_there[i] && is_there[j]));
        }
    }
    return most;
}

/// The largest distance between the surface and anything a block can be drawn as, over one tile of its samples. Surface minus
/// fan is linear between samples and where the fan's own ridges cross cells; what finer neighbours change along an edge, they
/// change less towards the centre.
@compute @workgroup_size(8, 8)
fn tiles(@builtin(global_invocation_id) id: vec3<u32>) {
    let tile_level = min(params.level, TILE_LEVEL);
    let tiles_of = level_size(base(), tile_level);
    if any(id.xy >= tiles_of) {
        return;
    }
    let at = id.xy >> vec2(params.level - tile_level);
    let block = block_of(params.level, at, base());
    let nw = height_at(block.low.x, block.low.y);
    let ne = height_at(block.high.x, block.low.y);
    let sw = height_at(block.low.x, block.high.y);
    let se = height_at(block.high.x, block.high.y);
    let centre_m = height_at(block.middle.x, block.middle.y);
    let fan = Fan(centre_m, vec4(nw, ne, sw, se) - centre_m);
    let clamped = is_clamped(block);
    var off = edge_off_in[at.y * level_size(base(), params.level).x + at.x];
    if clamped {
        // ridges cross cells anywhere: with one number for all edges, what they may move is convex across the ridges as well
        off = vec4(max(max(off.x, off.y), max(off.z, off.w)));
    }
    let low = id.xy << vec2(tile_level);
    let high = min(low + (1u << tile_level), base());
    var worst = 0.0;
    var largest = max(max(abs(fan.corners.x), abs(fan.corners.y)), max(abs(fan.corners.z), abs(fan.corners.w)));
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let offset = vec2<f32>(vec2<i32>(vec2(x, y)) - vec2<i32>(block.middle));
            let place = on_fan(block, fan, off, offset);
            let own = height_at(x, y) - centre_m;
            largest = max(largest, abs(own));
            worst = max(worst, abs(own - place.height_m) + place.edge_off);
            // the ridge from north-west to south-east crosses the surface's diagonals in the middle of its cells
            if !clamped && offset.x == offset.y && x < high.x && y < high.y {
                let middle = on_fan(block, fan, off, offset + 0.5);
                let surface = 0.5 * ((height_at(x + 1u, y) - centre_m) + (height_at(x, y + 1u) - centre_m));
                worst = max(worst, abs(surface - middle.height_m) + middle.edge_off);
            }
        }
    }
    if clamped {
        worst += 0.7072 * ridges(block, fan);
    }
    tile_off[id.y * tiles_of.x + id.x] = worst + select(0.0, ROUNDING * largest, worst > 0.0);
}

/// Tiles a side of a block.
fn tiles_a_side() -> u32 {
    return 1u << (params.level - min(params.level, TILE_LEVEL));
}

/// The largest of each row of a block's tiles. (Rows first, since a block of the whole terrain has more tiles than an adapter may
/// give one thread turns of its loops.)
@compute @workgroup_size(8, 8)
fn gather_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    let tiles_of = level_size(base(), min(params.level, TILE_LEVEL));
    let columns = level_size(base(), params.level).x;
    if id.x >= columns || id.y >= tiles_of.y {
        return;
    }
    let low = id.x * tiles_a_side();
    let high = min(low + tiles_a_side(), tiles_of.x);
    var worst = 0.0;
    for (var x = low; x < high; x++) {
        worst = max(worst, tile_off_in[id.y * tiles_of.x + x]);
    }
    row_off[id.y * columns + id.x] = worst;
}

/// The largest of a block's rows of tiles and of the blocks below.
@compute @workgroup_size(8, 8)
fn gather(@builtin(global_invocation_id) id: vec3<u32>) {
    let blocks = level_size(base(), params.level);
    if any(id.xy >= blocks) {
        return;
    }
    let low = id.y * tiles_a_side();
    let high = min(low + tiles_a_side(), level_size(base(), min(params.level, TILE_LEVEL)).y);
    var worst = largest_below(id.xy);
    for (var y = low; y < high; y++) {
        worst = max(worst, row_off_in[y * blocks.x + id.x]);
    }
    put(id.xy, worst);
}
