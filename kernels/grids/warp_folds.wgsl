//!include lib/warp.wgsl
// What is done about folds of a warp: corners of folded cells give way, a round that folds for good is taken back, and in the end the whole warp goes
// only as far as no cell of the grid folds. A cell counts as folded by the sine of its corners, since those of dense places are small.

struct Params {
    /// Columns and rows of the importance map.
    size: vec2<u32>,
    /// Columns and rows of the grid.
    grid: vec2<u32>,
}

@group(0) @binding(0) var<uniform> params: Params;
/// Where the corners of the importance map's cells go.
@group(0) @binding(1) var<storage, read> map_before: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read_write> map_out: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read> warp_map: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read> relax_from: array<vec2<f32>>;
/// How often each of these corners gave way, in the rounds before, and with this one.
@group(0) @binding(5) var<storage, read> gave_way_before: array<u32>;
@group(0) @binding(6) var<storage, read_write> gave_way: array<u32>;
/// Workgroups along x, y and z that visit all corners of the map; none along x if it has no fold.
@group(0) @binding(7) var<storage, read_write> fold_work: array<atomic<u32>>;
/// Those that visit all cells of the grid; none along x if no round has folded anything. Then how much of the warp keeps every cell convex, as
/// the bits of an f32.
@group(0) @binding(8) var<storage, read_write> grid_work: array<atomic<u32>>;
/// Those that visit them once more; none along x if the grid has no fold.
@group(0) @binding(9) var<storage, read_write> left_work: array<atomic<u32>>;
/// Workgroups along x, y and z that take a round back; none along x if it has left no fold.
@group(0) @binding(10) var<storage, read_write> back_work: array<atomic<u32>>;
@group(0) @binding(11) var<storage, read> round_needed: array<u32>;
@group(0) @binding(12) var<storage, read> uniform_point: array<vec2<f32>>;

/// This round may not be needed.
override MAY_END: bool = false;

/// Before a round, nobody has found a fold.
@compute @workgroup_size(1)
fn begin() {
    atomicStore(&fold_work[0], 0u);
    atomicStore(&fold_work[1], groups().y);
    atomicStore(&fold_work[2], 1u);
    atomicStore(&back_work[0], 0u);
    atomicStore(&back_work[1], groups().y);
    atomicStore(&back_work[2], 1u);
}

/// The same for the grid, before the first round.
@compute @workgroup_size(1)
fn begin_grid() {
    atomicStore(&grid_work[0], 0u);
    atomicStore(&grid_work[1], grid_groups().y);
    atomicStore(&grid_work[2], 1u);
    atomicStore(&grid_work[SHARE], bitcast<u32>(1.0));
    atomicStore(&left_work[0], 0u);
    atomicStore(&left_work[1], grid_groups().y);
    atomicStore(&left_work[2], 1u);
}

/// Least sine of a cell's corner.
const LEAST: f32 = 0.02;
/// Least area of a cell's corner, as a share of what it has without warp, where the warp as a whole gives way.
const LEAST_AREA: f32 = 0.001;

/// Workgroups that visit all corners of the map's cells.
fn groups() -> vec2<u32> {
    return (params.size + 8u) / 8u;
}

/// Workgroups that visit all cells of the grid.
fn grid_groups() -> vec2<u32> {
    return (params.grid + 6u) / 8u;
}

/// The least sine of the four corners of a cell, or nearly: negative if it is folded, however small it is.
fn least_sine(nw: vec2<f32>, ne: vec2<f32>, sw: vec2<f32>, se: vec2<f32>) -> f32 {
    let north = min(sine(ne - nw, sw - nw), sine(ne - nw, se - ne));
    return min(north, min(sine(se - sw, sw - nw), sine(se - sw, se - ne)));
}

fn sine(along: vec2<f32>, down: vec2<f32>) -> f32 {
    let area = along.x * down.y - along.y * down.x;
    return area / max(length(along) * length(down), 1e-30);
}

/// Whether a cell of the map is folded, or all but folded.
fn is_folded(cell: vec2<u32>) -> bool {
    let cells = vec2<f32>(params.size);
    let north = cell.y * (params.size.x + 1u) + cell.x;
    let south = north + params.size.x + 1u;
    return least_sine(cells * warp_map[north], cells * warp_map[north + 1u], cells * warp_map[south], cells * warp_map[south + 1u]) < LEAST;
}

/// Whether any cell folds; otherwise no workgroup of `relax` begins.
@compute @workgroup_size(8, 8)
fn find_folds(@builtin(global_invocation_id) id: vec3<u32>) {
    // a round that is not needed changes nothing
    if any(id.xy >= params.size) || (MAY_END && round_needed[0] == 0u) {
        return;
    }
    if is_folded(id.xy) {
        atomicMax(&fold_work[0], groups().x);
        atomicMax(&grid_work[0], grid_groups().x);
    }
}

/// Whether any cell still folds; otherwise no workgroup of `take_back` begins.
@compute @workgroup_size(8, 8)
fn find_left(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    if is_folded(id.xy) {
        atomicMax(&back_work[0], groups().x);
    }
}

/// A further round that folds cells for good is taken back.
@compute @workgroup_size(8, 8)
fn take_back(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy <= params.size) {
        let index = id.y * (params.size.x + 1u) + id.x;
        map_out[index] = map_before[index];
        gave_way[index] = gave_way_before[index];
    }
}

/// A warp along rows that differ can fold the cells between them. The corners of those cells, and no others, give way: each goes to the
/// middle of its neighbours, along the border if it is there. Done to all corners without end this leaves no fold (Tutte 1963).
@compute @workgroup_size(8, 8)
fn relax(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy > params.size) {
        return;
    }
    let wide = params.size.x + 1u;
    let index = id.y * wide + id.x;
    var place = relax_from[index];
    let is_inside = (id.xy > vec2(0u)) & (id.xy < params.size);
    if any(is_inside) && least_around(id.xy) < LEAST {
        let beside = select(0u, 1u, is_inside.x);
        let over = select(0u, wide, is_inside.y);
        // where there is no neighbour the corner is its own, and stays on the border
        let along = 0.5 * (relax_from[index - beside] + relax_from[index + beside]);
        let down = 0.5 * (relax_from[index - over] + relax_from[index + over]);
        place = select(select(down, along, is_inside.x), 0.5 * (along + down), all(is_inside));
        gave_way[index] += 1u;
    }
    map_out[index] = place;
}

/// The least sine of the cells around a corner.
fn least_around(corner: vec2<u32>) -> f32 {
    let cells = vec2<f32>(params.size);
    var least = 1.0;
    for (var i = 0u; i < 4u; i++) {
        // before the first row and column numbers are as large as they can be
        let cell = corner - vec2(i & 1u, i >> 1u);
        if all(cell < params.size) {
            let north = cell.y * (params.size.x + 1u) + cell.x;
            let south = north + params.size.x + 1u;
            least = min(least, least_sine(cells * relax_from[north], cells * relax_from[north + 1u], cells * relax_from[south],
                                          cells * relax_from[south + 1u]));
        }
    }
    return least;
}

/// How far along the straight way from unwarped (0) to warped (1) a corner keeps its sense of rotation: `along` and `down` are
/// by how much its edges change, in cells. The corner's area is 1 + b t + a t^2.
fn convex_until(along: vec2<f32>, down: vec2<f32>) -> f32 {
    let a = along.x * down.y - along.y * down.x;
    let b = along.x + down.y;
    let c = 1.0 - LEAST_AREA;
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return 1.0;
    }
    let q = -0.5 * (b + select(-1.0, 1.0, b >= 0.0) * sqrt(discriminant));
    let first = select(c / q, 2.0, q == 0.0);
    let second = select(q / a, 2.0, a == 0.0);
    return min(select(2.0, first, first > 0.0), select(2.0, second, second > 0.0));
}

/// Whether a cell of the grid still folds, where corners of a finer map gave way and lie close together or not often enough.
@compute @workgroup_size(8, 8)
fn find_grid_folds(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy + 1u >= params.grid) {
        return;
    }
    let place = vec2<f32>(id.xy);
    let nw = place + grid_moved(id.xy);
    let ne = place + vec2(1.0, 0.0) + grid_moved(id.xy + vec2(1u, 0u));
    let sw = place + vec2(0.0, 1.0) + grid_moved(id.xy + vec2(0u, 1u));
    if least_sine(nw, ne, sw, place + 1.0 + grid_moved(id.xy + 1u)) < LEAST {
        atomicMax(&left_work[0], grid_groups().x);
    }
}

/// Then the whole warp goes only as far as none does.
@compute @workgroup_size(8, 8)
fn unfold(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy + 1u >= params.grid) {
        return;
    }
    let nw = grid_moved(id.xy);
    let ne = grid_moved(id.xy + vec2(1u, 0u));
    let sw = grid_moved(id.xy + vec2(0u, 1u));
    let se = grid_moved(id.xy + 1u);
    let north = min(convex_until(ne - nw, sw - nw), convex_until(ne - nw, se - ne));
    let south = min(convex_until(se - sw, sw - nw), convex_until(se - sw, se - ne));
    let until = min(north, south);
    if until < 1.0 {
        // positive floats are ordered like their bits
        atomicMin(&grid_work[SHARE], bitcast<u32>(0.999 * until));
    }
}

/// How far a point of the grid is moved, in cells of the grid.
fn grid_moved(at: vec2<u32>) -> vec2<f32> {
    let place = uniform_point[at.y * params.grid.x + at.x];
    return (warped_place(place) - place) * vec2<f32>(params.grid - 1u);
}
