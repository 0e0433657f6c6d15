//! Rows of whole scenes drawn at random.

use super::fixture::{circle, corpus, params, sources};
use crate::corpus::Split;
use crate::train::scenes::draw;

#[test]
fn exact_drawn_rows_are_those_of_whole_scenes_and_the_last_is_cut() {
    let dir = tempfile::tempdir().unwrap();
    let place = corpus(&dir, "a", &(0..21).map(|shard| circle(shard, 40)).collect::<Vec<_>>());
    let sources = sources(&[place], &params()).unwrap();
    let scene = |shard: u64| circle(shard, 40).into_iter().flat_map(|(_, row)| row).collect::<Vec<f32>>();
    let sample = draw(&sources, Split::Train, 100, 7).unwrap();
    assert_eq!((sample.rows.len(), sample.scenes, sample.scenes_there), (100, 3, 15));
    let mut found = Vec::new();
    for part in sample.rows.features.chunks(40 * 3) {
        let shards: Vec<u64> = (0..21).filter(|&shard| scene(shard)[..part.len()] == *part).collect();
        assert_eq!(shards.len(), 1);
        found.extend(shards);
    }
    found.sort_unstable();
    found.dedup();
    assert_eq!(found.len(), 3, "each scene once");
    assert!(found.iter().all(|shard| Split::of_shard(*shard) == Split::Train));
}

#[test]
fn law_a_draw_is_a_function_of_seed_and_split_and_short_draws_begin_long_ones() {
    let dir = tempfile::tempdir().unwrap();
    let place = corpus(&dir, "a", &(0..21).map(|shard| circle(shard, 40)).collect::<Vec<_>>());
    let sources = sources(&[place], &params()).unwrap();
    let features = |count, seed| draw(&sources, Split::Train, count, seed).unwrap().rows.features;
    assert_eq!(features(100, 1), features(100, 1));
    assert_ne!(features(100, 1), features(100, 2));
    assert_eq!(features(300, 1)[..100 * 3], features(100, 1)[..]);
    assert_eq!(draw(&sources, Split::Train, 10_000, 1).unwrap().rows.len(), 15 * 40);
}
