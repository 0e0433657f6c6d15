//! A report -> an SVG: what each setting costs over what it loses, the Pareto front drawn through.
//!
//! One panel for the pipeline and one for the trainer. Cost grows to the right, in its logarithm; loss grows upwards, so that better is
//! to the lower left. Bars are the intervals of the loss; the front runs through their upper ends, by which it is judged. Settings on the
//! front bear their names.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::report::{Report, Row};
use super::settings::Side;

const PANEL: (u32, u32) = (920, 560);
const FRONT: RGBColor = RGBColor(60, 60, 60);
/// One colour a knob, told apart by people who see few.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(204, 121, 167),
    RGBColor(150, 150, 150),
];

type Fault = Box<dyn std::error::Error>;

struct Point<'a> {
    row: &'a Row,
    cost: f64,
    /// Points of balanced accuracy.
    loss: f64,
    half_width: f64,
}

/// `None` where no setting has both a cost and a loss.
pub fn svg(report: &Report) -> Option<String> {
    let panels: Vec<(&str, &str, Vec<Point>)> = [
        (Side::Pipeline, "the pipeline", "CPU a kept scan, ms"),
        (Side::Trainer, "the trainer", "CPU a row learnt, us"),
    ]
    .into_iter()
    .map(|(side, title, unit)| (title, unit, points(report, side)))
    .filter(|(.., points)| !points.is_empty())
    .collect();
    if panels.is_empty() {
        return None;
    }
    let mut text = String::new();
    draw(&mut text, report, &panels).ok()?;
    Some(text)
}

fn points(report: &Report, side: Side) -> Vec<Point<'_>> {
    let of = |row| -> Option<Point> {
        let row: &Row = row;
        let (cost, loss) = (row.cost()?, row.loss()?);
        let half_width = if loss.half_width.is_finite() { loss.half_width } else { 0.0 };
        (cost > 0.0).then_some(Point { row, cost, loss: 100.0 * loss.mean, half_width: 100.0 * half_width })
    };
    report.side(side).filter_map(of).collect()
}

fn draw(text: &mut String, report: &Report, panels: &[(&str, &str, Vec<Point>)]) -> Result<(), Fault> {
    let area = SVGBackend::with_string(text, (PANEL.0, PANEL.1 * panels.len() as u32)).into_drawing_area();
    area.fill(&WHITE)?;
    for (part, (title, unit, points)) in area.split_evenly((panels.len(), 1)).iter().zip(panels) {
        panel(part, &format!("{}: {title}", report.name), unit, points, 100.0 * report.max_loss)?;
    }
    area.present()?;
    Ok(())
}

fn panel(
    area: &DrawingArea<SVGBackend, Shift>,
    title: &str,
    unit: &str,
    points: &[Point],
    max_loss: f64,
) -> Result<(), Fault> {
    let least = |value: &dyn Fn(&Point) -> f64| points.iter().map(value).fold(f64::INFINITY, f64::min);
    let most = |value: &dyn Fn(&Point) -> f64| points.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    let costs = 0.8 * least(&|p| p.cost)..1.6 * most(&|p| p.cost);
    let (low, high) = (least(&|p| p.loss - p.half_width), most(&|p| p.loss + p.half_width).max(max_loss));
    let margin = 0.06 * (high - low).max(0.1);
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 18))
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(costs.clone().log_scale().base(2.0), low - margin..high + margin)?;
    chart
        .configure_mesh()
        .x_desc(unit)
        .y_desc("loss, points of balanced accuracy")
        .light_line_style(WHITE)
        .bold_line_style(FRONT.mix(0.12))
        .x_labels(12)
        .x_label_formatter(&|cost| if *cost >= 10.0 { format!("{cost:.0}") } else { format!("{cost:.1}") })
        .draw()?;
    chart
        .draw_series([PathElement::new(vec![(costs.start, max_loss), (costs.end, max_loss)], FRONT.mix(0.4))])?
        .label(format!("loss of {max_loss} points"))
        .legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], FRONT.mix(0.4)));

    let mut front: Vec<&Point> = points.iter().filter(|point| point.row.on_front).collect();
    front.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    chart
        .draw_series(LineSeries::new(front.iter().map(|p| (p.cost, p.loss + p.half_width)), FRONT.stroke_width(1)))?
        .label("Pareto front")
        .legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], FRONT.stroke_width(1)));

    let mut groups: Vec<_> = points.iter().map(|point| point.row.group).collect();
    groups.dedup();
    for (k, group) in groups.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let own = || points.iter().filter(|point| point.row.group == *group);
        chart.draw_series(own().map(|p| {
            PathElement::new(vec![(p.cost, p.loss - p.half_width), (p.cost, p.loss + p.half_width)], colour.mix(0.5))
        }))?;
        chart
            .draw_series(
                own().map(|p| Circle::new((p.cost, p.loss), if p.row.on_front { 5 } else { 4 }, colour.filled())),
            )?
            .label(group.map_or("reference", |group| group.name()))
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
    }
    // Neighbours on the front are often close: their names stand above and below in turn.
    let name = |(k, p): (usize, &&Point)| {
        let beside = if k % 2 == 0 { 0.6 } else { -0.2 } * margin;
        Text::new(p.row.name.clone(), (1.03 * p.cost, p.loss + beside), ("sans-serif", 13))
    };
    chart.draw_series(front.iter().enumerate().map(name))?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(FRONT.mix(0.3))
        .draw()?;
    Ok(())
}
