//!include lib/look.wgsl
// A rectangle of a buffer as a picture: each element has a colour by its value, nearest, and what is no number shouts.

struct Params {
    format: Format,
    /// The same of the buffer that is taken away.
    minus: Format,
    scale: Scale,
    /// Columns and rows of the picture, and pixels from one row of it to the next.
    size: vec2<u32>,
    pitch: u32,
    /// The first of the pixels that elements may be seen in.
    corner: vec2<u32>,
    /// Elements before the first row, and from one row to the next.
    first: u32,
    stride: u32,
    minus_first: u32,
    minus_stride: u32,
    /// Columns and rows of elements.
    extent: vec2<u32>,
    /// Where the picture's corner is in elements, and elements a pixel.
    origin: vec2<f32>,
    step: vec2<f32>,
    /// Larger values are marked.
    mark_above: f32,
    is_marked: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> data: array<u32>;
@group(0) @binding(2) var<storage, read> other: array<u32>;
/// 256 colours from lowest to highest.
@group(0) @binding(3) var<storage, read> colours: array<u32>;
@group(0) @binding(4) var<storage, read_write> painted: array<u32>;

const OPAQUE: u32 = 0xff000000u;
const SAYS_MISSING: u32 = 0xff3a3430u;
const MARK: u32 = 0xff2060ffu;

fn loud(kind: u32, at: vec2<u32>) -> u32 {
    let is_odd = ((at.x / 4u + at.y / 4u) & 1u) == 1u;
    switch kind {
        case NOT_A_NUMBER: {
            return select(0xffff00ffu, 0xff800080u, is_odd);
        }
        case INFINITE: {
            return select(0xff00ffffu, 0xff0000ffu, is_odd);
        }
        default: {
            return select(0xffffff00u, 0xffff0000u, is_odd);
        }
    }
}

fn colour_of(element: vec2<u32>, at: vec2<u32>) -> u32 {
    let index = params.first + element.y * params.stride + element.x;
    let word = data[index * params.format.words + params.format.word];
    if KIND == COLOUR && !IS_DIFFERENCE {
        return word | OPAQUE;
    }
    var shown = shown_of(word, params.format, KIND);
    if IS_DIFFERENCE {
        let other_index = params.minus_first + element.y * params.minus_stride + element.x;
        let other_word = other[other_index * params.minus.words + params.minus.word];
        if KIND == COLOUR {
            shown = Shown(colour_difference(word, other_word), NUMBER);
        } else {
            shown = difference(shown, shown_of(other_word, params.minus, MINUS_KIND));
        }
    }
    if shown.kind == MISSING {
        return SAYS_MISSING;
    }
    if shown.kind != NUMBER {
        return loud(shown.kind, at);
    }
    if params.is_marked != 0u && shown.value > params.mark_above {
        return MARK;
    }
    return colours[u32(share_of(shown.value, params.scale) * 255.0 + 0.5)];
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = params.corner + id.xy;
    if any(at >= params.size) {
        return;
    }
    let place = floor(params.origin + (vec2<f32>(at) + 0.5) * params.step);
    if all(place >= vec2(0.0)) && all(place < vec2<f32>(params.extent)) {
        painted[at.y * params.pitch + at.x] = colour_of(vec2<u32>(place), at);
    }
}
