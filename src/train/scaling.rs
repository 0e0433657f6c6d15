//! The corpora's statistics -> how features are scaled and how much a row of each class and corpus counts.
//!
//! Statistics are those of the train split alone, merged over the corpora in their order.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::normal_scores::MOST_VALUES;
use super::params::{Balance, Neighbours};
use super::quantiles::sample;
use super::rows::Rows;
use super::scaler::less;
use super::source::{Source, Sources};
use super::{NormalScores, Scaler, TrainError, TrainParams};
use crate::cells::{Label, MEAN_HEIGHT, is_neighbour};
use crate::corpus::stats::Moments;

/// The scaler, and the names of the features that never vary: they get scale 1 and teach nothing.
///
/// What is subtracted from another first has no statistics in the manifest, and those of cells with points alone are not there where a
/// corpus holds others: they come from a sample of rows, as normal scores do.
pub(crate) fn scaler(sources: &Sources, params: &TrainParams) -> Result<(Scaler, Vec<String>), TrainError> {
    let minus = subtracted(&sources.features, params.neighbours);
    let mut moments: Vec<Moments> = sources.features.iter().map(|name| merged(&sources.list, name)).collect();
    let is_sampled = |minus: &Option<usize>| sources.seen_alone || minus.is_some();
    let sample = match params.network.normal_scores || minus.iter().any(is_sampled) {
        true => sample(sources, params.seed)?,
        false => Rows::new(sources.features.len()),
    };
    if minus.iter().any(is_sampled) {
        let differences = moments.iter_mut().zip(moments_of(&sample, &minus)).zip(&minus);
        let sampled = differences.filter(|(_, minus)| is_sampled(minus));
        sampled.for_each(|((moments, sample), _)| *moments = sample);
    }
    let score = |feature| score_of(&sample, &minus, params, feature);
    let scores = scored(&sample, params).into_par_iter().map(score).collect();
    let (scaler, constant) = scaler_of(minus, moments.into_iter(), scores, params.clip);
    Ok((scaler, constant.into_iter().map(|feature| sources.features[feature].clone()).collect()))
}

/// Per feature, the number of the one that is subtracted from it: of a neighbour's height, the cell's own.
pub(crate) fn subtracted(features: &[String], neighbours: Neighbours) -> Vec<Option<usize>> {
    let own = features.iter().position(|name| name == MEAN_HEIGHT);
    let above_cell = |name: &String| neighbours == Neighbours::AboveCell && is_neighbour(name);
    features.iter().map(|name| own.filter(|_| above_cell(name))).collect()
}

/// Moments of rows, each feature less what is subtracted from it.
pub(crate) fn moments_of(rows: &Rows, minus: &[Option<usize>]) -> Vec<Moments> {
    let mut moments = vec![Moments::default(); rows.width];
    for row in 0..rows.len() {
        let row = rows.row(row);
        for ((moments, value), minus) in moments.iter_mut().zip(row).zip(minus) {
            moments.add(less(*value, *minus, row));
        }
    }
    moments
}

/// Normal scores of each feature of rows, less what is subtracted from it; none where the network takes none. On this thread alone: trainings in memory
/// are tasks of a schedule, which wait for no other.
pub(crate) fn scores_of(rows: &Rows, minus: &[Option<usize>], params: &TrainParams) -> Vec<NormalScores> {
    scored(rows, params).map(|feature| score_of(rows, minus, params, feature)).collect()
}

/// The features that have normal scores.
fn scored(rows: &Rows, params: &TrainParams) -> Range<usize> {
    if params.network.normal_scores { 0..rows.width } else { 0..0 }
}

/// By every so many-th row where they are many.
fn score_of(rows: &Rows, minus: &[Option<usize>], params: &TrainParams, feature: usize) -> NormalScores {
    let every = rows.len().div_ceil(MOST_VALUES).max(1);
    let value = |row: &[f32]| less(row[feature], minus[feature], row);
    let values = (0..rows.len()).step_by(every).map(|row| value(rows.row(row))).collect();
    match minus[feature] {
        None => NormalScores::of_sample(values, params.clip),
        Some(_) => NormalScores::of_heights_above(values, params.clip),
    }
}

/// The scaler of features with these moments and scores, and which of them never vary.
pub(crate) fn scaler_of(
    minus: Vec<Option<usize>>,
    features: impl Iterator<Item = Moments>,
    scores: Vec<NormalScores>,
    clip: f64,
) -> (Scaler, Vec<usize>) {
    let mut scaler = Scaler { minus, mean: Vec::new(), scale: Vec::new(), clip, scores };
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
    pub(crate) fn new(counts: &[[u64; 2]], corpora: &[f64], balance: Balance) -> Weights {
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
    pub(crate) fn of(&self, label: Label, corpus: u16) -> f64 {
        self.class[label.index()] * self.corpus[usize::from(corpus)]
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
            .map(|(of, c)| Label::ALL.map(|label| of[label.index()] * weights.of(label, *c)).iter().sum::<f64>())
            .sum();
        assert!((sum - 200.0).abs() < 1e-9, "{sum}");
    }

    #[test]
    fn exact_neighbours_stand_above_the_cell_where_its_own_height_is_an_input() {
        let names = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
        let with = names(&["point_count", "mean_height_m", "neighbour_n_m", "height_difference_m", "neighbour_sw_m"]);
        let above = [None, None, Some(1), None, Some(1)];
        assert_eq!(subtracted(&with, Neighbours::AboveCell), above);
        assert_eq!(subtracted(&with, Neighbours::AboveRover), [None; 5]);
        assert_eq!(subtracted(&names(&["point_count", "neighbour_n_m"]), Neighbours::AboveCell), [None; 2]);
        let mut rows = Rows::new(2);
        rows.features = vec![1.0, 1.5, 2.0, 2.25, -1.0, 0.25];
        (rows.labels, rows.corpora) = (vec![Label::Traversable; 3], vec![0; 3]);
        let moments = moments_of(&rows, &[None, Some(0)]);
        // Heights 1, 2, -1; differences 0.5, 0.25, 1.25.
        assert!((moments[0].mean - 2.0 / 3.0).abs() < 1e-15 && (moments[1].mean - 2.0 / 3.0).abs() < 1e-15);
        assert!((moments[1].variance() - 13.0 / 72.0).abs() < 1e-15);
    }

    #[test]
    fn exact_inputs_are_standardised_and_end_at_the_clip_that_the_config_names() {
        let mut moments = Moments::default();
        [1.0, 3.0].into_iter().for_each(|x| moments.add(x));
        let (scaler, constant) = scaler_of(vec![None], std::iter::once(moments), Vec::new(), 8.0);
        assert!(constant.is_empty());
        let scaled = |x: f32| {
            let mut out = [0.0];
            scaler.scale(&[x], &mut out);
            out[0]
        };
        // Mean 2, standard deviation 1.
        let inside = [(2.0, 0.0), (3.0, 1.0), (-5.5, -7.5), (10.0, 8.0)];
        let beyond = [(10.5, 8.0), (1e30, 8.0), (-6.5, -8.0), (f32::NEG_INFINITY, -8.0)];
        for (x, wanted) in [inside, beyond].concat() {
            assert_eq!(scaled(x), wanted, "{x}");
        }
    }

    #[test]
    fn extreme_one_class_alone_is_not_weighed() {
        assert_eq!(Weights::new(&[[90, 0]], &[1.0], Balance::Classes).class, [1.0, 1.0]);
    }
}
