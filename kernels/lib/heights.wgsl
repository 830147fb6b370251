//!include lib/means.wgsl
//!include ground/octaves.wgsl
// Heights of vertices: from the mean pyramid, and the octaves that a mesh can hold there.
//
// A kernel that includes this has in its parameters, beside those of `lib/means.wgsl`, `octaves: Octaves` and `bias`, how many octaves less
// a mesh has than its vertices could hold.

/// Up to which octave vertices hold the surface whose farthest neighbour is `extent` cells away (Dachsbacher, Stamminger 2004, Eq. 1, with
/// d0 a cell). One more than there are to be seen is all of them.
fn split_octave(extent: f32) -> f32 {
    return clamp(-log2(max(extent, 1e-12)) - params.bias, 0.0, f32(params.octaves.for_meshes + 1u));
}

/// Height and level of a vertex with the octaves that it can hold: octave k counts by how much the split octave is beyond k, up to all of it. Where
/// there are some, the level is less than 0: it is the split octave with a minus.
fn with_octaves(found: vec2<f32>, cells: vec2<f32>, extent: f32) -> vec2<f32> {
    if !OCTAVES {
        return found;
    }
    let split = split_octave(extent);
    let origin = vec2<f32>(params.terrain.eye_cell) + params.terrain.eye_fraction;
    let place = octave_place(clamp(cells, -origin, vec2<f32>(params.terrain.size - 1u) - origin));
    var height_m = found.x;
    var amplitude_m = params.octaves.amplitude_m;
    for (var k = 1u; f32(k) < split; k++) {
        height_m += min(split - f32(k), 1.0) * amplitude_m * octave_noise(place, k).x;
        amplitude_m *= params.octaves.persistence;
    }
    return vec2(height_m, select(found.y, -split, split > 0.0));
}
