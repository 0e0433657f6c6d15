//! Readings and features -> a cloud of particles: FastSLAM 2.0, and dead reckoning as its one-particle case.
//!
//! In: control steps, angle readings, a sweep's features and surface. Out: [`Estimate`](super::Estimate)s relative to the start. Source: Montemerlo et al.
//! 2003; order of T. Bailey's fastslam2r: weigh, resample, then draw, so that no fresh draw is thrown away. Deviation: draws
//! of a Latin hypercube, whose margins a hundred particles fill evenly. Between sweeps every particle is a local Kalman filter whose covariance is carried; it is drawn from only when a sweep had features or a surface. Not
//! estimated: the constant bias of roll and pitch; what it leaves in the pose is considered (Schmidt 1966) in what is believed: on a straight
//! way a map that is tilted as a whole contradicts no feature. Where the rover turns, landmarks do tell of it, and the sigma of z is too large.

use super::keyframe::Keyframe;
use super::matrix::{Matrix, Vector, square};
use super::measurement::{Mounting, usable};
use super::motion::{Control, GaussianPose, GroundSlope, MotionNoise, PITCH, READING_GATE, ROLL, YAW, angle_sigma_rad};
use super::particle::{
    Association, EXISTENCE_SURE, Feature, Landmark, Observation, Particle, Scratch, SweepObservations,
};
use super::per_particle::{Chart, Drive, ReadAngle, Refine, TakeFix};
use super::registration::{Registration, Surface};
use super::scale::ScaleFactor;
use super::visibility::Visibility;
use super::weights::{Genealogy, effective_samples, exponentials, normalise, systematic};
use super::{Counters, FastslamParams};
use crate::drive::{InstrumentNoise, Reading};
use crate::math;
use crate::random::{Purpose, Streams};
use crate::wide::in_fours;

/// Base noise of a feature: range, metres; bearing and elevation, radians. Covers the extraction's own errors once inflated.
const FEATURE_SIGMA: Vector<3> = [0.03, DEGREE, DEGREE];
/// Least noise of a feature: with less, linearisation errors look like information.
const LEAST_FEATURE_SIGMA: Vector<3> = [0.01, 0.25 * DEGREE, 0.25 * DEGREE];
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Features of one sweep stand at least this far apart, metres.
const FEATURE_SPACING_M: f64 = 0.3;
/// With fewer of the first particles' lines left, the position sigmas are too small.
const FEW_ANCESTORS: usize = 3;

/// Mean and covariance of the whole cloud, and how good it is; position relative to the start.
#[derive(Clone, Debug)]
pub(super) struct ParticleMoments {
    pub mean: Vector<6>,
    pub covariance: Matrix<6, 6>,
    pub effective_samples: f64,
}

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
    particles: Vec<Particle>,
    spare: Vec<Particle>,
    /// The likeliest before the last resampling, or a child of it: the likeliest as long as all weigh the same.
    favourite: usize,
    started: bool,
    /// Mixture right after the last sweep, before the draw; until the next step.
    at_sweep: Option<ParticleMoments>,
    ancestry: Genealogy,
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
    feature_variances: Vector<3>,
    measurement_inflation: f64,
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
        let count = params.particles as usize;
        let mean = [0.0, 0.0, 0.0, attitude[0], attitude[1], attitude[2]];
        let belief = GaussianPose { mean, scale: ScaleFactor::of_slip(noise.slip), ..GaussianPose::default() };
        let log_weight = -math::ln(count as f64);
        let particle = Particle { belief, log_weight, ..Particle::default() };
        Filter {
            particles: vec![particle.clone(); count],
            spare: vec![particle; count],
            favourite: 0,
            started: false,
            at_sweep: None,
            ancestry: Genealogy::new(count),
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
            feature_variances: feature_variances(&FEATURE_SIGMA, params.measurement_inflation),
            measurement_inflation: params.measurement_inflation,
            resample_below: params.resample_below,
            max_features: params.max_features as usize,
        }
    }

    /// Other noise of features than that of sweeps.
    pub(super) fn set_feature_sigmas(&mut self, sigmas: &Vector<3>) {
        self.feature_variances = feature_variances(sigmas, self.measurement_inflation);
    }

    /// One control step and the angles read after it.
    pub(super) fn step(&mut self, reading: &Reading) {
        self.at_sweep = None;
        match Control::of(reading) {
            Some(control) => {
                let driven = Control { distance_m: self.scale().0 * control.distance_m, ..control };
                self.level_way_m += driven.distance_m * math::sin_cos(self.angle(PITCH).0).1;
                let angles_rad = [reading.roll_rad, reading.pitch_rad];
                self.ground.take(driven, angles_rad, self.imu_variance_rad2, &mut self.motion);
                in_fours(Drive { particles: &mut self.particles, control, noise: &self.motion });
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
            self.normalise_weights();
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
            for Particle { belief, .. } in &mut self.particles {
                belief.mean[component] = math::wrap_angle(angle_rad);
                belief.covariance[component] = [0.0; 6];
                belief.covariance.iter_mut().for_each(|row| row[component] = 0.0);
                belief.covariance[component][component] = variance_rad2;
            }
            return false;
        }
        // Decided once for all: particles that use a reading and particles that do not could not be compared.
        let (mean_rad, spread_rad2) = self.angle(component);
        let apart = math::wrap_angle(angle_rad - mean_rad);
        if apart * apart > READING_GATE * (spread_rad2 + variance_rad2) {
            self.counters.gated += 1;
            return false;
        }
        in_fours(ReadAngle { particles: &mut self.particles, component, angle_rad, variance_rad2 });
        true
    }

    /// Keeps the log weights normalised, so that none drifts out of range over a long drive.
    fn normalise_weights(&mut self) {
        let mut logs: Vec<f64> = self.particles.iter().map(|p| p.log_weight).collect();
        if !normalise(&mut logs) {
            self.counters.weight_collapses += 1;
        }
        for (particle, log) in self.particles.iter_mut().zip(logs) {
            particle.log_weight = log;
        }
    }

    /// The particles' weights; they sum to 1.
    pub(super) fn weights(&self) -> Vec<f64> {
        exponentials(self.particles.iter().map(|p| p.log_weight).collect())
    }

    /// Mean and variance of one angle over the cloud.
    pub(super) fn angle(&self, component: usize) -> (f64, f64) {
        let reference = self.particles[0].belief.mean[component];
        // Within a step the weights are not normalised, and their logarithms may be large.
        let most = self.particles[self.likeliest()].log_weight;
        let weights = exponentials(self.particles.iter().map(|p| p.log_weight - most).collect());
        let (mut total, mut first, mut second, mut own) = (0.0, 0.0, 0.0, 0.0);
        for (particle, weight) in self.particles.iter().zip(weights) {
            let d = math::wrap_angle(particle.belief.mean[component] - reference);
            total += weight;
            first += weight * d;
            second += weight * d * d;
            own += weight * particle.belief.covariance[component][component];
        }
        let mean = first / total;
        (math::wrap_angle(reference + mean), (second / total - mean * mean).max(0.0) + own / total)
    }

    /// Mean and variance of the odometry's scale over the cloud.
    pub(super) fn scale(&self) -> (f64, f64) {
        // One that was known from the start is the same for all.
        if self.particles.iter().all(|p| p.belief.scale.is_known()) {
            return (self.particles[self.likeliest()].belief.scale.mean, 0.0);
        }
        let (mut mean, mut second) = (0.0, 0.0);
        for (particle, weight) in self.particles.iter().zip(self.weights()) {
            let scale = &particle.belief.scale;
            mean += weight * scale.mean;
            second += weight * (scale.variance + scale.mean * scale.mean);
        }
        (mean, (second - mean * mean).max(0.0))
    }

    /// A sweep's features, what stands up in it where sweeps are laid on one another, and where it looked. The streams stand at the step.
    pub(super) fn observe(
        &mut self,
        found: &[Feature],
        surface: Option<Surface>,
        visibility: &Visibility,
        streams: &Streams,
    ) {
        // After a turn the instrument's bias leans another way.
        let tilt_rad2 = self.angle(ROLL).1.max(self.angle(PITCH).1) + self.imu_bias_variance_rad2;
        // First, so that features are looked for from where the surfaces tell that the rover stands.
        let surface = surface.filter(Surface::is_enough);
        let is_registered = surface.as_ref().is_some_and(|surface| self.register(surface, tilt_rad2));
        if is_registered {
            self.normalise_weights();
        }
        let features = self.choose(found);
        let prior = self.weights();
        let mut scratch = Scratch::default();
        let seen =
            SweepObservations { observations: &features, variances: &self.feature_variances, mounting: &self.mounting };
        in_fours(Refine { particles: &mut self.particles, seen, scratch: &mut scratch });
        self.mean_innovation = self.innovation(&prior);
        if !features.is_empty() {
            self.normalise_weights();
        }
        let mixture = self.mixture();
        let best = self.likeliest();
        let kinds = &self.particles[best].associations;
        let count = |is: fn(&Association) -> bool| kinds.iter().filter(|a| is(a)).count() as u32;
        self.scan.features = features.len() as u32;
        self.scan.matched = count(|a| matches!(a, Association::Matched(_)));
        self.scan.new_landmarks = count(|a| matches!(a, Association::New));
        self.counters.ambiguous += count(|a| matches!(a, Association::Ambiguous(_) | Association::Unclear));
        self.stops_without_match =
            if self.scan.matched > 0 || is_registered { 0 } else { self.stops_without_match + 1 };

        let telling =
            |p: &Particle| p.associations.iter().any(|a| matches!(a, Association::Matched(_) | Association::New));
        // A keyframe is of particles that know where they stood.
        let draws = surface.is_some() || self.particles.iter().any(telling);
        let thin = mixture.effective_samples < self.resample_below * self.particles.len() as f64;
        // Without a draw as well: readings alone wear weights thin while no feature is matched.
        if thin {
            let parents = systematic(&self.weights(), streams.open(Purpose::SlamResample).uniform(0));
            self.descend(&parents);
            self.ancestry.record(&parents);
        }
        if draws {
            // What a heading errs here turns all that is mapped after it, and only what is drawn can be found right later: so evenly, not by chance.
            let mut normals = vec![[0.0; 6]; self.particles.len()];
            streams.open(Purpose::SlamSample).fill_normal_hypercube(0, &mut normals);
            for (particle, normals) in self.particles.iter_mut().zip(&normals) {
                particle.belief.draw(normals);
            }
            self.drew = true;
        }
        let seen =
            SweepObservations { observations: &features, variances: &self.feature_variances, mounting: &self.mounting };
        in_fours(Chart { particles: &mut self.particles, seen, visibility, scratch: &mut scratch });
        let sure = |l: &&Landmark| l.existence >= EXISTENCE_SURE;
        self.scan.landmarks = self.particles[self.likeliest()].landmarks.iter().filter(sure).count() as u32;
        self.at_sweep = Some(mixture);
        if let Some(surface) = surface {
            self.keyframe = Some(Keyframe::new(surface, tilt_rad2, &mut self.particles));
        }
    }

    /// Lays a surface on the keyframe's and lets every particle take in where it lies; whether it was found there.
    fn register(&mut self, surface: &Surface, tilt_rad2: f64) -> bool {
        let Some(keyframe) = &self.keyframe else { return false };
        match keyframe.register(surface, tilt_rad2, &self.particles, &self.weights()) {
            Registration::Fixed(fix) => {
                in_fours(TakeFix { particles: &mut self.particles, fix: &fix });
                true
            }
            Registration::Apart => false,
            Registration::Gated => {
                self.counters.gated += 1;
                false
            }
        }
    }

    /// The usable features: those of most points (the nearer of two), apart from one another, nearest first.
    fn choose(&mut self, found: &[Feature]) -> Vec<Observation> {
        let mut order: Vec<Feature> = found.iter().copied().filter(|f| usable(&f.polar)).collect();
        self.counters.not_finite += (found.len() - order.len()) as u32;
        order.sort_by(|a, b| b.points.cmp(&a.points).then(a.polar[0].total_cmp(&b.polar[0])));
        let mut chosen: Vec<Observation> = Vec::with_capacity(self.max_features);
        for observation in order.into_iter().map(Observation::new) {
            if chosen.len() == self.max_features {
                break;
            }
            let near = |other: &Observation| {
                let apart: Vector<3> = std::array::from_fn(|i| observation.point_m[i] - other.point_m[i]);
                square(&apart) < FEATURE_SPACING_M * FEATURE_SPACING_M
            };
            // Known features cannot be doubles of one another.
            if observation.feature.known.is_some() || !chosen.iter().any(near) {
                chosen.push(observation);
            }
        }
        chosen.sort_by(|a, b| a.feature.polar[0].total_cmp(&b.feature.polar[0]));
        chosen
    }

    /// Normalised innovation squared of a match, averaged with the weights from before the sweep.
    fn innovation(&self, prior: &[f64]) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0.0);
        for (particle, weight) in self.particles.iter().zip(prior) {
            let matches = particle.associations.iter().filter(|a| matches!(a, Association::Matched(_))).count();
            sum += weight * particle.innovation_sum;
            count += weight * matches as f64;
        }
        (count > 0.0).then(|| sum / count)
    }

    fn descend(&mut self, parents: &[u32]) {
        let best = self.likeliest() as u32;
        self.favourite = parents.iter().position(|&parent| parent == best).unwrap_or(0);
        let equal = -math::ln(self.particles.len() as f64);
        for (child, &parent) in self.spare.iter_mut().zip(parents) {
            child.clone_from(&self.particles[parent as usize]);
            child.log_weight = equal;
        }
        std::mem::swap(&mut self.particles, &mut self.spare);
    }

    fn likeliest(&self) -> usize {
        let mut best = self.favourite;
        for (i, particle) in self.particles.iter().enumerate() {
            if particle.log_weight > self.particles[best].log_weight {
                best = i;
            }
        }
        best
    }

    /// Mean and covariance of the cloud as it is, angles as differences to the first particle's.
    fn mixture(&self) -> ParticleMoments {
        let weights = self.weights();
        let reference = self.particles[0].belief.mean;
        let apart = |mean: &Vector<6>| -> Vector<6> {
            std::array::from_fn(|i| {
                let d = mean[i] - reference[i];
                if i == ROLL || i == YAW { math::wrap_angle(d) } else { d }
            })
        };
        let mut shift = [0.0; 6];
        for (particle, &weight) in self.particles.iter().zip(&weights) {
            let d = apart(&particle.belief.mean);
            for i in 0..6 {
                shift[i] += weight * d[i];
            }
        }
        let mut covariance = [[0.0; 6]; 6];
        for (particle, &weight) in self.particles.iter().zip(&weights) {
            let d = apart(&particle.belief.mean);
            for r in 0..6 {
                for c in 0..6 {
                    let spread = (d[r] - shift[r]) * (d[c] - shift[c]);
                    covariance[r][c] += weight * (particle.belief.covariance[r][c] + spread);
                }
            }
        }
        let mut mean: Vector<6> = std::array::from_fn(|i| reference[i] + shift[i]);
        mean[ROLL] = math::wrap_angle(mean[ROLL]);
        mean[YAW] = math::wrap_angle(mean[YAW]);
        ParticleMoments { mean, covariance, effective_samples: effective_samples(&weights) }
    }

    /// The belief now: right after a sweep that of before the draw, whose variance is lower.
    pub(super) fn believed(&self) -> ParticleMoments {
        let mut moments = self.at_sweep.clone().unwrap_or_else(|| self.mixture());
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

    /// Found nothing again for more than two stops.
    pub(super) fn lost(&self) -> bool {
        self.stops_without_match > 2 || !self.drew
    }

    pub(super) fn mean_innovation(&self) -> Option<f64> {
        self.mean_innovation
    }

    pub(super) fn ancestors(&self) -> usize {
        self.ancestry.distinct()
    }

    /// Too few ancestors are left for the positions' spread to mean much.
    pub(super) fn optimistic(&self) -> bool {
        self.drew && self.ancestors() < FEW_ANCESTORS
    }

    /// Pose and map of the likeliest particle, relative to the start.
    pub(super) fn best(&self) -> (&Vector<6>, &[Landmark]) {
        let particle = &self.particles[self.likeliest()];
        (&particle.belief.mean, &particle.landmarks)
    }
}

/// What the filter works with for features of a stated noise.
fn feature_variances(sigmas: &Vector<3>, inflation: f64) -> Vector<3> {
    std::array::from_fn(|i| {
        let sigma = (sigmas[i] * inflation.sqrt()).max(LEAST_FEATURE_SIGMA[i]);
        sigma * sigma
    })
}

#[cfg(test)]
mod tests {
    use crate::drive::InstrumentNoise;
    use crate::geometry::{Pose, Transform};
    use crate::slam::{FastslamParams, Slam, SlamParams};

    #[test]
    fn exact_the_likeliest_particle_is_the_one_of_the_greatest_weight() {
        let noise = InstrumentNoise {
            imu_rad: 0.01,
            imu_bias_rad: 0.0,
            sun_rad: 0.03,
            odometry_m_per_sqrt_m: 0.05,
            sideways_m_per_sqrt_m: 0.0,
            slip: 0.0,
            heading_rad_per_sqrt_m: 0.03,
        };
        let params = SlamParams::Fastslam(FastslamParams { particles: 9, ..FastslamParams::default() });
        for likeliest in 0..9 {
            let mut slam = Slam::new(&params, &noise, &Pose::default(), &Transform::IDENTITY).expect("a filter");
            for (k, particle) in slam.filter.particles.iter_mut().enumerate() {
                particle.log_weight = -3.0 - k as f64 + if k == likeliest { 20.0 } else { 0.0 };
            }
            assert_eq!(slam.filter.likeliest(), likeliest);
            // Its children weigh as much as all others; the first of them is the likeliest still.
            let parents = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|child: u32| child.max(likeliest as u32));
            slam.filter.descend(&parents);
            assert_eq!(slam.filter.likeliest(), 0);
            let parents = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|child: u32| child.min(likeliest as u32));
            slam.filter.favourite = likeliest;
            slam.filter.descend(&parents);
            assert_eq!(slam.filter.likeliest(), likeliest);
        }
    }
}
