//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/traverse.wgsl
// Exact first hit of each pixel's ray with the full-resolution surface.
//
// `coarse` walks the bundle of rays of a tile of pixels as far as nothing in it can hit anything; `main` starts
// each ray there. A ray's parameter t is its distance along the view direction, so a tile's rays share it.

struct Params {
    camera: Camera,
    terrain: Terrain,
    octaves: Octaves,
    foreground: Foreground,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> distance: array<f32>;
/// For each tile of pixels, a t that all its rays reach without a hit; FAR if none of them hits anything.
@group(0) @binding(2) var<storage, read_write> clear_until: array<f32>;
@group(0) @binding(3) var<storage, read> start: array<f32>;

/// Pixels a side of a tile.
const TILE: u32 = 8u;
/// Tries of a bundle before it is content with where it is.
const MOST_TRIES: u32 = 96u;

/// Largest height under the cells from `low` to `high`, from at most four nodes.
fn highest(low: vec2<i32>, high: vec2<i32>) -> f32 {
    let extent = u32(max(high.x - low.x, high.y - low.y));
    let level = clamp(firstLeadingBit(extent | 1u) + 1u, 1u, GROUND_CELLS_TOP);
    let a = low >> vec2(level);
    let b = high >> vec2(level);
    return max(max(bound(level, a, 1.0), bound(level, b, 1.0)),
               max(bound(level, vec2(a.x, b.y), 1.0), bound(level, vec2(b.x, a.y), 1.0)));
}

@compute @workgroup_size(8, 8)
fn coarse(@builtin(global_invocation_id) id: vec3<u32>) {
    let tiles = (params.camera.viewport + TILE - 1u) / TILE;
    if any(id.xy >= tiles) {
        return;
    }
    let terrain = params.terrain;
    // the box of the corner rays' directions holds the directions of all rays between them
    let first = id.xy * TILE;
    let last_pixel = min(first + TILE, params.camera.viewport) - 1u;
    let a = view_ray_of_pixel(params.camera, first);
    let b = view_ray_of_pixel(params.camera, last_pixel);
    let c = view_ray_of_pixel(params.camera, vec2(first.x, last_pixel.y));
    let d = view_ray_of_pixel(params.camera, vec2(last_pixel.x, first.y));
    let box_low = min(min(a, b), min(c, d));
    let box_high = max(max(a, b), max(c, d));
    let scale = vec2(1.0, -1.0) / terrain.cell_m;
    let low = min(box_low.xy * scale, box_high.xy * scale);
    let high = max(box_low.xy * scale, box_high.xy * scale);

    let last = vec2<i32>(terrain.size) - 1;
    let border_low = relative_cells(terrain, vec2(0));
    let border_high = relative_cells(terrain, last);
    let summit = relative_height(terrain, bound(GROUND_CELLS_TOP, vec2(0), 1.0));
    let speed = max(max(length(low), length(high)), 1e-6);
    let width = max(high.x - low.x, high.y - low.y);
    var t = 0.0;
    var step = 16.0 / speed;
    var tries = 0u;
    loop {
        // far beyond the border, or above everything and rising: no ray of the bundle comes back
        let gone = ((low > vec2(0.0)) & (low * t > border_high)) | ((high < vec2(0.0)) & (high * t < border_low));
        if any(gone) || (box_low.z > 0.0 && box_low.z * t > summit) {
            t = FAR;
            break;
        }
        if tries == MOST_TRIES {
            break;
        }
        tries += 1u;
        let next = t + step;
        // a hundredth of a cell is more than rounding on the largest terrain
        let from_cell = min(low * t, low * next) + terrain.eye_fraction - 0.01;
        let to_cell = max(high * t, high * next) + terrain.eye_fraction + 0.01;
        // far outside, integers would overflow; the border is as good
        let reach = vec2<f32>(last + abs(terrain.eye_cell) + 2);
        let from_index = vec2<i32>(floor(clamp(from_cell, -reach, reach))) + terrain.eye_cell;
        let to_index = vec2<i32>(floor(clamp(to_cell, -reach, reach))) + terrain.eye_cell;
        let outside = any(to_index < vec2(0)) || any(from_index >= last);
        let m = highest(clamp(from_index, vec2(0), last - 1), clamp(to_index, vec2(0), last - 1));
        let lowest = box_low.z * select(next, t, box_low.z > 0.0);
        if outside || lowest > relative_height(terrain, m) {
            t = next;
            step *= 2.0;
        } else {
            step *= 0.5;
            // shorter than the bundle is wide, or than two cells, a step finds out little
            if step * speed < max(2.0, width * t) {
                break;
            }
        }
    }
    clear_until[id.y * tiles.x + id.x] = t;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.camera.viewport) {
        return;
    }
    var clear = 0.0;
    if !UNDERSIDE {
        let tiles = (params.camera.viewport.x + TILE - 1u) / TILE;
        clear = start[(id.y / TILE) * tiles + id.x / TILE];
    }
    let direction_m = view_ray_of_pixel(params.camera, id.xy);
    var t = FAR;
    if clear < FAR {
        t = first_hit(direction_m, clear);
    }
    let index = id.y * params.camera.viewport.x + id.x;
    distance[index] = select(t * length(direction_m), NO_SURFACE, t >= FAR);
}
