//! Readings and features -> a cloud of particles: FastSLAM 2.0; of one Gaussian that is never drawn: registration alone, and dead reckoning.
//!
//! In: control steps, angle readings, a sweep's features and surface. Out: [`Estimate`](super::Estimate)s relative to the start. Source: Montemerlo
//! et al. 2003; order of T. Bailey's fastslam2r: weigh, resample, then draw, so that no fresh draw is thrown away. Deviation: draws of a Latin
//! hypercube, whose margins a hundred particles fill evenly. Between sweeps every particle is a local Kalman filter whose covariance is carried; it
//! is drawn from only when a sweep had features. The constant bias of roll and pitch is not a state: what it
//! does to the pose is added to the covariance that is told (a consider filter, Schmidt 1966), because on a straight drive a map that is tilted as a
//! whole contradicts no feature. Where the rover turns, landmarks would observe the bias, and the sigma of z is too large.

use super::cloud::{Cloud, ParticleMoments};
use super::ground_slope::GroundSlope;
use super::keyframe::Keyframe;
use super::landmark::Landmark;
use super::matrix::Vector;
use super::measurement::Mounting;
use super::motion::{Control, GaussianPose, MotionNoise, PITCH, READING_GATE, ROLL, YAW, angle_sigma_rad};
use super::observation::{FEATURE_SIGMA, Feature, FeatureNoise, choose};
use super::particle::{Association, Particle, Scratch, SweepObservations};
use super::per_particle::{Drive, ReadAngle, TakeFix, UpdateMap, UpdatePose};
use super::registration::{Registration, Surface};
use super::scale::ScaleFactor;
use super::visibility::Visibility;
use super::{Counters, FastslamParams};
use crate::drive::{InstrumentNoise, Reading};
use crate::math;
use crate::random::{Purpose, Streams};
use crate::wide::in_fours;

/// With fewer of the first particles' lines left, the position sigmas are too small.
const FEW_ANCESTORS: usize = 3;

/// What the last sweep brought; of matches and landmarks, the likeliest particle's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ScanCounts {
    pub features: u32,
    pub matched: u32,
    pub new_landmarks: u32,
    pub landmarks: u32,
}

/// A cloud of particles.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    cloud: Cloud,
    started: bool,
    /// The cloud's moments right after the last sweep, before the draw; until the next step.
    at_sweep: Option<ParticleMoments>,
    drew: bool,
    scan: ScanCounts,
    counters: Counters,
    stops_without_match: u32,
    mean_innovation: Option<f64>,
    keyframe: Option<Keyframe>,
    motion: MotionNoise,
    ground: GroundSlope,
    mounting: Mounting,
    imu_variance_rad2: f64,
    imu_bias_variance_rad2: f64,
    /// Level way driven forwards: how far a bias of the pitch of one radian has lowered z.
    level_way_m: f64,
    sun_variance_rad2: f64,
    feature_noise: FeatureNoise,
    resample_below: f64,
    max_features: usize,
}

impl Filter {
    /// `attitude`: roll, pitch and yaw believed until the first reading replaces them.
    pub(super) fn new(
        params: &FastslamParams,
        noise: &InstrumentNoise,
        attitude: Vector<3>,
        mounting: Mounting,
    ) -> Filter {
        let mean = [0.0, 0.0, 0.0, attitude[0], attitude[1], attitude[2]];
        let belief = GaussianPose { mean, scale: ScaleFactor::of_slip(noise.slip), ..GaussianPose::default() };
        Filter {
            cloud: Cloud::new(params.particles as usize, belief),
            started: false,
            at_sweep: None,
            drew: false,
            scan: ScanCounts::default(),
            counters: Counters::default(),
            stops_without_match: 0,
            mean_innovation: None,
            keyframe: None,
            motion: MotionNoise::new(noise, params.motion_inflation),
            ground: GroundSlope::default(),
            mounting,
            imu_variance_rad2: angle_sigma_rad(noise.imu_rad) * angle_sigma_rad(noise.imu_rad),
            imu_bias_variance_rad2: noise.imu_bias_rad * noise.imu_bias_rad,
            level_way_m: 0.0,
            sun_variance_rad2: angle_sigma_rad(noise.sun_rad) * angle_sigma_rad(noise.sun_rad),
            feature_noise: FeatureNoise { default_sigmas: FEATURE_SIGMA, inflation: params.measurement_inflation },
            resample_below: params.resample_below,
            max_features: params.max_features as usize,
        }
    }

    /// Other noise of features than that of sweeps, for those that do not tell their own.
    pub(super) fn set_feature_sigmas(&mut self, sigmas: &Vector<3>) {
        self.feature_noise.default_sigmas = *sigmas;
    }

    /// One control step and the angles read after it.
    pub(super) fn step(&mut self, reading: &Reading) {
        self.at_sweep = None;
        match Control::of(reading) {
            Some(control) => {
                let driven = Control { distance_m: self.cloud.scale().0 * control.distance_m, ..control };
                self.level_way_m += driven.distance_m * math::sin_cos(self.cloud.angle(PITCH).0).1;
                let angles_rad = [reading.roll_rad, reading.pitch_rad];
                self.ground.take(driven, angles_rad, self.imu_variance_rad2, &mut self.motion);
                in_fours(Drive { particles: &mut self.cloud.particles, control, noise: &self.motion });
            }
            None => self.counters.not_finite += 1,
        }
        let angles = [
            (ROLL, reading.roll_rad, self.imu_variance_rad2),
            (PITCH, reading.pitch_rad, self.imu_variance_rad2),
            (YAW, reading.yaw_rad, self.sun_variance_rad2),
        ];
        let mut is_weighed = false;
        for (component, angle_rad, variance_rad2) in angles {
            if let Some(angle_rad) = angle_rad {
                is_weighed |= self.read(component, angle_rad, variance_rad2);
            }
        }
        self.started = true;
        // Weights that nothing changed are left as they are, to the bit.
        if is_weighed {
            self.normalise();
        }
    }

    /// Whether it changed the weights.
    fn read(&mut self, component: usize, angle_rad: f64, variance_rad2: f64) -> bool {
        if !angle_rad.is_finite() {
            self.counters.not_finite += 1;
            return false;
        }
        if !self.started {
            // Nothing is known of the attitude before the first reading: it is taken as it is.
            for Particle { belief, .. } in &mut self.cloud.particles {
                belief.mean[component] = math::wrap_angle(angle_rad);
                belief.covariance[component] = [0.0; 6];
                belief.covariance.iter_mut().for_each(|row| row[component] = 0.0);
                belief.covariance[component][component] = variance_rad2;
            }
            return false;
        }
        // Decided once for all: particles that use a reading and particles that do not could not be compared.
        let (mean_rad, spread_rad2) = self.cloud.angle(component);
        let apart = math::wrap_angle(angle_rad - mean_rad);
        if apart * apart > READING_GATE * (spread_rad2 + variance_rad2) {
            self.counters.gated += 1;
            return false;
        }
        in_fours(ReadAngle { particles: &mut self.cloud.particles, component, angle_rad, variance_rad2 });
        true
    }

    fn normalise(&mut self) {
        self.counters.weight_collapses += u32::from(!self.cloud.normalise());
    }

    /// The cloud, as it is.
    pub(super) fn cloud(&self) -> &Cloud {
        &self.cloud
    }

    /// A sweep's features, its surface where sweeps are laid on one another, and where it looked. The streams stand at the step.
    pub(super) fn observe(
        &mut self,
        found: &[Feature],
        surface: Option<Surface>,
        visibility: &Visibility,
        streams: &Streams,
    ) {
        // After a turn the instrument's bias leans another way.
        let tilt_rad2 = self.cloud.angle(ROLL).1.max(self.cloud.angle(PITCH).1) + self.imu_bias_variance_rad2;
        // First, so that features are looked for from where the surfaces tell that the rover stands.
        let surface = surface.filter(Surface::is_enough);
        let is_registered = surface.as_ref().is_some_and(|surface| self.register(surface, tilt_rad2));
        if is_registered {
            self.normalise();
        }
        let (features, unusable) = choose(found, &self.feature_noise, self.max_features);
        self.counters.not_finite += unusable;
        self.counters.passed_over += (found.len() - features.len()) as u32 - unusable;
        let prior = self.cloud.weights();
        let mut scratch = Scratch::default();
        let seen = SweepObservations { observations: &features, mounting: &self.mounting };
        in_fours(UpdatePose { particles: &mut self.cloud.particles, seen, scratch: &mut scratch });
        self.mean_innovation = self.cloud.innovation(&prior);
        if !features.is_empty() {
            self.normalise();
        }
        let moments = self.cloud.moments();
        let kinds = &self.cloud.likeliest().associations;
        let count = |is: fn(&Association) -> bool| kinds.iter().filter(|a| is(a)).count() as u32;
        self.scan.features = features.len() as u32;
        self.scan.matched = count(|a| matches!(a, Association::Matched(_)));
        self.scan.new_landmarks = count(|a| matches!(a, Association::New));
        self.counters.ambiguous += count(|a| matches!(a, Association::Ambiguous(_) | Association::Unclear));
        self.stops_without_match =
            if self.scan.matched > 0 || is_registered { 0 } else { self.stops_without_match + 1 };

        let telling =
            |p: &Particle| p.associations.iter().any(|a| matches!(a, Association::Matched(_) | Association::New));
        let draws = self.cloud.particles.iter().any(telling);
        let thin = moments.effective_samples < self.resample_below * self.cloud.particles.len() as f64;
        // Without a draw as well: readings alone wear weights thin while no feature is matched.
        if thin {
            self.cloud.resample(streams.open(Purpose::SlamResample).uniform(0));
        }
        if draws {
            // An error of the heading here turns all that is mapped after it, and later stops can only choose among the headings that were
            // drawn: a Latin hypercube covers them evenly.
            let mut normals = vec![[0.0; 6]; self.cloud.particles.len()];
            streams.open(Purpose::SlamSample).fill_normal_hypercube(0, &mut normals);
            for (particle, normals) in self.cloud.particles.iter_mut().zip(&normals) {
                particle.belief.draw(normals);
            }
            self.drew = true;
        }
        let seen = SweepObservations { observations: &features, mounting: &self.mounting };
        in_fours(UpdateMap { particles: &mut self.cloud.particles, seen, visibility, scratch: &mut scratch });
        let map = &self.cloud.likeliest().landmarks;
        self.scan.landmarks = map.iter().filter(|landmark| landmark.is_sure()).count() as u32;
        self.at_sweep = Some(moments);
        if let Some(surface) = surface {
            self.keyframe = Some(Keyframe::new(surface, tilt_rad2, &mut self.cloud.particles));
        }
    }

    /// Lays a surface on the keyframe's and lets every particle take in where it lies; whether it was found there.
    fn register(&mut self, surface: &Surface, tilt_rad2: f64) -> bool {
        let Some(keyframe) = &self.keyframe else { return false };
        match keyframe.register(surface, tilt_rad2, &self.cloud.particles, &self.cloud.weights()) {
            Registration::Fixed(fix) => {
                in_fours(TakeFix { particles: &mut self.cloud.particles, fix: &fix });
                true
            }
            Registration::Apart => false,
            Registration::Gated => {
                self.counters.gated += 1;
                false
            }
        }
    }

    /// The belief now: right after a sweep that of before the draw, whose variance is lower.
    pub(super) fn believed(&self) -> ParticleMoments {
        let mut moments = self.at_sweep.clone().unwrap_or_else(|| self.cloud.moments());
        let by_pitch = [0.0, 0.0, -self.level_way_m, 0.0, 1.0, 0.0];
        moments.covariance[ROLL][ROLL] += self.imu_bias_variance_rad2;
        for r in 0..6 {
            for c in 0..6 {
                moments.covariance[r][c] += by_pitch[r] * by_pitch[c] * self.imu_bias_variance_rad2;
            }
        }
        moments
    }

    pub(super) fn scan(&self) -> ScanCounts {
        self.scan
    }

    pub(super) fn counters(&self) -> Counters {
        self.counters
    }

    /// Whether a stop showed features or a surface yet.
    fn has_map(&self) -> bool {
        self.drew || self.keyframe.is_some()
    }

    /// Whether the last stop's features or surface were found in the map.
    pub(super) fn found_again(&self) -> bool {
        self.has_map() && self.stops_without_match == 0
    }

    /// Found nothing again for more than two stops.
    pub(super) fn lost(&self) -> bool {
        self.stops_without_match > 2 || !self.has_map()
    }

    pub(super) fn mean_innovation(&self) -> Option<f64> {
        self.mean_innovation
    }

    /// Too few ancestors are left for the positions' spread to mean much.
    pub(super) fn optimistic(&self) -> bool {
        self.drew && self.cloud.ancestors() < FEW_ANCESTORS
    }

    /// Pose and map of the likeliest particle, relative to the start.
    pub(super) fn best(&self) -> (&Vector<6>, &[Landmark]) {
        let particle = self.cloud.likeliest();
        (&particle.belief.mean, &particle.landmarks)
    }
}
