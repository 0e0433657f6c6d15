//! A feature seen from an exact pose -> a landmark, where it is and whether it is there at all.
//!
//! In: [`Feature`]s, a view of the sensor. Out: [`Landmark`]s; metres, relative to the start. Source: Montemerlo et al. 2003, with the log-odds of a
//! landmark's existence by what was seen and what should have been. Not modelled: things that move.

use super::kalman;
use super::matrix::{Matrix, Vector, cholesky, product, sum, transpose};
use super::measurement::{SensorView, innovation};
use super::observation::Feature;

/// Log-odds of existence: of a new landmark, what a match and a miss add, between which bounds, and below which it is taken out.
const NEW: f64 = 0.4;
const SEEN: f64 = 0.85;
pub(super) const MISSED: f64 = -0.4;
const BOUNDS: (f64, f64) = (-2.0, 4.0);
const DELETE: f64 = -1.0;
/// Landmarks above this are counted as there.
const SURE: f64 = 0.8;

/// A mapped feature; position relative to the start.
#[derive(Clone, Debug)]
pub struct Landmark {
    pub mean_m: Vector<3>,
    pub covariance_m2: Matrix<3, 3>,
    /// Log-odds of being there at all.
    pub existence: f64,
    pub known: Option<u32>,
}

impl Landmark {
    /// Where a feature lies, seen from an exact pose.
    #[inline(always)]
    pub(super) fn new(feature: &Feature, view: &SensorView, variances: &Vector<3>) -> Landmark {
        let (mean_m, covariance_m2) = view.locate(&feature.polar, variances);
        Landmark { mean_m, covariance_m2, existence: NEW, known: feature.known }
    }

    #[inline(always)]
    pub(super) fn see(&mut self) {
        self.existence += SEEN;
    }

    #[inline(always)]
    pub(super) fn miss(&mut self) {
        self.existence += MISSED;
    }

    /// Kalman update of the landmark from an exact pose.
    #[inline(always)]
    pub(super) fn kalman_update(&mut self, feature: &Feature, view: &SensorView, noise: &Matrix<3, 3>) {
        let Some(prediction) = view.predict(&self.mean_m) else { return };
        let hm = &prediction.by_landmark;
        // A new landmark's covariance is symmetric to rounding only: P H', not H P.
        let ph = product(&self.covariance_m2, &transpose(hm));
        let Some(factor) = cholesky(&sum(&product(hm, &ph), noise)) else { return };
        let innovation = innovation(&feature.polar, &prediction.polar);
        let belief = (&mut self.mean_m, &mut self.covariance_m2);
        kalman::update(belief, hm, &transpose(&ph), &factor, &innovation, noise);
    }

    /// One more sighting or miss counts however many there were before.
    #[inline(always)]
    pub(super) fn bound_existence(&mut self) {
        self.existence = self.existence.clamp(BOUNDS.0, BOUNDS.1);
    }

    /// Whether it stays in the map.
    pub(super) fn is_kept(&self) -> bool {
        self.existence >= DELETE
    }

    /// Whether it counts as there.
    pub(super) fn is_sure(&self) -> bool {
        self.existence >= SURE
    }
}
