//! What a user gets for a mistake: one golden diagnostic each, the exit status, and earlier results untouched.

mod common;

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use common::{errors, run};

/// A whole experiment with one part replaced.
fn experiment(replace: &str, with: &str) -> String {
    let whole = r#"Experiment(
    title: "bad",
    scene: (
        terrain: Shape(kind: Sine, size: (33, 33)),
        camera: Still(eye: (400, -300, 1500), look_at: (400, 500, 0)),
        viewport: (64, 48),
    ),
    chains: {
        "grid": [HeightPyramid, ViewGrid(size: (8, 8)), Project, Rasterize, Shade],
        "cast": [HeightPyramid, RayCast],
    },
    sweep: {"grid.ViewGrid.size": [(8, 8), (16, 16)]},
    measure: [ScreenError, Time],
)
"#;
    assert!(whole.contains(replace), "{replace}");
    whole.replacen(replace, with, 1)
}

/// An experiment with a user's kernel.
fn kernel(bind: &str, rest: &str) -> String {
    let stage = format!("Kernel(file: \"mine.wgsl\", bind: {bind}, {rest})");
    experiment("HeightPyramid, RayCast]", &format!("{stage}, HeightPyramid, RayCast]"))
        .replace("\"grid\": [HeightPyramid, ViewGrid(size: (8, 8)), Project, Rasterize, Shade],", "")
        .replace("sweep: {\"grid.ViewGrid.size\": [(8, 8), (16, 16)]},", "")
}

const BIND: &str = r#"{"src": "height", "dst": New(name: "mine", of: F32, like: "height")}"#;
const OVER: &str = r#"over: "mine""#;

const KERNEL: &str = "struct Params {
    scale: f32,
}
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> src: array<f32>;
@group(0) @binding(2) var<storage, read_write> dst: array<f32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    dst[id.x] = params.scale * src[id.x];
}
";

struct Case {
    name: &'static str,
    experiment: String,
    kernel: String,
    arguments: Vec<&'static str>,
}

fn case(name: &'static str, experiment: String) -> Case {
    Case { name, experiment, kernel: KERNEL.into(), arguments: vec!["plan", "bad.ron"] }
}

fn dem(fields: &str) -> String {
    experiment("Shape(kind: Sine, size: (33, 33))", &format!("Dem({fields})"))
}

fn with_kernel(name: &'static str, replace: &str, with: &str) -> Case {
    assert!(KERNEL.contains(replace));
    let experiment = kernel(BIND, &format!("params: (scale: 1), {OVER}"));
    Case { kernel: KERNEL.replacen(replace, with, 1), ..case(name, experiment) }
}

impl Case {
    /// With another change to the kernel.
    fn replaced(self, replace: &str, with: &str) -> Self {
        assert!(self.kernel.contains(replace), "{replace}");
        Self { kernel: self.kernel.replace(replace, with), ..self }
    }
}

fn set(name: &'static str, arguments: &[&'static str]) -> Case {
    Case { arguments: [&["plan", "bad.ron"], arguments].concat(), ..case(name, experiment("bad", "bad")) }
}

fn ron_cases() -> Vec<Case> {
    vec![
        case("empty file", String::new()),
        case("not an experiment", "Recipe(flour: 1)".into()),
        case("bracket never closed", experiment("(400, 500, 0)),", "(400, 500, 0),")),
        case("string never closed", experiment("\"bad\"", "\"bad")),
        case("comment never closed", experiment("sweep", "/* sweep")),
        case("comma missing", experiment("(64, 48),\n", "(64, 48)\n fov_deg 60")),
        case("field twice", experiment("title: \"bad\"", "title: \"bad\", title: \"worse\"")),
        case("unknown field of the experiment", experiment("measure:", "measures:")),
        case("unknown field of the scene", experiment("viewport:", "view_port:")),
        case("no scene", experiment("scene:", "sweep_nothing:")),
        case("wrong type", experiment("(64, 48)", "\"large\"")),
        case("negative size", experiment("size: (33, 33)", "size: (-33, 33)")),
        case("unknown terrain", experiment("Shape(kind: Sine", "Shap(kind: Sine")),
        case("unknown shape", experiment("kind: Sine", "kind: Wave")),
        case("unknown stage", experiment("Rasterize, Shade", "Rasterise, Shade")),
        case("unknown field of a stage", experiment("ViewGrid(size: (8, 8))", "ViewGrid(sise: (8, 8))")),
        case(
            "wrong type in a stage",
            experiment("[HeightPyramid, RayCast]", "[HeightPyramid(max_level: \"all\"), RayCast]"),
        ),
        case(
            "a sketch map without the levels that it needs",
            experiment(
                "[HeightPyramid, RayCast]",
                "[HeightPyramid(max_level: 1), SketchMap(texels: 8), SketchImportance]",
            ),
        ),
        case("unknown value of a stage", experiment("Project,", "Project(filter: Sharp),")),
        case("unknown measure", experiment("[ScreenError, Time]", "[ScreenErorr, Time]")),
        case("zero viewport", experiment("(64, 48)", "(0, 48)")),
        case("viewport too large", experiment("(64, 48)", "(100000, 48)")),
        case("field of view of a half turn", experiment("viewport: (64, 48)", "fov_deg: 180")),
        case("an eye that looks at itself", experiment("look_at: (400, 500, 0)", "look_at: (400, -300, 1500)")),
        case(
            "a flight without keys",
            experiment("Still(eye: (400, -300, 1500), look_at: (400, 500, 0))", "Flight(frames: 3, keys: [])"),
        ),
        case("no frames", experiment("Still(", "Still(frames: 0, ")),
        case("grid of one point", experiment("[(8, 8), (16, 16)]", "[(8, 8), (1, 16)]")),
        case(
            "stages in the wrong order",
            experiment("ViewGrid(size: (8, 8)), Project", "Project, ViewGrid(size: (8, 8))"),
        ),
        case("stage left out", experiment("HeightPyramid, RayCast", "RayCast")),
        case(
            "surface types that nobody makes",
            experiment(
                "[HeightPyramid, RayCast]",
                "[HeightPyramid, SketchMap, SketchImportance(densest_of_types: (1, 1, 1, 1)), SurfaceType]",
            ),
        ),
        case(
            "errors that nobody keeps",
            experiment("[HeightPyramid, RayCast]", "[HeightPyramid, SketchMap, SketchImportance(error_share: 0.5)]"),
        ),
        case(
            "no points for a surface type",
            experiment(
                "[HeightPyramid, RayCast]",
                "[HeightPyramid, SurfaceType, SketchMap, SketchImportance(densest_of_types: (0, 1, 1, 1))]",
            ),
        ),
        case("measured buffer nobody makes", experiment("Rasterize, Shade]", "]")),
        case(
            "chains not a map",
            experiment("chains: {", "chains: [").replace("RayCast],\n    },", "RayCast],\n    ],"),
        ),
        case("empty chain", experiment("[HeightPyramid, RayCast]", "[]")),
        case("two chains of one name", experiment("\"cast\"", "\"grid\"")),
        case("chain named like a path", experiment("\"cast\"", "\"a.b\"")),
        case("a bound of nothing", experiment("Project,", "Project, GridError(threshold_px: 0),")),
        case("a rule that is none", experiment("Project,", "Project, GridError(rule: Prooven),")),
        case("a bound without planes", experiment("Project,", "Project, GridError(rule: Proven),")),
        case("two bounds", experiment("Project,", "Project, GridError, GridError,")),
        case("too many rounds", experiment("Project,", "AspectImportance, Warp(rounds: 9), Project,")),
        case("a share of two", experiment("Project,", "AspectImportance, Warp(uniform_share: 2), Project,")),
        case("a warp without importance", experiment("Project,", "Warp, Project,")),
        case("importance of nothing", experiment("Project,", "AspectImportance(size: (0, 4)), Warp, Project,")),
        case("a list of vectors", experiment("Project,", "Project, Compact(of: \"vertex\"),")),
        case("a list above nothing", experiment("Project,", "Project, Compact(of: \"height\", above: NaN),")),
        case("a list of no rows", experiment("Project,", "Project, Compact(of: \"height\", rows: 0),")),
        case(
            "a list of rows of a list",
            experiment("Project,", "Project, Compact(of: \"height\"), Compact(of: \"pixels\", rows: 2),"),
        ),
        case(
            "a fill of rows of another list",
            experiment(
                "Project, Rasterize,",
                "Project, GridError, Rasterize, Compact(of: \"distance\", rows: 2), RayFill,",
            ),
        ),
        case(
            "a fill of rows over a terrain that is too large for that",
            experiment("Project, Rasterize,", "Project, GridError, Rasterize, Compact(rows: 2), RayFill,")
                .replace("size: (33, 33)", "size: (2, 16384)"),
        ),
        case(
            "importance that is too large for a warp",
            kernel(
                &BIND.replace("like: \"height\"", "size: (16001, 2)").replace("\"mine\"", "\"importance\""),
                "params: (scale: 1), over: \"importance\"",
            )
            .replace("HeightPyramid, RayCast]", "ViewGrid, Warp]"),
        ),
        case("sums of floats", experiment("Project,", "Project, Scan(of: \"height\"),")),
        case("a fill without a list", experiment("Project, Rasterize,", "Project, GridError, Rasterize, RayFill,")),
        case("errors of nothing", experiment("Rasterize, Shade]", "]").replace("[ScreenError, Time]", "[ErrorBuffer]")),
        case(
            "a mesh of nothing",
            experiment("[HeightPyramid, RayCast]", "[HeightPyramid]").replace("[ScreenError, Time]", "[Mesh]"),
        ),
        case(
            "a picture that is not shaded",
            experiment("Rasterize, Shade]", "Rasterize]").replace("[ScreenError, Time]", "[Image]"),
        ),
        case("a negative measure", experiment("[ScreenError, Time]", "[ScreenError(threshold_px: inf), Time]")),
        case(
            "a list where a grid is needed",
            experiment(
                "HeightPyramid, RayCast]",
                "HeightPyramid, Roughness, VertexSplitting, TriangleSplitting, GridError]",
            ),
        ),
        case("axis that matches nothing", experiment("grid.ViewGrid.size", "grid.ViewGird.size")),
        case("axis over no chain", experiment("grid.ViewGrid.size", "mesh.ViewGrid.size")),
        case("axis without values", experiment("[(8, 8), (16, 16)]", "[]")),
        case("axis with a wrong value", experiment("(16, 16)]", "(16, large)]")),
        case("axis with an unknown field", experiment("grid.ViewGrid.size", "grid.ViewGrid.sides")),
        case("axis with a value twice", experiment("[(8, 8), (16, 16)]", "[(8, 8), (8, 8)]")),
        case("two axes over one thing", experiment("sweep: {", "sweep: {\"*.ViewGrid.size\": [(4, 4), (5, 5)], ")),
        case(
            "axis of four thousand million steps",
            experiment("[(8, 8), (16, 16)]", "Linear(from: 0, to: 1, steps: 4000000000)"),
        ),
        case("brackets without end", "(".repeat(100_000)),
        case(
            "a mistake in a long line",
            experiment("(64, 48)", "(64, 48), fov_deg: 300").replace('\n', &" ".repeat(20)),
        ),
        case("two places in a long line", experiment("sweep:", "chains: {}, sweep:").replace('\n', &" ".repeat(20))),
        case("a stage whose name has no end", experiment("[HeightPyramid,", &format!("[{},", "Warp".repeat(50_000)))),
        case(
            "a sweep of a thousand times a thousand cells",
            experiment(
                "[(8, 8), (16, 16)]",
                "[(8, 8)], \"scene.fov_deg\": Linear(from: 10, to: 90, steps: 1000), \
                 \"scene.light.ambient\": Linear(from: 0, to: 1, steps: 1000)",
            ),
        ),
        case(
            "too many cells of two chains",
            experiment("[(8, 8), (16, 16)]", "[(8, 8)], \"scene.fov_deg\": Linear(from: 10, to: 90, steps: 30000)"),
        ),
        case(
            "an axis of too many values",
            experiment("[(8, 8), (16, 16)]", &format!("[(8, 8)], \"scene.fov_deg\": [{}]", "60,".repeat(50_001))),
        ),
        case(
            "too many frames in all",
            experiment("Still(", "Still(frames: 100000, ")
                .replace("[(8, 8), (16, 16)]", "[(8, 8)], \"scene.fov_deg\": Linear(from: 10, to: 90, steps: 60)"),
        ),
        case("warm-up without end", experiment("Time]", "Time(warmup: 4294967295)]")),
        case(
            "a negative threshold",
            experiment("HeightPyramid, RayCast]", "HeightPyramid, Roughness, VertexSplitting(threshold_px: -1)]"),
        ),
        case(
            "lists of nothing",
            experiment("HeightPyramid, RayCast]", "HeightPyramid, Roughness, VertexSplitting(capacity: 0)]"),
        ),
        case(
            "a start that is none",
            experiment("HeightPyramid, RayCast]", "HeightPyramid, Roughness, VertexSplitting(start: Leaf)]"),
        ),
        case("blocks without roughness", experiment("HeightPyramid, RayCast]", "HeightPyramid, VertexSplitting]")),
        case("triangles of nothing", experiment("HeightPyramid, RayCast]", "HeightPyramid, TriangleSplitting]")),
        case(
            "no triangles",
            experiment(
                "HeightPyramid, RayCast]",
                "HeightPyramid, Roughness, VertexSplitting, TriangleSplitting(capacity: 0)]",
            ),
        ),
        case(
            "a bound over patches",
            experiment("HeightPyramid, RayCast]", "HeightPyramid, Roughness(error: Proven)]")
                .replace("viewport: (64, 48),", "viewport: (64, 48), surface: Bilinear,"),
        ),
        case(
            "noise without end",
            experiment("Shape(kind: Sine, size: (33, 33))", "Noise(kind: Fbm, lacunarity: 1e300)"),
        ),
        case(
            "noise of nothing",
            experiment("Shape(kind: Sine, size: (33, 33))", "Noise(kind: DomainWarped, persistence: -1)"),
        ),
        case("logarithm of zero", experiment("[(8, 8), (16, 16)]", "Log(from: 0, to: 1, steps: 3)")),
        case("range that never arrives", experiment("[(8, 8), (16, 16)]", "Range(from: 0, to: 1, step: -1)")),
        case(
            "zipped axis with a row too short",
            experiment(
                "\"grid.ViewGrid.size\": [(8, 8), (16, 16)]",
                "\"grid.ViewGrid.size, scene.fov_deg\": [((8, 8), 50), ((9, 9),)]",
            ),
        ),
        case("cell of no extent", experiment("size: (33, 33)", "size: (33, 33), cell_m: 0")),
        case("cell of a wrong type", experiment("size: (33, 33)", "size: (33, 33), cell_m: \"fine\"")),
        case("terrain too large", experiment("size: (33, 33)", "size: (100000, 100000)")),
        case("terrain of one sample", experiment("size: (33, 33)", "size: (1, 1)")),
        case(
            "noise that takes an hour",
            experiment(
                "Shape(kind: Sine, size: (33, 33))",
                "Noise(kind: DomainWarped, octaves: 32, lacunarity: 1.1, size: (16384, 16384))",
            ),
        ),
        case(
            "a chain without end",
            experiment("HeightPyramid, RayCast]", &format!("{}RayCast]", "Slope, ".repeat(1000))),
        ),
        case("infinite height", experiment("size: (33, 33)", "size: (33, 33), height_m: (0, inf)")),
        case("octaves without end", experiment("Shape(kind: Sine, size: (33, 33))", "Noise(kind: Fbm, octaves: 99)")),
        case("eye that is not a number", experiment("(400, -300, 1500)", "(NaN, -300, 1500)")),
        case("place that is not a number", experiment("look_at: (400, 500, 0)", "look_at: (NaN, 0, 0)")),
        case("place beyond all worlds", experiment("look_at: (400, 500, 0)", "look_at: (1e308, 1e308, 0)")),
        case(
            "clearance that is not a number",
            experiment("(400, -300, 1500),", "(400, -300, 1500), clearance_m: NaN,"),
        ),
        case("two view directions", experiment("look_at: (400, 500, 0)", "look_at: (400, 500, 0), yaw_deg: 90")),
        case("cell too large", experiment("size: (33, 33)", "size: (33, 33), cell_m: 1e39")),
        case("cell too small", experiment("size: (33, 33)", "size: (33, 33), cell_m: 5e-324")),
        case(
            "two scales of height",
            dem("file: \"heights.npy\", cell_m: 90, height_m: (0, 100), height_offset_m: 5000"),
        ),
        case("gap filled with nothing", dem("file: \"heights.npy\", cell_m: 90, nodata: Fill(NaN)")),
        case("light from nowhere", experiment("viewport:", "light: (azimuth_deg: NaN), viewport:")),
        case("more octaves than there are", experiment("viewport:", "detail: (octaves: 31), viewport:")),
        case(
            "octaves of a negative height",
            experiment("viewport:", "detail: (octaves: 3, amplitude_m: -2), viewport:"),
        ),
        case(
            "octaves steeper than ground",
            experiment("viewport:", "detail: (octaves: 9, amplitude_m: 1e6), viewport:"),
        ),
        case(
            "octaves from too far",
            experiment("viewport:", "detail: (octaves: 3, origin: (2147483647, 0)), viewport:"),
        ),
        case(
            "a bound over octaves",
            experiment("viewport:", "detail: (octaves: 3), viewport:").replace("Project,", "Project, GridError,"),
        ),
        case("light below zero", experiment("viewport:", "light: (ambient: -5), viewport:")),
        case("threshold below zero", experiment("[ScreenError,", "[ScreenError(threshold_px: -1),")),
        case("field of view of a hair", experiment("viewport:", "fov_deg: 0.001, viewport:")),
    ]
}

fn file_cases() -> Vec<Case> {
    vec![
        case("DEM that is not there", dem("file: \"nowhere.png\", cell_m: 30")),
        case("DEM of an unknown kind", dem("file: \"heights.xyz\", cell_m: 30")),
        case("DEM without a cell size", dem("file: \"good.png\"")),
        case("PNG cut off", dem("file: \"cut.png\", cell_m: 30")),
        case("PNG in colour", dem("file: \"colour.png\", cell_m: 30")),
        case("PNG that lies about its size", dem("file: \"liar.png\", cell_m: 30")),
        case("TIFF of garbage", dem("file: \"garbage.tif\", cell_m: 30")),
        case("TIFF of two planes", dem("file: \"planes.tif\", cell_m: 30")),
        case("TIFF of bits", dem("file: \"bits.tif\", cell_m: 30")),
        case("hgt of a wrong length", dem("file: \"N47W122.hgt\"")),
        case("hgt without a place", dem("file: \"somewhere.hgt\"")),
        case("zip that is none", dem("file: \"N48W122.hgt.zip\"")),
        case("npy of three dimensions", dem("file: \"cube.npy\", cell_m: 30")),
        case("npy that lies about its size", dem("file: \"liar.npy\", cell_m: 30")),
        case("npy of nested lists", dem("file: \"lists.npy\", cell_m: 30")),
        case("npy of nested tuples", dem("file: \"tuples.npy\", cell_m: 30")),
        case("npy of nested dictionaries", dem("file: \"dictionaries.npy\", cell_m: 30")),
        case("npy of records", dem("file: \"records.npy\", cell_m: 30")),
        case("npy with more keys", dem("file: \"keys.npy\", cell_m: 30")),
        case("npy with a header without end", dem("file: \"header.npy\", cell_m: 30")),
        case("npy that is none", dem("file: \"good.npy\", cell_m: 30")),
        case("npy with a word that fills a page", dem("file: \"word.npy\", cell_m: 30")),
        case("npy cut off", dem("file: \"cut.npy\", cell_m: 30")),
        case("npy with NaN", dem("file: \"nan.npy\", cell_m: 30")),
        case("npy all NaN", dem("file: \"empty.npy\", cell_m: 30, nodata: Interpolate")),
        case("range for floating point heights", dem("file: \"nan.npy\", cell_m: 30, height_m: (0, 1)")),
        case("crop outside", dem("file: \"good.png\", cell_m: 30, crop: (2, 2, 5, 5)")),
        case("colours that are not there", experiment("viewport:", "colour: Image(file: \"nowhere.png\"), viewport:")),
        case("colours of garbage", experiment("viewport:", "colour: Image(file: \"garbage.tif\"), viewport:")),
        case(
            "surface types in colour",
            experiment("viewport:", "surface_type: Image(file: \"colour.png\"), viewport:"),
        ),
        case(
            "surface types in two bits",
            experiment("viewport:", "surface_type: Image(file: \"two_bits.png\"), viewport:"),
        ),
        case(
            "surface types that are not there",
            experiment("viewport:", "surface_type: Image(file: \"no.png\"), viewport:"),
        ),
        case("an unknown kind of colours", experiment("viewport:", "colour: Autumn(), viewport:")),
        case("resample to nothing", dem("file: \"good.png\", cell_m: 30, resample: (0, 0)")),
    ]
}

fn kernel_cases() -> Vec<Case> {
    let ok = format!("params: (scale: 1), {OVER}");
    vec![
        with_kernel("WGSL syntax", "params.scale * src", "params.scale ** src"),
        with_kernel("WGSL unknown name", "params.scale", "parms.scale"),
        with_kernel("WGSL type", "dst[id.x] =", "dst[id.x] = 1u;\n    dst[id.x] ="),
        with_kernel("WGSL without the entry point", "fn main", "fn start"),
        with_kernel("WGSL in another group", "@group(0) @binding(1)", "@group(1) @binding(1)"),
        with_kernel("WGSL element type", "dst: array<f32>", "dst: array<u32>"),
        with_kernel("WGSL include of nothing", "struct", "//!include lib/places.wgsl\nstruct"),
        with_kernel("WGSL that is no compute kernel", "@compute @workgroup_size(8, 8)\nfn main(@builtin(global_invocation_id) id: vec3<u32>) {\n    dst[id.x] = params.scale * src[id.x];", "@fragment\nfn main() {\n    dst[0] = params.scale * src[0];"),
        Case {
            kernel: KERNEL.replace("params.scale *", "more.scale * params.scale *") + "@group(0) @binding(3) var<uniform> more: Params;\n",
            ..case("WGSL with two structures of parameters", kernel(BIND, &ok))
        },
        case("measured buffer of another size", kernel(&BIND.replace("like: \"height\"", "size: (10, 7)").replace("mine", "distance"), "params: (scale: 1), over: \"distance\"").replace(", HeightPyramid, RayCast]", "]")),
        case("pyramid of another size", kernel(&BIND.replace("mine", "height_max"), "params: (scale: 1), over: \"height_max\"").replace(", HeightPyramid, RayCast]", ", RayCast]")),
        case("kernel that is not there", kernel(BIND, &ok).replace("mine.wgsl", "yours.wgsl")),
        case("binding left out", kernel("{\"src\": \"height\"}", "params: (scale: 1), over: \"height\"")),
        case("binding too many", kernel(&BIND.replace('}', ", \"more\": \"height\"}"), &ok)),
        case("buffer nobody makes", kernel(&BIND.replace("\"height\",", "\"depth\","), &ok)),
        case("parameter left out", kernel(BIND, OVER)),
        case("parameter unknown", kernel(BIND, &format!("params: (scale: 1, size: 2), {OVER}"))),
        case("parameter of a wrong type", kernel(BIND, &format!("params: (scale: \"much\"), {OVER}"))),
        case(
            "reads what it writes",
            kernel("{\"src\": \"height\", \"dst\": \"height\"}", "params: (scale: 1), over: \"height\""),
        ),
        case("new buffer without a size", kernel(&BIND.replace(", like: \"height\"", ""), &ok)),
        case("repeated without end", kernel(BIND, &format!("{ok}, repeat: 1000000"))),
        case("ping-pong of nothing", kernel(BIND, &format!("{ok}, repeat: 2, ping_pong: (\"a\", \"b\")"))),
        case("over a name without quotes", kernel(BIND, "params: (scale: 1), over: mine")),
        case("groups that are no numbers of groups", kernel(BIND, "params: (scale: 1), over: Indirect(\"height\")")),
        case(
            "two kernels that wait for each other",
            kernel(&BIND.replace("\"height\",", "\"b\","), &ok).replace(
                "HeightPyramid, RayCast]",
                "Kernel(file: \"mine.wgsl\", bind: {\"src\": \"mine\", \"dst\": New(name: \"b\", of: F32, like: \"height\")}, params: (scale: 1), over: \"b\"), HeightPyramid, RayCast]",
            ),
        ),
        case("errors that are numbers", kernel(&BIND.replace("\"mine\", of: F32", "\"error\", of: F32, as: Error"), "params: (scale: 1), over: \"error\"").replace(", HeightPyramid, RayCast]", "]")),
        case("a distance of another size", kernel(&BIND.replace("like: \"height\"", "size: (10, 7), as: Distance"), "params: (scale: 1), over: \"mine\"")),
        case("offered as nothing that is known", kernel(&BIND.replace("of: F32", "of: F32, as: Depth"), &ok)),
        case("over nothing", kernel(BIND, "params: (scale: 1), over: (0, 8)")),
        case(
            "errors that a kernel makes up",
            kernel(&BIND.replace("\"mine\"", "\"error_demand\""), "params: (scale: 1), over: \"error_demand\"")
                .replace("HeightPyramid, RayCast]", "HeightPyramid, SketchMap, SketchImportance(error_share: 1)]"),
        ),
        case("the frame before of nothing", kernel(&BIND.replace("\"height\",", "Last(\"depth\"),"), &ok)),
        case("the frame before of an input", kernel(&BIND.replace("\"height\",", "Last(\"height\"),"), &ok)),
        case("sized like the frame before", kernel(&BIND.replace("\"height\",", "Last(\"distance\"),").replace("like: \"height\"", "like: \"distance.last\""), &ok)),
        case("a ground changed in place", kernel(&BIND.replace("mine", "height"), "params: (scale: 1), over: \"height\"").replace(", HeightPyramid, RayCast]", ", Kernel(file: \"mine.wgsl\", bind: {\"src\": New(name: \"other\", of: F32, like: \"height\"), \"dst\": \"height\"}, params: (scale: 1), over: \"height\"), HeightPyramid, RayCast]")),
        case("a ground that was promised", kernel(&BIND.replace("mine", "height"), "params: (scale: 1), over: \"height\"").replace("[Kernel", "[HeightPyramid, Roughness(error: Proven), VertexSplitting, Kernel")),
        case("a name with a step in it", kernel(&BIND.replace("mine", "a@b"), "params: (scale: 1), over: \"a@b\"")),
        case("a ground of another size", kernel(&BIND.replace("mine", "height").replace("like: \"height\"", "size: (10, 7)"), "params: (scale: 1), over: (10, 7)")),
        case("a pyramid of another ground", kernel(&BIND.replace("mine", "height"), "params: (scale: 1), over: \"height\"").replace("[Kernel", "[HeightPyramid, Kernel").replace(", HeightPyramid, RayCast]", ", RayCast]")),
        case("a proof on another ground", kernel(&BIND.replace("mine", "height"), "params: (scale: 1), over: \"height\"").replace(", HeightPyramid, RayCast]", ", HeightPyramid, Roughness(error: Proven), RayCast]")),
        with_kernel("WGSL with a block of other fields", "struct Params {", "struct Motion {\n    @align(16) speed: f32,\n}\nstruct Params {\n    motion: Motion,"),
        with_kernel("WGSL array longer than its buffer", "src: array<f32>", "src: array<f32, 1090>"),
        with_kernel("WGSL extension that adapters lack", "struct", "enable f16;\nstruct"),
        with_kernel("WGSL operation that adapters lack", "src[id.x]", "subgroupAdd(src[id.x])"),
        with_kernel("WGSL constant without a value", "params.scale *", "FACTOR * params.scale *").replaced("struct", "override FACTOR: f32;\nstruct"),
        with_kernel("WGSL workgroup of too many threads", "workgroup_size(8, 8)", "workgroup_size(32, 32)"),
        with_kernel("WGSL workgroup that is too deep", "workgroup_size(8, 8)", "workgroup_size(1, 1, DEEP)").replaced("struct", "override DEEP: u32 = 65u;\nstruct"),
        with_kernel("WGSL workgroup that shares too much", "src[id.x];", "src[id.x] + many[id.x];").replaced("struct", "var<workgroup> many: array<f32, 4097>;\nstruct"),
        with_kernel("WGSL binding of a large number", "@binding(2)", "@binding(1000)"),
        with_kernel("WGSL parameters that are too large", "scale: f32,", "scale: f32,\n    table: array<vec4<f32>, 4096>,"),
        with_kernel("WGSL sum without end", "src[id.x];", "src[id.x]\n").replaced("src[id.x]\n", &format!("src[id.x]{};", "\n+ src[0]".repeat(20_000))),
        with_kernel("WGSL brackets without end", "params.scale *", &format!("{}1{} *", "(\n".repeat(20_000), ")".repeat(20_000))),
        with_kernel("WGSL brackets that are too deep", "params.scale *", &format!("{}1.0{} *", "(".repeat(250), ")".repeat(250))),
        with_kernel("WGSL branches without end", "dst[id.x] =", &format!("if id.x == 0u {{ return; }}{}\n    dst[id.x] =", "\nelse if id.x == 1u { return; }".repeat(20_000))),
        with_kernel("WGSL without end", "struct", &format!("{}\nstruct", "// nothing\n".repeat(100_000))),
        with_kernel("WGSL image of three dimensions", "src: array<f32>", "unused: array<f32>").replaced("var<storage, read> unused: array<f32>", "var src: texture_3d<f32>").replaced("src[id.x]", "textureLoad(src, id, 0).x"),
    ]
}

/// What waits for somebody who writes, or has no end.
#[cfg(unix)]
fn pipe_cases() -> Vec<Case> {
    let with = |name, arguments: &[&'static str]| Case { arguments: arguments.to_vec(), ..set(name, &[]) };
    vec![
        case("DEM that is a pipe", dem("file: \"pipe.npy\", cell_m: 30")),
        case("DEM that has no end", dem("file: \"zeros.tif\", cell_m: 30")),
        case("DEM that is a folder", dem("file: \"folder.png\", cell_m: 30")),
        case("colours that are a pipe", experiment("viewport:", "colour: Image(file: \"pipe.npy\"), viewport:")),
        case("kernel that is a pipe", kernel(BIND, OVER).replace("mine.wgsl", "pipe.npy")),
        with("experiment that is a pipe", &["plan", "pipe.npy"]),
        with("experiment that has no end", &["run", "zeros.tif"]),
    ]
}

#[cfg(unix)]
fn write_pipes(folder: &Path) {
    let made = std::process::Command::new("mkfifo").arg(folder.join("pipe.npy")).status().unwrap();
    assert!(made.success());
    std::os::unix::fs::symlink("/dev/zero", folder.join("zeros.tif")).unwrap();
    std::fs::create_dir(folder.join("folder.png")).unwrap();
}

fn command_cases() -> Vec<Case> {
    let with = |name, arguments: &[&'static str]| Case { arguments: arguments.to_vec(), ..set(name, &[]) };
    vec![
        set("set without a value", &["--set", "scene.fov_deg"]),
        set("set of nothing", &["--set", "scene.fov=50"]),
        set("set of a wrong type", &["--set", "scene.fov_deg=wide"]),
        set("set of an unknown stage", &["--set", "*.Grid.size=(4, 4)"]),
        with("experiment that is not there", &["plan", "nowhere.ron"]),
        with("stage that is not there", &["stages", "RayCats"]),
        with("wrong adapter", &["run", "bad.ron", "--adapter", "Voodoo"]),
        with("folder that cannot be written", &["run", "bad.ron", "--out", "good.png/out"]),
        with("dump of nothing", &["run", "bad.ron", "--dump", "depth"]),
        with("dump after no step", &["run", "bad.ron", "--dump", "distance@Warp"]),
        with("dump of a render target after a step", &["run", "bad.ron", "--dump", "drawn@Rasterize"]),
        with(
            "terrain too large for the adapter",
            &[
                "run",
                "bad.ron",
                "--adapter",
                "llvmpipe",
                "--set",
                "scene.terrain.size=(8000, 8000)",
                "--set",
                "scene.held_as=Array",
            ],
        ),
    ]
}

/// Sizes and numbers of a user's kernel that no adapter has.
fn large_kernel_cases() -> Vec<Case> {
    let sized = |size: &str| BIND.replace("like: \"height\"", &format!("size: ({size})"));
    let repeated = "params: (scale: 1), over: (8, 8), repeat: 10000";
    vec![
        case("buffer of 2^64 elements", kernel(&sized("4294967295, 4294967295"), "params: (scale: 1), over: (8, 8)")),
        case("buffer of 2^32 elements", kernel(&sized("65536, 65536"), "params: (scale: 1), over: (8, 8)")),
        case(
            "thirty thousand steps",
            kernel(
                &sized("8, 8"),
                &format!(
                    "{repeated}), Kernel(file: \"mine.wgsl\", bind: {BIND}, {repeated}), Kernel(file: \"mine.wgsl\", bind: {BIND}, {repeated}"
                ),
            ),
        ),
    ]
}

/// A PNG of 4 x 1 pixels with the values 0 to 3, two bits each.
fn two_bits() -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8], data: &[u8]| {
        png.extend((data.len() as u32).to_be_bytes());
        let body = [kind, data].concat();
        png.extend(&body);
        png.extend(crc32(&body).to_be_bytes());
    };
    chunk(b"IHDR", &[0, 0, 0, 4, 0, 0, 0, 1, 2, 0, 0, 0, 0]);
    // a zlib stream of one stored block: no filter, and a byte of pixels, 0b00_01_10_11; its Adler-32
    chunk(b"IDAT", &[0x78, 0x01, 1, 2, 0, 0xfd, 0xff, 0, 0x1b, 0, 0x1d, 0, 0x1c]);
    chunk(b"IEND", &[]);
    png
}

/// Files with something wrong with them.
fn write_files(folder: &Path) {
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).unwrap();
    let good = folder.join("good.png");
    image::ImageBuffer::from_fn(5, 5, |x, y| image::Luma([(x * y) as u16])).save(&good).unwrap();
    image::RgbImage::new(5, 5).save(folder.join("colour.png")).unwrap();
    write("two_bits.png", &two_bits());
    let png = std::fs::read(&good).unwrap();
    write("cut.png", &png[..png.len() - 30]);
    let mut liar = png.clone();
    // width in the header; the checksum after it is made to agree
    liar[16..20].copy_from_slice(&0x7fff_ffffu32.to_be_bytes());
    let checksum = crc32(&liar[12..29]);
    liar[29..33].copy_from_slice(&checksum.to_be_bytes());
    write("liar.png", &liar);
    write("planes.tif", &[&grey_tiff(8, 2)[..], &[1, 2, 3, 4, 5, 6, 7, 8]].concat());
    write("bits.tif", &[&grey_tiff(4, 1)[..], &[1, 2, 3, 4]].concat());
    write("garbage.tif", b"II*\0 this is not a tiff at all");
    write("N47W122.hgt", &[0; 1000]);
    write("somewhere.hgt", &vec![0; 1201 * 1201 * 2]);
    write("N48W122.hgt.zip", b"PK no");
    write("cube.npy", &npy("<f4", "(2, 2, 2)", &[0; 32]));
    write("liar.npy", &npy("<f4", "(1000000, 1000000)", &[0; 16]));
    write("lists.npy", &npy("<f4", &format!("{}2, 2{}", "[".repeat(100), "]".repeat(100)), &[0; 16]));
    write("tuples.npy", &npy("<f4", &format!("{}2, 2{}", "(".repeat(4_000), ")".repeat(4_000)), &[0; 16]));
    write("dictionaries.npy", &npy("<f4", &format!("{}1{}", "{1: ".repeat(100), "}".repeat(100)), &[0; 16]));
    write("records.npy", &npy_of("[('height', '<f4')]", "(2, 2)", &[0; 16]));
    write("keys.npy", &npy("<f4", "(2, 2), 'unit': 'm'", &[0; 16]));
    write("header.npy", &npy("<f4", &format!("(2, 2){}", " ".repeat(20_000)), &[0; 16]));
    write("good.npy", &png);
    write("word.npy", &npy_of(&"f".repeat(5_000), "(2, 2)", &[0; 16]));
    write("cut.npy", &npy("<f4", "(4, 4)", &[0; 16]));
    let nan: Vec<u8> = [0.0f32, 1.0, 2.0, f32::NAN].iter().flat_map(|value| value.to_le_bytes()).collect();
    write("nan.npy", &npy("<f4", "(2, 2)", &nan));
    let empty: Vec<u8> = [f32::NAN; 4].iter().flat_map(|value| value.to_le_bytes()).collect();
    write("empty.npy", &npy("<f4", "(2, 2)", &empty));
}

/// The tags of a TIFF of 2 x 2 samples in planes of a strip each, which follow.
fn grey_tiff(bits: u32, planes: u32) -> Vec<u8> {
    let after = 8 + 2 + 11 * 12 + 4;
    // a field has room for two u16
    let two = |first: u32, second: u32| if planes == 2 { second << 16 | first } else { first };
    common::tiff(&[
        (256, 3, 1, 2),
        (257, 3, 1, 2),
        (258, 3, 1, bits),
        (259, 3, 1, 1),
        (262, 3, 1, 1),
        (273, 3, planes, two(after, after + 4)),
        (277, 3, 1, planes),
        (278, 3, 1, 2),
        (279, 3, planes, two(4, 4)),
        (284, 3, 1, planes),
        (339, 3, 1, 1),
    ])
}

fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    npy_of(&format!("'{descr}'"), shape, data)
}

fn npy_of(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// Adapters differ from machine to machine; what is said about them does not.
fn without_adapter(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        match line.split_once("; there are: ") {
            Some((said, _)) => lines.push(format!("{said}; there are: [adapters]")),
            None => lines.push(line.replace(&between(line, "bytes, ", " binds"), "[adapter]")),
        }
    }
    lines.join("\n")
}

fn between(line: &str, from: &str, to: &str) -> String {
    let found = line.split_once(from).and_then(|(_, rest)| rest.split_once(to)).map(|(found, _)| found.to_string());
    found.unwrap_or_else(|| "\u{0}".into())
}

/// Bytes of a message that somebody can read, whatever is in the file.
const LONGEST_MESSAGE: usize = 4000;

#[test]
fn every_mistake_has_its_diagnostic() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    // results of an earlier run, which have to survive all of it
    std::fs::write(folder.path().join("bad.ron"), experiment("bad", "good")).unwrap();
    common::succeeded(&run(folder.path(), &["run", "bad.ron"]));
    let earlier = common::records(&folder.path().join("out/bad"));
    assert_eq!(earlier.len(), 3);

    let (mut golden, mut wrong) = (String::new(), Vec::new());
    let mut cases = vec![ron_cases(), file_cases(), kernel_cases(), large_kernel_cases(), command_cases()];
    #[cfg(unix)]
    {
        write_pipes(folder.path());
        cases.push(pipe_cases());
    }
    let cases = cases.into_iter().flatten().collect::<Vec<Case>>();
    assert!(cases.len() >= 40, "{} cases", cases.len());
    for case in cases {
        std::fs::write(folder.path().join("bad.ron"), &case.experiment).unwrap();
        std::fs::write(folder.path().join("mine.wgsl"), &case.kernel).unwrap();
        let output = run(folder.path(), &case.arguments);
        let said = without_adapter(&errors(&output));
        let is_short = said.len() < LONGEST_MESSAGE;
        let is_told = said.starts_with("error: ") && !said.contains("panicked");
        if !matches!(output.status.code(), Some(1 | 2)) || !is_told || !is_short {
            wrong.push(format!("{}: {:?}\n{said}", case.name, output.status));
        }
        writeln!(
            golden,
            "## {}\n$ lodlab {}\n{said}\nexit status {}\n",
            case.name,
            case.arguments.join(" "),
            output.status.code().unwrap_or(-1)
        )
        .unwrap();
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
    assert_eq!(earlier, common::records(&folder.path().join("out/bad")));
    insta::assert_snapshot!("diagnostics", golden);
}

/// The exit status of a command whose output goes somewhere else.
fn status(folder: &Path, arguments: &[&str], redirect: impl FnOnce(&mut Command)) -> Option<i32> {
    let mut command = common::lodlab(folder);
    command.args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    redirect(&mut command);
    command.status().unwrap().code()
}

/// `| head` ends before the program does, and nothing of it is a failure of the program.
#[test]
fn a_reader_may_go_away() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("good.ron"), experiment("bad", "good")).unwrap();
    std::fs::write(folder.path().join("bad.ron"), experiment("(64, 48)", "(0, 48)")).unwrap();
    let nobody_reads = || std::io::pipe().unwrap().1;
    let errors_to_nobody = |command: &mut Command| {
        command.stderr(nobody_reads());
    };
    let all_to_nobody = |command: &mut Command| {
        command.stdout(nobody_reads()).stderr(nobody_reads());
    };
    assert_eq!(status(folder.path(), &["plan", "bad.ron"], errors_to_nobody), Some(2));
    assert_eq!(status(folder.path(), &["plan", "bad.ron"], all_to_nobody), Some(2));
    assert_eq!(status(folder.path(), &["plan", "good.ron"], all_to_nobody), Some(0));
    assert_eq!(status(folder.path(), &["plan"], all_to_nobody), Some(2));
    assert_eq!(status(folder.path(), &["--help"], all_to_nobody), Some(0));
}

/// What was asked for and cannot be written is a failure; a complaint that cannot be written changes nothing.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_the_output_is_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("good.ron"), experiment("bad", "good")).unwrap();
    std::fs::write(folder.path().join("bad.ron"), experiment("(64, 48)", "(0, 48)")).unwrap();
    let full = || std::fs::File::options().write(true).open("/dev/full").unwrap();
    let results_lost = |command: &mut Command| {
        command.stdout(full());
    };
    let all_lost = |command: &mut Command| {
        command.stdout(full()).stderr(full());
    };
    for arguments in [&["plan", "good.ron"][..], &["stages"], &["--help"]] {
        assert_eq!(status(folder.path(), arguments, results_lost), Some(1), "{arguments:?}");
        assert_eq!(status(folder.path(), arguments, all_lost), Some(1), "{arguments:?}");
    }
    assert_eq!(status(folder.path(), &["plan", "bad.ron"], all_lost), Some(2));
    let output = common::lodlab(folder.path()).args(["plan", "good.ron"]).stdout(full()).output().unwrap();
    assert!(errors(&output).starts_with("error: standard output cannot be written: "), "{}", errors(&output));
}

/// A system that gives no thread is told of; here none can have the stack that it asks for.
#[test]
fn without_threads_nothing_panics() {
    let folder = tempfile::tempdir().unwrap();
    let terrain = experiment("Shape(kind: Sine, size: (33, 33))", "Noise(kind: Fbm, size: (33, 33))");
    std::fs::write(folder.path().join("good.ron"), terrain).unwrap();
    let mut command = common::lodlab(folder.path());
    let output = command.args(["plan", "good.ron"]).env("RUST_MIN_STACK", (1usize << 46).to_string()).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", errors(&output));
    assert!(errors(&output).starts_with("error: no thread can be started: "), "{}", errors(&output));
}
