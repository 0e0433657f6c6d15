//! What is told of judged scans: counts, features outside the training range, and how good the model is by the clouds' labels.

use serde_json::json;

use super::args::ClassifyArgs;
use crate::cli::output::{errln, out, outln};
use crate::cli::progress::counted;
use crate::corpus::stats::PointCounts;
use crate::evaluate::Report;
use crate::judge::{Frame, JudgedScan, Outside, ScanJudge, Setup, Sigmas, class_names, scale};
use crate::train::Model;

/// Which model judges and where it tells outputs apart, and what was not measured but taken for granted.
pub(super) fn assumed(args: &ClassifyArgs, model: &Model, judge: &ScanJudge) {
    let setup = judge.setup();
    let trained = model.about.cells.window_scans;
    if args.sensor_height.is_some() && trained > 1 {
        errln!("warning: the model was trained on windows of {trained} scans; without poses each scan is judged alone");
    }
    if let Some(told) = model.other_frame(setup.pose_source.cell_frame()) {
        errln!("warning: {told}");
    }
    if let Some(told) = model.other_overhang(setup.overhang_m) {
        errln!("warning: {told}");
    }
    args.point.remarks(model, judge.thresholds()).iter().for_each(|remark| errln!("warning: {remark}"));
    let Sigmas { xy_m, z_m, tilt_rad, yaw_rad } = setup.sigmas;
    if args.json {
        let sigmas = json!({ "xy_m": xy_m, "z_m": z_m, "tilt_rad": tilt_rad, "yaw_rad": yaw_rad });
        outln!(
            "{}",
            json!({
                "model_sha256": model.sha256,
                "thresholds": judge.thresholds(),
                "max_range_m": setup.max_range_m,
                "window": setup.window,
                "frame": setup.pose_source.cell_frame(),
                "overhang_m": setup.overhang_m,
                "sigmas": sigmas,
            })
        );
        return;
    }
    let takes_sigmas = model.about.features.iter().any(|name| name.starts_with("sigma_"));
    let (tilt_deg, yaw_deg) = (tilt_rad.to_degrees(), yaw_rad.to_degrees());
    let sigmas = takes_sigmas.then(|| {
        format!(", pose sigmas: xy {xy_m} m, z {z_m} m, tilt {tilt_deg:.3} degrees, yaw {yaw_deg:.3} degrees")
    });
    outln!(
        "model {}: range {} m, window {}{}",
        model.short_sha256().unwrap_or_default(),
        setup.max_range_m,
        setup.window,
        sigmas.unwrap_or_default()
    );
    outln!("  {}", borders(model, judge.thresholds()));
    if let Some(above_m) = setup.overhang_m {
        outln!("  without what hangs over more than {above_m} m of free height");
    }
}

/// Which outputs are of which class, and what that was worth on the scenes that stopped the training, where that is known.
fn borders(model: &Model, thresholds: &[f64]) -> String {
    let names = class_names(thresholds.len() + 1);
    let borders = thresholds
        .iter()
        .zip(&names[1..])
        .map(|(threshold, name)| format!("{name} from an output of {threshold:.3} on"));
    let borders = borders.collect::<Vec<_>>().join(", ");
    let worth = |threshold: &f64| model.about.calibration.as_ref()?.worth(*threshold);
    match (thresholds.first().and_then(worth), thresholds.last().and_then(worth)) {
        (Some([missed, _]), Some([_, alarms])) => format!(
            "{borders}; on the model's validation scenes {:.2} % of the untraversable cells lie below and {:.2} % of the traversable ones above",
            100.0 * missed,
            100.0 * alarms
        ),
        _ => borders,
    }
}

/// Says so where no point of a scan lies in any cell, with what may be the reason.
pub(super) fn nowhere(setup: &Setup, judged: &JudgedScan) {
    if !judged.cells.cells.rows.is_empty() {
        return;
    }
    let question = scale::question(&judged.scan.cloud.points_m).filter(|_| setup.frame == Frame::Sensor);
    errln!(
        "warning: {}: no point lies within {} m of the sensor; {}",
        judged.scan.name,
        setup.max_range_m,
        question.unwrap_or("check --frame, the pose and the unit, which is metres")
    );
}

/// The counts of one scan; with --json as one object a line.
pub(super) fn scan(args: &ClassifyArgs, judged: &JudgedScan) {
    let loaded = &judged.scan;
    let counts: Vec<usize> = (0..judged.cells.of_classes).map(|class| judged.cells.count(Some(class))).collect();
    let unknown = judged.cells.count(None);
    let names = judged.cells.class_names();
    let cells = &judged.cells.cells;
    if args.json {
        let mut object = json!({
            "cloud": loaded.name,
            "points": loaded.cloud.points_m.len(),
            "points_not_finite": loaded.cloud.not_finite,
            "points_at_sensor": loaded.at_sensor,
            "points_on_rover": loaded.on_rover,
            "window_points": cells.points_in,
            "window_points_beyond_range": cells.dropped_beyond_range,
            "window_points_off_grid": cells.dropped_off_grid,
            "window_points_overhanging": cells.overhanging,
            "cells": cells.rows.len(),
            "cells_by_class": counts,
            "cells_unknown": unknown,
        });
        if let Some(found) = loaded.levelled {
            object["levelled"] = json!({
                "tilt_deg": found.tilt_rad.to_degrees(),
                "sensor_height_m": found.height_m,
                "near_share": found.near_share,
                "rms_m": found.rms_m,
                "rival": loaded.rival.map(|rival| json!({
                    "sensor_height_m": rival.height_m,
                    "angle_deg": rival.angle_rad.to_degrees(),
                    "share": rival.share,
                })),
            });
        }
        outln!("{object}");
        return;
    }
    outln!("{}", loaded.name);
    if let Some(found) = loaded.levelled {
        outln!(
            "  ground: tilt {:.2} degrees, sensor {:.3} m above it, {:.0} % of the spread points within 0.1 m (rms {:.3} m)",
            found.tilt_rad.to_degrees(),
            found.height_m,
            100.0 * found.near_share,
            found.rms_m
        );
    }
    if let Some(rival) = loaded.rival {
        errln!(
            "warning: {}: a second plane may be the ground: the sensor stands {:.3} m above it, it is tilted against the first by {:.1} degrees, and \
             {:.0} % as many points lie on it alone; give --sensor-height more exactly, or the pose with --pose or --trajectory",
            loaded.name,
            rival.height_m,
            rival.angle_rad.to_degrees(),
            100.0 * rival.share
        );
    }
    outln!(
        "  points {} ({} more not finite, {} at the sensor{}); of the window's {}: {} beyond range, {} off the grid{}",
        loaded.cloud.points_m.len(),
        loaded.cloud.not_finite,
        loaded.at_sensor,
        if loaded.on_rover > 0 { format!(", {} on the rover itself", loaded.on_rover) } else { String::new() },
        cells.points_in,
        cells.dropped_beyond_range,
        cells.dropped_off_grid,
        PointCounts::of(cells).words_left_out()
    );
    let by_class: Vec<String> = names.iter().zip(&counts).map(|(name, count)| format!("{name} {count}")).collect();
    outln!(
        "  cells {}: {}, unknown {} (fewer than {} points)",
        cells.rows.len(),
        by_class.join(", "),
        unknown,
        args.min_points
    );
}

/// A feature within its training range is listed where so many cells lie beyond all but 0.2 % of the training's.
const LEAST_RARE_SHARE: f64 = 0.01;

/// Per feature, how much of the scans the model never saw the like of.
pub(super) fn ranges(args: &ClassifyArgs, found: &[Outside]) {
    if args.json {
        let features: Vec<_> = found
            .iter()
            .map(|f| {
                json!({
                    "feature": f.feature, "least": f.least, "greatest": f.greatest,
                    "below": f.below, "above": f.above, "rare": f.rare,
                })
            })
            .collect();
        outln!("{}", json!({ "outside_training_range": features }));
        return;
    }
    let is_told = |f: &&Outside| f.below + f.above > 0.0 || f.rare >= LEAST_RARE_SHARE;
    let told: Vec<&Outside> = found.iter().filter(is_told).collect();
    let others = counted((found.len() - told.len()) as u64, "feature");
    if told.is_empty() {
        outln!("\nno cell lies outside the training range of any feature");
        return;
    }
    let width = told.iter().map(|f| f.feature.len()).max().unwrap_or_default().max("feature".len()) + 2;
    outln!("\ncells outside the training range");
    outln!(
        "  {:<width$}{:>12}{:>12}{:>9}{:>9}{:>22}",
        "feature",
        "least",
        "greatest",
        "below",
        "above",
        "outside 0.1..99.9 %"
    );
    for f in &told {
        outln!(
            "  {:<width$}{:>12.4}{:>12.4}{:>8.1}%{:>8.1}%{:>21.1}%",
            f.feature,
            f.least,
            f.greatest,
            100.0 * f.below,
            100.0 * f.above,
            100.0 * f.rare
        );
    }
    if told.len() < found.len() {
        outln!("  {others} more: no cell outside, and under {} % outside 0.1..99.9 %", 100.0 * LEAST_RARE_SHARE);
    }
    for f in found.iter().filter(|f| f.below + f.above > 0.1) {
        errln!(
            "warning: {} lies outside what the model was trained on for {:.0} % of the cells; check frame, pose and units, or train on \
             scenes like these",
            f.feature,
            100.0 * (f.below + f.above)
        );
    }
}

/// The report of `evaluate`, over all cells that have a label and were judged.
pub(super) fn evaluation(args: &ClassifyArgs, report: &Report) {
    if args.json {
        let object = serde_json::to_value(report).expect("a report is plain data");
        outln!("{object}");
    } else {
        outln!("");
        out!("{report}");
    }
}
