//! The features of a sweep -> those that are taken in, and how far they err.
//!
//! In: [`Feature`]s of the extractor or of one's own front end, sensor frame; metres, radians. Out: [`Observation`]s, and the variances that the
//! filter works with. Own choice: features of many points first, and apart from one another, because
//! association easily confuses two that are close.

use super::associate::GATE;
use super::matrix::{Vector, square};
use super::measurement::{self, Polar};
use super::motion::DEGREE;
use crate::math;

/// Base noise of a feature: range, metres; bearing and elevation, radians. Covers the extraction's own errors once inflated.
pub(super) const FEATURE_SIGMA: Vector<3> = [0.03, DEGREE, DEGREE];
/// Least noise of a feature: with less, linearisation errors look like information.
const LEAST_FEATURE_SIGMA: Vector<3> = [0.01, 0.25 * DEGREE, 0.25 * DEGREE];
/// Features of one sweep stand at least this far apart, metres.
const FEATURE_SPACING_M: f64 = 0.3;

/// A thing seen in a sweep, sensor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feature {
    /// Range (metres), bearing and elevation (radians).
    pub polar: Polar,
    /// How many points of the sweep lie on it.
    pub points: u32,
    /// Half its width across the line of sight, metres.
    pub half_width_m: f64,
    /// Which landmark it is, where a log tells it; features of sweeps never do.
    pub known: Option<u32>,
    /// Its own standard deviations of range (metres), bearing and elevation (radians), where a log tells them; the filter's otherwise.
    pub sigmas: [Option<f64>; 3],
}

impl Feature {
    /// Whether a filter can take it in; decided once, for all particles alike.
    fn is_usable(&self) -> bool {
        measurement::is_usable(&self.polar)
            && self.sigmas.iter().flatten().all(|sigma| *sigma > 0.0 && sigma.is_finite())
    }
}

/// How far features err.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FeatureNoise {
    /// Range (metres), bearing and elevation (radians), of features that do not tell theirs.
    pub default_sigmas: Vector<3>,
    /// Factor on variances.
    pub inflation: f64,
}

impl FeatureNoise {
    /// What the filter works with for standard deviations, each its own or the default.
    fn variances(&self, sigmas: &[Option<f64>; 3]) -> Vector<3> {
        std::array::from_fn(|i| {
            let sigma = sigmas[i].unwrap_or(self.default_sigmas[i]);
            let sigma = (sigma * self.inflation.sqrt()).max(LEAST_FEATURE_SIGMA[i]);
            sigma * sigma
        })
    }
}

/// A feature that was chosen, with what all particles need of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Observation {
    pub feature: Feature,
    /// Its point in the sensor frame.
    pub point_m: Vector<3>,
    /// Of range, bearing and elevation.
    pub variances: Vector<3>,
    /// ln of the likelihood that a match has on the gate, with a landmark that was seen with the default noise, or its own where that is
    /// more: what it counts as where it is new, or where it is not clear which landmark it is.
    pub ln_unmatched: f64,
}

impl Observation {
    pub(super) fn new(feature: Feature, noise: &FeatureNoise) -> Observation {
        let (variances, usual) = (noise.variances(&feature.sigmas), noise.variances(&[None; 3]));
        let volume: f64 = (0..3).map(|i| std::f64::consts::TAU * (variances[i] + variances[i].max(usual[i]))).product();
        let ln_unmatched = -0.5 * (GATE + math::ln(volume));
        Observation { feature, point_m: measurement::point_m(&feature.polar), variances, ln_unmatched }
    }
}

/// Of the usable features so many at most: those of most points (of two the less noisy, and the nearer), apart from one another, nearest
/// first; and how many were not usable.
pub(super) fn choose(found: &[Feature], noise: &FeatureNoise, most: usize) -> (Vec<Observation>, u32) {
    let usable = found.iter().copied().filter(Feature::is_usable);
    let mut order: Vec<Observation> = usable.map(|feature| Observation::new(feature, noise)).collect();
    let unusable = (found.len() - order.len()) as u32;
    let volume = |observation: &Observation| observation.variances.iter().product::<f64>();
    order.sort_by(|a, b| {
        let nearer = || a.feature.polar[0].total_cmp(&b.feature.polar[0]);
        b.feature.points.cmp(&a.feature.points).then_with(|| volume(a).total_cmp(&volume(b))).then_with(nearer)
    });
    let mut chosen: Vec<Observation> = Vec::with_capacity(most.min(order.len()));
    for observation in order {
        if chosen.len() == most {
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
    (chosen, unusable)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: FeatureNoise = FeatureNoise { default_sigmas: [0.03, 0.02, 0.04], inflation: 4.0 };

    fn feature(range_m: f64, sigmas: [Option<f64>; 3]) -> Feature {
        Feature { polar: [range_m, 0.1, 0.0], points: 1, half_width_m: 0.0, known: None, sigmas }
    }

    #[test]
    fn exact_a_features_own_noise_is_inflated_and_has_the_same_floor() {
        let variances = |sigmas| Observation::new(feature(2.0, sigmas), &NOISE).variances.map(f64::sqrt);
        let close = |got: Vector<3>, want: Vector<3>| (0..3).all(|i| (got[i] / want[i] - 1.0).abs() < 1e-12);
        assert!(close(variances([None; 3]), [0.06, 0.04, 0.08]));
        assert!(close(variances([Some(0.5), None, Some(0.1)]), [1.0, 0.04, 0.2]));
        let floored = variances([Some(1e-9), Some(f64::MIN_POSITIVE), Some(0.001)]);
        assert!(close(floored, LEAST_FEATURE_SIGMA), "{floored:?}");
    }

    #[test]
    fn extreme_noise_that_is_none_leaves_the_feature_out_and_is_counted() {
        for sigma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let found = [feature(2.0, [None, Some(sigma), None]), feature(3.0, [Some(0.1); 3])];
            let (chosen, unusable) = choose(&found, &NOISE, 9);
            assert_eq!((chosen.len(), chosen[0].feature, unusable), (1, found[1], 1), "{sigma}");
        }
    }

    #[test]
    fn law_of_two_features_that_are_close_the_less_noisy_one_is_kept() {
        let (near, sure) = (feature(2.0, [Some(0.3), None, None]), feature(2.1, [Some(0.05), None, None]));
        let (chosen, _) = choose(&[near, sure], &NOISE, 9);
        assert_eq!(chosen.iter().map(|o| o.feature).collect::<Vec<_>>(), [sure]);
        // As noisy as one another: the nearer.
        let (chosen, _) = choose(&[feature(2.1, [None; 3]), feature(2.0, [None; 3])], &NOISE, 9);
        assert_eq!(chosen.iter().map(|o| o.feature.polar[0]).collect::<Vec<_>>(), [2.0]);
    }
}
