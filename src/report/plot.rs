//! Error against run time as SVG, for papers: a panel a scene, a curve a chain, log axes, the front highlighted.

use plotters::coord::Shift;
use plotters::coord::combinators::BindKeyPoints;
use plotters::prelude::*;

use super::records::{Record, Results};
use super::standing::{self, Group, Point, Standing};
use crate::experiment::diagnostic::Diagnostic;

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

/// Columns and rows of the picture that one panel has, if there is only one, and if there are several.
const ONE_PANEL: (u32, u32) = (880, 560);
const PANEL: (u32, u32) = (520, 400);
const PANELS_IN_A_ROW: usize = 3;
/// Scenes that a plot can show.
const MOST_PANELS: usize = 24;
/// Names stand to the right of all panels, where they hide nothing: what a name takes, with its line and for each of its letters.
const LINE_WIDTH: u32 = 44;
const LETTER_WIDTH: u32 = 8;
const TITLE_HEIGHT: u32 = 34;

/// Which figures are plotted, and what the axes are called.
#[derive(Clone, Copy, Debug)]
pub struct Axes<'a> {
    pub error: &'a str,
    pub error_title: &'a str,
    pub cost: &'a str,
    pub cost_title: &'a str,
    /// A line is drawn at this error.
    pub target: Option<f64>,
}

/// One scene.
struct Panel<'a> {
    title: &'a str,
    records: &'a [Record],
    points: Vec<Point>,
}

type Error = Box<dyn std::error::Error>;

/// The plot as SVG text, or `None` if no record has an error and a time.
pub fn svg(title: &str, results: &Results, axes: &Axes) -> Result<Option<String>, Diagnostic> {
    let standing = Standing::of(results);
    let panels: Vec<Panel> = standing.groups.iter().map(|group| panel(results, group, axes)).collect();
    let mut panels: Vec<Panel> = panels.into_iter().filter(|panel| !panel.points.is_empty()).collect();
    if panels.is_empty() {
        return Ok(None);
    }
    let (title, scenes) = (title.to_string(), panels.len());
    let title = if scenes > MOST_PANELS { format!("{title} ({MOST_PANELS} of {scenes} scenes)") } else { title };
    panels.truncate(MOST_PANELS);
    let mut chains: Vec<&str> = Vec::new();
    for point in panels.iter().flat_map(|panel| &panel.points) {
        let chain = results.records[point.record].head.chain.as_str();
        if !chains.contains(&chain) {
            chains.push(chain);
        }
    }
    let mut text = String::new();
    let drawn = Drawing { title: &title, panels, chains, axes }.draw(&mut text);
    drawn.map_err(|error| Diagnostic::run(format!("the plot cannot be drawn: {error}")))?;
    Ok(Some(text))
}

fn panel<'a>(results: &'a Results, group: &'a Group, axes: &Axes) -> Panel<'a> {
    let placed = |point: Point| {
        let (cost, error) = (placed(point.cost, SMALLEST_MS)?, placed(point.error, SMALLEST_PX)?);
        Some(Point { cost, error, ..point })
    };
    let points = standing::points(results, group, axes.error, axes.cost).into_iter().filter_map(placed).collect();
    Panel { title: &group.label, records: &results.records, points }
}

/// Where a number is on its axis, if it has a place there.
fn placed(value: f64, smallest: f64) -> Option<f64> {
    (0.0..=LARGEST).contains(&value).then_some(value.max(smallest))
}

struct Drawing<'a> {
    title: &'a str,
    panels: Vec<Panel<'a>>,
    chains: Vec<&'a str>,
    axes: &'a Axes<'a>,
}

type Area<'t> = DrawingArea<SVGBackend<'t>, Shift>;

impl Drawing<'_> {
    fn draw(&self, text: &mut String) -> Result<(), Error> {
        let columns = self.panels.len().min(PANELS_IN_A_ROW);
        let rows = self.panels.len().div_ceil(columns);
        let (width, height) = if self.panels.len() == 1 { ONE_PANEL } else { PANEL };
        let (width, height) = (width * columns as u32, height * rows as u32);
        let longest = self.chains.iter().map(|chain| chain.chars().count() as u32).max().unwrap_or(0);
        let names_width = LINE_WIDTH + LETTER_WIDTH * longest.max(12);
        let root = SVGBackend::with_string(text, (width + names_width, TITLE_HEIGHT + height)).into_drawing_area();
        root.fill(&WHITE)?;
        let (plots, names) = root.split_horizontally(width);
        let (head, plots) = plots.split_vertically(TITLE_HEIGHT);
        head.draw(&Text::new(self.title, (16, 10), ("sans-serif", 20)))?;
        let (costs, errors) = (self.range(|point| point.cost), self.range(|point| point.error));
        for (panel, area) in self.panels.iter().zip(plots.split_evenly((rows, columns))) {
            self.panel(panel, &area, &costs, &errors)?;
        }
        self.names(&names)?;
        root.present()?;
        Ok(())
    }

    /// What all panels have in common can be compared between them.
    fn range(&self, pick: fn(&Point) -> f64) -> std::ops::Range<f64> {
        let values = self.panels.iter().flat_map(|panel| &panel.points).map(pick);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
        low / 1.6..high * 1.6
    }

    fn colour(&self, chain: &str) -> RGBColor {
        COLOURS[self.chains.iter().position(|known| *known == chain).unwrap_or(0) % COLOURS.len()]
    }

    fn panel(
        &self,
        panel: &Panel,
        area: &Area,
        costs: &std::ops::Range<f64>,
        errors: &std::ops::Range<f64>,
    ) -> Result<(), Error> {
        let axis = |range: &std::ops::Range<f64>| {
            let range = range.clone();
            let ticks = ticks(&range);
            range.log_scale().with_key_points(ticks.clone()).with_light_points(ticks)
        };
        let mut builder = ChartBuilder::on(area);
        builder.margin(12).x_label_area_size(44).y_label_area_size(68);
        if !panel.title.is_empty() {
            builder.caption(panel.title, ("sans-serif", 15));
        }
        let mut chart = builder.build_cartesian_2d(axis(costs), axis(errors))?;
        chart
            .configure_mesh()
            .x_desc(self.axes.cost_title)
            .y_desc(self.axes.error_title)
            .light_line_style(RGBColor(240, 240, 240))
            .bold_line_style(RGBColor(225, 225, 225))
            .label_style(("sans-serif", 13))
            .x_label_formatter(&short)
            .y_label_formatter(&short)
            .draw()?;
        if let Some(target) = self.axes.target.filter(|target| errors.contains(target)) {
            let line = [(costs.start, target), (costs.end, target)];
            chart.draw_series(DashedLineSeries::new(line, 6, 4, RGBColor(120, 120, 120).stroke_width(1)))?;
        }
        let front = standing::front(&panel.points);
        chart
            .draw_series(LineSeries::new(front.iter().map(|point| (point.cost, point.error)), FRONT.stroke_width(9)))?;
        for chain in &self.chains {
            let colour = self.colour(chain);
            let own = |point: &&Point| panel.records[point.record].head.chain == *chain;
            let points: Vec<Point> = panel.points.iter().filter(own).copied().collect();
            for curve in standing::curves(panel.records, &points) {
                let line = curve.iter().map(|point| (point.cost, point.error));
                chart.draw_series(LineSeries::new(line, colour.mix(0.5).stroke_width(1)))?;
            }
            let whisker = |point: &Point| {
                let record = &panel.records[point.record];
                let spread = if self.axes.cost == "frame_ms" { record.frame() } else { record.method() };
                let is_time = matches!(self.axes.cost, "frame_ms" | "method_ms");
                let ends = spread.filter(|_| is_time).map(|spread| [spread.lower_quartile, spread.upper_quartile]);
                ends.map(|ends| PathElement::new(ends.map(|ms| (ms.max(SMALLEST_MS), point.error)), colour.mix(0.6)))
            };
            chart.draw_series(points.iter().filter_map(whisker))?;
            let (faulty, sound): (Vec<Point>, Vec<Point>) = points.iter().partition(|point| point.is_faulty);
            let place = |point: &Point| (point.cost, point.error);
            let (low, sound): (Vec<Point>, Vec<Point>) = sound.iter().partition(|point| point.error <= SMALLEST_PX);
            chart.draw_series(sound.iter().map(|point| Circle::new(place(point), 3, colour.filled())))?;
            chart.draw_series(low.iter().map(|point| Circle::new(place(point), 3, colour.stroke_width(1))))?;
            chart.draw_series(faulty.iter().map(|point| Cross::new(place(point), 4, colour.stroke_width(1))))?;
        }
        // only what is on the front has a name, and only where names do not lie on one another
        let mut named: Vec<(i32, i32)> = Vec::new();
        for point in &front {
            let at = chart.backend_coord(&(point.cost, point.error));
            if named.iter().any(|other| (other.0 - at.0).abs() < 110 && (other.1 - at.1).abs() < 13) {
                continue;
            }
            named.push(at);
            let head = &panel.records[point.record].head;
            let label = head.label_in_scene();
            let style = ("sans-serif", 11).into_font().color(&self.colour(&head.chain));
            chart.draw_series([Text::new(label, (point.cost * 1.06, point.error * 1.5), style)])?;
        }
        Ok(())
    }

    fn names(&self, names: &Area) -> Result<(), Error> {
        let chains = self.chains.iter().map(|chain| (*chain, self.colour(chain), 2));
        for ((name, colour, width), y) in std::iter::once(("front", FRONT, 9)).chain(chains).zip((60..).step_by(24)) {
            names.draw(&PathElement::new([(0, y), (20, y)], colour.stroke_width(width)))?;
            names.draw(&Text::new(name, (28, y - 7), ("sans-serif", 14)))?;
        }
        let mut y = 60 + 24 * (self.chains.len() as i32 + 1);
        let has = |what: fn(&Point) -> bool| self.panels.iter().flat_map(|panel| &panel.points).any(what);
        if has(|point| point.is_faulty) {
            names.draw(&Cross::new((10, y), 4, BLACK.stroke_width(1)))?;
            names.draw(&Text::new("faulty", (28, y - 7), ("sans-serif", 14)))?;
            y += 24;
        }
        if has(|point| point.error <= SMALLEST_PX) {
            names.draw(&Circle::new((10, y), 3, BLACK.stroke_width(1)))?;
            names.draw(&Text::new(format!("<= {SMALLEST_PX}"), (28, y - 7), ("sans-serif", 14)))?;
        }
        Ok(())
    }
}

/// Places of the ticks of a logarithmic axis: 1, 2 and 5 of each decade, decades alone where there are many, and at least three.
fn ticks(range: &std::ops::Range<f64>) -> Vec<f64> {
    let decades = (range.start.log10().floor() as i32)..=(range.end.log10().ceil() as i32);
    let of = |digits: &[f64]| -> Vec<f64> {
        let all = decades.clone().flat_map(|decade| digits.iter().map(move |digit| digit * 10f64.powi(decade)));
        all.filter(|tick| range.contains(tick)).collect()
    };
    let span = (range.end / range.start).log10();
    let coarse = if span > 5.0 { of(&[1.0]) } else { of(&[1.0, 2.0, 5.0]) };
    match coarse.len() {
        0..3 => of(&[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0]),
        _ => coarse,
    }
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

    /// (An axis to the end of all numbers would never be drawn.)
    #[test]
    fn what_has_no_place_is_left_out() {
        for value in [f64::NAN, f64::INFINITY, -1.0, 1e308] {
            assert_eq!(placed(value, SMALLEST_MS), None, "{value}");
        }
        assert_eq!(placed(0.0, SMALLEST_MS), Some(SMALLEST_MS));
    }

    #[test]
    fn an_axis_has_ticks_however_short_it_is() {
        for (from, to) in [(1.0, 1000.0), (3.0, 9.0), (61.0, 160.0), (1.1, 2.9), (SMALLEST_MS, LARGEST)] {
            let ticks = ticks(&(from..to));
            assert!((3..=20).contains(&ticks.len()), "{from}..{to}: {ticks:?}");
        }
    }
}
