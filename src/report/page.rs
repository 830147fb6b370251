//! One page with everything in it, and nothing outside of it: plot, tables and pictures that a browser shows from the disk.
//!
//! What the page does is in `page/page.js`; this makes the data that it reads. uPlot draws the points: it has fifty kilobytes, log axes,
//! a cursor and zoom, and draws ten thousand cells at once.

use base64::Engine;
use serde_json::{Value, json};

use super::data::{self, Column, Role};
use super::equal::Answer;
use super::records::{Record, Results};
use super::standing::{self, Standing};

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = include_str!("page/page.js");
const LIBRARY: &str = include_str!("page/uPlot.iife.min.js");
const LIBRARY_STYLE: &str = include_str!("page/uPlot.min.css");

/// Bytes of pictures that a page has in itself, those of the front first; it points at the others, which are files beside it.
const MOST_PICTURE_BYTES: usize = 24 << 20;

/// What the pictures of every cell are called, and what they show.
pub const PICTURES: [(&str, &str); 2] = [("image", "final image"), ("error", "screen-space error")];

/// What a page is about besides its results.
pub struct About<'a> {
    pub title: &'a str,
    pub answers: &'a [Answer],
    /// A line is drawn at this error.
    pub target_px: f64,
}

/// The name of the file of a cell's picture.
pub fn picture_name(hash: &str, kind: &str) -> String {
    format!("pictures/{hash}_{kind}.png")
}

/// `picture` reads a file of the results; `None` if it is not there.
pub fn page(about: &About, results: &Results, picture: &dyn Fn(&str) -> Option<Vec<u8>>) -> String {
    let columns = data::columns(results);
    let data = json!({
        "title": about.title,
        "about": summary(results),
        "target_px": about.target_px,
        "columns": columns.iter().map(column).collect::<Vec<_>>(),
    });
    let Value::Object(mut data) = data else { return String::new() };
    data.extend(details(results, picture));
    let parts = [
        ("{{title}}", escape(about.title)),
        ("{{style}}", STYLE.into()),
        ("{{library_style}}", LIBRARY_STYLE.into()),
        ("{{library}}", LIBRARY.into()),
        ("{{script}}", SCRIPT.into()),
        ("{{equal}}", about.answers.iter().map(answer).collect()),
        // last, and no other part is looked for in it
        ("{{data}}", Value::Object(data).to_string().replace('<', "\\u003c")),
    ];
    let mut html = String::new();
    let mut rest = TEMPLATE;
    while let Some((name, text, at)) = next_part(rest, &parts) {
        html += &rest[..at];
        html += text;
        rest = &rest[at + name.len()..];
    }
    html + rest
}

/// The first placeholder in a part of the template, with what takes its place.
fn next_part<'a>(rest: &str, parts: &'a [(&'a str, String)]) -> Option<(&'a str, &'a str, usize)> {
    let found = parts.iter().filter_map(|(name, text)| Some((*name, text.as_str(), rest.find(name)?)));
    found.min_by_key(|(_, _, at)| *at)
}

fn summary(results: &Results) -> String {
    let mut adapters: Vec<String> = Vec::new();
    for head in results.heads() {
        let adapter = format!("{} ({})", head.adapter.name, head.adapter.driver);
        if !adapters.contains(&adapter) {
            adapters.push(adapter);
        }
    }
    let dates = || results.heads().map(|head| head.made.date.split('T').next().unwrap_or_default());
    let (first, last) = (dates().min().unwrap_or_default(), dates().max().unwrap_or_default());
    let dates = if first == last { first.to_string() } else { format!("{first} to {last}") };
    format!("{} cells on {}, {dates}", results.heads().count(), adapters.join(" and "))
}

fn column(column: &Column) -> Value {
    let mut made = json!({
        "name": column.name,
        "title": if column.role == Role::Axis { column.name.clone() } else { column.name.replace('_', " ") },
        "unit": column.unit,
        "meaning": column.meaning,
        "kind": column.values.kind(),
        "role": column.role,
        "values": (0..column.values.count()).map(|row| column.values.json(row)).collect::<Vec<_>>(),
    });
    if column.more_is_better {
        made["better"] = "more".into();
    }
    made
}

/// Kernel times, plans, warnings and pictures of each cell. Plans and lists of kernels that are the same are there once.
fn details(results: &Results, picture: &dyn Fn(&str) -> Option<Vec<u8>>) -> serde_json::Map<String, Value> {
    let (mut plans, mut sets): (Vec<Value>, Vec<Value>) = Default::default();
    let pictures = pictures(results, picture);
    let mut made: Vec<Value> = Vec::new();
    for (record, pictures) in results.records.iter().zip(pictures) {
        let kernels = &record.timings.kernels;
        let set = kernels.iter().map(|time| {
            json!({"stage": time.stage, "step": time.step, "once": time.once, "after_surface": time.after_surface})
        });
        let ms = kernels.iter().map(|time| {
            let rounded = |ms: f64| (ms * 1e4).round() / 1e4;
            time.ms.as_ref().map(|ms| [ms.median, ms.lower_quartile, ms.upper_quartile].map(rounded))
        });
        made.push(json!({
            "short": record.head.label_in_scene(),
            "plan": place(&mut plans, record.plan.clone().into()),
            "kernel_set": place(&mut sets, set.collect()),
            "kernel_ms": ms.collect::<Vec<_>>(),
            "warnings": record.warnings,
            "pictures": pictures,
        }));
    }
    made.extend(results.failures.iter().map(|_| json!({"warnings": [], "pictures": []})));
    let parts = [("plans", plans.into()), ("kernel_sets", sets.into()), ("details", made.into())];
    parts.into_iter().map(|(name, value): (&str, Value)| (name.to_string(), value)).collect()
}

/// The place of a value in a list that has each once.
fn place(all: &mut Vec<Value>, value: Value) -> usize {
    all.iter().position(|known| *known == value).unwrap_or_else(|| {
        all.push(value);
        all.len() - 1
    })
}

/// What each picture of a cell shows and where it is, those of the front in the page itself.
fn pictures(results: &Results, picture: &dyn Fn(&str) -> Option<Vec<u8>>) -> Vec<Vec<(String, String)>> {
    let standing = Standing::of(results);
    let mut order: Vec<usize> = Vec::new();
    for group in &standing.groups {
        let points = standing::points(results, group, "error_rms", "method_ms");
        order.extend(standing::front(&points).iter().map(|point| point.record));
    }
    order.extend(0..results.records.len());
    let mut shown: Vec<Option<Vec<(String, String)>>> = vec![None; results.records.len()];
    let mut bytes = 0;
    for at in order {
        if shown[at].is_none() {
            shown[at] = Some(of_cell(&results.records[at], picture, &mut bytes));
        }
    }
    shown.into_iter().map(Option::unwrap_or_default).collect()
}

fn of_cell(record: &Record, picture: &dyn Fn(&str) -> Option<Vec<u8>>, bytes: &mut usize) -> Vec<(String, String)> {
    let own = PICTURES.iter().map(|(kind, what)| (what.to_string(), picture_name(&record.head.hash, kind)));
    let mut shown = Vec::new();
    for (what, file) in own.chain(record.looks.iter().cloned()) {
        let Some(png) = picture(&file) else { continue };
        *bytes += png.len();
        let source = match *bytes <= MOST_PICTURE_BYTES {
            true => format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png)),
            false => file,
        };
        shown.push((what, source));
    }
    shown
}

/// A table as HTML.
fn answer(answer: &Answer) -> String {
    let row = |tag: &str, cells: &[String]| {
        let cells: String = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect();
        format!("<tr>{cells}</tr>")
    };
    let rows: String = answer.rows.iter().map(|cells| row("td", cells)).collect();
    let (title, head) = (escape(&answer.title), row("th", &answer.header));
    format!("<table><caption>{title}</caption><thead>{head}</thead><tbody>{rows}</tbody></table>\n")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
