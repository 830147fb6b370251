//! What ARCHITECTURE says of the tree is true.

mod common;

use std::path::{Path, PathBuf};

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().flatten().map(|entry| entry.path());
    let (folders, here): (Vec<PathBuf>, Vec<PathBuf>) = entries.partition(|path| path.is_dir());
    let below = folders.iter().flat_map(|folder| files(folder));
    below.chain(here.into_iter().filter(|path| path.extension().is_some_and(|kind| kind == "rs"))).collect()
}

/// The text of a file without comments and without its unit tests.
fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The modules in the order in which `lib.rs` lists them.
fn modules() -> Vec<String> {
    let lib = std::fs::read_to_string(Path::new(common::ROOT).join("src/lib.rs")).unwrap();
    lib.lines().filter_map(|line| Some(line.strip_prefix("pub mod ")?.strip_suffix(';')?.to_string())).collect()
}

fn module_of(path: &Path) -> String {
    let below = path.strip_prefix(Path::new(common::ROOT).join("src")).unwrap();
    below.components().next().unwrap().as_os_str().to_string_lossy().trim_end_matches(".rs").to_string()
}

#[test]
fn modules_import_only_what_stands_before_them() {
    let order = modules();
    assert!(order.len() > 8, "{order:?}");
    let place = |module: &str| order.iter().position(|known| known == module);
    for path in files(&Path::new(common::ROOT).join("src")) {
        let Some(own) = place(&module_of(&path)) else { continue };
        for (at, _) in code(&path).match_indices("crate::") {
            let after: String =
                code(&path)[at + 7..].chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect();
            let Some(imported) = place(&after) else { continue };
            assert!(imported <= own, "{} imports `{after}`, which comes after it", path.display());
        }
    }
}

/// The inspector's one file of those that may is where canvases meet the window.
#[test]
fn only_the_gpu_knows_wgpu() {
    for path in files(&Path::new(common::ROOT).join("src")) {
        let may = module_of(&path) == "gpu" || path.ends_with("inspector/screen.rs");
        assert!(!code(&path).contains("wgpu::") || may, "{}", path.display());
    }
}

/// Outside of the stages, what they hand on is asked for by type.
#[test]
fn no_code_outside_the_stages_asks_for_a_buffer_by_name() {
    let names: Vec<&str> = lodlab::stages::REGISTRY.iter().flat_map(|entry| entry.info.writes).copied().collect();
    assert!(names.contains(&"distance") && names.contains(&"vertex"));
    for path in files(&Path::new(common::ROOT).join("src")).iter().filter(|path| module_of(path) != "stages") {
        let text = code(path);
        for name in &names {
            for call in ["read", "read_as", "find", "get", "make"] {
                let asks = format!(".{call}(\"{name}\"");
                assert!(!text.contains(&asks), "{} has {asks}", path.display());
            }
        }
    }
}

/// A stage is a folder in a room with its plan and its reference, and its kernels have its name.
#[test]
fn a_stage_is_a_folder() {
    let source = Path::new(common::ROOT).join("src/stages");
    for entry in lodlab::stages::REGISTRY {
        let folder = source.join(entry.room).join(entry.module);
        assert!(folder.join("mod.rs").is_file(), "{}", folder.display());
        let has_reference = folder.join("reference.rs").is_file() || folder.join("reference/mod.rs").is_file();
        assert!(has_reference, "{} has no reference", folder.display());
    }
    let folders = std::fs::read_dir(&source).unwrap().flatten().filter(|entry| entry.path().is_dir());
    let rooms: Vec<String> = folders.map(|entry| entry.file_name().to_string_lossy().to_string()).collect();
    for room in rooms.iter().filter(|room| *room != "shared") {
        for stage in std::fs::read_dir(source.join(room)).unwrap().flatten() {
            let stage = stage.file_name().to_string_lossy().to_string();
            let is_listed = lodlab::stages::REGISTRY.iter().any(|entry| entry.room == room && entry.module == stage);
            assert!(is_listed, "{room}/{stage} is not in the list of stages");
        }
    }
}
