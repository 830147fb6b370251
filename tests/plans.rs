//! Plans and sweeps as values: no device.

mod common;

use std::sync::Arc;

use lodlab::experiment::Experiment;
use lodlab::experiment::diagnostic::{Diagnostic, Source};
use lodlab::experiment::sweep::read_setting;
use lodlab::experiment::tree::Node;
use lodlab::gpu::limits;
use lodlab::plan::Plan;
use lodlab::run::{Keep, Setup};
use lodlab::scene::COLOUR_MAP;

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

/// The steps of every frame that are not the method's.
fn after_surface(scene: &str, chain: &str) -> Vec<String> {
    let folder = format!("{ROOT}/experiments");
    let plan = Setup::chain(scene, chain, folder.as_ref(), Keep::Last).unwrap().plan;
    plan.after_surface.iter().map(|&at| format!("{}/{}", plan.steps[at].stage, plan.steps[at].label)).collect()
}

#[test]
fn what_the_drawn_surface_does_not_depend_on_is_not_of_the_method() {
    let after = |chain: &str| {
        after_surface(
            "terrain: Noise(kind: Fbm, size: (65, 65)), camera: Still(eye: (100, 10, 900)), viewport: (32, 24)",
            chain,
        )
    };
    assert_eq!(after("[HeightPyramid, RayCast, Shade]"), ["Shade/shade"]);
    assert_eq!(after("[HeightPyramid, RayCast]"), [""; 0]);
    // wherever it stands: what fills the gaps draws the surface
    let filled = "HeightPyramid, ViewGrid(size: (8, 6)), Project, GridError, Rasterize, Compact, RayFill";
    assert_eq!(after(&format!("[{filled}, Shade]")), ["Shade/shade"]);
    // the next frame's surface depends on what is kept for it
    let tree = "HeightPyramid, Roughness, VertexSplitting(start: LastFrame), TriangleSplitting, Rasterize, Shade";
    assert_eq!(after(&format!("[{tree}]")), ["Shade/shade"]);
    // and so it does on what a step behind it leaves
    let change = |now: &str, before: &str, made: &str| {
        format!(
            "Kernel(file: \"kernels/change.wgsl\", bind: {{\"now\": \"{now}\", \"before\": {before}, \"change\": {made}}}, over: \"{now}\")"
        )
    };
    let drawn =
        |before: &str| change("distance", before, "New(name: \"drawn\", of: F32, like: \"distance\", as: Distance)");
    let left = change("drawn", "\"distance\"", "New(name: \"left\", of: F32, like: \"distance\")");
    let stages = |before: &str| {
        let steps = after(&format!("[HeightPyramid, RayCast, {}, {left}]", drawn(before)));
        steps.into_iter().map(|step| step.split('/').next().unwrap().to_string()).collect::<Vec<_>>()
    };
    assert_eq!(stages("\"distance\""), ["Kernel"]);
    assert_eq!(stages("Last(\"left\")"), [""; 0]);
    // a map is no picture of a surface, and where none is drawn all steps are the method's
    assert_eq!(after("[Slope]"), [""; 0]);
    assert_eq!(after("[HeightPyramid, RayCast, ViewGrid]"), [""; 0]);
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
        |cell: &lodlab::experiment::Cell| cell.settings.iter().map(|setting| setting.value.clone()).collect::<Vec<_>>();
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

/// A sweep of tens of thousands of cells is not in memory at once.
#[test]
fn a_cell_is_made_when_its_turn_comes() {
    let experiment = experiment("\"scene.fov_deg\": [30, wide]").unwrap();
    let made: Vec<bool> = experiment.each_cell(&[]).unwrap().map(|cell| cell.is_ok()).collect();
    assert_eq!(made, [true, false, true, false, true, false]);
    assert!(experiment.cells(&[]).is_err());
}

/// What is large of a scene is made once, however many cameras look at it.
#[test]
fn scenes_of_one_terrain_share_what_is_made_of_it() {
    let text = r#"Experiment(
        scene: (terrain: Shape(kind: Sine, size: (9, 9)), colour: Cover(), camera: Still(eye: (0, 0, 2000))),
        chains: {"cast": [HeightPyramid, RayCast, Shade]},
        sweep: {"scene.fov_deg": [30, 60], "scene.surface": [Triangles, Bilinear]},
    )"#;
    let experiment = Experiment::read(Source::new("sweep.ron", text), "".into()).unwrap();
    let cells = lodlab::run::prepare(&experiment, &[]).unwrap_or_else(|error| panic!("{error}"));
    let data: Vec<_> = cells.iter().map(|cell| &cell.data).collect();
    let maps: Vec<_> = data.iter().map(|data| data.input(COLOUR_MAP).unwrap().bytes().as_ptr()).collect();
    assert!(maps.iter().all(|map| *map == maps[0]));
    assert!(Arc::ptr_eq(&data[0].ground, &data[2].ground) && Arc::ptr_eq(&data[1].ground, &data[3].ground));
    assert!(!Arc::ptr_eq(&data[0].ground, &data[1].ground), "another surface is another ground");
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
    let fov = cells("\"scene.fov_deg\": Linear(from: 1.1, to: 1.5, steps: 5)", &[]);
    assert_eq!(fov[..5], ["a 1.1", "a 1.2", "a 1.3", "a 1.4", "a 1.5"]);
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

/// What a plan asks for: the terrain in each form that it is bound in, render targets with their depth, parameters of all frames.
#[test]
fn bytes_are_all_there_is() {
    let plan = |camera: &str, chain: &str| {
        let scene = format!("terrain: Shape(kind: Sine, size: (33, 17)), camera: {camera}, viewport: (40, 30)");
        Setup::chain(&scene, chain, "".as_ref(), Keep::Last).unwrap_or_else(|error| panic!("{error}")).plan
    };
    let parameters = |plan: &Plan| -> u64 {
        let frames = plan.packed_frames();
        plan.steps.iter().map(|step| step.parameter_bytes(frames)).sum()
    };
    let still = "Still(eye: (400, -300, 1500), look_at: (400, 200, 0))";
    let terrain = 4 * 33 * 17;
    // an array for the map, an image for the pyramid
    let map = "Kernel(file: \"experiments/kernels/smooth.wgsl\", bind: {\"src\": \"height\", \"dst\": New(name: \"smooth\", of: F32, \
               like: \"height\")}, over: \"smooth\")";
    let of_map = plan(still, &format!("[{map}]"));
    assert_eq!(of_map.bytes(), 2 * terrain + parameters(&of_map));
    let of_pyramid = plan(still, "[HeightPyramid]");
    let buffers = |plan: &Plan| -> u64 {
        let own = plan.buffers.iter().filter(|buffer| buffer.lifetime.is_some() && buffer.name != "height");
        own.filter(|buffer| buffer.slot.is_none()).map(|buffer| buffer.bytes()).sum::<u64>()
            + plan.slots.iter().sum::<u64>()
    };
    assert_eq!(of_pyramid.bytes(), buffers(&of_pyramid) + terrain + parameters(&of_pyramid));
    // both at once, and a target of 4 bytes a pixel with 4 of depth
    let drawn = plan(still, "[HeightPyramid, ViewGrid(size: (4, 3)), Project, Rasterize]");
    assert_eq!(drawn.bytes(), buffers(&drawn) + 2 * terrain + 4 * 40 * 30 + parameters(&drawn));
    let longer = plan(
        &still.replace("Still(", "Still(frames: 5, "),
        "[HeightPyramid, ViewGrid(size: (4, 3)), Project, Rasterize]",
    );
    assert!(parameters(&longer) > parameters(&drawn));
}

/// Only the next frames of a path are in memory.
#[test]
fn a_long_path_takes_no_more_memory_than_a_shorter_one() {
    let bytes = |frames: u32| {
        let camera = format!("Orbit(frames: {frames}, center: (400, 400, 0), radius_m: 800, height_m: 900)");
        let scene = format!("terrain: Shape(kind: Sine, size: (33, 17)), camera: {camera}, viewport: (40, 30)");
        let setup = Setup::chain(&scene, "[HeightPyramid, RayCast]", "".as_ref(), Keep::Last);
        setup.unwrap_or_else(|error| panic!("{error}")).plan.bytes()
    };
    assert!(bytes(2) < bytes(1000));
    assert_eq!(bytes(1000), bytes(100_000));
}

/// Whatever an adapter has too little of is named before anything runs on it.
#[test]
fn every_limit_is_compared_with_the_plan() {
    let scene = "terrain: Shape(kind: Sine, size: (65, 65)), camera: Still(eye: (40, -30, 90), look_at: (40, 40, 0)), viewport: (64, 48)";
    let chain = "[HeightPyramid, Roughness, VertexSplitting(start: LastFrame), TriangleSplitting, Rasterize, Shade]";
    let setup = |held: &str| {
        let scene = format!("{scene}, held_as: {held}");
        Setup::chain(&scene, chain, "".as_ref(), Keep::Everything).unwrap().plan
    };
    let (array, image) = (setup("Array"), setup("Image"));
    let most = wgpu::Limits {
        min_uniform_buffer_offset_alignment: 256,
        max_inter_stage_shader_variables: 16,
        max_storage_buffers_per_shader_stage: 8,
        ..wgpu::Limits::default()
    };
    for plan in [&array, &image] {
        limits::check(plan, &most, "small").unwrap();
    }
    type Lower = fn(&mut wgpu::Limits);
    let cases: [(&str, Lower); 16] = [
        ("buffer", |limits| limits.max_storage_buffer_binding_size = 1000),
        ("buffer", |limits| limits.max_buffer_size = 1000),
        ("a side of the image", |limits| limits.max_texture_dimension_2d = 47),
        ("in bytes of parameters", |limits| limits.max_uniform_buffer_binding_size = 16),
        ("in storage buffers", |limits| limits.max_storage_buffers_per_shader_stage = 7),
        ("in uniform buffers", |limits| limits.max_uniform_buffers_per_shader_stage = 0),
        ("in images", |limits| limits.max_sampled_textures_per_shader_stage = 0),
        ("in samplers", |limits| limits.max_samplers_per_shader_stage = 0),
        ("in groups of bindings", |limits| limits.max_bind_groups = 1),
        ("in numbers of bindings", |limits| limits.max_bindings_per_bind_group = 4),
        ("workgroup along x", |limits| limits.max_compute_workgroup_size_x = 32),
        ("workgroup along y", |limits| limits.max_compute_workgroup_size_y = 1),
        ("in threads of a workgroup", |limits| limits.max_compute_invocations_per_workgroup = 32),
        ("of a workgroup's memory", |limits| limits.max_compute_workgroup_storage_size = 1000),
        ("in workgroups", |limits| limits.max_compute_workgroups_per_dimension = 1),
        ("variables between its shaders", |limits| limits.max_inter_stage_shader_variables = 0),
    ];
    for (what, lower) in cases {
        let mut less = most.clone();
        lower(&mut less);
        let refused = limits::check(&image, &less, "small").unwrap_err().to_string();
        assert!(refused.contains(what) && refused.contains("small"), "{what}: {refused}");
    }
}
