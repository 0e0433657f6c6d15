//! A report -> figures as SVG text: confusion matrix (figure 9), error against density and range (figure 13), ROC.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::report::{Report, SpreadReport};
use super::spread::Bin;
use super::table::thousands;

/// A figure could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("figure {name}: {reason}")]
pub struct FigureError {
    name: &'static str,
    reason: String,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

const FALSE: RGBColor = RGBColor(0xd9, 0x7b, 0x29);
const MISSED: RGBColor = RGBColor(0xb0, 0x1e, 0x3c);
const NETWORK: RGBColor = RGBColor(0x1f, 0x5f, 0xa8);
const BASELINE: RGBColor = RGBColor(0x80, 0x80, 0x80);

/// Names and SVG texts of all figures that the report has numbers for.
pub fn figures(report: &Report) -> Result<Vec<(&'static str, String)>, FigureError> {
    let mut all = vec![
        ("confusion.svg", draw("confusion.svg", (720, 420), |area| confusion(area, report))?),
        (
            "error-against-points.svg",
            draw("error-against-points.svg", (760, 440), |area| {
                spread(area, &report.points_per_cell, "Error against points per cell", "points in the cell", |bin| {
                    point_label(bin)
                })
            })?,
        ),
        (
            "error-against-range.svg",
            draw("error-against-range.svg", (760, 440), |area| {
                spread(area, &report.range_m, "Error against range", "range, m", range_label)
            })?,
        ),
    ];
    if !report.roc.is_empty() {
        all.push(("roc.svg", draw("roc.svg", (520, 520), |area| roc(area, report))?));
    }
    Ok(all)
}

fn draw(name: &'static str, size: (u32, u32), figure: impl FnOnce(&Area) -> Drawn) -> Result<String, FigureError> {
    let failed = |error: Box<dyn std::error::Error>| FigureError { name, reason: error.to_string() };
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE).map_err(|e| failed(e.into()))?;
        figure(&area).map_err(failed)?;
        area.present().map_err(|e| failed(e.into()))?;
    }
    Ok(svg)
}

fn text(area: &Area, words: &str, at: (i32, i32), size: i32, colour: &RGBColor) -> Drawn {
    let style = ("sans-serif", size).into_font().color(colour);
    area.draw(&Text::new(words.to_string(), at, style))?;
    Ok(())
}

/// Four fields, shaded by the share of their row.
fn confusion(area: &Area, report: &Report) -> Drawn {
    let Some(at) = report.groups.first().and_then(|all| all.network.at.first()) else { return Ok(()) };
    let counts = at.cells.counts;
    text(area, &format!("Cells of {}, {} split", report.data.name, report.data.split), (24, 16), 20, &BLACK)?;
    text(area, &format!("untraversable from an output of {:.3} on", at.threshold.value), (24, 42), 15, &BASELINE)?;
    text(area, "called traversable", (235, 78), 16, &BLACK)?;
    text(area, "called untraversable", (470, 78), 16, &BLACK)?;
    let rows = [
        ("traversable", [counts.true_traversable, counts.false_untraversable], counts.traversable()),
        ("untraversable", [counts.missed_untraversable, counts.true_untraversable], counts.untraversable()),
    ];
    for (row, (name, fields, whole)) in rows.into_iter().enumerate() {
        let top = 104 + 150 * row as i32;
        text(area, "truly", (24, top + 50), 16, &BLACK)?;
        text(area, name, (24, top + 70), 16, &BLACK)?;
        for (col, count) in fields.into_iter().enumerate() {
            let left = 190 + 250 * col as i32;
            let share = if whole > 0 { count as f64 / whole as f64 } else { 0.0 };
            let colour = if row == col { NETWORK } else { MISSED };
            let field =
                Rectangle::new([(left, top), (left + 240, top + 140)], colour.mix(0.12 + 0.75 * share).filled());
            area.draw(&field)?;
            let ink = if share > 0.55 { WHITE } else { BLACK };
            text(area, &thousands(count), (left + 24, top + 40), 26, &ink)?;
            text(area, &format!("{:.2} % of its row", 100.0 * share), (left + 24, top + 78), 16, &ink)?;
        }
    }
    Ok(())
}

fn point_label(bin: &Bin) -> String {
    match bin.to {
        Some(to) if to - bin.from <= 1.0 => format!("{}", bin.from),
        Some(to) => format!("{}-{}", bin.from, to - 1.0),
        None => format!("{}+", bin.from),
    }
}

fn range_label(bin: &Bin) -> String {
    bin.to.map_or(format!("{}+", bin.from), |to| format!("{}-{to}", bin.from))
}

/// Two bars a bin: the share of the traversable called untraversable, and of the untraversable missed.
fn spread(area: &Area, report: &SpreadReport, title: &str, axis: &str, label: impl Fn(&Bin) -> String) -> Drawn {
    let rho = report.rho_wrong.map_or(String::new(), |rho| format!("  (Spearman's rho with being wrong {rho:.3})"));
    let bins = &report.bins;
    let rates = bins.iter().flat_map(|bin| [bin.rates.false_untraversable, bin.rates.missed_untraversable]);
    let highest = rates.flatten().fold(0.0f64, f64::max).max(0.01);
    let names: Vec<String> = bins.iter().map(&label).collect();
    let mut chart = ChartBuilder::on(area)
        .caption(format!("{title}{rho}"), ("sans-serif", 18))
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(60)
        .build_cartesian_2d(0.0..bins.len().max(1) as f64, 0.0..100.0 * highest * 1.08)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_desc(axis)
        .y_desc("wrong, % of the class")
        .x_labels(0)
        .y_label_formatter(&|value| format!("{value:.1}"))
        .draw()?;
    for (name, colour, left, rate) in [
        ("false_untraversable", FALSE, 0.12, (|bin| bin.rates.false_untraversable) as fn(&Bin) -> Option<f64>),
        ("missed_untraversable", MISSED, 0.50, |bin| bin.rates.missed_untraversable),
    ] {
        let bar = |(k, bin): (usize, &Bin)| {
            let (x, height) = (k as f64 + left, 100.0 * rate(bin).unwrap_or(0.0));
            Rectangle::new([(x, 0.0), (x + 0.36, height)], colour.filled())
        };
        chart
            .draw_series(bins.iter().enumerate().map(bar))?
            .label(name)
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 12, y + 5)], colour.filled()));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BASELINE)
        .draw()?;
    let style = ("sans-serif", 12).into_font().color(&BLACK);
    for (k, name) in names.iter().enumerate() {
        let (x, y) = chart.backend_coord(&(k as f64 + 0.5, 0.0));
        let centre = plotters::style::text_anchor::Pos::new(
            plotters::style::text_anchor::HPos::Center,
            plotters::style::text_anchor::VPos::Top,
        );
        area.draw(&Text::new(name.clone(), (x, y + 6), style.pos(centre)))?;
    }
    Ok(())
}

fn roc(area: &Area, report: &Report) -> Drawn {
    let Some(all) = report.groups.first() else { return Ok(()) };
    let mut chart = ChartBuilder::on(area)
        .caption("Who is called untraversable", ("sans-serif", 18))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(52)
        .build_cartesian_2d(0.0..100.0, 0.0..100.0)?;
    chart
        .configure_mesh()
        .x_desc("of the traversable, %  (false_untraversable)")
        .y_desc("of the untraversable, %")
        .light_line_style(TRANSPARENT)
        .draw()?;
    chart.draw_series(LineSeries::new([(0.0, 0.0), (100.0, 100.0)], BASELINE.mix(0.4)))?;
    for (name, colour, auc, curve) in [
        ("network", NETWORK, all.network.auc, &report.roc),
        ("height difference", FALSE, all.height_difference.auc, &report.roc_height_difference),
    ] {
        let auc = auc.map_or(String::new(), |auc| format!(", AUC {auc:.4}"));
        let points = curve.iter().map(|p| (100.0 * p.false_untraversable, 100.0 * (1.0 - p.missed_untraversable)));
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
            .label(format!("{name}{auc}"))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], colour.stroke_width(2)));
    }
    for at in &all.network.at {
        let rates = at.cells.rates;
        if let Some((x, missed)) = rates.false_untraversable.zip(rates.missed_untraversable) {
            let place = (100.0 * x, 100.0 * (1.0 - missed));
            chart.draw_series([Circle::new(place, 4, NETWORK.filled())])?;
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BASELINE)
        .draw()?;
    Ok(())
}
