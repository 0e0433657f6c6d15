//! What may go wrong: rows, settings, states and covariances that cannot be used.

use super::*;

#[test]
fn equal_restored_filters_go_on_to_the_same_bits() {
    for params in all() {
        let (mut network, inputs, targets, noise) = case(60);
        let mut filter = build(&params, &network.layout).unwrap();
        // 41 rows: an odd number of passes, a batch that is not full, and updates that are not in the triangle yet.
        filter.learn(&mut network, &inputs[..41 * 8], &targets[..41], &noise[..41]);
        let (mut copy, state) = (network.clone(), filter.state());
        filter.learn(&mut network, &inputs[41 * 8..], &targets[41..], &noise[41..]);
        let mut other = build(&params, &copy.layout).unwrap();
        other.learn(&mut copy.clone(), &inputs[..8], &targets[..1], &noise[..1]);
        other.restore(&state).unwrap();
        assert_eq!(other.state(), state, "{params:?}");
        other.learn(&mut copy, &inputs[41 * 8..], &targets[41..], &noise[41..]);
        assert_eq!(bits(&network.weights), bits(&copy.weights), "{params:?}");
        assert_eq!(other.state(), filter.state());
        assert_eq!(other.counters().updates, 60);
    }
}

#[test]
fn extreme_states_of_other_filters_and_sizes_are_refused() {
    let (network, ..) = case(1);
    let state = |params: &FilterParams, layout: &Layout| build(params, layout).unwrap().state();
    let small = Layout { inputs: 3, hidden: vec![2], bias: true, members: 1, activation: Activation::Logistic };
    let all = all();
    for (k, params) in all.iter().enumerate() {
        let mut filter = build(params, &network.layout).unwrap();
        if !matches!(params, FilterParams::Backprop(_)) {
            assert!(matches!(filter.restore(&state(params, &small)), Err(FilterError::OtherSize { .. })));
        }
        let other = &all[(k + 2) % all.len()];
        assert!(matches!(filter.restore(&state(other, &network.layout)), Err(FilterError::OtherKind { .. })));
    }
}

#[test]
fn extreme_rows_that_are_not_finite_are_counted_and_not_learnt() {
    let (start, mut inputs, mut targets, mut noise) = case(40);
    inputs[5 * 8 + 3] = f64::NAN;
    inputs[9 * 8] = f64::INFINITY;
    targets[12] = f64::NAN;
    noise[20] = 0.0;
    noise[21] = f64::INFINITY;
    let bad = [5, 9, 12, 20, 21];
    let clean: Vec<usize> = (0..40).filter(|k| !bad.contains(k)).collect();
    let clean_inputs: Vec<f64> = clean.iter().flat_map(|&k| inputs[k * 8..][..8].to_vec()).collect();
    let pick = |from: &[f64]| clean.iter().map(|&k| from[k]).collect::<Vec<f64>>();
    for params in all() {
        let (mut network, mut other) = (start.clone(), start.clone());
        let mut filter = build(&params, &start.layout).unwrap();
        filter.learn(&mut network, &inputs, &targets, &noise);
        assert_eq!(filter.counters(), Counters { updates: 35, rejected: 5, ..Counters::default() }, "{params:?}");
        build(&params, &start.layout).unwrap().learn(&mut other, &clean_inputs, &pick(&targets), &pick(&noise));
        assert_eq!(bits(&network.weights), bits(&other.weights), "{params:?}");
    }
}

/// All filters stay sound on rows that were changed, and learn or reject each.
fn stays_finite(change: impl Fn(&mut [f64])) {
    let (start, mut inputs, targets, noise) = case(400);
    inputs.chunks_mut(8).for_each(change);
    for params in all() {
        let mut network = start.clone();
        let mut filter = build(&params, &network.layout).unwrap();
        filter.learn(&mut network, &inputs, &targets, &noise);
        assert!(network.weights.iter().all(|w| w.is_finite()), "{params:?}");
        let counters = filter.counters();
        assert_eq!(counters.updates + counters.rejected, 400);
    }
}

#[test]
fn extreme_constant_feature_keeps_weights_finite() {
    stays_finite(|row| row[2] = 1.0);
}

#[test]
fn extreme_duplicated_feature_keeps_weights_finite() {
    stays_finite(|row| row[3] = row[4]);
}

#[test]
fn extreme_features_of_size_1e_minus_8_keep_weights_finite() {
    stays_finite(|row| row.iter_mut().for_each(|x| *x *= 1e-8));
}

#[test]
fn extreme_features_of_size_1e8_keep_weights_finite() {
    stays_finite(|row| row.iter_mut().for_each(|x| *x *= 1e8));
}

#[test]
fn extreme_single_row_repeated_keeps_weights_finite() {
    let row = normals(9, 8);
    stays_finite(|there| there.copy_from_slice(&row));
}

#[test]
fn exact_rows_at_the_clip_are_counted() {
    let (start, mut inputs, targets, noise) = case(40);
    inputs.iter_mut().for_each(|x| *x = x.clamp(-3.0, 3.0));
    (inputs[3 * 8], inputs[3 * 8 + 5], inputs[17 * 8 + 2]) = (8.0, -8.0, -8.0);
    for params in all() {
        let mut filter = build(&params, &start.layout).unwrap();
        filter.learn(&mut start.clone(), &inputs, &targets, &noise);
        assert_eq!(filter.counters().clipped, 2, "{params:?}");
    }
}

#[test]
fn extreme_weights_are_cut_back_and_counted() {
    let (mut network, inputs, targets, _) = case(40);
    let backprop = FilterParams::Backprop(BackpropParams { rate: 1e3 });
    let mut filter = build(&backprop, &network.layout).unwrap();
    filter.learn(&mut network, &inputs, &targets, &[1e-12; 40]);
    let largest = network.weights.iter().fold(0.0, |m: f64, w| m.max(w.abs()));
    assert_eq!(largest, 1e6);
    assert!(filter.counters().cut_back > 0 && filter.counters().updates == 40, "{:?}", filter.counters());
}

/// Puts one value everywhere into a plain covariance.
fn spoil(filter: &mut dyn Filter, value: f64) {
    let mut state = filter.state();
    let covariance = state.arrays.iter_mut().find(|a| a.0 == "covariance").unwrap();
    if covariance.1 == "F32" {
        covariance.3.chunks_mut(4).for_each(|x| x.copy_from_slice(&(value as f32).to_le_bytes()));
    } else {
        covariance.3.chunks_mut(8).for_each(|x| x.copy_from_slice(&value.to_le_bytes()));
    }
    filter.restore(&state).unwrap();
}

#[test]
fn extreme_covariance_that_turned_indefinite_is_rebuilt_before_it_is_used() {
    let (start, inputs, targets, noise) = case(20);
    for params in [ekf(10.0, 0.0, Precision::F32, false, 1), ekf(10.0, 0.0, Precision::F64, false, 4)] {
        for poison in [-1.0, f64::NAN] {
            let mut network = start.clone();
            let mut filter = build(&params, &network.layout).unwrap();
            spoil(filter.as_mut(), poison);
            filter.learn(&mut network, &inputs, &targets, &noise);
            assert_eq!(
                filter.counters(),
                Counters { updates: 20, rebuilt: 1, rebuilt_at: Some(0), ..Counters::default() }
            );
            assert!(network.weights.iter().all(|w| w.is_finite()));
        }
    }
}

#[test]
fn extreme_covariance_that_is_spoilt_twice_goes_on_factored() {
    let (start, inputs, targets, noise) = case(90);
    let part = |from: usize, to: usize| (&inputs[from * 8..to * 8], &targets[from..to], &noise[from..to]);
    for params in [ekf(10.0, 1e-6, Precision::F32, false, 1), ekf(10.0, 0.0, Precision::F64, false, 4)] {
        let mut network = start.clone();
        let mut filter = build(&params, &network.layout).unwrap();
        for (from, to) in [(0, 20), (20, 40)] {
            spoil(filter.as_mut(), -1.0);
            let (x, d, r) = part(from, to);
            filter.learn(&mut network, x, d, r);
        }
        let expected =
            Counters { updates: 40, rebuilt: 2, rebuilt_at: Some(0), factored_at: Some(20), ..Counters::default() };
        assert_eq!(filter.counters(), expected);
        // A checkpoint of the factored form goes on to the same bits in a filter made from the same settings.
        let state = filter.state();
        let (mut copy, mut other) = (network.clone(), build(&params, &network.layout).unwrap());
        other.restore(&state).unwrap();
        assert_eq!(other.state(), state);
        let (x, d, r) = part(40, 90);
        filter.learn(&mut network, x, d, r);
        other.learn(&mut copy, x, d, r);
        assert_eq!(bits(&network.weights), bits(&copy.weights));
        assert_eq!(filter.counters(), Counters { updates: 90, ..expected });
        let factored = filter.state().arrays.iter().any(|a| a.0 == "factor");
        assert!(factored && network.weights.iter().all(|w| w.is_finite()));
    }
}

#[test]
fn extreme_settings_are_refused_with_the_reason() {
    let refusal = |params: &FilterParams, hidden: &[usize]| {
        let layout =
            Layout { inputs: 14, hidden: hidden.to_vec(), bias: true, members: 1, activation: Activation::Logistic };
        build(params, &layout).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(refusal(&ekf(1e6, 0.0, Precision::F32, false, 1), &[4]).contains("robust"));
    assert!(refusal(&ekf(1e6, 0.0, Precision::F32, true, 1), &[4]).is_empty());
    assert!(refusal(&ekf(1e6, 0.0, Precision::F64, false, 1), &[4]).is_empty());
    let ukf = FilterParams::Ukf(UkfParams::default());
    assert!(refusal(&ukf, &[32, 32]).contains("1569 weights"));
    assert!(refusal(&ukf, &[16, 16]).is_empty());
    assert!(refusal(&FilterParams::Ekf(EkfParams::default()), &[4096, 4096]).contains("GiB"));
    assert!(refusal(&FilterParams::Backprop(BackpropParams { rate: 0.1 }), &[4096]).is_empty());
    assert!(refusal(&FilterParams::default(), &[512, 512]).is_empty());
    assert!(refusal(&FilterParams::default(), &[20_000, 20_000]).contains("GiB"));
}

/// n weights of one group take n (n + 1) / 2 numbers; in f64 8 bytes each, in f32 4.
#[test]
fn exact_what_a_covariance_takes_is_what_it_is_refused_for() {
    let layout =
        |hidden| Layout { inputs: 14, hidden: vec![hidden], bias: true, members: 1, activation: Activation::Logistic };
    let decoupled = |groups, precision| {
        FilterParams::Decoupled(DecoupledParams { groups, precision, ..DecoupledParams::default() })
    };
    let by_layer = [15 * 8192_u64, 8193];
    for (precision, element) in [(Precision::F32, 4), (Precision::F64, 8)] {
        let bytes: u64 = by_layer.iter().map(|n| n * (n + 1) / 2 * element).sum();
        let said = build(&decoupled(Groups::Layer, precision), &layout(8192)).err().expect("too large").to_string();
        assert!(said.contains(&format!("takes {} GiB", bytes >> 30)), "{said}");
        assert!(build(&decoupled(Groups::Layer, precision), &layout(64)).is_ok());
    }
}

/// A rebuilt covariance begins from a floor that is a share of P0: so small that a step grows with it in proportion.
#[test]
fn law_the_first_step_after_a_rebuild_grows_with_p0() {
    let (start, inputs, targets, noise) = case(1);
    let step = |p0: f64| {
        let mut network = start.clone();
        let mut filter = build(&ekf(p0, 0.0, Precision::F64, false, 1), &network.layout).unwrap();
        spoil(filter.as_mut(), -1.0);
        filter.learn(&mut network, &inputs, &targets, &noise);
        assert_eq!(filter.counters().rebuilt, 1);
        network.weights.iter().zip(&start.weights).fold(0.0, |most: f64, (w, old)| most.max((w - old).abs()))
    };
    let ratio = step(100.0) / step(10.0);
    assert!((ratio - 10.0).abs() < 0.1, "{ratio}");
}
