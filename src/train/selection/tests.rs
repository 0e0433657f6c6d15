//! Which rows are learnt: probabilities, expectations, and the same bits wherever a portion begins.

use super::*;
use crate::train::Network;
use crate::train::filter::build;
use crate::train::network::Activations;
use crate::train::params::EkfParams;
use crate::train::{Activation, Layout, TrainParams};

fn selection(full_error: f64, floor: f64, seed: u64) -> Selection {
    let rows = RowsLearnt::ByError(ByErrorParams { full_error, floor });
    Selection::of(&FilterParams::Ekf(EkfParams { rows, ..EkfParams::default() }), seed).unwrap()
}

/// The places chosen of all rows, and the noise of each of these.
fn chosen(selection: &mut Selection, first: u64, errors: &[f64]) -> (Vec<usize>, Vec<f64>) {
    let (mut noise, mut places) = (vec![1.0; errors.len()], Vec::new());
    selection.select(first, errors, &mut noise, &mut places);
    let of_places = places.iter().map(|&place| noise[place]).collect();
    (places, of_places)
}

#[test]
fn exact_probabilities_are_linear_between_the_floor_and_one() {
    let selection = selection(0.2, 0.05, 1);
    for (error, p) in [(0.0, 0.05), (0.009, 0.05), (-0.1, 0.5), (0.15, 0.75), (0.2, 1.0), (-0.9, 1.0)] {
        assert!((selection.probability(error) - p).abs() < 1e-15, "{error}");
    }
}

#[test]
fn extreme_errors_that_are_no_number_are_handed_on_and_floors_of_one_choose_all() {
    let errors = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 0.0, -0.0, 1e-300];
    let (places, noise) = chosen(&mut selection(0.2, 1e-6, 1), 0, &errors);
    assert_eq!((&places[..4], &noise[..4]), (&[0, 1, 2, 3][..], &[1.0; 4][..]));
    let (places, noise) = chosen(&mut selection(0.2, 1.0, 1), 0, &errors);
    assert_eq!((places, noise), ((0..errors.len()).collect(), vec![1.0; errors.len()]));
}

#[test]
fn dist_gradient_and_information_have_the_expectation_of_every_row() {
    let layout = Layout { inputs: 2, hidden: vec![3], bias: true, members: 1, activation: Activation::Logistic };
    let streams = Streams { seed: 3, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    let network = Network::random(layout, &streams);
    let (rows, size, seeds) = (60, network.weights.len(), 4000_u32);
    let mut inputs = vec![0.0; 2 * rows];
    streams.open(Purpose::GroundNoise).fill_normal(0, &mut inputs);
    // Of each row, its part of the gradient and of the information's diagonal; errors from almost nothing to more than `full_error`.
    let errors: Vec<f64> = (0..rows).map(|row| (row as f64 - 20.0) * 0.01).collect();
    let mut parts = Vec::new();
    for (row, error) in inputs.chunks_exact(2).zip(&errors) {
        let mut slopes = vec![0.0; size];
        network.gradient(row, &mut Activations::default(), &mut slopes);
        parts.push(slopes.iter().map(|b| b * error).chain(slopes.iter().map(|b| b * b)).collect::<Vec<f64>>());
    }
    let mut sums = vec![0.0; 2 * size];
    for seed in 0..seeds {
        let (places, noise) = chosen(&mut selection(0.2, 0.05, u64::from(seed)), 0, &errors);
        for (place, r) in places.into_iter().zip(noise) {
            sums.iter_mut().zip(&parts[place]).for_each(|(sum, part)| *sum += part / r);
        }
    }
    let rule = selection(0.2, 0.05, 0);
    for (k, sum) in sums.iter().enumerate() {
        let every: f64 = parts.iter().map(|part| part[k]).sum();
        // A row adds x / p with probability p: the variance is x^2 (1 - p) / p. Five standard errors: 38 sums, one failure in 50,000.
        let variance: f64 = parts
            .iter()
            .zip(&errors)
            .map(|(part, &error)| part[k] * part[k] * (1.0 / rule.probability(error) - 1.0))
            .sum();
        let off = (sum / f64::from(seeds) - every).abs();
        assert!(off < 5.0 * (variance / f64::from(seeds)).sqrt(), "{k}: {off} beside {every}");
    }
}

#[test]
fn equal_draws_wherever_a_portion_begins() {
    let errors: Vec<f64> = (0..500).map(|row| f64::from(row % 23) * 0.01).collect();
    let (whole, noise) = chosen(&mut selection(0.2, 0.05, 7), 1000, &errors);
    assert!(whole.len() > 100 && whole.len() < 400);
    for cut in [1, 3, 255, 256, 499] {
        let mut parts = selection(0.2, 0.05, 7);
        let (mut places, mut of_places) = chosen(&mut parts, 1000, &errors[..cut]);
        let (after, of_after) = chosen(&mut parts, 1000 + cut as u64, &errors[cut..]);
        places.extend(after.iter().map(|place| place + cut));
        of_places.extend(of_after);
        assert_eq!((&places, &of_places), (&whole, &noise), "{cut}");
    }
    assert_ne!(chosen(&mut selection(0.2, 0.05, 8), 1000, &errors).0, whole);
    assert_ne!(chosen(&mut selection(0.2, 0.05, 7), 1500, &errors).0, whole);
}

#[test]
fn equal_the_kalman_filter_has_a_selection_and_every_row_or_another_filter_none() {
    let of = |set: &str| {
        let params: TrainParams = crate::config::load_train(None, &[set.to_string()]).unwrap();
        build(&params.filter, &params.layout(3), params.clip).unwrap();
        Selection::of(&params.filter, 1).is_some()
    };
    assert!(of("filter={ekf: {}}") && of("filter={ekf: {robust: true}}"));
    assert!(
        !of("seed=1") && !of("filter.ekf.rows=every") && !of("filter={decoupled: {}}") && !of("filter={backprop: {}}")
    );
}
