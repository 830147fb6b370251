// A canvas in a window: each pixel of the window has that of the canvas, and what nothing was painted on stays dark.

@group(0) @binding(0) var canvas: texture_2d<f32>;

/// The window mixes colours as they are on a screen, and this one wants them in proportion to light.
override IN_LIGHT: bool = false;

const UNPAINTED: vec3<f32> = vec3(20.0 / 255.0);

struct Corner {
    @builtin(position) position: vec4<f32>,
    /// From the top left of the rectangle that the canvas fills to the bottom right.
    @location(0) at: vec2<f32>,
}

/// A triangle that covers the rectangle.
@vertex
fn cover(@builtin(vertex_index) index: u32) -> Corner {
    let at = vec2(f32(index & 1u), f32(index >> 1u)) * 2.0;
    return Corner(vec4(at.x * 2.0 - 1.0, 1.0 - at.y * 2.0, 0.0, 1.0), at);
}

fn in_light(colour: vec3<f32>) -> vec3<f32> {
    let dark = colour / 12.92;
    return select(pow((colour + 0.055) / 1.055, vec3(2.4)), dark, colour <= vec3(0.04045));
}

@fragment
fn show(corner: Corner) -> @location(0) vec4<f32> {
    let size = vec2<f32>(textureDimensions(canvas));
    let texel = vec2<i32>(clamp(corner.at * size, vec2(0.0), size - 1.0));
    let painted = textureLoad(canvas, texel, 0);
    let colour = painted.rgb + (1.0 - painted.a) * UNPAINTED;
    if IN_LIGHT {
        return vec4(in_light(colour), 1.0);
    }
    return vec4(colour, 1.0);
}
