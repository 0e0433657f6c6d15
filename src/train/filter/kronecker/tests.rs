//! Products, bases, gradients and steps against plain forms of the same.

use std::collections::BTreeMap;

use super::basis::turn_to_eigenvectors;
use super::gradient::{MicroBatch, Row};
use super::layer::Layer;
use crate::math;
use crate::random::{Purpose, Stage, Streams};
use crate::train::filter::lanes::Isa;
use crate::train::filter::{Counters, FilterState, build};
use crate::train::network::Activations;
use crate::train::network::forward::ForwardWeights;
use crate::train::network::matrix::{Matrix, times, times_transposed, transposed_times};
use crate::train::params::{FilterParams, KroneckerParams};
use crate::train::{Activation, Layout, Loss, Network};

fn normals(seed: u64, count: usize) -> Vec<f64> {
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 2 };
    let mut values = vec![0.0; count];
    streams.open(Purpose::InitialWeights).fill_normal(0, &mut values);
    values
}

fn matrix(seed: u64, rows: usize, columns: usize) -> Matrix {
    let mut matrix = Matrix::zeros(rows, columns);
    matrix.fill(normals(seed, rows * columns).into_iter().map(|x| x as f32));
    matrix
}

fn network(inputs: usize, hidden: &[usize], bias: bool) -> Network {
    drawn(Activation::Logistic, 1, inputs, hidden, bias)
}

fn rectified(inputs: usize, hidden: &[usize], bias: bool) -> Network {
    drawn(Activation::Relu, 1, inputs, hidden, bias)
}

fn drawn(activation: Activation, members: usize, inputs: usize, hidden: &[usize], bias: bool) -> Network {
    let streams = Streams { seed: 5, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    Network::random(Layout { inputs, hidden: hidden.to_vec(), bias, members, activation }, &streams)
}

/// The largest difference of a matrix from what a formula says of each place.
fn furthest(out: &Matrix, wanted: impl Fn(usize, usize) -> f64) -> f64 {
    let places = (0..out.rows).flat_map(|i| (0..out.columns).map(move |j| (i, j)));
    places.map(|(i, j)| (f64::from(out.get(i, j)) - wanted(i, j)).abs()).fold(0.0, f64::max)
}

#[test]
fn equal_products_and_their_sums_written_out_on_every_instruction_set() {
    for (n, k, m) in [(1, 1, 1), (4, 16, 16), (5, 17, 33), (64, 65, 64), (1, 65, 64), (9, 3, 20)] {
        let (a, b, c) = (matrix(1, n, k), matrix(2, k, m), matrix(3, m, k));
        let t = matrix(4, k, n);
        let sum = |x: &dyn Fn(usize) -> f64| (0..k).map(x).sum::<f64>();
        let of = |x: &Matrix, i, j| f64::from(x.get(i, j));
        let mut first = None;
        for isa in Isa::available() {
            let [mut plain, mut left, mut right] = [(); 3].map(|()| Matrix::zeros(n, m));
            times(&a, &b, &mut plain, isa);
            transposed_times(&t, &b, &mut left, isa);
            times_transposed(&a, &c, &mut right, isa);
            assert!(furthest(&plain, |i, j| sum(&|x| of(&a, i, x) * of(&b, x, j))) < 2e-5);
            assert!(furthest(&left, |i, j| sum(&|x| of(&t, x, i) * of(&b, x, j))) < 2e-5);
            assert!(furthest(&right, |i, j| sum(&|x| of(&a, i, x) * of(&c, j, x))) < 2e-5);
            let all = (plain, left, right);
            assert_eq!(first.get_or_insert_with(|| all.clone()), &all, "{isa:?}");
        }
    }
}

#[test]
fn equal_bits_of_gradients_bases_and_steps_on_every_instruction_set() {
    let shapes = [(&[64, 64][..], true), (&[15], true), (&[64, 7], false), (&[], true)];
    for (network, hidden, bias) in shapes.into_iter().flat_map(|(hidden, bias)| {
        [network(23, hidden, bias), rectified(23, hidden, bias)].map(|network| (network, hidden, bias))
    }) {
        let inputs = 23;
        let values = normals(5, 64 * inputs);
        let row = |(k, inputs)| Row { inputs, target: 0.1 + 0.8 * (k % 2) as f64, weight: 1.0 + k as f64 };
        let rows: Vec<Row> = values.chunks(inputs).enumerate().map(row).collect();
        let mut first = None;
        for isa in Isa::available() {
            let layout = &network.layout;
            let mut layers: Vec<Layer> = layout.layers().map(|(i, n)| Layer::new(n, i + usize::from(bias))).collect();
            let mut weights = network.weights.iter().map(|w| *w as f32);
            layers.iter_mut().for_each(|layer| layer.weights.fill(&mut weights));
            let (mut forward, mut micro_batch) = (ForwardWeights::new(layout, 0), MicroBatch::new(layout));
            // Whole micro-batches, and some whose last places are of rows before.
            for (steps, count) in [64, 37, 64, 1].into_iter().enumerate() {
                let of: Vec<&Matrix> = layers.iter().map(|layer| &layer.weights).collect();
                forward.set(of.iter().copied(), isa);
                micro_batch.run(&of, &forward, &rows[64 - count..], Loss::Squared, isa);
                for (layer, gradient) in layers.iter_mut().zip(&micro_batch.gradients) {
                    layer.gradient.change_by(gradient, isa, |x, y| x + y);
                    // Bases are turned at each step.
                    layer.step(count as u64, 10 * steps as u64, 0.02, 0.5, isa);
                }
            }
            let kept = |layer: &Layer| layer.arrays().into_iter().map(|(_, array)| array.clone()).collect::<Vec<_>>();
            let all: Vec<_> = layers.iter().map(kept).collect();
            assert!(all.iter().flatten().flat_map(Matrix::padded).all(|x| x.is_finite()));
            assert!(first.get_or_insert_with(|| all.clone()) == &all, "{hidden:?} {isa:?}");
        }
    }
}

fn far_from_orthonormal(basis: &Matrix) -> f64 {
    let mut products = Matrix::zeros(basis.rows, basis.rows);
    times_transposed(basis, basis, &mut products, Isa::detect());
    furthest(&products, |i, j| f64::from(u8::from(i == j)))
}

#[test]
fn equal_a_basis_turned_often_and_the_eigenvectors_of_nalgebra() {
    let size = 23;
    let root = matrix(7, size, size);
    let mut covariance = Matrix::zeros(size, size);
    // Eigenvalues far enough apart for the order to be clear.
    let mut scaled = root.clone();
    (0..size).for_each(|row| {
        (0..size).for_each(|column| scaled.set(row, column, root.get(row, column) * 0.7_f32.powi(column as i32)))
    });
    times_transposed(&scaled, &scaled, &mut covariance, Isa::detect());
    let dense = nalgebra::DMatrix::from_fn(size, size, |i, j| f64::from(covariance.get(i, j)));
    let eigen = nalgebra::SymmetricEigen::new(dense);
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let (mut basis, mut scratch) = (Matrix::identity(size), Matrix::zeros(size, size));
    (0..300).for_each(|_| turn_to_eigenvectors(&covariance, &mut basis, &mut scratch, Isa::detect()));
    assert!(far_from_orthonormal(&basis) < 2e-6);
    for (place, &column) in order.iter().enumerate().take(6) {
        let along: f64 = (0..size).map(|i| f64::from(basis.get(place, i)) * eigen.eigenvectors[(i, column)]).sum();
        assert!((along.abs() - 1.0).abs() < 1e-4, "vector {place}: {along}");
    }
}

#[test]
fn extreme_a_basis_stays_orthonormal_whatever_the_covariance() {
    let size = 20;
    let ones = |value: f32| {
        let mut all = Matrix::zeros(size, size);
        all.fill(std::iter::repeat_n(value, size * size));
        all
    };
    let mut axis = Matrix::zeros(size, size);
    axis.set(3, 3, 1.0);
    for covariance in [ones(0.0), ones(1.0), ones(1e-38), ones(1e37), axis, Matrix::identity(size)] {
        let (mut basis, mut scratch) = (Matrix::identity(size), Matrix::zeros(size, size));
        for _ in 0..3 {
            turn_to_eigenvectors(&covariance, &mut basis, &mut scratch, Isa::detect());
            assert!(far_from_orthonormal(&basis) < 1e-5);
        }
    }
}

#[test]
fn equal_the_gradient_of_rows_and_the_sum_of_the_networks_own() {
    let shapes = [(&[6, 4][..], true), (&[64, 64], true), (&[15, 17], true), (&[5], false), (&[], true)];
    let (inputs, count) = (23, 37);
    for (network, hidden, bias, loss) in shapes.into_iter().flat_map(|(hidden, bias)| {
        let [logistic, rectified] = [network(inputs, hidden, bias), rectified(inputs, hidden, bias)];
        let losses = [Loss::Squared, Loss::Logarithmic];
        losses
            .into_iter()
            .flat_map(move |loss| [(logistic.clone(), loss), (rectified.clone(), loss)])
            .map(move |(network, loss)| (network, hidden, bias, loss))
    }) {
        let values = normals(11, inputs * count);
        let target = |k: usize| if k.is_multiple_of(3) { 0.9 } else { 0.1 };
        let weight = |k: usize| 0.5 + k as f64;
        let row = |(k, inputs)| Row { inputs, target: target(k), weight: weight(k) };
        let rows: Vec<Row> = values.chunks(inputs).enumerate().map(row).collect();
        let mut layers: Vec<Layer> =
            network.layout.layers().map(|(i, n)| Layer::new(n, i + usize::from(bias))).collect();
        let mut weights = network.weights.iter().map(|w| *w as f32);
        layers.iter_mut().for_each(|layer| layer.weights.fill(&mut weights));
        let of: Vec<&Matrix> = layers.iter().map(|layer| &layer.weights).collect();
        let mut forward = ForwardWeights::new(&network.layout, 0);
        forward.set(of.iter().copied(), Isa::detect());
        let mut micro_batch = MicroBatch::new(&network.layout);
        // More rows first: what they leave behind must not count.
        let more: Vec<Row> = rows.iter().chain(&rows).map(|row| Row { ..*row }).take(64).collect();
        micro_batch.run(&of, &forward, &more, loss, Isa::detect());
        micro_batch.run(&of, &forward, &rows, loss, Isa::detect());
        let mut wanted = vec![0.0; network.weights.len()];
        let (mut slopes, mut tape) = (wanted.clone(), Activations::default());
        for (k, inputs) in values.chunks(inputs).enumerate() {
            let output = network.gradient(inputs, &mut tape, &mut slopes);
            let off = output - target(k);
            let by_output = match loss {
                Loss::Squared => off,
                // d/dy of -t ln y - (1 - t) ln(1 - y).
                Loss::Logarithmic => off / (output * (1.0 - output)),
            };
            wanted.iter_mut().zip(&slopes).for_each(|(sum, slope)| *sum += weight(k) * by_output * slope);
        }
        let most = wanted.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let found: Vec<f64> = micro_batch.gradients.iter().flat_map(Matrix::values).map(f64::from).collect();
        let off = found.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 2e-6 * most, "{hidden:?}, {:?}, {loss:?}: {off} of {most}", network.layout.activation);
        // What lies behind the last column stays nought.
        let padded = |m: &Matrix| m.padded().filter(|x| **x != 0.0).count();
        assert!(micro_batch.gradients.iter().all(|m| padded(m) == m.values().filter(|x| *x != 0.0).count()));
    }
}

#[test]
fn equal_steps_and_their_formula_in_f64() {
    type Dense = nalgebra::DMatrix<f64>;
    let dense = |m: &Matrix| Dense::from_fn(m.rows, m.columns, |i, j| f64::from(m.get(i, j)));
    let kept = |layer: &Layer| layer.arrays().into_iter().map(|(name, m)| (name, dense(m))).collect::<BTreeMap<_, _>>();
    let close = |a: &Dense, b: &Dense| (a - b).abs().max() < 1e-5 * b.abs().max();
    let mut layer = Layer::new(5, 7);
    layer.weights.fill(normals(1, 35).into_iter().map(|x| x as f32));
    for steps in 0..40 {
        // The sum over 32 rows.
        layer.gradient.fill(normals(100 + steps, 35).into_iter().map(|x| 32.0 * x as f32));
        let before = kept(&layer);
        let (rate, seen) = (0.1, 1.0 - math::pow(0.95, (steps + 1) as f64));
        layer.step(32, steps, rate as f32, seen as f32, Isa::detect());
        let after = kept(&layer);
        let gradient = &before["gradient"] / 32.0;
        let mean = |name: &str, new: &Dense| &before[name] * 0.95 + new * 0.05;
        assert!(close(&after["mean"], &mean("mean", &gradient)));
        assert!(close(&after["by_neurons"], &mean("by_neurons", &(&gradient * gradient.transpose()))));
        assert!(close(&after["by_inputs"], &mean("by_inputs", &(gradient.transpose() * &gradient))));
        let (a, b) = (&after["neuron_basis"], &after["input_basis"]);
        let turned = a * &gradient * b.transpose();
        assert!(close(&after["squares"], &mean("squares", &turned.component_mul(&turned))));
        let roots = after["squares"].map(|square| (square / seen).sqrt());
        let step = a.transpose() * ((a * &after["mean"] * b.transpose()) / seen).component_div(&roots) * b * rate;
        // The first gradients leave directions empty, in which all is rounding.
        assert!(steps < 3 || close(&(&before["weights"] - &after["weights"]), &step), "step {steps}");
        assert!(furthest(&layer.gradient, |_, _| 0.0) == 0.0);
    }
}

#[test]
fn extreme_a_direction_that_lost_its_squares_moves_by_a_bounded_step() {
    let mut layer = Layer::new(3, 4);
    for steps in 0..10 {
        layer.gradient.fill(normals(steps, 12).into_iter().map(|x| 1e12 * x as f32));
        layer.step(1, steps, 0.005, 1.0 - 0.95_f32.powi(steps as i32 + 1), Isa::detect());
    }
    // As a turn may leave it: a mean, and no squares.
    layer
        .arrays_mut()
        .into_iter()
        .filter(|(name, _)| *name == "squares")
        .for_each(|(_, squares)| squares.fill(std::iter::repeat_n(0.0, 12)));
    let before = layer.weights.clone();
    layer.step(1, 11, 0.005, 0.4, Isa::detect());
    let moved = furthest(&layer.weights, |i, j| f64::from(before.get(i, j)));
    assert!(moved > 0.005 && moved < 0.005 * 100.0 * 12.0_f64.sqrt(), "{moved}");
}

#[test]
fn extreme_a_batch_whose_squares_are_not_finite_is_left_out_whole() {
    let mut layer = Layer::new(2, 3);
    for (x, is_sound) in [(1e18, true), (1e19, false), (f32::INFINITY, false), (f32::NAN, false)] {
        layer.gradient.set(1, 1, x);
        assert_eq!(layer.is_sound(), is_sound, "{x}");
    }
    let mut start = network(8, &[4], true);
    // Neurons that are not saturated, whatever the inputs: then the first layer's gradient is too large, the last one's is not.
    start.weights[..9 * 4].fill(0.0);
    let fresh = || {
        build(
            &FilterParams::Kronecker(KroneckerParams { rate: 0.02, ..KroneckerParams::default() }),
            &start.layout,
            1e6,
        )
        .unwrap()
    };
    let (mut filter, mut network) = (fresh(), start.clone());
    filter.learn(&mut network, &[1e6; 64 * 8], &[0.9; 64], &[1e-15; 64]);
    assert_eq!(filter.counters(), Counters { rejected: 64, clipped: 64, ..Counters::default() });
    assert_eq!(network, start);
    // It goes on as if there had been none.
    let (inputs, targets) = (normals(3, 64 * 8), [0.9; 64]);
    let (mut other, mut expected) = (fresh(), start.clone());
    filter.learn(&mut network, &inputs, &targets, &[1.0; 64]);
    other.learn(&mut expected, &inputs, &targets, &[1.0; 64]);
    assert!(network == expected && network != start);
    assert_eq!(filter.state().arrays[1..], other.state().arrays[1..]);
}

/// Rows of 8 inputs that a small network can learn, learnt in portions of `portion` rows on so many threads.
fn learnt(rows: usize, portion: usize, threads: usize, outliers: bool) -> (Network, Counters, FilterState) {
    learnt_by(network(8, &[16, 16], true), rows, portion, threads, outliers)
}

fn learnt_by(
    mut network: Network,
    rows: usize,
    portion: usize,
    threads: usize,
    outliers: bool,
) -> (Network, Counters, FilterState) {
    let mut inputs = normals(1, rows * 8);
    let targets: Vec<f64> = inputs.chunks(8).map(|x| if x[0] * x[1] + x[2] > 0.3 { 0.9 } else { 0.1 }).collect();
    let mut noise = vec![1.0; rows];
    if outliers {
        inputs.iter_mut().step_by(97).for_each(|x| *x = 8.0);
        noise.iter_mut().step_by(31).for_each(|noise| *noise = 1e-12);
    }
    let mut filter = build(
        &FilterParams::Kronecker(KroneckerParams { rate: 0.02, ..KroneckerParams::default() }),
        &network.layout,
        8.0,
    )
    .unwrap();
    filter.share_work();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        for (k, targets) in targets.chunks(portion).enumerate() {
            let own = k * portion..k * portion + targets.len();
            filter.learn(&mut network, &inputs[own.start * 8..own.end * 8], targets, &noise[own]);
        }
    });
    (network, filter.counters(), filter.state())
}

/// Members of 16-16 neurons, logistic and rectified by turns.
fn of_both(members: usize) -> Network {
    drawn(Activation::Both, members, 8, &[16, 16], true)
}

#[test]
fn exact_by_either_loss_outputs_are_the_targets_of_like_rows_however_small() {
    // Four kinds of rows, told apart by an input each; the target of each stands for the mean of its labels.
    let shares = [0.001, 0.02, 0.5, 0.995];
    let furthest_logit = |loss| {
        let mut network = network(4, &[8], true);
        let params = FilterParams::Kronecker(KroneckerParams { rate: 0.02, loss });
        let mut filter = build(&params, &network.layout, 8.0).unwrap();
        let kinds: Vec<Vec<f64>> =
            (0..4).map(|kind| (0..4).map(|k| f64::from(u8::from(k == kind))).collect()).collect();
        for _ in 0..400 {
            let rows = kinds.concat().repeat(64);
            filter.learn(&mut network, &rows, &shares.repeat(64), &[1.0; 256]);
        }
        let logit = |p: f64| math::ln(p / (1.0 - p));
        let mut tape = Activations::default();
        let off = |(kind, share): (&Vec<f64>, &f64)| (logit(network.output(kind, &mut tape)) - logit(*share)).abs();
        kinds.iter().zip(&shares).map(off).fold(0.0, f64::max)
    };
    let [logarithmic, squared] = [Loss::Logarithmic, Loss::Squared].map(furthest_logit);
    assert!(logarithmic < 0.005 && squared < 0.1, "{logarithmic} {squared}");
}

#[test]
fn equal_any_number_of_threads_learns_the_same_bits() {
    let one = learnt(4000, 256, 1, false);
    let three = || of_both(3);
    let of_three = learnt_by(three(), 4000, 256, 1, true);
    for threads in [2, 3, 8] {
        assert!(learnt(4000, 256, threads, false) == one, "{threads} threads");
        assert!(learnt_by(three(), 4000, 256, threads, true) == of_three, "{threads} threads");
    }
}

#[test]
fn equal_a_member_learns_among_others_what_it_learns_alone() {
    let start = of_both(3);
    let size = start.weights.len() / 3;
    let activation = |member: usize| if member == 1 { Activation::Relu } else { Activation::Logistic };
    let alone = |member: usize| Network {
        layout: Layout { members: 1, activation: activation(member), ..start.layout.clone() },
        weights: start.weights[member * size..][..size].to_vec(),
    };
    let (together, counters, state) = learnt_by(start.clone(), 4000, 256, 2, false);
    for member in 0..3 {
        let (network, own, own_state) = learnt_by(alone(member), 4000, 256, 1, false);
        assert!(together.weights[member * size..][..size] == network.weights && counters == own);
        for (name, kind, shape, bytes) in own_state.arrays {
            assert!(state.arrays.contains(&(format!("members.{member}.{name}"), kind, shape, bytes)), "{name}");
        }
    }
    // And goes on from its state.
    let fresh = || {
        build(
            &FilterParams::Kronecker(KroneckerParams { rate: 0.02, ..KroneckerParams::default() }),
            &start.layout,
            8.0,
        )
        .unwrap()
    };
    let (mut one, mut other) = (fresh(), fresh());
    one.restore(&state).unwrap();
    other.restore(&one.state()).unwrap();
    let inputs = normals(9, 640 * 8);
    let [mut a, mut b] = [together.clone(), together.clone()];
    one.learn(&mut a, &inputs, &[0.9; 640], &[1.0; 640]);
    other.learn(&mut b, &inputs, &[0.9; 640], &[1.0; 640]);
    assert!(a == b && a != together);
}

#[test]
fn extreme_a_state_with_more_rows_begun_than_a_batch_holds_is_refused() {
    let (network, counters, state) = learnt(20_000, 256, 1, false);
    let mut filter = build(&FilterParams::Kronecker(KroneckerParams::default()), &network.layout, 8.0).unwrap();
    filter.restore(&state).unwrap();
    for begun in [u64::MAX, counters.updates + 1, 65] {
        let mut spoilt = state.clone();
        let place = spoilt.arrays.iter_mut().find(|array| array.0.ends_with("place")).expect("a place");
        place.3[16..24].copy_from_slice(&begun.to_le_bytes());
        let error = filter.restore(&spoilt).unwrap_err();
        assert!(error.to_string().contains(&format!("a batch of {begun} rows is begun")), "{error}");
    }
}

#[test]
fn law_another_training_starts_at_the_average_and_averages_its_own_steps() {
    let (before, _, state) = learnt(20_000, 256, 1, false);
    let mut filter = build(
        &FilterParams::Kronecker(KroneckerParams { rate: 0.02, ..KroneckerParams::default() }),
        &before.layout,
        8.0,
    )
    .unwrap();
    // Another corpus: all of it untraversable. 30 batches of 64 rows.
    let inputs = normals(3, 30 * 64 * 8);
    let moved = |filter: &mut dyn crate::train::Filter| {
        let mut network = before.clone();
        filter.learn(&mut network, &inputs, &[0.9; 30 * 64], &[1.0; 30 * 64]);
        network.weights.iter().zip(&before.weights).map(|(now, then)| (now - then).abs()).fold(0.0_f64, f64::max)
    };
    filter.restore(&state).unwrap();
    let gone_on = moved(&mut *filter);
    filter.restore(&state).unwrap();
    filter.begin_anew();
    let anew = moved(&mut *filter);
    assert!(anew > 1.5 * gone_on, "{anew} {gone_on}");
    // Its first step is taken from the average, and is the average then: no element of it moves by more than the rate does.
    filter.restore(&state).unwrap();
    filter.begin_anew();
    let mut network = before.clone();
    filter.learn(&mut network, &inputs[..64 * 8], &[0.9; 64], &[1.0; 64]);
    let first =
        network.weights.iter().zip(&before.weights).map(|(now, then)| (now - then).abs()).fold(0.0_f64, f64::max);
    assert!(first > 0.0 && first < 0.1, "{first}");
    assert!(network.weights.iter().all(|w| (w - f64::from(*w as f32)).abs() < 1e-12));
}

#[test]
fn law_a_problem_is_learnt_and_rows_of_huge_weight_leave_all_finite() {
    let wrong = |network: &Network| {
        let inputs = normals(2, 1000 * 8);
        let mut outputs = vec![0.0; 1000];
        network.outputs(&inputs, &mut outputs);
        let is_off = |(x, y): (&[f64], &f64)| (x[0] * x[1] + x[2] > 0.3) != (*y > 0.5);
        inputs.chunks(8).zip(&outputs).filter(|&row| is_off(row)).count()
    };
    let (by_rectified, ..) = learnt_by(rectified(8, &[16, 16], true), 40_000, 256, 1, false);
    let (learnt_well, counters, _) = learnt(40_000, 256, 1, false);
    for network in [&learnt_well, &by_rectified] {
        assert!(wrong(network) < 50, "{} of 1000 wrong", wrong(network));
    }
    assert_eq!(counters, Counters { updates: 40_000, ..Counters::default() });
    let (bent, counters, _) = learnt(10_000, 256, 1, true);
    assert!(bent.weights.iter().all(|w| w.is_finite()));
    assert_eq!((counters.updates, counters.rejected), (10_000, 0));
}
