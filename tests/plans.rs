//! Plans and sweeps as values: no device.

mod common;

use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::{Diagnostic, Source};
use lodlab::experiment::sweep::read_setting;
use lodlab::experiment::tree::Node;

use common::{ROOT, run, succeeded};

/// What `lodlab plan` prints.
fn plan(name: &str) -> String {
    let output = run(ROOT.as_ref(), &["plan", &format!("experiments/{name}.ron")]);
    succeeded(&output);
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_plan_of_a_flat_scene() {
    insta::assert_snapshot!("flat", plan("stability/flat"));
}

#[test]
fn the_plan_of_a_user_kernel() {
    insta::assert_snapshot!("custom_kernel", plan("custom_kernel"));
}

#[test]
fn the_plan_of_the_quickstart() {
    insta::assert_snapshot!("quickstart", plan("quickstart"));
}

fn experiment(sweep: &str) -> Result<Experiment, Diagnostic> {
    let text = format!(
        r#"Experiment(
            scene: (terrain: Shape(kind: Flat), camera: Still(eye: (0, 0, 9))),
            chains: {{
                "a": [HeightPyramid, ViewGrid, Project, Rasterize],
                "b": [HeightPyramid, ViewGrid(size: (4, 4)), Project(filter: Finest), Rasterize],
                "c": [HeightPyramid, RayCast],
            }},
            sweep: {{{sweep}}},
        )"#
    );
    Experiment::read(Source::new("sweep.ron", text), "".into())
}

/// Chain and settings of every cell.
fn cells(sweep: &str, set: &[&str]) -> Vec<String> {
    let settings: Vec<_> = set.iter().map(|argument| read_setting(argument).unwrap()).collect();
    let cells =
        experiment(sweep).and_then(|experiment| experiment.cells(&settings)).unwrap_or_else(|error| panic!("{error}"));
    let settings =
        |cell: &lodlab::experiment::Cell| cell.settings.iter().map(|(_, value)| value.clone()).collect::<Vec<_>>();
    cells.iter().map(|cell| format!("{} {}", cell.chain, settings(cell).join(" "))).collect()
}

#[test]
fn an_axis_concerns_the_chains_that_have_its_path() {
    assert_eq!(cells("", &[]), ["a ", "b ", "c "]);
    assert_eq!(cells("\"*.ViewGrid.size\": [(2, 2), (3, 3)]", &[]), ["a (2,2)", "a (3,3)", "b (2,2)", "b (3,3)", "c "]);
    assert_eq!(cells("\"b.ViewGrid.size\": [(2, 2), (3, 3)]", &[]), ["a ", "b (2,2)", "b (3,3)", "c "]);
}

#[test]
fn axes_multiply_and_zipped_ones_do_not() {
    let half = read_setting("scene.fov_deg=40").unwrap();
    let zipped = experiment("\"a.HeightPyramid.max_level, scene.fov_deg\": [(1, 30)]").unwrap();
    assert!(zipped.cells(&[half]).is_err(), "one path of a zipped axis is not all of it");
    let product = cells("\"a.HeightPyramid.max_level\": [1, 2], \"scene.fov_deg\": [30, 40, 50]", &[]);
    assert_eq!(product.iter().filter(|cell| cell.starts_with('a')).count(), 6);
    let zipped = cells("\"a.HeightPyramid.max_level, scene.fov_deg\": [(1, 30), (2, 40)]", &[]);
    assert_eq!(zipped, ["a 1 30", "a 2 40", "b 30", "b 40", "c 30", "c 40"]);
}

#[test]
fn spaced_values_are_round_and_end_where_they_should() {
    let of_a = |axis: &str| {
        cells(&format!("\"a.HeightPyramid.max_level\": {axis}"), &[])
            .into_iter()
            .filter(|cell| cell.starts_with('a'))
            .collect::<Vec<_>>()
    };
    assert_eq!(of_a("Range(from: 1, to: 7, step: 2)"), ["a 1", "a 3", "a 5", "a 7"]);
    assert_eq!(of_a("Log(from: 1, to: 8, steps: 4)"), ["a 1", "a 2", "a 4", "a 8"]);
    assert_eq!(
        cells("\"scene.fov_deg\": Log(from: 10, to: 100, steps: 3)", &[])[0..3],
        ["a 10", "a 31.6227766017", "a 100"]
    );
    let fov = cells("\"scene.fov_deg\": Linear(from: 0.1, to: 0.5, steps: 5)", &[]);
    assert_eq!(fov[..5], ["a 0.1", "a 0.2", "a 0.3", "a 0.4", "a 0.5"]);
}

#[test]
fn set_wins_over_the_file_and_over_an_axis() {
    assert_eq!(cells("\"*.ViewGrid.size\": [(2, 2), (3, 3)]", &["*.ViewGrid.size=(5, 5)"]), ["a ", "b ", "c "]);
    assert_eq!(
        cells("\"*.ViewGrid.size\": [(2, 2), (3, 3)]", &["b.ViewGrid.size=(5, 5)"]),
        ["a (2,2)", "a (3,3)", "b ", "c "]
    );
    assert_eq!(cells("\"scene.camera.Still.frames\": [2, 3]", &["scene.camera.frames=1"]).len(), 3);
    let settings = [read_setting("scene.camera.Still.eye=(1, 2, 3)").unwrap()];
    let cells = experiment("").unwrap().cells(&settings).unwrap();
    assert!(format!("{:?}", cells[0].scene.camera).contains("eye: (1.0, 2.0, 3.0)"));
}

#[test]
fn trees_keep_places_through_comments_strings_and_nesting() {
    let text = "// note\n(a: [1, /* two */ 2], b: {\"k\": Some(r#\"x\"y\"#)}, c: -1.5e-3, d: 'q')";
    let node = Node::read(&Source::new("t", text)).unwrap();
    assert_eq!(node.canonical(), "(a:[1,2],b:{\"k\":Some(r#\"x\"y\"#),},c:-1.5e-3,d:'q',)");
    assert_eq!(node.field("c").unwrap().origin.line_column(), (2, 52));
}

#[test]
fn a_wrong_value_is_reported_where_it_was_written() {
    let experiment = experiment("\"a.ViewGrid.size\": [(2, 2), (3, 3.5)]").unwrap();
    let cells = experiment.cells(&[]).unwrap();
    let error = cells
        .iter()
        .find_map(|cell| cell.stages.iter().find_map(|call| lodlab::stages::read(call, "".as_ref()).err()))
        .unwrap();
    let (origin, _) = &error.labels[0];
    assert_eq!((origin.text(), origin.line_column().0), ("3.5", 8));
}
