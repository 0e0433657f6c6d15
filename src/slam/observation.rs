//! The features of a sweep -> those that are taken in, and how far they err.
//!
//! In: [`Feature`]s of the extractor or of one's own front end, sensor frame; metres, radians. Out: [`Observation`]s, and the variances that the
//! filter works with. Own choice: features of many points first, and apart from one another, because
//! association easily confuses two that are close.

use super::associate::GATE;
use super::matrix::{Vector, square};
use super::measurement::{self, Polar, usable};
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

/// How far features err.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FeatureNoise {
    /// Of those that do not tell it themselves.
    pub sigmas: Vector<3>,
    /// Factor on variances.
    pub inflation: f64,
}

impl FeatureNoise {
    /// What the filter works with for a feature.
    fn variances(&self, feature: &Feature) -> Vector<3> {
        std::array::from_fn(|i| {
            let stated = feature.sigmas[i].unwrap_or(self.sigmas[i]);
            let sigma = (stated * self.inflation.sqrt()).max(LEAST_FEATURE_SIGMA[i]);
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
    /// ln of the likelihood that a match has on the gate: what it counts as where it is new, or of nobody knows which landmark.
    pub ln_unmatched: f64,
}

impl Observation {
    pub(super) fn new(feature: Feature, noise: &FeatureNoise) -> Observation {
        let variances = noise.variances(&feature);
        let volume: f64 = variances.iter().map(|v| std::f64::consts::TAU * 2.0 * v).product();
        let ln_unmatched = -0.5 * (GATE + math::ln(volume));
        Observation { feature, point_m: measurement::point_m(&feature.polar), variances, ln_unmatched }
    }
}

/// Of the usable features so many at most: those of most points (the nearer of two), apart from one another, nearest first; and how many
/// were not usable.
pub(super) fn choose(found: &[Feature], noise: &FeatureNoise, most: usize) -> (Vec<Observation>, u32) {
    let mut order: Vec<Feature> = found.iter().copied().filter(|f| usable(&f.polar)).collect();
    let unusable = (found.len() - order.len()) as u32;
    order.sort_by(|a, b| b.points.cmp(&a.points).then(a.polar[0].total_cmp(&b.polar[0])));
    let mut chosen: Vec<Observation> = Vec::with_capacity(most.min(order.len()));
    for observation in order.into_iter().map(|feature| Observation::new(feature, noise)) {
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
