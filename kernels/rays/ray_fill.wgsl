//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/view.wgsl
//!include lib/traverse.wgsl
//!include lib/place.wgsl
// First hit for the pixels of a list, which replaces what the mesh drew there: exact, or, for blocks of several rows, within the
// bound that the mesh has promised.

struct Params {
    camera: Camera,
    terrain: Terrain,
    octaves: Octaves,
    view: View,
    /// Elements that the list has room for.
    length: u32,
    /// Steepest slope of the surface, as a tangent.
    steepest: f32,
    /// Largest error that a pixel may have.
    bound_px: f32,
    foreground: Foreground,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> distance: array<f32>;
/// For each tile of pixels, a t that all its rays reach without a hit; FAR if none of them hits anything.
@group(0) @binding(2) var<storage, read> clear_until: array<f32>;
/// Numbers of the pixels.
@group(0) @binding(3) var<storage, read> pixels: array<u32>;
/// Workgroups along x, y, z, and how many pixels there are.
@group(0) @binding(4) var<storage, read> pixels_count: array<u32>;
/// Normalised error of what the mesh drew.
@group(0) @binding(5) var<storage, read> error: array<f32>;

/// The mesh is nowhere under the surface: what it drew in front of a ray, the ray reaches.
override FROM_MESH: bool = false;
/// Rows of pixels that an element of the list stands for.
override ROWS: u32 = 1;

/// Pixels a side of a tile.
const TILE: u32 = 8u;

fn number_of(pixel: vec2<u32>) -> u32 {
    return pixel.y * params.camera.viewport.x + pixel.x;
}

/// How far the ray of a pixel of the list is known to go without a hit; the mesh is asked while the pixel still shows it.
fn clear_of(pixel: vec2<u32>, direction_m: vec3<f32>, is_untouched: bool) -> f32 {
    if UNDERSIDE {
        return 0.0;
    }
    let tiles = (params.camera.viewport.x + TILE - 1u) / TILE;
    let clear = clear_until[(pixel.y / TILE) * tiles + pixel.x / TILE];
    let index = number_of(pixel);
    if FROM_MESH && is_untouched && error[index] < 1.0 {
        return max(clear, distance[index] / length(direction_m) * 0.999998);
    }
    return clear;
}

fn hit_after(direction_m: vec3<f32>, clear: f32) -> f32 {
    var t = FAR;
    if clear < FAR {
        t = first_hit(direction_m, clear);
    }
    return t;
}

fn cast_pixel(pixel: vec2<u32>) {
    let direction_m = view_ray_of_pixel(params.camera, pixel);
    let t = hit_after(direction_m, clear_of(pixel, direction_m, true));
    distance[number_of(pixel)] = select(t * length(direction_m), NO_SURFACE, t >= FAR);
}

// ---- One ray for several pixels, one under another ----

fn is_over(pixel: vec2<u32>) -> bool {
    return pixel.y < params.camera.viewport.y && error[number_of(pixel)] > 0.0;
}

/// Parameter of the pixel's ray where it passes closest to where another ray has 1, on the ground.
fn beside(shared_m: vec3<f32>, own_m: vec3<f32>) -> f32 {
    return dot(shared_m.xy, own_m.xy) / max(dot(own_m.xy, own_m.xy), 1e-12);
}

/// How much farther or nearer than on its own ray a pixel may show what another ray has hit.
const MOST_APART: f32 = 0.1;

/// Pixels, with room for rounding, of a difference in height next to a place on a pixel's ray.
fn off_px(own_m: vec3<f32>, t: f32, off_m: f32) -> f32 {
    let depth = t - off_m * abs(params.view.forward.z);
    let px = params.view.focal_px * off_m * length(own_m * params.view.forward.z - vec3(0.0, 0.0, 1.0)) / depth;
    return select(FAR, px * 1.0001 + 0.02, depth > 0.0);
}

/// Whether what is hit on a ray, and that nothing is hit before, holds for a pixel's own ray within its bound. Both rays are
/// straight: what they are apart, in height and aside times the steepest slope there is, grows with the distance, and is as many
/// pixels everywhere.
fn serves(shared_m: vec3<f32>, own_m: vec3<f32>) -> bool {
    let along = beside(shared_m, own_m);
    // a millionth is what rounding may do to a ray
    let aside = length(shared_m.xy - own_m.xy * along) + 1e-6;
    let slack = params.steepest * aside;
    let off = max(abs(own_m.z * along - shared_m.z), slack) + slack;
    // close to the ground below the eye, the same ground can be at quite another distance
    return abs(along - 1.0) <= MOST_APART && off_px(own_m, along, off) <= params.bound_px;
}

/// Parameter at which a ray leaves the terrain. The eye is over it.
fn way_out(direction_m: vec3<f32>) -> f32 {
    let terrain = params.terrain;
    let direction = cells_from_world(terrain, direction_m.xy);
    let low = relative_cells(terrain, vec2(0));
    let high = relative_cells(terrain, vec2<i32>(terrain.size) - 1);
    let out = select(low, high, direction >= vec2(0.0)) / direction;
    return min(out.x, out.y);
}

/// Whether a ray that meets nothing says so for a pixel's own, too, which may have a way to go where the first has left the terrain.
fn serves_sky(shared_m: vec3<f32>, own_m: vec3<f32>) -> bool {
    let along = beside(shared_m, own_m);
    let out = way_out(shared_m);
    let ground = length(own_m.xy);
    let farther = ground * max(way_out(own_m) - along * out, 0.0) + 1e-6 * ground * out;
    let slack = params.steepest * (length(shared_m.xy - own_m.xy * along) + 1e-6) * out;
    let off = abs(own_m.z * along - shared_m.z) * out + slack + farther * (params.steepest + abs(own_m.z) / ground);
    return off_px(own_m, along * out, off) <= params.bound_px;
}

/// One of the two triangles of a cell.
struct Triangle {
    /// The cell's north-west corner, in cells from the eye.
    corner: vec2<f32>,
    /// Metres a cell.
    slope: vec2<f32>,
    is_north_west: bool,
}

fn triangle_at(hit_m: vec3<f32>) -> Triangle {
    let terrain = params.terrain;
    let at = cells_from_world(terrain, hit_m.xy);
    let whole = terrain.eye_cell + vec2<i32>(floor(at + terrain.eye_fraction));
    let cell = clamp(whole, vec2(0), vec2<i32>(terrain.size) - 2);
    let corner = relative_cells(terrain, cell);
    let h = ground_corners(cell);
    let is_north_west = ground_is_north_west(at - corner);
    return Triangle(corner, ground_slope(h, is_north_west), is_north_west);
}

/// Shows at a pixel what another ray has hit: where the pixel's own ray meets the same triangle, or else the ground next to the hit.
/// False if that would be beyond the terrain's border, or if meeting nothing says nothing for this pixel.
fn show(pixel: vec2<u32>, shared_m: vec3<f32>, t: f32, hit: Triangle) -> bool {
    let terrain = params.terrain;
    let own_m = view_ray_of_pixel(params.camera, pixel);
    let own = cells_from_world(terrain, own_m.xy);
    var own_t = t * beside(shared_m, own_m);
    if !BILINEAR {
        let away = own * own_t - cells_from_world(terrain, shared_m.xy * t);
        let gap = own_m.z * own_t - shared_m.z * t - dot(hit.slope, away);
        let steep = own_m.z - dot(hit.slope, own);
        let exact = own_t - gap / steep;
        let place = own * exact - hit.corner;
        let is_north_west = ground_is_north_west(place);
        let is_inside = all(place >= vec2(0.0)) && all(place <= vec2(1.0)) && is_north_west == hit.is_north_west;
        own_t = select(own_t, exact, is_inside && steep < 0.0 && exact > 0.0);
    }
    distance[number_of(pixel)] = select(own_t * length(own_m), NO_SURFACE, t >= FAR);
    let low = relative_cells(terrain, vec2(0));
    let high = relative_cells(terrain, vec2<i32>(terrain.size) - 1);
    return select(all(own * own_t >= low) && all(own * own_t <= high), serves_sky(shared_m, own_m), t >= FAR);
}

/// The pixels over the bound of a block that is one pixel wide: by one ray in their middle if it serves them all, otherwise each by
/// its own. (One loop for both: software adapters go through what they skip.)
fn cast_block(block: vec2<u32>) {
    var first = ROWS;
    var last = 0u;
    for (var row = 0u; row < ROWS; row++) {
        if is_over(block + vec2(0u, row)) {
            first = min(first, row);
            last = row;
        }
    }
    if first > last {
        return;
    }
    let middle_m = view_ray(params.camera, vec2<f32>(block) + 0.5 + vec2(0.0, 0.5 * f32(first + last)));
    var each = UNDERSIDE || !FROM_MESH || first == last;
    for (var row = first; row <= last; row++) {
        let pixel = block + vec2(0u, row);
        each |= is_over(pixel) && !serves(middle_m, view_ray_of_pixel(params.camera, pixel));
    }
    var is_untouched = true;
    var row = first;
    while row <= last {
        let own = block + vec2(0u, row);
        if each && !is_over(own) {
            row += 1u;
            continue;
        }
        let direction_m = select(middle_m, view_ray_of_pixel(params.camera, own), vec3(each));
        // as far as each of the pixels served has a way without a hit over the same ground
        var clear = FAR;
        for (var other = select(first, row, each); other <= select(last, row, each); other++) {
            let pixel = block + vec2(0u, other);
            let own_m = view_ray_of_pixel(params.camera, pixel);
            let share = select(beside(own_m, direction_m), 1.0, each);
            clear = min(clear, select(FAR, clear_of(pixel, own_m, is_untouched) * share, is_over(pixel)));
        }
        let t = hit_after(direction_m, clear);
        if each {
            distance[number_of(own)] = select(t * length(direction_m), NO_SURFACE, t >= FAR);
            row += 1u;
            continue;
        }
        let hit = triangle_at(middle_m * select(t, 0.0, t >= FAR));
        for (var other = first; other <= last; other++) {
            let pixel = block + vec2(0u, other);
            each |= is_over(pixel) && !show(pixel, middle_m, t, hit);
        }
        if !each {
            break;
        }
        is_untouched = false;
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let at = id.y * groups.x * 64u + id.x;
    let every = params.camera.viewport.x * params.camera.viewport.y;
    if at >= min(pixels_count[3], params.length) {
        return;
    }
    // anybody can make a list
    let index = pixels[at];
    if index >= every {
        return;
    }
    let pixel = place_of(index, params.camera.viewport.x);
    if ROWS == 1u {
        cast_pixel(pixel);
    } else {
        cast_block(pixel);
    }
}
