use proptest::prelude::*;

use super::*;
use crate::cells::{CellFrame, CellParams, LabelRule, Obstacle};
use crate::drive::Rover;
use crate::math;
use crate::sweep::Sensor;
use crate::train::operating_point::class;
use crate::train::{Activation, Calibration, Layout, NormalScores, Scaler};

/// A small model whose every number is known: weights are a sine of their number.
pub(crate) fn model(features: &[&str], hidden: &[usize], bias: bool) -> Model {
    ensemble(1, features, hidden, bias)
}

/// The same of several members.
pub(crate) fn ensemble(members: usize, features: &[&str], hidden: &[usize], bias: bool) -> Model {
    let layout =
        Layout { inputs: features.len(), hidden: hidden.to_vec(), bias, members, activation: Activation::Logistic };
    let weights = (0..layout.weights()).map(|k| 1.5 * math::sin(1.0 + 0.7 * k as f64)).collect();
    let rover: Rover = serde_saphyr::from_str(include_str!("../../../configs/rovers/kapvik.yaml")).unwrap();
    let sensor: Sensor = serde_saphyr::from_str(include_str!("../../../configs/sensors/urg-04lx.yaml")).unwrap();
    let inputs = features.len();
    let about = About {
        marsyard_model: MODEL_FORMAT,
        inputs,
        hidden: hidden.to_vec(),
        bias,
        members,
        activation: Activation::Logistic,
        features: features.iter().map(|name| name.to_string()).collect(),
        scaler: Scaler {
            minus: (0..inputs).map(|k| (k == 2).then_some(0)).collect(),
            mean: (0..inputs).map(|k| 0.1 * k as f64).collect(),
            scale: (0..inputs).map(|k| 0.5 + 0.25 * k as f64).collect(),
            clip: 8.0,
            scores: Vec::new(),
        },
        quantiles: (0..inputs).map(|k| [-3.0, -2.0, -1.0, 0.1 * k as f64, 1.0, 2.0, 3.0]).collect(),
        targets: [0.1, 0.9],
        thresholds: vec![0.5],
        cells: CellParams::default(),
        rover,
        sensor,
        mount: [0.2, 0.0, 0.4, 0.0, 0.0, 0.0],
        corpus_ids: vec!["ab".repeat(32)],
        corpus_names: vec!["tiny".into()],
        run: Some("cd".repeat(32)),
        learnt_from: Vec::new(),
        calibration: Some(Calibration {
            slope: 1.5,
            offset: -0.75,
            edge: 1e-4,
            cells: [900, 100],
            curve: vec![[0.25, 0.01, 0.2], [0.5, 0.05, 0.03], [0.75, 0.3, 0.005]],
        }),
        frames: Vec::new(),
        overhangs_m: Vec::new(),
        reach_m: None,
        labels: None,
    };
    Model { network: Network { layout, weights }, about, sha256: None }
}

/// The same with normal scores of every feature, between quantiles of some unlike distributions; the first never varied.
pub(crate) fn scored(members: usize, features: &[&str], hidden: &[usize], bias: bool) -> Model {
    let mut model = ensemble(members, features, hidden, bias);
    let sample = |k: usize| (0..500).map(|x| k as f64 * math::exp(0.01 * f64::from(x)) - 3.0).collect();
    let of = |(k, minus): (usize, &Option<usize>)| match minus {
        None => NormalScores::of_sample(sample(k), 8.0),
        Some(_) => NormalScores::of_heights_above(sample(k), 8.0),
    };
    model.about.scaler.scores = model.about.scaler.minus.iter().enumerate().map(of).collect();
    model.about.inputs *= 2;
    model.network.layout.inputs *= 2;
    let weights = model.network.layout.weights();
    model.network.weights = (0..weights).map(|k| 1.5 * math::sin(1.0 + 0.7 * k as f64)).collect();
    model
}

/// The same network with other hidden neurons.
pub(crate) fn with_neurons(activation: Activation, mut model: Model) -> Model {
    (model.about.activation, model.network.layout.activation) = (activation, activation);
    model
}

fn small() -> Model {
    model(&["mean_height_m", "height_difference_m", "point_count"], &[4, 2], true)
}

#[test]
fn exact_one_neuron_is_the_logistic_of_its_weighted_sum() {
    let mut one = model(&["a"], &[1], true);
    one.network.weights = vec![2.0, 0.5, -3.0, 1.0];
    one.about.scaler = Scaler { minus: vec![None], mean: vec![1.0], scale: vec![4.0], clip: 8.0, scores: Vec::new() };
    let logistic = |x: f64| 1.0 / (1.0 + math::exp(-x));
    let expected = |x: f64| logistic(-3.0 * logistic(2.0 * ((x - 1.0) / 4.0).clamp(-8.0, 8.0) + 0.5) + 1.0);
    for x in [0.0, 1.0, -7.5, 1e30, -1e30, f64::INFINITY] {
        assert!((one.output(&[x as f32]) - expected(x)).abs() < 1e-15, "{x}");
    }
    let mut plain = model(&["a"], &[1], false);
    plain.network.weights = vec![2.0, -3.0];
    plain.about.scaler = Scaler { minus: vec![None], mean: vec![0.0], scale: vec![1.0], clip: 8.0, scores: Vec::new() };
    assert!((plain.output(&[0.25]) - logistic(-3.0 * logistic(0.5))).abs() < 1e-15);
}

#[test]
fn exact_an_output_at_a_threshold_is_of_the_class_above_it() {
    assert_eq!([0.0, 0.5_f64.next_down(), 0.5, 1.0].map(|output| class(&[0.5], output)), [0, 0, 1, 1]);
    assert_eq!([0.1, 0.3, 0.5, 0.7, 0.9].map(|output| class(&[0.3, 0.7], output)), [0, 1, 1, 2, 2]);
}

#[test]
fn exact_an_input_above_another_is_their_difference_before_it_is_scaled() {
    let (mean, scale) = (vec![1.0, 0.5], vec![2.0, 0.25]);
    let scaler = Scaler { minus: vec![None, Some(0)], mean, scale, clip: 8.0, scores: Vec::new() };
    let mut out = [0.0; 2];
    scaler.scale(&[3.0, 4.0], &mut out);
    assert_eq!(out, [1.0, 2.0]);
    let mut chained = small();
    chained.about.scaler.minus = vec![None, Some(2), Some(0)];
    let error = chained.save().unwrap_err().to_string();
    assert!(error.contains("input 2 is subtracted from another"), "{error}");
}

#[test]
fn exact_normal_scores_stand_behind_the_scaled_features_and_are_of_differences_too() {
    let scores = |from: f64| NormalScores { at: vec![from, from + 2.0], score: vec![-1.0, 1.0], unseen: None };
    let (mean, scale) = (vec![1.0, 0.5], vec![2.0, 0.25]);
    let scores = vec![scores(2.0), NormalScores { unseen: Some(-3.5), ..scores(0.0) }];
    let scaler = Scaler { minus: vec![None, Some(0)], mean, scale, clip: 8.0, scores };
    assert_eq!(scaler.inputs(), 4);
    let mut out = [0.0; 4];
    scaler.scale(&[3.0, 3.5], &mut out);
    assert_eq!(out, [1.0, 0.0, 0.0, -0.5]);
    scaler.scale(&[30.0, -1.0], &mut out);
    assert_eq!(out, [8.0, -8.0, 1.0, -1.0]);
    // A neighbour at the cell's own height.
    scaler.scale(&[3.0, 3.0], &mut out);
    assert_eq!(out, [1.0, -2.0, 0.0, -3.5]);
    scaler.scale(&[f32::NAN, 0.0], &mut out);
    assert!(out.iter().all(|x| x.is_nan()));
}

#[test]
fn extreme_a_network_and_scores_that_do_not_fit_are_refused_by_name() {
    let changed = |change: &dyn Fn(&mut Model)| {
        let mut model = scored(1, &["a", "b"], &[3], true);
        change(&mut model);
        model.save().unwrap_err().to_string()
    };
    let error = changed(&|model| {
        model.about.scaler.scores.pop();
    });
    assert!(error.contains("4 inputs, but 2 features and normal scores of 1"), "{error}");
    let error = changed(&|model| model.about.scaler.scores.clear());
    assert!(error.contains("4 inputs, but 2 features and normal scores of 0"), "{error}");
    let error = changed(&|model| model.about.scaler.scores[1].score[0] = 9.0);
    assert!(error.contains("do not rise within the clip"), "{error}");
}

#[test]
fn equal_rows_together_and_one_by_one() {
    let scored = scored(2, &["a", "b", "c"], &[4], true);
    for model in [small(), with_neurons(Activation::Both, scored.clone()), scored] {
        // More than a chunk, and a part of one.
        let rows: Vec<f32> = (0..4500).map(|k| math::sin(f64::from(k)) as f32 * 5.0).collect();
        let together = model.outputs(&rows);
        assert_eq!(together, model.outputs_in_parallel(&rows));
        let apart: Vec<f64> = rows.chunks_exact(3).map(|row| model.output(row)).collect();
        assert_eq!(together, apart);
        assert!(together.iter().all(|y| (0.0..=1.0).contains(y)));
    }
}

#[test]
fn equal_a_model_and_its_file_read_back() {
    let plain = [(1, true), (1, false), (3, true)].map(|(members, bias)| ensemble(members, &["b", "a"], &[3], bias));
    let others = [
        scored(2, &["b", "a"], &[3], true),
        with_neurons(Activation::Both, ensemble(2, &["b", "a"], &[3], true)),
        with_neurons(Activation::Relu, small()),
    ];
    for (number, mut original) in plain.into_iter().chain(others).enumerate() {
        original.network.weights[0] = 1.0 / 3.0;
        original.about.calibration.as_mut().unwrap().edge = [0.01, 1e-4][number % 2];
        original.about.thresholds = vec![0.1 + 0.2, 0.7];
        original.about.cells.max_range_m = Some(10.0);
        let bytes = original.save().unwrap();
        let back = Model::load(&bytes).unwrap();
        assert_eq!(back.sha256.as_deref(), Some(crate::corpus::sha256(&bytes).as_str()));
        assert_eq!(Model { sha256: None, ..back.clone() }, original);
        assert_eq!(back.save().unwrap(), bytes);
    }
}

#[test]
fn law_the_metadata_is_one_key_of_sorted_json() {
    let bytes = small().save().unwrap();
    let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let metadata = header.metadata().clone().unwrap();
    assert_eq!(metadata.keys().collect::<Vec<_>>(), ["marsyard"]);
    let value: serde_json::Value = serde_json::from_str(&metadata["marsyard"]).unwrap();
    let keys: Vec<&String> = value.as_object().unwrap().keys().collect();
    assert!(keys.is_sorted(), "{keys:?}");
    let inner: Vec<&String> = value["sensor"].as_object().unwrap().keys().collect();
    assert!(inner.is_sorted(), "{inner:?}");
}

#[test]
fn exact_inputs_are_found_by_name_and_missing_ones_are_named() {
    let model = small();
    let columns = ["point_count", "x", "mean_height_m", "height_difference_m"];
    assert_eq!(model.inputs_of(&columns).unwrap(), [2, 3, 0]);
    let error = model.inputs_of(&["mean_height_m"]).unwrap_err().to_string();
    assert!(error.contains("height_difference_m, point_count, which the data does not have"), "{error}");
}

#[test]
fn extreme_another_cell_size_is_refused_with_both() {
    let model = small();
    model.check_cell_size(0.1).unwrap();
    let error = model.check_cell_size(0.25).unwrap_err().to_string();
    assert!(error.contains("cells of 0.1 m, the data has cells of 0.25 m"), "{error}");
}

#[test]
fn exact_every_flipped_byte_of_a_model_is_refused() {
    let mut bytes = model(&["a"], &[1], true).save().unwrap();
    for at in 0..bytes.len() {
        for mask in [1, 0x20, 0x80, 0xff] {
            bytes[at] ^= mask;
            assert!(Model::load(&bytes).is_err(), "byte {at} by {mask}");
            bytes[at] ^= mask;
        }
    }
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    let error = Model::load(&bytes).unwrap_err().to_string();
    assert!(error.contains("damaged") && error.contains("--resume"), "{error}");
}

#[test]
fn equal_models_of_the_format_without_a_checksum_are_still_read_and_written() {
    let mut before = small();
    (before.about.marsyard_model, before.about.run) = (1, None);
    let bytes = before.save().unwrap();
    let text = with_metadata(Some(&before.about.to_json()));
    assert_eq!(bytes, text, "no checksum, no run");
    assert_eq!(Model { sha256: None, ..Model::load(&bytes).unwrap() }, before);
}

/// The file with another metadata text (or none), all else as it was: of format 1, which has no checksum to be refused by.
fn with_metadata(text: Option<&str>) -> Vec<u8> {
    let model = small();
    let bytes = model.save().unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let metadata = text.map(|text| std::collections::HashMap::from([("marsyard".to_string(), text.to_string())]));
    safetensors::serialize(tensors.tensors(), metadata).unwrap()
}

/// The metadata of a model of format 1; that had logistic neurons alone, but of others it has no checksum either.
fn unchecked(activation: Activation) -> String {
    let mut about = small().about;
    (about.marsyard_model, about.run, about.activation) = (1, None, activation);
    about.to_json()
}

#[test]
fn extreme_foreign_files_are_refused_with_the_cure() {
    let foreign: [&[u8]; 4] = [b"", b"PAR1", &[0xff; 64], &with_metadata(None)];
    for bytes in foreign {
        let error = Model::load(bytes).unwrap_err().to_string();
        assert!(error.contains("not a marsyard model") && error.contains("model.safetensors"), "{error}");
    }
    let format = |version: u32| format!("\"marsyard_model\":{version}");
    let newer = small().about.to_json().replace(&format(MODEL_FORMAT), &format(MODEL_FORMAT + 1));
    let error = Model::load(&with_metadata(Some(&newer))).unwrap_err().to_string();
    let says = format!("format {}, this marsyard reads formats 1 to {MODEL_FORMAT}", MODEL_FORMAT + 1);
    assert!(error.contains(&says), "{error}");
    let whole = small().save().unwrap();
    for end in 0..whole.len() {
        assert!(Model::load(&whole[..end]).is_err(), "cut at {end}");
    }
}

#[test]
fn extreme_contradictions_are_refused_by_name() {
    let json = unchecked(Activation::Logistic);
    let changed = |from: &str, to: &str| {
        assert!(json.contains(from), "{from} in {json}");
        Model::load(&with_metadata(Some(&json.replace(from, to)))).unwrap_err().to_string()
    };
    for (from, to, word) in [
        ("\"hidden\":[4,2]", "\"hidden\":[4,3]", "tensor 'layers.1'"),
        ("\"hidden\":[4,2]", "\"hidden\":[18446744073709551615,18446744073709551615]", "tensor 'layers.0'"),
        ("\"hidden\":[4,2]", "\"hidden\":[4,2,2]", "3 tensors for 1 members of 4 layers"),
        ("\"hidden\":[4,2]", "\"hidden\":[4,2],\"members\":2", "3 tensors for 2 members of 3 layers"),
        ("\"hidden\":[4,2]", "\"hidden\":[4,2],\"members\":0", "3 tensors for 0 members"),
        (
            "\"hidden\":[4,2]",
            "\"hidden\":[4,2],\"members\":18446744073709551615",
            "3 tensors for 18446744073709551615 members",
        ),
        ("\"inputs\":3", "\"inputs\":0", "without neurons"),
        ("\"clip\":8.0", "\"clip\":0.0", "clipped to 0"),
        ("\"targets\":[0.1,0.9]", "\"targets\":[0.9,0.1]", "targets"),
        ("\"thresholds\":[0.5]", "\"thresholds\":[]", "thresholds"),
        ("\"thresholds\":[0.5]", "\"thresholds\":[0.5,0.2]", "thresholds"),
        ("\"thresholds\":[0.5]", "\"thresholds\":[0.5,0.5]", "thresholds [0.5, 0.5] are not 1 to 16 rising numbers"),
        ("\"slope\":1.5", "\"slope\":1e300", "a calibration of slope"),
        ("\"edge\":0.0001", "\"edge\":0.0", "an edge of 0"),
        ("\"edge\":0.0001", "\"edge\":0.5", "an edge of 0.5"),
        ("[0.5,0.05,0.03]", "[0.5,0.005,0.03]", "thresholds of the validation scenes"),
        ("\"point_count\"", "\"mean_height_m\"", "named twice"),
        ("\"size_m\":0.1", "\"size_m\":-1.0", "its cells"),
        ("\"bias\":true", "\"bais\":true", "unknown field"),
        ("[0.5,0.75,1.0]", "[0.5,0.0,1.0]", "scale that is not positive"),
        ("[0.0,0.1,0.2]", "[0.0,0.1]", "3 features, but scaling or quantiles of 2"),
    ] {
        let error = changed(from, to);
        assert!(error.contains(word), "{from} -> {to}: {error}");
    }
    let mut broken = small();
    broken.network.weights[5] = f64::NAN;
    assert!(broken.save().unwrap_err().to_string().contains("weight 5 is NaN"));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// What loads is a model that works; nothing panics.
    #[test]
    fn extreme_random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(Model::load(&bytes).is_err());
    }

    #[test]
    fn extreme_changed_files_are_refused_or_still_models(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        x in prop::array::uniform3(any::<f32>()),
        activation in prop::sample::select(vec![Activation::Logistic, Activation::Relu]),
    ) {
        let mut bytes = with_metadata(Some(&unchecked(activation)));
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok(model) = Model::load(&bytes) {
            let y = model.output(&x);
            prop_assert!((0.0..=1.0).contains(&y) || x.iter().any(|v| v.is_nan()), "{}", y);
        }
    }

    /// Numbers in the metadata swapped for hostile ones: refused, or sane.
    #[test]
    fn extreme_hostile_numbers_in_the_metadata_never_panic(
        at in any::<prop::sample::Index>(),
        pick in 0usize..8,
        activation in prop::sample::select(vec![Activation::Logistic, Activation::Relu]),
    ) {
        let hostile = ["1e308", "-1e308", "1e-320", "18446744073709551615", "-1", "[]", "null", "0"][pick];
        let json = unchecked(activation);
        let starts: Vec<usize> = json
            .char_indices()
            .filter(|(i, c)| c.is_ascii_digit() && json[..*i].ends_with([':', '[', ',']))
            .map(|(i, _)| i)
            .collect();
        let start = starts[at.index(starts.len())];
        let end = start + json[start..].find([',', ']', '}']).unwrap_or(0);
        let text = format!("{}{hostile}{}", &json[..start], &json[end..]);
        if let Ok(model) = Model::load(&with_metadata(Some(&text))) {
            let y = model.output(&[1.0, -2.0, 3.0]);
            prop_assert!((0.0..=1.0).contains(&y), "{} gives {}", text, y);
        }
    }
}

#[test]
fn extreme_a_weight_beyond_reason_is_a_fault_that_names_it() {
    for bad in [f64::MAX, -f64::MAX, f64::INFINITY, f64::NAN] {
        let mut model = model(&["a", "b"], &[2], true);
        assert_eq!(model.fault(), None);
        model.network.weights[3] = bad;
        let fault = model.fault().expect("a fault");
        assert!(fault.starts_with("weight 3 is "), "{fault}");
    }
    // Of neurons without a bound less is beyond reason; what is not leaves the deepest of networks a number, where sums of both signs meet.
    let deep = |layers: usize, size: f64| {
        let mut deep = with_neurons(Activation::Relu, model(&["a", "b"], &vec![2; layers], true));
        deep.network.weights.fill(size);
        let last = deep.network.weights.len() - 2;
        deep.network.weights[last] = -size;
        deep
    };
    assert_eq!(deep(8, 1e20).fault(), None);
    assert!(!deep(8, 1e20).output(&[1e30, 1e30]).is_nan());
    assert!(deep(8, 1e100).output(&[1e30, 1e30]).is_nan());
    assert!(deep(8, 1.1e20).fault().is_some_and(|fault| fault.starts_with("weight 0 is ")));
    assert!(deep(9, 1.0).fault().is_some_and(|fault| fault.starts_with("9 hidden layers of rectified neurons")));
}

#[test]
fn exact_an_overhang_rule_that_a_model_never_learnt_is_told_and_the_file_keeps_all_heights() {
    let mut model = model(&["mean_height_m"], &[2], true);
    assert_eq!(model.other_overhang(None), None);
    let told = model.other_overhang(Some(0.8)).unwrap();
    assert!(told.starts_with("the model learnt cells with all that hangs over them"), "{told}");
    assert!(told.ends_with("train on a corpus with `cells.overhang`"), "{told}");
    model.about.overhangs_m = vec![Some(0.6), Some(0.9)];
    let again = Model::load(&model.save().unwrap()).unwrap();
    assert_eq!(again.about.overhangs_m, model.about.overhangs_m);
    assert_eq!([0.6, 0.7, 0.9].map(|m| again.other_overhang(Some(m))), [None, None, None]);
    let told = again.other_overhang(None).unwrap();
    assert!(told.contains("without what hangs over 0.6 m of free height, and these hold it"), "{told}");
    let told = again.other_overhang(Some(1.5)).unwrap();
    assert!(told.contains("0.6 to 0.9 m") && told.ends_with("`cells.overhang: {above_m: 1.5}`"), "{told}");
    // One that learnt both with and without it is at home in both.
    model.about.overhangs_m = vec![None, Some(0.6)];
    assert_eq!([None, Some(0.6)].map(|m| model.other_overhang(m)), [None, None]);
    model.about.overhangs_m = vec![Some(-1.0)];
    assert!(model.fault().is_some());
}

#[test]
fn exact_the_rule_of_labels_is_kept_and_another_is_told() {
    let mut model = model(&["mean_height_m"], &[2], true);
    let taller = |height_m| LabelRule { obstacle: Obstacle::TallerThanWheel(height_m), ..LabelRule::default() };
    assert_eq!(model.other_labels(Some(&taller(0.1))), None);
    model.about.labels = Some(taller(0.2));
    let again = Model::load(&model.save().unwrap()).unwrap();
    assert_eq!(again.about.labels, model.about.labels);
    assert_eq!(again.other_labels(Some(&taller(0.2))), None);
    let told = again.other_labels(None).unwrap();
    assert!(
        told.contains("judged by the corpus's own labels: --labels '{\"obstacle\":{\"taller_than_wheel\":0.2}"),
        "{told}"
    );
    assert!(again.other_labels(Some(&taller(0.1))).unwrap().contains("is judged by another rule"));
    let as_height = LabelRule { obstacle: Obstacle::TallerThanM(0.2), ..LabelRule::default() };
    assert_eq!(again.other_labels(Some(&as_height)), None);
    model.about.labels = Some(taller(-1.0));
    assert!(model.fault().is_some_and(|fault| fault.starts_with("its labels: ")));
}

#[test]
fn exact_a_model_reaches_as_far_as_the_farthest_family_that_it_learnt_from() {
    let mut model = model(&["mean_height_m"], &[2], true);
    assert_eq!(model.about.reaches_m(), model.about.sensor.max_range_m);
    model.about.cells.max_range_m = Some(3.0);
    assert_eq!(model.about.reaches_m(), 3.0);
    model.about.reach_m = Some(15.0);
    assert_eq!(Model::load(&model.save().unwrap()).unwrap().about.reaches_m(), 15.0);
    for wrong_m in [-1.0, 0.0, f64::NAN, 1e100] {
        model.about.reach_m = Some(wrong_m);
        assert!(model.fault().is_some_and(|fault| fault.starts_with("a reach that")), "{wrong_m}");
    }
}

#[test]
fn exact_a_frame_that_a_model_never_learnt_is_told_and_the_file_keeps_both() {
    let mut model = model(&["mean_height_m"], &[2], true);
    assert_eq!(model.other_frame(CellFrame::EstimatedPose), None);
    let told = model.other_frame(CellFrame::FittedPlane).unwrap();
    assert!(
        told.starts_with("the model learnt cells of the frame estimated_pose, and these are of the frame fitted_plane")
    );
    assert!(told.ends_with("train on a corpus with `cells.frame: fitted_plane`"), "{told}");
    model.about.frames = vec![CellFrame::EstimatedPose, CellFrame::FittedPlane];
    let again = Model::load(&model.save().unwrap()).unwrap();
    assert_eq!(again.about.frames, model.about.frames);
    assert_eq!(again.other_frame(CellFrame::FittedPlane), None);
}
