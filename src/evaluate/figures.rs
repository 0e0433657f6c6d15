//! A report -> figures as SVG text: confusion matrix (figure 9), error against density and range and by place (figure 13), ROC,
//! reliability.

use super::places::{FEWEST_CELLS, PlacesReport, Square};
use super::report::{Report, SpreadReport};
use super::spread::Bin;
use super::table::thousands;
use crate::chart::{self, Axis, Colour, Field, Marks, Panel, Point, Series, ShadedTable};

const FALSE: Colour = Colour(0xd9, 0x7b, 0x29);
const MISSED: Colour = Colour(0xb0, 0x1e, 0x3c);
const NETWORK: Colour = Colour(0x1f, 0x5f, 0xa8);
const BLACK: Colour = Colour(0, 0, 0);
const BASELINE: Colour = Colour(0x80, 0x80, 0x80);

/// Names and SVG texts of all figures that the report has numbers for.
pub(crate) fn figures(report: &Report) -> Vec<(&'static str, String)> {
    let mut all: Vec<_> = confusion(report).map(|table| ("confusion.svg", table.svg())).into_iter().collect();
    let points = spread(&report.points_per_cell, "Error against points per cell", "points in the cell", point_label);
    all.push(("error-against-points.svg", chart::svg((760, 470), &[points])));
    let range = spread(&report.range_m, "Error against range", "range, m", range_label);
    all.push(("error-against-range.svg", chart::svg((760, 470), &[range])));
    all.extend(report.places.as_ref().map(|places| ("error-by-place.svg", chart::maps_svg(620, &maps(places)))));
    if !report.roc.is_empty() {
        all.extend(roc(report).map(|panel| ("roc.svg", chart::svg((540, 570), &[panel]))));
    }
    all.extend(reliability(report).map(|panel| ("reliability.svg", chart::svg((540, 570), &[panel]))));
    all
}

/// Four fields, shaded by the share of their row.
fn confusion(report: &Report) -> Option<ShadedTable> {
    let at = report.groups.first()?.network.at.first()?;
    let counts = at.cells.counts;
    let rows = [
        ("traversable", [counts.true_traversable, counts.false_untraversable], counts.traversable()),
        ("untraversable", [counts.missed_untraversable, counts.true_untraversable], counts.untraversable()),
    ];
    let rows = rows.into_iter().enumerate().map(|(row, (name, fields, whole))| {
        let field = |(column, count): (usize, u64)| {
            let share = if whole > 0 { count as f64 / whole as f64 } else { 0.0 };
            let colour = if row == column { NETWORK } else { MISSED };
            Field { words: thousands(count), detail: format!("{:.2} % of its row", 100.0 * share), colour, share }
        };
        (format!("truly\n{name}"), fields.into_iter().enumerate().map(field).collect())
    });
    Some(ShadedTable {
        title: format!("Cells of {}, {} split", report.data.name, report.data.split),
        subtitle: format!("untraversable from an output of {:.3} on", at.threshold.value),
        columns: ["called traversable", "called untraversable"].map(String::from).to_vec(),
        rows: rows.collect(),
    })
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
fn spread(report: &SpreadReport, title: &str, axis: &str, label: impl Fn(&Bin) -> String) -> Panel {
    let rho = report.rho_wrong.map_or(String::new(), |rho| format!("  (Spearman's rho with being wrong {rho:.3})"));
    let bars = |left: f64, rate: fn(&Bin) -> Option<f64>| {
        let bar = |(k, bin): (usize, &Bin)| {
            let from = k as f64 + left;
            (from, from + 0.36, 100.0 * rate(bin).unwrap_or(0.0))
        };
        Marks::Bars(report.bins.iter().enumerate().map(bar).collect())
    };
    let rates = report.bins.iter().flat_map(|bin| [bin.rates.false_untraversable, bin.rates.missed_untraversable]);
    let highest = rates.flatten().fold(0.0f64, f64::max).max(0.01);
    Panel {
        title: format!("{title}{rho}"),
        x: Axis::categories(axis, report.bins.iter().map(label)),
        y: Axis::linear("wrong, % of the class", 0.0..100.0 * highest * 1.08),
        series: vec![
            Series::named("false_untraversable", FALSE, bars(0.12, |bin| bin.rates.false_untraversable)),
            Series::named("missed_untraversable", MISSED, bars(0.50, |bin| bin.rates.missed_untraversable)),
        ],
    }
}

/// Shades of a map, the lightest first: up to which value, in its unit.
const RATES: [f64; 7] = [0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5];
const DENSITIES: [f64; 6] = [2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

/// Seen from above, the rover looking up: points a cell, false alarms, and what is missed. As in the paper's figure 13, dark is dense, and wrong.
fn maps(places: &PlacesReport) -> [Panel; 3] {
    let percent = |shade: usize| match RATES.get(shade) {
        Some(0.0) => "none".into(),
        Some(to) => format!("to {:.0} %", 100.0 * to),
        None => format!("above {:.0} %", 100.0 * RATES[shade - 1]),
    };
    let points = |shade: usize| match DENSITIES.get(shade) {
        Some(to) => format!("to {to}"),
        None => format!("above {}", DENSITIES[shade - 1]),
    };
    let density =
        |square: &Square| (square.cells.total() > 0).then(|| square.points as f64 / square.cells.total() as f64);
    let rate = |part: u64, whole: u64| (whole >= FEWEST_CELLS).then(|| part as f64 / whole as f64);
    [
        map(places, "Points a cell", NETWORK, &DENSITIES, points, density),
        map(places, "False alarms, of the traversable cells", FALSE, &RATES, percent, |square| {
            rate(square.cells.false_untraversable, square.cells.traversable())
        }),
        map(places, "Missed, of the untraversable cells", MISSED, &RATES, percent, |square| {
            rate(square.cells.missed_untraversable, square.cells.untraversable())
        }),
    ]
}

/// Squares shaded by a value; those that have none are grey where they hold a cell.
fn map(
    places: &PlacesReport,
    title: &str,
    colour: Colour,
    steps: &[f64],
    name: impl Fn(usize) -> String,
    value: impl Fn(&Square) -> Option<f64>,
) -> Panel {
    let side_m = places.square_m;
    // The rover's right is the picture's.
    let tile = |square: &Square| [(-square.left_m - side_m, square.ahead_m), (-square.left_m, square.ahead_m + side_m)];
    let mut shades = vec![Vec::new(); steps.len() + 1];
    let mut unknown = Vec::new();
    for square in &places.squares {
        match value(square) {
            Some(value) => shades[steps.partition_point(|&step| step < value)].push(tile(square)),
            None => unknown.push(tile(square)),
        }
    }
    let mut series = Vec::new();
    if !unknown.is_empty() {
        let words = format!("fewer than {FEWEST_CELLS} cells");
        series.push(Series::named(words, BASELINE, Marks::Tiles(unknown)).with_opacity(0.16));
    }
    for (shade, tiles) in shades.into_iter().enumerate().filter(|(_, tiles)| !tiles.is_empty()) {
        let opacity = 0.08 + 0.92 * shade as f64 / steps.len() as f64;
        series.push(Series::named(name(shade), colour, Marks::Tiles(tiles)).with_opacity(opacity));
    }
    let nose =
        Marks::Line(vec![(-0.5 * side_m, 0.0), (0.0, 1.2 * side_m), (0.5 * side_m, 0.0), (-0.5 * side_m, 0.0)], 2);
    series.push(Series::unnamed(BLACK, nose));
    let ends = |low: fn(&Square) -> f64| {
        let lows = places.squares.iter().map(low);
        let (least, most) = lows.fold((0.0f64, 0.0f64), |(least, most), low| (least.min(low), most.max(low)));
        least..most + side_m
    };
    let (ahead, left) = (ends(|square| square.ahead_m), ends(|square| square.left_m));
    Panel {
        title: format!("{title}, by place: squares of {side_m} m"),
        x: Axis::linear("to the right of the rover, m", -left.end..-left.start),
        y: Axis::linear("ahead of it, m", ahead),
        series,
    }
}

/// Both curves; the network's thresholds as dots.
fn roc(report: &Report) -> Option<Panel> {
    let all = report.groups.first()?;
    let place = |false_untraversable: f64, missed: f64| (100.0 * false_untraversable, 100.0 * (1.0 - missed));
    let mut series =
        vec![Series::unnamed(BASELINE, Marks::Line(vec![(0.0, 0.0), (100.0, 100.0)], 1)).with_opacity(0.4)];
    for (name, colour, auc, curve) in [
        ("network", NETWORK, all.network.auc, &report.roc),
        ("height difference", FALSE, all.height_difference.auc, &report.roc_height_difference),
    ] {
        let auc = auc.map_or(String::new(), |auc| format!(", AUC {auc:.4}"));
        let points = curve.iter().map(|p| place(p.false_untraversable, p.missed_untraversable)).collect();
        series.push(Series::named(format!("{name}{auc}"), colour, Marks::Line(points, 2)));
    }
    let rates = all.network.at.iter().map(|at| at.cells.rates);
    let thresholds: Vec<Point> =
        rates.filter_map(|rates| Some(place(rates.false_untraversable?, rates.missed_untraversable?))).collect();
    series.push(Series::unnamed(NETWORK, Marks::Dots(thresholds, 4)));
    Some(Panel {
        title: "Who is called untraversable".into(),
        x: Axis::linear("of the traversable, %  (false_untraversable)", 0.0..100.0),
        y: Axis::linear("of the untraversable, %", 0.0..100.0),
        series,
    })
}

/// What the probabilities promise against what came true, bin by bin.
fn reliability(report: &Report) -> Option<Panel> {
    let of = report.groups.first()?.probabilities.as_ref()?;
    let points: Vec<Point> =
        of.bins.iter().map(|bin| (100.0 * bin.mean_probability, 100.0 * bin.untraversable_share)).collect();
    let error = 100.0 * of.expected_calibration_error;
    Some(Panel {
        title: format!("What probabilities are worth: off by {error:.2} points in the mean"),
        x: Axis::linear("probability given, %", 0.0..100.0),
        y: Axis::linear("untraversable, % of the cells", 0.0..100.0),
        series: vec![
            Series::unnamed(BASELINE, Marks::Line(vec![(0.0, 0.0), (100.0, 100.0)], 1)).with_opacity(0.4),
            Series::unnamed(NETWORK, Marks::Line(points.clone(), 2)),
            Series::unnamed(NETWORK, Marks::Dots(points, 4)),
        ],
    })
}
