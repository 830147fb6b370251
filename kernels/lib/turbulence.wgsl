//!include lib/waves.wgsl
// Turbulence that moves the places whose colour is looked up, so that borders between kinds of ground are washed out (Dachsbacher, Stamminger
// 2004, section 4.2). Its other half is `src/stages/picture/shade/turbulence.rs`.

const TURBULENCE_SEEDS: vec2<u32> = vec2(0x51ed270bu, 0x2545f491u);

/// How far a place is moved to the east and to the south, as a part of the most: octaves below a split, the one it is in by its fraction, each
/// with half of the one before. `period_cells` is a power of two, or 0 for turbulence that never repeats.
fn turbulence(place: OctavePlace, split: f32, finest: u32, period_cells: u32) -> vec2<f32> {
    var sum = vec2(0.0);
    var share = 0.5;
    for (var k = 1u; k <= finest && f32(k) < split; k++) {
        let nodes = select(EVERYWHERE, ((period_cells << k) >> 2u) - 1u, period_cells > 0u);
        let east = octave_waves(place, k, TURBULENCE_SEEDS.x, nodes).x;
        let south = octave_waves(place, k, TURBULENCE_SEEDS.y, nodes).x;
        sum += min(split - f32(k), 1.0) * share * vec2(east, south);
        share *= 0.5;
    }
    return sum;
}

/// The texture: texels along its side at its finest level, its levels, and the cells that it covers.
const TURBULENCE_TEXELS: u32 = 512u;
const TURBULENCE_LEVELS: u32 = 4u;
const TURBULENCE_PERIOD: u32 = 16u;

/// Where a level begins.
fn turbulence_start(level: u32) -> u32 {
    let all = TURBULENCE_TEXELS * TURBULENCE_TEXELS;
    return (all - (all >> (2u * level))) / 3u * 4u;
}
