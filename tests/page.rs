//! The page of a report in a browser: what a person sees of a cell is what its record says. Without Chromium this test is shown as ignored;
//! `scripts/page-test --install` gets it.

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;

use libtest_mimic::{Arguments, Failed, Trial};
use serde_json::Value;

const EXPERIMENT: &str = r#"Experiment(
    title: "A page <of> \"two\" scenes",
    scene: (
        terrain: Noise(kind: Ridged, size: (129, 129), wavelength_m: 1500),
        camera: Still(frames: 3, eye: (1900, 100, 900), look_at: (1900, 3000, 300)),
        viewport: (120, 90),
    ),
    chains: {
        "grid": [HeightPyramid, ViewGrid, Project, Rasterize, Shade],
        "exact": [HeightPyramid, RayCast, Shade],
        "open": [HeightPyramid, Roughness(error: Proven), VertexSplitting(threshold_px: 8), TriangleSplitting(split: false), Rasterize, Shade],
        // more than four gigabytes, which no adapter binds
        "large": [HeightPyramid, RayCast, Shade, Kernel(file: "two.wgsl", bind: {"d": "distance", "e": New(name: "e", of: F32, size: (43000, 26000))}, over: "distance")],
    },
    sweep: {"grid.ViewGrid.size": [(12, 9), (24, 18), (48, 36)], "scene.terrain.height_m": {"low": (0, 300), "high": (0, 900)}},
    measure: [ScreenError, Image, Mesh, Time],
)"#;

const TWO: &str = "@group(0) @binding(0) var<storage, read_write> d: array<f32>;
@group(0) @binding(1) var<storage, read_write> e: array<f32>;
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3<u32>) { e[0] = 1.0; d[id.x] *= 0.5; }";

fn chromium() -> Option<PathBuf> {
    ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"]
        .map(PathBuf::from)
        .into_iter()
        .find(|path| path.is_file())
}

fn main() {
    let is_absent = chromium().is_none();
    let trial = Trial::test("a page shows what the records say", shows_the_records).with_ignored_flag(is_absent);
    libtest_mimic::run(&Arguments::from_args(), vec![trial]).exit();
}

/// What the script in `page/drive.js` has found in a page that it drove in a browser.
fn drive(page: &Path, folder: &Path) -> Result<Value, Failed> {
    let script = std::fs::read_to_string(Path::new(common::ROOT).join("tests/page/drive.js"))?;
    let html = std::fs::read_to_string(page)?;
    let (head, tail) = html.rsplit_once("</body>").ok_or("the page has no end")?;
    let driven = page.with_file_name("driven.html");
    std::fs::write(&driven, format!("{head}<script>{script}</script></body>{tail}"))?;
    let browser = chromium().ok_or("there is no browser")?;
    let output = Command::new(browser)
        .args([
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--virtual-time-budget=20000",
            "--window-size=1300,1000",
        ])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .args(["--dump-dom".into(), format!("file://{}", driven.display())])
        .output()?;
    let dom = String::from_utf8_lossy(&output.stdout).to_string();
    let result = dom.rsplit_once("id=\"test-result\">").ok_or("the page was not driven to its end")?.1;
    let json = result.split("</pre>").next().unwrap_or_default();
    let json = json.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&");
    Ok(serde_json::from_str(&json)?)
}

fn shows_the_records() -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("made.ron"), EXPERIMENT)?;
    std::fs::write(folder.path().join("two.wgsl"), TWO)?;
    let ran = common::run(folder.path(), &["run", "made.ron", "--out", "made"]);
    assert_eq!(ran.status.code(), Some(1), "{}", common::errors(&ran));
    let rows = common::rows(&folder.path().join("made"));
    let found = drive(&folder.path().join("made/report.html"), folder.path())?;
    assert_eq!(found["problems"], serde_json::json!([]), "{found:#}");
    assert_eq!(found["network"], serde_json::json!([]), "{found:#}");
    let row = |hash: &Value| rows.iter().find(|row| row["cell"] == *hash).cloned().unwrap_or_default();

    // all are there: 3 grids, 1 exact, 1 with holes, 1 that fits no adapter, over two terrains
    assert_eq!((found["cells"].as_u64(), found["panels"].as_u64()), (Some(12), Some(2)), "{found:#}");
    assert!(found["title"].as_str().is_some_and(|title| title.contains("<of> \"two\"")), "{found:#}");
    let failed = found["failed"].to_string();
    assert!(failed.contains("large") && failed.contains("binds"), "{failed}");

    // the front of each scene is that of the rows, and has nothing faulty
    let is_beaten = |own: &Value| {
        let figures = |row: &Value| row["method_ms"].as_f64().zip(row["error_rms"].as_f64().map(|px| px.max(1e-4)));
        let (ms, px) = figures(own).unwrap_or_default();
        let sound = rows.iter().filter(|row| row["status"] == "ok" && row["scene"] == own["scene"]);
        sound.filter_map(figures).any(|other| other.0 <= ms && other.1 <= px && (other.0 < ms || other.1 < px))
    };
    let front = found["front"].as_array().ok_or("there is no front")?;
    for own in &rows {
        let is_on_front = front.contains(&own["cell"]);
        assert_eq!(is_on_front, own["status"] == "ok" && !is_beaten(own), "{own:#}\n{front:?}");
    }
    assert!(rows.iter().any(|row| row["status"] == "faulty" && row["why"].to_string().contains("holes")), "{rows:#?}");

    // what is read under the mouse is the record's, to the digits that are shown
    let hovered = found["hover"].as_array().ok_or("nothing was pointed at")?;
    assert!(!hovered.is_empty());
    for hover in hovered {
        let own = row(&hover["hash"]);
        let text = hover["card"]["text"].as_str().unwrap_or_default();
        assert!(
            text.contains(own["label"].as_str().unwrap_or("?")) && text.contains(own["cell"].as_str().unwrap_or("?")),
            "{text}"
        );
        assert_eq!(hover["card"]["picture"], true);
        for (title, figure) in [("error rms", "error_rms"), ("method ms", "method_ms")] {
            let entries = hover["card"]["entries"].as_object().ok_or("the card has no entries")?;
            let entry =
                entries.iter().find(|(name, _)| name.starts_with(title)).ok_or(format!("no {title}: {entries:?}"))?;
            let shown = entry.1.as_str().and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
            let (shown, own) = (shown.ok_or(format!("{entry:?}"))?, own[figure].as_f64().unwrap_or(f64::NAN));
            // three digits are shown
            assert!((shown - own).abs() <= 0.006 * own, "{title}: {shown} for {own}");
        }
    }

    // the table, sorted
    for sort in found["sort"].as_array().ok_or("nothing was sorted")? {
        let first = &sort["first"];
        let (own, column) = (row(&first["hash"]), sort["column"].as_str().unwrap_or_default());
        let shown = first["values"][column]["full"]
            .as_str()
            .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
        let values = rows.iter().filter_map(|row| row[column].as_f64());
        let best = match sort["direction"].as_str() {
            Some("descending") => values.fold(f64::MIN, f64::max),
            _ => values.fold(f64::MAX, f64::min),
        };
        assert_eq!((shown, own[column].as_f64()), (Some(best), Some(best)), "{sort:#}");
    }

    // a chain that is filtered away is in neither plot nor table
    let filter = &found["filter"];
    let chain = filter["chain"].as_str().ok_or("nothing was filtered")?;
    let others = rows.iter().filter(|row| row["chain"] != chain).count();
    assert!(filter["count"].as_str().is_some_and(|text| text.starts_with(&format!("{others} of 12"))), "{filter:#}");
    assert_eq!(filter["rows_of_chain"], 0);
    Ok(())
}
