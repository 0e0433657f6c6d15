//! Errors of a network scene by scene -> how sure its validation error is, and how much it is above another's.
//!
//! In: outputs on the validation rows and the scene of each row. A validation error is a ratio, the weighted squared errors of all scenes
//! over their weights, and what was drawn are scenes: with q_s and w_s of a scene, both as shares of the weight of all, E = sum q_s, and its variance is
//! that of the linearised ratio (Cochran 1977, "Sampling Techniques", 6.4), n / (n - 1) sum (q_s - E w_s)^2. Out: intervals of 95 %, Student's
//! with n - 1 degrees of freedom. A difference of two networks is of pairs: q_s is then the difference on each scene. Not covered: other trainings of
//! the same network, and that the best of many networks looks better than it is.

use crate::statistics::{Interval, student};
use crate::train::memory::Held;

/// The scenes that validation rows come from.
#[derive(Clone, Debug)]
pub(crate) struct ValidationScenes {
    /// Of each validation row, from 0.
    of_row: Vec<u32>,
    /// Of each scene, as a share of the weight of all.
    weights: Vec<f64>,
    /// Of the 95 % interval, in standard deviations.
    student: f64,
}

impl ValidationScenes {
    /// `of_row`: the scene of each row that was drawn, from 0, before [`Held`] thinned them.
    pub(crate) fn new(held: &Held, of_row: &[u32]) -> ValidationScenes {
        let of_row: Vec<u32> = of_row.iter().copied().step_by(held.looked_every).collect();
        assert_eq!(of_row.len(), held.validation.len(), "a scene for each row");
        let scenes = of_row.iter().max().map_or(0, |last| *last as usize + 1);
        let student = if scenes > 1 { student(scenes - 1, 0.95) } else { f64::INFINITY };
        let mut found = ValidationScenes { of_row, weights: vec![0.0; scenes], student };
        for row in 0..held.validation.len() {
            found.weights[found.of_row[row] as usize] += found.weight(held, row);
        }
        let all: f64 = found.weights.iter().sum();
        found.weights.iter_mut().for_each(|weight| *weight /= all);
        found
    }

    pub(crate) fn count(&self) -> usize {
        self.weights.len()
    }

    fn weight(&self, held: &Held, row: usize) -> f64 {
        held.objective.look_weights.of(held.validation.labels[row], held.validation.corpora[row])
    }

    /// What each scene adds to the validation error of a network with these outputs; nothing where that is not finite.
    pub(super) fn errors(&self, held: &Held, outputs: &[f64]) -> Vec<f64> {
        let mut errors = vec![0.0; self.weights.len()];
        let mut all = 0.0;
        for (row, output) in outputs.iter().enumerate() {
            let error = held.objective.targets[held.validation.labels[row].index()] - output;
            let weight = self.weight(held, row);
            errors[self.of_row[row] as usize] += weight * error * error;
            all += weight;
        }
        errors.iter_mut().for_each(|error| *error /= all);
        if errors.iter().all(|error| error.is_finite()) { errors } else { Vec::new() }
    }

    /// The interval of an error, or of a difference of errors, by what each scene adds to it; `None` where that is not known.
    pub(crate) fn interval(&self, errors: impl ExactSizeIterator<Item = f64> + Clone) -> Option<Interval> {
        if errors.len() != self.weights.len() {
            return None;
        }
        let mean: f64 = errors.clone().sum();
        let count = self.weights.len() as f64;
        let apart = errors.zip(&self.weights).map(|(error, weight)| error - mean * weight);
        let squares: f64 = apart.map(|apart| apart * apart).sum();
        let half_width =
            if count > 1.0 { self.student * (squares * count / (count - 1.0)).sqrt() } else { f64::INFINITY };
        Some(Interval { mean, half_width })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::random::{Purpose, Stage, Streams};

    pub(crate) fn scenes(weights: &[f64]) -> ValidationScenes {
        let all: f64 = weights.iter().sum();
        let weights: Vec<f64> = weights.iter().map(|weight| weight / all).collect();
        ValidationScenes { of_row: Vec::new(), student: student(weights.len() - 1, 0.95), weights }
    }

    #[test]
    fn exact_scenes_of_one_weight_have_the_interval_of_a_mean() {
        let values = [0.1, 0.4, 0.2, 0.7, 0.3];
        let interval = scenes(&[2.0; 5]).interval(values.iter().map(|value| value / 5.0)).unwrap();
        let (mean, variance) = (0.34, (0.0576 + 0.0036 + 0.0196 + 0.1296 + 0.0016) / 4.0);
        assert!((interval.mean - mean).abs() < 1e-15);
        // Student's 95 % quantile for four degrees of freedom.
        assert!((interval.half_width - 2.776_445_105 * f64::sqrt(variance / 5.0)).abs() < 1e-9);
        assert!(scenes(&[1.0; 5]).interval([0.1; 4].into_iter()).is_none());
    }

    #[test]
    fn law_intervals_of_a_ratio_hold_what_is_true_as_often_as_they_say() {
        // Scenes of other weights and errors, which go with the weights.
        let (runs, count) = (2000, 60);
        let mut held = 0;
        for run in 0..runs {
            let streams = Streams { seed: run, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
            let mut drawn = vec![0.0; 2 * count];
            streams.open(Purpose::InitialWeights).fill_uniform(0, &mut drawn);
            let weights: Vec<f64> = drawn[..count].iter().map(|u| 0.5 + u).collect();
            let squared: Vec<f64> =
                weights.iter().zip(&drawn[count..]).map(|(w, u)| w * (0.05 + 0.1 * w + 0.2 * u)).collect();
            let all: f64 = weights.iter().sum();
            let interval = scenes(&weights).interval(squared.iter().map(|q| q / all)).unwrap();
            // E[q] / E[w], with w uniform in (0.5, 1.5) and u in (0, 1): 0.15 + 0.1 E[w^2].
            let truth = 0.15 + 0.1 * (1.0 + 1.0 / 12.0);
            held += u64::from((interval.mean - truth).abs() <= interval.half_width);
        }
        let share = held as f64 / runs as f64;
        // 95 % less and more four standard errors of 2000 runs.
        assert!((0.93..0.97).contains(&share), "{share}");
    }
}
