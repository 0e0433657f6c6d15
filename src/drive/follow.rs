//! Start and guide -> the true way: one stance per control step.
//!
//! Each step: the guide's command, disturbed by the control noise, leads to a place; the rover is set on the ground there.
//! The drive ends at the path's end, or before the step that would bring the body onto an obstacle or over the yard's edge,
//! or onto ground that the rover cannot stand on. A random walk keeps room to turn in place, so that it can go on elsewhere.

use super::contact::ContactPose;
use super::footing::Footing;
use super::guide::PathFollower;
use super::motion::{MotionNoise, advance};
use super::yard::{Yard, body};
use super::{DriveError, Rover};
use crate::math;

const MAX_STEPS: usize = 200_000;

/// The true way of a drive.
pub(super) struct DrivenPath {
    /// The start, then one per step.
    pub stances: Vec<ContactPose>,
    /// One per step.
    pub durations_s: Vec<f64>,
    pub cut_short: bool,
}

pub(super) fn follow(
    rover: &Rover,
    yard: &Yard,
    footing: &Footing,
    start: ContactPose,
    mut guide: PathFollower,
    bumps: &MotionNoise,
) -> Result<DrivenPath, DriveError> {
    let mut travel = DrivenPath { stances: vec![start], durations_s: Vec::new(), cut_short: false };
    let mut now = start;
    while let Some(command) = guide.next(&now.pose) {
        if travel.stances.len() > MAX_STEPS {
            let reason = format!("it takes more than {MAX_STEPS} control steps; raise drive.step_m or shorten it");
            return Err(DriveError::NoWay { reason });
        }
        let place = advance(&now.pose, &bumps.disturb(command, travel.stances.len() as u64));
        let clear = yard.clear(&body(rover, place.at_m, place.yaw_rad), 0.0)
            && (!guide.needs_turning_room() || yard.clear_circle(place.at_m, rover.turning_radius_m()));
        let next = clear.then(|| footing.stand(place.at_m.x, place.at_m.y, place.yaw_rad, Some(&now)));
        if let Some(Ok(stance)) = next {
            guide.done(&command);
            travel.stances.push(stance);
            travel.durations_s.push(command.dt_s);
            now = stance;
        } else if !guide.barred(&command) {
            travel.cut_short = true;
            break;
        }
    }
    Ok(travel)
}

impl DrivenPath {
    /// At most `count` steps, ascending: the start, then wherever the rover has come an even share of its way, to the last step; one alone
    /// is the last step. A step that turns counts as its turn, so many metres a radian, where that is more than the way that it leads on.
    pub(super) fn stops(&self, count: u32, turn_as_way_m_per_rad: f64) -> Vec<usize> {
        let mut way_m = vec![0.0];
        for pair in self.stances.windows(2) {
            let [before, after] = [pair[0].pose, pair[1].pose];
            let led_m = (after.position_m - before.position_m).length();
            let turn_rad = math::wrap_angle(after.yaw_rad - before.yaw_rad).abs();
            way_m.push(way_m[way_m.len() - 1] + led_m.max(turn_as_way_m_per_rad * turn_rad));
        }
        let last = self.stances.len() - 1;
        let shares = count - 1;
        let share_m = way_m[last] / f64::from(shares.max(1));
        // A nanometre of slack, so that rounding does not push a stop to the next step.
        let mut stops: Vec<usize> =
            (0..shares).map(|k| way_m.partition_point(|&w| w < share_m * f64::from(k) - 1e-9).min(last)).collect();
        stops.push(last);
        stops.dedup();
        stops
    }
}
