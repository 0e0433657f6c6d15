//! Corpora that no training should meet: it stays finite, says what it saw, or left out.

use super::fixture::{Row, circle, corpus, params, run, setup, with};
use crate::cells::Label;
use crate::train::run::Summary;
use crate::train::{Model, folder};

/// Trains on seven shards and gives back what came of it; all weights and the best error are finite.
fn trained(shards: Vec<Vec<Row>>, sets: &[&str]) -> (Summary, Model) {
    let dir = tempfile::tempdir().unwrap();
    let place = corpus(&dir, "a", &shards);
    let setup = setup(&[place], &with(sets), dir.path().join("run")).unwrap();
    let summary = run(&setup).unwrap();
    let model = Model::read(&setup.out.join(folder::MODEL)).unwrap();
    assert!(model.network.weights.iter().all(|w| w.is_finite()));
    assert!(summary.best.validation_error.unwrap().is_finite());
    assert_eq!((summary.counters.rejected, summary.counters.rebuilt), (0, 0));
    (summary, model)
}

fn changed(rows: usize, change: impl Fn(Row) -> Row) -> Vec<Vec<Row>> {
    (0..7).map(|shard| circle(shard, rows).into_iter().map(&change).collect()).collect()
}

#[test]
fn extreme_constant_feature_is_named_and_scaled_by_one() {
    let (summary, model) = trained(changed(200, |(label, [a, b, _])| (label, [a, b, 1e8])), &[]);
    assert_eq!(summary.constant_features, ["sigma_x_m"]);
    assert_eq!((model.about.scaler.mean[2], model.about.scaler.scale[2]), (1e8, 1.0));
}

#[test]
fn extreme_duplicated_feature_trains() {
    let (plain, _) = trained(changed(400, |row| row), &["epochs=10"]);
    let (twice, _) = trained(changed(400, |(label, [a, b, _])| (label, [a, b, b])), &["epochs=10"]);
    let (plain, twice) = (plain.best.validation_error.unwrap(), twice.best.validation_error.unwrap());
    // The third feature is noise: its place taken by a copy of another one, nothing is lost.
    assert!(twice < 1.3 * plain, "{twice} against {plain}");
}

#[test]
fn extreme_features_of_size_1e_minus_8_and_1e8_train_as_those_of_size_1() {
    let best = |scale: f32| {
        let (summary, _) = trained(changed(400, |(label, row)| (label, row.map(|x| scale * x))), &["epochs=10"]);
        summary.best.validation_error.unwrap()
    };
    // Standardised, only the rounding of f32 is left of the scale.
    let plain = best(1.0);
    for scale in [1e-8, 1e8] {
        assert!((best(scale) / plain - 1.0).abs() < 0.02, "{scale:e}: {} against {plain}", best(scale));
    }
}

#[test]
fn extreme_one_class_alone_is_learnt_and_not_weighed() {
    let (summary, _) = trained(changed(200, |(_, row)| (Some(Label::Traversable), row)), &["allow_one_class=true"]);
    assert!(summary.best.validation_error.unwrap() < 1e-3 && summary.class_weights == [1.0, 1.0]);
}

#[test]
fn extreme_single_row_trains() {
    let mut shards = vec![Vec::new(); 7];
    let row = || vec![(Some(Label::Untraversable), [0.5, 0.25, 1e-8])];
    (shards[0], shards[3]) = (row(), row());
    let (summary, _) = trained(shards, &["allow_few_rows=true", "allow_one_class=true"]);
    assert_eq!((summary.train_rows, summary.rows_learnt), (1, 3));
}

#[test]
fn extreme_outliers_are_clipped_and_counted() {
    let dir = tempfile::tempdir().unwrap();
    let spoilt = |shard: u64| {
        let mut rows = circle(shard, 300);
        rows[7].1[0] = 1e6;
        rows
    };
    let place = corpus(&dir, "a", &(0..7).map(spoilt).collect::<Vec<_>>());
    let setup = setup(&[place], &with(&["patience=100", "filter.ekf.rows=every"]), dir.path().join("run")).unwrap();
    // One row in each of five train shards, in each of three epochs.
    assert_eq!(run(&setup).unwrap().counters.clipped, 15);
}

#[test]
fn extreme_rows_with_nan_infinity_or_no_label_are_counted_in_each_epoch_and_never_learnt() {
    let dir = tempfile::tempdir().unwrap();
    let spoilt = |shard: u64| {
        let mut rows = circle(shard, 300);
        rows[0].1[1] = f32::NAN;
        rows[1].1[2] = f32::INFINITY;
        rows[2].0 = None;
        rows
    };
    let place = corpus(&dir, "a", &(0..7).map(spoilt).collect::<Vec<_>>());
    let setup = setup(&[place], &params(), dir.path().join("run")).unwrap();
    let summary = run(&setup).unwrap();
    assert_eq!((summary.left_out.unlabelled, summary.left_out.not_finite), (5 * 3, 5 * 3 * 2));
    assert_eq!((summary.left_out_of_validation.unlabelled, summary.left_out_of_validation.not_finite), (1, 2));
    assert_eq!(summary.rows_learnt, 3 * 5 * 297);
    assert_eq!(summary.counters.rejected, 0, "the filter never saw them");
}
