//! The filters against closed forms, a plain reference and each other.

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::train::filter::diagonal::Diagonal;
use crate::train::filter::ekf::Ekf;
use crate::train::filter::groups::groups;
use crate::train::filter::lanes::{Isa, Real};
use crate::train::filter::linearised::{Learner, Linearised, Outcome, Rows};
use crate::train::filter::noise::Noise;
use crate::train::filter::state::Writer;
use crate::train::filter::ud::Ud;
use crate::train::filter::ukf::{Learnt, SquareRoot};

/// Eqs 11-16 as printed, dense, with a mask for the blocks of groups; `batch` rows at a time.
fn textbook(rows: usize, p0: f64, q: f64, batch: usize, by: Groups) -> Vec<f64> {
    textbook_of(case(rows), p0, q, batch, by)
}

type Case = (Network, Vec<f64>, Vec<f64>, Vec<f64>);

fn textbook_of((mut network, inputs, targets, noise): Case, p0: f64, q: f64, batch: usize, by: Groups) -> Vec<f64> {
    let s = network.weights.len();
    let mut mask = DMatrix::zeros(s, s);
    for group in groups(&network.layout, by) {
        for &i in &group {
            for &j in &group {
                mask[(i as usize, j as usize)] = 1.0;
            }
        }
    }
    let mut p = DMatrix::<f64>::identity(s, s) * p0;
    let data: Vec<_> = inputs.chunks(8).zip(&targets).zip(&noise).collect();
    for rows in data.chunks(batch) {
        let m = rows.len();
        let mut b = DMatrix::zeros(m, s);
        let mut innovation = DVector::zeros(m);
        let mut r = DMatrix::zeros(m, m);
        for (k, ((x, d), noise)) in rows.iter().enumerate() {
            let mut gradient = vec![0.0; s];
            innovation[k] = *d - network.gradient(x, &mut Default::default(), &mut gradient);
            b.row_mut(k).copy_from_slice(&gradient);
            r[(k, k)] = **noise;
        }
        p += DMatrix::identity(s, s) * q; // Eq. (11)
        let gain = &p * b.transpose() * (&b * &p * b.transpose() + r).try_inverse().unwrap(); // Eq. (13)
        p = ((DMatrix::identity(s, s) - &gain * &b) * &p).component_mul(&mask); // Eq. (14)
        let step = &gain * innovation; // Eq. (15)
        network.weights.iter_mut().zip(step.iter()).for_each(|(w, x)| *w += x);
    }
    network.weights
}

#[test]
fn equal_ekf_and_the_dense_textbook_form() {
    for (batch, q) in [(1, 0.0), (1, 1e-4), (7, 1e-4)] {
        let want = textbook(150, 10.0, q, batch, Groups::One);
        let (got, counters) = learn(&ekf(10.0, q, Precision::F64, false, batch), 150);
        assert!(furthest(&got, &want) < 1e-10, "batch {batch}: {}", furthest(&got, &want));
        assert_eq!(counters, Counters { updates: 150, ..Counters::default() });
        let (got, _) = learn(&ekf(10.0, q, Precision::F32, false, batch), 150);
        // 150 steps of f32 rounding (6e-8) on weights of size 1, amplified by the network's bends.
        assert!(furthest(&got, &want) < 2e-4, "f32, batch {batch}: {}", furthest(&got, &want));
    }
}

/// Made by `scripts/peers/ekf_digits.py`, in fifty digits: no code of it is here, nor any rounding of f64.
#[test]
fn golden_weights_are_those_of_the_equations_in_fifty_digits() {
    let want = [
        [
            -0.310_984_108_598_224_5,
            0.100_591_349_052_074_26,
            -0.286_745_248_923_149_07,
            0.158_219_904_771_386_98,
            0.061_860_776_006_495_97,
            -0.229_989_253_936_871_92,
            0.391_475_616_599_378_6,
            -0.123_645_606_072_835_1,
            -0.255_297_415_434_479_15,
            0.157_649_147_774_643_06,
            -0.080_352_836_227_286_31,
            -0.431_548_789_709_265_7,
            0.125_328_189_749_959_07,
            -0.163_895_587_914_643_76,
            0.146_022_433_397_097_7,
            -0.060_470_360_689_516_62,
            -0.326_483_063_820_743_44,
            0.350_021_905_999_579_55,
            -0.092_639_275_915_475_33,
            -0.093_932_253_099_769_13,
            0.087_844_440_720_920_87,
        ],
        [
            -0.310_987_104_984_515_5,
            0.100_592_168_187_905_45,
            -0.286_744_783_282_362_97,
            0.158_210_697_592_134_96,
            0.061_859_444_506_289_38,
            -0.229_992_835_780_656_96,
            0.391_482_782_578_222_8,
            -0.123_652_127_816_068_56,
            -0.255_299_638_337_213_25,
            0.157_647_908_742_999_36,
            -0.080_349_513_950_895_87,
            -0.431_555_779_974_994_7,
            0.125_326_527_125_816_3,
            -0.163_895_505_559_088_9,
            0.146_022_278_744_093_63,
            -0.060_476_198_368_049_31,
            -0.326_492_452_720_290_3,
            0.350_021_172_048_510_74,
            -0.092_646_886_716_087_5,
            -0.093_931_430_297_144_04,
            0.087_835_540_329_271_4,
        ],
    ];
    for (q, want) in [0.0, 1.0 / 8192.0].into_iter().zip(want) {
        let mut network = network(3, &[4]);
        network.weights = (0..21).map(|i| f64::from((7 * i) % 11 - 5) / 16.0).collect();
        let inputs: Vec<f64> =
            (0..6).flat_map(|row| (0..3).map(move |i| f64::from((3 * i + 5 * row) % 13 - 6) / 8.0)).collect();
        let targets = [1.0, 7.0, 1.0, 7.0, 1.0, 7.0].map(|target| target / 8.0);
        let noise = [1.0, 0.5, 2.0, 1.0, 0.5, 2.0];
        build(&ekf(10.0, q, Precision::F64, false, 1), &network.layout).unwrap().learn(
            &mut network,
            &inputs,
            &targets,
            &noise,
        );
        assert!(furthest(&network.weights, &want) < 1e-14, "q = {q}: {:e}", furthest(&network.weights, &want));
    }
}

/// One to six rows from each of fifty networks: rounding has had no time to grow along the course of a training.
#[test]
fn equal_a_few_updates_and_the_textbook_form_to_the_last_digits() {
    let (network, inputs, targets, noise) = case(300);
    let starts = (0..50_usize).map(|k| {
        let mut network = network.clone();
        network.weights.iter_mut().zip(normals(200 + k as u64, 87)).for_each(|(w, n)| *w += 0.3 * n);
        let (from, to) = (6 * k, 6 * k + 1 + k % 6);
        (network, inputs[8 * from..8 * to].to_vec(), targets[from..to].to_vec(), noise[from..to].to_vec())
    });
    // The factored form adds Q to D and not to P, which is another filter: it is compared without.
    let forms = [
        (ekf(10.0, 1e-4, Precision::F64, false, 1), 1e-4, 1, Groups::One),
        (ekf(10.0, 1e-4, Precision::F64, false, 3), 1e-4, 3, Groups::One),
        (ekf(10.0, 0.0, Precision::F64, true, 1), 0.0, 1, Groups::One),
        (decoupled(Groups::Layer, Precision::F64), 1e-5, 1, Groups::Layer),
        (decoupled(Groups::Node, Precision::F64), 1e-5, 1, Groups::Node),
    ];
    for start in starts {
        for (params, q, batch, by) in &forms {
            let want = textbook_of(start.clone(), 10.0, *q, *batch, *by);
            let (mut network, inputs, targets, noise) = start.clone();
            build(params, &network.layout).unwrap().learn(&mut network, &inputs, &targets, &noise);
            let (rows, off) = (targets.len(), furthest(&network.weights, &want));
            assert!(off < 1e-14, "{params:?}, {rows} rows: {off:e}");
        }
    }
}

#[test]
fn equal_decoupled_and_the_dense_form_with_block_diagonal_p() {
    for by in [Groups::Layer, Groups::Node, Groups::InputNode, Groups::Weight] {
        let want = textbook(100, 10.0, 1e-5, 1, by);
        let (got, _) = learn(&decoupled(by, Precision::F64), 100);
        assert!(furthest(&got, &want) < 1e-11, "{by:?}: {}", furthest(&got, &want));
    }
}

#[test]
fn equal_one_group_decoupled_and_ekf_to_the_bit() {
    for precision in [Precision::F32, Precision::F64] {
        let one = learn(&decoupled(Groups::One, precision), 500).0;
        assert_eq!(bits(&one), bits(&learn(&ekf(10.0, 1e-5, precision, false, 1), 500).0));
    }
}

#[test]
fn equal_s_groups_and_the_diagonal_filter() {
    let (network, ..) = case(1);
    let size = network.weights.len();
    let run = |learner: &mut dyn Learner| {
        let mut weights = network.weights.clone();
        for k in 0..200 {
            let b = normals(100 + k, size);
            learner.update(&mut weights, &Rows { jacobian: &b, innovations: &[0.3], noise: &[1.0], q: 1e-6 });
        }
        weights
    };
    let grouped = run(&mut Ekf::<f64>::new("x", groups(&network.layout, Groups::Weight), 10.0, 1, Isa::detect()));
    let diagonal = run(&mut Diagonal::new(size, 10.0, 1));
    assert!(furthest(&grouped, &diagonal) < 1e-12, "{}", furthest(&grouped, &diagonal));
}

#[test]
fn equal_factored_and_plain_ekf_over_a_thousand_updates() {
    for batch in [1, 8] {
        let plain = learn(&ekf(10.0, 0.0, Precision::F64, false, batch), 1000).0;
        let factored = learn(&ekf(10.0, 0.0, Precision::F64, true, batch), 1000).0;
        assert!(furthest(&plain, &factored) < 1e-9, "batch {batch}: {}", furthest(&plain, &factored));
    }
}

#[test]
fn exact_backprop_is_the_ekf_under_the_two_assumptions() {
    // P = p I: a filter that has learnt nothing yet. (B P B' + R)^-1 = a I: one output, so a is a number.
    let (mut network, inputs, targets, _) = case(40);
    let p = 2.5;
    for (x, d) in inputs.chunks(8).zip(&targets) {
        let mut gradient = vec![0.0; network.weights.len()];
        network.gradient(x, &mut Default::default(), &mut gradient);
        let a = 1.0 / (p * gradient.iter().map(|b| b * b).sum::<f64>() + 1.0);
        let mut by_ekf = network.clone();
        build(&ekf(p, 0.0, Precision::F64, false, 1), &network.layout).unwrap().learn(&mut by_ekf, x, &[*d], &[1.0]);
        let backprop = FilterParams::Backprop(BackpropParams { rate: a * p });
        build(&backprop, &network.layout).unwrap().learn(&mut network, x, &[*d], &[1.0]);
        assert!(furthest(&network.weights, &by_ekf.weights) < 1e-14);
    }
}

/// A linear model's rows and targets, and the closed form of its estimate: (I / P0 + X'X / R)^-1 X'd / R.
fn linear(rows: usize, size: usize, p0: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let x = DMatrix::from_row_slice(rows, size, &normals(3, rows * size));
    let truth = DVector::from_vec(normals(4, size));
    let d = &x * truth + DVector::from_vec(normals(6, rows)) * 0.1;
    let information = DMatrix::identity(size, size) / p0 + x.transpose() * &x / 0.25;
    let want = information.cholesky().unwrap().solve(&(x.transpose() * &d / 0.25));
    (x.transpose().as_slice().to_vec(), d.as_slice().to_vec(), want.as_slice().to_vec())
}

fn least_squares(learner: &mut dyn Learner, rows: &[f64], targets: &[f64], size: usize) -> Vec<f64> {
    let mut weights = vec![0.0; size];
    let batch = learner.batch();
    for (rows, targets) in rows.chunks(batch * size).zip(targets.chunks(batch)) {
        let output = |x: &[f64]| x.iter().zip(&weights).map(|(x, w)| x * w).sum::<f64>();
        let innovations: Vec<f64> = rows.chunks(size).zip(targets).map(|(x, d)| d - output(x)).collect();
        let noise = vec![0.25; targets.len()];
        let rows = Rows { jacobian: rows, innovations: &innovations, noise: &noise, q: 0.0 };
        assert_eq!(learner.update(&mut weights, &rows), Outcome::default());
    }
    weights
}

#[test]
fn exact_linear_model_is_least_squares_in_closed_form() {
    // From 150 on updates stay beside the triangle for a while; 155 leaves a strip without a pair.
    for size in [1, 3, 4, 5, 15, 16, 17, 33, 70, 150, 155] {
        let (rows, targets, want) = linear(150, size, 50.0);
        let one = || vec![(0..size as u32).collect::<Vec<_>>()];
        let isa = Isa::detect();
        for batch in [1, 2, 8] {
            let got = least_squares(&mut Ekf::<f64>::new("x", one(), 50.0, batch, isa), &rows, &targets, size);
            assert!(furthest(&got, &want) < 1e-10, "size {size}, batch {batch}: {}", furthest(&got, &want));
            let got = least_squares(&mut Ekf::<f32>::new("x", one(), 50.0, batch, isa), &rows, &targets, size);
            assert!(furthest(&got, &want) < 1e-3, "f32 size {size}, batch {batch}: {}", furthest(&got, &want));
            let got = least_squares(&mut Ud::<f64>::new(size, 50.0, batch, isa), &rows, &targets, size);
            assert!(furthest(&got, &want) < 1e-10, "UD size {size}, batch {batch}: {}", furthest(&got, &want));
            let got = least_squares(&mut Ud::<f32>::new(size, 50.0, batch, isa), &rows, &targets, size);
            assert!(furthest(&got, &want) < 1e-3, "UD f32 size {size}, batch {batch}: {}", furthest(&got, &want));
        }
        for alpha in [1.0, 0.3, 0.01] {
            let mut root = SquareRoot::new(size, 50.0, alpha, 2.0);
            let mut weights = vec![0.0; size];
            for (x, d) in rows.chunks(size).zip(&targets) {
                let output = |w: &[f64]| x.iter().zip(w).map(|(x, w)| x * w).sum::<f64>();
                assert_eq!(root.update(&mut weights, *d, 0.25, 0.0, output), Learnt::Yes);
            }
            assert!(furthest(&weights, &want) < 1e-9, "UKF size {size}: {}", furthest(&weights, &want));
        }
    }
}

#[test]
fn exact_variances_that_the_factored_form_takes_over_are_those_of_least_squares() {
    let p0 = 50.0;
    for (size, batch) in [(17, 1), (17, 8), (150, 1), (150, 8)] {
        let (rows, targets, _) = linear(60, size, p0);
        let x = DMatrix::from_row_slice(60, size, &rows);
        let information = DMatrix::identity(size, size) / p0 + x.transpose() * &x / 0.25;
        // Neither side is nearer than the rounding of so ill-conditioned an inverse.
        let eigenvalues = information.clone().symmetric_eigenvalues();
        let bound = (f64::EPSILON * p0 * eigenvalues.max() / eigenvalues.min()).max(1e-10);
        let want = information.try_inverse().unwrap();
        let mut plain = Ekf::<f64>::new("x", vec![(0..size as u32).collect()], p0, batch, Isa::detect());
        least_squares(&mut plain, &rows, &targets, size);
        let mut writer = Writer::new("ud-f64");
        plain.factored(Isa::detect()).save(&mut writer);
        let state = writer.finish();
        let variances: Vec<f64> =
            state.arrays[1].3.chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
        let gap = furthest(&variances, want.diagonal().as_slice());
        assert!(gap < bound, "size {size}, batch {batch}: {gap}, {bound}");
    }
}

#[test]
fn law_unscented_tends_to_extended_as_p0_vanishes() {
    let step = |params: &FilterParams| {
        let start = case(1).0.weights;
        learn(params, 1).0.iter().zip(start).map(|(w, start)| w - start).collect::<Vec<f64>>()
    };
    let gap = |p0: f64| {
        let extended = step(&ekf(p0, 0.0, Precision::F64, false, 1));
        let unscented = step(&FilterParams::Ukf(UkfParams { noise: noise(p0, 0.0), ..UkfParams::default() }));
        furthest(&extended, &unscented) / extended.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    };
    // The bends of the network enter with eta^2 = s P0.
    assert!(gap(1e-4) < 0.02 && gap(1e-6) < 2e-4, "{} {}", gap(1e-4), gap(1e-6));
}

#[test]
fn equal_instruction_sets_give_the_same_bits() {
    fn run<T: Real>(isa: Isa, robust: bool, batch: usize, by: Groups) -> Vec<u64> {
        let (_, inputs, targets, noise) = case(60);
        // 249 weights: covariances of one group that are more than one cache, and strips with and without a pair.
        let mut network = network(8, &[12, 10]);
        let size = network.weights.len();
        let set = Noise::of(&NoiseParams { q_over_r: 1e-5, ..NoiseParams::default() });
        let mut filter: Box<dyn Filter> = if robust {
            Box::new(Linearised::new(Ud::<T>::new(size, 10.0, batch, isa), set, size, 8.0))
        } else {
            Box::new(Linearised::new(Ekf::<T>::new("x", groups(&network.layout, by), 10.0, batch, isa), set, size, 8.0))
        };
        filter.learn(&mut network, &inputs, &targets, &noise);
        bits(&network.weights)
    }
    for (robust, batch, by) in
        [(false, 1, Groups::One), (false, 1, Groups::Node), (false, 5, Groups::One), (true, 1, Groups::One)]
    {
        let wanted = (run::<f32>(Isa::PORTABLE, robust, batch, by), run::<f64>(Isa::PORTABLE, robust, batch, by));
        for isa in Isa::available() {
            assert_eq!(run::<f32>(isa, robust, batch, by), wanted.0, "{isa:?} f32 {robust} {batch} {by:?}");
            assert_eq!(run::<f64>(isa, robust, batch, by), wanted.1, "{isa:?} f64 {robust} {batch} {by:?}");
        }
    }
}

#[test]
fn law_every_filter_learns_what_it_is_shown() {
    let error = |network: &Network, inputs: &[f64], targets: &[f64]| {
        let mut outputs = vec![0.0; targets.len()];
        network.outputs(inputs, &mut outputs);
        outputs.iter().zip(targets).filter(|(y, d)| (**y >= 0.5) != (**d >= 0.5)).count() as f64 / targets.len() as f64
    };
    let (start, inputs, targets, noise) = case(3000);
    for params in all() {
        let mut network = start.clone();
        let mut filter = build(&params, &network.layout).unwrap();
        // By batches of 64 a pass is 46 steps, fewer than the rate takes to rise.
        let passes = if matches!(params, FilterParams::Kronecker(_)) { 10 } else { 1 };
        (0..passes).for_each(|_| filter.learn(&mut network, &inputs, &targets, &noise));
        let got = error(&network, &inputs, &targets);
        // Always the same class: about 40 % wrong. The slow learners are diagonal filters and back-propagation.
        assert!(got < 0.3, "{params:?}: {got}");
    }
}

#[test]
fn equal_portions_at_once_are_learnt_as_one_by_one() {
    let (start, mut inputs, targets, noise) = case(700);
    // A row that no filter takes, in the second portion.
    inputs[200 * 8] = f64::INFINITY;
    let ends = [130, 257, 258, 700];
    for params in all() {
        let learnt = |threads: usize, at_once: bool| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (mut filter, mut network) = (build(&params, &start.layout).unwrap(), start.clone());
            filter.share_work();
            pool.install(|| {
                if at_once {
                    filter.learn_portions(&mut network, &inputs, &targets, &noise, &ends);
                    return;
                }
                for (from, end) in [0, 130, 257, 258].into_iter().zip(ends) {
                    filter.learn(&mut network, &inputs[from * 8..end * 8], &targets[from..end], &noise[from..end]);
                }
            });
            (network, filter.counters(), filter.state())
        };
        let one_by_one = learnt(1, false);
        assert!(one_by_one.1.rejected == 1 && one_by_one.0 != start, "{params:?}");
        for threads in [1, 3] {
            assert!(learnt(threads, true) == one_by_one, "{params:?}, {threads} threads");
        }
    }
}
