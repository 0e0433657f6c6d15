//! One particle: its pose and weight against the stacked forms, its map, and what association leaves out.

use super::*;
use crate::geometry::{DVec3, Pose};
use crate::math;
use crate::slam::associate::{GATE, NEW_BEYOND};
use crate::slam::landmark::MISSED;
use crate::slam::matrix::{
    Matrix, Vector, cholesky, half_solve, ln_determinant, product, product_across, solve, square, sum, transpose,
};
use crate::slam::measurement::{self, Prediction, innovation};
use crate::slam::observation::{Feature, FeatureNoise};
use crate::slam::tests::feature;

const VARIANCES: Vector<3> = [9e-4, 3e-4, 3e-4];
const LANDMARKS: [Vector<3>; 3] = [[2.0, 0.5, 0.2], [-1.0, 2.0, 0.1], [1.5, -2.5, 0.4]];

fn mounting() -> Mounting {
    Mounting::new(&Pose { position_m: DVec3::new(0.2, 0.0, 0.5), ..Pose::default() }.transform())
}

/// A full-rank covariance: A A' for a fixed A, times `scale`.
fn covariance(scale: f64) -> Matrix<6, 6> {
    let a: Matrix<6, 6> = std::array::from_fn(|r| {
        std::array::from_fn(|c| if r == c { 0.05 } else { 0.01 * math::sin((6 * r + c) as f64) })
    });
    product(&a, &transpose(&a)).map(|row| row.map(|v| scale * v))
}

fn particle(scale: f64) -> Particle {
    let mean = [0.1, -0.2, 0.05, 0.1, -0.15, 0.7];
    let landmarks = LANDMARKS
        .iter()
        .zip(0..)
        .map(|(&mean_m, id)| Landmark {
            mean_m,
            covariance_m2: diagonal(&[4e-4 * scale, 6e-4 * scale, 3e-4 * scale]),
            existence: 2.0,
            known: Some(id),
        })
        .collect();
    Particle {
        belief: GaussianPose { mean, covariance: covariance(scale), ..GaussianPose::default() },
        landmarks,
        ..Particle::default()
    }
}

fn features(particle: &Particle, off: impl Fn(usize, usize) -> f64) -> Vec<Feature> {
    let view = SensorView::new(&particle.belief.mean, &mounting());
    (0..3)
        .map(|i| {
            let polar = view.predict(&LANDMARKS[i]).expect("in view").polar;
            let polar = std::array::from_fn(|k| polar[k] + off(i, k));
            Feature { known: Some(i as u32), ..feature(polar) }
        })
        .collect()
}

/// Lets a particle take in features from this mount.
fn update_pose(particle: &mut Particle, features: &[Feature], variances: &Vector<3>) {
    let observations =
        features.iter().map(|&feature| Observation { variances: *variances, ..observed(feature) }).collect::<Vec<_>>();
    let seen = SweepObservations { observations: &observations, mounting: &mounting() };
    particle.update_pose(&seen, &mut Scratch::default());
}

/// ln of what a match on the gate counts, by its definition.
fn ln_on_the_gate() -> f64 {
    let determinant: f64 = VARIANCES.iter().map(|v| 2.0 * v).product();
    -0.5 * (GATE + math::ln(std::f64::consts::TAU * std::f64::consts::TAU * std::f64::consts::TAU * determinant))
}

/// A feature of the noise of [`VARIANCES`], unless it tells its own.
fn observed(feature: Feature) -> Observation {
    Observation::new(feature, &FeatureNoise { default_sigmas: VARIANCES.map(f64::sqrt), inflation: 1.0 })
}

fn sighted(features: &[Feature]) -> Vec<Observation> {
    features.iter().copied().map(observed).collect()
}

fn inverse(a: &Matrix<6, 6>) -> Matrix<6, 6> {
    solve(&cholesky(a).expect("positive definite"), &diagonal(&[1.0; 6]))
}

#[test]
fn equal_sequential_gain_form_and_stacked_information_form() {
    // Measurements as predicted: the mean stays, so that one linearisation holds for all three. Each has a noise of its own, in part.
    let mut refined = particle(1.0);
    let mut found = features(&refined, |_, _| 0.0);
    (found[0].sigmas, found[1].sigmas) = ([Some(0.3), None, Some(0.05)], [None, Some(0.1), None]);
    let variances = [[0.09, VARIANCES[1], 0.0025], [VARIANCES[0], 0.01, VARIANCES[2]], VARIANCES];
    let view = SensorView::new(&refined.belief.mean, &mounting());
    let mut information = inverse(&refined.belief.covariance);
    for (landmark, variances) in refined.landmarks.iter().zip(&variances) {
        let h = view.predict(&landmark.mean_m).expect("in view");
        let hm = &h.by_landmark;
        let q = sum(&product(&product(hm, &landmark.covariance_m2), &transpose(hm)), &diagonal(variances));
        let l = cholesky(&q).expect("positive definite");
        information = sum(&information, &product_across(&solve(&l, &h.by_pose), &h.by_pose));
    }
    let seen = SweepObservations { observations: &sighted(&found), mounting: &mounting() };
    refined.update_pose(&seen, &mut Scratch::default());
    let want = inverse(&information);
    for r in 0..6 {
        for c in 0..6 {
            let got = refined.belief.covariance[r][c];
            assert!((got - want[r][c]).abs() < 1e-9 * want[r][r].max(want[c][c]), "({r}, {c}): {got}");
        }
    }
}

#[test]
fn equal_product_of_weights_and_the_density_of_the_stacked_measurement() {
    // Everything scaled down to where the model is linear; the tolerance is what is left of its bend.
    let scale: f64 = 1e-14;
    let variances = VARIANCES.map(|v| v * scale);
    let mut refined = particle(scale);
    let found = features(&refined, |i, k| 0.02 * scale.sqrt() * math::sin((3 * i + k + 1) as f64));
    let view = SensorView::new(&refined.belief.mean, &mounting());
    let p = refined.belief.covariance;
    let predictions: Vec<Prediction> = LANDMARKS.iter().map(|m| view.predict(m).expect("in view")).collect();
    let mut stacked = [[0.0; 9]; 9];
    let mut residual = [0.0; 9];
    for (i, a) in predictions.iter().enumerate() {
        let nu = innovation(&found[i].polar, &a.polar);
        for (j, b) in predictions.iter().enumerate() {
            let mut block = product(&product(&a.by_pose, &p), &transpose(&b.by_pose));
            if i == j {
                let hm = &a.by_landmark;
                let own = product(&product(hm, &refined.landmarks[i].covariance_m2), &transpose(hm));
                block = sum(&block, &sum(&own, &diagonal(&variances)));
            }
            for r in 0..3 {
                residual[3 * i + r] = nu[r];
                for c in 0..3 {
                    stacked[3 * i + r][3 * j + c] = block[r][c];
                }
            }
        }
    }
    let l = cholesky(&stacked).expect("positive definite");
    let want = -0.5 * (square(&half_solve(&l, &residual)) + ln_determinant(&l) + 9.0 * math::ln(std::f64::consts::TAU));
    update_pose(&mut refined, &found, &variances);
    assert!((refined.log_weight - want).abs() < 1e-6, "{} {want}", refined.log_weight);
}

#[test]
fn law_every_feature_adds_one_term_of_comparable_size() {
    // A match on the gate weighs as a newcomer, where the landmark is as uncertain as the feature and the pose is exact.
    let mut sure = Particle::default();
    let view = SensorView::new(&sure.belief.mean, &mounting());
    let (mean_m, covariance_m2) = view.locate(&[3.0, 0.2, -0.1], &VARIANCES);
    sure.landmarks.push(Landmark { mean_m, covariance_m2, existence: 1.0, known: None });
    let on_gate = 3.0 + (2.0 * GATE * (1.0 - 1e-9) * VARIANCES[0]).sqrt();
    let found = feature([on_gate, 0.2, -0.1]);
    update_pose(&mut sure, &[found], &VARIANCES);
    assert_eq!(sure.associations, [Association::Matched(0)]);
    assert!((sure.log_weight - ln_on_the_gate()).abs() < 1e-6, "{}", sure.log_weight);
    let mut lone = Particle::default();
    let far = feature([3.0, 0.0, 0.0]);
    update_pose(&mut lone, &[far, far], &VARIANCES);
    assert!((lone.log_weight - 2.0 * ln_on_the_gate()).abs() < 1e-12);
}

#[test]
fn law_a_sure_feature_where_a_vague_one_was_is_a_match_and_outweighs_a_new_one() {
    let of_noise = |factor: f64| {
        let sigmas = VARIANCES.map(|v| Some(factor * v.sqrt()));
        sighted(&[Feature { sigmas, ..feature([3.0, 0.2, -0.1]) }])
    };
    let take = |particle: &mut Particle, factor: f64| {
        let seen = SweepObservations { observations: &of_noise(factor), mounting: &mounting() };
        particle.update_pose(&seen, &mut Scratch::default());
        particle.update_map(&seen, &Visibility::blind(10.0), &mut Scratch::default());
    };
    let mut lone = Particle::default();
    take(&mut lone, 6.0);
    let view = SensorView::new(&lone.belief.mean, &mounting());
    let (mean_m, covariance_m2) = view.locate(&[3.0, 0.2, -0.1], &VARIANCES.map(|v| 36.0 * v));
    let landmark = &lone.landmarks[0];
    assert_eq!(landmark.mean_m, mean_m);
    for (got, want) in landmark.covariance_m2.iter().flatten().zip(covariance_m2.iter().flatten()) {
        assert!((got - want).abs() < 1e-12 * covariance_m2[0][0], "{got} {want}");
    }
    let weight = lone.log_weight;
    take(&mut lone, 1.0 / 6.0);
    assert_eq!(lone.associations, [Association::Matched(0)]);
    let as_new = of_noise(1.0 / 6.0)[0].ln_unmatched;
    assert!(lone.log_weight - weight > as_new, "{} {as_new}", lone.log_weight - weight);
}

#[test]
fn law_two_landmarks_of_like_likelihood_are_left_alone() {
    let mut torn = Particle::default();
    let view = SensorView::new(&torn.belief.mean, &mounting());
    for aside in [-0.02, 0.02] {
        let (mean_m, covariance_m2) = view.locate(&[2.0, aside, 0.0], &VARIANCES);
        torn.landmarks.push(Landmark { mean_m, covariance_m2, existence: 1.0, known: None });
    }
    let between = feature([2.0, 0.001, 0.0]);
    update_pose(&mut torn, &[between], &VARIANCES);
    assert_eq!(torn.associations, vec![Association::Ambiguous([1, 0])]);
    // Both were seen; the less likely one is believed in less.
    let seen = SweepObservations { observations: &sighted(&[between]), mounting: &mounting() };
    let everywhere: Vec<DVec3> =
        (0..360).map(|deg| DVec3::from(measurement::point_m(&[1.0, f64::from(deg).to_radians(), 0.0]))).collect();
    torn.update_map(&seen, &Visibility::free(10.0, &everywhere), &mut Scratch::default());
    let existence: Vec<f64> = torn.landmarks.iter().map(|l| l.existence).collect();
    assert_eq!(existence, [1.0 + MISSED, 1.0]);
}

#[test]
fn law_a_number_that_is_seen_twice_at_first_sight_is_one_landmark() {
    let mut lone = Particle::default();
    let twice = [3.0, 3.02].map(|range_m| Feature { known: Some(7), ..feature([range_m, 0.1, 0.0]) });
    update_pose(&mut lone, &twice, &VARIANCES);
    let seen = SweepObservations { observations: &sighted(&twice), mounting: &mounting() };
    lone.update_map(&seen, &Visibility::blind(10.0), &mut Scratch::default());
    let [landmark] = lone.landmarks.as_slice() else { panic!("{} landmarks", lone.landmarks.len()) };
    let view = SensorView::new(&lone.belief.mean, &mounting());
    let [range_m, ..] = view.predict(&landmark.mean_m).expect("in view").polar;
    assert!((range_m - 3.01).abs() < 1e-9, "the mean of both: {range_m}");
}

/// Draws between -1 and 1, the same each time.
fn numbers(from: usize) -> impl Iterator<Item = f64> {
    (from..).map(|i| math::sin(1.7 * (i * i) as f64))
}

/// Features around a particle's landmarks, each with the landmark's distance squared and whether it is looked at.
fn looked_at(believed: &Particle, variances: &Vector<3>, draws: &mut dyn Iterator<Item = f64>) -> Vec<(f64, bool)> {
    let (view, noise) = (SensorView::new(&believed.belief.mean, &mounting()), diagonal(variances));
    let mut places = LandmarkIndex::default();
    places.fill(&believed.landmarks);
    let mut found = Vec::new();
    for (index, landmark) in believed.landmarks.iter().enumerate() {
        let Some(at) = view.predict(&landmark.mean_m) else { continue };
        for _ in 0..10 {
            let mut off = || draws.next().expect("no end");
            let [range_m, bearing_rad, elevation_rad] = at.polar;
            let polar =
                [(range_m * (1.0 + 0.5 * off())).max(0.2), bearing_rad + 0.6 * off(), elevation_rad + 0.3 * off()];
            let feature = feature(polar);
            let mut candidate = Candidate::default();
            if believed.judge(index, &feature, &view, &noise, f64::INFINITY, &mut candidate) {
                let ring = believed.ring(&polar, &view, &noise);
                let reach_m = ring.reach_m(noise[1][1] + noise[2][2], places.most_variance_m2());
                let near = places.within(reach_m, &view.in_map(&measurement::point_m(&polar)));
                found.push((candidate.distance2, near.contains(&(index as u32))));
            }
        }
    }
    found
}

#[test]
fn law_landmarks_within_the_gate_are_looked_at() {
    let (mut within, mut left_out) = (0, 0);
    for trial in 0..3000 {
        let mut draws = numbers(200 * trial);
        let mut believed = particle([1e-6, 1e-2, 0.3, 1.0][trial % 4]);
        believed.belief.mean.iter_mut().zip(draws.by_ref()).for_each(|(mean, n)| *mean += 0.5 * n);
        let variances = VARIANCES.map(|v| v * [0.02, 0.1, 1.0, 4.0][trial % 4]);
        for (judged, is_near) in looked_at(&believed, &variances, &mut draws) {
            assert!(is_near || judged > NEW_BEYOND, "{trial}: {judged}");
            within += u32::from(judged <= NEW_BEYOND);
            left_out += u32::from(!is_near);
        }
    }
    // There is something to leave out, and something to keep.
    assert!(within > 1000 && left_out > 1000, "{within}, {left_out}");
}

#[test]
fn extreme_landmarks_at_arms_length_of_a_rover_that_is_lost_along_a_line_are_looked_at_within_the_gate_of_a_match() {
    let mut within = 0;
    for trial in 0..3000 {
        let mut draws = numbers(200 * trial);
        let mut lost = particle(1e-6);
        let along: Vector<3> = std::array::from_fn(|_| draws.next().expect("no end"));
        let sigma_m = [0.05, 0.15, 0.3, 0.6][trial % 4];
        for r in 0..3 {
            for c in 0..3 {
                lost.belief.covariance[r][c] += sigma_m * sigma_m * along[r] * along[c];
            }
        }
        let view = SensorView::new(&lost.belief.mean, &mounting());
        for (landmark, n) in lost.landmarks.iter_mut().zip([0.4, 0.7, 1.1]) {
            let bearing_rad = 3.0 * draws.next().expect("no end");
            landmark.mean_m = view.in_map(&measurement::point_m(&[n, bearing_rad, -0.4]));
        }
        let floor = [1e-4, 1.9e-5, 1.9e-5];
        for (judged, is_near) in looked_at(&lost, &floor, &mut draws) {
            assert!(is_near || judged > GATE, "{trial}: {judged}");
            within += u32::from(judged <= GATE);
        }
    }
    // So exact are features here that few of those that are drawn may be the landmark.
    assert!(within > 100, "{within}");
}

#[test]
fn law_a_landmark_that_the_range_rules_out_is_judged_too_far() {
    let (mut ruled_out, mut judged) = (0, 0);
    for trial in 0..200 {
        let mut draws = numbers(1000 * trial);
        let mut believed = particle([1e-2, 1.0, 10.0][trial % 3]);
        for (mean, n) in believed.belief.mean.iter_mut().zip(draws.by_ref()) {
            *mean += 0.5 * n;
        }
        let view = SensorView::new(&believed.belief.mean, &mounting());
        let noise = diagonal(&VARIANCES);
        for landmark in &mut believed.landmarks {
            for (mean, n) in landmark.mean_m.iter_mut().zip(draws.by_ref()) {
                *mean += n;
            }
        }
        for index in 0..3 {
            let prediction = view.predict(&believed.landmarks[index].mean_m).expect("in view");
            for off_m in draws.by_ref().take(20) {
                let polar = [(prediction.polar[0] + 3.0 * off_m).max(0.2), prediction.polar[1], prediction.polar[2]];
                let feature = feature(polar);
                let mut candidate = Candidate::default();
                assert!(believed.judge(index, &feature, &view, &noise, f64::INFINITY, &mut candidate));
                let far = believed.ring(&polar, &view, &noise).rules_out(&believed.landmarks[index]);
                assert!(!far || candidate.distance2 > NEW_BEYOND, "{trial}: {}", candidate.distance2);
                ruled_out += u32::from(far);
                judged += u32::from(candidate.distance2 > NEW_BEYOND);
            }
        }
    }
    // Rules out most of what is too far.
    assert!(2 * ruled_out > judged && judged > 1000, "{ruled_out} of {judged}");
}
