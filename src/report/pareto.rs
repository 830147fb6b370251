//! Error against run time: one curve a chain, log axes, the front highlighted.

use plotters::prelude::*;

use super::Record;
use crate::experiment::diagnostic::Diagnostic;

/// A record with both numbers.
struct Point<'a> {
    chain: &'a str,
    label: String,
    ms: f64,
    error_px: f64,
}

/// Errors below this are drawn at it: a log axis has no zero, and a thousandth of a pixel is none.
const SMALLEST_PX: f64 = 1e-4;
const SMALLEST_MS: f64 = 1e-6;
/// What is larger, or no number, is no error of a picture and no time of a frame (it would be thirty years), and has no place in the plot.
const LARGEST: f64 = 1e12;

const COLOURS: [RGBColor; 10] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 99, 20),
    RGBColor(44, 140, 44),
    RGBColor(148, 73, 179),
    RGBColor(170, 40, 50),
    RGBColor(90, 90, 90),
    RGBColor(20, 150, 160),
    RGBColor(120, 80, 50),
    RGBColor(220, 90, 160),
    RGBColor(130, 140, 20),
];
const FRONT: RGBColor = RGBColor(250, 205, 90);

/// Columns of the picture that the curves have; their names stand to the right of them, where they hide nothing.
const PLOT_WIDTH: u32 = 880;
/// And what a name takes, with its line and for each of its letters.
const LINE_WIDTH: u32 = 44;
const LETTER_WIDTH: u32 = 8;

/// The plot as SVG text, or `None` if no record has an error and a time.
pub fn svg(title: &str, records: &[Record]) -> Result<Option<String>, Diagnostic> {
    let points: Vec<Point> = records.iter().filter_map(point).collect();
    if points.is_empty() {
        return Ok(None);
    }
    let mut text = String::new();
    draw(&mut text, title, &points).map_err(|error| Diagnostic::run(format!("the plot cannot be drawn: {error}")))?;
    Ok(Some(text))
}

fn point(record: &Record) -> Option<Point<'_>> {
    let error_px = placed(record.measure("error_rms")?, SMALLEST_PX)?;
    Some(Point { chain: &record.chain, label: record.label(), ms: placed(record.method_ms()?, SMALLEST_MS)?, error_px })
}

/// Where a number is on its axis, if it has a place there.
fn placed(value: f64, smallest: f64) -> Option<f64> {
    (0.0..=LARGEST).contains(&value).then_some(value.max(smallest))
}

/// Nobody is both faster and more exact.
fn front<'a>(points: &'a [Point<'a>]) -> Vec<&'a Point<'a>> {
    let beaten = |point: &Point| {
        points.iter().any(|other| {
            other.ms <= point.ms
                && other.error_px <= point.error_px
                && (other.ms < point.ms || other.error_px < point.error_px)
        })
    };
    let mut front: Vec<&Point> = points.iter().filter(|point| !beaten(point)).collect();
    front.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    front
}

fn draw(text: &mut String, title: &str, points: &[Point]) -> Result<(), Box<dyn std::error::Error>> {
    let range = |pick: fn(&Point) -> f64| {
        let (low, high) =
            points.iter().map(pick).fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
        low / 1.6..high * 1.6
    };
    let longest = points.iter().map(|point| point.chain.chars().count() as u32).max().unwrap_or(0);
    let width = PLOT_WIDTH + LINE_WIDTH + LETTER_WIDTH * longest;
    let root = SVGBackend::with_string(text, (width, 560)).into_drawing_area();
    root.fill(&WHITE)?;
    let (plot, names) = root.split_horizontally(PLOT_WIDTH);
    let mut chart = ChartBuilder::on(&plot)
        .caption(title, ("sans-serif", 20))
        .margin(16)
        .x_label_area_size(48)
        .y_label_area_size(72)
        .build_cartesian_2d(range(|point| point.ms).log_scale(), range(|point| point.error_px).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("time of the method without shading, ms (median)")
        .y_desc("screen-space error, px (RMS)")
        .light_line_style(RGBColor(240, 240, 240))
        .label_style(("sans-serif", 14))
        .x_label_formatter(&short)
        .y_label_formatter(&short)
        .draw()?;
    let front = front(points);
    let along_front = front.iter().map(|point| (point.ms, point.error_px));
    chart.draw_series(LineSeries::new(along_front, FRONT.stroke_width(9)))?;
    let mut chains: Vec<&str> = points.iter().map(|point| point.chain).collect();
    chains.dedup();
    for (index, chain) in chains.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let mut curve: Vec<&Point> = points.iter().filter(|point| point.chain == *chain).collect();
        curve.sort_by(|a, b| a.ms.total_cmp(&b.ms));
        chart.draw_series(LineSeries::new(
            curve.iter().map(|point| (point.ms, point.error_px)),
            colour.stroke_width(2),
        ))?;
        chart.draw_series(curve.iter().map(|point| Circle::new((point.ms, point.error_px), 4, colour.filled())))?;
        // the chain's name is beside the plot; what varies stands at the point
        let name = |point: &&Point| {
            let label = point.label.strip_prefix(point.chain).unwrap_or(&point.label).trim().to_string();
            Text::new(label, (point.ms * 1.03, point.error_px * 1.04), ("sans-serif", 11).into_font().color(&colour))
        };
        chart.draw_series(curve.iter().map(name))?;
    }
    let lines = [("front", FRONT, 9)].into_iter();
    let lines =
        lines.chain(chains.iter().enumerate().map(|(index, chain)| (*chain, COLOURS[index % COLOURS.len()], 2)));
    for ((name, colour, width), y) in lines.zip((60..).step_by(24)) {
        names.draw(&PathElement::new([(0, y), (20, y)], colour.stroke_width(width)))?;
        names.draw(&Text::new(name, (28, y - 7), ("sans-serif", 14)))?;
    }
    root.present()?;
    drop(chart);
    drop(root);
    Ok(())
}

fn short(value: &f64) -> String {
    match value {
        0.01..1000.0 => format!("{value:.4}").trim_end_matches('0').trim_end_matches('.').to_string(),
        _ => format!("{value:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(chain: &str, ms: f64, error_px: f64) -> Point<'_> {
        Point { chain, label: chain.into(), ms, error_px }
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let points = [
            point("a", 1.0, 8.0),
            point("b", 2.0, 4.0),
            point("c", 3.0, 4.0),
            point("d", 4.0, 1.0),
            point("e", 5.0, 2.0),
        ];
        let names: Vec<&str> = front(&points).iter().map(|point| point.chain).collect();
        assert_eq!(names, ["a", "b", "d"]);
        // of two equal points both are on it
        assert_eq!(front(&[point("a", 1.0, 1.0), point("b", 1.0, 1.0)]).len(), 2);
    }

    /// (An axis to the end of all numbers would never be drawn.)
    #[test]
    fn what_has_no_place_is_left_out_and_the_widest_plot_ends() {
        for value in [f64::NAN, f64::INFINITY, -1.0, 1e308] {
            assert_eq!(placed(value, SMALLEST_MS), None, "{value}");
        }
        assert_eq!(placed(0.0, SMALLEST_MS), Some(SMALLEST_MS));
        let mut text = String::new();
        draw(&mut text, "title", &[point("a", SMALLEST_MS, SMALLEST_PX), point("a", LARGEST, LARGEST)]).unwrap();
        assert_eq!(text.matches("<circle").count(), 2);
    }

    #[test]
    fn decades_are_equally_wide_and_high() {
        let points = [point("a", 1.0, 0.01), point("a", 10.0, 0.1), point("a", 100.0, 1.0)];
        let mut text = String::new();
        draw(&mut text, "title", &points).unwrap();
        let number = |part: &str, name: &str| -> f64 {
            part.split_once(&format!("{name}=\"")).unwrap().1.split('"').next().unwrap().parse().unwrap()
        };
        let circles: Vec<(f64, f64)> =
            text.split("<circle").skip(1).map(|part| (number(part, "cx"), number(part, "cy"))).collect();
        assert_eq!(circles.len(), 3, "{text}");
        let steps: Vec<(f64, f64)> =
            circles.windows(2).map(|pair| (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1)).collect();
        // more time is to the right, more error up; places are whole pixels
        assert!(steps[0].0 > 100.0 && (steps[0].0 - steps[1].0).abs() <= 1.0, "{steps:?}");
        assert!(steps[0].1 < -50.0 && (steps[0].1 - steps[1].1).abs() <= 1.0, "{steps:?}");
    }
}
