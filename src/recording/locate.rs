//! A recording and what is known of its instruments -> a pose at each time, and a map.
//!
//! In: a [`Recording`], [`LocateParams`], how to come by the returns of a sweep, and whom to tell of each step. Out: [`Located`]. An observation
//! between two readings cuts the step: the reading's speed and yaw rate hold over both parts, its angles belong to the end. Frames and units as in [`crate::recording`].

use super::{Observation, Recording};
use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{Pose, Transform};
use crate::random::{Stage, Streams};
use crate::slam::motion::Control;
use crate::slam::{Counters, Estimate, Landmark, Slam, SlamError, SlamParams, Visibility};
use crate::sweep::Returns;

/// Where the drive starts, and how good the instruments are.
#[derive(Clone, Debug, PartialEq)]
pub struct LocateParams {
    pub slam: SlamParams,
    pub noise: InstrumentNoise,
    /// Of a feature's range (metres), bearing and elevation (radians).
    pub feature_sigmas: [f64; 3],
    pub start: Pose,
    pub rover_from_sensor: Transform,
    /// A sweep is read when the wheels have rolled so far since the one that was read before, metres: what one sweep laid on another errs is
    /// biased alike from pair to pair, and adds up where sweeps follow one another closely. 0 reads all.
    pub sweep_spacing_m: f64,
    pub seed: u64,
}

/// The belief at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    pub time_s: f64,
    pub estimate: Estimate,
}

/// A drive that was located.
#[derive(Clone, Debug)]
pub struct Located {
    pub steps: Vec<Step>,
    /// Of the steps those that end at a sweep, read or not.
    pub sweep_steps: Vec<usize>,
    pub sweeps_read: usize,
    /// Of those read, sweeps in which something was found again that had been seen before, so that they corrected the pose.
    pub sweeps_found_again: usize,
    /// Of the likeliest particle; positions in the map.
    pub landmarks: Vec<Landmark>,
    /// Mean and standard deviation of the share of the counted way that was driven.
    pub odometry_scale: (f64, f64),
    /// What was left out, by cause.
    pub left_out: Counters,
}

/// Runs the filter over a recording. `returns_of`: the returns of the sweep in a file; dead reckoning asks for none. `each_step` is told how many
/// steps are done, and of how many.
pub fn locate<E: From<SlamError>>(
    recording: &Recording,
    params: &LocateParams,
    mut returns_of: impl FnMut(&str) -> Result<Returns, E>,
    mut each_step: impl FnMut(usize, usize),
) -> Result<Located, E> {
    let LocateParams { slam, noise, feature_sigmas, start, rover_from_sensor, sweep_spacing_m, seed } = params;
    let mut filter = Slam::new(slam, noise, start, rover_from_sensor)?.with_feature_sigmas(feature_sigmas);
    // Nothing is known of where the sensor looked and saw nothing.
    let visibility = Visibility::blind(f64::INFINITY);
    let reads_sights = slam.reads_sweeps();
    let (mut steps, mut sweep_steps) = (Vec::with_capacity(recording.readings.len()), Vec::new());
    let (mut sweeps_read, mut sweeps_found_again, mut rolled_m) = (0, 0, f64::INFINITY);
    let parts = cut(recording);
    let all = parts.len();
    for (number, (time_s, reading, observation)) in parts.into_iter().enumerate() {
        let streams = Streams { seed: *seed, scene: 0, attempt: 0, stage: Stage::Slam, step: number as u32 };
        filter.step(&reading)?;
        rolled_m += Control::of(&reading).map_or(0.0, |control| control.rolled_m());
        if matches!(observation, Some(Observation::Sweep { .. })) {
            sweep_steps.push(number);
        }
        let estimate = match observation.filter(|_| reads_sights) {
            Some(Observation::Features(features)) => filter.observe_features(features, &visibility, &streams)?,
            Some(Observation::Sweep { file, .. }) if rolled_m >= *sweep_spacing_m => {
                (sweeps_read, rolled_m) = (sweeps_read + 1, 0.0);
                let estimate = filter.observe(&returns_of(file)?, &streams)?;
                sweeps_found_again += usize::from(filter.found_again());
                estimate
            }
            Some(Observation::Sweep { .. }) | None => filter.estimate(),
        };
        steps.push(Step { time_s, estimate });
        each_step(number + 1, all);
    }
    let start_m = start.position_m.to_array();
    let mut landmarks = filter.best().1.to_vec();
    for landmark in &mut landmarks {
        landmark.mean_m = std::array::from_fn(|axis| landmark.mean_m[axis] + start_m[axis]);
    }
    let (odometry_scale, left_out) = (filter.odometry_scale(), filter.counters());
    Ok(Located { steps, sweep_steps, sweeps_read, sweeps_found_again, landmarks, odometry_scale, left_out })
}

/// Readings and observations in one order: a step that ends at each time of either.
fn cut(recording: &Recording) -> Vec<(f64, Reading, Option<&Observation>)> {
    let mut steps = Vec::new();
    let mut observations = recording.observations.iter().peekable();
    let mut now_s = recording.readings.first().map_or(0.0, |&(time_s, _)| time_s);
    for &(end_s, reading) in &recording.readings {
        while let Some((time_s, observation)) = observations.next_if(|(time_s, _)| *time_s < end_s) {
            let part = Reading { dt_s: time_s - now_s, roll_rad: None, pitch_rad: None, yaw_rad: None, ..reading };
            steps.push((*time_s, part, Some(observation)));
            now_s = *time_s;
        }
        let observation = observations.next_if(|(time_s, _)| *time_s == end_s).map(|(_, observation)| observation);
        steps.push((end_s, Reading { dt_s: end_s - now_s, ..reading }, observation));
        now_s = end_s;
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::SightLog;
    use crate::slam::FastslamParams;

    #[test]
    fn law_cut_steps_cover_the_time_once_and_end_at_every_observation() {
        let odometry = "time_s,speed_mps,yaw_rate_radps,yaw_rad\n1,0,0,0\n2,1,0.5,0.5\n3,1,0.5,1\n";
        let features = "time_s,range_m,bearing_rad\n1,4,0\n1.25,4,0\n1.5,4,0\n3,4,0\n";
        let features = SightLog::Features { file: "f", text: features };
        let recording = Recording::read(("o", odometry), Some(features)).expect("a recording");
        let steps = cut(&recording);
        let told: Vec<(f64, f64, bool, bool)> =
            steps.iter().map(|(t, r, f)| (*t, r.dt_s, r.yaw_rad.is_some(), f.is_some())).collect();
        assert_eq!(
            told,
            [
                (1.0, 0.0, true, true),
                (1.25, 0.25, false, true),
                (1.5, 0.25, false, true),
                (2.0, 0.5, true, false),
                (3.0, 1.0, true, true)
            ]
        );
    }

    #[test]
    fn exact_sweeps_are_read_a_spacing_apart_and_all_have_a_step() {
        let rows: String = (0..=10).map(|k| format!("{k},0.1,0\n")).collect();
        let odometry = format!("time_s,speed_mps,yaw_rate_radps\n{rows}");
        let list: String = (0..=10).map(|k| format!("{k},{k}.bin\n")).collect();
        let list = format!("time_s,file\n{list}");
        let sweeps = SightLog::Sweeps { file: "s", text: &list };
        let recording = Recording::read(("o", &odometry), Some(sweeps)).expect("a recording");
        let read = |slam: SlamParams, sweep_spacing_m: f64| {
            let params = LocateParams { slam, sweep_spacing_m, ..params() };
            let mut names = Vec::new();
            let returns_of = |name: &str| {
                names.push(name.to_owned());
                Ok(crate::recording::returns_of_points(&[], |_| false).returns)
            };
            let mut told = Vec::new();
            let located = locate::<SlamError>(&recording, &params, returns_of, |done, of| told.push((done, of)));
            let located = located.expect("a drive");
            assert_eq!((located.sweeps_read, located.sweep_steps.len()), (names.len(), 11));
            assert!(told.into_iter().eq((1..=11).map(|done| (done, 11))));
            assert_eq!(located.sweeps_found_again, 0, "there is nothing in them");
            names
        };
        let fastslam = || SlamParams::Fastslam(FastslamParams { particles: 1, ..FastslamParams::default() });
        // A tenth of a metre from one to the next.
        assert_eq!(read(fastslam(), 0.25), ["0.bin", "3.bin", "6.bin", "9.bin"]);
        assert_eq!(read(fastslam(), 0.0).len(), 11);
        assert_eq!(read(fastslam(), f64::INFINITY), ["0.bin"]);
        assert_eq!(read(SlamParams::DeadReckoning, 0.0).len(), 0);
    }

    fn params() -> LocateParams {
        LocateParams {
            slam: SlamParams::DeadReckoning,
            noise: InstrumentNoise {
                imu_rad: 0.01,
                imu_bias_rad: 0.0,
                sun_rad: 0.0,
                odometry_m_per_sqrt_m: 0.05,
                sideways_m_per_sqrt_m: 0.02,
                slip: 0.0,
                heading_rad_per_sqrt_m: 0.03,
            },
            feature_sigmas: [0.03, 0.02, 0.02],
            start: Pose::default(),
            rover_from_sensor: Transform::IDENTITY,
            sweep_spacing_m: 0.0,
            seed: 0,
        }
    }
}
