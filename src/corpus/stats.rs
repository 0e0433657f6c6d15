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
mod tests;
