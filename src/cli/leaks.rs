//! Corpora to learn from -> refused, or told, where a scene of one is in another split of the other.

use super::Failure;
use crate::corpus::{Split, Yards};
use crate::train::leaks::{self, Leak};
use crate::train::{About, Model};

/// What is known of a corpus that is to be learnt from.
pub(super) struct Learnt {
    /// As it was typed.
    pub(super) place: String,
    pub(super) yards: Yards,
    /// Of what makes its rows.
    pub(super) rows_hash: String,
}

/// Refuses leaks between the corpora, and from what the network to start from learnt; where they are allowed, they are told, and
/// returned for the run's own record.
pub(super) fn check(corpora: &[Learnt], init: Option<&Model>, allow: bool) -> Result<Vec<String>, Failure> {
    let mut learnt_before = init.map(|model| &model.about).map(About::learnt_from).unwrap_or_default();
    learnt_before.iter_mut().for_each(|corpus| corpus.name += ", which the network of --init learnt from");
    let mut found: Vec<Leak> = Vec::new();
    for (number, corpus) in corpora.iter().enumerate() {
        let here = (corpus.place.as_str(), &corpus.yards);
        for other in &corpora[..number] {
            let there = (other.place.as_str(), &other.yards);
            found.extend(leaks::between(there, here, corpus.rows_hash == other.rows_hash));
        }
        let judged = [Split::Test, Split::Validation];
        found.extend(judged.iter().flat_map(|&split| leaks::of_judging(here, split, &learnt_before)));
    }
    let found: Vec<String> = found.iter().map(Leak::to_string).collect();
    if allow {
        found.iter().for_each(|leak| tracing::warn!("{leak}"));
        return Ok(found);
    }
    if found.is_empty() {
        return Ok(found);
    }
    Err(Failure::usage(miette::miette!(
        help = "give each corpus a seed of its own (--set seed=N), or cut them into shards alike (the same scenes_per_shard), or learn \
                from one of them; --allow-shared-scenes goes on, and training.json says so",
        "a scene is in one split, and is learnt from once: {}",
        found.join("; ")
    )))
}
