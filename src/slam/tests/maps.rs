//! Features and the map that is made of them.

use super::*;

#[test]
fn law_features_bring_the_pose_in_and_the_map_stays_as_large_as_the_world() {
    let start = Pose::default();
    let rocks = field(start.position_m);
    let mut slam = slam(&fastslam(100), &start);
    let end = drive_ahead(&mut slam, &start, &rocks, 30);
    let estimate = slam.estimate();
    assert!(distance_m(&estimate.pose, &end) < 0.08, "{:?}", estimate.pose);
    assert!(estimate.matched >= 8 && estimate.landmarks >= 15, "{estimate:?}");
    assert_eq!(slam.mode(), Mode::Slam);
    let (_, landmarks) = slam.best();
    for landmark in landmarks.iter().filter(|l| l.existence > 0.8) {
        let at = DVec3::from_array(landmark.mean_m);
        assert!(rocks.iter().any(|r| r.distance(at) < 0.2), "{at}");
    }
}

#[test]
fn law_a_landmark_is_matched_once_in_a_sweep() {
    // Two features just far enough apart to both be taken, one landmark between them.
    let start = Pose::default();
    let view = everywhere(3.6);
    let mut slam = slam(&fastslam(20), &start);
    slam.step(&rest(&start)).expect("upright");
    slam.observe_features(&[feature([2.0, 0.0, -0.1])], &view, &streams(0)).expect("upright");
    slam.step(&rest(&start)).expect("upright");
    let two = [feature([2.0, 0.078, -0.1]), feature([2.0, -0.078, -0.1])];
    let estimate = slam.observe_features(&two, &view, &streams(1)).expect("upright");
    assert_eq!((estimate.features, estimate.matched), (2, 1));
    assert_eq!(estimate.new_landmarks, 0, "the other is too near to be new");
}

#[test]
fn extreme_measurement_noise_from_the_floor_to_useless() {
    let start = Pose::default();
    let run = |inflation: f64, seed: u64| {
        let params = FastslamParams { particles: 100, measurement_inflation: inflation, ..FastslamParams::default() };
        let mut slam = slam(&SlamParams::Fastslam(params), &start);
        drive_among(&mut slam, &start, &field(DVec3::ZERO), 20, seed, inflation > 1.0);
        sound(&slam);
        slam.estimate()
    };
    run(1e-12, 1);
    // Known landmarks: gates of any width would leave the associations to chance.
    let mut reckoned = slam(&SlamParams::DeadReckoning, &start);
    drive_ahead(&mut reckoned, &start, &[], 20);
    let reckoned = reckoned.estimate();
    let (mut ratios, mut offs, seeds) = ([0.0; 6], [0.0; 3], 40);
    for seed in 0..seeds {
        let useless = run(1e12, seed);
        let off_m = useless.pose.position_m - reckoned.pose.position_m;
        for (i, ratio) in ratios.iter_mut().enumerate() {
            *ratio += useless.covariance[i][i] / reckoned.covariance[i][i] / seeds as f64;
        }
        for (i, off) in offs.iter_mut().enumerate() {
            *off += off_m[i] / reckoned.sigmas()[i] / seeds as f64;
        }
    }
    // Each of the few resamplings of some 50 effective particles knows a variance to 20 %, a mean to 14 % of a sigma; with
    // five of them and 40 seeds the averages are known to 7 and 5 %: three of these.
    assert!(ratios.iter().all(|r| (r - 1.0).abs() < 0.21), "{ratios:?}");
    assert!(offs.iter().all(|off| off.abs() < 0.15), "{offs:?}");
}

#[test]
fn extreme_a_kidnapped_rover_does_not_match_wrong_landmarks() {
    let start = Pose::default();
    let view = everywhere(3.6);
    let rocks = [DVec3::new(2.0, 0.0, 0.2), DVec3::new(2.5, 1.5, 0.2), DVec3::new(1.0, -2.0, 0.2)];
    let mut slam = slam(&fastslam(50), &start);
    for step in 0..4 {
        slam.step(&rest(&start)).expect("upright");
        slam.observe_features(&seen(&rocks, &start), &view, &streams(step)).expect("upright");
    }
    let carried = Pose { position_m: DVec3::new(0.0, -2.0, 0.0), ..start };
    slam.step(&rest(&carried)).expect("upright");
    let estimate = slam.observe_features(&seen(&rocks, &carried), &view, &streams(9)).expect("upright");
    assert!(estimate.features >= 2);
    assert_eq!(estimate.matched, 0, "{estimate:?}");
    // The nearest landmark to where each feature seems to be, whatever its distance.
    let seem = |rock: &DVec3| *rock - carried.position_m;
    let nearest = |at: DVec3| (0..3).min_by(|&a, &b| rocks[a].distance(at).total_cmp(&rocks[b].distance(at)));
    let wrong = (0..3).filter(|&k| nearest(seem(&rocks[k])) != Some(k)).count();
    assert!(wrong > 0);
    row(
        Family::Slam,
        "carried 2 m aside between two sweeps",
        &format!("nearest landmark without a gate: {wrong} of 3 features matched to another's landmark"),
        &format!("none of {} features matched; new landmarks or left out", estimate.features),
    );
}

#[test]
fn extreme_lost_features_switch_the_mode_and_found_ones_switch_it_back() {
    let start = Pose::default();
    let rocks = field(DVec3::ZERO);
    let view = everywhere(3.6);
    let mut slam = slam(&fastslam(50), &start);
    drive_ahead(&mut slam, &start, &rocks, 10);
    assert_eq!(slam.mode(), Mode::Slam);
    let known = slam.estimate().sigmas()[0];
    let mut pose = Pose { position_m: DVec3::new(1.0, 0.0, 0.0), ..start };
    for k in 11..=25u32 {
        pose.position_m.x += 0.1;
        slam.step(&Reading { dt_s: 1.0, speed_mps: 0.1, ..rest(&pose) }).expect("upright");
        if k % 5 == 0 {
            slam.observe_features(&[], &Visibility::blind(0.0), &streams(k)).expect("upright");
        }
    }
    assert_eq!(slam.mode(), Mode::DeadReckoning);
    let lost = slam.estimate();
    assert!(lost.sigmas()[0] > 1.5 * known);
    slam.step(&rest(&pose)).expect("upright");
    let regained = slam.observe_features(&seen(&rocks, &pose), &view, &streams(26)).expect("upright");
    assert_eq!(slam.mode(), Mode::Slam);
    assert!(regained.sigmas()[0] < 0.7 * lost.sigmas()[0]);
    assert!((regained.pose.position_m.x - pose.position_m.x).abs() < 3.0 * lost.sigmas()[0]);
}

#[test]
fn extreme_ten_thousand_landmarks() {
    let start = Pose::default();
    let params = FastslamParams { particles: 2, max_features: 20_000, ..FastslamParams::default() };
    let mut slam = slam(&SlamParams::Fastslam(params), &start);
    let many: Vec<Feature> = (0..10_000u32)
        .map(|i| {
            let polar = [1.0 + 3e-4 * f64::from(i), math::wrap_angle(0.7 * f64::from(i)), 0.0];
            Feature { known: Some(i), ..feature(polar) }
        })
        .collect();
    slam.step(&rest(&start)).expect("upright");
    slam.observe_features(&many, &Visibility::blind(0.0), &streams(0)).expect("upright");
    assert_eq!(slam.best().1.len(), 10_000);
    slam.step(&rest(&start)).expect("upright");
    slam.observe_features(&[feature([9.0, 0.0, 0.0])], &Visibility::blind(0.0), &streams(1)).expect("upright");
    sound(&slam);
    assert_eq!(slam.estimate().new_landmarks, 1);
    let state = 6.0 + 3.0 * 10_000.0;
    row(
        Family::Slam,
        "ten thousand landmarks",
        &format!("EKF-SLAM: one covariance of {state} x {state} numbers, {:.1} GB", state * state * 8e-9),
        &format!(
            "{} landmarks of {} bytes a particle; a new feature finds its place among them",
            10_000,
            std::mem::size_of::<Landmark>()
        ),
    );
}

#[test]
fn law_missing_landmarks_fade_and_hidden_ones_stay() {
    let start = Pose::default();
    let rock = [feature([2.0, 0.0, -0.1])];
    let run = |view: &Visibility| {
        let mut slam = slam(&fastslam(5), &start);
        for step in 0..12 {
            slam.step(&rest(&start)).expect("upright");
            let features: &[Feature] = if step < 3 { &rock } else { &[] };
            slam.observe_features(features, view, &streams(step)).expect("upright");
        }
        slam.best().1.len()
    };
    assert_eq!(run(&everywhere(3.6)), 0);
    assert_eq!(run(&everywhere(1.5)), 1, "out of reach");
    assert_eq!(run(&Visibility::blind(3.6)), 1, "never looked at");
}

/// A normalised square is none before a sweep, and never negative; an error of the range alone adds to it.
#[test]
fn law_the_mean_innovation_grows_with_the_error_of_what_is_seen() {
    let start = Pose::default();
    let rocks = field(start.position_m);
    let innovation = |error_m: f64| {
        let mut slam = slam(&fastslam(20), &start);
        assert_eq!(slam.mean_innovation(), None);
        drive_ahead(&mut slam, &start, &rocks, 3);
        let here = slam.best().0;
        let mut found = seen(&rocks, &here);
        found.iter_mut().for_each(|feature| feature.polar[0] += error_m);
        slam.observe_features(&found, &everywhere(4.0), &streams(4)).expect("a sweep");
        slam.mean_innovation().expect("matches")
    };
    let (right, wrong) = (innovation(0.0), innovation(0.05));
    assert!(right >= 0.0 && wrong > right, "{right} {wrong}");
}
