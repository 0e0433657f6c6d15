//! A located drive and its truth -> how far off it is, and whether its covariance says so.
//!
//! In: [`Step`]s, [`TruePose`]s. Out: [`Score`]. A truth between two rows is interpolated along a line, its yaw the shorter way round; steps
//! outside the truth's times are not judged. No alignment: the start is known, and an alignment would hide an error of the heading.

use super::Step;
use super::read::TruePose;
use crate::geometry::DVec2;
use crate::math;
use crate::slam::matrix::{cholesky, half_solve, square};

/// Of the steps that a truth covers.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Score {
    pub steps_judged: u64,
    /// Root mean square of the distance over the map.
    pub ate_m: f64,
    pub last_error_m: f64,
    pub heading_rms_rad: f64,
    /// Error squared over covariance of x, y and yaw, mean over the steps: 3 where the covariance is honest. `None` where a
    /// covariance has no inverse.
    pub nees: Option<f64>,
}

/// `None` where the truth covers no step.
pub fn score(steps: &[Step], truth: &[TruePose]) -> Option<Score> {
    let (mut squares_m2, mut headings_rad2, mut nees, mut last_error_m, mut count) = (0.0, 0.0, Some(0.0), 0.0, 0u64);
    for step in steps {
        let Some((place_m, yaw_rad)) = at(truth, step.time_s) else { continue };
        let pose = &step.estimate.pose;
        let off_m = pose.position_m.truncate() - place_m;
        let turned_rad = math::wrap_angle(pose.yaw_rad - yaw_rad);
        squares_m2 += off_m.length_squared();
        headings_rad2 += turned_rad * turned_rad;
        last_error_m = off_m.length();
        let covariance = AXES.map(|row| AXES.map(|column| step.estimate.covariance[row][column]));
        // The start is exact: its covariance says nothing.
        if covariance[0][0] > 0.0 || covariance[1][1] > 0.0 {
            let of_step =
                cholesky(&covariance).map(|factor| square(&half_solve(&factor, &[off_m.x, off_m.y, turned_rad])));
            nees = nees.zip(of_step).map(|(sum, of_step)| sum + of_step);
            count += 1;
        }
    }
    let judged = steps.iter().filter(|step| at(truth, step.time_s).is_some()).count() as u64;
    (judged > 0).then(|| Score {
        steps_judged: judged,
        ate_m: (squares_m2 / judged as f64).sqrt(),
        last_error_m,
        heading_rms_rad: (headings_rad2 / judged as f64).sqrt(),
        nees: nees.filter(|_| count > 0).map(|sum| sum / count as f64),
    })
}

/// x, y, yaw.
const AXES: [usize; 3] = [0, 1, 5];

fn at(truth: &[TruePose], time_s: f64) -> Option<(DVec2, f64)> {
    let next = truth.partition_point(|row| row.time_s < time_s);
    let after = truth.get(next)?;
    if after.time_s == time_s {
        return Some((after.pose.position_m.truncate(), after.pose.yaw_rad));
    }
    let before = truth.get(next.checked_sub(1)?)?;
    let share = (time_s - before.time_s) / (after.time_s - before.time_s);
    let place_m = before.pose.position_m.lerp(after.pose.position_m, share).truncate();
    let turn_rad = math::wrap_angle(after.pose.yaw_rad - before.pose.yaw_rad);
    Some((place_m, math::wrap_angle(before.pose.yaw_rad + share * turn_rad)))
}
