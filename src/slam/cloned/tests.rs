//! Pose, keyframe and scale, held against a Kalman filter of all eleven numbers written out, and against samples.

use super::*;
use crate::random::{Purpose, Stage, Streams};
use crate::slam::matrix::{apply, cholesky_clamped, diagonal, half_solve, square};
use crate::slam::motion::{PITCH, ROLL};
use crate::slam::scale::tests::{driven, unsure};

const BY_POSE: Matrix<3, 6> =
    [[0.8, 0.6, 0.0, 0.0, 0.0, 0.0], [-0.6, 0.8, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]];
const BY_KEYFRAME: Matrix<3, 4> = [[-0.8, -0.6, 0.0, 0.2], [0.6, -0.8, 0.0, -0.5], [0.0, 0.0, 0.0, -1.0]];
const WAY_SIGMAS: Vector<3> = [0.01, 0.015, 0.005];

/// Two steps, a keyframe, and another: pose, keyframe and scale have something in common.
fn under_way() -> GaussianPose {
    let mut belief = driven(driven(unsure()));
    belief.keyframe = ClonedPose::of(&belief);
    driven(belief)
}

fn assert_near(got: &GaussianPose, mean: &Vector<ALL>, covariance: &Matrix<ALL, ALL>, tolerance: f64) {
    let (own_mean, own) = got.stacked();
    for r in 0..ALL {
        assert!((own_mean[r] - mean[r]).abs() < tolerance, "{r}: {} {}", own_mean[r], mean[r]);
        for c in 0..ALL {
            assert!((own[r][c] - covariance[r][c]).abs() < tolerance, "{r} {c}: {} {}", own[r][c], covariance[r][c]);
        }
    }
}

/// x + K v and P - K H P, with the gain K = P H' / (H P H' + R) of numbers taken in one after the other, which is the same.
fn textbook(
    mean: &Vector<ALL>,
    covariance: &Matrix<ALL, ALL>,
    measured: &[(Vector<ALL>, f64, f64)],
) -> (Vector<ALL>, Matrix<ALL, ALL>) {
    let (mut x, mut p) = (*mean, *covariance);
    for (h, innovation, variance) in measured {
        let common: Vector<ALL> = std::array::from_fn(|r| (0..ALL).map(|c| p[r][c] * h[c]).sum());
        let spread = (0..ALL).map(|r| h[r] * common[r]).sum::<f64>() + variance;
        // What the numbers before have moved already.
        let moved: f64 = (0..ALL).map(|r| h[r] * (x[r] - mean[r])).sum();
        for r in 0..ALL {
            x[r] += common[r] / spread * (innovation - moved);
            for c in 0..ALL {
                p[r][c] -= common[r] * common[c] / spread;
            }
        }
    }
    (x, p)
}

#[test]
fn exact_a_keyframe_is_the_pose_as_it_was() {
    let before = {
        let mut belief = under_way();
        belief.keyframe = ClonedPose::default();
        belief
    };
    let mut after = before.clone();
    after.keyframe = ClonedPose::of(&after);
    let (mean, covariance) = after.stacked();
    for (k, &own) in KEPT.iter().enumerate() {
        assert_eq!(mean[KEYFRAME + k], before.mean[own]);
        for c in 0..6 {
            assert_eq!(covariance[KEYFRAME + k][c], before.covariance[own][c]);
        }
        for (l, &other) in KEPT.iter().enumerate() {
            assert_eq!(covariance[KEYFRAME + k][KEYFRAME + l], before.covariance[own][other]);
        }
        assert_eq!(covariance[KEYFRAME + k][SCALE], before.scale.with_pose[own]);
    }
    assert!(after.climb_m2().abs() < 1e-15, "no way, no climb");
    // Of a pose that is known exactly nothing is carried.
    assert!(ClonedPose::of(&GaussianPose::default()).is_known());
}

/// F P F' + Q of all eleven: F by central differences of the mean, Q what a known pose has after the step.
#[test]
fn equal_a_step_and_that_of_a_filter_of_all_numbers() {
    let before = under_way();
    let (mean, covariance) = before.stacked();
    let at = |mean: Vector<ALL>| {
        let scale = ScaleFactor { mean: mean[SCALE], ..ScaleFactor::default() };
        let keyframe = ClonedPose { mean: std::array::from_fn(|k| mean[KEYFRAME + k]), ..ClonedPose::default() };
        let known = std::array::from_fn(|i| mean[i]);
        driven(GaussianPose { mean: known, covariance: [[0.0; 6]; 6], scale, keyframe }).stacked()
    };
    let columns: Matrix<ALL, ALL> = std::array::from_fn(|column| {
        let moved = |h: f64| at(std::array::from_fn(|i| mean[i] + if i == column { h } else { 0.0 })).0;
        let (above, below) = (moved(1e-5), moved(-1e-5));
        std::array::from_fn(|row| (above[row] - below[row]) / 2e-5)
    });
    let (wanted_mean, noise) = at(mean);
    let wanted = sum(&product(&product(&transpose(&columns), &covariance), &columns), &noise);
    assert_near(&driven(before), &wanted_mean, &wanted, 1e-8);
}

#[test]
fn equal_a_way_that_is_measured_and_that_of_a_filter_of_all_numbers() {
    let mut belief = under_way();
    let (mean, covariance) = belief.stacked();
    let innovation = [0.02, -0.03, 0.01];
    let spread = belief.way_covariance(&BY_POSE, &BY_KEYFRAME);
    let slopes: Matrix<3, ALL> = std::array::from_fn(|r| {
        std::array::from_fn(|c| match c {
            0..KEYFRAME => BY_POSE[r][c],
            KEYFRAME..SCALE => BY_KEYFRAME[r][c - KEYFRAME],
            _ => 0.0,
        })
    });
    let wanted_spread = product(&product(&slopes, &covariance), &transpose(&slopes));
    assert!((0..9).all(|i| (spread[i / 3][i % 3] - wanted_spread[i / 3][i % 3]).abs() < 1e-15));
    let noise = diagonal(&WAY_SIGMAS.map(|s| s * s));
    belief.measure_way(&BY_POSE, &BY_KEYFRAME, &innovation, &noise).expect("positive definite");
    let numbers: Vec<_> = (0..3).map(|r| (slopes[r], innovation[r], WAY_SIGMAS[r] * WAY_SIGMAS[r])).collect();
    let (wanted_mean, wanted) = textbook(&mean, &covariance, &numbers);
    assert_near(&belief, &wanted_mean, &wanted, 1e-12);
}

#[test]
fn equal_a_reading_and_that_of_a_filter_of_all_numbers() {
    for component in [ROLL, PITCH, YAW] {
        let mut belief = under_way();
        let (mean, covariance) = belief.stacked();
        let mut slopes = [0.0; ALL];
        slopes[component] = 1.0;
        let reading_rad = mean[component] + 0.02;
        belief.read_angle(component, reading_rad, 4e-4);
        let (wanted_mean, wanted) = textbook(&mean, &covariance, &[(slopes, 0.02, 4e-4)]);
        assert_near(&belief, &wanted_mean, &wanted, 1e-12);
    }
}

/// Given the pose, keyframe and scale are what a Gaussian's other numbers are: mean C P^-1 d, covariance less C P^-1 C'.
#[test]
fn equal_a_draw_and_the_gaussian_given_what_was_drawn() {
    let mut belief = under_way();
    let (mean, covariance) = belief.stacked();
    belief.draw(&[0.5, -1.2, 0.3, 0.8, -0.4, 1.1]);
    let exactly: Vec<(Vector<ALL>, f64, f64)> = (0..KEYFRAME)
        .map(|i| (std::array::from_fn(|c| f64::from(u8::from(c == i))), belief.mean[i] - mean[i], 0.0))
        .collect();
    let (wanted_mean, mut wanted) = textbook(&mean, &covariance, &exactly);
    wanted[..KEYFRAME].iter_mut().for_each(|row| *row = [0.0; ALL]);
    wanted.iter_mut().for_each(|row| row[..KEYFRAME].fill(0.0));
    assert_near(&belief, &wanted_mean, &wanted, 1e-9);
}

/// Over 4000 drives in which a way is measured and then the sun read, the errors of all eleven numbers are as stated.
#[test]
fn dist_errors_of_pose_keyframe_and_scale_are_as_stated() {
    let start = under_way();
    let (mean, covariance) = start.stacked();
    let factor = cholesky_clamped(&covariance);
    let streams = Streams { seed: 8, scene: 0, attempt: 0, stage: Stage::Slam, step: 0 };
    let (mut squares, mut count) = ([0.0; 3], 0.0);
    for trial in 0..4000 {
        let mut normals = [0.0; ALL + 4];
        streams.at_step(trial).open(Purpose::SlamSample).fill_normal(0, &mut normals);
        let off = apply(&factor, &std::array::from_fn(|i| normals[i]));
        // Small errors: the way's slopes are taken as they are.
        let innovation = std::array::from_fn(|r| {
            let of_pose: f64 = (0..6).map(|c| BY_POSE[r][c] * off[c]).sum();
            let of_keyframe: f64 = (0..4).map(|k| BY_KEYFRAME[r][k] * off[KEYFRAME + k]).sum();
            of_pose + of_keyframe + WAY_SIGMAS[r] * normals[ALL + r]
        });
        let mut belief = start.clone();
        let noise = diagonal(&WAY_SIGMAS.map(|s| s * s));
        belief.measure_way(&BY_POSE, &BY_KEYFRAME, &innovation, &noise).expect("positive definite");
        belief.read_angle(YAW, mean[YAW] + off[YAW] + 0.01 * normals[ALL + 3], 1e-4);
        let (told, stated) = belief.stacked();
        let error: Vector<ALL> = std::array::from_fn(|i| told[i] - mean[i] - off[i]);
        for (sum, block) in squares.iter_mut().zip([[0, 1, 5], [6, 7, 9], [2, 8, 10]]) {
            let of_block = block.map(|r| block.map(|c| stated[r][c]));
            let factor = cholesky(&of_block).expect("positive definite");
            *sum += square(&half_solve(&factor, &block.map(|i| error[i])));
        }
        count += 3.0;
    }
    // Of such means 99.9 % lie within 5 % of 1.
    assert!(squares.iter().all(|sum| (sum / count - 1.0).abs() < 0.05), "{squares:?} of {count}");
}

/// As above, of odometry that is told of no slip, and of a measurement of the pose alone.
#[test]
fn equal_a_measured_pose_and_that_of_a_filter_of_all_numbers_with_and_without_slip() {
    for slips in [true, false] {
        let mut belief = under_way();
        if !slips {
            belief = GaussianPose { scale: ScaleFactor::default(), keyframe: ClonedPose::default(), ..belief };
            belief.keyframe = ClonedPose::of(&belief);
            belief = driven(belief);
        }
        let (mean, covariance) = belief.stacked();
        let (noise, innovation) = (diagonal(&WAY_SIGMAS.map(|s| s * s)), [0.02, -0.03, 0.01]);
        let pull = product(&BY_POSE, &belief.covariance);
        let factor = cholesky(&sum(&product(&pull, &transpose(&BY_POSE)), &noise)).expect("positive definite");
        belief.measure(&BY_POSE, &pull, &factor, &innovation, &noise);
        let wide = |r: usize| std::array::from_fn(|c| if c < KEYFRAME { BY_POSE[r][c] } else { 0.0 });
        let numbers: Vec<_> = (0..3).map(|r| (wide(r), innovation[r], WAY_SIGMAS[r] * WAY_SIGMAS[r])).collect();
        let (wanted_mean, wanted) = textbook(&mean, &covariance, &numbers);
        assert_near(&belief, &wanted_mean, &wanted, 1e-12);
        assert_eq!(belief.scale.is_known(), !slips);
    }
}

#[test]
fn extreme_ways_of_nonsense_and_of_no_doubt() {
    for (noise, innovation) in [(0.0, 1e-3), (1e300, 1e-3), (1e-300, 1.0), (f64::NAN, 0.0)] {
        let mut belief = under_way();
        let before = belief.clone();
        let told = belief.measure_way(&BY_POSE, &BY_KEYFRAME, &[innovation; 3], &diagonal(&[noise; 3]));
        if told.is_none() {
            assert_eq!(belief, before, "{noise}");
        } else {
            let (mean, covariance) = belief.stacked();
            assert!(mean.iter().chain(covariance.iter().flatten()).all(|v| v.is_finite()), "{noise}");
            assert!((0..ALL).all(|i| covariance[i][i] >= -1e-15), "{noise}: {covariance:?}");
        }
    }
    // A keyframe right here, and a way of nothing measured exactly: singular, and left alone or taken in without harm.
    let mut belief = under_way();
    belief.keyframe = ClonedPose::of(&belief);
    belief.measure_way(&BY_POSE, &BY_KEYFRAME, &[0.0; 3], &diagonal(&[1e-12; 3])).expect("a factor");
    assert!(belief.mean.iter().chain(belief.covariance.iter().flatten()).all(|v| v.is_finite()));
}
