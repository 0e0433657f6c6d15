//! The same beams cast exactly and otherwise, before any noise -> how far the ranges are off.
//!
//! Errors are kept in a histogram of equal steps in their logarithm (2 % a bin), so that scenes add up in any order to the same
//! quantiles; the greatest is kept as it is.

use crate::geometry::{DVec3, Transform};
use crate::math;
use crate::scene::Scene;
use crate::sweep::params::Cast;
use crate::sweep::{Caster, Hit, Pattern};

/// The histogram reaches from a picometre to ten kilometres; below it an error counts as none.
const LEAST_M: f64 = 1e-12;
const BINS_A_DECADE: f64 = 116.0;
const BINS: usize = 16 * 116;

/// Ranges of one cast against the exact ones.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RangeErrors {
    pub rays: u64,
    /// Beams that met something both ways.
    pub both: u64,
    /// Of those, beams that met another thing.
    pub other_object: u64,
    /// Met exactly and not otherwise, and the other way round.
    pub missed: u64,
    pub invented: u64,
    pub max_m: f64,
    /// Errors below the histogram.
    none: u64,
    bins: Vec<u32>,
}

impl Default for RangeErrors {
    fn default() -> Self {
        let bins = vec![0; BINS];
        RangeErrors { rays: 0, both: 0, other_object: 0, missed: 0, invented: 0, max_m: 0.0, none: 0, bins }
    }
}

impl RangeErrors {
    pub(super) fn add(&mut self, exact: Hit, other: Hit) {
        self.rays += 1;
        match (exact.object == Hit::NOTHING, other.object == Hit::NOTHING) {
            (true, true) => {}
            (false, true) => self.missed += 1,
            (true, false) => self.invented += 1,
            (false, false) => {
                self.both += 1;
                self.other_object += u64::from(exact.object != other.object);
                let error_m = (exact.range_m - other.range_m).abs();
                self.max_m = self.max_m.max(error_m);
                match bin_of(error_m) {
                    Some(bin) => self.bins[bin] += 1,
                    None => self.none += 1,
                }
            }
        }
    }

    pub(super) fn merge(&mut self, more: &RangeErrors) {
        self.rays += more.rays;
        self.both += more.both;
        self.other_object += more.other_object;
        self.missed += more.missed;
        self.invented += more.invented;
        self.max_m = self.max_m.max(more.max_m);
        self.none += more.none;
        self.bins.iter_mut().zip(&more.bins).for_each(|(sum, count)| *sum += count);
    }

    /// The error that this share of the beams stays within, to 1 %; `None` where no beam met anything both ways.
    pub(crate) fn quantile_m(&self, share: f64) -> Option<f64> {
        let wanted = share * self.both.checked_sub(1)? as f64;
        let mut below = self.none;
        if below as f64 > wanted {
            return Some(0.0);
        }
        for (bin, &count) in self.bins.iter().enumerate() {
            below += u64::from(count);
            if below as f64 > wanted {
                return Some(middle_m(bin).min(self.max_m));
            }
        }
        Some(self.max_m)
    }
}

fn bin_of(error_m: f64) -> Option<usize> {
    let steps = math::ln(error_m / LEAST_M) * (BINS_A_DECADE / std::f64::consts::LN_10);
    (error_m >= LEAST_M).then(|| (steps.max(0.0) as usize).min(BINS - 1))
}

fn middle_m(bin: usize) -> f64 {
    LEAST_M * math::exp((bin as f64 + 0.5) * (std::f64::consts::LN_10 / BINS_A_DECADE))
}

/// Casts a pattern from one place, exactly and otherwise.
pub(super) fn range_errors(
    scene: &Scene,
    cast: &Cast,
    pattern: &Pattern,
    world_from_sensor: &Transform,
    max_range_m: f64,
) -> RangeErrors {
    let directions: Vec<DVec3> = pattern.directions.iter().map(|&d| world_from_sensor.direction(d)).collect();
    let hits = |cast| {
        let mut hits = Vec::new();
        Caster::new(scene, cast).from(world_from_sensor.translation_m, max_range_m).cast(&directions, &mut hits);
        hits
    };
    let mut errors = RangeErrors::default();
    for (exact, other) in hits(&Cast::Exact).into_iter().zip(hits(cast)) {
        errors.add(exact, other);
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(range_m: f64, object: i32) -> Hit {
        Hit { range_m, object }
    }

    #[test]
    fn exact_hits_missed_invented_and_of_other_objects_are_counted_apart() {
        let mut errors = RangeErrors::default();
        errors.add(hit(2.0, Hit::GROUND), hit(2.5, Hit::GROUND));
        errors.add(hit(2.0, Hit::GROUND), hit(1.0, 3));
        errors.add(hit(2.0, 4), Hit::NONE);
        errors.add(Hit::NONE, hit(1.0, 0));
        errors.add(Hit::NONE, Hit::NONE);
        let counts = (errors.rays, errors.both, errors.other_object, errors.missed, errors.invented);
        assert_eq!(counts, (5, 2, 1, 1, 1));
        assert_eq!(errors.max_m, 1.0);
    }

    #[test]
    fn law_quantiles_are_right_to_a_percent_and_add_up_in_any_order() {
        // Errors 1e-6, 2e-6 ... 1e-3, a quarter of the beams exact.
        let error = |k: u32| 1e-6 * f64::from(k);
        let mut parts = vec![RangeErrors::default(); 3];
        for k in 1..=1000 {
            parts[k as usize % 3].add(hit(1.0, Hit::GROUND), hit(1.0 + error(k), Hit::GROUND));
        }
        for k in 0..333 {
            parts[k % 3].add(hit(1.0, Hit::GROUND), hit(1.0, Hit::GROUND));
        }
        let (mut forward, mut backward) = (RangeErrors::default(), RangeErrors::default());
        parts.iter().for_each(|part| forward.merge(part));
        parts.iter().rev().for_each(|part| backward.merge(part));
        assert_eq!(forward, backward);
        assert_eq!(forward.quantile_m(0.2), Some(0.0));
        for (share, k) in [(0.5, 334), (0.99, 987)] {
            let found = forward.quantile_m(share).unwrap();
            assert!((found / error(k) - 1.0).abs() < 0.012, "{share}: {found}");
        }
        assert_eq!(RangeErrors::default().quantile_m(0.5), None);
    }
}
