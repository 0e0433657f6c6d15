//! Training on rows in memory.

use std::sync::atomic::{AtomicBool, Ordering};

use super::fixture::{circle, corpus, looks, params, run, setup, with};
use crate::cells::Label;
use crate::corpus::Split;
use crate::train::memory::{Course, Event, Held, Trained, train};
use crate::train::params::{Balance, StopBy};
use crate::train::rows::Rows;
use crate::train::stopping::Stop;
use crate::train::{Model, TrainError, TrainParams, folder};

/// Rows of the circle: those of a shard of `super::fixture`.
fn rows(shard: u64, count: usize) -> Rows {
    let mut rows = Rows::new(3);
    for (label, features) in circle(shard, count) {
        rows.features.extend(features);
        rows.labels.push(label.unwrap());
        rows.corpora.push(0);
    }
    rows
}

fn names() -> Vec<String> {
    ["x", "y", "z"].map(String::from).to_vec()
}

fn held(params: &TrainParams) -> Held {
    Held::new(&names(), rows(0, 900), rows(3, 400), &[1.0], params).unwrap()
}

fn whole(params: &TrainParams, held: &Held, course: Course) -> Trained {
    train(params, held, course, &AtomicBool::new(false), &mut |_| ()).unwrap().unwrap()
}

#[test]
fn equal_bits_from_memory_and_from_a_corpus_of_one_row_group() {
    let dir = tempfile::tempdir().unwrap();
    let mut shards = vec![Vec::new(); 7];
    (shards[0], shards[3]) = (circle(0, 900), circle(3, 400));
    let place = corpus(&dir, "a", &shards);
    for (name, params) in [("run", params()), ("batches", with(&["filter={kronecker: {}}"]))] {
        let setup = setup(std::slice::from_ref(&place), &params, dir.path().join(name)).unwrap();
        assert_eq!(setup.sources.groups(Split::Train).len(), 1);
        let summary = run(&setup).unwrap();
        let model = Model::read(&setup.out.join(folder::MODEL)).unwrap();
        let held = held(&setup.params);
        let trained = whole(&setup.params, &held, held.course(&setup.params));
        assert_eq!(held.objective.scaler, model.about.scaler);
        assert_eq!(model.about.scaler.scores.len(), if name == "batches" { 3 } else { 0 });
        assert_eq!(trained.network, model.network);
        assert_eq!(trained.looks, looks(&setup));
        assert_eq!((trained.best, trained.stopped), (summary.best, summary.stopped));
        assert_eq!((trained.rows_learnt, trained.counters), (summary.rows_learnt, summary.counters));
    }
}

#[test]
fn equal_looks_of_a_short_course_and_the_beginning_of_a_long_one() {
    let params = params();
    let held = held(&params);
    let course = Course { rows: 2700, validate_every: 450 };
    let long = whole(&params, &held, course);
    for rows in [450, 900, 1350] {
        let short = whole(&params, &held, Course { rows, ..course });
        assert_eq!(short.looks[..], long.looks[..short.looks.len()]);
        assert_eq!(short.rows_learnt, rows);
    }
}

#[test]
fn law_a_course_ends_at_its_rows_by_patience_or_when_asked_to() {
    let mut params = params();
    let held = held(&params);
    let course = Course { rows: 1000, validate_every: 300 };
    let trained = whole(&params, &held, course);
    assert_eq!((trained.rows_learnt, trained.stopped), (1000, Stop::Epochs));
    assert_eq!(trained.looks.iter().map(|look| look.rows).collect::<Vec<_>>(), [0, 300, 600, 900, 1000]);
    params.patience = 1;
    let long = whole(&params, &held, Course { rows: 1_000_000, validate_every: 300 });
    assert_eq!(long.stopped, Stop::Patience);
    let errors: Vec<f64> = long.looks.iter().map(|look| look.validation_error.unwrap()).collect();
    let improves: Vec<bool> = errors.windows(2).map(|pair| pair[1] < 0.99 * pair[0]).collect();
    // All looks but the last improve by a hundredth on the one before.
    assert_eq!(improves.iter().position(|improves| !improves), Some(improves.len() - 1));
    assert_eq!(long.best.validation_error, errors.into_iter().reduce(f64::min));
    let stop = AtomicBool::new(false);
    let mut tell = |event: Event| stop.store(matches!(event, Event::Rows(512..)), Ordering::Relaxed);
    assert_eq!(train(&params, &held, course, &stop, &mut tell).unwrap(), None);
}

#[test]
fn exact_the_network_is_that_of_the_best_look_and_outputs_are_its() {
    let params = params();
    let held = held(&params);
    let trained = whole(&params, &held, held.course(&params));
    assert_eq!(Some(held.validation_error(&trained.network)), trained.best.validation_error);
    let outputs = held.outputs(&trained.network, &held.validation);
    let (mut squared, mut weight) = (0.0, 0.0);
    for (output, &label) in outputs.iter().zip(&held.validation.labels) {
        let w = held.objective.weights.of(label, 0);
        let error = params.targets[label.index()] - output;
        (squared, weight) = (squared + w * error * error, weight + w);
    }
    assert!((squared / weight - trained.best.validation_error.unwrap()).abs() < 1e-13);
}

#[test]
fn extreme_no_rows_and_fewer_rows_than_weights_are_refused() {
    let mut params = params();
    let none = || Rows::new(3);
    for (train, validation, says) in [(none(), rows(3, 9), "row to learn"), (rows(0, 9), none(), "row to validate by")]
    {
        let error = Held::new(&names(), train, validation, &[1.0], &params).err().unwrap();
        assert!(error.to_string().contains(says), "{error}");
    }
    params.network.hidden = vec![400];
    let held = held(&params);
    let refused = train(&params, &held, held.course(&params), &AtomicBool::new(false), &mut |_| ());
    assert!(matches!(refused, Err(TrainError::FewRows { rows: 900, weights: 2001 })));
}

#[test]
fn exact_looks_by_classes_weigh_both_alike_while_rows_to_learn_count_as_they_come() {
    let unweighed = TrainParams { balance: Balance::None, ..params() };
    let (by_rows, by_classes) =
        (held(&unweighed), held(&TrainParams { stop_by: StopBy::Classes, ..unweighed.clone() }));
    for held in [&by_rows, &by_classes] {
        assert_eq!(held.objective.weights.class, [1.0; 2]);
    }
    assert_eq!(by_rows.objective.look_weights.class, [1.0; 2]);
    let learnt = |class: Label| by_rows.train.labels.iter().filter(|&&label| label == class).count() as f64;
    let [traversable, untraversable] = by_classes.objective.look_weights.class;
    assert!(
        (traversable * learnt(Label::Traversable) - untraversable * learnt(Label::Untraversable)).abs() < 1e-9
            && learnt(Label::Traversable) != learnt(Label::Untraversable)
    );

    // The error by hand, of a network that says the same of every row.
    let mut network = whole(&unweighed, &by_rows, Course { rows: 100, validate_every: 100 }).network;
    network.weights.fill(0.0);
    let share = |class: Label| {
        let of = by_classes.validation.labels.iter().filter(|&&label| label == class).count() as f64;
        of * by_classes.objective.look_weights.class[class.index()]
    };
    let [low, high] = unweighed.targets;
    let expected = {
        let [traversable, untraversable] = Label::ALL.map(share);
        (traversable * (0.5 - low) * (0.5 - low) + untraversable * (0.5 - high) * (0.5 - high))
            / (traversable + untraversable)
    };
    assert!((by_classes.validation_error(&network) - expected).abs() < 1e-12);
}

#[test]
fn exact_looks_count_epochs_from_one_and_what_was_before_the_first_row_as_none() {
    let params = params();
    let held = held(&params);
    let trained = whole(&params, &held, Course { rows: 2700, validate_every: 450 });
    let epochs: Vec<(u64, u32)> = trained.looks.iter().map(|look| (look.rows, look.epoch)).collect();
    // 900 rows an epoch: the look after the last row of one belongs to it.
    let expected = [(0, 0), (450, 1), (900, 1), (1350, 2), (1800, 2), (2250, 3), (2700, 3)];
    assert!(epochs.len() > 3 && epochs[..] == expected[..epochs.len()], "{epochs:?}");
}

#[test]
fn exact_a_handful_of_rows_behind_the_last_look_tells_no_training_error() {
    let params = params();
    let held = held(&params);
    for (rows, is_told) in [(450 + 44, false), (450 + 45, true)] {
        let trained = whole(&params, &held, Course { rows, validate_every: 450 });
        let told: Vec<(u64, bool)> = trained.looks.iter().map(|look| (look.rows, look.train_error.is_some())).collect();
        assert_eq!(told, [(0, false), (450, true), (rows, is_told)]);
    }
}
