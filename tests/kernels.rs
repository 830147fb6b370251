//! Kernels and registry: every kernel validates, every kernel belongs to a stage, every stage says the truth.

use std::path::Path;

use lodlab::experiment::diagnostic::Source;
use lodlab::experiment::tree::Node;
use lodlab::kernel::Kernel;
use lodlab::stages::REGISTRY;

#[test]
fn every_kernel_validates() {
    let names = Kernel::built_in_names();
    assert!(!names.is_empty());
    for name in names {
        let kernel = Kernel::built_in(&name).unwrap_or_else(|error| panic!("{error}"));
        assert!(!kernel.entries.is_empty(), "{name} has no entry point");
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

#[test]
fn kernels_and_stages_are_in_bijection() {
    let mut of_stages: Vec<&str> = REGISTRY.iter().flat_map(|info| info.kernels).copied().collect();
    of_stages.sort_unstable();
    assert_eq!(of_stages, Kernel::built_in_names());
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

/// Every documented parameter is accepted with its documented default, and no other name is.
#[test]
fn documented_parameters_are_the_real_ones() {
    for info in REGISTRY.iter().filter(|info| info.name != "Kernel") {
        let mut fields = String::new();
        for (name, default, _) in info.params {
            fields += &format!("{name}: {default}, ");
        }
        let read = |text: String| (info.read)(&Node::read(&Source::new("test", text)).unwrap(), Path::new(""));
        let documented =
            read(format!("{}({fields})", info.name)).unwrap_or_else(|error| panic!("{}: {error}", info.name));
        let plain = read(info.name.to_string()).unwrap_or_else(|error| panic!("{}: {error}", info.name));
        assert_eq!(format!("{documented:?}"), format!("{plain:?}"), "defaults of {}", info.name);
        assert!(read(format!("{}(no_such_field: 1)", info.name)).is_err(), "{} takes any field", info.name);
    }
}
