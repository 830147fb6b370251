//! What rounding can do to a value: one number for arithmetic, two for rasterizers.

/// Largest relative rounding error of one f32 operation.
pub const EPSILON: f64 = f32::EPSILON as f64 / 2.0;

/// How far a rasterizer may see a corner from where it is, in pixels, for an argument about one picture: it works on corners rounded
/// to 1/256 of a pixel or finer (D3D 11 asks for 8 bits, every desktop and software adapter has them). This is half the
/// diagonal of that, and what transforming a corner in f32 adds.
pub const PROOF_SNAP_PX: f32 = 0.005;

/// The same for any adapter there may be, which decides where a reference says nothing: Vulkan's smallest `subPixelPrecisionBits` is
/// 4, so corners are rounded to 1/16 of a pixel.
pub const ANY_ADAPTER_SNAP_PX: f64 = 0.7072 / 16.0;

/// Relative error of `pow(x, exponent)` in f32 for an x from 1 / `range` to `range`: WGSL has it of exp2 and log2, to which Vulkan allows 3 + 2 |x|
/// units in the last place, and 3 units or 2^-21.
pub fn power(range: f64, exponent: f64) -> f64 {
    let largest = range.log2();
    let logarithm = exponent * (5e-7 + 6.0 * EPSILON * largest) + 2.0 * EPSILON * exponent * largest;
    std::f64::consts::LN_2 * logarithm + (6.0 + 4.0 * exponent * largest) * EPSILON
}
