//! A command -> where the rover goes.
//!
//! Source: Thrun, Burgard & Fox 2005, 5.3 (velocity model: speed and yaw rate disturbed in proportion to themselves, and an
//! extra turn). Deviation: the extra turn's variance grows with the way of the outer wheel, so that it does not depend on
//! the length of a step. A unicycle on tilted ground: it advances along its nose, so that a climb shortens the way over
//! the map by cos(pitch); pitch is that of the step's start. Yaw is the heading on the map. Not modelled: sideways
//! slip on cross slopes.

use super::params::DriveParams;
use crate::geometry::{DVec2, Pose};
use crate::math;
use crate::random::{Drawn, Purpose, Stream, Streams};

/// What the rover is told to do for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Command {
    /// Along the nose, and to the left.
    pub length_m: f64,
    pub turn_rad: f64,
    pub dt_s: f64,
}

/// Position on the map and heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose2 {
    pub at_m: DVec2,
    pub yaw_rad: f64,
}

/// Noise of the true motion; none where the config names none.
pub(super) struct MotionNoise {
    half_track_m: f64,
    noise: Option<Noise>,
}

struct Noise {
    speed: (f64, Stream),
    yaw_rate: (f64, Stream),
    heading_rad_per_sqrt_m: (f64, Stream),
}

impl MotionNoise {
    pub(super) fn new(params: &DriveParams, drawn: &Drawn, streams: &Streams) -> MotionNoise {
        let noise = params.control_noise.is_some().then(|| Noise {
            speed: (drawn[Purpose::ControlSpeedSd], streams.open(Purpose::ControlSpeedNoise)),
            yaw_rate: (drawn[Purpose::ControlYawRateSd], streams.open(Purpose::ControlYawRateNoise)),
            heading_rad_per_sqrt_m: (
                drawn[Purpose::ControlHeadingSd].to_radians(),
                streams.open(Purpose::ControlHeadingNoise),
            ),
        });
        MotionNoise { half_track_m: 0.5 * params.rover.track_m(), noise }
    }

    /// What the rover does where it was told `command`, at control step `index`.
    pub(super) fn disturb(&self, command: Command, index: u64) -> Command {
        let Some(noise) = &self.noise else { return command };
        let drawn = |(sd, stream): &(f64, Stream)| if *sd > 0.0 { sd * stream.normal(index) } else { 0.0 };
        let way_m = outer_way_m(command.length_m, command.turn_rad, self.half_track_m);
        Command {
            length_m: command.length_m * (1.0 + drawn(&noise.speed)),
            turn_rad: command.turn_rad * (1.0 + drawn(&noise.yaw_rate))
                + drawn(&noise.heading_rad_per_sqrt_m) * way_m.sqrt(),
            dt_s: command.dt_s,
        }
    }
}

/// Path of the outer wheel over a step.
pub(super) fn outer_way_m(length_m: f64, turn_rad: f64, half_track_m: f64) -> f64 {
    length_m.abs() + turn_rad.abs() * half_track_m
}

/// Where an arc from `pose` ends.
pub(super) fn advance(pose: &Pose, command: &Command) -> Pose2 {
    let half = 0.5 * command.turn_rad;
    // Chord of the arc: length sin(half) / half, along the mean heading.
    let chord_m = command.length_m / arc_over_chord(command.turn_rad) * math::cos(pose.pitch_rad);
    let (sin, cos) = math::sin_cos(pose.yaw_rad + half);
    Pose2 {
        at_m: DVec2::new(pose.position_m.x + chord_m * cos, pose.position_m.y + chord_m * sin),
        yaw_rad: math::wrap_angle(pose.yaw_rad + command.turn_rad),
    }
}

/// Length of an arc over that of its chord.
pub(super) fn arc_over_chord(turn_rad: f64) -> f64 {
    let half = 0.5 * turn_rad;
    // Below, the series' next term is under 1e-17.
    if half.abs() < 1e-4 { 1.0 + half * half / 6.0 } else { half / math::sin(half) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DVec3;

    #[test]
    fn exact_steps_along_a_circle_lie_on_it_and_close_it() {
        let (radius_m, steps) = (2.0, 36);
        let turn_rad = std::f64::consts::TAU / f64::from(steps);
        let command = Command { length_m: radius_m * turn_rad, turn_rad, dt_s: 1.0 };
        let mut pose = Pose { position_m: DVec3::new(3.0, 1.0, 0.0), ..Pose::default() };
        for _ in 0..steps {
            let place = advance(&pose, &command);
            assert!(((place.at_m - DVec2::new(3.0, 3.0)).length() - radius_m).abs() < 1e-13);
            pose.position_m = place.at_m.extend(0.0);
            pose.yaw_rad = place.yaw_rad;
        }
        assert!((pose.position_m - DVec3::new(3.0, 1.0, 0.0)).length() < 1e-13);
        assert!(math::wrap_angle(pose.yaw_rad).abs() < 1e-13);
    }

    #[test]
    fn exact_a_climb_shortens_the_way_over_the_map() {
        let pose = Pose { pitch_rad: -0.5, yaw_rad: 0.8, ..Pose::default() };
        let place = advance(&pose, &Command { length_m: 2.0, turn_rad: 0.0, dt_s: 1.0 });
        assert!((place.at_m.length() - 2.0 * math::cos(0.5)).abs() < 1e-15);
        assert_eq!(place.yaw_rad, 0.8);
    }

    #[test]
    fn equal_arc_over_chord_by_series_and_by_sine() {
        for turn in [1e-5_f64, 1.9e-4, 2.1e-4, 0.1, 3.0] {
            let exact = 0.5 * turn / math::sin(0.5 * turn);
            assert!((arc_over_chord(turn) - exact).abs() < 4e-16 * exact, "{turn}");
        }
        assert_eq!(arc_over_chord(0.0), 1.0);
    }
}
