//! A report -> an SVG: the learning curve of each setting, error over CPU time.
//!
//! One panel for the pipeline and one for the trainer. CPU time of making the scenes and of training grows to the right, in its logarithm;
//! the balanced error grows upwards, so that better is to the lower left. The reference is drawn thick, with the intervals of its sizes;
//! a setting has the colour of its knob and stands out where it is told apart from the reference; what was followed to more scenes goes on to them. The broad band is the front of the
//! pipeline's settings, the ring what is recommended. Settings that are told apart, and those that the front passes through at two sizes and more, are named.

use super::front::front;
use super::report::{CurveRow, Recommendation, Report, Row, Told, WorthRow};
use super::settings::{Group, OTHER_DRAWS, Side};
use crate::chart::{self, Axis, Colour, Marks, Panel, Point, Series};
use crate::math;

const PANEL: (u32, u32) = (920, 600);
/// Pixels from the foot of a panel's axis to its head.
const PLOT_PX: f64 = 456.0;
/// Pixels between a point and its name, and between two names.
const CLEAR_PX: f64 = 12.0;
const LINE_PX: f64 = 15.0;
const BLACK: Colour = Colour(0, 0, 0);
const GREY: Colour = Colour(150, 150, 150);
/// One colour a knob, told apart by people who see few.
const COLOURS: [Colour; 7] = [
    Colour(230, 159, 0),
    Colour(0, 114, 178),
    Colour(0, 158, 115),
    Colour(213, 94, 0),
    Colour(86, 180, 233),
    Colour(204, 121, 167),
    Colour(120, 94, 40),
];

/// `None` where nothing could be trained.
pub(crate) fn svg(report: &Report) -> Option<String> {
    let sides = [
        (Side::Pipeline, "the pipeline", &report.recommended_pipeline),
        (Side::Trainer, "the trainer", &report.recommended_filter),
    ];
    let panels: Vec<Panel> = sides
        .into_iter()
        .filter_map(|(side, title, recommended)| {
            let curves: Vec<&Row> = report.side(side).filter(|row| row.worth.is_some()).collect();
            let title = format!("{}: {title}, learning curves", report.name);
            let on_front = if side == Side::Pipeline { front(report) } else { Vec::new() };
            (!curves.is_empty()).then(|| panel(title, &report.judged_by(), &curves, on_front, recommended.as_ref()))
        })
        .collect();
    (!panels.is_empty()).then(|| chart::svg(PANEL, &panels))
}

fn sizes(row: &Row) -> impl DoubleEndedIterator<Item = &CurveRow> {
    row.worth.iter().flat_map(WorthRow::sizes)
}

fn error(size: &CurveRow) -> f64 {
    100.0 * (1.0 - size.balanced_accuracy.mean)
}

fn at(size: &CurveRow) -> Point {
    (size.cpu_s(), error(size))
}

fn panel(
    title: String,
    judged_by: &str,
    rows: &[&Row],
    front: Vec<(&Row, &CurveRow)>,
    recommended: Option<&Recommendation>,
) -> Panel {
    let all = || rows.iter().flat_map(|row| sizes(row));
    let reference = rows[0];
    let interval = |size: &CurveRow| {
        let half_width =
            Some(100.0 * size.balanced_accuracy.half_width).filter(|width| width.is_finite()).unwrap_or(0.0);
        (size.cpu_s(), (error(size) - half_width).max(0.3 * error(size)), error(size) + half_width)
    };
    let intervals: Vec<_> = sizes(reference).map(interval).collect();
    let ends = intervals.iter().flat_map(|&(_, low, high)| [low, high]);
    let errors: Vec<f64> = all().map(error).chain(ends).collect();
    let costs = || all().map(CurveRow::cpu_s);
    let (least, most) = (costs().fold(f64::INFINITY, f64::min), costs().fold(f64::NEG_INFINITY, f64::max));
    // Names stand to the right of the last points.
    let cost_range = 0.85 * least..most * math::pow(most / least, 0.28).max(1.2);

    let mut groups: Vec<Group> = rows.iter().filter_map(|row| row.group).collect();
    groups.dedup();
    let colour = |row: &Row| match row.group.and_then(|group| groups.iter().position(|other| *other == group)) {
        Some(k) => COLOURS[k % COLOURS.len()],
        None => GREY,
    };
    let mut series = Vec::new();
    if front.len() > 1 {
        let band = Marks::Line(front.iter().map(|(_, size)| at(size)).collect(), 9);
        series.push(Series::named("front: no other is both cheaper and better", GREY, band).with_opacity(0.35));
    }
    let mut named = Vec::new();
    for row in rows.iter().skip(1) {
        let is_apart = matches!(row.told(), Some(Told::Better | Told::Worse));
        let opacity = if is_apart { 1.0 } else { 0.45 };
        let line = Marks::Line(sizes(row).map(at).collect(), if is_apart { 2 } else { 1 });
        let name = row.group.map_or(OTHER_DRAWS, Group::name);
        let is_first = !named.contains(&name);
        named.extend(is_first.then_some(name));
        let curve = if is_first { Series::named(name, colour(row), line) } else { Series::unnamed(colour(row), line) };
        series.push(curve.with_opacity(opacity));
        let dots = Marks::Dots(sizes(row).map(at).collect(), 3);
        series.push(Series::unnamed(colour(row), dots).with_opacity(opacity));
    }
    series.push(Series::unnamed(BLACK, Marks::Intervals(intervals)).with_opacity(0.6));
    series.push(Series::named(reference.name.clone(), BLACK, Marks::Line(sizes(reference).map(at).collect(), 3)));
    series.push(Series::unnamed(BLACK, Marks::Dots(sizes(reference).map(at).collect(), 4)));
    let chosen = recommended.map(|of| (of.cpu_s, 100.0 * (1.0 - of.balanced_accuracy.mean)));
    if let (Some(of), Some(point)) = (recommended, chosen) {
        let name = format!("recommended: {} (how many scenes of it: plan --hours)", of.name);
        series.push(Series::named(name, BLACK, Marks::Rings(vec![point], 10)));
    }
    let y = Axis::of_values(format!("balanced error on {judged_by}, %"), errors.iter().copied());
    series.push(Series::unnamed(BLACK, Marks::Words(names(rows, &front, &y))));
    Panel { title, x: Axis::durations("CPU time of generating and training", cost_range), y, series }
}

/// Names of the settings that are told apart or stand on the front at two sizes and more, at their last points: of those that are worse above these, of the others below, away from the
/// reference, which the legend names. Those that would stand on another's are moved on.
fn names(rows: &[&Row], front: &[(&Row, &CurveRow)], y: &Axis) -> Vec<(Point, i32, String)> {
    let is_worse = |row: &Row| row.told() == Some(Told::Worse);
    let is_named = |row: &Row| {
        // One size alone stands there by the luck of its trainings.
        let sizes_on_front = front.iter().filter(|(other, _)| other.label() == row.label()).count();
        row.told() == Some(Told::Better) || (sizes_on_front > 1 && row.group.is_some())
    };
    let of = |is_of: &dyn Fn(&Row) -> bool, away: f64| {
        let end = |row: &&Row| Some((at(sizes(row).next_back()?), row.name.clone()));
        let mut ends: Vec<(Point, String)> = rows.iter().filter(|row| is_of(row)).filter_map(end).collect();
        ends.sort_by(|a, b| (away * a.0.1).total_cmp(&(away * b.0.1)));
        let mut last = f64::NEG_INFINITY;
        let moved = ends.into_iter().map(move |(point, name)| {
            let own = away * y.position(point.1) * PLOT_PX;
            let at = (own + CLEAR_PX).max(last + LINE_PX);
            last = at;
            (point, (away * (at - own)) as i32, name)
        });
        moved.collect::<Vec<_>>()
    };
    [of(&|row| is_named(row) && !is_worse(row), -1.0), of(&is_worse, 1.0)].concat()
}
