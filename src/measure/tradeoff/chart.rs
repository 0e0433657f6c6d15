//! A report -> an SVG: what each setting costs over what it loses, the Pareto front drawn through.
//!
//! One panel for the pipeline and one for the trainer. Cost grows to the right, in its logarithm; loss grows upwards, so that better is
//! to the lower left. Vertical lines are the intervals of the loss. Whether a setting is on the front is judged by their upper ends; the
//! line joins the points themselves, larger and with their names.

use super::report::{Report, Row};
use super::settings::Side;
use crate::chart::{self, Axis, Colour, Marks, Panel, Series};

const PANEL: (u32, u32) = (920, 560);
const FRONT: Colour = Colour(60, 60, 60);
/// One colour a knob, told apart by people who see few.
const COLOURS: [Colour; 8] = [
    Colour(0, 0, 0),
    Colour(230, 159, 0),
    Colour(86, 180, 233),
    Colour(0, 158, 115),
    Colour(213, 94, 0),
    Colour(0, 114, 178),
    Colour(204, 121, 167),
    Colour(150, 150, 150),
];

/// A setting that has both a cost and a loss.
struct Measured<'a> {
    row: &'a Row,
    cost: f64,
    /// Points of balanced accuracy.
    loss: f64,
    half_width: f64,
}

/// `None` where no setting has both a cost and a loss.
pub(crate) fn svg(report: &Report) -> Option<String> {
    let sides = [
        (Side::Pipeline, "the pipeline", "CPU a kept scan, ms"),
        (Side::Trainer, "the trainer", "CPU a row learnt, us"),
    ];
    let panels: Vec<Panel> = sides
        .into_iter()
        .filter_map(|(side, title, unit)| {
            let measured: Vec<Measured> = report.side(side).filter_map(Measured::of).collect();
            let title = format!("{}: {title}", report.name);
            (!measured.is_empty()).then(|| panel(title, unit, &measured, 100.0 * report.max_loss))
        })
        .collect();
    (!panels.is_empty()).then(|| chart::svg(PANEL, &panels))
}

impl Measured<'_> {
    fn of(row: &Row) -> Option<Measured<'_>> {
        let (cost, loss) = (row.cost()?, row.loss()?);
        let half_width = if loss.half_width.is_finite() { loss.half_width } else { 0.0 };
        (cost > 0.0).then_some(Measured { row, cost, loss: 100.0 * loss.mean, half_width: 100.0 * half_width })
    }
}

fn panel(title: String, unit: &str, all: &[Measured], max_loss: f64) -> Panel {
    let least = |value: &dyn Fn(&Measured) -> f64| all.iter().map(value).fold(f64::INFINITY, f64::min);
    let most = |value: &dyn Fn(&Measured) -> f64| all.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    let costs = 0.8 * least(&|m| m.cost)..1.6 * most(&|m| m.cost);
    let (low, high) = (least(&|m| m.loss - m.half_width), most(&|m| m.loss + m.half_width).max(max_loss));
    let margin = 0.06 * (high - low).max(0.1);

    let limit = Marks::Line(vec![(costs.start, max_loss), (costs.end, max_loss)], 1);
    let mut series = vec![Series::named(format!("loss of {max_loss} points"), FRONT, limit).with_opacity(0.4)];
    let mut front: Vec<&Measured> = all.iter().filter(|measured| measured.row.on_front).collect();
    front.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let through = front.iter().map(|measured| (measured.cost, measured.loss)).collect();
    series.push(Series::named("Pareto front", FRONT, Marks::Line(through, 1)));

    let mut groups: Vec<_> = all.iter().map(|measured| measured.row.group).collect();
    groups.dedup();
    for (k, group) in groups.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let own = || all.iter().filter(|measured| measured.row.group == *group);
        let intervals = own().map(|m| (m.cost, m.loss - m.half_width, m.loss + m.half_width)).collect();
        series.push(Series::unnamed(colour, Marks::Intervals(intervals)).with_opacity(0.5));
        let dots = own().map(|m| (m.cost, m.loss)).collect();
        let name = group.map_or("reference", |group| group.name());
        series.push(Series::named(name, colour, Marks::Dots(dots, 4)));
        let on_front = own().filter(|m| m.row.on_front).map(|m| (m.cost, m.loss)).collect();
        series.push(Series::unnamed(colour, Marks::Dots(on_front, 6)));
    }
    // Neighbours on the front are often close: their names stand above and below in turn.
    let name = |(k, m): (usize, &&Measured)| ((m.cost, m.loss), if k % 2 == 0 { 12 } else { -12 }, m.row.name.clone());
    series.push(Series::unnamed(FRONT, Marks::Words(front.iter().enumerate().map(name).collect())));
    Panel {
        title,
        x: Axis::logarithmic(unit, costs),
        y: Axis::linear("loss, points of balanced accuracy", low - margin..high + margin),
        series,
    }
}
