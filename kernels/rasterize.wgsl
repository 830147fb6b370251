//!include lib/camera.wgsl
//!include lib/terrain.wgsl
// A grid mesh to the pixels it covers: a draw that keeps the nearest triangle's number, then one exact
// intersection of each pixel's ray with its triangle.

struct Params {
    camera: Camera,
    terrain: Terrain,
    /// Columns and rows of vertices.
    grid: vec2<u32>,
    /// World axes of the view, as rows: right, up, forward.
    view_right: vec3<f32>,
    view_up: vec3<f32>,
    view_forward: vec3<f32>,
    /// Tangents of half the field of view.
    half_tan: vec2<f32>,
    near_m: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
/// x, y, z in metres from the eye; w is not used here.
@group(0) @binding(1) var<storage, read> vertex: array<vec4<f32>>;
@group(0) @binding(2) var visible: texture_2d<u32>;
@group(0) @binding(3) var<storage, read_write> distance: array<f32>;

/// Cell corners of the two triangles; the diagonal joins the north-east and south-west corner.
fn corner(triangle: u32, which: u32) -> vec3<f32> {
    let cells = params.grid.x - 1u;
    let cell = vec2((triangle / 2u) % cells, (triangle / 2u) / cells);
    // 0: nw, sw, ne; 1: ne, sw, se
    let offsets = array(vec2(0u, 0u), vec2(0u, 1u), vec2(1u, 0u), vec2(1u, 0u), vec2(0u, 1u), vec2(1u, 1u));
    let at = cell + offsets[(triangle & 1u) * 3u + which];
    return vertex[at.y * params.grid.x + at.x].xyz;
}

struct Drawn {
    @builtin(position) position: vec4<f32>,
    /// Sample coordinates relative to the eye, to cut the mesh at the terrain's border.
    @location(0) cells: vec2<f32>,
    @location(1) @interpolate(flat, first) triangle: u32,
}

@vertex
fn draw(@builtin(vertex_index) index: u32) -> Drawn {
    let triangle = index / 3u;
    let world = corner(triangle, index % 3u);
    let view = vec3(dot(params.view_right, world), dot(params.view_up, world), dot(params.view_forward, world));
    var drawn: Drawn;
    // reversed depth without a far plane: near / forward distance
    drawn.position = vec4(view.xy / params.half_tan, params.near_m, view.z);
    drawn.cells = cells_from_world(params.terrain, world.xy);
    drawn.triangle = triangle;
    return drawn;
}

@fragment
fn keep(drawn: Drawn) -> @location(0) u32 {
    let border = vec2<i32>(params.terrain.size) - 1;
    let low = relative_cells(params.terrain, vec2(0));
    let high = relative_cells(params.terrain, border);
    if any(drawn.cells < low) || any(drawn.cells > high) {
        discard;
    }
    return drawn.triangle + 1u;
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.camera.viewport) {
        return;
    }
    let index = id.y * params.camera.viewport.x + id.x;
    let number = textureLoad(visible, id.xy, 0).x;
    if number == 0u {
        distance[index] = NO_SURFACE;
        return;
    }
    let a = corner(number - 1u, 0u);
    let b = corner(number - 1u, 1u);
    let c = corner(number - 1u, 2u);
    let ray = view_ray_of_pixel(params.camera, id.xy);
    let normal = cross(b - a, c - a);
    let steep = dot(normal, ray);
    // a ray's parameter is its depth, and depth is linear on a triangle: its corners bound the answer, also where the
    // rasterizer drew a pixel just beside it and its plane is seen all but edge-on
    let depth = vec3(dot(params.view_forward, a), dot(params.view_forward, b), dot(params.view_forward, c));
    let nearest = max(min(depth.x, min(depth.y, depth.z)), 0.0);
    let farthest = max(depth.x, max(depth.y, depth.z));
    let t = select(dot(normal, a) / steep, nearest, steep == 0.0);
    distance[index] = clamp(t, nearest, farthest) * length(ray);
}
