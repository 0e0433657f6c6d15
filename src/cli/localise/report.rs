//! A located drive -> the tables that are written, and what is said of it.

use std::fmt::Write;

use serde_json::json;

use super::args::LocaliseArgs;
use super::sweeps::SweepsRead;
use crate::cli::output::{errln, outln};
use crate::recording::{Located, Score, Step};

const STATE: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// A row a step: the upper triangle of the covariance, metres and radians.
pub(super) fn covariances(steps: &[Step]) -> String {
    let pairs = || (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
    let mut text = String::from("time_s");
    for (row, column) in pairs() {
        let _ = write!(text, ",{}_{}", STATE[row], STATE[column]);
    }
    for step in steps {
        let _ = write!(text, "\n{}", step.time_s);
        for (row, column) in pairs() {
            let _ = write!(text, ",{}", step.estimate.covariance[row][column]);
        }
    }
    text + "\n"
}

/// A row a landmark, in the order in which they were first seen; the covariance is that of the particle, whose pose is taken as exact.
pub(super) fn landmarks(located: &Located) -> String {
    let mut text = String::from("id,x_m,y_m,z_m,x_x_m2,x_y_m2,x_z_m2,y_y_m2,y_z_m2,z_z_m2\n");
    for landmark in &located.landmarks {
        let id = landmark.known.map_or(String::new(), |id| id.to_string());
        let ([x, y, z], c) = (landmark.mean_m, &landmark.covariance_m2);
        let [xx, xy, xz, yy, yz, zz] = [c[0][0], c[0][1], c[0][2], c[1][1], c[1][2], c[2][2]];
        let _ = writeln!(text, "{id},{x},{y},{z},{xx},{xy},{xz},{yy},{yz},{zz}");
    }
    text
}

pub(super) fn report(args: &LocaliseArgs, located: &Located, scores: Option<(Score, Score)>, read: &SweepsRead) {
    let last = &located.steps[located.steps.len() - 1].estimate;
    let (located_score, reckoned_score) = scores.unzip();
    let (scale, scale_sigma) = located.odometry_scale;
    let left_out = &located.left_out;
    if u64::from(left_out.not_finite) > located.steps.len() as u64 / 2 {
        errln!(
            "warning: {} measurements at {} steps make no sense and are left out; times are in seconds and grow, ways in metres, angles in the \
             unit that the columns name",
            left_out.not_finite,
            located.steps.len()
        );
    }
    if args.json {
        outln!(
            "{:#}",
            json!({
                "steps": located.steps.len(),
                "landmarks": located.landmarks.len(),
                "sweeps": args.sweeps.as_ref().map(|_| json!({
                    "listed": located.sweep_steps.len(),
                    "read": located.sweeps_read,
                    "found_again": located.sweeps_found_again,
                    "empty": read.empty,
                    "points": read.points,
                    "not_finite": read.not_finite,
                    "at_sensor": read.at_sensor,
                    "on_rover": read.on_rover,
                })),
                "left_out": {
                    "not_finite": left_out.not_finite,
                    "gated": left_out.gated,
                    "ambiguous": left_out.ambiguous,
                    "passed_over": left_out.passed_over,
                },
                "sigma_optimistic": last.sigma_optimistic,
                "odometry_scale": { "mean": scale, "sigma": scale_sigma },
                "score": located_score,
                "dead_reckoning": reckoned_score,
            })
        );
        return;
    }
    outln!("{} steps, {} landmarks", located.steps.len(), located.landmarks.len());
    if args.sweeps.is_some() {
        outln!(
            "{} of {} sweeps read, {} empty; in {} something was found again; of {} points left out: {} that are not finite, {} at the \
             sensor, {} on the rover itself",
            located.sweeps_read,
            located.sweep_steps.len(),
            read.empty,
            located.sweeps_found_again,
            read.points,
            read.not_finite,
            read.at_sensor,
            read.on_rover
        );
    }
    // Without features and sweeps the drive is dead reckoning itself, and only readings can be left out.
    let is_filtered = args.features.is_some() || args.sweeps.is_some();
    let of_features = format!(
        ", {} too far from what was believed, {} features of two landmarks or of none, {} beside others",
        left_out.gated, left_out.ambiguous, left_out.passed_over
    );
    outln!(
        "left out: {} measurements that make no sense{}",
        left_out.not_finite,
        if is_filtered { of_features.as_str() } else { "" }
    );
    if args.slip > 0.0 && is_filtered {
        outln!("{:.1} ± {:.1} % of the counted way was driven", 100.0 * scale, 100.0 * scale_sigma);
    }
    for (name, score) in [("this drive", located_score.filter(|_| is_filtered)), ("dead reckoning", reckoned_score)] {
        let Some(score) = score else { continue };
        let nees =
            score.nees.map_or("none (a covariance has no inverse)".into(), |nees| format!("{nees:.2} (3 is honest)"));
        outln!(
            "{name}: ATE {:.3} m, at the end {:.3} m, heading {:.2} deg, NEES of x, y, yaw {nees}",
            score.ate_m,
            score.last_error_m,
            score.heading_rms_rad.to_degrees()
        );
    }
    if last.sigma_optimistic {
        outln!(
            "the position's covariance is too small: all particles descend from fewer than 3; more particles put that off"
        );
    }
}
