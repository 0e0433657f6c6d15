//! How often the trainings of a study went through their rows -> how often one on more scenes will.
//!
//! Training ends some looks after the validation error fell last, and looks are parts of a pass: the more rows, the fewer passes. ln passes =
//! a + power ln scenes, fitted to all settings together (least squares), for one training ends a look or five before or after
//! another. Beyond the study the law goes on to [`FEWEST`].

use crate::math;
use crate::measure::study::{Study, StudySize};

/// Patience alone is one pass, and the best look comes some time before.
const FEWEST: f64 = 1.2;

/// passes = at_largest (scenes / largest)^power, and no fewer than [`FEWEST`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Passes {
    at_largest: f64,
    largest: f64,
    power: f64,
}

impl Passes {
    pub(super) fn of(study: &Study) -> Passes {
        let sizes = || study.settings.iter().flat_map(|setting| &setting.sizes);
        let largest = sizes().map(|size| size.scenes).max().unwrap_or(1) as f64;
        let point = |size: &StudySize| (math::ln(size.scenes as f64 / largest), math::ln(size.passes));
        let points: Vec<(f64, f64)> = sizes().map(point).collect();
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
        let (mean_x, mean_y) = (mean(|point| point.0), mean(|point| point.1));
        let products: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
        let squares: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.0 - mean_x)).sum();
        let power = (products / squares).clamp(-1.0, 0.0);
        Passes { at_largest: math::exp(mean_y - power * mean_x), largest, power }
    }

    /// Of so many scenes that train and stop.
    pub(super) fn at(&self, scenes: f64) -> f64 {
        (self.at_largest * math::pow(scenes / self.largest, self.power)).max(FEWEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::study::tests::{setting, study};

    fn law(passes: impl Fn(f64) -> f64) -> Passes {
        let mut study = study(vec![setting("a", None, (0.05, 4.0), (0.02, 0.01)); 2]);
        let settings = study.settings.iter_mut().flat_map(|setting| &mut setting.sizes);
        settings.for_each(|size| size.passes = passes(size.scenes as f64));
        Passes::of(&study)
    }

    #[test]
    fn exact_a_power_of_the_scenes_is_found_again_down_to_the_fewest_passes() {
        let passes = law(|scenes| 4.0 * (128.0 / scenes).sqrt());
        assert!((passes.at(128.0) - 4.0).abs() < 1e-9 && (passes.at(512.0) - 2.0).abs() < 1e-9);
        assert_eq!(passes.at(1e6), FEWEST);
        // More scenes never take more passes.
        let passes = law(|scenes| 1.5 + scenes / 128.0);
        assert_eq!(passes.at(1e6), passes.at(16.0));
    }
}
