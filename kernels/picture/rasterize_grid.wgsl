//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/view.wgsl
//!include lib/footprint.wgsl
// A grid mesh to the pixels it covers. Each fragment intersects its pixel's ray with the plane of its triangle, which comes with the
// strip's first vertex and is not interpolated, so distances do not depend on how a GPU interpolates.

struct Params {
    camera: Camera,
    terrain: Terrain,
    view: View,
    /// Columns and rows of vertices.
    grid: vec2<u32>,
    /// The error that the mesh is allowed.
    threshold_px: f32,
    /// How far the rasterizer may see a corner from where it is.
    snap_px: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// x, y, z in metres from the eye; w: the level of a grid point, its normalised error (Paper), metres it was raised (Proven).
@group(0) @binding(1) var<storage, read> vertex: array<vec4<f32>>;
/// For both triangles of a cell: lowest and highest of surface minus plane, in metres.
@group(0) @binding(2) var<storage, read> cell_bound: array<vec4<f32>>;
@group(0) @binding(3) var drawn: texture_2d<u32>;
@group(0) @binding(4) var<storage, read_write> distance: array<f32>;
/// What the mesh carries: its error, or its level.
@group(0) @binding(5) var<storage, read_write> carried: array<f32>;
/// For each tile of pixels, a depth that all its rays reach without a hit.
@group(0) @binding(6) var<storage, read> clear_until: array<f32>;

/// Tiles are known.
override LED: bool = false;
/// Larger is sky; see FAR of lib/traverse.wgsl.
const FARTHEST: f32 = 1.0e38;
/// Pixels a side of a tile.
const TILE: u32 = 8u;
/// The mesh has a proven bound: the error of a pixel comes from bounds of its cell and not from its grid points.
override PROVEN: bool = false;
/// The eye is outside the terrain's rectangle, so that what the mesh has beyond the border can stand in front of it.
override DISCARD: bool = false;

/// Grid place of vertex `k` of a row of the strip: two a column, then two that lead to the next row.
fn strip_place(row: u32, k: u32) -> vec2<u32> {
    let columns = params.grid.x;
    let at = vec2(k / 2u, row + (k & 1u));
    // the last row leads nowhere
    let next = max(row, 1u) - 1u;
    return select(at, select(vec2(columns - 1u, row + 1u), vec2(0u, next), k > 2u * columns), k >= 2u * columns);
}

fn vertex_at(place: vec2<u32>) -> vec4<f32> {
    return vertex[place.y * params.grid.x + place.x];
}

struct Drawn {
    @builtin(position) position: vec4<f32>,
    /// Sample coordinates relative to the eye, to cut the mesh at the terrain's border.
    @location(0) cells: vec2<f32>,
    /// Interpolated: the error of a grid point (Paper), or its level; how much of two of the corners is in a place of the triangle (Proven).
    @location(1) carried: vec2<f32>,
    /// The triangle's normal, upwards, and its product with a corner.
    @location(2) @interpolate(flat, first) plane: vec4<f32>,
    /// Nearest and farthest corner along the view direction.
    @location(3) @interpolate(flat, first) depth: vec2<f32>,
    /// The same of the plane in the middle of what the surface may be.
    @location(4) @interpolate(flat, first) middle: vec4<f32>,
    /// Metres: largest distance of the surface from that plane, distance around the triangle over which that holds, how much
    /// lower than its corners the raised plane may stand there; and by how many times its distance it holds behind the triangle.
    @location(5) @interpolate(flat, first) bound: vec4<f32>,
}

@vertex
fn draw(@builtin(vertex_index) index: u32) -> Drawn {
    let columns = params.grid.x;
    // the grid's last row is the nearest: what is drawn first hides what comes after it
    let row = params.grid.y - 2u - index / (2u * columns + 2u);
    let k = index % (2u * columns + 2u);
    // the triangle that this vertex is the first of; past the row's end there is none with an area
    let last = 2u * columns - 1u;
    let here = vertex_at(strip_place(row, k));
    let second = vertex_at(strip_place(row, min(k + 1u, last)));
    let third = vertex_at(strip_place(row, min(k + 2u, last)));
    let world = here.xyz;
    let view = vec3(dot(params.view.right, world), dot(params.view.up, world), dot(params.view.forward, world));
    // nw, sw, ne and sw, ne, se turn opposite ways
    let turn = select(-1.0, 1.0, (k & 1u) == 0u);
    let normal = turn * cross(second.xyz - world, third.xyz - world);

    var drawn: Drawn;
    // reversed depth without a far plane: near / forward distance
    drawn.position = vec4(view.xy / params.view.half_tan, params.view.near_m, view.z);
    drawn.cells = cells_from_world(params.terrain, world.xy);
    drawn.carried = vec2(here.w, 0.0);
    drawn.plane = vec4(normal, dot(normal, world));
    let depth = vec3(view.z, dot(params.view.forward, second.xyz), dot(params.view.forward, third.xyz));
    drawn.depth = vec2(max(min(depth.x, min(depth.y, depth.z)), 0.0), max(depth.x, max(depth.y, depth.z)));
    drawn.middle = vec4(0.0);
    drawn.bound = vec4(0.0);
    if PROVEN {
        // of three vertices in a row of a strip, each has another remainder
        drawn.carried = select(vec2(0.0), vec2(1.0), vec2(0u, 1u) == vec2(index % 3u));
        let both = cell_bound[row * (columns - 1u) + min(k, last - 2u) / 2u];
        let found = select(both.zw, both.xy, (k & 1u) == 0u);
        let a = lowered(here);
        let lift = vec3(0.0, 0.0, 0.5 * (found.x + found.y));
        let down = turn * cross(lowered(second) - a, lowered(third) - a);
        drawn.middle = vec4(down, dot(down, a + lift));
        let extent = max(max(here.xy, second.xy), third.xy) - min(min(here.xy, second.xy), third.xy);
        let low = min(here.w, min(second.w, third.w));
        let high = max(here.w, max(second.w, third.w));
        let distances = vec3(length(here.xy), length(second.xy), length(third.xy));
        let nearest = min(distances.x, min(distances.y, distances.z));
        let farthest = max(distances.x, max(distances.y, distances.z));
        drawn.bound = vec4(0.5 * (found.y - found.x), 0.99 * EDGE * max(extent.x, extent.y), 4.0 * EDGE * (high - low),
                           0.99 * reach_behind(nearest, farthest));
    }
    return drawn;
}

/// A corner where it was before it was raised.
fn lowered(corner: vec4<f32>) -> vec3<f32> {
    return corner.xyz - vec3(0.0, 0.0, corner.w);
}

/// Parameter of the hit of a pixel's ray, which is its depth. Depth is linear on a triangle: its corners bound the answer,
/// also where the rasterizer drew a pixel just beside it and its plane is seen all but edge-on.
fn hit(ray: vec3<f32>, drawn: Drawn) -> f32 {
    let steep = dot(drawn.plane.xyz, ray);
    let t = select(drawn.plane.w / steep, drawn.depth.x, steep == 0.0);
    return clamp(t, drawn.depth.x, drawn.depth.y);
}

fn is_outside(cells: vec2<f32>) -> bool {
    let border = vec2<i32>(params.terrain.size) - 1;
    return any(cells < relative_cells(params.terrain, vec2(0))) || any(cells > relative_cells(params.terrain, border));
}

/// Whether this part of the mesh is beyond the terrain's border. Seen from inside, nothing of the terrain is behind it, and a
/// fragment that is not discarded keeps the depth test early.
fn is_air(cells: vec2<f32>) -> bool {
    let outside = is_outside(cells);
    if DISCARD && outside {
        discard;
    }
    return outside;
}

/// Whether a pixel's ray meets its triangle, and not only the one that the rasterizer sees with its corners moved.
fn is_within(two: vec2<f32>) -> bool {
    let shares = vec3(two, 1.0 - two.x - two.y);
    return all(shares > 3.0 * params.snap_px * fwidth(shares));
}

/// The largest error of a pixel for which the mesh shows at least where a ray may start.
const LARGEST_ERROR: f32 = 0.99999;

/// Depth and normalised error (Loeffler et al., Eq. 4) of what is drawn at a pixel. With error 0 it is in the middle of what the
/// surface may be; below 1 no surface is in front of it; 1 says nothing.
fn proven(ray: vec3<f32>, raised: f32, drawn: Drawn) -> vec2<f32> {
    let normal = drawn.plane.xyz;
    let steep = dot(normal, ray);
    let lower = dot(drawn.middle.xyz, ray);
    // seen from below, or turned over: the ray starts under the mesh
    if !(steep < 0.0 && lower < 0.0 && normal.z > 0.0) || raised <= drawn.depth.x || raised >= drawn.depth.y {
        return vec2(raised, 1.0);
    }
    let start = max(raised + drawn.bound.z * normal.z / steep, 0.0);
    // the triangle may end just beside this pixel, and the ray goes on from it to the plane
    let right = params.camera.right_hi + params.camera.right_lo;
    let down = params.camera.down_hi + params.camera.down_lo;
    let a = raised * (right - ray * (dot(normal, right) / steep));
    let b = raised * (down - ray * (dot(normal, down) / steep));
    let t = max(drawn.middle.w / lower, raised);
    let beside = 2.0 * params.snap_px * sqrt(dot(a.xy, a.xy) + dot(b.xy, b.xy));
    let bound_m = drawn.bound.x;
    let depth = t - bound_m * abs(params.view.forward.z);
    let holds = beside <= drawn.bound.y && t <= raised * (1.0 + drawn.bound.w) && depth > 0.0;
    if !holds || is_outside(cells_from_world(params.terrain, ray.xy * t)) {
        return vec2(start, LARGEST_ERROR);
    }
    let off_px = params.view.focal_px * bound_m * length(ray * params.view.forward.z - vec3(0.0, 0.0, 1.0)) / depth;
    // what rounding adds to a pixel's place
    let most_px = off_px * 1.0001 + 0.01;
    let is_over = most_px > params.threshold_px;
    return select(vec2(t, 0.0), vec2(start, min(1.0 - params.threshold_px / most_px, LARGEST_ERROR)), is_over);
}

@fragment
fn keep(drawn: Drawn) -> @location(0) u32 {
    if is_air(drawn.cells) {
        return 0u;
    }
    let ray = view_ray_of_pixel(params.camera, vec2<u32>(drawn.position.xy));
    return bitcast<u32>(hit(ray, drawn) * length(ray));
}

@fragment
fn keep_carried(drawn: Drawn) -> @location(0) vec2<u32> {
    let is_within = !PROVEN || is_within(drawn.carried);
    if is_air(drawn.cells) {
        return vec2(0u);
    }
    let ray = view_ray_of_pixel(params.camera, vec2<u32>(drawn.position.xy));
    var seen = vec2(hit(ray, drawn), drawn.carried.x);
    if PROVEN {
        seen = proven(ray, seen.x, drawn);
        // a ray that passes beside the triangle, and beside what hides the way under the mesh, may have been under it all along
        seen.y = select(1.0, seen.y, is_within);
    }
    return bitcast<vec2<u32>>(seen * vec2(length(ray), 1.0));
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.camera.viewport) {
        return;
    }
    let bits = textureLoad(drawn, id.xy, 0).x;
    distance[id.y * params.camera.viewport.x + id.x] = select(bitcast<f32>(bits), NO_SURFACE, bits == 0u);
}

@compute @workgroup_size(8, 8)
fn resolve_carried(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.camera.viewport) {
        return;
    }
    let index = id.y * params.camera.viewport.x + id.x;
    let bits = textureLoad(drawn, id.xy, 0).xy;
    distance[index] = select(bitcast<f32>(bits.x), NO_SURFACE, bits.x == 0u);
    // the paper takes what the mesh does not cover for sky; proven is only what rays have seen
    var uncovered = select(0.0, 1.0, PROVEN);
    if PROVEN && LED {
        let tiles = (params.camera.viewport.x + TILE - 1u) / TILE;
        uncovered = select(1.0, 0.0, clear_until[(id.y / TILE) * tiles + id.x / TILE] > FARTHEST);
    }
    carried[index] = select(bitcast<f32>(bits.y), uncovered, bits.x == 0u);
}
