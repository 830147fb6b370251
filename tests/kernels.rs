//! Kernels and registry: every kernel validates, every kernel belongs to a stage, every stage says the truth.

use std::path::Path;

use lodlab::experiment::diagnostic::Source;
use lodlab::experiment::parameters::describe;
use lodlab::experiment::tree::Node;
use lodlab::kernel::Kernel;
use lodlab::stages::REGISTRY;

#[test]
fn every_kernel_validates() {
    let paths = Kernel::built_in_paths();
    assert!(!paths.is_empty());
    for path in paths {
        let kernel = Kernel::built_in(&path).unwrap_or_else(|error| panic!("{error}"));
        assert!(!kernel.entries.is_empty(), "{path} has no entry point");
    }
}

#[test]
fn kernels_of_the_experiments_validate() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/kernels");
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let text = std::fs::read_to_string(entry.path()).unwrap();
        Kernel::from_source(Source::new(entry.path().display().to_string(), text), false)
            .unwrap_or_else(|error| panic!("{error}"));
    }
}

/// A kernel belongs to the stage that it is named after.
#[test]
fn every_kernel_belongs_to_one_stage() {
    let mut of_stages: Vec<String> = REGISTRY.iter().flat_map(|entry| entry.kernels()).collect();
    of_stages.sort_unstable();
    assert_eq!(of_stages, Kernel::built_in_paths());
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
