//! Times of the scenes, and trainings at four sizes -> what each setting is worth: its learning curve, and its gain at equal CPU.

use super::curve::{Curve, CurvePoint, flat_from};
use super::judging::TestScenes;
use super::learning::{Training, Trainings};
use super::measure::{Measured, cpu_s};
use super::missed::WrongByThreshold;
use super::report::{CurveRow, GainRow, Told, WorstRow, WorthRow};
use super::resample::{Resampled, Resampling, of_group};
use super::settings::{Settings, Variant};
use super::sizes::{Chosen, SIZES};
use crate::evaluate::Confusion;
use crate::measure::budget::FLAT;
use crate::statistics::{Interval, median};

/// How many trainings there are of a setting at a size, and how many a round brought.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seeds {
    pub all: usize,
    pub per_round: usize,
}

/// The settings' worth in their order, each against the first of its side; and how many times larger the variances of the gains
/// would be without common random numbers (median over settings).
pub(super) fn worth(
    settings: &Settings,
    measured: &Measured,
    test: &TestScenes,
    trainings: &[Option<Trainings>],
    seeds: Seeds,
) -> (Vec<Option<WorthRow>>, Option<f64>) {
    let resampling = Resampling::new(settings.reference().seed, test.judging(), seeds.all);
    let sizes: Vec<Option<Vec<Size>>> = settings
        .list
        .iter()
        .zip(trainings)
        .enumerate()
        .map(|(k, (setting, of))| {
            // The trainer's settings learn the reference's corpus.
            let corpus = if matches!(setting.variant, Variant::Plan(_)) { k } else { 0 };
            let of = of.as_ref()?.iter().enumerate();
            Some(of.map(|(size, of_size)| Size::of(measured, corpus, (size, seeds), of_size, &resampling)).collect())
        })
        .collect();
    let curves: Vec<Option<Curve>> = sizes.iter().map(|sizes| sizes.as_ref().map(|sizes| curve(sizes))).collect();
    let mut ratios = Vec::new();
    let mut rows: Vec<Option<WorthRow>> = Vec::new();
    for k in 0..settings.list.len() {
        let base = settings.base_of(k);
        let both = curves[k].as_ref().zip(curves[base].as_ref());
        let equal = both.filter(|_| k != base).and_then(|(own, base)| own.against(base, &resampling));
        let at_reference_cpu = both.and_then(|(own, base)| own.mean_within(base.largest_cpu_s()));
        ratios.extend(equal.as_ref().and_then(|equal| equal.variance_ratio));
        rows.push(sizes[k].as_ref().map(|sizes| {
            WorthRow {
                curve: sizes
                    .iter()
                    .zip(&trainings[k].as_ref().expect("it has sizes")[..])
                    .map(|(size, of)| size.row(of, test, &resampling))
                    .collect(),
                farther: Vec::new(),
                farther_gain: None,
                at_reference_cpu,
                gain: equal.map(|equal| GainRow {
                    cpu_s: equal.cpu_s,
                    scenes: equal.scenes.round() as u64,
                    reference_scenes: equal.base_scenes.round() as u64,
                    balanced_accuracy: equal.gain,
                    fewer_missed: equal.fewer_missed,
                    told: Told::of(&equal.gain, None),
                }),
                flat_from: flat_from(
                    &sizes.iter().map(|size| size.accuracy.clone()).collect::<Vec<_>>(),
                    &resampling,
                    FLAT,
                )
                .map(|size| sizes[size].scenes as u64),
            }
        }));
    }
    (rows, median(&ratios))
}

/// A setting at a size.
struct Size {
    scenes: usize,
    generate_cpu_s: f64,
    train_cpu_s: f64,
    accuracy: Resampled,
    missed: Resampled,
}

impl Size {
    fn of(
        measured: &Measured,
        corpus: usize,
        (size, Seeds { all: seeds, per_round }): (usize, Seeds),
        trainings: &[Training],
        resampling: &Resampling,
    ) -> Size {
        let of_seed = |seed| Chosen::of(measured.scenes.len(), size, seed, per_round);
        let chosen: Vec<Chosen> = (0..seeds).map(of_seed).collect();
        let made_s =
            chosen.iter().flat_map(Chosen::all).map(|scene| cpu_s(&measured.scenes[scene][corpus])).sum::<f64>();
        let tested: Vec<&[Confusion]> = trainings.iter().map(|one| one.verdicts.scenes.as_slice()).collect();
        let missed: Vec<&[WrongByThreshold]> = trainings.iter().map(|one| one.verdicts.missed.as_slice()).collect();
        Size {
            scenes: chosen[0].count(),
            generate_cpu_s: made_s / seeds as f64,
            train_cpu_s: trainings.iter().map(|one| one.cpu_s).sum::<f64>() / seeds as f64,
            accuracy: resampling.balanced_accuracy(&tested),
            missed: resampling.missed(&missed),
        }
    }

    fn row(&self, trainings: &[Training], test: &TestScenes, resampling: &Resampling) -> CurveRow {
        let mean = |of: &dyn Fn(&Training) -> Option<f64>| {
            let values = trainings.iter().map(of).collect::<Option<Vec<f64>>>()?;
            Some(values.iter().sum::<f64>() / values.len() as f64)
        };
        let families = test.groups_with_scenes().filter(|(group, _)| group.judges);
        let families = families.filter_map(|(group, scenes)| {
            let family = group.held_out.clone()?;
            Some(WorstRow { balanced_accuracy: mean(&|one| of_group(&one.verdicts.scenes, scenes))?, family })
        });
        CurveRow {
            scenes: self.scenes as u64,
            train_rows: mean(&|one| Some(one.train_rows as f64)).unwrap_or(0.0),
            rows_learnt: mean(&|one| Some(one.rows_learnt as f64)).unwrap_or(0.0),
            generate_cpu_s: self.generate_cpu_s,
            train_cpu_s: self.train_cpu_s,
            learning_cpu_s: mean(&|one| Some(one.learning_cpu_s)).unwrap_or(0.0),
            balanced_accuracy: resampling.interval(&self.accuracy),
            by_seed: self.accuracy.by_seed().to_vec(),
            own: mean(&|one| of_group(&one.verdicts.scenes, test.own())),
            worst: families.min_by(|a, b| a.balanced_accuracy.total_cmp(&b.balanced_accuracy)),
            missed: resampling.interval(&self.missed),
        }
    }
}

fn curve(sizes: &[Size]) -> Curve {
    let point = |size: &Size| CurvePoint {
        scenes: size.scenes as f64,
        cpu_s: size.generate_cpu_s + size.train_cpu_s,
        accuracy: size.accuracy.clone(),
        missed: size.missed.clone(),
    };
    debug_assert_eq!(sizes.len(), SIZES.len());
    Curve::new(sizes.iter().map(point).collect())
}

impl Told {
    /// Of a gain that lies beyond its interval, and beyond what other draws alone gained, if that is known.
    pub(super) fn of(gain: &Interval, floor: Option<f64>) -> Told {
        if !gain.half_width.is_finite() {
            return Told::OneSeed;
        }
        let apart = gain.mean.abs() > gain.half_width && gain.mean.abs() > floor.unwrap_or(0.0);
        match apart {
            false => Told::NotApart,
            true if gain.mean > 0.0 => Told::Better,
            true => Told::Worse,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_gain_is_told_beyond_its_interval_and_the_noise_floor() {
        let gain = |mean: f64, half_width: f64| Interval { mean, half_width };
        for (mean, half_width, floor, expected) in [
            (0.01, 0.004, None, Told::Better),
            (-0.01, 0.004, Some(0.009), Told::Worse),
            (0.01, 0.004, Some(0.012), Told::NotApart),
            (0.01, 0.01, None, Told::NotApart),
            (0.0, 0.0, None, Told::NotApart),
            (0.5, f64::INFINITY, None, Told::OneSeed),
        ] {
            assert_eq!(Told::of(&gain(mean, half_width), floor), expected, "{mean} {half_width} {floor:?}");
        }
    }
}
