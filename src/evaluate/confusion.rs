//! Truth and call -> a 2 x 2 table of counts, and the rates that people quote.
//!
//! In: counts of cells or points. Out: rates in [0, 1]; `None` where a rate is 0 / 0. The positive class is *untraversable*, and
//! no rate is named "false positive": `missed_untraversable` is the share of the truly untraversable that was called traversable
//! (the dangerous error), `false_untraversable` the share of the truly traversable that was called untraversable (the needless
//! detour). Source: Hewitt et al. 2017, table 1 (see [`Table1`]). Matthews 1975 for the correlation.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// How often truth and call met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Confusion {
    /// Traversable, and called so.
    pub true_traversable: u64,
    /// Traversable, called untraversable.
    pub false_untraversable: u64,
    /// Untraversable, called traversable.
    pub missed_untraversable: u64,
    /// Untraversable, and called so.
    pub true_untraversable: u64,
}

/// The rates of a table of counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rates {
    /// Share that is truly untraversable.
    pub prevalence: Option<f64>,
    /// Accuracy of calling everything by the more frequent class.
    pub majority_baseline: Option<f64>,
    pub accuracy: Option<f64>,
    /// Mean of both classes' shares called right.
    pub balanced_accuracy: Option<f64>,
    /// Matthews's correlation coefficient, in [-1, 1].
    pub mcc: Option<f64>,
    /// Of the truly untraversable, the share called traversable.
    pub missed_untraversable: Option<f64>,
    /// Of the truly traversable, the share called untraversable.
    pub false_untraversable: Option<f64>,
}

/// The five rows of table 1. The paper does not say what its counts and shares are of; both readings are given.
///
/// With 11,687 and 308,800 as the denominators, 4.74 % and 0.81 % are 554 and 2,501 errors: 0.95 % of all points, which the paper
/// gives as 0.96 %. With the counts as what was called so and the rates as shares of what is truly so, all errors together would be
/// 0.93 %. The abstract ("falsely classifying just 4.74% of untraversable terrain") and the text on the tops of rocks agree with the
/// first: 4.74 % is the share of the truly untraversable that was called traversable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table1 {
    /// Counts and shares of what is truly so: the reading that agrees with the abstract.
    pub of_truth: FiveRows,
    /// Counts and shares of what was called so.
    pub of_calls: FiveRows,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FiveRows {
    pub untraversable: u64,
    pub traversable: u64,
    /// Of `untraversable`, the share where truth and call differ.
    pub wrong_of_untraversable: Option<f64>,
    /// Of `traversable`, the share where truth and call differ.
    pub wrong_of_traversable: Option<f64>,
    /// Of all, the share where truth and call differ.
    pub wrong_of_all: Option<f64>,
}

impl AddAssign for Confusion {
    fn add_assign(&mut self, other: Confusion) {
        self.true_traversable += other.true_traversable;
        self.false_untraversable += other.false_untraversable;
        self.missed_untraversable += other.missed_untraversable;
        self.true_untraversable += other.true_untraversable;
    }
}

/// `None` of nothing.
pub(super) fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

impl Confusion {
    /// Counts `weight` things (cells: 1, points: as many as there are) of one truth and one call.
    pub(crate) fn add(&mut self, untraversable: bool, called_untraversable: bool, weight: u64) {
        let count = match (untraversable, called_untraversable) {
            (false, false) => &mut self.true_traversable,
            (false, true) => &mut self.false_untraversable,
            (true, false) => &mut self.missed_untraversable,
            (true, true) => &mut self.true_untraversable,
        };
        *count += weight;
    }

    pub(crate) fn traversable(&self) -> u64 {
        self.true_traversable + self.false_untraversable
    }

    pub(crate) fn untraversable(&self) -> u64 {
        self.missed_untraversable + self.true_untraversable
    }

    pub(crate) fn called_untraversable(&self) -> u64 {
        self.true_untraversable + self.false_untraversable
    }

    pub(crate) fn total(&self) -> u64 {
        self.traversable() + self.untraversable()
    }

    pub(crate) fn wrong(&self) -> u64 {
        self.false_untraversable + self.missed_untraversable
    }

    /// Shares and scores; `None` where a class is absent.
    ///
    /// ```
    /// use marsyard::evaluate::Confusion;
    ///
    /// // Of 100 cells 10 are untraversable; 8 of them are found, for 9 false alarms.
    /// let found = Confusion { true_traversable: 81, false_untraversable: 9, missed_untraversable: 2, true_untraversable: 8 };
    /// let rates = found.rates();
    /// assert_eq!(rates.missed_untraversable, Some(0.2));
    /// assert_eq!(rates.false_untraversable, Some(0.1));
    /// // Accuracy alone says that calling everything traversable is better; what both classes are worth says otherwise.
    /// assert_eq!((rates.accuracy, rates.majority_baseline), (Some(0.89), Some(0.9)));
    /// assert!((rates.balanced_accuracy.unwrap() - 0.85).abs() < 1e-15);
    /// let calls_nothing = Confusion { true_traversable: 90, missed_untraversable: 10, ..Confusion::default() };
    /// assert_eq!(calls_nothing.rates().balanced_accuracy, Some(0.5));
    /// ```
    pub fn rates(&self) -> Rates {
        let missed = share(self.missed_untraversable, self.untraversable());
        let false_alarms = share(self.false_untraversable, self.traversable());
        Rates {
            prevalence: share(self.untraversable(), self.total()),
            majority_baseline: share(self.untraversable().max(self.traversable()), self.total()),
            accuracy: share(self.total() - self.wrong(), self.total()),
            balanced_accuracy: missed.zip(false_alarms).map(|(missed, alarms)| 1.0 - 0.5 * (missed + alarms)),
            mcc: self.mcc(),
            missed_untraversable: missed,
            false_untraversable: false_alarms,
        }
    }

    /// `None` where all is of one class, or all was called so.
    fn mcc(&self) -> Option<f64> {
        let [tn, fp, fneg, tp] =
            [self.true_traversable, self.false_untraversable, self.missed_untraversable, self.true_untraversable]
                .map(|count| count as f64);
        let scale = ((tp + fp) * (tp + fneg) * (tn + fp) * (tn + fneg)).sqrt();
        (scale > 0.0).then(|| ((tp * tn - fp * fneg) / scale).clamp(-1.0, 1.0))
    }

    pub(crate) fn table_1(&self) -> Table1 {
        let wrong_of_all = share(self.wrong(), self.total());
        let called_untraversable = self.called_untraversable();
        let called_traversable = self.true_traversable + self.missed_untraversable;
        Table1 {
            of_truth: FiveRows {
                untraversable: self.untraversable(),
                traversable: self.traversable(),
                wrong_of_untraversable: share(self.missed_untraversable, self.untraversable()),
                wrong_of_traversable: share(self.false_untraversable, self.traversable()),
                wrong_of_all,
            },
            of_calls: FiveRows {
                untraversable: called_untraversable,
                traversable: called_traversable,
                wrong_of_untraversable: share(self.false_untraversable, called_untraversable),
                wrong_of_traversable: share(self.missed_untraversable, called_traversable),
                wrong_of_all,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn confusion(counts: [u64; 4]) -> Confusion {
        let [true_traversable, false_untraversable, missed_untraversable, true_untraversable] = counts;
        Confusion { true_traversable, false_untraversable, missed_untraversable, true_untraversable }
    }

    #[test]
    fn exact_rates_of_a_table_counted_by_hand() {
        // 100 traversable, 10 of them called untraversable; 20 untraversable, 5 of them missed.
        let rates = confusion([90, 10, 5, 15]).rates();
        assert_eq!(rates.prevalence, Some(20.0 / 120.0));
        assert_eq!(rates.majority_baseline, Some(100.0 / 120.0));
        assert_eq!(rates.accuracy, Some(105.0 / 120.0));
        assert_eq!(rates.balanced_accuracy, Some(0.825));
        assert_eq!((rates.missed_untraversable, rates.false_untraversable), (Some(0.25), Some(0.1)));
        let mcc = (15.0 * 90.0 - 10.0 * 5.0) / (25.0f64 * 20.0 * 100.0 * 95.0).sqrt();
        assert!((rates.mcc.unwrap() - mcc).abs() < 1e-15);
    }

    #[test]
    fn exact_the_papers_table_1_comes_out_of_its_counts() {
        // 11,687 untraversable and 308,800 traversable points; 554 and 2,501 errors.
        let table = confusion([308_800 - 2_501, 2_501, 554, 11_687 - 554]).table_1().of_truth;
        assert_eq!((table.untraversable, table.traversable), (11_687, 308_800));
        assert!((100.0 * table.wrong_of_untraversable.unwrap() - 4.74).abs() < 0.005);
        assert!((100.0 * table.wrong_of_traversable.unwrap() - 0.81).abs() < 0.005);
        assert!((100.0 * table.wrong_of_all.unwrap() - 0.96).abs() < 0.01);
    }

    #[test]
    fn exact_the_reading_by_calls_divides_by_what_was_called() {
        let table = confusion([90, 10, 5, 15]).table_1().of_calls;
        assert_eq!((table.untraversable, table.traversable), (25, 95));
        assert_eq!((table.wrong_of_untraversable, table.wrong_of_traversable), (Some(0.4), Some(5.0 / 95.0)));
        assert_eq!(table.wrong_of_all, Some(15.0 / 120.0));
    }

    #[test]
    fn extreme_empty_and_one_sided_tables_have_no_rates_but_no_nan() {
        let nothing = Confusion::default().rates();
        assert_eq!((nothing.accuracy, nothing.mcc, nothing.balanced_accuracy), (None, None, None));
        let ground = confusion([7, 3, 0, 0]).rates();
        assert_eq!((ground.accuracy, ground.mcc, ground.balanced_accuracy), (Some(0.7), None, None));
        assert_eq!((ground.missed_untraversable, ground.false_untraversable), (None, Some(0.3)));
        let large = confusion([u64::MAX / 8; 4]).rates();
        assert_eq!((large.mcc, large.accuracy), (Some(0.0), Some(0.5)));
        assert_eq!(confusion([u64::MAX / 8, 0, 0, u64::MAX / 8]).rates().mcc, Some(1.0));
    }
}
