//! What a corpus holds, by family -> what makes it weak for its own sensor and rover, with the key to turn.
//!
//! `plan` asks of the scenes that its estimate ran anyhow, `inspect` of the tables of a corpus that is there. Each finding names the families
//! that it is true of with their figures, the limit that it broke and the key that mends it. The limits are coarse on purpose: they tell what
//! makes a corpus useless or dear, not what could be a little better. Ranges in metres, shares in percent where they are told.

mod content;
#[cfg(test)]
mod tests;
mod views;

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;

pub(crate) use content::Content;
pub(crate) use views::{CellGrid, View, Views};

/// Cells with fewer points have next to no shape: the feature of most worth, the height difference, needs a pair at two heights.
const FEW_POINTS: i32 = 3;
/// Share of cells with few points from which a corpus is called sparse.
const SPARSE_SHARE: f64 = 1.0 / 3.0;
/// Untraversable cells: fewer than this share teach little of what stops a rover, more than the other little of what does not.
const LEAST_UNTRAVERSABLE: f64 = 0.01;
const MOST_UNTRAVERSABLE: f64 = 0.6;
/// Share of returns that no cell reads.
const UNREAD_SHARE: f64 = 0.25;
/// Share of drives that end before their length or goal; of fewer drives than this it is chance.
const CUT_SHARE: f64 = 1.0 / 3.0;
const LEAST_DRIVES: u64 = 5;
/// Test scenes of a held-out family below which its figure is mostly luck: the standard deviation between scenes is some 5 points, and
/// 20 scenes bring the standard error to about 1.
pub(crate) const LEAST_TEST_SCENES: u64 = 20;
/// Share of a held-out family's cells at ranges that no training family has.
const BEYOND_TRAINING_SHARE: f64 = 0.05;

/// Share of the scans whose nearest obstacle stands in one sector of 30 degrees, from which on they are one view again and again; of
/// fewer scans than this it is chance.
const ONE_VIEW_SHARE: f64 = 0.5;
const LEAST_SCANS: u64 = 20;

fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// A finding and its cure.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub(crate) struct Advice {
    /// What is found, with the families that it is true of.
    pub finding: String,
    /// The key to turn.
    pub cure: String,
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "advice: {}\n        {}", self.finding, self.cure)
    }
}

/// What makes a corpus weak; `contents` by family.
pub(crate) fn advise(contents: &[Content]) -> Vec<Advice> {
    let advisers = [no_scene, no_cell, cut_short, one_view, balance, sparse, unread, held_out_scenes, held_out_ranges];
    advisers.into_iter().flat_map(|adviser| adviser(contents)).collect()
}

/// The families for which there is something to say: "a 41 %, b 55 %"; where there is one family, just what there is to say.
fn named(contents: &[Content], say: impl Fn(&Content) -> Option<String>) -> Option<String> {
    let families = contents.iter().filter(|content| content.scenes > content.failed);
    let is_only = contents.len() == 1;
    let with_name = |name: &str, said: String| if is_only { said } else { format!("{name} {said}") };
    let said: Vec<String> = families.filter_map(|content| Some(with_name(&content.family, say(content)?))).collect();
    (!said.is_empty()).then(|| said.join(", "))
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn no_scene(contents: &[Content]) -> Vec<Advice> {
    let failing = contents.iter().filter(|content| content.failed > 0);
    let advice = failing.map(|content| Advice {
        finding: format!(
            "{} of {} scenes of {} that were looked at fail",
            content.failed, content.scenes, content.family
        ),
        cure: format!("the first: {}", content.first_failure.as_deref().unwrap_or("no reason was given")),
    });
    advice.collect()
}

fn no_cell(contents: &[Content]) -> Vec<Advice> {
    let said =
        named(contents, |content| (content.cells() == 0).then(|| format!("none in all {} scenes", content.driven())));
    Vec::from_iter(said.map(|said| Advice {
        finding: format!("scenes without any cell, of which nothing can be learnt: {said}"),
        cure: "raise cells.max_range_m beyond where the lowest beams meet the ground, or aim lower (sweep.mount.pitch_deg)".into(),
    }))
}

fn cut_short(contents: &[Content]) -> Vec<Advice> {
    let said = named(contents, |content| {
        let driven = content.driven();
        let cut = share(content.cut_short, driven);
        (cut > CUT_SHARE && driven >= LEAST_DRIVES).then(|| format!("{} of {driven}", percent(cut)))
    });
    Vec::from_iter(said.map(|said| Advice {
        finding: format!("drives that end before their length or goal, so that scans repeat one view: {said}"),
        cure: "shorten drive.path's length_m, raise drive.start.near_obstacle_m, or take path: random_walk, which turns away".into(),
    }))
}

/// How many drives were cut short; of which families, where there are several: "4 of 34 (a 3 of 10, b 1 of 5)".
pub(crate) fn cut_short_of(contents: &[Content]) -> String {
    let (cut_short, driven) =
        contents.iter().fold((0, 0), |sum, content| (sum.0 + content.cut_short, sum.1 + content.driven()));
    let families = named(contents, |content| {
        (content.cut_short > 0).then(|| format!("{} of {}", content.cut_short, content.driven()))
    });
    let by_family =
        families.filter(|_| contents.len() > 1).map_or_else(String::new, |families| format!(" ({families})"));
    format!("{cut_short} of {driven}{by_family}")
}

fn one_view(contents: &[Content]) -> Vec<Advice> {
    let said = named(contents, |content| {
        let (share, middle_deg) = content.views.commonest_bearing(LEAST_SCANS)?;
        let where_it_is =
            if middle_deg == 0.0 { "straight ahead".into() } else { format!("at {middle_deg:.0} degrees") };
        (share > ONE_VIEW_SHARE).then(|| format!("{} {where_it_is}", percent(share)))
    });
    Vec::from_iter(said.map(|said| Advice {
        finding: format!("scans whose nearest obstacle stands in the same sector of 30 degrees: {said}"),
        cure: "take drive.path: straight (a random heading), random_walk or planned in place of toward_obstacle, or keep sweeps of the way (drive.keep)"
            .into(),
    }))
}

fn balance(contents: &[Content]) -> Vec<Advice> {
    let of = |content: &Content| (content.labelled > 0).then(|| share(content.untraversable, content.labelled));
    let none = named(contents, |content| (of(content)? == 0.0).then(|| format!("none of {}", content.labelled)));
    let few = named(contents, |content| {
        let held = of(content).filter(|&held| held > 0.0 && held < LEAST_UNTRAVERSABLE)?;
        Some(format!("{:.2} %", 100.0 * held))
    });
    let many = named(contents, |content| Some(percent(of(content).filter(|&held| held > MOST_UNTRAVERSABLE)?)));
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

fn sparse(contents: &[Content]) -> Vec<Advice> {
    let said = named(contents, |content| {
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

fn unread(contents: &[Content]) -> Vec<Advice> {
    let said = named(contents, |content| {
        let unread = share(content.returns_unread, content.returns);
        (unread > UNREAD_SHARE).then(|| percent(unread))
    });
    Vec::from_iter(said.map(|said| Advice {
        finding: format!("returns beyond cells.max_range_m, cast and not read: {said}"),
        cure: "raise cells.max_range_m, or aim lower (sweep.mount.pitch_deg)".into(),
    }))
}

fn held_out_scenes(contents: &[Content]) -> Vec<Advice> {
    let few = contents.iter().filter(|content| content.is_held_out && content.test_scenes < LEAST_TEST_SCENES);
    let said: Vec<String> = few.map(|content| format!("{} {}", content.family, content.test_scenes)).collect();
    let advice = (!said.is_empty()).then(|| Advice {
        finding: format!("held-out families with too few test scenes to tell 1 point: {}", said.join(", ")),
        cure: format!("raise scenes, or the families' weights, until each has {LEAST_TEST_SCENES}"),
    });
    Vec::from_iter(advice)
}

fn held_out_ranges(contents: &[Content]) -> Vec<Advice> {
    let (held_out, trained): (Vec<&Content>, Vec<&Content>) =
        contents.iter().filter(|content| content.cells() > 0).partition(|content| content.is_held_out);
    let Some(trained_m) = trained.into_iter().map(Content::reach_m).max() else { return Vec::new() };
    let beyond = held_out.into_iter().filter(|content| content.share_beyond(trained_m) > BEYOND_TRAINING_SHARE);
    let said: Vec<String> =
        beyond.map(|content| format!("{} {}", content.family, percent(content.share_beyond(trained_m)))).collect();
    let advice = (!said.is_empty()).then(|| Advice {
        finding: format!(
            "cells of held-out families beyond {trained_m} m, where no training family has any: {}",
            said.join(", ")
        ),
        cure: "raise cells.max_range_m of a training family, or give one a sensor that sees as far".into(),
    });
    Vec::from_iter(advice)
}
