//! A report -> tables for a terminal, and the same in Markdown.

use std::fmt::Write;

use super::report::{ClassifierRow, Report, Row};
use super::settings::Side;
use crate::statistics::{Interval, Spread};

/// Headings, and rows that may be a heading of their own (one cell).
struct Grid {
    title: String,
    head: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

/// For a terminal.
pub(crate) fn text(report: &Report) -> String {
    let mut out = opening(report);
    for grid in grids(report) {
        let _ = write!(out, "\n{}\n\n", grid.title);
        grid.align(&mut out);
    }
    out + "\n" + &closing(report)
}

/// For a page.
pub(crate) fn markdown(report: &Report) -> String {
    let mut out = format!("# Speed against accuracy: {}\n\n{}", report.name, opening(report));
    for grid in grids(report) {
        let _ = write!(out, "\n## {}\n\n", grid.title);
        let _ = writeln!(out, "| {} |\n|{}", grid.head.join(" | ").replace('\n', " "), "---|".repeat(grid.head.len()));
        for row in &grid.rows {
            let _ = writeln!(out, "| {} |", row.join(" | "));
        }
    }
    out + "\n" + &closing(report)
}

fn opening(report: &Report) -> String {
    let reference = report.rows.first().map(|row| row.sets.join(" ")).unwrap_or_default();
    let own: String = report.sets.iter().map(|set| format!(" --set {set}")).collect();
    let ranges = report.rows.iter().find_map(|row| row.pipeline.as_ref()?.ranges.as_ref());
    let beams = ranges.map_or(String::new(), |ranges| format!(", {} beams", ranges.rays));
    format!(
        "{}{own}: {} scenes at {} settings, {} thread{}; reference: {reference}\n\
         CPU: of the thread, per kept scan, median [quartiles] over scenes. Range error: against the exact surface, before\n\
         noise{beams}. Position and heading: of the estimate, median [quartiles] over scans; NEES: its mean. Drive moved:\n\
         the true pose against the reference's, at most. Cells other: only here or only at the reference; labels other: of those\n\
         at both; shift of their features: root mean square, in the reference's standard deviations. Loss: points of balanced\n\
         accuracy on the reference's {} test cells, of a 16-16 network trained at the setting; mean and 95 % interval of {}\n\
         pairs of seeds. *: on the Pareto front of cost over loss, losses at their interval's upper end.\n",
        report.name,
        report.scenes,
        report.rows.iter().filter(|row| row.pipeline.is_some()).count(),
        report.threads,
        if report.threads == 1 { "" } else { "s" },
        report.test_cells,
        report.seeds,
    )
}

fn closing(report: &Report) -> String {
    let mut out = String::new();
    for refused in &report.refused {
        let _ = writeln!(out, "left out: {}: {}: {}", refused.group.name(), refused.name, refused.reason);
    }
    let points = 100.0 * report.max_loss;
    for (what, cheapest, side) in
        [("pipeline", &report.cheapest_pipeline, Side::Pipeline), ("filter", &report.cheapest_filter, Side::Trainer)]
    {
        if report.side(side).next().is_none() {
            continue;
        }
        let row = cheapest.as_ref().and_then(|name| report.side(side).find(|row| row.label() == *name));
        let said = row.and_then(|row| Some((row, row.cost()?, row.loss()?)));
        let Some((row, cost, loss)) = said else {
            let _ =
                writeln!(out, "no {what} is sure to lose at most {points} points: more --seeds or a higher --max-loss");
            continue;
        };
        let unit = if side == Side::Trainer { "us CPU a row" } else { "ms CPU a scan" };
        let sets = if row.sets.is_empty() { "the config as written".to_owned() } else { row.sets.join(" ") };
        let _ = writeln!(
            out,
            "cheapest {what} that loses at most {points} points (at the interval's upper end): {} ({} {unit}, loss {}): {sets}",
            row.label(),
            figures(cost),
            interval(&loss)
        );
    }
    out
}

fn grids(report: &Report) -> Vec<Grid> {
    let yards: Vec<&Row> = report.side(Side::Yard).collect();
    let pipelines: Vec<&Row> = report.side(Side::Pipeline).collect();
    let filters: Vec<&Row> = report.side(Side::Trainer).collect();
    let mut grids = vec![errors("What each setting costs, and the error it brings", &pipelines)];
    if !yards.is_empty() {
        let title = "Changes of the yard and of what is modelled: these are no errors";
        grids.push(errors(title, &yards));
    }
    grids.push(stages(&[pipelines, yards].concat()));
    if !filters.is_empty() {
        grids.push(trainers(&filters));
    }
    grids
}

fn errors(title: &str, rows: &[&Row]) -> Grid {
    let head = vec![
        "setting",
        "CPU\nms",
        "range error, m\nmedian / p99 / max",
        "missed,\ninvented",
        "position\nerror, m",
        "heading\nerror, deg",
        "NEES\n(of 6)",
        "drive\nmoved, m",
        "cells\nother, %",
        "labels\nother, %",
        "worst shift,\nsd",
        "loss,\npoints",
    ];
    let rows = rows.iter().map(|row| {
        let p = row.pipeline.as_ref();
        let ranges = p.and_then(|p| p.ranges.as_ref());
        let pose = p.and_then(|p| p.pose.as_ref());
        let cells = p.and_then(|p| p.cells.as_ref());
        let drive = p.and_then(|p| p.drive.as_ref());
        let share = |part: u64, of: u64| format!("{:.2}", 100.0 * part as f64 / of.max(1) as f64);
        vec![
            marked(row),
            shown(p.and_then(|p| p.cpu_ms), spread),
            shown(ranges, |r| {
                let some = |value: Option<f64>| shown(value, figures);
                format!("{} / {} / {}", some(r.median_m), some(r.p99_m), figures(r.max_m))
            }),
            shown(ranges, |r| format!("{}, {}", r.missed, r.invented)),
            shown(pose.and_then(|pose| pose.position_m), spread),
            shown(pose.and_then(|pose| pose.heading_deg), |s| figures(s.median)),
            shown(pose.and_then(|pose| pose.mean_nees), figures),
            shown(drive.filter(|drive| drive.max_position_m > 0.0), |d| figures(d.max_position_m)),
            shown(cells, |c| share(c.vanished + c.appeared, c.matched + c.vanished)),
            shown(cells, |c| format!("{:.2}", 100.0 * c.other_label)),
            shown(cells, |c| {
                if c.worst_shift_sd > 0.0 {
                    format!("{} {}", figures(c.worst_shift_sd), c.worst_feature)
                } else {
                    "0".into()
                }
            }),
            lost(row),
        ]
    });
    Grid { title: title.into(), rows: rows.collect(), head }
}

fn stages(rows: &[&Row]) -> Grid {
    let head = vec!["setting", "scene", "drive", "sweep", "slam", "cells", "all, wall", "rays"];
    let rows = rows.iter().filter_map(|row| {
        let p = row.pipeline.as_ref()?;
        let mut cells = vec![marked(row)];
        cells.extend(p.stages.iter().map(|stage| shown(stage.cpu_ms, spread)));
        cells.push(shown(p.wall_ms, spread));
        cells.push(shown(p.rays_per_scan, |rays| format!("{rays:.0}")));
        Some(cells)
    });
    Grid {
        title: "By stage: milliseconds of CPU a kept scan; of wall, all threads busy; beams cast".into(),
        rows: rows.collect(),
        head,
    }
}

fn trainers(rows: &[&Row]) -> Grid {
    let head = vec!["setting", "CPU us\na row", "rows\nlearnt", "loss,\npoints"];
    let rows = rows.iter().filter_map(|row| {
        let c = row.classifier.as_ref()?;
        Some(vec![
            marked(row),
            shown(c.cpu_us_per_row, spread),
            shown(c.rows_learnt, |s| format!("{:.0}", s.median)),
            lost(row),
        ])
    });
    Grid { title: "The trainer, on the reference's cells".into(), rows: rows.collect(), head }
}

/// The loss; beside a reference's nothing, how good it is.
fn lost(row: &Row) -> String {
    let accuracy =
        row.classifier.as_ref().and_then(ClassifierRow::mean_balanced_accuracy).filter(|_| row.group.is_none());
    let of = accuracy.map_or(String::new(), |accuracy| format!(" of {:.2}", 100.0 * accuracy));
    shown(row.loss(), |loss| interval(&loss) + &of)
}

fn marked(row: &Row) -> String {
    format!("{}{}", if row.on_front { "* " } else { "  " }, row.label())
}

fn shown<T>(value: Option<T>, say: impl FnOnce(T) -> String) -> String {
    value.map_or("-".into(), say)
}

fn spread(spread: Spread) -> String {
    format!("{} [{}, {}]", figures(spread.median), figures(spread.lower_quartile), figures(spread.upper_quartile))
}

/// A loss in points of balanced accuracy.
fn interval(loss: &Interval) -> String {
    if loss.mean == 0.0 && loss.half_width == 0.0 {
        "0".into()
    } else {
        format!("{:+.2} ± {:.2}", 100.0 * loss.mean, 100.0 * loss.half_width)
    }
}

/// Three significant figures.
fn figures(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        size if size >= 0.1 => format!("{value:.3}"),
        size if size >= 0.01 => format!("{value:.4}"),
        _ => format!("{value:.5}"),
    }
}

impl Grid {
    /// Columns aligned; the first to the left, the others to the right. Headings stand at the foot of their lines.
    fn align(&self, out: &mut String) {
        let words: Vec<Vec<&str>> = self.head.iter().map(|head| head.split('\n').collect()).collect();
        let lines = words.iter().map(Vec::len).max().unwrap_or(0);
        let head_line = |line: usize| -> Vec<String> {
            let word = |words: &Vec<&str>| match (line + words.len()).checked_sub(lines) {
                Some(k) => words[k].to_owned(),
                None => String::new(),
            };
            words.iter().map(word).collect()
        };
        let heads: Vec<Vec<String>> = (0..lines).map(head_line).collect();
        let all = || heads.iter().chain(&self.rows);
        let width = |column: usize| all().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        for row in all() {
            let cells = row.iter().zip(&widths).enumerate();
            let padded = cells.map(
                |(k, (cell, &width))| {
                    if k == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                },
            );
            let line = padded.collect::<Vec<_>>().join("  ");
            let _ = writeln!(out, "{}", line.trim_end());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_numbers_have_three_figures() {
        for (value, expected) in [
            (0.0, "0"),
            (1234.4, "1234"),
            (12.34, "12.3"),
            (-1.234, "-1.23"),
            (0.1234, "0.123"),
            (0.01234, "0.0123"),
            (0.001234, "0.00123"),
            (1.5e-9, "1.5e-9"),
        ] {
            assert_eq!(figures(value), expected);
        }
        let loss = Interval { mean: 0.0123, half_width: 0.004 };
        assert_eq!(interval(&loss), "+1.23 ± 0.40");
        assert_eq!(interval(&Interval { mean: 0.0, half_width: 0.0 }), "0");
    }

    #[test]
    fn exact_columns_are_aligned() {
        let rows = vec![vec!["a".into(), "1".into()], vec!["long".into(), "22.5".into()]];
        let grid = Grid { title: String::new(), head: vec!["name", "of\ntwo"], rows };
        let mut out = String::new();
        grid.align(&mut out);
        assert_eq!(out, "        of\nname   two\na        1\nlong  22.5\n");
    }
}
