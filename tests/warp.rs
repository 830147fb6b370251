//! The warp's promises on importance that nothing good can be made of: exact ends, never backwards, no fold; and what
//! compensated sums are for.

mod common;

use std::sync::Arc;

use common::Ran;
use lodlab::gpu::Gpu;

const SCENE: &str = "terrain: Shape(kind: Flat, size: (9, 9)), camera: Still(eye: (100, 10, 50)), viewport: (8, 8)";

/// The warp of a map of `columns` x `rows` cells with one of the stiff patterns.
fn warp(gpu: &Arc<Gpu>, kind: u32, (columns, rows): (u32, u32), parameters: &str) -> Ran {
    let source = format!(
        "Kernel(file: \"pattern.wgsl\", entry: \"weights\", bind: {{\"importance\": New(name: \"importance\", of: F32, size: ({columns}, {rows}))}}, \
         params: (kind: {kind}), over: ({}, 1))",
        columns * rows
    );
    Ran::chain(gpu, SCENE, &format!("[{source}, ViewGrid(size: (33, 17)), Warp({parameters})]"))
}

const PATTERNS: std::ops::Range<u32> = 0..9;
/// The pattern whose rows differ, in the middle of 64 x 48.
const FOLDING: u32 = 8;
/// (Eight threads of a software adapter go together, and what ends their loops counts the longest way of any at every turn.)
const SIZES: [(u32, u32); 8] = [(1, 1), (2, 1), (1, 3), (3, 2), (64, 48), (97, 31), (4095, 2), (8192, 8)];

fn is_warp(line: &[f32]) -> bool {
    let ends = line[0].to_bits() == 0.0f32.to_bits() && line[line.len() - 1].to_bits() == 1.0f32.to_bits();
    ends && line.windows(2).all(|pair| pair[0] <= pair[1])
}

#[test]
fn ends_are_exact_and_nothing_runs_backwards() {
    let gpu = Gpu::open(None).unwrap();
    for kind in PATTERNS {
        for size in SIZES {
            let ran = warp(&gpu, kind, size, "");
            let (rows, columns) = (ran.read::<f32>("warp_rows"), ran.read::<f32>("warp_columns"));
            let what = format!("pattern {kind}, {size:?}");
            assert!(rows.chunks_exact(size.0 as usize + 1).all(is_warp), "{what}");
            assert!(columns.chunks_exact(size.1 as usize + 1).all(is_warp), "{what}");
        }
    }
}

#[test]
fn no_cell_of_the_grid_folds() {
    let gpu = Gpu::open(None).unwrap();
    for kind in PATTERNS {
        for (size, parameters) in [
            ((3, 2), ""),
            ((16, 16), ""),
            ((64, 48), ""),
            ((64, 48), "rounds: 3"),
            ((31, 33), "rounds: 8"),
            ((97, 31), "uniform_share: 0.2"),
            ((64, 48), "lead: 0"),
            ((64, 48), "rounds: 3, lead: 0"),
            ((31, 33), "rounds: 8, lead: 0.01"),
        ] {
            let ran = warp(&gpu, kind, size, parameters);
            let points = ran.read::<[f32; 2]>("grid_point");
            let at = |x: usize, y: usize| points[y * 33 + x].map(f64::from);
            let turn =
                |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            let what = format!("pattern {kind}, {size:?} {parameters}");
            for y in 0..17 {
                assert_eq!((at(0, y)[0], at(32, y)[0]), (0.0, 1.0), "{what}: the sides");
            }
            for x in 0..33 {
                assert_eq!((at(x, 0)[1], at(x, 16)[1]), (0.0, 1.0), "{what}: top and bottom");
            }
            for y in 0..16 {
                for x in 0..32 {
                    let (nw, ne, sw, se) = (at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1));
                    assert!(turn(nw, ne, sw) >= 0.0 && turn(se, sw, ne) >= 0.0, "{what}: cell {x}, {y}");
                }
            }
        }
    }
}

/// Largest distance between a row's warp and its inverse running sum in f64.
fn largest_off(ran: &Ran, columns: usize) -> f64 {
    let row = &ran.read::<f32>("warp_rows")[..=columns];
    let weights: Vec<f64> = ran.read::<f32>("importance").into_iter().map(f64::from).collect();
    let total: f64 = weights.iter().sum();
    let (mut k, mut before) = (0, 0.0);
    let mut exact = |i: usize| {
        let wanted = total * i as f64 / columns as f64;
        while k + 1 < columns && before + weights[k] < wanted {
            before += weights[k];
            k += 1;
        }
        (k as f64 + (wanted - before) / weights[k]) / columns as f64
    };
    row.iter().enumerate().map(|(i, &place)| (f64::from(place) - exact(i)).abs()).fold(0.0, f64::max)
}

/// 8192 weights whose plain sum is rounded the same way over and over.
#[test]
fn plain_sums_fail_where_compensated_ones_hold() {
    const COLUMNS: u32 = 8192;
    let gpu = Gpu::open(None).unwrap();
    // the total, each share of it and each sum are rounded a few times, relative to a total of 0.7 a cell, of which one cell
    // is all there is between two places; and the place itself is
    let tolerance = 8.0 * f64::from(f32::EPSILON);
    let compensated = largest_off(&warp(&gpu, 6, (COLUMNS, 1), "lead: 0"), COLUMNS as usize);
    let plain = largest_off(&warp(&gpu, 6, (COLUMNS, 1), "sums: Plain, lead: 0"), COLUMNS as usize);
    println!("compensated {compensated:e}, plain {plain:e}, tolerance {tolerance:e}");
    assert!(compensated <= tolerance, "{compensated:e}");
    assert!(plain > 10.0 * tolerance, "plain sums are off by {plain:e} only");
}

/// Every round applied the same importance once more, and the mean error went from 0.9 to 32 px in eight rounds.
#[test]
fn more_rounds_are_never_worse() {
    let scene = "terrain: Noise(kind: Ridged, seed: 4, size: (257, 257), cell_m: 30, height_m: (0, 900), wavelength_m: 2500), \
                 camera: Still(eye: (1000, 300, 1100), look_at: (5000, 6000, 200)), viewport: (160, 120)";
    let rms_px = |rounds: u32| {
        let chain = format!(
            "[HeightPyramid, ViewGrid(size: (40, 30)), AspectImportance, Warp(rounds: {rounds}), Project, Rasterize]"
        );
        let text =
            format!("Experiment(scene: ({scene}), chains: {{\"warped\": {chain}}}, measure: [ScreenError, Mesh])");
        let folder = tempfile::tempdir().unwrap();
        let record = &common::records_of(folder.path(), &text, &[])[0];
        assert_eq!(common::measure(record, "folded"), Some(0.0), "{rounds} rounds");
        common::measure(record, "error_rms").unwrap()
    };
    let once = rms_px(1);
    for rounds in [2, 4, 8] {
        let error_px = rms_px(rounds);
        assert!(error_px < 1.01 * once, "{rounds} rounds: {error_px} px, one: {once} px");
    }
}

/// Where a few cells would fold, they and what is next to them give way, and the warp of the others stays but for what the grid still needs.
#[test]
fn a_fold_is_undone_where_it_is() {
    let gpu = Gpu::open(None).unwrap();
    let (columns, rows) = (64, 48);
    let ran = warp(&gpu, FOLDING, (columns, rows), "lead: 0");
    let gave_way = ran.read::<u32>("warp_gave_way");
    let moved = gave_way.iter().filter(|times| **times > 0).count();
    assert!(moved > 0, "nothing would fold");
    assert!(moved < gave_way.len() / 4, "{moved} of {} corners gave way", gave_way.len());
    // a quarter, if the whole warp alone gave way
    let share = f32::from_bits(ran.read::<u32>("grid_work")[3]);
    assert!(share > 0.7, "{share} of the warp is left");
}
