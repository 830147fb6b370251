//! Every experiment that ships runs, small: no cracks, no broken proofs, exact rays. Those that want data that is not here are ignored.

mod common;

use std::path::{Path, PathBuf};

use common::{measure, records, run, succeeded};
use libtest_mimic::{Arguments, Failed, Trial};

fn main() {
    let folder = Path::new(common::ROOT).join("experiments");
    let folders = [folder.clone(), folder.join("stability"), folder.join("papers")];
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).into_iter().flatten().flatten());
    let mut files: Vec<PathBuf> = files.map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|kind| kind == "ron"));
    files.sort();
    assert!(files.len() >= 15, "{files:?}");
    let trial = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let is_absent = text.contains("shared/dem") && !common::shared_dem().is_dir();
        let name = path.strip_prefix(&folder).unwrap_or(&path).display().to_string();
        Trial::test(name, move || runs(&path, &text)).with_ignored_flag(is_absent)
    };
    let trials = files.into_iter().map(trial).collect();
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn runs(path: &Path, text: &str) -> Result<(), Failed> {
    let out = tempfile::tempdir()?;
    let target = out.path().join("out");
    let arguments = ["run", &path.display().to_string(), "--out", &target.display().to_string()];
    let mut settings = vec!["--set", "scene.viewport=(120, 90)", "--frames", "2"];
    // the papers' meshes are as large as the papers say
    let is_of_paper = path.parent().is_some_and(|folder| folder.ends_with("papers"));
    let smaller = ["*.ViewGrid.size=(48, 36)", "*.VertexSplitting.threshold_px=4"];
    for setting in smaller.into_iter().filter(|setting| is_of_paper && text.contains(&setting[2..10])) {
        settings.extend(["--set", setting]);
    }
    succeeded(&run(out.path(), &[&arguments[..], &settings].concat()));
    for record in records(&target) {
        if record["chain"].as_str().is_some_and(|chain| chain.to_lowercase().contains("proven")) {
            assert_eq!(measure(&record, "bound_violations"), Some(0.0), "{record}");
        }
        assert!(measure(&record, "cracks").is_none_or(|cracks| cracks == 0.0), "{record}");
        if record["chain"] == "ray cast" {
            let worst = measure(&record, "error_max").ok_or("rays are measured")?;
            assert!(worst < 0.02, "{worst} px from the surface it is cast on");
            assert_eq!(measure(&record, "silhouette_misses"), Some(0.0));
        }
    }
    assert!(target.join("report.html").is_file());
    Ok(())
}
