//! Which rows come, in which order, and what is left out.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::fixture::{self, Row};
use crate::cells::Label;
use crate::corpus::Split;
use crate::train::Sources;
use crate::train::stream::{self, Course, Window};

/// Every row has a number of its own in its first feature.
fn numbered(dir: &tempfile::TempDir, shards: usize) -> std::path::PathBuf {
    let rows = |shard: usize| {
        (0..10 + shard % 5).map(move |row| (Some(Label::ALL[row % 2]), [(shard * 100 + row) as f32, 1.0, 0.5]))
    };
    fixture::corpus(dir, "numbered", &(0..shards).map(|shard| rows(shard).collect::<Vec<Row>>()).collect::<Vec<_>>())
}

fn course(epochs: u32) -> Course {
    Course { seed: 3, epoch: 0, window: 0, epochs }
}

fn ids(windows: &[Window]) -> Vec<(u32, u32, u32)> {
    let of = |window: &Window| {
        let (epoch, number) = (window.epoch, window.window);
        let ids: Vec<_> =
            window.order.iter().map(|&row| (epoch, number, window.rows.row(row as usize)[0] as u32)).collect();
        ids
    };
    windows.iter().flat_map(of).collect()
}

fn windows(sources: &Arc<Sources>, course: Course, ahead: usize) -> Vec<Window> {
    stream::start(Arc::clone(sources), course, ahead).map(Result::unwrap).collect()
}

#[test]
fn law_each_epoch_holds_every_row_of_the_train_split_once_in_another_order() {
    let dir = tempfile::tempdir().unwrap();
    let sources = Arc::new(fixture::sources(&[numbered(&dir, 40)], &fixture::params()).unwrap());
    let all = ids(&windows(&sources, course(3), 1));
    let mut by_epoch: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    all.iter().for_each(|&(epoch, _, id)| by_epoch.entry(epoch).or_default().push(id));
    let mut expected: Vec<u32> = (0..40)
        .filter(|&shard| Split::of_shard(shard) == Split::Train)
        .flat_map(|shard| (0..10 + shard % 5).map(move |row| (shard * 100 + row) as u32))
        .collect();
    expected.sort_unstable();
    assert_eq!(by_epoch.len(), 3);
    for ids in by_epoch.values() {
        let mut sorted = ids.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, expected);
    }
    assert_ne!(by_epoch[&0], by_epoch[&1]);
    // Rows of eight shards are mixed: neighbours in the stream are seldom of one shard.
    let of_one_shard = by_epoch[&0].windows(2).filter(|pair| pair[0] / 100 == pair[1] / 100).count();
    assert!(of_one_shard * 4 < by_epoch[&0].len(), "{of_one_shard} of {}", by_epoch[&0].len());
}

#[test]
fn equal_order_however_far_is_read_ahead_and_wherever_it_begins() {
    let dir = tempfile::tempdir().unwrap();
    let sources = Arc::new(fixture::sources(&[numbered(&dir, 40)], &fixture::params()).unwrap());
    let whole = ids(&windows(&sources, course(2), 0));
    for ahead in [1, 2, 7] {
        assert_eq!(ids(&windows(&sources, course(2), ahead)), whole);
    }
    for (epoch, window) in [(0, 2), (1, 0), (1, 3)] {
        let rest: Vec<_> = whole.iter().copied().filter(|&(e, w, _)| (e, w) >= (epoch, window)).collect();
        assert!(!rest.is_empty());
        assert_eq!(ids(&windows(&sources, Course { epoch, window, ..course(2) }, 1)), rest);
    }
}

#[test]
fn exact_two_corpora_give_the_rows_of_both() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (numbered(&dir, 7), fixture::circles(&dir, "b", 20));
    let sources = Arc::new(fixture::sources(&[a, b], &fixture::params()).unwrap());
    let all = windows(&sources, course(1), 1);
    let of = |corpus: u16| all.iter().flat_map(|w| &w.rows.corpora).filter(|&&c| c == corpus).count();
    assert_eq!((of(0), of(1)), (10 + 11 + 12 + 14 + 10, 5 * 20));
    // Both in each window: one epoch is one permutation of all row groups.
    assert_eq!(all.len(), 2);
}

#[test]
fn law_a_reader_that_nobody_listens_to_stops() {
    let dir = tempfile::tempdir().unwrap();
    let sources = Arc::new(fixture::sources(&[numbered(&dir, 40)], &fixture::params()).unwrap());
    let mut stream = stream::start(Arc::clone(&sources), course(100_000), 1);
    stream.next().unwrap().unwrap();
    drop(stream);
    assert_eq!(Arc::strong_count(&sources), 1);
}

#[test]
fn equal_windows_read_into_memory_that_was_used_hold_the_same_rows() {
    let dir = tempfile::tempdir().unwrap();
    let sources = Arc::new(fixture::sources(&[numbered(&dir, 40)], &fixture::params()).unwrap());
    let fresh = windows(&sources, course(3), 1);
    let mut reused = stream::start(sources, course(3), 1);
    let mut count = 0;
    while let Some(window) = reused.next().transpose().unwrap() {
        let expected = &fresh[count];
        assert_eq!((window.epoch, window.window, &window.order), (expected.epoch, expected.window, &expected.order));
        assert_eq!(window.rows, expected.rows);
        count += 1;
        reused.reuse(window);
    }
    assert_eq!(count, fresh.len());
    // The last window of an epoch is smaller than those before it: memory that was fuller leaves nothing behind.
    assert!(fresh.iter().any(|window| window.rows.len() < fresh[0].rows.len()));
}
