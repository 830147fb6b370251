//! Kernels and registry: every kernel validates, every kernel belongs to a stage, every stage says the truth.

use std::path::Path;

use lodlab::experiment::diagnostic::Source;
use lodlab::experiment::parameters::describe;
use lodlab::experiment::tree::Node;
use lodlab::kernel::{GroundForm, Kernel};
use lodlab::stages::REGISTRY;

#[test]
fn every_kernel_validates() {
    let paths = Kernel::built_in_paths();
    assert!(!paths.is_empty());
    for path in paths {
        for form in [None, Some(GroundForm::Array), Some(GroundForm::Image)] {
            let kernel = Kernel::built_in(&path, form).unwrap_or_else(|error| panic!("{error}"));
            assert!(!kernel.entries.is_empty(), "{path} has no entry point");
        }
    }
}

/// The limit that every adapter of WebGPU has: a kernel with more storage buffers does not run on some of them.
#[test]
fn every_kernel_binds_what_any_adapter_can() {
    const MOST_STORAGE_BUFFERS: usize = 8;
    let forms = [None, Some(GroundForm::Array), Some(GroundForm::Image)];
    let mut beyond = Vec::new();
    for (path, form) in Kernel::built_in_paths().iter().flat_map(|path| forms.map(|form| (path, form))) {
        for entry in &Kernel::built_in(path, form).unwrap().entries {
            if entry.storage_buffers() > MOST_STORAGE_BUFFERS {
                beyond.push(format!("{path} {form:?}: {} binds {}", entry.name, entry.storage_buffers()));
            }
        }
    }
    assert!(beyond.is_empty(), "{beyond:#?}");
}

#[test]
fn kernels_of_the_experiments_validate() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/kernels");
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let text = std::fs::read_to_string(entry.path()).unwrap();
        Kernel::from_source(Source::new(entry.path().display().to_string(), text), false, None)
            .unwrap_or_else(|error| panic!("{error}"));
    }
}

/// A kernel belongs to the stage that it is named after, or shows what others have made.
#[test]
fn every_kernel_belongs_to_one_stage() {
    let mut known: Vec<String> = REGISTRY.iter().flat_map(|entry| entry.kernels()).collect();
    known.extend(lodlab::gpu::paint::KERNELS.map(String::from));
    known.sort_unstable();
    assert_eq!(known, Kernel::built_in_paths());
}

#[test]
fn a_library_has_no_bindings_and_no_entry_points() {
    for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("kernels/lib")).unwrap().flatten() {
        let text = std::fs::read_to_string(entry.path()).unwrap();
        for word in ["@group", "@compute", "@vertex", "@fragment"] {
            assert!(!text.contains(word), "{} has {word}", entry.path().display());
        }
    }
}

/// The files of the ground are the one door to it.
#[test]
fn no_kernel_binds_the_ground_by_hand() {
    let kernels = Path::new(env!("CARGO_MANIFEST_DIR")).join("kernels");
    let rooms = std::fs::read_dir(&kernels).unwrap().flatten().map(|room| room.path());
    for room in rooms.filter(|room| room.is_dir() && !room.ends_with("ground")) {
        for file in std::fs::read_dir(room).unwrap().flatten() {
            let text = std::fs::read_to_string(file.path()).unwrap();
            for binding in text.lines().filter(|line| line.starts_with("@group")) {
                let name = binding.split(" height:").count();
                assert!(name == 1 && binding.starts_with("@group(0)"), "{}: {binding}", file.path().display());
            }
            // what the surface is between samples is written in one place
            assert!(!text.contains("north-east to south-west"), "{}", file.path().display());
            assert!(
                !text.contains("x + p.y <= 1.0") && !text.contains("x + place.y <= 1.0"),
                "{}",
                file.path().display()
            );
        }
    }
}

/// Every form of the ground has the same functions.
#[test]
fn the_forms_of_the_ground_have_the_same_functions() {
    let functions = |file: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("kernels/ground").join(file);
        let text = std::fs::read_to_string(path).unwrap();
        let lines = text.lines().filter(|line| line.starts_with("fn "));
        let mut all: Vec<String> = lines.map(|line| line.trim_end_matches(" {").to_string()).collect();
        all.sort();
        all
    };
    assert!(functions("array.wgsl").len() >= 3);
    assert_eq!(functions("array.wgsl"), functions("image.wgsl"));
}

/// Every documented parameter is accepted with its documented default, every documented choice is one, and no other name is.
#[test]
fn documented_parameters_are_the_real_ones() {
    for info in REGISTRY.iter().map(|entry| entry.info).filter(|info| info.name != "Kernel") {
        let documented = describe(&(info.parameters)());
        let read = |fields: &str| {
            let node = Node::read(&Source::new("test", format!("{}({fields})", info.name))).unwrap();
            (info.read)(&node, Path::new("")).map(|stage| format!("{stage:?}"))
        };
        let mut fields = String::new();
        for parameter in &documented {
            assert!(!parameter.meaning.is_empty(), "`{}` of {} is not explained", parameter.name, info.name);
            fields += &format!("{}: {}, ", parameter.name, parameter.default.as_ref().unwrap());
            for (choice, meaning) in &parameter.choices {
                assert!(!meaning.is_empty(), "{choice} of `{}` of {} is not explained", parameter.name, info.name);
                assert!(read(&format!("{}: {choice}", parameter.name)).is_ok(), "{}: {choice}", info.name);
            }
        }
        let all = read(&fields).unwrap_or_else(|error| panic!("{}: {error}", info.name));
        assert_eq!(all, read("").unwrap_or_else(|error| panic!("{}: {error}", info.name)), "defaults of {}", info.name);
        assert!(read("no_such_field: 1").is_err(), "{} takes any field", info.name);
    }
}
