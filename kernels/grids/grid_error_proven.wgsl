//!include lib/terrain.wgsl
//!include lib/view.wgsl
//!include ground
//!include lib/footprint.wgsl
// How far a projected grid can be from the surface anywhere in each of its cells (`bound`), and the grid raised until it is nowhere under
// the surface (`raise`): docs/proven_bound.md.

struct Params {
    terrain: Terrain,
    view: View,
    /// Columns and rows of grid points.
    grid: vec2<u32>,
    /// How far the rasterizer may see a corner from where it is.
    snap_px: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// x, y, z in metres from the eye; w: pyramid level.
@group(0) @binding(1) var<storage, read> vertex: array<vec4<f32>>;
/// Of each node: height in its middle and largest distance of the surface from its plane; its slopes as two halves.
@group(0) @binding(2) var<storage, read> height_plane: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read> plane_slope: array<u32>;
/// For both triangles of a cell: lowest and highest of surface minus plane, in metres.
@group(0) @binding(4) var<storage, read_write> cell_bound: array<vec4<f32>>;
/// How far a cell's corners have to rise, in metres.
@group(0) @binding(5) var<storage, read_write> cell_raise: array<f32>;
@group(0) @binding(6) var<storage, read> raises: array<f32>;
/// x, y, z in metres from the eye; w: metres it was raised.
@group(0) @binding(7) var<storage, read_write> moved: array<vec4<f32>>;

/// z = at_m + slope . (place - corner), places in cells from the eye.
struct Plane {
    corner: vec2<f32>,
    at_m: f32,
    slope: vec2<f32>,
}

/// Through three points in cells and metres; level through the first if they stand in a line, and draw nothing.
fn plane_through(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Plane {
    let u = b - a;
    let v = c - a;
    let area = u.x * v.y - u.y * v.x;
    let slope = vec2(u.z * v.y - u.y * v.z, u.x * v.z - u.z * v.x) / area;
    return Plane(a.xy, a.z, select(slope, vec2(0.0), area == 0.0));
}

/// Ground under and behind a cell of the grid: its corners in cells from the eye, how far around them it goes, and how many times
/// as far from the eye.
struct Footprint {
    x: vec4<f32>,
    y: vec4<f32>,
    around: vec2<f32>,
    far: f32,
}

fn least(v: vec4<f32>) -> f32 {
    return min(min(v.x, v.y), min(v.z, v.w));
}

fn most(v: vec4<f32>) -> f32 {
    return max(max(v.x, v.y), max(v.z, v.w));
}

fn low_of(ground: Footprint) -> vec2<f32> {
    let low = vec2(least(ground.x), least(ground.y));
    return min(low, low * ground.far) - ground.around;
}

fn high_of(ground: Footprint) -> vec2<f32> {
    let high = vec2(most(ground.x), most(ground.y));
    return max(high, high * ground.far) + ground.around;
}

/// Part of the surface: a plane over a box, and what it may be off by.
struct Part {
    low: vec2<f32>,
    high: vec2<f32>,
    plane: Plane,
    off_m: f32,
}

/// A range of heights; nothing if its ends are the wrong way round.
const NOTHING: vec2<f32> = vec2(3.0e38, -3.0e38);

fn join(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2(min(a.x, b.x), max(a.y, b.y));
}

/// A part minus a plane over what the part shares with a footprint: within its range over both of their boxes, and within its range
/// over the footprint's corners.
fn range_of(ground: Footprint, part: Part, minus: Plane) -> vec2<f32> {
    let box_low = max(low_of(ground), part.low);
    let box_high = min(high_of(ground), part.high);
    if any(box_low > box_high) {
        return NOTHING;
    }
    let middle = 0.5 * (box_low + box_high);
    let slope = part.plane.slope - minus.slope;
    let at_m = part.plane.at_m + dot(part.plane.slope, middle - part.plane.corner)
        - minus.at_m - dot(minus.slope, middle - minus.corner);
    let spread = 0.5 * dot(abs(slope), box_high - box_low);
    let near = at_m + slope.x * (ground.x - middle.x) + slope.y * (ground.y - middle.y);
    let far = at_m + slope.x * (ground.x * ground.far - middle.x) + slope.y * (ground.y * ground.far - middle.y);
    let beyond = dot(abs(slope), ground.around);
    let range_m = vec2(max(at_m - spread, least(min(near, far)) - beyond), min(at_m + spread, most(max(near, far)) + beyond));
    return select(range_m + vec2(-part.off_m, part.off_m), NOTHING, range_m.x > range_m.y);
}

/// What a cell of the grid is looked at with: the ground under it, the ground as far around as its bounds have to hold, and the
/// planes of its triangles.
struct Cell {
    under: Footprint,
    around: Footprint,
    low: vec2<f32>,
    high: vec2<f32>,
    first: Plane,
    second: Plane,
}

/// Surface minus each plane around the cell; under it, how far the surface is above each plane at most, and how high it is.
struct Found {
    first: vec2<f32>,
    second: vec2<f32>,
    above: vec2<f32>,
    highest: f32,
}

fn look(found: Found, cell: Cell, part: Part) -> Found {
    let level = Plane(vec2(0.0), 0.0, vec2(0.0));
    let above = vec2(range_of(cell.under, part, cell.first).y, range_of(cell.under, part, cell.second).y);
    return Found(
        join(found.first, range_of(cell.around, part, cell.first)),
        join(found.second, range_of(cell.around, part, cell.second)),
        max(found.above, above),
        max(found.highest, range_of(cell.under, part, level).y),
    );
}

/// The surface in one cell of the terrain: two planes, each where it holds, or a patch.
fn look_at_cell(before: Found, cell: Cell, node: vec2<i32>) -> Found {
    let four = ground_corners(node);
    let h = vec4(relative_height(params.terrain, four.x), relative_height(params.terrain, four.y),
                 relative_height(params.terrain, four.z), relative_height(params.terrain, four.w));
    let corner = relative_cells(params.terrain, node);
    // a little wider than it is: neighbours round the line between them each in their own way
    let low = max(cell.low, corner) - 1e-6;
    let high = min(cell.high, corner + 1.0) + 1e-6;
    let from_corner = low - corner;
    let to_corner = high - corner;
    var found = before;
    if BILINEAR {
        let place = 0.5 * (from_corner + to_corner);
        let half = 0.5 * (to_corner - from_corner);
        let twist = ground_twist(h);
        let slope = ground_slope(h, true) + twist * place.yx;
        let at_m = ground_on_patch(h, place);
        return look(found, cell, Part(low, high, Plane(corner + place, at_m, slope), abs(twist) * half.x * half.y));
    }
    if ground_is_north_west(from_corner) {
        found = look(found, cell, Part(low, high, Plane(corner, h.x, ground_slope(h, true)), 0.0));
    }
    if ground_past_diagonal(to_corner) >= 0.0 {
        found = look(found, cell, Part(low, high, Plane(corner + 1.0, h.w, ground_slope(h, false)), 0.0));
    }
    return found;
}

/// The surface in a node, from its plane.
fn look_at_node(found: Found, cell: Cell, level: u32, node: vec2<i32>) -> Found {
    let index = ground_node(level, vec2<u32>(node));
    let plane = height_plane[index];
    let corner = relative_cells(params.terrain, node << vec2(level));
    let side = f32(1u << level);
    let middle = Plane(corner + 0.5 * side, relative_height(params.terrain, plane.x), unpack2x16float(plane_slope[index]));
    return look(found, cell, Part(corner - 1e-6 * side, corner + side * 1.000001, middle, plane.y));
}

fn corner_at(at: vec2<u32>) -> vec3<f32> {
    let point = vertex[at.y * params.grid.x + at.x];
    return vec3(cells_from_world(params.terrain, point.xy), point.z);
}

/// Nodes a side that a cell is looked at with, at most.
const NODES: i32 = 4;

fn look_around(cell: Cell) -> Found {
    var found = Found(NOTHING, NOTHING, vec2(NOTHING.y), NOTHING.y);
    let last = vec2<i32>(params.terrain.size) - 2;
    let first_cell = cell_of(params.terrain, cell.low);
    let last_cell = cell_of(params.terrain, cell.high);
    if any(first_cell > last) || any(last_cell < vec2(0)) {
        return found;
    }
    let a = clamp(first_cell, vec2(0), last);
    let b = clamp(last_cell, vec2(0), last);
    var level = 0u;
    while any((b >> vec2(level)) - (a >> vec2(level)) >= vec2(NODES)) {
        level += 1u;
    }
    let to = b >> vec2(level);
    for (var y = a.y >> level; y <= to.y; y++) {
        for (var x = a.x >> level; x <= to.x; x++) {
            if level == 0u {
                found = look_at_cell(found, cell, vec2(x, y));
            } else {
                found = look_at_node(found, cell, level, vec2(x, y));
            }
        }
    }
    return found;
}

@compute @workgroup_size(8, 8)
fn bound(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = params.grid - 1u;
    if any(id.xy >= cells) {
        return;
    }
    let nw = corner_at(id.xy);
    let ne = corner_at(id.xy + vec2(1u, 0u));
    let sw = corner_at(id.xy + vec2(0u, 1u));
    let se = corner_at(id.xy + 1u);
    let m1 = plane_through(nw, ne, sw);
    let m2 = plane_through(se, sw, ne);
    let cell_m = params.terrain.cell_m;
    let low = min(min(nw, ne), min(sw, se));
    let high = max(max(nw, ne), max(sw, se));
    let extent = (high.xy - low.xy) * cell_m;
    let farthest = max(abs(low), abs(high)) * vec3(cell_m, 1.0);
    let snap_m = params.snap_px / params.view.focal_px * length(farthest);
    // the bounds hold on the ground close to the cell and behind it, too; see `proven` of picture/rasterize_grid.wgsl
    let around = (EDGE * max(extent.x, extent.y) + snap_m) / cell_m + 1e-6 * max(abs(low.xy), abs(high.xy));
    let x = vec4(nw.x, ne.x, sw.x, se.x);
    let y = vec4(nw.y, ne.y, sw.y, se.y);
    let distances = sqrt(x * x * cell_m.x * cell_m.x + y * y * cell_m.y * cell_m.y);
    let far = 1.0 + reach_behind(least(distances), most(distances)) * 1.01;
    let behind = Footprint(x, y, around, far);
    let found = look_around(Cell(Footprint(x, y, around, 1.0), behind, low_of(behind), high_of(behind), m1, m2));
    let index = id.y * cells.x + id.x;
    if found.first.y < found.first.x {
        // nothing but air under this cell
        cell_bound[index] = vec4(0.0);
        cell_raise[index] = 0.0;
        return;
    }
    // what rounding adds: a few units of the terms of every height and of every place times its slope
    let steepest = max(abs(m1.slope), abs(m2.slope));
    let terms = farthest.z + dot(steepest, max(abs(low.xy), abs(high.xy)) * 0.25 + (high.xy - low.xy));
    // what is only behind the cell has a bound, but nothing to rise above
    let highest = max(found.highest, -farthest.z);
    let rounding = 1.0e-6 * (terms + abs(highest));
    // a thin triangle's plane is steep, but between its corners it is no lower than the lowest of them
    let lowest = min(ne.z, sw.z);
    let rise = min(found.above, highest - vec2(min(nw.z, lowest), min(se.z, lowest)));
    let slide = min(dot(steepest, vec2(snap_m) / cell_m), high.z - low.z) + snap_m;
    cell_bound[index] = vec4(found.first, found.second) + rounding * vec4(-1.0, 1.0, -1.0, 1.0);
    cell_raise[index] = max(max(rise.x, rise.y), 0.0) + slide + rounding;
}

@compute @workgroup_size(8, 8)
fn raise(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.grid) {
        return;
    }
    let cells = params.grid - 1u;
    // the cells around the point, clamped at the border
    let a = max(id.xy, vec2(1u)) - 1u;
    let b = min(id.xy, cells - 1u);
    let by = max(max(raises[a.y * cells.x + a.x], raises[a.y * cells.x + b.x]),
                 max(raises[b.y * cells.x + a.x], raises[b.y * cells.x + b.x]));
    let index = id.y * params.grid.x + id.x;
    let point = vertex[index];
    moved[index] = vec4(point.xy, point.z + by, by);
}
