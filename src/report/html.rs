//! One page with everything, and nothing outside of it.

use std::fmt::Write;

use base64::Engine;

use super::{Record, table};

/// A cell's pictures as PNG, middle frame.
#[derive(Clone, Debug, Default)]
pub struct Pictures {
    pub label: String,
    pub image: Option<Vec<u8>>,
    pub error: Option<Vec<u8>>,
    /// Looks of buffers, each with what it shows.
    pub looks: Vec<(String, Vec<u8>)>,
}

const TIME: &str = "The time is that of the method: a frame without the steps that the drawn surface does not depend on, such as those that \
shade it. The table has the time of the whole frame beside it.";

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2rem auto;padding:0 1rem;color:#222}\
table{border-collapse:collapse;font-size:13px}td,th{padding:.25rem .6rem;border-bottom:1px solid #ddd;text-align:right}\
td:first-child,th:first-child{text-align:left}img{max-width:49%;margin:0 .3% 0 0}pre{background:#f6f6f6;padding:.8rem;\
overflow-x:auto;font-size:12px}svg{max-width:100%;height:auto}figure{margin:1.2rem 0}figcaption{font-size:13px;color:#555}";

pub fn page(title: &str, records: &[Record], pareto: Option<&str>, pictures: &[Pictures]) -> String {
    let mut html = String::new();
    // writing to a String cannot fail
    let _ = write_page(&mut html, title, records, pareto, pictures);
    html
}

fn write_page(
    html: &mut String,
    title: &str,
    records: &[Record],
    pareto: Option<&str>,
    pictures: &[Pictures],
) -> std::fmt::Result {
    let title = escape(title);
    write!(
        html,
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style><h1>{title}</h1>"
    )?;
    if let Some(record) = records.first() {
        let adapter = &record.adapter;
        write!(
            html,
            "<p>{} cells on {} ({}), {}.</p>",
            records.len(),
            escape(&adapter.name),
            escape(&adapter.driver),
            escape(&adapter.backend)
        )?;
    }
    if let Some(svg) = pareto {
        write!(html, "<h2>Error against run time</h2><p>{TIME}</p>{svg}")?;
    }
    write!(html, "<h2>Cells</h2><table><tr>")?;
    let columns = table::columns(records);
    for name in table::header(&columns) {
        write!(html, "<th>{name}</th>")?;
    }
    for row in table::rows(&columns, records) {
        write!(html, "</tr><tr>")?;
        for cell in row {
            write!(html, "<td>{}</td>", escape(&cell))?;
        }
    }
    write!(html, "</tr></table><h2>Kernel times</h2>")?;
    write_kernels(html, records)?;
    write!(
        html,
        "<h2>Pictures</h2><p>Final image and screen-space error of the middle frame: black is none, white four thresholds or more, grey sky, blue sky and surface mixed up.</p>"
    )?;
    write_pictures(html, pictures)?;
    write!(html, "<h2>Plans</h2>")?;
    for record in records {
        write!(
            html,
            "<details><summary>{}</summary><pre>{}</pre></details>",
            escape(&record.label()),
            escape(&record.plan)
        )?;
    }
    write!(html, "</html>")
}

fn write_pictures(html: &mut String, pictures: &[Pictures]) -> std::fmt::Result {
    for cell in pictures {
        write!(html, "<figure>")?;
        for png in [&cell.image, &cell.error].into_iter().flatten() {
            let data = base64::engine::general_purpose::STANDARD.encode(png);
            write!(html, "<img alt=\"{}\" src=\"data:image/png;base64,{data}\">", escape(&cell.label))?;
        }
        write!(html, "<figcaption>{}</figcaption></figure>", escape(&cell.label))?;
        for (what, png) in &cell.looks {
            let (data, what) = (base64::engine::general_purpose::STANDARD.encode(png), escape(what));
            write!(html, "<figure><img alt=\"{what}\" src=\"data:image/png;base64,{data}\">")?;
            write!(html, "<figcaption>{what}, {}</figcaption></figure>", escape(&cell.label))?;
        }
    }
    Ok(())
}

fn write_kernels(html: &mut String, records: &[Record]) -> std::fmt::Result {
    write!(
        html,
        "<table><tr><th>cell</th><th>stage</th><th>step</th><th>ms (median)</th><th>quartiles</th><th>samples</th></tr>"
    )?;
    for record in records {
        for time in &record.timings.kernels {
            let (median, quartiles, samples) = match &time.ms {
                Some(ms) => (
                    format!("{:.3}", ms.median),
                    format!("{:.3} .. {:.3}", ms.lower_quartile, ms.upper_quartile),
                    ms.samples,
                ),
                None => ("not measured".into(), String::new(), 0),
            };
            let often = match (time.once, time.after_surface) {
                (true, _) => " (once)",
                (_, true) => " (not of the method)",
                _ => "",
            };
            write!(
                html,
                "<tr><td>{}</td><td>{}</td><td>{}{often}</td><td>{median}</td><td>{quartiles}</td><td>{samples}</td></tr>",
                escape(&record.label()),
                escape(&time.stage),
                escape(&time.step)
            )?;
        }
    }
    write!(html, "</table>")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
