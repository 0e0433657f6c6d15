//! The network against hand arithmetic, central differences and itself.

use super::neuron::logistic;
use super::*;
use crate::extremes::{Family, row};
use crate::math;
use crate::random::Stage;

fn network(inputs: usize, hidden: &[usize], bias: bool, seed: u64) -> Network {
    ensemble(1, inputs, hidden, bias, seed)
}

fn ensemble(members: usize, inputs: usize, hidden: &[usize], bias: bool, seed: u64) -> Network {
    drawn(Activation::Logistic, members, inputs, hidden, bias, seed)
}

fn drawn(activation: Activation, members: usize, inputs: usize, hidden: &[usize], bias: bool, seed: u64) -> Network {
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    Network::random(Layout { inputs, hidden: hidden.to_vec(), bias, members, activation }, &streams)
}

fn rows(count: usize, inputs: usize) -> Vec<f64> {
    (0..count * inputs).map(|k| 2.0 * math::sin(1.0 + 1.7 * k as f64)).collect()
}

#[test]
fn exact_two_neurons_by_hand() {
    let layout = Layout { inputs: 2, hidden: vec![1], bias: true, members: 1, activation: Activation::Logistic };
    let network = Network { layout, weights: vec![0.5, -0.25, 0.125, 2.0, -1.0] };
    let sigma = |x: f64| 1.0 / (1.0 + math::exp(-x));
    let h = sigma(0.5 * 3.0 - 0.25 * 2.0 + 0.125);
    let y = sigma(2.0 * h - 1.0);
    let mut gradient = [0.0; 5];
    let got = network.gradient(&[3.0, 2.0], &mut Activations::default(), &mut gradient);
    assert!((got - y).abs() < 1e-15);
    let (d, e) = (y * (1.0 - y), h * (1.0 - h));
    for (got, want) in gradient.iter().zip([d * 2.0 * e * 3.0, d * 2.0 * e * 2.0, d * 2.0 * e, d * h, d]) {
        assert!((got - want).abs() < 1e-15, "{got} against {want}");
    }
}

#[test]
fn exact_two_rectified_neurons_by_hand() {
    let layout = Layout { inputs: 2, hidden: vec![2], bias: true, members: 1, activation: Activation::Relu };
    // Sums of 1.125 and of -0.5: the second is silent.
    let network = Network { layout, weights: vec![0.5, -0.25, 0.125, -0.5, 0.25, 0.5, 2.0, 3.0, -1.0] };
    let y = 1.0 / (1.0 + math::exp(-(2.0 * 1.125 - 1.0)));
    let d = y * (1.0 - y);
    let mut gradient = [f64::NAN; 9];
    let got = network.gradient(&[3.0, 2.0], &mut Activations::default(), &mut gradient);
    assert!((got - y).abs() < 1e-15);
    for (got, want) in gradient.iter().zip([d * 6.0, d * 4.0, d * 2.0, 0.0, 0.0, 0.0, d * 1.125, 0.0, d]) {
        assert!((got - want).abs() < 1e-15, "{got} against {want}");
    }
}

#[test]
fn exact_gradients_equal_central_differences() {
    let shapes = [
        (1, &[][..], true),
        (1, &[1], false),
        (1, &[16, 16], true),
        (1, &[3, 7, 2], true),
        (1, &[5, 4], false),
        (3, &[5, 4], true),
    ];
    for (activation, (members, hidden, bias)) in [Activation::Logistic, Activation::Relu, Activation::Both]
        .into_iter()
        .flat_map(|a| shapes.map(|shape| (a, shape)))
    {
        let mut network = drawn(activation, members, 14, hidden, bias, 3);
        let input = rows(1, 14);
        let mut tape = Activations::default();
        let mut gradient = vec![f64::NAN; network.weights.len()];
        network.gradient(&input, &mut tape, &mut gradient);
        for (k, slope) in gradient.iter().enumerate() {
            let w = network.weights[k];
            let h = 1e-4;
            let mut at = |x: f64| {
                network.weights[k] = x;
                network.output(&input, &mut tape)
            };
            // Fourth-order differences: error about h^4 and eps / h.
            let wide = (at(w + 2.0 * h) - at(w - 2.0 * h)) / (4.0 * h);
            let near = (at(w + h) - at(w - h)) / (2.0 * h);
            network.weights[k] = w;
            let want = (4.0 * near - wide) / 3.0;
            assert!((slope - want).abs() < 1e-11, "{activation:?} {hidden:?} weight {k}: {slope} against {want}");
        }
    }
}

#[test]
fn equal_rows_alone_and_among_others_to_the_bit() {
    for (count, members) in [(0, 1), (1, 1), (7, 1), (8, 2), (9, 1), (50, 3)] {
        for network in [ensemble(members, 5, &[6, 3], true, 1), drawn(Activation::Both, members, 5, &[9, 3], true, 3)] {
            let rows = rows(count, 5);
            let mut outputs = vec![0.0; count];
            network.outputs(&rows, &mut outputs);
            let mut tape = Activations::default();
            for (row, output) in rows.chunks(5).zip(&outputs) {
                assert_eq!(network.output(row, &mut tape).to_bits(), output.to_bits());
            }
        }
    }
}

#[test]
fn equal_an_ensemble_and_the_mean_of_its_members_alone() {
    let together = ensemble(3, 5, &[6, 3], true, 1);
    let alone: Vec<Network> = together
        .weights
        .chunks_exact(together.weights.len() / 3)
        .map(|weights| Network { weights: weights.to_vec(), ..network(5, &[6, 3], true, 1) })
        .collect();
    // The first is what the seed draws where there is one; no two are alike.
    assert!(alone[0] == network(5, &[6, 3], true, 1) && alone[0] != alone[1] && alone[1] != alone[2]);
    let mut tape = Activations::default();
    for row in rows(20, 5).chunks(5) {
        let mean = alone.iter().map(|member| member.output(row, &mut tape)).sum::<f64>() / 3.0;
        assert!((together.output(row, &mut tape) - mean).abs() < 1e-15);
    }
}

#[test]
fn equal_a_network_of_both_and_the_mean_of_a_logistic_and_a_rectified_one() {
    let both = drawn(Activation::Both, 3, 5, &[6, 3], true, 3);
    let size = both.weights.len() / 3;
    let kinds = [Activation::Logistic, Activation::Relu, Activation::Logistic];
    let alone = |(member, activation): (usize, Activation)| Network {
        weights: both.weights[member * size..][..size].to_vec(),
        layout: Layout { members: 1, activation, ..both.layout.clone() },
    };
    let alone: Vec<Network> = kinds.into_iter().enumerate().map(alone).collect();
    let mut tape = Activations::default();
    for row in rows(20, 5).chunks(5) {
        let mean = alone.iter().map(|member| member.output(row, &mut tape)).sum::<f64>() / 3.0;
        assert!((both.output(row, &mut tape) - mean).abs() < 1e-15);
    }
    assert_eq!(
        drawn(Activation::Both, 1, 5, &[6], true, 3).weights,
        drawn(Activation::Logistic, 1, 5, &[6], true, 3).weights
    );
}

#[test]
fn equal_instruction_sets_give_the_same_bits() {
    instruction_sets_give_the_same_bits(&network(14, &[16, 9], true, 1));
    instruction_sets_give_the_same_bits(&drawn(Activation::Relu, 2, 14, &[16, 9], true, 3));
}

fn instruction_sets_give_the_same_bits(network: &Network) {
    let input = rows(1, 14);
    let run = |isa: Isa| {
        let mut gradient = vec![0.0; network.weights.len()];
        let mut tape = Activations::default();
        let kernel = Gradient { network, inputs: &input, tape: &mut tape, gradient: &mut gradient };
        let output = isa.run(kernel);
        (output.to_bits(), gradient.iter().map(|g| g.to_bits()).collect::<Vec<_>>())
    };
    let want = run(Isa::PORTABLE);
    assert!(Isa::available().all(|isa| run(isa) == want));
    // Many rows at once, a last portion that is not full among them.
    let inputs = rows(333, 14);
    let many = |isa: Isa| {
        let mut outputs = vec![0.0; 333];
        isa.run(NetworkBatch { network, rows: &inputs, outputs: &mut outputs });
        outputs.iter().map(|y| y.to_bits()).collect::<Vec<_>>()
    };
    let want = many(Isa::PORTABLE);
    assert!(Isa::available().all(|isa| many(isa) == want));
}

#[test]
fn extreme_arguments_saturate_without_nan() {
    for (x, y) in [(1e4, 1.0), (-1e4, 0.0), (f64::INFINITY, 1.0), (f64::NEG_INFINITY, 0.0), (0.0, 0.5)] {
        assert_eq!(logistic(&[x]), [y]);
    }
    let mut network = network(3, &[4], true, 1);
    network.weights.iter_mut().for_each(|w| *w *= 1e6);
    let mut gradient = vec![f64::NAN; network.weights.len()];
    let output = network.gradient(&[1e4, -1e4, 1e3], &mut Activations::default(), &mut gradient);
    assert!((0.0..=1.0).contains(&output) && gradient.iter().all(|g| g.is_finite()));
    let up = math::exp(1e4);
    let (value, slope) = (up / (1.0 + up), up / ((1.0 + up) * (1.0 + up)));
    assert!(value.is_nan() && slope.is_nan());
    row(
        Family::Filters,
        "sigmoid of 1e4 and of -1e4",
        &format!("exp(x) / (1 + exp(x)) at 1e4: {value}; its slope exp(-x) / (1 + exp(-x))^2 at -1e4: {slope}"),
        "1 and 0, exactly; every slope of the network finite",
    );
}

#[test]
fn law_initial_weights_fill_their_interval_layer_by_layer() {
    let network = network(15, &[200, 3], false, 9);
    let (first, second) = network.weights.split_at(15 * 200);
    let he = drawn(Activation::Relu, 1, 15, &[200, 3], false, 3);
    let (of_inputs, of_values) = he.weights.split_at(15 * 200);
    for (layer, bound) in [
        (first, 1.5 / 4.0),
        (&second[..600], 1.5 / f64::sqrt(201.0)),
        (of_inputs, f64::sqrt(6.0) / 4.0),
        (&of_values[..600], f64::sqrt(6.0 / 201.0)),
    ] {
        let largest = layer.iter().fold(0.0, |m: f64, w| m.max(w.abs()));
        assert!(largest < bound && largest > 0.95 * bound, "{largest} of {bound}");
        let variance = layer.iter().map(|w| w * w).sum::<f64>() / layer.len() as f64;
        // Uniform: bound^2 / 3; 4 standard errors of 600 draws are 15 %.
        assert!((3.0 * variance / (bound * bound) - 1.0).abs() < 0.15, "{variance}");
    }
}

#[test]
fn exact_numbers_of_weights() {
    let weights = |inputs, hidden: &[usize], bias| {
        Layout { inputs, hidden: hidden.to_vec(), bias, members: 1, activation: Activation::Logistic }.weights()
    };
    assert_eq!(weights(14, &[16, 16], true), 529);
    assert_eq!(weights(14, &[32, 32], true), 1569);
    assert_eq!(weights(14, &[32, 32, 32], true), 2625);
    assert_eq!(weights(14, &[16, 16], false), 14 * 16 + 16 * 16 + 16);
    assert_eq!(
        Layout { inputs: 14, hidden: vec![16, 16], bias: true, members: 3, activation: Activation::Logistic }.weights(),
        3 * 529
    );
}

#[test]
fn equal_outputs_in_f32_and_in_f64_and_of_rows_alone_and_among_others() {
    for (members, inputs, hidden, bias) in [
        (2, 23, &[64, 64][..], true),
        (1, 19, &[16, 16], true),
        (1, 5, &[6, 3], false),
        (3, 33, &[17], true),
        (1, 4, &[], true),
        (1, 16, &[32, 5], false),
    ] {
        let both = drawn(Activation::Both, members, inputs, hidden, bias, 3);
        for network in [ensemble(members, inputs, hidden, bias, 7), both] {
            let rows = rows(150, inputs);
            let [mut exact, mut outputs] = [(); 2].map(|()| vec![0.0; 150]);
            network.outputs(&rows, &mut exact);
            let forward = forward::NetworkIn::F32(forward::NetworkF32::new(&network));
            forward.outputs(&rows, &mut outputs);
            for (row, (output, exact)) in outputs.iter().zip(&exact).enumerate() {
                assert!((output - exact).abs() < 2e-6, "{hidden:?}: {output} {exact}");
                let mut alone = [0.0];
                forward.outputs(&rows[row * inputs..(row + 1) * inputs], &mut alone);
                assert_eq!(alone[0].to_bits(), output.to_bits());
            }
        }
    }
}

#[test]
fn extreme_huge_rows_and_weights_saturate_in_f32_and_nan_stays() {
    let layout = Layout { inputs: 2, hidden: vec![3], bias: true, members: 1, activation: Activation::Logistic };
    let mut network = Network { layout, weights: vec![1e30; 13] };
    // The hidden neurons are nought, and the bias of the output alone speaks.
    network.weights[12] = -1e30;
    let forward = forward::NetworkF32::new(&network);
    let mut outputs = [f64::NAN; 2];
    forward::NetworkIn::F32(forward).outputs(&[-1e8, -1e8, f64::NAN, 0.0], &mut outputs);
    assert!(outputs[0] < 1e-37 && outputs[1].is_nan(), "{outputs:?}");
    // Rectified neurons are nought there, too; and no number stays none.
    network.layout.activation = Activation::Relu;
    let forward = forward::NetworkIn::F32(forward::NetworkF32::new(&network));
    forward.outputs(&[-1e8, -1e8, f64::NAN, 0.0], &mut outputs);
    assert!(outputs[0] < 1e-37 && outputs[1].is_nan(), "{outputs:?}");
    let mut exact = [f64::NAN; 2];
    network.outputs(&[-1e8, -1e8, f64::NAN, 0.0], &mut exact);
    assert!(exact[0] < 1e-37 && exact[1].is_nan(), "{exact:?}");
}
