//! Feature values and labels -> what a trainer scales by and a reader of the card wants to know.
//!
//! Source: Welford 1962 for the running mean and sum of squares, Chan, Golub & LeVeque 1979 for merging two of them. Values
//! are f32, sums f64; rows are taken in order and shards merged in order, so that the bits do not depend on who did it when.
//! Values that are not finite are counted apart.

mod rows;

pub(crate) use rows::RowMoments;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cells::{Cells, Label};

/// Count, mean, sum of squared distances from the mean, and range of one feature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Moments {
    pub count: u64,
    pub mean: f64,
    pub m2: f64,
    /// `None` where nothing was counted.
    pub min: Option<f64>,
    pub max: Option<f64>,
    /// NaN or infinite; in no other figure.
    pub not_finite: u64,
}

impl Moments {
    pub(crate) fn add(&mut self, value: f64) {
        if !value.is_finite() {
            self.not_finite += 1;
            return;
        }
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.m2 += before * (value - self.mean);
        self.min = Some(self.min.map_or(value, |min| if value < min { value } else { min }));
        self.max = Some(self.max.map_or(value, |max| if value > max { value } else { max }));
    }

    /// Both together; `other` comes after `self`.
    pub(crate) fn merge(&self, other: &Moments) -> Moments {
        let not_finite = self.not_finite + other.not_finite;
        if other.count == 0 || self.count == 0 {
            return Moments { not_finite, ..if self.count == 0 { *other } else { *self } };
        }
        let (n_a, n_b) = (self.count as f64, other.count as f64);
        let n = n_a + n_b;
        let delta = other.mean - self.mean;
        let pick = |a: Option<f64>, b: Option<f64>, of: fn(f64, f64) -> f64| a.zip(b).map(|(a, b)| of(a, b));
        Moments {
            count: self.count + other.count,
            mean: self.mean + delta * (n_b / n),
            m2: self.m2 + other.m2 + delta * delta * (n_a * n_b / n),
            min: pick(self.min, other.min, f64::min),
            max: pick(self.max, other.max, f64::max),
            not_finite,
        }
    }

    /// Population variance; 0 for nothing.
    pub(crate) fn variance(&self) -> f64 {
        if self.count == 0 { 0.0 } else { self.m2 / self.count as f64 }
    }

    /// All values are one.
    pub(crate) fn is_constant(&self) -> bool {
        self.min == self.max
    }
}

/// Cells by label.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LabelCounts {
    pub traversable: u64,
    pub untraversable: u64,
    pub unknown: u64,
}

impl LabelCounts {
    pub(crate) fn of(cells: &Cells) -> LabelCounts {
        let mut counts = LabelCounts::default();
        for cell in &cells.rows {
            counts.add(cell.label);
        }
        counts
    }

    pub(crate) fn add(&mut self, label: Option<Label>) {
        match label {
            Some(Label::Traversable) => self.traversable += 1,
            Some(Label::Untraversable) => self.untraversable += 1,
            None => self.unknown += 1,
        }
    }

    pub(crate) fn total(&self) -> u64 {
        self.traversable + self.untraversable + self.unknown
    }

    /// Share of the known labels that are untraversable; `None` where none is known.
    pub(crate) fn untraversable_share(&self) -> Option<f64> {
        let known = self.traversable + self.untraversable;
        (known > 0).then(|| self.untraversable as f64 / known as f64)
    }
}

impl std::ops::Add for LabelCounts {
    type Output = LabelCounts;

    fn add(self, other: LabelCounts) -> LabelCounts {
        LabelCounts {
            traversable: self.traversable + other.traversable,
            untraversable: self.untraversable + other.untraversable,
            unknown: self.unknown + other.unknown,
        }
    }
}

impl std::iter::Sum for LabelCounts {
    fn sum<I: Iterator<Item = LabelCounts>>(counts: I) -> LabelCounts {
        counts.fold(LabelCounts::default(), |a, b| a + b)
    }
}

/// Where the points of the kept scans went: in = binned + dropped + left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PointCounts {
    pub points_in: u64,
    pub binned: u64,
    pub beyond_range: u64,
    pub off_grid: u64,
    /// All points of sweeps that no plane levels; absent where there are none.
    #[serde(default, skip_serializing_if = "is_none")]
    pub without_ground: u64,
    /// Points that hang over free height (`cells.overhang`); absent where there are none.
    #[serde(default, skip_serializing_if = "is_none")]
    pub overhanging: u64,
}

/// A count that only some configs have.
fn is_none(count: &u64) -> bool {
    *count == 0
}

impl PointCounts {
    pub(crate) fn of(cells: &Cells) -> PointCounts {
        PointCounts {
            points_in: cells.points_in,
            binned: cells.points_binned,
            beyond_range: cells.dropped_beyond_range,
            off_grid: cells.dropped_off_grid,
            without_ground: cells.without_ground,
            overhanging: cells.overhanging,
        }
    }

    /// Those that a config keeps out of the cells.
    pub(crate) fn left_out(&self) -> u64 {
        self.without_ground + self.overhanging
    }

    /// For people: each of these that there is, as `, 3 without ground`.
    pub(crate) fn words_left_out(&self) -> String {
        let causes = [(self.without_ground, "without ground"), (self.overhanging, "overhanging")];
        let causes = causes.into_iter().filter(|(count, _)| *count > 0);
        causes.map(|(count, cause)| format!(", {count} {cause}")).collect()
    }

    /// No point is lost or counted twice.
    pub(crate) fn add_up(&self) -> bool {
        self.points_in == self.binned + self.beyond_range + self.off_grid + self.left_out()
    }
}

impl std::ops::Add for PointCounts {
    type Output = PointCounts;

    fn add(self, other: PointCounts) -> PointCounts {
        PointCounts {
            points_in: self.points_in + other.points_in,
            binned: self.binned + other.binned,
            beyond_range: self.beyond_range + other.beyond_range,
            off_grid: self.off_grid + other.off_grid,
            without_ground: self.without_ground + other.without_ground,
            overhanging: self.overhanging + other.overhanging,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extremes::{Family, row};
    use crate::math;

    fn of(values: &[f64]) -> Moments {
        let mut moments = Moments::default();
        values.iter().for_each(|&v| moments.add(v));
        moments
    }

    fn direct(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum())
    }

    #[test]
    fn equal_running_moments_and_two_passes() {
        let values: Vec<f64> = (0..5000).map(|i| 3.0 + math::sin(f64::from(i) * 0.37)).collect();
        let (mean, m2) = direct(&values);
        let moments = of(&values);
        assert!((moments.mean - mean).abs() < 1e-12 && (moments.m2 / m2 - 1.0).abs() < 1e-11);
        assert_eq!(moments.count, 5000);
        let folded = |of: fn(f64, f64) -> f64| values.iter().copied().reduce(of);
        assert_eq!((moments.min, moments.max), (folded(f64::min), folded(f64::max)));
    }

    #[test]
    fn equal_merged_parts_and_the_whole() {
        let values: Vec<f64> = (0..1000).map(|i| math::cos(f64::from(i))).collect();
        let whole = of(&values);
        for cut in [0, 1, 10, 500, 999, 1000] {
            let merged = of(&values[..cut]).merge(&of(&values[cut..]));
            assert_eq!((merged.count, merged.min, merged.max), (whole.count, whole.min, whole.max));
            assert!(
                (merged.mean - whole.mean).abs() < 1e-14 && (merged.m2 / whole.m2 - 1.0).abs() < 1e-12,
                "cut {cut}"
            );
        }
    }

    #[test]
    fn extreme_a_small_spread_on_a_large_mean_keeps_its_variance() {
        let values: Vec<f64> = (0..1000).map(|i| 1e9 + f64::from(i % 2)).collect();
        assert!((of(&values).variance() - 0.25).abs() < 1e-9);
        let merged = of(&values[..300]).merge(&of(&values[300..]));
        assert!((merged.variance() - 0.25).abs() < 1e-9);
        let mean_square = values.iter().map(|v| v * v).sum::<f64>() / 1000.0;
        let textbook = mean_square - merged.mean * merged.mean;
        assert!((textbook - 0.25).abs() > 0.1, "{textbook}");
        row(
            Family::Sums,
            "a spread of 0.5 on a mean of 1e9: variance 0.25",
            &format!("mean square less squared mean: {textbook}"),
            &format!("{}, merged from two parts as well", merged.variance()),
        );
    }

    /// 100,000 shards of 10,000 rows: multiples of 2^-10 m about a height of a thousand kilometres, so that whole numbers
    /// hold every sum exactly.
    #[test]
    fn extreme_a_billion_rows_merged_from_shards() {
        const SHARDS: u64 = 100_000;
        const ROWS: u64 = 10_000;
        const KINDS: u64 = 1000;
        let unit = 1.0 / 1024.0;
        let whole = |kind: u64, row: u64| (1 << 30) + i128::from(kind) + i128::from(row);
        // The shards' own statistics, row by row; there are a thousand different ones.
        let kinds: Vec<Moments> = (0..KINDS)
            .map(|kind| {
                let mut moments = Moments::default();
                (0..ROWS).for_each(|row| moments.add(whole(kind, row) as f64 * unit));
                moments
            })
            .collect();
        let kind = |shard: u64| shard * 7919 % KINDS;
        let merged = (0..SHARDS).fold(Moments::default(), |sum, shard| sum.merge(&kinds[kind(shard) as usize]));

        let (mut sum, mut squares) = (0_i128, 0_i128);
        let mut of_kind = vec![(0_i128, 0_i128); KINDS as usize];
        for (kind, sums) in of_kind.iter_mut().enumerate() {
            for row in 0..ROWS {
                let v = whole(kind as u64, row);
                *sums = (sums.0 + v, sums.1 + v * v);
            }
        }
        // The textbook keeps a sum and a sum of squares, each rounded.
        let (mut rounded_sum, mut rounded_squares) = (0.0_f64, 0.0_f64);
        for shard in 0..SHARDS {
            let (of_values, of_squares) = of_kind[kind(shard) as usize];
            (sum, squares) = (sum + of_values, squares + of_squares);
            (rounded_sum, rounded_squares) =
                (rounded_sum + of_values as f64 * unit, rounded_squares + of_squares as f64 * unit * unit);
        }
        let rows = i128::from(SHARDS * ROWS);
        let mean = sum as f64 / rows as f64 * unit;
        let m2 = (rows * squares - sum * sum) as f64 / rows as f64 * (unit * unit);
        let variance = m2 / rows as f64;
        assert_eq!(i128::from(merged.count), rows);
        assert_eq!(merged.min, Some(f64::from(1 << 30) * unit));
        assert_eq!(merged.max, Some(whole(KINDS - 1, ROWS - 1) as f64 * unit));
        let (mean_off, own_off) = ((merged.mean / mean - 1.0).abs(), (merged.variance() / variance - 1.0).abs());
        assert!(mean_off < 1e-13 && own_off < 1e-9, "{mean_off:e} {own_off:e}");
        let textbook_mean = rounded_sum / rows as f64;
        let textbook = rounded_squares / rows as f64 - textbook_mean * textbook_mean;
        let textbook_off = (textbook / variance - 1.0).abs();
        assert!(textbook_off > 1e3 * own_off, "{textbook_off:e}");
        row(
            Family::Sums,
            "a billion rows from 100,000 shards, heights about 1e6 m",
            &format!("sum and sum of squares in f64: variance {textbook:.4} for {variance:.4}"),
            &format!("mean off by a share of {mean_off:.0e}, variance by {own_off:.0e}, count exact"),
        );
    }

    #[test]
    fn extreme_values_that_are_not_finite_are_counted_apart() {
        let moments = of(&[1.0, f64::NAN, f64::INFINITY, 3.0]);
        assert_eq!((moments.count, moments.mean, moments.not_finite), (2, 2.0, 2));
        let none = Moments::default().merge(&of(&[f64::NAN]));
        assert_eq!((none.count, none.min, none.not_finite), (0, None, 1));
    }

    #[test]
    fn equal_moments_survive_json_to_the_last_bit() {
        let moments = of(&[0.1, 0.2, 1.0 / 3.0, 1e-300, 7e22]);
        let text = serde_json::to_string(&moments).unwrap();
        assert_eq!(serde_json::from_str::<Moments>(&text).unwrap(), moments);
    }
}
