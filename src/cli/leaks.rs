//! Corpora to learn from -> refused, or told, where a scene of one is in another split of the other.

use std::collections::BTreeMap;

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
    /// Shards that are learnt from, by the hash of what is in their rows: plans may differ in what leaves rows as they are.
    pub(super) shards: BTreeMap<String, u64>,
}

/// Says of two corpora that they train on the same rows, where shards of both hold the same.
fn same_rows(here: &Learnt, there: &Learnt) -> Option<String> {
    let same = || here.shards.iter().filter(|(values, _)| there.shards.contains_key(*values)).map(|(_, shard)| *shard);
    let first = same().min()?;
    let (count, here, there) = (same().count(), &here.place, &there.place);
    let shards = if count == 1 { "shard" } else { "shards" };
    Some(format!(
        "{count} {shards} of the train split of {here} (the first is shard {first}) have the same rows in {there}"
    ))
}

/// Refuses leaks between the corpora, and from what the network to start from learnt; where they are allowed, they are told, and
/// returned for the run's own record.
pub(super) fn check(corpora: &[Learnt], init: Option<&Model>, allow: bool) -> Result<Vec<String>, Failure> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_shards_with_the_same_rows_are_learnt_once_whatever_their_plans_say() {
        let learnt = |place: &str, rows_hash: &str, values: &[&str]| Learnt {
            place: place.into(),
            yards: Yards::default(),
            rows_hash: rows_hash.into(),
            shards: (0..).zip(values).map(|(shard, values)| (values.to_string(), shard)).collect(),
        };
        let all = [learnt("a", "1", &["x", "y", "z"]), learnt("b", "2", &["w", "z", "y"])];
        let said = check(&all, None, false).unwrap_err().report.to_string();
        assert!(
            said.contains("2 shards of the train split of a (the first is shard 1) have the same rows in b"),
            "{said}"
        );
        assert_eq!(check(&all, None, true).unwrap().len(), 1);
        assert!(check(&[learnt("a", "1", &["x"]), learnt("b", "1", &["w"])], None, false).unwrap().is_empty());
    }
}
