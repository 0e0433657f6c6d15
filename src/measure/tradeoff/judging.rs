//! The reference plan -> the scenes that every classifier is judged on: some of the config's own kinds, and some of each held-out family.
//!
//! They are of another seed, so no corpus of the config holds them, and they are made at the reference setting alone: a setting that makes its
//! own scenes easier does not gain by it. Where the config has held-out families a classifier is judged by their mean, else by the own
//! kinds. Kept: each scene's cells, as the trainer holds them.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::compare::SceneCells;
use super::measure::inputs;
use super::missed::WrongByThreshold;
use super::{Event, TradeoffError, caught};
use crate::cells::Label;
use crate::corpus::Split;
use crate::episode::{Prepared, Scratch, Unobserved, replay_scene};
use crate::evaluate::Confusion;
use crate::parallel;
use crate::plan::{Family, Plan};
use crate::train::rows::Rows;

/// Above it, an output calls a cell untraversable.
const THRESHOLD: f64 = 0.5;
/// What the seed of the test scenes differs by.
const OTHER_SEED: u64 = 0x7465_7374;

/// Test scenes of one kind.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct TestGroup {
    /// `None`: the families that train, by their weights.
    pub held_out: Option<String>,
    pub scenes: u64,
    pub cells: u64,
    /// Scenes that could not be made, or have no cell with a label.
    #[serde(default)]
    pub left_out: u64,
    /// Whether classifiers are compared by it; not by a family all of whose cells are of one class.
    pub judges: bool,
}

/// Cells to judge by, scene after scene, group after group.
#[derive(Default)]
pub(super) struct TestScenes {
    pub groups: Vec<TestGroup>,
    /// Of each scene its group and its cells, as they were made.
    made: Vec<(usize, Rows)>,
    rows: Rows,
    /// Of each scene: its rows.
    scenes: Vec<Range<usize>>,
    /// Of each group: its scenes.
    of_group: Vec<Range<usize>>,
}

/// What a classifier makes of the test scenes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Verdicts {
    /// By scene.
    pub scenes: Vec<Confusion>,
    /// Of each group that judges: what is missed at a fixed share of false calls.
    pub missed: Vec<WrongByThreshold>,
}

/// Makes test scenes of the own kinds and of each held-out family, those of these numbers, and puts them behind the ones that are there.
/// `None` where `stop` was raised.
pub(super) fn make(
    reference: &Plan,
    mut there: TestScenes,
    numbers: Range<u64>,
    threads: usize,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<TestScenes>, TradeoffError> {
    let plans = plans(reference);
    let prepared = plans.iter().map(|(_, plan)| Prepared::new(plan.clone())).collect::<Result<Vec<_>, _>>()?;
    let (features, columns) = inputs(&prepared[0].plan);
    let wanted: Vec<(usize, u64)> = plans
        .iter()
        .enumerate()
        .flat_map(|(k, (_, plan))| train_scenes(plan, &numbers).map(move |id| (k, id)))
        .collect();
    let one_scene = |(group, id): (usize, u64), scratch: &mut Scratch| {
        caught(|| {
            let mut rows = Rows::new(features.len());
            // One that cannot be made is counted with those that have no cells.
            if let Ok(replay) = replay_scene(&prepared[group], id, scratch, &mut Unobserved) {
                SceneCells::of(&replay.scans, &columns).learn(&mut rows);
            }
            (group, rows)
        })
    };
    let of = wanted.len();
    let made = parallel::map(threads, wanted, stop, one_scene, |done| tell(Event::TestScene { done, of }))?;
    let names: Vec<Option<String>> = plans.into_iter().map(|(name, _)| name).collect();
    let Some(made) = made else { return Ok(None) };
    there.made.extend(made);
    let test = TestScenes::new(&names, features.len(), there.made);
    if test.judging().is_empty() {
        return Err(TradeoffError::OneClass { scenes: test.groups.iter().map(|group| group.scenes).sum() });
    }
    Ok(Some(test))
}

/// The own kinds, then each held-out family, with their names.
fn plans(reference: &Plan) -> Vec<(Option<String>, Plan)> {
    let other = Plan { seed: reference.seed ^ OTHER_SEED, ..reference.clone() };
    let held_out = reference.families.iter().filter(|family| family.hold_out).map(|family| {
        let family = Family { hold_out: false, ..family.clone() };
        (Some(family.name.clone()), Plan { families: vec![family], ..other.clone() })
    });
    let held_out: Vec<_> = held_out.collect();
    [(None, other)].into_iter().chain(held_out).collect()
}

/// Scenes of train shards, which hold no held-out family: those of these numbers among them.
fn train_scenes(plan: &Plan, numbers: &Range<u64>) -> impl Iterator<Item = u64> + use<> {
    let per_shard = u64::from(plan.scenes_per_shard);
    let own = (0..).filter(move |scene| Split::of_shard(scene / per_shard) == Split::Train);
    own.skip(numbers.start as usize).take((numbers.end - numbers.start) as usize)
}

fn holds_both_classes(labels: &[Label]) -> bool {
    labels.iter().any(|label| label.is_untraversable()) && labels.iter().any(|label| !label.is_untraversable())
}

impl TestScenes {
    fn new(names: &[Option<String>], width: usize, made: Vec<(usize, Rows)>) -> TestScenes {
        let mut test = TestScenes { rows: Rows::new(width), ..TestScenes::default() };
        let judges = |name: &Option<String>| name.is_some() || names.len() == 1;
        for (group, name) in names.iter().enumerate() {
            let (first_scene, first_row) = (test.scenes.len(), test.rows.len());
            let own = || made.iter().filter(|(of, _)| *of == group);
            for (_, rows) in own().filter(|(_, rows)| !rows.is_empty()) {
                let first = test.rows.len();
                test.rows.features.extend(&rows.features);
                test.rows.labels.extend(&rows.labels);
                test.rows.corpora.extend(&rows.corpora);
                test.scenes.push(first..test.rows.len());
            }
            test.of_group.push(first_scene..test.scenes.len());
            test.groups.push(TestGroup {
                held_out: name.clone(),
                scenes: (test.scenes.len() - first_scene) as u64,
                cells: (test.rows.len() - first_row) as u64,
                left_out: own().filter(|(_, rows)| rows.is_empty()).count() as u64,
                judges: judges(name) && holds_both_classes(&test.rows.labels[first_row..]),
            });
        }
        test.made = made;
        test
    }

    pub(super) fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Of each group that judges: its scenes.
    pub(super) fn judging(&self) -> Vec<Range<usize>> {
        let groups = self.groups_with_scenes().filter(|(group, _)| group.judges);
        groups.map(|(_, scenes)| scenes.clone()).collect()
    }

    /// The own kinds' scenes.
    pub(super) fn own(&self) -> &Range<usize> {
        &self.of_group[0]
    }

    /// Groups with their scenes.
    pub(super) fn groups_with_scenes(&self) -> impl Iterator<Item = (&TestGroup, &Range<usize>)> {
        self.groups.iter().zip(&self.of_group)
    }

    /// Outputs for the rows, in their order -> what is right and wrong in each scene.
    pub(super) fn verdicts(&self, outputs: &[f64]) -> Verdicts {
        let scene = |rows: &Range<usize>| {
            let mut counts = Confusion::default();
            for row in rows.clone() {
                counts.add(self.rows.labels[row].is_untraversable(), outputs[row] >= THRESHOLD, 1);
            }
            counts
        };
        let cell = |row: usize| (self.rows.labels[row].is_untraversable(), outputs[row]);
        let missed = |scenes: Range<usize>| WrongByThreshold::of(&self.scenes[scenes], cell);
        Verdicts {
            scenes: self.scenes.iter().map(scene).collect(),
            missed: self.judging().into_iter().map(missed).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(labels: &[i8]) -> Rows {
        let mut rows = Rows::new(0);
        rows.labels.extend(labels.iter().map(|&number| Label::of_number(number).expect("0 or 1")));
        rows.corpora.extend(labels.iter().map(|_| 0));
        rows
    }

    #[test]
    fn exact_scenes_without_cells_are_left_out_and_held_out_families_judge() {
        let names = [None, Some("unseen".to_owned())];
        let made = vec![(0, rows(&[0, 1])), (0, rows(&[])), (1, rows(&[1, 0, 0])), (1, rows(&[1]))];
        let test = TestScenes::new(&names, 0, made);
        let facts = |test: &TestScenes| -> Vec<_> {
            test.groups.iter().map(|group| (group.scenes, group.cells, group.left_out, group.judges)).collect()
        };
        assert_eq!(facts(&test), [(1, 2, 1, false), (2, 4, 0, true)]);
        // A family all of whose cells are of one class has no balanced accuracy.
        let one_class = vec![(0, rows(&[0, 1])), (1, rows(&[0, 0])), (1, rows(&[]))];
        let one_class = TestScenes::new(&names, 0, one_class);
        assert_eq!(facts(&one_class), [(1, 2, 0, false), (1, 2, 1, false)]);
        assert!(one_class.judging().is_empty());
        assert_eq!(test.judging().iter().map(|scenes| (scenes.start, scenes.end)).collect::<Vec<_>>(), [(1, 3)]);
        let verdicts = test.verdicts(&[0.1, 0.9, 0.4, 0.3, 0.6, 0.7]);
        let counts = |scene: usize| {
            let c = verdicts.scenes[scene];
            (c.true_traversable, c.false_untraversable, c.missed_untraversable, c.true_untraversable)
        };
        assert_eq!((counts(0), counts(1), counts(2)), ((1, 0, 0, 1), (1, 1, 1, 0), (0, 0, 0, 1)));
        // Of 0.4 and 0.7 untraversable, 0.3 and 0.6 traversable: no false call from above 0.6 on, and 0.4 is missed there; none where all are called.
        assert_eq!(
            verdicts.missed.iter().map(|of| (of.missed(&[1, 1]).unwrap() - 0.49).abs() < 1e-12).collect::<Vec<_>>(),
            [true]
        );
    }
}
