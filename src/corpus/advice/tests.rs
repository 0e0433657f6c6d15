//! Each weakness from both sides of its limit.

use super::*;
use crate::cells::{CellRow, CellTruth, Cells, Label};
use crate::episode::{ScanOutput, SceneCounts, SceneOutput};
use crate::geometry::CellIndex;

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
    content_of("default", false, 0, scenes)
}

fn content_of(family: &str, is_held_out: bool, test_scenes: u64, scenes: &[SceneOutput]) -> Content {
    let mut content = Content::of(family, is_held_out, test_scenes);
    scenes.iter().for_each(|scene| content.add(scene));
    content
}

fn findings(contents: &[Content]) -> Vec<String> {
    advise(contents).into_iter().map(|advice| format!("{}; {}", advice.finding, advice.cure)).collect()
}

const SOUND: [(usize, i32, f32, Label); 2] = [(90, 5, 2.5, Label::Traversable), (10, 5, 2.5, Label::Untraversable)];

#[test]
fn exact_a_sound_corpus_gets_no_advice() {
    assert_eq!(findings(&[content(&[scene(&SOUND)])]), Vec::<String>::new());
}

#[test]
fn exact_each_weakness_is_told_by_its_limit_from_both_sides() {
    let told = |scenes: &[SceneOutput], words: &str| {
        findings(&[content(scenes)]).iter().any(|finding| finding.contains(words))
    };
    let cells = |traversable, untraversable| {
        scene(&[(traversable, 5, 2.5, Label::Traversable), (untraversable, 5, 2.5, Label::Untraversable)])
    };
    assert!(told(
        &[scene(&[]), scene(&[])],
        "scenes without any cell, of which nothing can be learnt: none in all 2 scenes"
    ));
    assert!(!told(&[scene(&[]), cells(50, 0)], "without any cell"));
    let families = [content_of("bare", false, 0, &[scene(&[])]), content_of("full", false, 0, &[cells(50, 50)])];
    assert!(findings(&families).iter().any(|finding| finding.contains("learnt: bare none in all 1 scenes;")));
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
    let cut_of = |count: usize, of: usize| -> Vec<SceneOutput> { (0..of).map(|scene| cut(scene < count)).collect() };
    assert!(told(&cut_of(2, 5), "end before their length or goal, so that scans repeat one view: 40 % of 5"));
    assert!(!told(&cut_of(2, 6), "end before their length or goal"));
    assert!(!told(&cut_of(4, 4), "end before their length or goal"), "four drives are chance");

    let unread = |beyond| {
        let mut scene = scene(&SOUND);
        scene.scans[0].cells.dropped_beyond_range = beyond;
        scene
    };
    assert!(told(&[unread(251)], "not read: 25 %") && !told(&[unread(250)], "not read"));

    let failed = SceneOutput { error: Some("no place to start".into()), ..SceneOutput::default() };
    assert!(told(
        &[failed, scene(&SOUND)],
        "1 of 2 scenes of default that were looked at fail; the first: no place to start"
    ));
}

#[test]
fn exact_drives_that_end_early_are_told_of_all_and_of_the_families_that_have_some() {
    let content = |family: &str, scenes, failed, cut_short| {
        let mut content = Content::of(family, false, 0);
        (content.scenes, content.failed, content.cut_short) = (scenes, failed, cut_short);
        content
    };
    assert_eq!(cut_short_of(&[content("default", 30, 2, 6)]), "6 of 28");
    let several = [content("orchard", 10, 0, 3), content("scrub", 20, 1, 0), content("banks", 5, 0, 1)];
    assert_eq!(cut_short_of(&several), "4 of 34 (orchard 3 of 10, banks 1 of 5)");
}

#[test]
fn exact_a_held_out_family_needs_scenes_in_the_test_split_and_ranges_that_training_has() {
    let contents = |held_out_range_m: f32, test_scenes: u64| -> Vec<Content> {
        let of = |family: &str, is_held_out: bool| {
            let range_m = if is_held_out { held_out_range_m } else { 2.5 };
            let seen = scene(&[(90, 5, range_m, Label::Traversable), (10, 5, 2.5, Label::Untraversable)]);
            content_of(family, is_held_out, test_scenes, &[seen])
        };
        vec![of("yard", false), of("unseen", true), of("unseen_too", true)]
    };
    assert_eq!(findings(&contents(2.5, 20)), Vec::<String>::new());
    // One line for all families, however many there are.
    let far = findings(&contents(6.5, 20));
    let [only] = far.as_slice() else { panic!("{far:?}") };
    assert!(only.contains("beyond 3 m, where no training family has any: unseen 90 %, unseen_too 90 %"), "{only}");
    let few = findings(&contents(2.5, 19));
    let [only] = few.as_slice() else { panic!("{few:?}") };
    assert!(only.contains("too few test scenes to tell 1 point: unseen 19, unseen_too 19; raise scenes"), "{only}");
}
