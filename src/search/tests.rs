//! Searches as a whole, on rows whose border between the classes is known.

use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::json;

use super::networks::grid;
use super::over_scenes::ValidationScenes;
use super::rungs::Rung;
use super::{Event, Outcome, Setup, entry, journal, leaderboard, picture, search};
use crate::cells::Label;
use crate::random::{Purpose, Stage, Streams};
use crate::train::memory::Held;
use crate::train::rows::Rows;
use crate::train::{TrainError, TrainParams, folder};

/// Two features and a disc.
fn rows(seed: u64, count: usize) -> Rows {
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    let mut draws = vec![0.0; 2 * count];
    streams.open(Purpose::InitialWeights).fill_normal(0, &mut draws);
    let mut rows = Rows::new(2);
    for point in draws.chunks_exact(2) {
        rows.features.extend(point.iter().map(|x| *x as f32));
        rows.labels.push(Label::untraversable_if(point[0] * point[0] + point[1] * point[1] > 1.5));
        rows.corpora.push(0);
    }
    rows
}

fn setup(out: &Path, threads: usize) -> Setup {
    let sets = ["filter={ekf: {}}", "validate_every=100", "patience=4"].map(String::from);
    let params = TrainParams { epochs: 4, ..crate::config::load_train(None, &sets).unwrap() };
    let held = Held::new(&["x".into(), "y".into()], rows(1, 300), rows(2, 200), &[1.0], &params).unwrap();
    // Twenty rows a scene.
    let of_row: Vec<u32> = (0..200).map(|row| row / 20).collect();
    Setup {
        scenes: ValidationScenes::new(&held, &of_row),
        held,
        params,
        networks: grid(&[1, 3, 5], 2),
        rungs: 3,
        keep: 0.4,
        margin: 0.1,
        threads,
        data: json!({"rows": 300}),
        config_of: Box::new(|hidden| format!("{hidden:?}\n")),
        out: out.to_owned(),
        resume: true,
    }
}

/// To the end; how many networks were trained on the way.
fn run(setup: &Setup) -> u64 {
    let done = Cell::new(0);
    let outcome = search(setup, &AtomicBool::new(false), &mut |event| {
        done.set(done.get() + u64::from(matches!(event, Event::Done { .. })));
    });
    assert!(matches!(outcome.unwrap(), Outcome::Done(..)));
    done.get()
}

/// The files that must have the same bytes, and the journal's lines in order and without times.
fn promised(out: &Path) -> Vec<String> {
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let mut lines: Vec<String> =
        read(journal::NAME).lines().map(|line| line.split(",\"seconds\"").next().unwrap().to_owned()).collect();
    lines.sort();
    [leaderboard::NAME, picture::NAME, folder::CONFIG].map(read).into_iter().chain(lines).collect()
}

#[test]
fn equal_searches_for_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let out = |threads: usize| dir.path().join(threads.to_string());
    let done: Vec<u64> = [1, 2, 5].map(|threads| run(&setup(&out(threads), threads))).to_vec();
    assert!(done[0] >= 12 && done.iter().all(|n| *n == done[0]), "{done:?}");
    assert_eq!(promised(&out(1)), promised(&out(2)));
    assert_eq!(promised(&out(1)), promised(&out(5)));
}

#[test]
fn equal_searches_after_interruptions_and_kills_at_any_byte() {
    let dir = tempfile::tempdir().unwrap();
    let whole = setup(&dir.path().join("whole"), 2);
    let trained = run(&whole);
    let want = promised(&whole.out);
    // Interrupted after so many networks, again and again.
    let broken = setup(&dir.path().join("broken"), 2);
    for after in [1, 1, 2, 3] {
        let (stop, done) = (AtomicBool::new(false), Cell::new(0));
        let outcome = search(&broken, &stop, &mut |event| {
            done.set(done.get() + u64::from(matches!(event, Event::Done { .. })));
            stop.store(done.get() >= after, Ordering::Relaxed);
        });
        // Threads may be done with all before the word reaches them: then there is nothing to go on with.
        let interrupted = matches!(outcome.unwrap(), Outcome::Interrupted { .. });
        assert_eq!(broken.out.join(leaderboard::NAME).exists(), !interrupted, "{after}");
    }
    assert!(run(&broken) < trained);
    assert_eq!(promised(&broken.out), want);
    // Killed while a line was written.
    let journal = std::fs::read(whole.out.join(journal::NAME)).unwrap();
    for k in 0..8 {
        let killed = setup(&dir.path().join(format!("killed-{k}")), 2);
        std::fs::create_dir(&killed.out).unwrap();
        std::fs::write(killed.out.join(journal::NAME), &journal[..journal.len() * k / 8 + 1]).unwrap();
        run(&killed);
        assert_eq!(promised(&killed.out), want, "{k}");
    }
    // Once more: nothing is left to do, but for another margin.
    assert_eq!(run(&broken), 0);
    assert_eq!(run(&Setup { margin: 1.0, ..setup(&broken.out, 1) }), 0);
    assert_ne!(promised(&broken.out), want);
    // What somebody edited is not replaced.
    let edited = broken.out.join(folder::CONFIG);
    std::fs::write(&edited, "seed: 7\n").unwrap();
    let refused = search(&broken, &AtomicBool::new(false), &mut |_| {}).unwrap_err().to_string();
    assert!(refused.contains("holds train.yaml, which is not what this command gives"), "{refused}");
    assert_eq!(std::fs::read_to_string(&edited).unwrap(), "seed: 7\n");
}

#[test]
fn equal_an_entry_and_that_network_trained_alone() {
    let dir = tempfile::tempdir().unwrap();
    let setup = setup(&dir.path().join("a"), 2);
    let Outcome::Done(board, entries) = search(&setup, &AtomicBool::new(false), &mut |_| ()).unwrap() else {
        panic!("nobody asked it to stop")
    };
    let rung = Rung { rows: 4 * 300, networks: 1 };
    for there in &entries {
        let alone = entry::train(&setup, &there.hidden, (2, &rung), &AtomicBool::new(false));
        let alone = alone.unwrap().unwrap();
        assert_eq!(entry::Entry { seconds: 0.0, ..alone }, entry::Entry { seconds: 0.0, ..there.clone() });
        // Scenes add up to the error that was looked at.
        let sum: f64 = there.error_by_scene.iter().sum();
        assert!(there.error_by_scene.len() == 10 && (sum - there.validation_error.unwrap()).abs() < 1e-12);
    }
    // A disc takes three lines: no network of one neuron in its first layer sees it.
    assert!(board.chosen.unwrap().hidden[0] >= 3);
    assert!(entries[0].balanced_accuracy.unwrap() > 0.85 && entries[0].auc.unwrap() > 0.9, "{:?}", entries[0]);
}

#[test]
fn exact_scenes_of_rows_that_are_thinned_are_those_of_the_rows_that_are_left() {
    let params = TrainParams::default();
    let held = Held::new(&["x".into(), "y".into()], rows(1, 300), rows(2, 25_000), &[1.0], &params).unwrap();
    assert_eq!((held.looked_every, held.validation.len()), (2, 12_500));
    let of_row: Vec<u32> = (0..25_000).map(|row| if row < 5000 { 0 } else { 1 }).collect();
    let scenes = ValidationScenes::new(&held, &of_row);
    // Outputs that are right but for the first scene's, whose error is of its 2500 rows alone.
    let right = |row: usize| held.objective.targets[held.validation.labels[row].index()];
    let outputs: Vec<f64> = (0..12_500).map(|row| right(row) + f64::from(u8::from(row < 2500))).collect();
    let errors = scenes.errors(&held, &outputs);
    let weight = |row: usize| held.objective.look_weights.of(held.validation.labels[row], 0);
    let share = (0..2500).map(weight).sum::<f64>() / (0..12_500).map(weight).sum::<f64>();
    assert!((errors[0] - share).abs() < 1e-12 && errors[1] == 0.0, "{errors:?} {share}");
    let broken = vec![f64::NAN; 12_500];
    assert!(scenes.errors(&held, &broken).is_empty());
}

#[test]
fn law_a_search_begun_otherwise_or_in_a_foreign_folder_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let begun = setup(&dir.path().join("a"), 1);
    run(&begun);
    let refused = |setup: &Setup| search(setup, &AtomicBool::new(false), &mut |_| ()).unwrap_err().to_string();
    let mut other = setup(&begun.out, 1);
    (other.params.clip, other.keep) = (5.0, 0.5);
    let told = refused(&other);
    assert!(told.contains("'keep' was 0.4 and is 0.5 now") && told.contains("'config.clip' was 8.0"), "{told}");
    let mut wider = setup(&begun.out, 1);
    wider.params.network.members = 3;
    let told = refused(&wider);
    assert!(told.contains("'config.network.members' was 1 and is 3 now"), "{told}");
    assert!(refused(&Setup { resume: false, ..setup(&begun.out, 1) }).contains("is there already"));
    let foreign = dir.path().join("b");
    std::fs::create_dir(&foreign).unwrap();
    std::fs::write(foreign.join("thesis.txt"), "").unwrap();
    assert!(refused(&setup(&foreign, 1)).contains("no run folder"));
    let large = Setup { networks: vec![vec![200]], ..setup(&dir.path().join("c"), 1) };
    assert!(refused(&large).contains("300 rows to learn for 801 weights"));
    assert!(!large.out.exists(), "nothing was written");
}

#[test]
fn extreme_a_filter_that_learns_nothing_finite_leaves_a_leaderboard() {
    let dir = tempfile::tempdir().unwrap();
    let mut odd = setup(&dir.path().join("a"), 1);
    odd.held.validation.features.fill(f32::NAN);
    assert!(matches!(search(&odd, &AtomicBool::new(false), &mut |_| ()), Ok::<_, TrainError>(Outcome::Done(..))));
    let text = std::fs::read_to_string(odd.out.join(leaderboard::NAME)).unwrap();
    assert!(text.contains("\"chosen\": null"), "{text}");
    assert!(!odd.out.join(folder::CONFIG).exists());
}
