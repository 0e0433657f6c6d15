//! `--threshold`, `--miss-at-most` and `--doubtful`, as `evaluate` and `classify` take them alike.

use clap::Args;

use super::options::read_share;
use crate::train::{Model, OperatingPoint};

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
    #[arg(long, value_name = "SHARE", value_parser = parse_doubtful)]
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

    /// What whoever asked for these must know of the thresholds that the model gives for them; nothing where it has none.
    pub(super) fn remarks(&self, model: &Model, thresholds: &[f64]) -> Vec<String> {
        let mut remarks = Vec::new();
        if thresholds.is_empty() {
            return remarks;
        }
        if self.doubtful.is_some() && thresholds.len() == 1 {
            remarks.push(
                "no cell is doubtful: one threshold keeps both shares on the model's validation scenes".to_string(),
            );
        }
        let cells = model.about.calibration.as_ref().map_or([u64::MAX; 2], |calibration| calibration.cells);
        let asked = [self.doubtful, self.miss_at_most.or(self.doubtful)];
        for ((share, cells), class) in asked.into_iter().zip(cells).zip(["traversable", "untraversable"]) {
            if let Some(share) = share.filter(|share| share * (cells as f64) < 1.0) {
                remarks.push(format!(
                    "{} % of the {cells} {class} cells of the model's validation scenes is less than one cell: none of them is called wrongly, and \
                     they are too few to promise so small a share",
                    // Without what a product of binary fractions leaves at its end.
                    (1e10 * share).round() / 1e8
                ));
            }
        }
        remarks
    }
}

/// `1%` or `0.01`.
fn parse_share(text: &str) -> Result<f64, String> {
    match read_share(text) {
        Some(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err(format!("'{text}' is no share above 0 and below 1: one in a hundred is 1% or 0.01")),
    }
}

/// A share of each class that may be called wrongly by two thresholds; a coin calls half of each wrongly.
fn parse_doubtful(text: &str) -> Result<f64, String> {
    match parse_share(text)? {
        share if share < 0.5 => Ok(share),
        _ => Err(format!(
            "'{text}' of each class called wrongly is no better than a coin: take less than 50%, such as 1%"
        )),
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
            assert!(parse_doubtful(wrong).unwrap_err().contains("1% or 0.01"), "{wrong}");
        }
        assert!(parse_doubtful("60%").unwrap_err().contains("less than 50%") && parse_doubtful("49%") == Ok(0.49));
    }
}
