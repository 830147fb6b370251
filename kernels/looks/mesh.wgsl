//!include lib/look.wgsl
// A mesh as lines or filled triangles: a grid of points, a list of triangles between samples, or blocks of a quadtree, from any side.

struct Params {
    format: Format,
    scale: Scale,
    /// Clip space from metres (or from any unit that the points are in).
    clip_x: vec4<f32>,
    clip_y: vec4<f32>,
    clip_z: vec4<f32>,
    clip_w: vec4<f32>,
    /// Where the south-west sample is in the points' frame, without and with the height 0.
    south_west: vec3<f32>,
    /// Columns and rows of points, or of samples.
    size: vec2<u32>,
    cell_m: vec2<f32>,
    /// Columns and rows of the values that colour it.
    values: vec2<u32>,
    /// How many numbers an element of the points has.
    components: u32,
    /// Added to the depth, which is larger nearer.
    lift: f32,
    colour: u32,
}

/// What the points are.
const GRID: u32 = 0u;
const TRIANGLES: u32 = 1u;
const BLOCKS: u32 = 2u;

/// What colours a point.
const ONE_COLOUR: u32 = 0u;
const BY_POINT: u32 = 1u;
const BY_PLACE: u32 = 2u;
const BY_CELL: u32 = 3u;

override MESH: u32 = GRID;
override VALUE_FROM: u32 = ONE_COLOUR;
override IS_FILLED: bool = false;
/// Every other pixel shows what is under the mesh.
override IS_SHEER: bool = false;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> points: array<u32>;
/// For each point of a grid its place in the square that it is over.
@group(0) @binding(2) var<storage, read> places: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read> data: array<u32>;
@group(0) @binding(4) var<storage, read> heights: array<f32>;
@group(0) @binding(5) var<storage, read> colours: array<u32>;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) colour: u32,
}

/// Where a corner of a primitive is, and the element that colours it.
struct Found {
    point: vec3<f32>,
    element: u32,
    is_there: bool,
}

fn grid_corner(primitive: u32, corner: u32) -> Found {
    let cells = params.size - 1u;
    var at: vec2<u32>;
    var cell: vec2<u32>;
    // how far the primitive reaches from its first point
    var reach = vec2(1u, 1u);
    if IS_FILLED {
        let index = primitive / 2u;
        cell = vec2(index % cells.x, index / cells.x);
        let second = primitive % 2u;
        // 0 1 2 and 2 1 3 of the corners north-west, south-west, north-east, south-east
        let which = select(corner, select(3u, 2u - corner, corner < 2u), second == 1u);
        at = cell + vec2(which / 2u, which % 2u);
    } else {
        let index = primitive / 3u;
        cell = vec2(index % params.size.x, index / params.size.x);
        let ways = array(vec2(1u, 0u), vec2(0u, 1u), vec2(1u, 1u));
        reach = ways[primitive % 3u];
        at = cell + reach * corner;
        if primitive % 3u == 2u {
            // the diagonal joins north-east and south-west
            at = cell + select(vec2(1u, 0u), vec2(0u, 1u), corner == 1u);
        }
    }
    let is_there = all(cell + reach < params.size);
    let clamped = min(at, params.size - 1u);
    let element = clamped.y * params.size.x + clamped.x;
    let word = element * params.components;
    var point = vec3(bitcast<f32>(points[word]), bitcast<f32>(points[word + 1u]), 0.0);
    if params.components >= 3u {
        point.z = bitcast<f32>(points[word + 2u]);
    }
    var coloured = element;
    if VALUE_FROM == BY_CELL {
        let own = min(cell, params.values - 1u);
        coloured = own.y * params.values.x + own.x;
    }
    if VALUE_FROM == BY_PLACE {
        let place = clamp(places[element], vec2(0.0), vec2(1.0));
        let own = min(vec2<u32>(place * vec2<f32>(params.values)), params.values - 1u);
        coloured = own.y * params.values.x + own.x;
    }
    return Found(point, coloured, is_there);
}

fn sample_point(sample: vec2<u32>) -> vec3<f32> {
    let inside = min(sample, params.size - 1u);
    let along = vec2<f32>(vec2(inside.x, params.size.y - 1u - inside.y)) * params.cell_m;
    return params.south_west + vec3(along, heights[inside.y * params.size.x + inside.x]);
}

fn triangle_corner(primitive: u32, corner: u32) -> Found {
    let triangle = select(primitive / 3u, primitive, IS_FILLED);
    // of a line, its own corner and the next one
    let which = select((primitive % 3u + corner) % 3u, corner, IS_FILLED);
    let packed = points[triangle * 4u + which];
    return Found(sample_point(vec2(packed & 0xffffu, packed >> 16u)), triangle, true);
}

fn block_corner(primitive: u32, corner: u32) -> Found {
    let lines = select(4u, 2u, IS_FILLED);
    let block = primitive / lines;
    let side = primitive % lines;
    let centre = points[block * 2u];
    let level = countTrailingZeros(centre);
    let half = 1u << level;
    let halves = vec2(centre & 0xffffu, centre >> 16u);
    let low = (halves - half) / 2u;
    let corners = array(vec2(0u, 0u), vec2(1u, 0u), vec2(1u, 1u), vec2(0u, 1u));
    var which = (side + corner) % 4u;
    if IS_FILLED {
        which = select(corner, select(0u, corner + 1u, corner > 0u), side == 1u);
    }
    return Found(sample_point(low + corners[which] * (half)), block, true);
}

@vertex
fn draw(@builtin(vertex_index) vertex: u32) -> Corner {
    let corners = select(2u, 3u, IS_FILLED);
    let primitive = vertex / corners;
    let corner = vertex % corners;
    var found: Found;
    switch MESH {
        case TRIANGLES: {
            found = triangle_corner(primitive, corner);
        }
        case BLOCKS: {
            found = block_corner(primitive, corner);
        }
        default: {
            found = grid_corner(primitive, corner);
        }
    }
    let point = vec4(found.point, 1.0);
    var clip = vec4(dot(params.clip_x, point), dot(params.clip_y, point), dot(params.clip_z, point), dot(params.clip_w, point));
    clip.z += params.lift * clip.w;
    if !found.is_there {
        // beyond every plane
        clip = vec4(2.0, 2.0, 2.0, 1.0);
    }
    return Corner(clip, colour_of(found));
}

fn colour_of(found: Found) -> u32 {
    if VALUE_FROM == ONE_COLOUR {
        return params.colour;
    }
    let shown = shown_of(data[found.element * params.format.words + params.format.word], params.format, KIND);
    if shown.kind != NUMBER {
        return select(0xffff00ffu, 0xff3a3430u, shown.kind == MISSING);
    }
    return colours[u32(share_of(shown.value, params.scale) * 255.0 + 0.5)];
}

@fragment
fn paint(corner: Corner) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(corner.clip.xy);
    if IS_SHEER && ((pixel.x + pixel.y) & 1u) == 1u {
        discard;
    }
    return unpack4x8unorm(corner.colour);
}
