//! Rows of scenes drawn at random.

use super::fixture::{circle, corpus, params, sources};
use crate::corpus::Split;
use crate::train::scenes::draw;

#[test]
fn exact_every_scene_gives_its_share_of_the_rows_and_the_last_is_cut() {
    let dir = tempfile::tempdir().unwrap();
    let place = corpus(&dir, "a", &(0..21).map(|shard| circle(shard, 40)).collect::<Vec<_>>());
    let sources = sources(&[place], &params()).unwrap();
    let rows_of = |shard: u64| circle(shard, 40).into_iter().map(|(_, row)| row).collect::<Vec<_>>();
    // Fifteen scenes of 40 rows in the split: 100 rows are at most 7 a scene.
    let sample = draw(&sources, Split::Train, 100, 7).unwrap();
    assert_eq!((sample.rows.len(), sample.scenes, sample.scenes_there), (100, 15, 15));
    let mut given = [0; 21];
    for row in sample.rows.features.chunks(3) {
        let shard = (0..21).find(|&shard| rows_of(shard).iter().any(|of_scene| of_scene[..] == *row));
        given[shard.expect("a row of the corpus") as usize] += 1;
    }
    let mut shares: Vec<usize> =
        (0..21).filter(|&shard| Split::of_shard(shard) == Split::Train).map(|shard| given[shard as usize]).collect();
    shares.sort_unstable();
    assert_eq!((shares[0], &shares[1..]), (2, &[7; 14][..]));
    let distinct: std::collections::BTreeSet<Vec<u32>> =
        sample.rows.features.chunks(3).map(|row| row.iter().map(|v| v.to_bits()).collect()).collect();
    assert_eq!(distinct.len(), 100, "each row once");
    // Each row is known to be of its scene: those that follow one another are of one, and no scene comes twice.
    assert_eq!(sample.of_row.len(), 100);
    let of_row: Vec<u32> = (0..15).flat_map(|scene| vec![scene; if scene == 14 { 2 } else { 7 }]).collect();
    assert_eq!(sample.of_row, of_row);
    let shard_of = |row: usize| {
        let row = &sample.rows.features[3 * row..3 * row + 3];
        (0..21).find(|&shard| rows_of(shard).iter().any(|of_scene| of_scene[..] == *row))
    };
    for row in 1..100 {
        assert_eq!(shard_of(row) == shard_of(row - 1), of_row[row] == of_row[row - 1], "row {row}");
    }
}

#[test]
fn law_at_least_a_hundred_scenes_give_rows_where_there_are_so_many() {
    let dir = tempfile::tempdir().unwrap();
    let place = corpus(&dir, "a", &(0..200).map(|shard| circle(shard, 20)).collect::<Vec<_>>());
    let sources = sources(&[place], &params()).unwrap();
    for count in [100, 1050, 2000] {
        let sample = draw(&sources, Split::Train, count, 7).unwrap();
        assert!(sample.rows.len() == count && sample.scenes >= 100, "{count}: {}", sample.scenes);
    }
}

#[test]
fn law_scenes_of_few_rows_leave_others_to_give_more() {
    let dir = tempfile::tempdir().unwrap();
    let place = corpus(
        &dir,
        "a",
        &(0..21).map(|shard| circle(shard, if shard % 2 == 0 { 2 } else { 100 })).collect::<Vec<_>>(),
    );
    let sources = sources(&[place], &params()).unwrap();
    let there: usize = (0..21)
        .filter(|&shard| Split::of_shard(shard) == Split::Train)
        .map(|shard| if shard % 2 == 0 { 2 } else { 100 })
        .sum();
    assert_eq!(draw(&sources, Split::Train, there - 1, 3).unwrap().rows.len(), there - 1);
    assert_eq!(draw(&sources, Split::Train, there + 1, 3).unwrap().rows.len(), there);
}

#[test]
fn law_a_draw_is_a_function_of_seed_and_split() {
    let dir = tempfile::tempdir().unwrap();
    let place = corpus(&dir, "a", &(0..21).map(|shard| circle(shard, 40)).collect::<Vec<_>>());
    let sources = sources(&[place], &params()).unwrap();
    let features = |count, seed| draw(&sources, Split::Train, count, seed).unwrap().rows.features;
    assert_eq!(features(100, 1), features(100, 1));
    assert_ne!(features(100, 1), features(100, 2));
    assert_eq!(draw(&sources, Split::Train, 10_000, 1).unwrap().rows.len(), 15 * 40);
}
