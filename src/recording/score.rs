//! A located drive and its truth -> how far off it is, and whether its covariance says so.
//!
//! In: [`Step`]s, [`TruePose`]s. Out: [`Score`]. A truth between two rows is interpolated along a line, its yaw the shorter way round; steps
//! outside the truth's times are not judged. No alignment: the start is known, and an alignment would hide an error of the heading.

use super::Step;
use super::read::TruePose;
use crate::geometry::Pose;
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
    let (mut squares_m2, mut headings_rad2, mut last_error_m, mut judged) = (0.0, 0.0, 0.0, 0u64);
    let (mut nees, mut with_covariance) = (Some(0.0), 0u64);
    for step in steps {
        let Some(true_pose) = truth_at(truth, step.time_s) else { continue };
        judged += 1;
        let pose = &step.estimate.pose;
        let off_m = (pose.position_m - true_pose.position_m).truncate();
        let turned_rad = math::wrap_angle(pose.yaw_rad - true_pose.yaw_rad);
        squares_m2 += off_m.length_squared();
        headings_rad2 += turned_rad * turned_rad;
        last_error_m = off_m.length();
        let covariance = AXES.map(|row| AXES.map(|column| step.estimate.covariance[row][column]));
        // The start is exact: its covariance says nothing.
        if covariance[0][0] > 0.0 || covariance[1][1] > 0.0 {
            let of_step =
                cholesky(&covariance).map(|factor| square(&half_solve(&factor, &[off_m.x, off_m.y, turned_rad])));
            nees = nees.zip(of_step).map(|(sum, of_step)| sum + of_step);
            with_covariance += 1;
        }
    }
    (judged > 0).then(|| Score {
        steps_judged: judged,
        ate_m: (squares_m2 / judged as f64).sqrt(),
        last_error_m,
        heading_rms_rad: (headings_rad2 / judged as f64).sqrt(),
        nees: nees.filter(|_| with_covariance > 0).map(|sum| sum / with_covariance as f64),
    })
}

/// x, y, yaw.
const AXES: [usize; 3] = [0, 1, 5];

/// Where the rover was at a time; `None` where no two rows hold it.
pub fn truth_at(truth: &[TruePose], time_s: f64) -> Option<Pose> {
    let next = truth.partition_point(|row| row.time_s < time_s);
    let after = truth.get(next)?;
    if after.time_s == time_s {
        return Some(after.pose);
    }
    let before = truth.get(next.checked_sub(1)?)?;
    let share = (time_s - before.time_s) / (after.time_s - before.time_s);
    let (from, to) = (&before.pose, &after.pose);
    let angle = |from_rad: f64, to_rad: f64| math::wrap_angle(from_rad + share * math::wrap_angle(to_rad - from_rad));
    Some(Pose {
        position_m: from.position_m.lerp(to.position_m, share),
        roll_rad: angle(from.roll_rad, to.roll_rad),
        pitch_rad: angle(from.pitch_rad, to.pitch_rad),
        yaw_rad: angle(from.yaw_rad, to.yaw_rad),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DVec3;
    use crate::slam::Estimate;

    fn pose(x_m: f64, yaw_rad: f64) -> Pose {
        Pose { position_m: DVec3::new(x_m, 0.0, 0.0), yaw_rad, ..Pose::default() }
    }

    fn truth() -> Vec<TruePose> {
        [(1.0, pose(0.0, 3.0)), (2.0, pose(2.0, -3.0))].map(|(time_s, pose)| TruePose { time_s, pose }).to_vec()
    }

    /// A belief whose x, y and yaw have these variances.
    fn step(time_s: f64, pose: Pose, variances: [f64; 3]) -> Step {
        let mut estimate: Estimate = crate::slam::truth(&pose);
        for (axis, variance) in AXES.into_iter().zip(variances) {
            estimate.covariance[axis][axis] = variance;
        }
        Step { time_s, estimate }
    }

    #[test]
    fn exact_a_truth_between_two_rows_turns_the_shorter_way_round() {
        let half = truth_at(&truth(), 1.5).expect("between two rows");
        assert_eq!(half.position_m.x, 1.0);
        assert!((half.yaw_rad.abs() - std::f64::consts::PI).abs() < 1e-12, "{}", half.yaw_rad);
        assert_eq!(truth_at(&truth(), 2.0), Some(pose(2.0, -3.0)));
        assert_eq!((truth_at(&truth(), 0.9), truth_at(&truth(), 2.1), truth_at(&[], 1.0)), (None, None, None));
    }

    #[test]
    fn exact_a_score_of_errors_known_on_paper() {
        // The first two steps lie outside the truth; of the others the errors are 0.3 m and 0.4 m, the heading's 0.1 and 0 rad.
        let off =
            |x_m: f64, y_m: f64, yaw_rad: f64| Pose { position_m: DVec3::new(x_m, y_m, 9.0), ..pose(0.0, yaw_rad) };
        let steps = [
            step(0.0, pose(99.0, 0.0), [1.0; 3]),
            step(2.5, pose(99.0, 0.0), [1.0; 3]),
            step(1.0, off(0.3, 0.0, 3.1), [0.09, 0.01, 0.01]),
            step(2.0, off(2.0, 0.4, -3.0), [0.01, 0.04, 0.01]),
        ];
        let found = score(&steps, &truth()).expect("two steps are covered");
        assert_eq!(found.steps_judged, 2);
        assert!((found.ate_m - (0.5 * (0.09 + 0.16_f64)).sqrt()).abs() < 1e-12);
        assert!((found.last_error_m - 0.4).abs() < 1e-12);
        assert!((found.heading_rms_rad - (0.5 * 0.01_f64).sqrt()).abs() < 1e-12);
        // 1 + 1 of the first, 4 of the second.
        assert!((found.nees.expect("covariances have inverses") - 3.0).abs() < 1e-9, "{:?}", found.nees);
        assert_eq!(score(&steps[..2], &truth()), None);
        // An exact start has no covariance to hold to; a covariance without inverse has no answer.
        let exact = step(1.0, pose(0.0, 3.0), [0.0; 3]);
        assert_eq!(score(std::slice::from_ref(&exact), &truth()).map(|found| found.nees), Some(None));
        let flat = step(2.0, pose(2.0, -3.0), [1.0, 0.0, 1.0]);
        assert_eq!(score(&[exact, flat], &truth()).map(|found| found.nees), Some(None));
    }
}
