//!include lib/camera.wgsl
//!include lib/terrain.wgsl
//!include lib/traverse.wgsl
//!include lib/beside.wgsl
// What a list of triangles has drawn to distances, and rays for the pixels that it says nothing of.

struct Params {
    camera: Camera,
    terrain: Terrain,
    octaves: Octaves,
    foreground: Foreground,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var drawn: texture_2d<u32>;
@group(0) @binding(2) var<storage, read_write> distance: array<f32>;

/// The mesh has a proven bound.
override PROVEN: bool = false;

/// Whether a ray meets a triangle at its rim is not known (on a cliff, a hair's breadth aside is another place), nor on which side of a
/// triangle next to it an eye is that stands on the surface: there, a mesh with a bound shows the surface itself.
@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.camera.viewport) {
        return;
    }
    let bits = textureLoad(drawn, id.xy, 0).x;
    var seen = select(bitcast<f32>(bits & ~BESIDE), NO_SURFACE, bits == 0u);
    if PROVEN {
        // a loop and no condition: software adapters go through both sides of those
        let ray = view_ray_of_pixel(params.camera, id.xy);
        var casts = (bits & BESIDE) != 0u || may_meet_foreground(ray);
        while casts {
            let t = first_hit(ray, 0.0);
            seen = select(t * length(ray), NO_SURFACE, t >= FAR);
            casts = false;
        }
    }
    distance[id.y * params.camera.viewport.x + id.x] = seen;
}
