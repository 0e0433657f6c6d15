//! A training from its first row to its files.

use std::sync::Arc;

use super::fixture::{self, circle, circles, corpus, identity, params, run, run_until, setup, with};
use crate::cells::Label;
use crate::train::operating_point::class;
use crate::train::stopping::Stop;
use crate::train::{Activation, Model, Setup, TrainParams, folder};

#[test]
fn law_a_learnable_problem_is_learnt_and_its_files_are_there() {
    let dir = tempfile::tempdir().unwrap();
    let setup =
        setup(&[circles(&dir, "a", 400)], &with(&["network.hidden=[8]", "epochs=20"]), dir.path().join("run")).unwrap();
    let summary = run(&setup).unwrap();
    assert_eq!((summary.train_rows, summary.validation_rows, summary.weights), (2000, 400, 41));
    let first = fixture::looks(&setup)[0];
    let (begun, best) = (first.validation_error.unwrap(), summary.best.validation_error.unwrap());
    assert!(best < 0.5 * begun, "{begun} -> {best}");
    // All rows of both splits are few enough to be judged.
    let found = summary.generalisation.unwrap();
    assert!((found.held_back - best).abs() < 1e-12 && found.learnt < 0.6 * begun, "{found:?}, {best}");
    let model = Model::read(&setup.out.join(folder::MODEL)).unwrap();
    let rows = circle(99, 2000);
    let right = rows
        .iter()
        .filter(|(label, row)| *label == Some(Label::ALL[class(&model.about.thresholds, model.output(row))]))
        .count();
    assert!(right > 1600, "{right} of 2000");
    assert_eq!(model.about.features, fixture::FEATURES);
    assert!((model.about.scaler.mean[1] - 10.0).abs() < 0.3 && (model.about.scaler.scale[1] - 3.0).abs() < 0.2);
    assert!(!setup.out.join(folder::CHECKPOINT).exists());
}

/// A training by batches, with looks that fall into them.
fn by_batches(loss: &str) -> TrainParams {
    let filter = format!("filter={{kronecker: {{rate: 0.02, loss: {loss}}}}}");
    with(&[&filter, "network.hidden=[8, 8]", "epochs=4", "patience=20"])
}

/// By batches, the second member of rectified neurons.
fn with_both() -> TrainParams {
    let mut params = by_batches("squared");
    (params.network.members, params.network.activation) = (2, Activation::Both);
    params
}

/// What learns in unlike ways, by name.
fn of_filters() -> [(&'static str, TrainParams); 8] {
    let [squared, logarithmic] = ["squared", "logarithmic"].map(by_batches);
    let by = |filter: &str| with(&[&format!("filter={{{filter}}}")]);
    [
        ("ekf", params()),
        ("robust", by("ekf: {robust: true}")),
        ("decoupled", by("decoupled: {}")),
        ("ukf", by("ukf: {}")),
        ("backprop", by("backprop: {}")),
        ("squared", squared),
        ("rectified", with_both()),
        ("logarithmic", logarithmic),
    ]
}

#[test]
fn equal_runs_have_the_same_bits_for_any_prefetch_and_thread_number() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    for (filter, params) in of_filters() {
        let one = |name: &str, ahead: usize, threads: usize| {
            let out = dir.path().join(format!("{filter}-{name}"));
            let setup = Setup { ahead, ..setup(std::slice::from_ref(&place), &params, out).unwrap() };
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&setup)).unwrap();
            identity(&setup)
        };
        let first = one("first", 0, 1);
        for (name, ahead, threads) in [("second", 1, 2), ("third", 4, 3)] {
            assert_eq!(one(name, ahead, threads), first);
        }
    }
}

#[test]
fn equal_bits_after_interruptions_and_crashes_at_ten_moments() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    for (filter, params) in of_filters() {
        let of =
            |name: String| setup(std::slice::from_ref(&place), &params, dir.path().join(filter).join(name)).unwrap();
        let whole = of("whole".into());
        run(&whole).unwrap();
        for crash in [false, true] {
            let broken = Setup { resume: true, ..of(format!("broken-{crash}")) };
            for rows in [1, 250, 299, 301, 700, 1490, 1501, 2000, 3100, 4250] {
                run_until(&broken, rows, crash);
            }
            run(&broken).unwrap();
            assert_eq!(identity(&broken), identity(&whole), "{filter}, crash {crash}");
            // Once more: nothing is left to do.
            run(&broken).unwrap();
        }
    }
}

/// 7500 rows to learn, looks at 6000 and at the end: between them portions are learnt several at once where threads share the work.
#[test]
fn equal_bits_where_several_portions_are_learnt_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 1500);
    let sets =
        ["filter={kronecker: {rate: 0.02}}", "network.hidden=[8, 8]", "epochs=3", "patience=20", "validate_every=6000"];
    let one = |threads: usize, stops: &[u64]| {
        let out = dir.path().join(format!("{threads}-{}", stops.len()));
        let setup = Setup { resume: true, ..setup(std::slice::from_ref(&place), &with(&sets), out).unwrap() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            stops.iter().for_each(|rows| run_until(&setup, *rows, false));
            run(&setup)
        })
        .unwrap();
        identity(&setup)
    };
    let first = one(1, &[]);
    assert_eq!(one(3, &[]), first);
    for threads in [1, 3] {
        assert_eq!(one(threads, &[1, 1025, 4096, 5000, 6000, 6144, 7500, 9000, 13_000]), first, "{threads} threads");
    }
}

#[test]
fn equal_a_floor_of_one_is_the_exact_filter_and_the_default_learns_fewer_rows() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    let one = |name: &str, rows: &str| {
        let params = with(&["epochs=20", "patience=100", &format!("filter.ekf.rows={rows}")]);
        let setup = setup(std::slice::from_ref(&place), &params, dir.path().join(name)).unwrap();
        let summary = run(&setup).unwrap();
        assert_eq!(summary.last.rows, 20 * 1500);
        let model = Model::read(&setup.out.join(folder::MODEL)).unwrap();
        (model.network.weights, summary.counters.updates)
    };
    let every = one("every", "every");
    assert_eq!(every.1, 20 * 1500);
    assert_eq!(one("floor", "{by_error: {floor: 1}}"), every);
    let by_error = one("default", "{by_error: {}}");
    assert!(by_error.1 > 1500 && by_error.1 < every.1 * 3 / 4, "{}", by_error.1);
}

#[test]
fn law_training_stops_when_the_validation_error_rises_and_reverts() {
    let dir = tempfile::tempdir().unwrap();
    // Validation says the opposite of training: every step makes it worse.
    let opposite = |shard: u64| -> Vec<fixture::Row> {
        let rows = circle(shard, 400).into_iter();
        rows.map(|(label, row)| (label.map(|l| Label::untraversable_if(l.is_untraversable() != (shard == 3))), row))
            .collect()
    };
    let place = corpus(&dir, "a", &(0..7).map(opposite).collect::<Vec<_>>());
    let setup =
        setup(&[place], &with(&["patience=2", "validate_every=500", "epochs=50"]), dir.path().join("run")).unwrap();
    let summary = run(&setup).unwrap();
    assert_eq!(summary.stopped, Stop::Patience);
    assert!(summary.best.rows <= 500 && summary.last.rows == summary.best.rows + 1000, "{summary:?}");
    let looks = fixture::looks(&setup);
    assert_eq!(looks.len() as u64, summary.looks);
}

#[test]
fn equal_a_training_that_starts_from_a_model_begins_with_its_error() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    let first = setup(std::slice::from_ref(&place), &params(), dir.path().join("first")).unwrap();
    let summary = run(&first).unwrap();
    let other = circles(&dir, "b", 500);
    for covariance in [true, false] {
        let init = crate::train::run::Init {
            path: "first".into(),
            model: Model::read(&first.out.join(folder::MODEL)).unwrap(),
            filter: covariance.then(|| std::fs::read(first.out.join(folder::FILTER)).unwrap()),
        };
        let out = dir.path().join(format!("on-{covariance}"));
        let on = Setup { init: Some(init.clone()), ..setup(std::slice::from_ref(&place), &params(), out).unwrap() };
        run(&on).unwrap();
        assert_eq!(fixture::looks(&on)[0].validation_error, summary.best.validation_error);
        // Another corpus, scaled as the model was.
        let out = dir.path().join(format!("other-{covariance}"));
        let on = Setup { init: Some(init), ..setup(std::slice::from_ref(&other), &params(), out).unwrap() };
        run(&on).unwrap();
        let scaler = |setup: &Setup| Model::read(&setup.out.join(folder::MODEL)).unwrap().about.scaler;
        assert_eq!(scaler(&on), scaler(&first));
    }
}

#[test]
fn extreme_a_start_from_a_network_of_other_inputs_is_refused_with_the_settings_that_fit() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    let batches = |more: &[&str]| with(&[&["filter={kronecker: {}}"], more].concat());
    let first = setup(std::slice::from_ref(&place), &batches(&[]), dir.path().join("first")).unwrap();
    run(&first).unwrap();
    let model = Model::read(&first.out.join(folder::MODEL)).unwrap();
    assert_eq!((model.about.inputs, model.about.scaler.scores.len()), (6, 3));
    let init = || Some(crate::train::run::Init { path: "first".into(), model: model.clone(), filter: None });
    let from = |params: &TrainParams, name: &str| {
        let setup = setup(std::slice::from_ref(&place), params, dir.path().join(name)).unwrap();
        run(&Setup { init: init(), ..setup })
    };
    let told = from(&batches(&["network.normal_scores=false"]), "other").unwrap_err().to_string();
    assert!(
        told.contains("--set network.members=2 --set network.activation=logistic --set network.normal_scores=true"),
        "{told}"
    );
    from(&batches(&[]), "on").unwrap();
}

#[test]
fn equal_weights_of_one_corpus_alone_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let place = circles(&dir, "a", 300);
    let one = |weight: f64, name: &str| {
        let store = crate::corpus::LocalFolder::new(&place);
        let source = crate::train::Source::open(&store, weight).unwrap();
        let params = params();
        let sources = crate::train::Sources::new(vec![source], &params.features, None).unwrap();
        let setup = setup(std::slice::from_ref(&place), &params, dir.path().join(name)).unwrap();
        let setup = Setup { sources: Arc::new(sources), ..setup };
        run(&setup).unwrap();
        Model::read(&setup.out.join(folder::MODEL)).unwrap().network.weights
    };
    assert_eq!(one(1.0, "one"), one(4.0, "four"));
}
