//!include lib/terrain.wgsl
//!include ground/octaves.wgsl
// Octaves at places that stay where they are: counted from the first sample, and seen from the eye.

struct Params {
    terrain: Terrain,
    octaves: Octaves,
    /// Cells from the first sample to where places begin, and 2^-32 of a cell between two of them.
    first_cell: vec2<i32>,
    step: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> fixed: array<f32>;
@group(0) @binding(2) var<storage, read_write> seen: array<f32>;
@group(0) @binding(3) var<storage, read_write> beside: array<f32>;

fn all_octaves(place: OctavePlace) -> f32 {
    var sum = 0.0;
    var amplitude_m = params.octaves.amplitude_m;
    for (var k = 1u; k <= params.octaves.count; k++) {
        sum += amplitude_m * octave_noise(place, k).x;
        amplitude_m *= params.octaves.persistence;
    }
    return sum;
}

/// Places on a line that goes 7 columns east and 3 rows south for each row of places, so that cells come in all of their parts.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&fixed) {
        return;
    }
    let cell = params.first_cell + vec2(7, 3) * i32(id.x / 50u);
    let high = vec2(id.x * params.step, id.x * params.step * 3u);
    let terrain = params.terrain;
    let eye_cell = terrain.eye_cell - select(vec2(0), vec2(1), terrain.eye_fraction < vec2(0.0));
    let origin = params.octaves.eye_cell - eye_cell;
    fixed[id.x] = all_octaves(OctavePlace(cell + origin, high, vec2(0u)));
    let cells = relative_cells(terrain, cell) + vec2<f32>(high >> vec2(8u)) / 16777216.0;
    seen[id.x] = all_octaves(octave_place(cells));
    // next to the eye on all sides, from nothing to a millionth of a cell
    let way = exp2(-20.0 - 0.1 * f32(id.x)) * select(-1.0, 1.0, (id.x & 1u) == 1u);
    beside[id.x] = all_octaves(octave_place(select(vec2(0.0), vec2(way, -way), id.x > 0u)));
}
