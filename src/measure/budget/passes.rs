//! How often the trainings of a study went through their rows -> how often one on more rows will.
//!
//! A training ends `patience` looks after its error fell last, and looks are parts of a pass: passes = those of patience, which `train` knows, and
//! those until the error fell last, which are the fewer the more rows there are. ln of these = a + power ln rows, fitted to all settings and
//! sizes of the study together (least squares), for one training ends a few looks before or after another. Beyond the study's largest size
//! the power is no steeper than [`STEEPEST_BEYOND`]: corpora of 8 to 60 times the rows took up to twice the passes of the law carried on.

use crate::math;
use crate::measure::study::{Study, StudySize};
use crate::train::TrainParams;

/// Taken for the passes until the error fell last where patience alone is as long as the trainings were.
const FEWEST: f64 = 0.05;

/// The steepest power beyond the largest size: between what quickstart.yaml and paper.yaml took, built for `scripts/verify_plan.py`.
const STEEPEST_BEYOND: f64 = -0.3;

/// Passes until the error fell last: at_largest (rows / largest)^power.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passes {
    at_largest: f64,
    largest_rows: f64,
    power: f64,
}

impl Passes {
    pub(super) fn of(study: &Study) -> Passes {
        let sizes = || study.settings.iter().flat_map(|setting| &setting.sizes);
        let largest_rows = sizes().map(|size| size.train_rows).fold(1.0, f64::max);
        let point = |size: &StudySize| {
            let passes = size.rows_learnt / size.train_rows - of_patience(size.train_rows);
            (math::ln(size.train_rows / largest_rows), math::ln(passes.max(FEWEST)))
        };
        let points: Vec<(f64, f64)> = sizes().map(point).collect();
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
        let (mean_x, mean_y) = (mean(|point| point.0), mean(|point| point.1));
        let products: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
        let squares: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.0 - mean_x)).sum();
        let power = (products / squares).clamp(-1.0, 0.0);
        Passes { at_largest: math::exp(mean_y - power * mean_x), largest_rows, power }
    }

    /// Of a training on so many rows.
    pub(super) fn at(&self, rows: f64) -> f64 {
        let power = if rows > self.largest_rows { self.power.max(STEEPEST_BEYOND) } else { self.power };
        self.at_largest * math::pow(rows / self.largest_rows, power) + of_patience(rows)
    }
}

/// Passes for which `train` waits in vain.
fn of_patience(rows: f64) -> f64 {
    let params = TrainParams::default();
    f64::from(params.patience) * params.rows_between_looks(rows as u64) as f64 / rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::study::tests::{setting, study};

    fn law(passes: impl Fn(f64) -> f64) -> Passes {
        let mut study = study(vec![setting("a", None, (0.05, 4.0), (0.02, 0.01)); 2]);
        for size in study.settings.iter_mut().flat_map(|setting| &mut setting.sizes) {
            size.train_rows = 1e3 * size.scenes as f64;
            size.rows_learnt = size.train_rows * passes(size.train_rows);
        }
        Passes::of(&study)
    }

    #[test]
    fn exact_passes_beside_patience_are_a_power_of_the_rows_and_end_at_patience() {
        // The study's largest size has 128,000 rows, whose patience is ten looks of 20,000.
        let passes = law(|rows| 3.0 * (128_000.0 / rows).sqrt() + of_patience(rows));
        assert!((passes.at(128_000.0) - 3.0 - 200.0 / 128.0).abs() < 1e-9, "{passes:?}");
        // Of more than 200,000 rows patience is one pass.
        assert!((passes.at(512_000.0) - 3.0 * math::pow(4.0, -0.3) - 1.0).abs() < 1e-9);
        assert!((passes.at(32_000.0) - 6.0 - of_patience(32_000.0)).abs() < 1e-9);
        // A flatter law goes on as it is.
        let flat = law(|rows| 3.0 * math::pow(128_000.0 / rows, 0.2) + of_patience(rows));
        assert!((flat.at(512_000.0) - 3.0 * math::pow(4.0, -0.2) - 1.0).abs() < 1e-9);
        assert!((passes.at(1e9) - 3.0 * math::pow(128e3 / 1e9, 0.3) - 1.0).abs() < 1e-9);
        assert!((passes.at(1e12) - 1.0).abs() < 0.05);
        // More rows never take more passes.
        let passes = law(|rows| 3.0 + rows / 64_000.0);
        assert_eq!(passes.power, 0.0);
    }
}
