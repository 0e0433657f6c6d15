//! The points of numbered cells -> a row a cell, and the features that its own points give.
//!
//! Source: Hewitt et al. 2017, "Neural network input types", eqs 3 and 4. Sums run in slot order, sweep after sweep. The variance is
//! taken in two passes, for the difference of two large sums would lose its digits.

use super::bin::Scratch;
use super::group::Numbers;
use super::labels::{TruthSum, Verdict};
use super::layout::Layout;
use super::points::Points;
use super::{CellRow, CellTruth, Cells, Label};
use crate::slam::Estimate;
use crate::wide::{Work, widest};

/// What the points of a cell add up to.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellSum {
    points: u32,
    height_m: f64,
    /// Of the heights from their mean.
    squares_m2: f64,
    low_m: f64,
    pub(super) high_m: f64,
    distance_m: f64,
    truth: TruthSum,
}

/// Sums the points of each cell into its row and features. A neighbour's height is the cell's own, and what is told by other cells is 0, until
/// `around` knows better.
pub(super) fn summarise(
    layout: &Layout,
    estimate: &Estimate,
    label: impl Fn(&CellTruth) -> Option<Label>,
    scratch: &mut Scratch,
    cells: &mut Cells,
) {
    let [sigma_x, sigma_y, sigma_z, sigma_roll, sigma_pitch, sigma_yaw] = estimate.sigmas();
    // The same for all rows.
    let [pitch, roll] = [estimate.pose.pitch_rad, estimate.pose.roll_rad].map(|f| f as f32);
    let sigmas = [sigma_z, sigma_roll, sigma_pitch, sigma_x, sigma_y, sigma_yaw].map(|f| f as f32);
    let Scratch { points, numbers, sums, verdicts, mean_heights_m, intensities, .. } = scratch;
    cells.points_binned = points.cells.len() as u64;
    widest(CellAccumulator { points, numbers, verdicts, mean_heights_m, sums });
    if layout.intensity {
        means_and_variances(numbers, &points.intensities, sums, intensities);
    }
    cells.rows.reserve(numbers.cells.len());
    cells.features.reserve(numbers.cells.len() * layout.width);
    for (k, (&index, sum)) in numbers.cells.iter().zip(&*sums).enumerate() {
        let (count, mean_m) = (f64::from(sum.points), mean_heights_m[k]);
        let truth = sum.truth.finish();
        cells.rows.push(CellRow {
            index,
            label: label(&truth),
            points: sum.points as i32,
            range_m: (sum.distance_m / count) as f32,
            neighbour_mask: 0,
            truth,
        });
        let features = &mut cells.features;
        let height_m = sum.high_m - sum.low_m;
        let [mean, variance, height, points] =
            [mean_m, sum.squares_m2 / count, height_m, count].map(|value| value as f32);
        features.extend_from_slice(&[mean, variance, height, points, pitch, roll]);
        features.extend(std::iter::repeat_n(mean, layout.local - Layout::NEIGHBOURS));
        features.resize(features.len() + layout.sigmas - layout.local, 0.0);
        features.extend_from_slice(&sigmas);
        if layout.intensity {
            let (mean, variance) = intensities[k];
            features.extend([mean as f32, variance as f32]);
        }
    }
    debug_assert_eq!(cells.features.len(), layout.width * cells.rows.len());
}

/// Sums over the points of each cell, and the means of their heights; in the machine's widest form, which compares floats in fewer steps.
struct CellAccumulator<'a> {
    points: &'a Points,
    numbers: &'a Numbers,
    verdicts: &'a [Verdict],
    mean_heights_m: &'a mut Vec<f64>,
    sums: &'a mut Vec<CellSum>,
}

impl Work for CellAccumulator<'_> {
    type Out = ();

    #[inline(always)]
    fn run(self) {
        let CellAccumulator { points, numbers, verdicts, mean_heights_m, sums } = self;
        sums.clear();
        sums.resize(numbers.cells.len(), CellSum::NONE);
        let slope_squared = &points.grounds.slope_squared;
        for ((&cell, &height_m), point) in numbers.of_point.iter().zip(&points.heights_m).zip(&points.returns) {
            let sum = &mut sums[cell as usize];
            sum.points += 1;
            sum.height_m += height_m;
            sum.low_m = f64::min(sum.low_m, height_m);
            sum.high_m = f64::max(sum.high_m, height_m);
            sum.distance_m += point.distance_m;
            let slope_squared = slope_squared.get(point.ground as usize).copied().unwrap_or(0.0);
            sum.truth.add(point.object, point.top, slope_squared, verdicts);
        }
        mean_heights_m.clear();
        // Eq. (3)
        mean_heights_m.extend(sums.iter().map(|sum| sum.height_m / f64::from(sum.points)));
        for (&cell, &height_m) in numbers.of_point.iter().zip(&points.heights_m) {
            // Eq. (4)
            let off_m = height_m - mean_heights_m[cell as usize];
            sums[cell as usize].squares_m2 += off_m * off_m;
        }
    }
}

impl CellSum {
    /// Of no point. Heights begin as sums of floats do: at the zero that changes no first term.
    const NONE: CellSum = CellSum {
        points: 0,
        height_m: -0.0,
        squares_m2: 0.0,
        low_m: f64::INFINITY,
        high_m: f64::NEG_INFINITY,
        distance_m: 0.0,
        truth: TruthSum::NONE,
    };
}

/// Mean and population variance of each cell's values, in two passes.
fn means_and_variances(numbers: &Numbers, values: &[f64], sums: &[CellSum], out: &mut Vec<(f64, f64)>) {
    out.clear();
    out.resize(sums.len(), (-0.0, 0.0));
    for (&cell, value) in numbers.of_point.iter().zip(values) {
        out[cell as usize].0 += value;
    }
    out.iter_mut().zip(sums).for_each(|((mean, _), sum)| *mean /= f64::from(sum.points));
    for (&cell, value) in numbers.of_point.iter().zip(values) {
        let (mean, squares) = &mut out[cell as usize];
        *squares += (value - *mean) * (value - *mean);
    }
    out.iter_mut().zip(sums).for_each(|((_, squares), sum)| *squares /= f64::from(sum.points));
}
