//! The hunt repeats itself, finds nothing among a few frames of everything, and sees a promise that is broken.

mod common;

use lodlab::gpu::Gpu;
use lodlab::hunt::{self, Found, Hunt, Summary};

fn hunted(stage: Option<&str>, seed: u64, frames: usize) -> (Summary, Vec<Found>) {
    let gpu = Gpu::open(None).unwrap();
    let hunt = Hunt { seed, frames, stage: stage.map(String::from), tries: 150, ..Hunt::default() };
    let mut all = Vec::new();
    let summary = hunt::hunt(&gpu, &hunt, &mut |found| all.push(found), &|_| ()).unwrap();
    (summary, all)
}

#[test]
fn a_short_hunt_finds_nothing_and_repeats() {
    for (stage, seed) in [(None, 11), (Some("RayFill"), 11), (Some("TriangleSplitting"), 7)] {
        let (summary, found) = hunted(stage, seed, 64);
        assert!(found.is_empty(), "{stage:?}: {found:#?}");
        assert!(summary.frames >= 64 && summary.promised > 0, "{stage:?}: {summary:?}");
        if stage.is_some() {
            assert_eq!(hunted(stage, seed, 64).0, summary);
        }
    }
}

#[test]
fn a_stage_that_no_example_has_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = common::run(folder.path(), &["hunt", "--stage", "Nothing"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(common::errors(&output).contains("no example has the stage `Nothing`"));
}
