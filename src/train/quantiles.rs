//! Rows of the train split -> what of each feature is common and what is rare, so that a user of the model can see how far a real
//! scan lies outside.
//!
//! Exact where the split has up to [`SAMPLE_ROWS`] rows; else from that many rows of row groups picked at random, with the extremes
//! taken from the manifest, which has seen all rows.

use super::order::Epoch;
use super::rows::Rows;
use super::source::Sources;
use super::{Scaler, TrainError};
use crate::corpus::Split;

/// Rows that are sorted at most.
pub(crate) const SAMPLE_ROWS: usize = 131_072;

/// The shares that the quantiles stand for.
pub(crate) const SHARES: [f64; 7] = [0.0, 0.001, 0.01, 0.5, 0.99, 0.999, 1.0];

/// Per feature, in the order of the sources' features.
pub(crate) fn of_train_split(sources: &Sources, seed: u64, scaler: &Scaler) -> Result<Vec<[f64; 7]>, TrainError> {
    let rows = sample(sources, seed)?;
    let mut quantiles = Vec::new();
    for (feature, name) in sources.features.iter().enumerate() {
        let mut values: Vec<f32> = rows.features.iter().skip(feature).step_by(rows.width).copied().collect();
        values.truncate(SAMPLE_ROWS);
        values.sort_unstable_by(f32::total_cmp);
        let mut of_feature = SHARES.map(|share| {
            quantile(&values, share).unwrap_or(if scaler.minus[feature].is_none() { scaler.mean[feature] } else { 0.0 })
        });
        for source in sources.list.iter().filter(|_| !sources.seen_alone) {
            let Some(summary) = source.features.iter().find(|summary| summary.name == *name) else { continue };
            of_feature[0] = summary.moments.min.map_or(of_feature[0], |min| of_feature[0].min(min));
            of_feature[6] = summary.moments.max.map_or(of_feature[6], |max| of_feature[6].max(max));
        }
        quantiles.push(of_feature);
    }
    Ok(quantiles)
}

/// Rows of row groups picked at random: all of a small split, else somewhat more than [`SAMPLE_ROWS`].
pub(crate) fn sample(sources: &Sources, seed: u64) -> Result<Rows, TrainError> {
    let groups = sources.groups(Split::Train);
    let mut rows = Rows::new(sources.features.len());
    for group in Epoch::new(seed, 0).groups(groups.len()) {
        sources.read(Split::Train, groups[group as usize], &mut rows)?;
        if rows.len() > SAMPLE_ROWS {
            break;
        }
    }
    Ok(rows)
}

/// The smallest value that at least this share of the sorted values does not exceed.
fn quantile(sorted: &[f32], share: f64) -> Option<f64> {
    let rank = (share * sorted.len() as f64).ceil().max(1.0) as usize;
    sorted.get(rank - 1).map(|&value| f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_quantiles_of_a_thousand_numbers() {
        let values: Vec<f32> = (1..=1000).map(|i| i as f32).collect();
        assert_eq!(
            SHARES.map(|share| quantile(&values, share).unwrap()),
            [1.0, 1.0, 10.0, 500.0, 990.0, 999.0, 1000.0]
        );
        assert_eq!(SHARES.map(|share| quantile(&[7.0], share).unwrap()), [7.0; 7]);
        assert_eq!(quantile(&[], 0.5), None);
    }
}
