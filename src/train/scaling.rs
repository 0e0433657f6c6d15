//! The corpora's statistics -> how features are scaled and how much a row of each class and corpus counts.
//!
//! Statistics are those of the train split alone, merged over the corpora in their order.

use std::sync::Arc;

use super::Scaler;
use super::params::Balance;
use super::source::{Source, Sources};
use crate::corpus::stats::Moments;

/// The scaler, and the names of the features that never vary: they get scale 1 and teach nothing.
pub fn scaler(sources: &Sources, clip: f64) -> (Scaler, Vec<String>) {
    let (scaler, constant) = scaler_of(sources.features.iter().map(|name| merged(&sources.list, name)), clip);
    (scaler, constant.into_iter().map(|feature| sources.features[feature].clone()).collect())
}

/// The scaler of features with these moments, and which of them never vary.
pub fn scaler_of(features: impl Iterator<Item = Moments>, clip: f64) -> (Scaler, Vec<usize>) {
    let mut scaler = Scaler { mean: Vec::new(), scale: Vec::new(), clip };
    let mut constant = Vec::new();
    for (feature, moments) in features.enumerate() {
        let (mean, variance) = (moments.mean, moments.variance());
        // Rounding leaves a constant column some variance; its range tells.
        let varies = !moments.is_constant() && variance.is_normal();
        if !varies {
            constant.push(feature);
        }
        scaler.mean.push(mean);
        scaler.scale.push(if varies { variance.sqrt() } else { 1.0 });
    }
    (scaler, constant)
}

/// The moments of one feature over all corpora. Weights do not enter: they say what a row teaches, not what is measured.
fn merged(sources: &[Arc<Source>], name: &str) -> Moments {
    let of = |source: &Arc<Source>| source.features.iter().find(|feature| feature.name == *name).map(|f| f.moments);
    sources.iter().filter_map(of).fold(Moments::default(), |merged, moments| merged.merge(&moments))
}

/// How much a row counts: by its class and its corpus. 1 on average over the train split.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// Of traversable and untraversable.
    pub class: [f64; 2],
    pub corpus: Vec<f64>,
}

impl Weights {
    /// `counts`: rows of each class (traversable, untraversable) by corpus.
    pub fn new(counts: &[[u64; 2]], corpora: &[f64], balance: Balance) -> Weights {
        let rows = |of: &[u64; 2]| (of[0] + of[1]) as f64;
        let total: f64 = counts.iter().map(rows).sum();
        let weighted: f64 = counts.iter().zip(corpora).map(|(of, weight)| weight * rows(of)).sum();
        let corpus: Vec<f64> = corpora.iter().map(|weight| weight * total / weighted).collect();
        let of_class = |class: usize| counts.iter().zip(&corpus).map(|(of, w)| w * of[class] as f64).sum::<f64>();
        let both = [of_class(0), of_class(1)];
        let class = match balance {
            Balance::Classes if both[0] > 0.0 && both[1] > 0.0 => both.map(|of| total / (2.0 * of)),
            _ => [1.0; 2],
        };
        Weights { class, corpus }
    }

    #[inline]
    pub fn of(&self, label: u8, corpus: u16) -> f64 {
        self.class[usize::from(label)] * self.corpus[usize::from(corpus)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_both_classes_weigh_alike_and_a_row_weighs_one_on_average() {
        let weights = Weights::new(&[[90, 10]], &[3.0], Balance::Classes);
        assert_eq!(weights.corpus, [1.0]);
        assert!((weights.class[0] * 90.0 - 50.0).abs() < 1e-12 && (weights.class[1] * 10.0 - 50.0).abs() < 1e-12);
        assert_eq!(Weights::new(&[[90, 10]], &[1.0], Balance::None).class, [1.0, 1.0]);
    }

    #[test]
    fn exact_a_corpus_of_twice_the_weight_counts_twice_a_row() {
        let weights = Weights::new(&[[30, 10], [80, 80]], &[2.0, 1.0], Balance::Classes);
        assert!((weights.corpus[0] / weights.corpus[1] - 2.0).abs() < 1e-12);
        let sum: f64 = [([30.0, 10.0], 0), ([80.0, 80.0], 1)]
            .iter()
            .map(|(of, c)| (0..2).map(|k| of[k] * weights.of(k as u8, *c)).sum::<f64>())
            .sum();
        assert!((sum - 200.0).abs() < 1e-9, "{sum}");
    }

    #[test]
    fn extreme_one_class_alone_is_not_weighed() {
        assert_eq!(Weights::new(&[[90, 0]], &[1.0], Balance::Classes).class, [1.0, 1.0]);
    }
}
