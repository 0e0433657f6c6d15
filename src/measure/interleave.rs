//! Variants of a work, measured in turn -> their spreads, and how sure the differences between them are.
//!
//! A repeat measures every variant once, in an order rotated by one from repeat to repeat: no variant always comes first, while caches are
//! cold, or always while the machine is busy. What drifts between repeats is the same for all variants of one, so differences are taken
//! within repeats (pairs). Not modelled: a drift within a repeat that the rotation does not average out.

use std::convert::Infallible;

use crate::statistics::{Moments, Spread};

/// The order of the variants in a repeat.
pub(crate) fn rotation(variants: usize, repeat: usize) -> impl Iterator<Item = usize> {
    (0..variants).map(move |k| (k + repeat) % variants)
}

/// One repeat: what `measure` gives for each variant, in the order of the variants; the first error ends it.
pub(crate) fn try_rotated<T, E>(
    variants: usize,
    repeat: usize,
    mut measure: impl FnMut(usize) -> Result<T, E>,
) -> Result<Vec<T>, E> {
    let mut measured: Vec<Option<T>> = (0..variants).map(|_| None).collect();
    for variant in rotation(variants, repeat) {
        measured[variant] = Some(measure(variant)?);
    }
    Ok(measured.into_iter().map(|one| one.expect("a rotation visits every variant")).collect())
}

/// `try_rotated` of what cannot fail.
pub fn rotated<T>(variants: usize, repeat: usize, mut measure: impl FnMut(usize) -> T) -> Vec<T> {
    match try_rotated(variants, repeat, |variant| Ok::<T, Infallible>(measure(variant))) {
        Ok(measured) => measured,
    }
}

/// A number for each variant in each repeat.
#[derive(Clone, Debug, Default)]
pub struct Repeats {
    by_repeat: Vec<Vec<f64>>,
}

impl Repeats {
    /// Adds a repeat: one number for each variant.
    pub fn push(&mut self, repeat: Vec<f64>) {
        self.by_repeat.push(repeat);
    }

    pub(crate) fn len(&self) -> usize {
        self.by_repeat.len()
    }

    /// Median and quartiles of a variant; `None` before the first repeat.
    pub fn spread(&self, variant: usize) -> Option<Spread> {
        Spread::of(&self.values(variant).collect::<Vec<_>>())
    }

    pub(crate) fn moments(&self, variant: usize) -> Option<Moments> {
        Moments::of(self.values(variant))
    }

    /// Of what `variant` takes more than `base`, pair by pair.
    pub fn spread_of_difference(&self, variant: usize, base: usize) -> Option<Spread> {
        Spread::of(&self.differences(variant, base).collect::<Vec<_>>())
    }

    pub(crate) fn moments_of_difference(&self, variant: usize, base: usize) -> Option<Moments> {
        Moments::of(self.differences(variant, base))
    }

    fn values(&self, variant: usize) -> impl Iterator<Item = f64> + Clone {
        self.by_repeat.iter().map(move |repeat| repeat[variant])
    }

    fn differences(&self, variant: usize, base: usize) -> impl Iterator<Item = f64> + Clone {
        self.by_repeat.iter().map(move |repeat| repeat[variant] - repeat[base])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_every_variant_is_measured_once_a_repeat_and_comes_first_in_turn() {
        let mut firsts = Vec::new();
        for repeat in 0..6 {
            let mut order = Vec::new();
            let measured = rotated(3, repeat, |variant| {
                order.push(variant);
                10 * variant
            });
            assert_eq!(measured, [0, 10, 20]);
            firsts.push(order[0]);
        }
        assert_eq!(firsts, [0, 1, 2, 0, 1, 2]);
        assert!(rotated(0, 7, |variant| variant).is_empty());
    }

    #[test]
    fn exact_an_error_ends_the_repeat() {
        let mut measured = 0;
        let failed = try_rotated(4, 1, |variant| {
            measured += 1;
            if variant == 2 { Err("no") } else { Ok(variant) }
        });
        assert_eq!((failed, measured), (Err("no"), 2));
    }

    #[test]
    fn law_a_drift_that_all_variants_of_a_repeat_share_is_in_no_difference() {
        let mut repeats = Repeats::default();
        for drift in [0.0, 5.0, 100.0, 1.0] {
            repeats.push(vec![1.0 + drift, 4.0 + drift]);
        }
        let difference = repeats.moments_of_difference(1, 0).unwrap();
        assert_eq!((difference.mean, difference.variance, repeats.len()), (3.0, Some(0.0), 4));
        assert_eq!(repeats.spread_of_difference(1, 0).unwrap().median, 3.0);
        assert_eq!((repeats.moments(0).unwrap().mean, repeats.spread(1).unwrap().median), (27.5, 7.0));
        assert!(Repeats::default().spread(0).is_none() && Repeats::default().len() == 0);
    }
}
