// The ground on which the bounds of a cell of a raised grid hold.

/// Around the cell, as a share of the longer side of its box on the ground.
const EDGE: f32 = 0.015625;
/// Behind it as seen from the eye, as a share of how far the cell itself reaches from the eye.
const BEHIND: f32 = 0.25;

/// By how many times its distance from the eye a place may be farther, for a cell or triangle with these distances.
fn reach_behind(nearest: f32, farthest: f32) -> f32 {
    return BEHIND * (1.0 - nearest / max(farthest, 1e-30));
}
