//! This module holds the families of a plan as the strata of a sample: which scene is run next, and what all scenes of the plan take.
//!
//! What each finished scene took and gave goes in (seconds, rows). The next scene's number comes out until enough is known, and for any cost the
//! [`Figure`] of the whole plan.
//!
//! Strata are the plan's families, weighed by the scenes that each really has. The next scene comes from the family that
//! takes most off the standard error for its time (Neyman's allocation, step by step), from all over the plan. Standard errors
//! are of the sample alone: a machine that is busier later than now is not in them.

use std::time::Instant;

use super::{ENOUGH, Options};
use crate::corpus::Table;
use crate::corpus::advice::Content;
use crate::episode::{SceneOutput, StageTimes};
use crate::measure::clock::{Costs, Seconds};
use crate::plan::Plan;
use crate::statistics::Moments;

/// Scenes of a family before its spread is known at all.
const FIRST: usize = 3;
/// A plan of more scenes is represented by so many, evenly spread.
const MOST_SCENES: u64 = 50_000;
/// Outputs are kept, to be written as a shard, up to so many scenes and rows of all tables.
const KEPT_SCENES: usize = 64;
const KEPT_ROWS: u64 = 2_000_000;

/// A value and its standard error, which is infinite where nothing tells it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Figure {
    pub value: f64,
    pub standard_error: f64,
}

impl Figure {
    /// Standard error over value.
    pub(crate) fn relative_error(&self) -> f64 {
        if self.value == 0.0 { 0.0 } else { self.standard_error / self.value.abs() }
    }
}

/// What one scene took and gave.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SceneCost {
    pub whole: Seconds,
    /// CPU seconds, in the order of [`StageTimes::STAGES`].
    pub stages: [f64; StageTimes::STAGES.len()],
    /// By number of [`Table`].
    pub rows: [f64; Table::ALL.len()],
}

impl SceneCost {
    pub(super) fn of(costs: &Costs, output: &SceneOutput) -> SceneCost {
        let scans = || output.scans.iter();
        let cells: usize = scans().map(|scan| scan.cells.rows.len()).sum();
        let points: usize = scans().filter_map(|scan| scan.points.as_ref()).map(|p| p.sweep.returns.status.len()).sum();
        SceneCost {
            whole: costs.whole,
            stages: costs.stages.map(|stage| stage.cpu),
            rows: Table::ALL.map(|table| match table {
                Table::Cells => cells as f64,
                Table::Scenes => 1.0,
                Table::Poses => output.poses.len() as f64,
                Table::Points => points as f64,
            }),
        }
    }
}

/// The scenes of one family.
pub(super) struct Stratum {
    pub family: usize,
    /// In the plan.
    pub scenes: f64,
    /// Numbers of its scenes, each prefix spread over the plan.
    pub order: Vec<u64>,
    /// Of the first ones in `order`, as they were finished.
    pub measured: Vec<SceneCost>,
    pub begun: usize,
}

/// Strata with what was measured, and outputs to write.
pub(super) struct Sample {
    pub strata: Vec<Stratum>,
    /// By family of the plan.
    pub contents: Vec<Content>,
    pub outputs: Vec<SceneOutput>,
    pub kept_rows: u64,
}

/// The plan's scenes by family, each family's in an order whose every beginning is spread over the plan.
pub(super) fn strata(plan: &Plan) -> Vec<Stratum> {
    let listed = plan.scenes.min(MOST_SCENES);
    let mut orders = vec![Vec::new(); plan.families.len()];
    for k in 0..listed {
        let scene = (u128::from(k) * u128::from(plan.scenes) / u128::from(listed)) as u64;
        orders[plan.family_index_of(scene)].push(scene);
    }
    let scenes_per_listed = plan.scenes as f64 / listed as f64;
    let spread = |order: Vec<u64>| {
        let mut numbered: Vec<(u32, u64)> = (0u32..).map(u32::reverse_bits).zip(order).collect();
        numbered.sort_unstable();
        numbered.into_iter().map(|(_, scene)| scene).collect::<Vec<_>>()
    };
    let families = orders.into_iter().enumerate().filter(|(_, order)| !order.is_empty());
    families
        .map(|(family, order)| Stratum {
            family,
            scenes: order.len() as f64 * scenes_per_listed,
            order: spread(order),
            measured: Vec::new(),
            begun: 0,
        })
        .collect()
}

impl Stratum {
    /// The variance is `None` where too few scenes were measured to tell; the mean of none is nought.
    fn mean_and_variance(&self, value: impl Fn(&SceneCost) -> f64) -> (f64, Option<f64>) {
        let moments = Moments::of(self.measured.iter().map(&value));
        moments.map_or((0.0, None), |moments| (moments.mean, moments.variance))
    }

    /// Variance that one more scene takes off the total's.
    fn gain(&self, value: impl Fn(&SceneCost) -> f64) -> f64 {
        let count = self.begun.max(1) as f64;
        self.scenes * self.scenes * self.mean_and_variance(value).1.unwrap_or(0.0) / (count * (count + 1.0))
    }
}

impl Sample {
    pub(super) fn scenes(&self) -> u64 {
        self.strata.iter().map(|stratum| stratum.measured.len() as u64).sum()
    }

    /// Why the first scene failed, where all did.
    pub(super) fn only_failure(&self) -> Option<String> {
        let (scenes, failed) = self
            .contents
            .iter()
            .fold((0, 0), |(scenes, failed), content| (scenes + content.scenes, failed + content.failed));
        let mut reasons = self.contents.iter().filter_map(|content| content.first_failure.clone());
        (scenes > 0 && failed == scenes).then(|| reasons.next().unwrap_or_default())
    }

    /// Families with scenes in the plan of which none was run.
    pub(super) fn not_reached(&self, plan: &Plan) -> Vec<String> {
        let unseen = self.strata.iter().filter(|stratum| stratum.measured.is_empty());
        unseen.map(|stratum| plan.families[stratum.family].name.clone()).collect()
    }

    /// Sum over all scenes of the plan. A family of which no scene was run is taken to be as the others; one of which a single scene was run is taken
    /// to spread about its mean as they do. Where no family has two scenes, nothing tells the standard error.
    pub(super) fn total(&self, value: impl Fn(&SceneCost) -> f64) -> Figure {
        let mut figure = Figure::default();
        let mut variance = 0.0;
        let relative = |stratum: &Stratum| {
            let (mean, spread) = stratum.mean_and_variance(&value);
            let spread = spread?;
            Some(if mean == 0.0 { 0.0 } else { spread / (mean * mean) })
        };
        let usual = Moments::of(self.strata.iter().filter_map(relative)).map_or(f64::INFINITY, |moments| moments.mean);
        for stratum in self.strata.iter().filter(|stratum| !stratum.measured.is_empty()) {
            let (mean, spread) = stratum.mean_and_variance(&value);
            let count = stratum.measured.len() as f64;
            figure.value += stratum.scenes * mean;
            // A family that was run to its last scene is known.
            if count < stratum.scenes {
                // Nought times infinity would be no number.
                let as_others = || if usual.is_finite() { usual * mean * mean } else { f64::INFINITY };
                let spread = spread.unwrap_or_else(as_others);
                variance += stratum.scenes * stratum.scenes * spread / count * (1.0 - count / stratum.scenes);
            }
        }
        let scenes = |is_measured: bool| {
            let strata = self.strata.iter().filter(|stratum| stratum.measured.is_empty() != is_measured);
            strata.map(|stratum| stratum.scenes).sum::<f64>()
        };
        let (seen, unseen) = (scenes(true), scenes(false));
        let all_per_seen = if seen > 0.0 { (seen + unseen) / seen } else { 1.0 };
        Figure { value: figure.value * all_per_seen, standard_error: variance.sqrt() * all_per_seen }
    }

    /// The next scene to run, if one is needed: its stratum and its number.
    pub(super) fn next(&mut self, options: &Options, started: Instant) -> Option<(usize, u64)> {
        if options.stopped() {
            return None;
        }
        let begun: usize = self.strata.iter().map(|stratum| stratum.begun).sum();
        let late = started.elapsed() > options.limit && begun > 0;
        let enough = match options.scenes {
            Some(wanted) => begun as u64 >= wanted,
            None => late || self.is_known(),
        };
        let open = || self.strata.iter().enumerate().filter(|(_, stratum)| stratum.begun < stratum.order.len());
        let unseen = |count: usize| open().find(|(_, stratum)| stratum.begun < count).map(|(k, _)| k);
        let k = match unseen(1) {
            // A family of which nothing is known is run however late it is; not where a number was asked for.
            Some(k) if options.scenes.is_none() || !enough => k,
            _ if enough => return None,
            _ => unseen(FIRST).or_else(|| self.most_telling())?,
        };
        let stratum = &mut self.strata[k];
        stratum.begun += 1;
        Some((k, stratum.order[stratum.begun - 1]))
    }

    /// The family whose next scene tells most for its time.
    fn most_telling(&self) -> Option<usize> {
        let (time, rows) = (self.total(|cost| cost.whole.cpu).value, self.total(|cost| cost.rows[0]).value);
        let worth = |stratum: &Stratum| {
            let relative = stratum.gain(|cost| cost.whole.cpu) / (time * time).max(f64::MIN_POSITIVE)
                + stratum.gain(|cost| cost.rows[0]) / (rows * rows).max(f64::MIN_POSITIVE);
            relative / stratum.mean_and_variance(|cost| cost.whole.cpu).0.max(1e-6)
        };
        let open = self.strata.iter().enumerate().filter(|(_, stratum)| stratum.begun < stratum.order.len());
        open.map(|(k, stratum)| (k, worth(stratum))).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    }

    fn is_known(&self) -> bool {
        self.strata.iter().all(|stratum| stratum.measured.len() >= FIRST.min(stratum.order.len()))
            && self.total(|cost| cost.whole.cpu).relative_error() < ENOUGH
            && self.total(|cost| cost.rows[0]).relative_error() < ENOUGH
    }

    pub(super) fn add(&mut self, stratum: usize, cost: SceneCost, output: SceneOutput) {
        self.strata[stratum].measured.push(cost);
        self.contents[self.strata[stratum].family].add(&output);
        let rows = cost.rows.iter().sum::<f64>() as u64;
        if self.outputs.is_empty() || self.outputs.len() < KEPT_SCENES && self.kept_rows + rows <= KEPT_ROWS {
            self.kept_rows += rows;
            self.outputs.push(output);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stratum(scenes: f64, values: &[f64]) -> Stratum {
        let cost = |&value: &f64| SceneCost { whole: Seconds { cpu: value, wall: value }, ..SceneCost::default() };
        Stratum {
            family: 0,
            scenes,
            order: (0..scenes as u64).collect(),
            measured: values.iter().map(cost).collect(),
            begun: values.len(),
        }
    }

    #[test]
    fn exact_stratified_total_and_its_standard_error() {
        let strata = vec![stratum(10.0, &[1.0, 3.0]), stratum(90.0, &[2.0, 2.0, 5.0])];
        let sample = Sample { strata, contents: Vec::new(), outputs: Vec::new(), kept_rows: 0 };
        let figure = sample.total(|cost| cost.whole.cpu);
        // Means 2 and 3; sample variances 2 and 3; with the share of each family that is left.
        assert_eq!(figure.value, 10.0 * 2.0 + 90.0 * 3.0);
        let variance: f64 = 100.0 * 2.0 / 2.0 * 0.8 + 8100.0 * 3.0 / 3.0 * (87.0 / 90.0);
        assert!((figure.standard_error - variance.sqrt()).abs() < 1e-12);
        // A family of which no scene was run counts as the others do.
        let strata = vec![stratum(10.0, &[1.0, 3.0]), stratum(5.0, &[])];
        let half_seen = Sample { strata, contents: Vec::new(), outputs: Vec::new(), kept_rows: 0 };
        assert_eq!(half_seen.total(|cost| cost.whole.cpu).value, 15.0 * 2.0);
        // A family of which one scene was run spreads as the others do, and a single scene tells nothing.
        let strata = vec![stratum(10.0, &[1.0, 3.0]), stratum(20.0, &[4.0])];
        let once = Sample { strata, contents: Vec::new(), outputs: Vec::new(), kept_rows: 0 };
        let variance: f64 = 100.0 * 2.0 / 2.0 * 0.8 + 400.0 * (0.5 * 16.0) * 0.95;
        assert!((once.total(|cost| cost.whole.cpu).standard_error - variance.sqrt()).abs() < 1e-12);
        for (others, value) in [(vec![], 10.0), (vec![stratum(5.0, &[])], 15.0), (vec![stratum(5.0, &[0.0])], 10.0)] {
            let strata = std::iter::once(stratum(10.0, &[1.0])).chain(others).collect();
            let single = Sample { strata, contents: Vec::new(), outputs: Vec::new(), kept_rows: 0 };
            let figure = single.total(|cost| cost.whole.cpu);
            assert!(
                figure.value == value && figure.standard_error == f64::INFINITY && figure.relative_error() > ENOUGH
            );
        }
        // A family run to its last scene leaves nothing open.
        let whole =
            Sample { strata: vec![stratum(2.0, &[1.0, 3.0])], contents: Vec::new(), outputs: Vec::new(), kept_rows: 0 };
        assert_eq!(whole.total(|cost| cost.whole.cpu), Figure { value: 4.0, standard_error: 0.0 });
    }

    #[test]
    fn law_the_family_of_most_spread_and_weight_is_sampled_next() {
        let next = |strata: Vec<Stratum>| {
            Sample { strata, contents: Vec::new(), outputs: Vec::new(), kept_rows: 0 }.most_telling()
        };
        assert_eq!(next(vec![stratum(50.0, &[1.0, 1.1, 0.9]), stratum(50.0, &[1.0, 3.0, 2.0])]), Some(1));
        assert_eq!(next(vec![stratum(900.0, &[1.0, 1.2, 0.8]), stratum(10.0, &[1.0, 1.4, 0.6])]), Some(0));
        assert_eq!(next(vec![stratum(3.0, &[1.0, 9.0, 5.0]), stratum(9.0, &[1.0, 1.0, 1.0])]), Some(1));
    }
}
