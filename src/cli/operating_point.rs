//! `--threshold`, `--miss-at-most` and `--doubtful`, as `evaluate` and `classify` take them alike.

use clap::Args;

use super::options::read_share;
use crate::train::OperatingPoint;

#[derive(Debug, Args)]
pub(super) struct PointArgs {
    /// Thresholds of the output in place of the model's own, rising: --threshold 0.3,0.5. From one on a cell is of the next class.
    #[arg(long = "threshold", value_delimiter = ',', value_name = "T", conflicts_with_all = ["miss_at_most", "doubtful"])]
    thresholds: Vec<f64>,
    /// The highest threshold that misses at most this share of the untraversable cells on the scenes that stopped the training: 1%.
    #[arg(long, value_name = "SHARE", value_parser = parse_share, conflicts_with = "doubtful")]
    miss_at_most: Option<f64>,
    /// Two thresholds, and doubtful between them: on the scenes that stopped the training at most this share of each class is called
    /// wrongly and not doubtful: 1%.
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    doubtful: Option<f64>,
}

impl PointArgs {
    pub(super) fn chosen(&self) -> OperatingPoint {
        match (self.miss_at_most, self.doubtful) {
            (Some(share), _) => OperatingPoint::MissAtMost(share),
            (None, Some(share)) => OperatingPoint::Doubtful(share),
            (None, None) if self.thresholds.is_empty() => OperatingPoint::Model,
            (None, None) => OperatingPoint::Thresholds(self.thresholds.clone()),
        }
    }
}

/// `1%` or `0.01`.
fn parse_share(text: &str) -> Result<f64, String> {
    match read_share(text) {
        Some(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err(format!("'{text}' is no share above 0 and below 1: one in a hundred is 1% or 0.01")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_shares_are_percents_or_fractions() {
        assert_eq!((parse_share("1%"), parse_share("0.01"), parse_share(" 2.5 %")), (Ok(0.01), Ok(0.01), Ok(0.025)));
        for wrong in ["0", "0%", "1", "100%", "-1%", "nan", "inf", "5", "", "%", "1 percent"] {
            assert!(parse_share(wrong).unwrap_err().contains("1% or 0.01"), "{wrong}");
        }
    }
}
