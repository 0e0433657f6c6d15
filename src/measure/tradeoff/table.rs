//! A report -> tables for a terminal, and the same in Markdown.

use std::fmt::Write;

use super::curve_grids::{curves, farther, front_grid};
use super::grid::Grid;
use super::report::{Ended, Recommendation, Report, Row, Told};
use super::settings::{OTHER_DRAWS, Side};
use super::words::{figures, percent, plural, points, shown, spread, told_in_words};

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
    let judging = || report.test.iter().filter(|group| group.judges);
    format!(
        "{}{own}: {} scenes at {} settings, {} thread{}; reference: {reference}\n\
         Worth: the default network trained on an eighth, a quarter, a half and all of the scenes, {} training{} each, judged on {}:\n\
         {} scenes, {} cells of another seed, made at the reference{}. CPU: of one thread, making the scenes that train and that stop\n\
         it, and training; nothing is written. Gain: balanced accuracy on the reference at the largest CPU time that both reach,\n\
         straight between sizes in its logarithm; missed: of the untraversable, at the threshold that calls 2 % of the traversable so. {}.\n\
         Errors: CPU of the thread per kept scan, median [quartiles] over scenes; range error against the exact surface, before\n\
         noise{beams}; position and heading of the estimate, median [quartiles] over scans; NEES: its mean; drive moved: the true\n\
         pose against the reference's, at most; cells other: only here or only at the reference; labels other: of those at both;\n\
         shift: root mean square, in the reference's standard deviations.\n",
        report.name,
        report.scenes,
        report.rows.iter().filter(|row| row.pipeline.is_some()).count(),
        report.threads,
        plural(report.threads),
        report.seeds,
        plural(report.seeds),
        report.judged_by(),
        judging().map(|group| group.scenes).sum::<u64>(),
        judging().map(|group| group.cells).sum::<u64>(),
        left_out(judging().map(|group| group.left_out).sum()),
        intervals(report.seeds),
    )
}

fn intervals(seeds: u64) -> &'static str {
    match seeds {
        1 => "One training has no interval, and nothing is told apart by it: ask for two or more (--seeds 2)",
        _ => "Intervals: 95 %, bootstrap over test scenes and trainings, in pairs",
    }
}

fn left_out(scenes: u64) -> String {
    match scenes {
        0 => String::new(),
        of => format!(" ({of} more could not be made, or have no cells)"),
    }
}

fn closing(report: &Report) -> String {
    let mut out = String::new();
    for refused in &report.refused {
        let _ = writeln!(out, "left out: {}: {}: {}", refused.group.name(), refused.name, refused.reason);
    }
    for family in report.test.iter().filter(|group| !group.judges).filter_map(|group| group.held_out.as_ref()) {
        let _ = writeln!(out, "left out: family {family}: its test scenes hold cells of one class alone");
    }
    out += &ended(report);
    if let Some(floor) = report.noise_floor {
        let gain = report.rows.iter().find(|row| row.name == OTHER_DRAWS).and_then(Row::gain);
        let _ = writeln!(
            out,
            "noise floor: other draws of the same config gain {} points; gains of less than {:.2} are not told apart, nor those within their interval",
            shown(gain, |gain| points(&gain.balanced_accuracy)),
            100.0 * floor
        );
    }
    if let Some(ratio) = report.variance_ratio {
        let _ = writeln!(
            out,
            "common scenes, trainings and draws make the variance of a gain {} times smaller (median of the settings)",
            figures(ratio)
        );
    }
    let sides = [
        (Side::Pipeline, "pipeline", &report.recommended_pipeline),
        (Side::Trainer, "filter", &report.recommended_filter),
    ];
    for (side, what, of) in sides {
        if let Some(of) = of {
            let rows: Vec<&Row> = report.side(side).collect();
            out += &recommended(what, of, &rows);
        }
    }
    out
}

/// What ended the rounds, and how far that resolves what matters; nothing of a single round that was all that was asked for.
fn ended(report: &Report) -> String {
    let why = match report.ended {
        Ended::Once => return String::new(),
        Ended::Resolved => "resolved",
        Ended::Time => "the time was over",
        Ended::Interrupted => "interrupted",
    };
    let asked = report.resolve.map_or(String::new(), |resolve| format!(" (asked: {})", figures(100.0 * resolve)));
    let widest = report.widest.as_ref().map_or("nothing that may be the best is open".into(), |widest| {
        let width = widest
            .half_width
            .map_or("one training, so no interval".into(), |width| format!("\u{b1} {:.2} points", 100.0 * width));
        format!("of the gains that may be the best, that of {} is known least: {width}{asked}", widest.name)
    });
    format!("{} round{}, {} trainings a size: {why}; {widest}\n", report.rounds, plural(report.rounds), report.seeds)
}

fn recommended(what: &str, of: &Recommendation, rows: &[&Row]) -> String {
    let is_better_at_first =
        |row: &&Row| row.may_be_recommended && row.gain().is_some_and(|gain| gain.told == Told::Better);
    let why = match () {
        () if of.is_told_better => "better than the reference at equal CPU",
        () if rows.iter().any(is_better_at_first) => {
            "what is told better above is not so on the most scenes, or was not followed to them"
        }
        () => "nothing is told apart from the reference for the better",
    };
    let is_reference = rows.first().is_some_and(|row| row.group.is_none() && row.name == of.name);
    let sets = match () {
        () if of.sets.is_empty() => "the config as written".to_owned(),
        () if is_reference => "the config at fidelity: reference".to_owned(),
        () => of.sets.join(" "),
    };
    format!(
        "recommended {what}: {} ({why}): balanced accuracy {} % of {} scenes, the most that it was measured at, in {} s CPU: {sets}\n",
        of.name,
        percent(&of.balanced_accuracy),
        of.scenes,
        figures(of.cpu_s),
    )
}

fn grids(report: &Report) -> Vec<Grid> {
    let of = |side| -> Vec<&Row> { report.side(side).collect() };
    let (pipelines, yards, filters) = (of(Side::Pipeline), of(Side::Yard), of(Side::Trainer));
    // Other draws are other yards: nothing of them can be matched.
    let matched: Vec<&Row> = pipelines.iter().copied().filter(|row| row.name != OTHER_DRAWS).collect();
    let yard_title = "Changes of the yard and of what is modelled: these are no errors";
    let mut grids = vec![worths(report, "What each setting is worth at equal CPU", &pipelines)];
    if !filters.is_empty() {
        grids.push(worths(report, "The trainer, on the reference's cells, at equal CPU", &filters));
    }
    grids.extend(farther(&pipelines));
    grids.push(curves(&[pipelines, filters].concat()));
    grids.push(front_grid(report));
    grids.push(errors("What each setting costs, and the error it brings", &matched));
    if !yards.is_empty() {
        grids.push(errors(yard_title, &yards));
    }
    grids.push(stages(&[matched, yards].concat()));
    grids
}

fn worths(report: &Report, title: &str, rows: &[&Row]) -> Grid {
    let has_families = report.test.iter().any(|group| group.judges && group.held_out.is_some());
    let mut head = vec!["setting", "CPU s, all scenes\ngenerate + train", "balanced\naccuracy, %"];
    head.extend(has_families.then_some(["worst\nfamily, %", "own\nkinds, %"]).into_iter().flatten());
    head.extend([
        "missed, %\nat 2 % false",
        "flat from\nscenes",
        "equal\nCPU s",
        "scenes for it,\nreference's",
        "gain,\npoints",
        "fewer missed,\npoints",
        "told",
    ]);
    let rows = rows.iter().filter_map(|row| {
        let (worth, whole) = (row.worth.as_ref()?, row.whole()?);
        let gain = worth.gain.as_ref();
        let mut cells = vec![
            row.label(),
            format!("{} + {}", figures(whole.generate_cpu_s), figures(whole.train_cpu_s)),
            percent(&whole.balanced_accuracy),
        ];
        if has_families {
            cells.push(shown(whole.worst.as_ref(), |worst| format!("{:.2}", 100.0 * worst.balanced_accuracy)));
            cells.push(shown(whole.own, |own| format!("{:.2}", 100.0 * own)));
        }
        cells.extend([
            percent(&whole.missed),
            shown(worth.flat_from, |scenes| scenes.to_string()),
            shown(gain, |gain| figures(gain.cpu_s)),
            shown(gain, |gain| format!("{}, {}", gain.scenes, gain.reference_scenes)),
            shown(gain, |gain| points(&gain.balanced_accuracy)),
            shown(gain, |gain| points(&gain.fewer_missed)),
            told(row),
        ]);
        Some(cells)
    });
    Grid { title: title.into(), rows: rows.collect(), head }
}

/// What the gain tells, in words.
fn told(row: &Row) -> String {
    let word = match row.gain() {
        None if row.group.is_none() => "",
        None => "no CPU time in common",
        Some(gain) => told_in_words(gain.told),
    };
    word.to_owned()
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
    ];
    let rows = rows.iter().map(|row| {
        let p = row.pipeline.as_ref();
        let ranges = p.and_then(|p| p.ranges.as_ref());
        let pose = p.and_then(|p| p.pose.as_ref());
        let cells = p.and_then(|p| p.cells.as_ref());
        let drive = p.and_then(|p| p.drive.as_ref());
        let share = |part: u64, of: u64| format!("{:.2}", 100.0 * part as f64 / of.max(1) as f64);
        vec![
            row.label(),
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
        ]
    });
    Grid { title: title.into(), rows: rows.collect(), head }
}

fn stages(rows: &[&Row]) -> Grid {
    let head = vec!["setting", "scene", "drive", "sweep", "slam", "cells", "all, wall", "rays"];
    let rows = rows.iter().filter_map(|row| {
        let p = row.pipeline.as_ref()?;
        let mut cells = vec![row.label()];
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
