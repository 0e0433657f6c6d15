//! The filter at its extremes, beside what `textbook` gives there. Metres, radians.

use super::textbook::{Planar, linear_weights, low_variance, nearest_neighbour_map};
use super::*;
use crate::extremes::{Family, row};
use crate::slam::measurement::SensorView;
use crate::slam::weights::{normalise, systematic};

/// A wavering error of size 1, known to nobody.
fn waver(k: u32) -> f64 {
    math::sin(12.9898 * f64::from(k) + 0.3)
}

#[test]
fn extreme_no_particle_and_one() {
    let refused = Slam::new(&fastslam(0), &NOISE, &Pose::default(), &mast()).map(|_| ()).unwrap_err();
    let mean = linear_weights(&[]).iter().sum::<f64>() / 0.0;
    assert!(mean.is_nan());
    row(Family::Slam, "no particle", &format!("mean of the cloud: {mean}"), &format!("refused: {refused}"));

    let start = Pose { yaw_rad: 2.0, ..Pose::default() };
    let mut reckoned = slam(&SlamParams::DeadReckoning, &start);
    drive_ahead(&mut reckoned, &start, &[], 30);
    let mut alone = slam(&fastslam(1), &start);
    drive_ahead(&mut alone, &start, &[], 30);
    let apart_m = distance_m(&reckoned.estimate().pose, &alone.estimate().pose);
    assert!(apart_m < 1e-9);
    // A spread over n - 1.
    let particles = [1.0_f64];
    let spread = (0.0 / (particles.len() as f64 - 1.0)).sqrt();
    row(
        Family::Slam,
        "one particle, no features",
        &format!("spread of the particles over n - 1: {spread}"),
        &format!("dead reckoning, to {apart_m:.0e} m, its sigmas carried by the particle"),
    );
}

#[test]
fn extreme_no_noise_at_all() {
    let start = Pose::default();
    let mut textbook = Planar::default();
    textbook.drive(0.1, 0.0, [0.0; 3]);
    textbook.observe([1.9, 0.0], [2.0, 0.0], [0.0; 2]);
    assert!(!textbook.is_finite());
    let mut slam = Slam::new(&fastslam(40), &EXACT, &start, &mast()).expect("a filter");
    let end = drive_ahead(&mut slam, &start, &field(DVec3::ZERO), 20);
    sound(&slam);
    let off_m = distance_m(&slam.estimate().pose, &end);
    assert!(off_m < 0.05, "{off_m}");
    row(
        Family::Slam,
        "instruments and features without noise",
        "S is singular: state NaN at the first feature",
        &format!("after 2 m off by {:.0} mm, covariance sound (floors of 1 mm and 0.01 deg a step)", 1e3 * off_m),
    );

    let driftless = InstrumentNoise { odometry_m_per_sqrt_m: 0.0, heading_rad_per_sqrt_m: 0.0, ..NOISE };
    let mut slam = Slam::new(&fastslam(40), &driftless, &start, &mast()).expect("a filter");
    // The odometry is 5 % long all the same.
    let mut textbook = Planar::default();
    slam.step(&rest(&start)).expect("upright");
    for _ in 1..=40 {
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.105, ..rest(&start) }).expect("upright");
        textbook.drive(0.105, 0.0, [0.0; 3]);
    }
    let estimate = slam.estimate();
    let sigmas = (estimate.pose.position_m.x - 4.0) / estimate.sigmas()[0];
    let claimed = (textbook.mean[0] - 4.0) / textbook.covariance[0][0].sqrt();
    assert!(sigmas.is_finite() && claimed.is_infinite());
    row(
        Family::Slam,
        "odometry stated as exact, 5 % long, 4 m",
        &format!("sigma 0: off by {claimed} sigmas"),
        &format!(
            "sigma {:.1} mm: off by {sigmas:.0} sigmas; wrong by what was stated, but never certain",
            1e3 * estimate.sigmas()[0]
        ),
    );
}

#[test]
fn extreme_a_feature_noise_stated_far_too_small() {
    // Features are off by 1 cm and 0.5 degrees, their noise is stated as a millionth of that.
    let start = Pose::default();
    let rocks: Vec<DVec3> = field(DVec3::ZERO).into_iter().filter(|r| r.length() < 3.0).collect();
    let noisy = |k: u32| -> Vec<Feature> {
        rocks
            .iter()
            .zip(0..)
            .flat_map(|(rock, id)| {
                seen(&[*rock], &start).into_iter().map(move |mut f| {
                    f.polar[0] += 0.01 * waver(40 * k + id);
                    f.polar[1] += 0.0087 * waver(40 * k + id + 7);
                    Feature { known: Some(id), ..f }
                })
            })
            .collect()
    };
    let params = FastslamParams { particles: 100, measurement_inflation: 1e-12, ..FastslamParams::default() };
    let mut slam = slam(&SlamParams::Fastslam(params), &start);
    let view = everywhere(3.6);
    let mut textbook = Planar::default();
    for k in 0..20 {
        // A creep of a millimetre that does not happen, so that there is something to correct.
        slam.step(&Reading { dt_s: 1.0, speed_mps: 1e-3, ..rest(&start) }).expect("upright");
        textbook.drive(1e-3, 0.0, [2.5e-6, 2.5e-6, 1e-6]);
        let features = noisy(k);
        slam.observe_features(&features, &view, &streams(k)).expect("upright");
        for feature in &features {
            let rock = rocks[feature.known.unwrap() as usize];
            // Level ranges and bearings from the mast: the planar world.
            let level = feature.polar[0] * math::cos(feature.polar[2]);
            let (s, c) = math::sin_cos(feature.polar[1]);
            let from_rover = [level * c + 0.2, level * s];
            let polar = [math::hypot(from_rover[0], from_rover[1]), math::atan2(from_rover[1], from_rover[0])];
            textbook.observe(polar, [rock.x, rock.y], [1e-16, 1e-16]);
        }
        sound(&slam);
    }
    let estimate = slam.estimate();
    let own = (0..2).map(|i| estimate.pose.position_m[i].abs() / estimate.sigmas()[i]).fold(0.0, f64::max);
    let theirs = (0..2).map(|i| textbook.mean[i].abs() / textbook.covariance[i][i].max(0.0).sqrt()).fold(0.0, f64::max);
    let broken = !textbook.is_finite() || (0..3).any(|i| textbook.covariance[i][i] < 0.0);
    assert!(own < 10.0 && (broken || theirs > 100.0), "{own} {theirs}");
    row(
        Family::Slam,
        "feature noise stated a million times too small",
        &if broken { "a variance below 0 or NaN".to_string() } else { format!("off by {theirs:.0e} of its sigmas") },
        &format!("off by {own:.1} of its sigmas (floors of 1 cm and 0.25 deg), covariance sound"),
    );
}

#[test]
fn extreme_doubles_in_one_sweep_make_no_second_landmark() {
    let start = Pose::default();
    let view = everywhere(3.6);
    let crowd: Vec<Feature> = (0..50).map(|i| feature([2.0 + 1e-4 * f64::from(i), 0.3, -0.1])).collect();
    let pair = vec![feature([2.0, 0.3, -0.1]), feature([2.01, 0.3, -0.1])];
    for (name, features) in [("fifty features at one point", crowd), ("two landmarks a centimetre apart", pair)] {
        let mut slam = slam(&fastslam(20), &start);
        let mut most = 0;
        for step in 0..10 {
            slam.step(&rest(&start)).expect("upright");
            slam.observe_features(&features, &view, &streams(step)).expect("upright");
            sound(&slam);
            most = most.max(slam.best().1.len());
        }
        assert!(most <= 2, "{most}");
        assert_eq!(slam.estimate().matched, 1);
        let places: Vec<[f64; 3]> = features.iter().map(|f| f.polar).collect();
        let textbook = nearest_neighbour_map(&vec![places; 10], 0.3);
        row(
            Family::Slam,
            &format!("{name}, ten sweeps"),
            &format!("nearest neighbour: {textbook} landmarks"),
            &format!("{most} landmark, matched once a sweep"),
        );
    }
}

#[test]
fn extreme_readings_that_are_no_numbers() {
    let (mut slam, still) = driven_and_still();
    let (before, mut textbook) = (slam.estimate(), Planar { covariance: [[1e-4; 3]; 3], ..Planar::default() });
    textbook.read_heading(f64::NAN, 0.01);
    slam.step(&Reading { yaw_rad: Some(f64::NAN), ..still }).expect("upright");
    slam.observe_features(&[feature([f64::NAN, 0.0, 0.0])], &Visibility::blind(0.0), &streams(92)).expect("upright");
    let after = slam.estimate();
    assert_eq!((after.pose, after.covariance, after.skipped), (before.pose, before.covariance, before.skipped + 2));
    assert!(!textbook.is_finite());
    row(
        Family::Slam,
        "a NaN from the sun sensor, a NaN range",
        "state and covariance NaN from then on",
        "both skipped and counted; pose and covariance as before, to the bit",
    );
}

#[test]
fn extreme_features_overhead_and_at_arms_length() {
    let pose = [0.0; 6];
    let view = SensorView::new(&pose, &crate::slam::measurement::Mounting::new(&Transform::IDENTITY));
    assert!(view.predict(&[0.0, 0.0, 2.0]).is_none());
    let (dx, dy) = (0.0_f64, 0.0);
    let slope = dy / (dx * dx + dy * dy);
    let start = Pose::default();
    let mut slam = slam(&fastslam(10), &start);
    slam.step(&rest(&start)).expect("upright");
    let before = slam.estimate();
    for polar in [[2.0, 0.0, 1.57], [0.1, 0.0, 0.0]] {
        slam.observe_features(&[feature(polar)], &Visibility::blind(0.0), &streams(1)).expect("upright");
    }
    let after = slam.estimate();
    assert_eq!((after.pose, after.features, after.skipped), (before.pose, 0, before.skipped + 2));
    assert!(slope.is_nan());
    row(
        Family::Slam,
        "a feature overhead, a feature at 0.1 m",
        &format!("slope of the bearing, dy / (dx^2 + dy^2): {slope}"),
        "both skipped and counted; the pose as before",
    );
}

#[test]
fn extreme_weights_that_all_underflow() {
    let logs = [-2000.0, -2000.0 - math::ln(3.0), -2100.0];
    let textbook = linear_weights(&logs.map(math::exp));
    assert!(textbook.iter().all(|w| w.is_nan()));
    let mut own = logs.to_vec();
    assert!(normalise(&mut own));
    let off = (math::exp(own[0]) - 0.75).abs().max((math::exp(own[1]) - 0.25).abs());
    assert!(off < 1e-12, "{off:e}");
    row(
        Family::Slam,
        "weights of exp(-2000)",
        "0 over 0: all weights NaN",
        &format!("3 to 1 as their logarithms say, to {off:.0e}; none left at all: all equal, and counted"),
    );
}

#[test]
fn extreme_resampling_at_the_ends_of_its_interval() {
    let mut worst = 0.0_f64;
    let (mut outside, mut dead, mut cases) = (0, 0, 0);
    for count in [3, 10, 30, 100, 1000] {
        // Sums that rounding leaves below 1, a weight of 1 among zeros, zeros at both ends.
        let tenth = vec![1.0 / count as f64; count];
        let mut one = vec![0.0; count];
        one[count / 2] = 1.0;
        let mut hollow = vec![1.0 / (count - 2) as f64; count];
        (hollow[0], hollow[count - 1]) = (0.0, 0.0);
        let short: Vec<f64> = tenth.iter().map(|w| w * (1.0 - 1e-9)).collect();
        for weights in [tenth, one, hollow, short] {
            for start in [0.0, 0.5, 1.0 - f64::EPSILON] {
                let parents = systematic(&weights, start);
                assert!(parents.iter().all(|&p| weights[p as usize] > 0.0), "{count}, {start}: {parents:?}");
                for (k, weight) in weights.iter().enumerate() {
                    let own = parents.iter().filter(|&&p| p as usize == k).count() as f64;
                    worst = worst.max((own - count as f64 * weight).abs());
                }
                for parent in low_variance(&weights, start) {
                    outside += usize::from(parent.is_none());
                    dead += usize::from(parent.is_some_and(|k| weights[k] == 0.0));
                    cases += 1;
                }
            }
        }
    }
    assert!(worst < 1.0 + 1e-6 && outside + dead > 0, "{worst}");
    row(
        Family::Slam,
        "resampling: u0 = 0 and 1 - eps, one weight of 1, sums below 1",
        &format!(
            "as printed: {outside} of {cases} offspring past the last particle, {dead} of particles without weight"
        ),
        "none; each particle has N w offspring, rounded down or up",
    );
}
