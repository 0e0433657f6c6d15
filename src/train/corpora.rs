//! Finished corpora, each with its plan -> what one training learns from: sources on one grid, no scene of one in another split of the
//! other, and what the first plan says of rover, sensor and cells.
//!
//! Within a corpus no scene is in two splits; between corpora, and against what the network to start from learnt, [`leaks`] says which
//! are. Not here: how places are opened, and how plans are read.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::leaks::{self, Leak};
use super::run::Origin;
use super::{About, Model, Source, Sources, TrainError, TrainParams};
use crate::corpus::{Split, Yards};
use crate::plan::{Family, Plan, unlike_labels};

/// A finished corpus to learn from.
pub(crate) struct CorpusToLearn {
    /// As its user calls it.
    pub place: String,
    pub source: Source,
    pub plan: Plan,
}

/// What a training learns from.
pub(crate) struct Joined {
    pub sources: Arc<Sources>,
    /// Of the first corpus.
    pub origin: Origin,
    /// That families label by unlike rules, and what to do about it; `None` where they do not, or `params` have a rule of their own.
    pub unlike_labels: Option<[String; 2]>,
}

/// Corpora, at least one, as one training's; scenes in two splits are refused, or with `allow_shared` kept in [`Sources::shared_scenes`].
pub(crate) fn join(
    corpora: Vec<CorpusToLearn>,
    params: &TrainParams,
    init: Option<&Model>,
    allow_shared: bool,
) -> Result<Joined, TrainError> {
    let (mut list, mut origins, mut scenes) = (Vec::new(), Vec::new(), Vec::new());
    let (mut frames, mut overhangs_m, mut families) = (BTreeSet::new(), Vec::new(), Vec::new());
    for CorpusToLearn { place, mut source, plan } in corpora {
        if !source.yards.known() {
            source.yards.yards = plan.yards();
        }
        let shards = source.shards_by_values(Split::Train);
        let (yards, rows_hash) = (source.yards.clone(), plan.rows_hash());
        scenes.push(Scenes { place: place.clone(), yards, rows_hash, shards });
        frames.extend(plan.families.iter().map(|family| family.cells.frame));
        overhangs_m.extend(plan.families.iter().map(|family| family.cells.above_m()));
        origins.push((place, Origin::of(&plan.families[0])));
        families.extend(plan.families);
        list.push(source);
    }
    if let Some((first, others)) = origins.split_first() {
        others.iter().try_for_each(|other| check_grids(first, other))?;
    }
    let mut sources = Sources::new(list, &params.features, params.labels.clone())?;
    sources.shared_scenes = shared_scenes(&scenes, init);
    if !allow_shared && !sources.shared_scenes.is_empty() {
        return Err(TrainError::SharedScenes { leaks: sources.shared_scenes.join("; ") });
    }
    let (_, mut origin) = origins.swap_remove(0);
    let learnt = families.iter().filter(|family| family.is_learnt());
    let farthest_m = learnt.map(reach_m).max_by(f64::total_cmp);
    origin.reach_m = farthest_m.filter(|&reach| reach != reach_m(&families[0]));
    if frames.len() > 1 {
        origin.frames = frames.into_iter().collect();
    }
    overhangs_m.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    overhangs_m.dedup();
    if overhangs_m.len() > 1 {
        origin.overhangs_m = overhangs_m;
    }
    let unlike_labels = unlike_labels(families.iter()).filter(|_| params.labels.is_none());
    Ok(Joined { sources: Arc::new(sources), origin, unlike_labels })
}

/// How far a family's cells reach, metres.
fn reach_m(family: &Family) -> f64 {
    let sensor_m = family.sweep.sensor.max_range_m;
    family.cells.max_range_m.map_or(sensor_m, |most_m| most_m.min(sensor_m))
}

/// Features mean the same on the same grid only.
fn check_grids((first, ours): &(String, Origin), (other, theirs): &(String, Origin)) -> Result<(), TrainError> {
    let differ = |key: &str, ours: String, theirs: String| {
        if ours == theirs {
            return Ok(());
        }
        let what = format!("cells.{key} is {theirs} there, and {ours} in the other");
        Err(TrainError::Unlike { place: other.clone(), other: first.clone(), what })
    };
    differ("size_m", ours.cells.size_m.to_string(), theirs.cells.size_m.to_string())?;
    differ("neighbours", ours.cells.neighbours.to_string(), theirs.cells.neighbours.to_string())?;
    // One that lacks the column is told apart by its features, where they ask for it.
    if let (Some(ours), Some(theirs)) = (&ours.cells.local_height, &theirs.cells.local_height) {
        differ("local_height", ours.words(), theirs.words())?;
    }
    match (&ours.cells.unseen, &theirs.cells.unseen) {
        (Some(ours), Some(theirs)) => differ("unseen", ours.words(), theirs.words()),
        _ => Ok(()),
    }
}

/// The corpora that a model learnt from without saying which yards they hold, as those of before format 2.
pub(crate) fn unknown_yards(model: &Model) -> Vec<String> {
    let learnt_from = model.about.learnt_from().into_iter();
    learnt_from.filter(|corpus| !corpus.yards.known()).map(|corpus| corpus.name).collect()
}

/// What is known of the scenes of a corpus that is to be learnt from.
struct Scenes {
    place: String,
    yards: Yards,
    /// Of what makes its rows.
    rows_hash: String,
    /// Shards that are learnt from, by the hash of what is in their rows: plans may differ in what leaves rows as they are.
    shards: BTreeMap<String, u64>,
}

/// Says of two corpora that they train on the same rows, where shards of both hold the same.
fn same_rows(here: &Scenes, there: &Scenes) -> Option<String> {
    let same = || here.shards.iter().filter(|(values, _)| there.shards.contains_key(*values)).map(|(_, shard)| *shard);
    let first = same().min()?;
    let (count, here, there) = (same().count(), &here.place, &there.place);
    let shards = if count == 1 { "shard" } else { "shards" };
    Some(format!(
        "{count} {shards} of the train split of {here} (the first is shard {first}) have the same rows in {there}"
    ))
}

/// Leaks between the corpora, and from what the network to start from learnt.
fn shared_scenes(corpora: &[Scenes], init: Option<&Model>) -> Vec<String> {
    let mut learnt_before = init.map(|model| &model.about).map(About::learnt_from).unwrap_or_default();
    learnt_before.iter_mut().for_each(|corpus| corpus.name += ", which the network of --init learnt from");
    let mut found: Vec<String> = Vec::new();
    for (number, corpus) in corpora.iter().enumerate() {
        let here = (corpus.place.as_str(), &corpus.yards);
        for other in &corpora[..number] {
            let there = (other.place.as_str(), &other.yards);
            let leaks = leaks::between(there, here, corpus.rows_hash == other.rows_hash);
            let is_told = leaks.iter().any(|leak| (leak.split_here, leak.split_there) == (Split::Train, Split::Train));
            found.extend(leaks.iter().map(Leak::to_string));
            found.extend(same_rows(other, corpus).filter(|_| !is_told));
        }
        let judged = [Split::Test, Split::Validation].into_iter();
        found.extend(
            judged.flat_map(|split| leaks::of_judging(here, split, &learnt_before)).map(|leak| leak.to_string()),
        );
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_shards_with_the_same_rows_are_learnt_once_whatever_their_plans_say() {
        let scenes = |place: &str, rows_hash: &str, values: &[&str]| Scenes {
            place: place.into(),
            yards: Yards::default(),
            rows_hash: rows_hash.into(),
            shards: (0..).zip(values).map(|(shard, values)| (values.to_string(), shard)).collect(),
        };
        let found = shared_scenes(&[scenes("a", "1", &["x", "y", "z"]), scenes("b", "2", &["w", "z", "y"])], None);
        assert_eq!(found, ["2 shards of the train split of a (the first is shard 1) have the same rows in b"],);
        assert!(shared_scenes(&[scenes("a", "1", &["x"]), scenes("b", "1", &["w"])], None).is_empty());
    }
}
