// Numbers in the words of any buffer, for kernels that show them.

/// What a word holds. (A u32 of which some bits are a number is cut out of them.)
const FLOAT: u32 = 0u;
const UNSIGNED: u32 = 1u;
const SIGNED: u32 = 2u;
const HALF: u32 = 3u;
/// Red, green, blue and alpha, the lowest byte first.
const COLOUR: u32 = 4u;

/// What the words are that are shown, and of those that are taken away; and how values are spread over colours. What is the same for all
/// elements is no branch of each.
override KIND: u32 = 0u;
override MINUS_KIND: u32 = 0u;
override SCALE: u32 = 0u;
override IS_DIFFERENCE: bool = false;

/// Where the number of an element is: words an element, the word, and the bits in it.
struct Format {
    @align(16) words: u32,
    word: u32,
    shift: u32,
    mask: u32,
    /// A negative number means that nothing is there.
    is_missing_below_zero: u32,
}

/// What a number is. A NaN is found by its bits, since compilers may take `x != x` for false.
const NUMBER: u32 = 0u;
const MISSING: u32 = 1u;
const NOT_A_NUMBER: u32 = 2u;
const INFINITE: u32 = 3u;
const MINUS_INFINITE: u32 = 4u;

struct Shown {
    value: f32,
    kind: u32,
}

fn kind_of_bits(bits: u32) -> u32 {
    let size = bits & 0x7fffffffu;
    if size > 0x7f800000u {
        return NOT_A_NUMBER;
    }
    if size == 0x7f800000u {
        return select(INFINITE, MINUS_INFINITE, (bits >> 31u) == 1u);
    }
    return NUMBER;
}

fn shown_of(word: u32, format: Format, kind: u32) -> Shown {
    switch kind {
        case FLOAT: {
            let value = bitcast<f32>(word);
            let found = kind_of_bits(word);
            let is_missing = format.is_missing_below_zero != 0u && found != NOT_A_NUMBER && (word >> 31u) == 1u;
            return Shown(value, select(found, MISSING, is_missing));
        }
        case SIGNED: {
            return Shown(f32(bitcast<i32>(word)), NUMBER);
        }
        case HALF: {
            let both = unpack2x16float(word);
            let value = select(both.x, both.y, format.shift != 0u);
            let half = (word >> format.shift) & 0x7fffu;
            let special = select(INFINITE, NOT_A_NUMBER, half > 0x7c00u);
            return Shown(value, select(NUMBER, special, half >= 0x7c00u));
        }
        case COLOUR: {
            return Shown(f32(word & 0xffu), NUMBER);
        }
        default: {
            return Shown(f32((word >> format.shift) & format.mask), NUMBER);
        }
    }
}

/// The most that a channel of two colours differs by.
fn colour_difference(a: u32, b: u32) -> f32 {
    var most = 0.0;
    for (var shift = 0u; shift < 24u; shift += 8u) {
        most = max(most, abs(f32((a >> shift) & 0xffu) - f32((b >> shift) & 0xffu)));
    }
    return most;
}

/// One minus the other; where only one is there, what is left is no number.
fn difference(a: Shown, b: Shown) -> Shown {
    if a.kind == MISSING && b.kind == MISSING {
        return a;
    }
    if a.kind != NUMBER || b.kind != NUMBER {
        return Shown(0.0, NOT_A_NUMBER);
    }
    return Shown(a.value - b.value, NUMBER);
}

/// How values are spread over colours.
struct Scale {
    @align(16) low: f32,
    high: f32,
    /// Closer to zero than this, a symmetric logarithm is as good as linear.
    linear_below: f32,
    /// The lowest value as it is scaled, and the share of the range that one more is.
    low_scaled: f32,
    per_unit: f32,
}

const LINEAR: u32 = 0u;
const LOGARITHM: u32 = 1u;
const SYMMETRIC: u32 = 2u;

fn scaled(value: f32, scale: Scale) -> f32 {
    switch SCALE {
        case LOGARITHM: {
            return log2(max(value, 1e-38));
        }
        case SYMMETRIC: {
            return sign(value) * log2(1.0 + abs(value) / scale.linear_below);
        }
        default: {
            return value;
        }
    }
}

/// 0 at the lowest value of a range and 1 at the highest.
fn share_of(value: f32, scale: Scale) -> f32 {
    if scale.per_unit == 0.0 {
        return 0.5;
    }
    return clamp((scaled(value, scale) - scale.low_scaled) * scale.per_unit, 0.0, 1.0);
}
