//! A recording and what is known of its instruments -> a pose at each time, and a map.
//!
//! In: a [`Recording`], [`LocateParams`]. Out: [`Located`]. An observation between two readings cuts the step: the reading's speed and yaw rate
//! hold over both parts, its angles belong to the end. Frames and units as in [`crate::recording`].

use super::Recording;
use crate::drive::{InstrumentNoise, Reading};
use crate::geometry::{Pose, Transform};
use crate::random::{Stage, Streams};
use crate::slam::{Counters, Estimate, Feature, Landmark, Slam, SlamError, SlamParams, Visibility};

/// Where the drive starts, and how good the instruments are.
#[derive(Clone, Debug, PartialEq)]
pub struct LocateParams {
    pub slam: SlamParams,
    pub noise: InstrumentNoise,
    /// Of a feature's range (metres), bearing and elevation (radians).
    pub feature_sigmas: [f64; 3],
    pub start: Pose,
    pub rover_from_sensor: Transform,
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
    /// Of the likeliest particle; positions in the map.
    pub landmarks: Vec<Landmark>,
    /// Mean and standard deviation of the share of the counted way that was driven.
    pub odometry_scale: (f64, f64),
    /// What was left out, by cause.
    pub left_out: Counters,
}

/// Runs the filter over a recording.
pub fn locate(recording: &Recording, params: &LocateParams) -> Result<Located, SlamError> {
    let LocateParams { slam, noise, feature_sigmas, start, rover_from_sensor, seed } = params;
    let mut filter = Slam::new(slam, noise, start, rover_from_sensor)?.with_feature_sigmas(feature_sigmas);
    // Nothing is known of where the sensor looked and saw nothing.
    let visibility = Visibility::blind(f64::INFINITY);
    let reads_features = matches!(slam, SlamParams::Fastslam(_));
    let mut steps = Vec::with_capacity(recording.readings.len());
    for (number, (time_s, reading, features)) in cut(recording).into_iter().enumerate() {
        let streams = Streams { seed: *seed, scene: 0, attempt: 0, stage: Stage::Slam, step: number as u32 };
        filter.step(&reading)?;
        let estimate = match features.filter(|_| reads_features) {
            Some(features) => filter.observe_features(features, &visibility, &streams)?,
            None => filter.estimate(),
        };
        steps.push(Step { time_s, estimate });
    }
    let start_m = start.position_m.to_array();
    let mut landmarks = filter.best().1.to_vec();
    for landmark in &mut landmarks {
        landmark.mean_m = std::array::from_fn(|axis| landmark.mean_m[axis] + start_m[axis]);
    }
    Ok(Located { steps, landmarks, odometry_scale: filter.odometry_scale(), left_out: filter.counters() })
}

/// Readings and observations in one order: a step that ends at each time of either.
fn cut(recording: &Recording) -> Vec<(f64, Reading, Option<&[Feature]>)> {
    let mut steps = Vec::new();
    let mut observations = recording.observations.iter().peekable();
    let mut now_s = recording.readings.first().map_or(0.0, |&(time_s, _)| time_s);
    for &(end_s, reading) in &recording.readings {
        while let Some((time_s, features)) = observations.next_if(|(time_s, _)| *time_s < end_s) {
            let part = Reading { dt_s: time_s - now_s, roll_rad: None, pitch_rad: None, yaw_rad: None, ..reading };
            steps.push((*time_s, part, Some(features.as_slice())));
            now_s = *time_s;
        }
        let features = observations.next_if(|(time_s, _)| *time_s == end_s).map(|(_, features)| features.as_slice());
        steps.push((end_s, Reading { dt_s: end_s - now_s, ..reading }, features));
        now_s = end_s;
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_cut_steps_cover_the_time_once_and_end_at_every_observation() {
        let odometry = "time_s,speed_mps,yaw_rate_radps,yaw_rad\n1,0,0,0\n2,1,0.5,0.5\n3,1,0.5,1\n";
        let features = "time_s,range_m,bearing_rad\n1,4,0\n1.25,4,0\n1.5,4,0\n3,4,0\n";
        let recording = Recording::read(("o", odometry), Some(("f", features))).expect("a recording");
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
}
