//! What a model learnt from, and a corpus -> scenes that are in two splits: judged, and learnt from.
//!
//! Within a corpus no scene is in two splits. Between corpora it is where they hold the same yards (equal seed and `scene` section,
//! [`Yards`]) in other shards, or where one of them grew out of the other.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{About, Model, Source, Sources};
use crate::corpus::yards::Common;
use crate::corpus::{Split, Yards};

/// A corpus that a model learnt from: its train split gave the weights, its validation split said when to stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntFrom {
    pub corpus_id: String,
    pub name: String,
    #[serde(flatten)]
    pub yards: Yards,
}

/// What a model learns from: its corpora, and what the network that it starts from learnt from.
pub(crate) fn learnt_from(sources: &Sources, init: Option<&Model>) -> Vec<LearntFrom> {
    let of_source = |source: &Arc<Source>| LearntFrom {
        corpus_id: source.corpus_id.clone(),
        name: source.name.clone(),
        yards: source.yards.clone(),
    };
    let mut all: Vec<LearntFrom> = sources.list.iter().map(of_source).collect();
    for corpus in init.map(|model| model.about.learnt_from()).unwrap_or_default() {
        if !all.contains(&corpus) {
            all.push(corpus);
        }
    }
    all
}

impl About {
    /// As the model says; of one from before it did, the corpora without what is known of their yards.
    pub(crate) fn learnt_from(&self) -> Vec<LearntFrom> {
        if !self.learnt_from.is_empty() {
            return self.learnt_from.clone();
        }
        let unknown = |(corpus_id, name): (&String, &String)| LearntFrom {
            corpus_id: corpus_id.clone(),
            name: name.clone(),
            yards: Yards::default(),
        };
        self.corpus_ids.iter().zip(&self.corpus_names).map(unknown).collect()
    }
}

/// Names of the corpora of which it cannot be said whether they share scenes with one that is judged.
pub(crate) fn unknown(judged: &Yards, corpus_id: &str, learnt_from: &[LearntFrom]) -> Vec<String> {
    let unknown = |corpus: &&LearntFrom| corpus.corpus_id != corpus_id && !(corpus.yards.known() && judged.known());
    learnt_from.iter().filter(unknown).map(|corpus| corpus.name.clone()).collect()
}

/// Scenes that are in one split here and in another there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Leak {
    pub here: String,
    pub split_here: Split,
    pub there: String,
    pub split_there: Split,
    pub common: Common,
}

impl fmt::Display for Leak {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Common { scenes, first } = self.common;
        let (are, s) = if scenes == 1 { ("is", "") } else { ("are", "s") };
        write!(
            f,
            "{scenes} scene{s} of the {} split of {} {are} in the {} split of {}",
            self.split_here.name(),
            self.here,
            self.split_there.name(),
            self.there
        )?;
        first.map_or(Ok(()), |first| write!(f, " (the first is scene {first})"))
    }
}

/// Why two corpora are not to be learnt from together. The train split of both may hold a yard that another rover or sensor sees
/// there, but not the same rows twice.
pub(crate) fn between(here: (&str, &Yards), there: (&str, &Yards), same_rows: bool) -> Vec<Leak> {
    let refused = |split: Split, other: Split| split != other || (same_rows && split == Split::Train);
    leaks(here, there, refused)
}

/// Scenes of a split that a model used more than it says: test scenes that it learnt from or was stopped by, validation scenes that it
/// learnt from.
pub(crate) fn of_judging(judged: (&str, &Yards), split: Split, learnt_from: &[LearntFrom]) -> Vec<Leak> {
    let use_of = |split| [Split::Test, Split::Validation, Split::Train].iter().position(|&each| each == split);
    let refused = |here: Split, there: Split| here == split && use_of(there) > use_of(here);
    learnt_from.iter().flat_map(|corpus| leaks(judged, (&corpus.name, &corpus.yards), refused)).collect()
}

fn leaks(here: (&str, &Yards), there: (&str, &Yards), refused: impl Fn(Split, Split) -> bool) -> Vec<Leak> {
    let by_split = here.1.common(there.1);
    let all = Split::ALL.iter().flat_map(|&here| Split::ALL.map(|there| (here, there)));
    all.map(|(split_here, split_there)| Leak {
        here: here.0.into(),
        split_here,
        there: there.0.into(),
        split_there,
        common: by_split[split_here as usize][split_there as usize],
    })
    .filter(|leak| leak.common.scenes > 0 && refused(leak.split_here, leak.split_there))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn yards(scenes: u64, scenes_per_shard: u32) -> Yards {
        Yards { seed: 3, yards: vec!["k".into()], scenes, scenes_per_shard }
    }

    #[test]
    fn exact_a_scene_in_two_splits_is_named_with_both() {
        let leaks = between(("a", &yards(28, 4)), ("b", &yards(28, 2)), false);
        let said: Vec<String> = leaks.iter().map(Leak::to_string).collect();
        let expected = "2 scenes of the test split of a are in the train split of b (the first is scene 24)";
        assert!(said.iter().any(|line| line == expected), "{said:?}");
    }

    #[test]
    fn law_a_grown_copy_is_learnt_twice_and_another_sensor_in_the_same_yards_is_not() {
        let (here, there) = (yards(7, 1), yards(8, 1));
        let said = between(("a", &here), ("b", &there), true);
        assert_eq!(said.len(), 1);
        assert_eq!((said[0].split_here, said[0].common.scenes), (Split::Train, 5));
        assert_eq!(between(("a", &here), ("b", &there), false), []);
    }

    #[test]
    fn law_what_is_judged_may_be_no_scene_that_was_used_more() {
        let learnt = [LearntFrom { corpus_id: "id".into(), name: "b".into(), yards: yards(28, 2) }];
        let leaks = |split| of_judging(("a", &yards(28, 4)), split, &learnt);
        let count = |split| leaks(split).iter().map(|leak| leak.common.scenes).sum::<u64>();
        // Of a's test scenes 24 to 27 b learnt 24 and 25 and tests 26 and 27; of its validation scenes 12 to 15 b tests 12 and 13.
        assert_eq!([Split::Test, Split::Validation, Split::Train].map(count), [2, 2, 0]);
        // The corpus itself, and what grew out of it.
        assert_eq!(of_judging(("b", &yards(56, 2)), Split::Test, &learnt), []);
    }
}
