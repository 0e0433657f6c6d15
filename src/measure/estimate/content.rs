//! Sampled scenes -> what a family's corpus will hold, and what makes it weak for its own sensor and rover, with the key to turn.
//!
//! Counts of the scenes that the estimate ran anyhow; nothing is run for them. Each finding names the families that it is true of with
//! their figures, the limit that it broke and the key that mends it. The limits are coarse on purpose: they tell what makes a corpus
//! useless or dear, not what could be a little better. Ranges in metres, shares in percent where they are told.

use crate::cells::Label;
use crate::corpus::Split;
use crate::episode::SceneOutput;
use crate::plan::Plan;

/// Cells with fewer points have next to no shape: the feature of most worth, the height difference, needs a pair at two heights.
const FEW_POINTS: i32 = 3;
/// Share of cells with few points from which a corpus is called sparse.
const SPARSE_SHARE: f64 = 1.0 / 3.0;
/// Range bins, one a metre; the last holds all that is farther.
const RANGE_BINS: usize = 64;
/// Untraversable cells: fewer than this share teach little of what stops a rover, more than the other little of what does not.
const LEAST_UNTRAVERSABLE: f64 = 0.01;
const MOST_UNTRAVERSABLE: f64 = 0.6;
/// Share of returns that no cell reads.
const UNREAD_SHARE: f64 = 0.25;
/// Share of drives that end before their length or goal.
const CUT_SHARE: f64 = 1.0 / 3.0;
/// Test scenes of a held-out family below which its figure is mostly luck: the standard deviation between scenes is some 5 points, and
/// 20 scenes bring the standard error to about 1.
const LEAST_TEST_SCENES: u64 = 20;
/// Test scenes that are looked through for those of a family.
const MOST_COUNTED: usize = 100_000;
/// Share of a held-out family's cells at ranges that no training family has.
const BEYOND_TRAINING_SHARE: f64 = 0.05;

/// What the sampled scenes of one family hold.
#[derive(Clone, Debug, Default)]
pub(crate) struct Content {
    pub scenes: u64,
    pub failed: u64,
    /// Why the first of the failed ones did.
    pub first_failure: Option<String>,
    pub cut_short: u64,
    pub returns: u64,
    /// Returns beyond `cells.max_range_m`.
    pub returns_unread: u64,
    /// Cells with a label, of them untraversable ones.
    pub labelled: u64,
    pub untraversable: u64,
    /// Cells by range, of them those with fewer than `FEW_POINTS`.
    cells_at: Vec<u64>,
    sparse_at: Vec<u64>,
}

impl Content {
    pub(super) fn add(&mut self, output: &SceneOutput) {
        self.cells_at.resize(RANGE_BINS, 0);
        self.sparse_at.resize(RANGE_BINS, 0);
        self.scenes += 1;
        if let Some(error) = &output.error {
            self.failed += 1;
            self.first_failure.get_or_insert_with(|| error.clone());
            return;
        }
        self.cut_short += u64::from(output.counts.cut_short);
        for cells in output.scans.iter().map(|scan| &scan.cells) {
            self.returns += cells.points_in;
            self.returns_unread += cells.dropped_beyond_range;
            for row in &cells.rows {
                let bin = (row.range_m as usize).min(RANGE_BINS - 1);
                self.cells_at[bin] += 1;
                self.sparse_at[bin] += u64::from(row.points < FEW_POINTS);
                self.labelled += u64::from(row.label.is_some());
                self.untraversable += u64::from(row.label == Some(Label::Untraversable));
            }
        }
    }

    fn cells(&self) -> u64 {
        self.cells_at.iter().sum()
    }

    /// Share of the cells with 1 or 2 points.
    fn sparse_share(&self) -> f64 {
        share(self.sparse_at.iter().sum(), self.cells())
    }

    /// The whole metres of range up to which fewer than `SPARSE_SHARE` of the cells are sparse; 0 where they are from the first on.
    fn dense_range_m(&self) -> usize {
        let (mut cells, mut sparse, mut dense_m) = (0, 0, 0);
        for (k, (at, few)) in self.cells_at.iter().zip(&self.sparse_at).enumerate() {
            (cells, sparse) = (cells + at, sparse + few);
            if cells > 0 && share(sparse, cells) < SPARSE_SHARE {
                dense_m = k + 1;
            }
        }
        dense_m
    }

    /// The range, to the metre, that all but one in a thousand of the cells keep.
    fn reach_m(&self) -> usize {
        let (cells, mut within) = (self.cells(), 0);
        let is_reached = |at: &u64| {
            within += at;
            within * 1000 >= cells * 999
        };
        self.cells_at.iter().position(is_reached).map_or(0, |bin| bin + 1)
    }

    fn share_beyond(&self, range_m: usize) -> f64 {
        share(self.cells_at.iter().skip(range_m).sum(), self.cells())
    }
}

fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// A finding and its cure.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Advice {
    /// What is found, with the families that it is true of.
    pub finding: String,
    /// The key to turn.
    pub cure: String,
}

/// What makes the corpus of a plan weak; `contents` by family.
pub(crate) fn advise(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let advisers = [no_scene, cut_short, balance, sparse, unread, held_out_scenes, held_out_ranges];
    advisers.into_iter().flat_map(|adviser| adviser(plan, contents)).collect()
}

/// The families for which there is something to say: "a 41 %, b 55 %"; of a plan of one family just what there is to say.
fn named(plan: &Plan, contents: &[Content], say: impl Fn(&Content) -> Option<String>) -> Option<String> {
    let families = plan.families.iter().zip(contents).filter(|(_, content)| content.scenes > content.failed);
    let is_only = plan.families.len() == 1;
    let with_name = |name: &str, said: String| if is_only { said } else { format!("{name} {said}") };
    let said: Vec<String> =
        families.filter_map(|(family, content)| Some(with_name(&family.name, say(content)?))).collect();
    (!said.is_empty()).then(|| said.join(", "))
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn no_scene(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let failing = plan.families.iter().zip(contents).filter(|(_, content)| content.failed > 0);
    let advice = failing.map(|(family, content)| Advice {
        finding: format!("{} of {} sampled scenes of {} fail", content.failed, content.scenes, family.name),
        cure: format!("the first: {}", content.first_failure.as_deref().unwrap_or("no reason was given")),
    });
    advice.collect()
}

fn cut_short(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let said = named(plan, contents, |content| {
        let cut = share(content.cut_short, content.scenes - content.failed);
        (cut > CUT_SHARE).then(|| percent(cut))
    });
    Vec::from_iter(said.map(|said| Advice {
        finding: format!("drives that end before their length or goal, so that scans repeat one view: {said}"),
        cure: "shorten drive.path's length_m, raise drive.start.near_obstacle_m, or take path: random_walk, which turns away".into(),
    }))
}

fn balance(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let of = |content: &Content| (content.labelled > 0).then(|| share(content.untraversable, content.labelled));
    let none = named(plan, contents, |content| (of(content)? == 0.0).then(|| format!("none of {}", content.labelled)));
    let few = named(plan, contents, |content| {
        let held = of(content).filter(|&held| held > 0.0 && held < LEAST_UNTRAVERSABLE)?;
        Some(format!("{:.2} %", 100.0 * held))
    });
    let many = named(plan, contents, |content| Some(percent(of(content).filter(|&held| held > MOST_UNTRAVERSABLE)?)));
    let more =
        "raise scene.rocks.count or diameter_m, start nearer (drive.start.near_obstacle_m), or lower cells.max_range_m";
    let advice = [
        none.map(|said| (format!("no untraversable cell: {said}"), more)),
        few.map(|said| (format!("hardly an untraversable cell: {said}"), more)),
        many.map(|said| {
            (
                format!("untraversable cells in excess: {said}"),
                "lower scene.rocks.count, or look at cells.labels: the rule may call too much an obstacle",
            )
        }),
    ];
    advice.into_iter().flatten().map(|(finding, cure)| Advice { finding, cure: cure.into() }).collect()
}

fn sparse(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let said = named(plan, contents, |content| {
        let sparse = content.sparse_share();
        let within = match content.dense_range_m() {
            0 => "at every range".into(),
            dense_m => format!("under a third up to {dense_m} m"),
        };
        (sparse > SPARSE_SHARE).then(|| format!("{} ({within})", percent(sparse)))
    });
    Vec::from_iter(said.map(|said| Advice {
        finding: format!("cells with 1 or 2 points: {said}"),
        cure: "lower cells.max_range_m, raise cells.size_m, or read several sweeps (cells.window_scans)".into(),
    }))
}

fn unread(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let said = named(plan, contents, |content| {
        let unread = share(content.returns_unread, content.returns);
        (unread > UNREAD_SHARE).then(|| percent(unread))
    });
    Vec::from_iter(said.map(|said| Advice {
        finding: format!("returns beyond cells.max_range_m, cast and not read: {said}"),
        cure: "raise cells.max_range_m, or aim lower (sweep.mount.pitch_deg)".into(),
    }))
}

fn held_out_scenes(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let per_shard = u64::from(plan.scenes_per_shard);
    let in_test = |index: usize| {
        let tests = (0..plan.shards()).filter(|&shard| Split::of_shard(shard) == Split::Test);
        let scenes = tests.flat_map(|shard| shard * per_shard..(shard + 1) * per_shard);
        let of_family = scenes.take(MOST_COUNTED).filter(|&scene| plan.family_index_of(scene) == index);
        of_family.take(LEAST_TEST_SCENES as usize).count() as u64
    };
    let held_out = plan.families.iter().enumerate().filter(|(k, family)| family.hold_out && *k < contents.len());
    let few = held_out.map(|(k, family)| (family, in_test(k))).filter(|(_, scenes)| *scenes < LEAST_TEST_SCENES);
    let advice = few.map(|(family, scenes)| Advice {
        finding: format!("{scenes} test scenes of the held-out family {}: too few to tell 1 point", family.name),
        cure: format!("raise scenes, or the family's weight, until there are {LEAST_TEST_SCENES}"),
    });
    advice.collect()
}

fn held_out_ranges(plan: &Plan, contents: &[Content]) -> Vec<Advice> {
    let families = || plan.families.iter().zip(contents).filter(|(_, content)| content.cells() > 0);
    let trained = families().filter(|(family, _)| !family.hold_out).map(|(_, content)| content.reach_m()).max();
    let Some(trained_m) = trained.filter(|_| families().any(|(family, _)| family.hold_out)) else { return Vec::new() };
    let beyond = families()
        .filter(|(family, content)| family.hold_out && content.share_beyond(trained_m) > BEYOND_TRAINING_SHARE);
    let advice = beyond.map(|(family, content)| Advice {
        finding: format!(
            "{} of the cells of the held-out family {} lie beyond {trained_m} m, where no training family has any",
            percent(content.share_beyond(trained_m)),
            family.name
        ),
        cure: "raise cells.max_range_m of a training family, or give one a sensor that sees as far".into(),
    });
    advice.collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::cells::{CellRow, CellTruth, Cells};
    use crate::episode::{ScanOutput, SceneCounts};
    use crate::geometry::CellIndex;

    fn plan(config: &str, sets: &[&str]) -> Plan {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(config);
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        crate::config::load(&file, &sets).unwrap()
    }

    /// A scene of one scan: (cells, points of each, range, label); a tenth of the returns is beyond what cells read.
    fn scene(of: &[(usize, i32, f32, Label)]) -> SceneOutput {
        let index = CellIndex { row: 0, col: 0 };
        let row = |&(cells, points, range_m, label): &(usize, i32, f32, Label)| {
            let truth = CellTruth::default();
            vec![CellRow { index, label: Some(label), points, range_m, neighbour_mask: 0, truth }; cells]
        };
        let cells = Cells {
            rows: of.iter().flat_map(row).collect(),
            points_in: 1000,
            dropped_beyond_range: 100,
            ..Cells::default()
        };
        SceneOutput { scans: vec![ScanOutput { scan_id: 0, cells, points: None }], ..SceneOutput::default() }
    }

    fn content(scenes: &[SceneOutput]) -> Content {
        let mut content = Content::default();
        scenes.iter().for_each(|scene| content.add(scene));
        content
    }

    fn findings(plan: &Plan, contents: &[Content]) -> Vec<String> {
        advise(plan, contents).into_iter().map(|advice| format!("{}; {}", advice.finding, advice.cure)).collect()
    }

    const SOUND: [(usize, i32, f32, Label); 2] = [(90, 5, 2.5, Label::Traversable), (10, 5, 2.5, Label::Untraversable)];

    #[test]
    fn exact_a_sound_corpus_gets_no_advice() {
        assert_eq!(findings(&plan("configs/quickstart.yaml", &[]), &[content(&[scene(&SOUND)])]), Vec::<String>::new());
    }

    #[test]
    fn exact_each_weakness_is_told_by_its_limit_from_both_sides() {
        let plan = plan("configs/quickstart.yaml", &[]);
        let told = |scenes: &[SceneOutput], words: &str| {
            findings(&plan, &[content(scenes)]).iter().any(|finding| finding.contains(words))
        };
        let cells = |traversable, untraversable| {
            scene(&[(traversable, 5, 2.5, Label::Traversable), (untraversable, 5, 2.5, Label::Untraversable)])
        };
        assert!(told(&[cells(50, 0)], "no untraversable cell: none of 50"));
        assert!(told(&[cells(999, 1)], "hardly an untraversable cell: 0.10 %"));
        assert!(!told(&[cells(99, 1)], "untraversable cell"));
        assert!(told(&[cells(39, 61)], "in excess: 61 %") && !told(&[cells(40, 60)], "in excess"));

        let sparse = |near, far| {
            scene(&[
                (near, 3, 1.5, Label::Traversable),
                (far, 2, 7.5, Label::Traversable),
                (9, 3, 1.5, Label::Untraversable),
            ])
        };
        assert!(told(&[sparse(41, 26)], "1 or 2 points: 34 % (under a third up to 7 m)"));
        assert!(!told(&[sparse(41, 25)], "1 or 2 points"));

        let cut = |cut_short| {
            let counts = SceneCounts { cut_short, ..SceneCounts::default() };
            SceneOutput { counts, ..scene(&SOUND) }
        };
        assert!(told(&[cut(true), cut(false)], "end before their length or goal"));
        assert!(!told(&[cut(true), cut(false), cut(false)], "end before their length or goal"));

        let unread = |beyond| {
            let mut scene = scene(&SOUND);
            scene.scans[0].cells.dropped_beyond_range = beyond;
            scene
        };
        assert!(told(&[unread(251)], "not read: 25 %") && !told(&[unread(250)], "not read"));

        let failed = SceneOutput { error: Some("no place to start".into()), ..SceneOutput::default() };
        assert!(told(&[failed, scene(&SOUND)], "1 of 2 sampled scenes of default fail; the first: no place to start"));
    }

    #[test]
    fn exact_a_held_out_family_needs_scenes_in_the_test_split_and_ranges_that_training_has() {
        let contents = |plan: &Plan, held_out_range_m: f32| -> Vec<Content> {
            let of = |hold_out| match hold_out {
                true => scene(&[(90, 5, held_out_range_m, Label::Traversable), (10, 5, 2.5, Label::Untraversable)]),
                false => scene(&SOUND),
            };
            plan.families.iter().map(|family| content(&[of(family.hold_out)])).collect()
        };
        let whole = plan("configs/mixed.yaml", &[]);
        assert_eq!(findings(&whole, &contents(&whole, 2.5)), Vec::<String>::new());
        let held_out: Vec<&str> = whole.families.iter().filter(|f| f.hold_out).map(|f| f.name.as_str()).collect();
        let of_each = |findings: &[String], words: &dyn Fn(&str) -> String| {
            assert_eq!(findings.len(), held_out.len(), "{findings:?}");
            findings.iter().zip(&held_out).all(|(finding, family)| finding.contains(&words(family)))
        };
        let far = findings(&whole, &contents(&whole, 6.5));
        let beyond = |family: &str| format!("90 % of the cells of the held-out family {family} lie beyond 3 m");
        assert!(of_each(&far, &beyond), "{far:?}");
        let cut = plan("configs/mixed.yaml", &["scenes=100", "scenes_per_shard=10"]);
        let few = findings(&cut, &contents(&cut, 2.5));
        assert!(of_each(&few, &|family| format!("test scenes of the held-out family {family}: too few")), "{few:?}");
    }
}
