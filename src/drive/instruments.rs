//! True motion -> what IMU, sun sensor and odometry read.
//!
//! Source: Hewitt et al. 2017, "Rover model": Gaussian noise on each measurement, "based on sensor specifications", drawn
//! once per scene. IMU: roll and pitch after every step, with noise and a constant bias. Sun sensor: heading, at the start
//! and at every stop. Odometry: the three-dimensional way and the turn of each step; slip is the share of the counted way
//! that was not driven, and noise grows with the square root of the way (the outer wheel's way for the heading). Not
//! modelled: drift of the bias, and tilt that leaks into the sun's heading.

use super::follow::DrivenPath;
use super::motion::{arc_over_chord, outer_way_m};
use super::params::{DriveParams, InstrumentsParams};
use super::{InstrumentNoise, Reading};
use crate::geometry::Pose;
use crate::math;
use crate::random::{Drawn, Purpose, Stream, Streams};

impl InstrumentNoise {
    /// The scene's standard deviations; of slip that of all scenes, for no rover is told how far its wheels slip today.
    pub fn of(params: &InstrumentsParams, drawn: &Drawn) -> InstrumentNoise {
        // A bias of that size along an axis that nobody knows.
        let bias_deg = params.imu_bias_deg.as_ref().map_or(0.0, |_| drawn[Purpose::ImuBias].abs());
        InstrumentNoise {
            imu_rad: drawn[Purpose::ImuSd].to_radians(),
            imu_bias_rad: bias_deg.to_radians() * std::f64::consts::FRAC_1_SQRT_2,
            sun_rad: if params.sun_deg.is_some() { drawn[Purpose::SunSd].to_radians() } else { 0.0 },
            odometry_m_per_sqrt_m: drawn[Purpose::OdometryDistanceSd],
            sideways_m_per_sqrt_m: 0.0,
            slip: params.slip.as_ref().map_or(0.0, |slip| root_mean_square(slip.bounds())),
            heading_rad_per_sqrt_m: drawn[Purpose::OdometryHeadingSd].to_radians(),
        }
    }
}

/// Of what is uniform between two bounds.
fn root_mean_square((low, high): (f64, f64)) -> f64 {
    ((low * low + low * high + high * high) / 3.0).sqrt()
}

/// The instruments of one scene.
pub(super) struct Instruments {
    noise: InstrumentNoise,
    roll_bias_rad: f64,
    pitch_bias_rad: f64,
    slip: f64,
    half_track_m: f64,
    has_sun: bool,
    roll: Stream,
    pitch: Stream,
    sun: Stream,
    distance: Stream,
    heading: Stream,
}

impl Instruments {
    pub(super) fn new(params: &DriveParams, drawn: &Drawn, streams: &Streams) -> Instruments {
        let instruments = &params.instruments;
        let (mut roll_bias_rad, mut pitch_bias_rad) = (0.0, 0.0);
        if instruments.imu_bias_deg.is_some() {
            let axis_rad = std::f64::consts::TAU * streams.open(Purpose::ImuBiasAxis).uniform(0);
            let (sin, cos) = math::sin_cos(axis_rad);
            let bias_rad = drawn[Purpose::ImuBias].to_radians();
            (roll_bias_rad, pitch_bias_rad) = (bias_rad * cos, bias_rad * sin);
        }
        Instruments {
            noise: InstrumentNoise::of(instruments, drawn),
            roll_bias_rad,
            pitch_bias_rad,
            slip: if instruments.slip.is_some() { drawn[Purpose::Slip] } else { 0.0 },
            half_track_m: 0.5 * params.rover.track_m(),
            has_sun: instruments.sun_deg.is_some(),
            roll: streams.open(Purpose::ImuRollNoise),
            pitch: streams.open(Purpose::ImuPitchNoise),
            sun: streams.open(Purpose::SunNoise),
            distance: streams.open(Purpose::OdometryDistanceNoise),
            heading: streams.open(Purpose::OdometryHeadingNoise),
        }
    }

    /// One reading per pose of a travel; the first is taken at rest. `stops` ascend.
    pub(super) fn read(&self, travel: &DrivenPath, stops: &[usize]) -> Vec<Reading> {
        let poses = || travel.stances.iter().map(|stance| &stance.pose);
        let mut readings = vec![self.after(0, &travel.stances[0].pose, 0.0, 0.0, 0.0, true)];
        for (k, (from, to)) in poses().zip(poses().skip(1)).enumerate() {
            let step = k + 1;
            let stop = stops.binary_search(&step).is_ok();
            readings.push(self.over_step(step as u64, from, to, travel.durations_s[k], stop));
        }
        readings
    }

    /// Reads after control step `index`, which took `dt_s` and led from one pose to the next.
    fn over_step(&self, index: u64, from: &Pose, to: &Pose, dt_s: f64, stop: bool) -> Reading {
        let turn_rad = math::wrap_angle(to.yaw_rad - from.yaw_rad);
        let way_m = (to.position_m - from.position_m).length() * arc_over_chord(turn_rad);
        let counted_m =
            way_m / (1.0 - self.slip) + draw(&self.distance, index, self.noise.odometry_m_per_sqrt_m) * way_m.sqrt();
        let outer_m = outer_way_m(way_m, turn_rad, self.half_track_m);
        let counted_rad = turn_rad + draw(&self.heading, index, self.noise.heading_rad_per_sqrt_m) * outer_m.sqrt();
        self.after(index, to, dt_s, counted_m / dt_s, counted_rad / dt_s, stop)
    }

    fn after(&self, index: u64, pose: &Pose, dt_s: f64, speed_mps: f64, yaw_rate_radps: f64, stop: bool) -> Reading {
        let imu_rad = self.noise.imu_rad;
        Reading {
            dt_s,
            speed_mps,
            yaw_rate_radps,
            roll_rad: Some(pose.roll_rad + self.roll_bias_rad + draw(&self.roll, index, imu_rad)),
            pitch_rad: Some(pose.pitch_rad + self.pitch_bias_rad + draw(&self.pitch, index, imu_rad)),
            yaw_rad: (self.has_sun && stop)
                .then(|| math::wrap_angle(pose.yaw_rad + draw(&self.sun, index, self.noise.sun_rad))),
        }
    }
}

fn draw(stream: &Stream, index: u64, sd: f64) -> f64 {
    if sd > 0.0 { sd * stream.normal(index) } else { 0.0 }
}
