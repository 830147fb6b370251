//! Prefix sums and stream compaction: exact, at sizes around a tile and far above.

mod common;

use common::Ran;
use lodlab::gpu::Gpu;

const SCENE: &str = "terrain: Shape(kind: Flat, size: (9, 9)), camera: Still(eye: (100, 10, 50)), viewport: (8, 8)";
/// Elements that a workgroup of the kernels takes.
const TILE: u32 = 2048;

/// Columns and rows of a buffer of that many elements: a side of a dispatch is limited.
fn sides(length: u32) -> (u32, u32) {
    if length <= 1 << 20 { (length, 1) } else { (1 << 12, length >> 12) }
}

fn source(kind: u32, length: u32) -> String {
    format!(
        "Kernel(file: \"pattern.wgsl\", entry: \"numbers\", bind: {{\"counts\": New(name: \"counts\", of: U32, size: {:?})}}, \
         params: (kind: {kind}), over: ({}, 1))",
        sides(length),
        length.min(4_000_000)
    )
}

#[test]
fn prefix_sums_are_exact() {
    let gpu = Gpu::open(None).unwrap();
    for length in [1, 2, 3, 63, 65, TILE - 1, TILE, TILE + 1, 5 * TILE + 7, 1_000_003] {
        for kind in 0..4 {
            let ran = Ran::chain(&gpu, SCENE, &format!("[{}, Scan(of: \"counts\")]", source(kind, length)));
            let (counts, sums) = (ran.read::<u32>("counts"), ran.read::<u32>("sums"));
            let mut sum = 0u32;
            for (at, count) in counts.iter().enumerate() {
                assert_eq!(sums[at], sum, "pattern {kind}, element {at} of {length}");
                sum = sum.wrapping_add(*count);
            }
            assert_eq!(ran.read::<u32>("sums_total"), [sum], "pattern {kind}, {length} elements");
        }
    }
}

#[test]
fn a_compacted_list_is_exact() {
    let gpu = Gpu::open(None).unwrap();
    for length in [1, 2, 3, 63, 65, TILE - 1, TILE, TILE + 1, 5 * TILE + 7, 1_000_003] {
        for (kind, above) in [(0, 0u32), (1, 0), (1, 1), (2, 0), (3, 1 << 31)] {
            let compact = format!("Compact(of: \"counts\", above: {above}, to: \"list\")");
            let ran = Ran::chain(&gpu, SCENE, &format!("[{}, {compact}]", source(kind, length)));
            let counts = ran.read::<u32>("counts");
            let expected: Vec<u32> = (0..length).filter(|&at| counts[at as usize] > above).collect();
            let count = ran.read::<u32>("list_count");
            assert_eq!(count[3] as usize, expected.len(), "pattern {kind}, {length} elements");
            assert_eq!(ran.read::<u32>("list")[..expected.len()], expected, "pattern {kind}, {length} elements");
            let groups = count[0] * count[1] * count[2];
            assert!(groups * 64 >= count[3] && (count[3] > 0 || groups == 0), "{count:?}");
        }
    }
}

#[test]
fn rows_make_one_element() {
    let gpu = Gpu::open(None).unwrap();
    for (width, tall) in [(1, 1), (1, 7), (3, 5), (4, 2), (8, 8), (37, 13), (64, 33), (1000, 67)] {
        for (kind, above) in [(0, 0u32), (1, 0), (2, 0), (3, 1 << 31)] {
            for rows in [2, 3, 16] {
                let source = format!(
                    "Kernel(file: \"pattern.wgsl\", entry: \"numbers\", bind: {{\"counts\": New(name: \"counts\", of: U32, \
                     size: ({width}, {tall}))}}, params: (kind: {kind}), over: ({}, 1))",
                    width * tall
                );
                let compact = format!("Compact(of: \"counts\", above: {above}, rows: {rows}, to: \"list\")");
                let ran = Ran::chain(&gpu, SCENE, &format!("[{source}, {compact}]"));
                let counts = ran.read::<u32>("counts");
                let is_above = |x: u32, row: u32| row < tall && counts[(row * width + x) as usize] > above;
                let expected: Vec<u32> = (0..tall)
                    .step_by(rows as usize)
                    .flat_map(|y| (0..width).map(move |x| (x, y)))
                    .filter(|&(x, y)| (y..y + rows).any(|row| is_above(x, row)))
                    .map(|(x, y)| y * width + x)
                    .collect();
                let what = format!("pattern {kind}, {width} x {tall}, {rows} rows");
                assert_eq!(ran.read::<u32>("list_count")[3] as usize, expected.len(), "{what}");
                assert_eq!(ran.read::<u32>("list")[..expected.len()], expected, "{what}");
            }
        }
    }
}
