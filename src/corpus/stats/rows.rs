//! Rows of feature values -> the moments of every feature, the features of a row side by side.
//!
//! In: f32, row by row. Out: [`Moments`], bit for bit those that one [`Moments::add`] a value gives; a division waits for
//! the one before it within a feature, not between features, so that a row's are done at once.

use super::Moments;
use crate::wide::{Work, widest};

/// One feature's moments in the making, as lanes of the arrays hold them.
#[derive(Clone, Debug, Default)]
struct Lanes {
    count: Vec<f64>,
    mean: Vec<f64>,
    m2: Vec<f64>,
    min: Vec<f64>,
    max: Vec<f64>,
    not_finite: Vec<f64>,
}

/// The moments of all features, row by row.
#[derive(Clone, Debug)]
pub(crate) struct RowMoments {
    lanes: Lanes,
}

impl RowMoments {
    /// Of so many features, before any row.
    pub(crate) fn new(features: usize) -> RowMoments {
        let all = |value: f64| vec![value; features];
        RowMoments {
            lanes: Lanes {
                count: all(0.0),
                mean: all(0.0),
                m2: all(0.0),
                min: all(f64::INFINITY),
                max: all(f64::NEG_INFINITY),
                not_finite: all(0.0),
            },
        }
    }

    /// The next rows, one after the other, a value a feature.
    pub(crate) fn add(&mut self, rows: &[f32]) {
        self.lanes = widest(Add { lanes: std::mem::take(&mut self.lanes), rows });
    }

    /// One a feature.
    pub(crate) fn moments(&self) -> impl Iterator<Item = Moments> + '_ {
        let lanes = &self.lanes;
        (0..lanes.count.len()).map(|k| {
            let any = |value: f64| (lanes.count[k] > 0.0).then_some(value);
            Moments {
                count: lanes.count[k] as u64,
                mean: lanes.mean[k],
                m2: lanes.m2[k],
                min: any(lanes.min[k]),
                max: any(lanes.max[k]),
                not_finite: lanes.not_finite[k] as u64,
            }
        })
    }
}

struct Add<'a> {
    lanes: Lanes,
    rows: &'a [f32],
}

impl Work for Add<'_> {
    type Out = Lanes;

    #[inline(always)]
    fn run(mut self) -> Lanes {
        let features = self.lanes.count.len();
        let Lanes { count, mean, m2, min, max, not_finite } = &mut self.lanes;
        for row in self.rows.chunks_exact(features.max(1)) {
            let (count, mean, m2) = (&mut count[..features], &mut mean[..features], &mut m2[..features]);
            let (min, max) = (&mut min[..features], &mut max[..features]);
            let (not_finite, row) = (&mut not_finite[..features], &row[..features]);
            for k in 0..features {
                let value = f64::from(row[k]);
                let finite = value.is_finite();
                let counted = count[k] + 1.0;
                let before = value - mean[k];
                let moved = mean[k] + before / counted;
                let squares = m2[k] + before * (value - moved);
                count[k] = if finite { counted } else { count[k] };
                mean[k] = if finite { moved } else { mean[k] };
                m2[k] = if finite { squares } else { m2[k] };
                min[k] = if finite && value < min[k] { value } else { min[k] };
                max[k] = if finite && value > max[k] { value } else { max[k] };
                not_finite[k] += if finite { 0.0 } else { 1.0 };
            }
        }
        self.lanes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wide::every_form;

    /// Values of many sizes, some of them not finite, some zeros of either sign.
    fn rows(features: usize, count: usize) -> Vec<f32> {
        let value = |i: usize| match i % 97 {
            13 => f32::NAN,
            29 => f32::INFINITY,
            51 => -0.0,
            52 => 0.0,
            kind => (i as f32 * 0.7311).fract() * 10f32.powi(kind as i32 % 9 - 4) - 0.3,
        };
        (0..features * count).map(|i| value(i * 31 + i / 7)).collect()
    }

    #[test]
    fn equal_to_a_value_at_a_time_in_every_form() {
        for features in [1, 7, 8, 20, 33] {
            let rows = rows(features, 1000);
            let mut expected = vec![Moments::default(); features];
            for row in rows.chunks_exact(features) {
                expected.iter_mut().zip(row).for_each(|(moments, &value)| moments.add(f64::from(value)));
            }
            assert!(expected.iter().any(|moments| moments.not_finite > 0));
            let bits = |m: Moments| {
                (m.count, m.not_finite, [m.mean, m.m2].map(f64::to_bits), [m.min, m.max].map(|m| m.map(f64::to_bits)))
            };
            let expected: Vec<_> = expected.into_iter().map(bits).collect();
            let mut parts = RowMoments::new(features);
            rows.chunks(features * 77).for_each(|part| parts.add(part));
            let forms = every_form(|| Add { lanes: RowMoments::new(features).lanes, rows: &rows });
            for sums in forms.into_iter().map(|lanes| RowMoments { lanes }).chain([parts]) {
                assert_eq!(sums.moments().map(bits).collect::<Vec<_>>(), expected);
            }
        }
    }

    #[test]
    fn extreme_no_rows_and_rows_without_a_finite_value_have_no_range() {
        let mut moments = RowMoments::new(2);
        assert!(moments.moments().all(|m| m == Moments::default()));
        moments.add(&[f32::NAN, f32::NEG_INFINITY]);
        let expected = Moments { not_finite: 1, ..Moments::default() };
        assert!(moments.moments().all(|m| m == expected));
        let mut none = RowMoments::new(0);
        none.add(&[]);
        assert_eq!(none.moments().count(), 0);
    }
}
