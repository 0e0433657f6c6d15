//! What the extractor finds in sweeps, and what the filter makes of it.

use super::extraction::{Finding, Study, Tally};
use super::params;
use super::trial::{ate_m, error, fastslam, mean, nees, run, seeds};
use super::world::Scenario;
use marsyard::random::{Stage, Streams};
use marsyard::slam::{FastslamParams, RegistrationParams, Slam, SlamParams};

/// Yards of the extraction study, ten scans in each.
const YARDS: u64 = 20;
/// The extractor's own share, to say what share a bin would want.
const PUSH_BACK: f64 = 0.58;

#[test]
fn dist_features_of_polyhedra_lie_at_their_rocks_whatever_the_size() {
    let study = Study::new();
    let mut tally = Tally::default();
    for seed in 1..=YARDS {
        study.yard(seed, 10, &mut tally);
    }
    let precision = tally.findings.len() as f64 / (tally.findings.len() + tally.spurious) as f64;
    println!(
        "{} scans, {:.1} features a scan, precision {precision:.3}, {:.2} ms an extraction",
        tally.scans,
        tally.findings.len() as f64 / tally.scans as f64,
        1e3 * tally.extraction_s / tally.scans as f64
    );
    for (low, high) in [(0.1, 0.2), (0.2, 0.3), (0.3, 0.4), (0.4, 0.6), (0.6, 0.9)] {
        let within = |d: f64| (low..high).contains(&d);
        let bin: Vec<_> = tally.findings.iter().filter(|f| within(f.rock_diameter_m)).collect();
        let rocks: Vec<_> = tally.rocks.iter().filter(|(d, _)| within(*d)).collect();
        let recall = rocks.iter().filter(|(_, found)| *found).count() as f64 / rocks.len() as f64;
        let of = |value: fn(&Finding) -> f64| {
            let m = mean(bin.iter().map(|f| value(f)));
            let sd = mean(bin.iter().map(|f| (value(f) - m) * (value(f) - m))).sqrt();
            (100.0 * m, 100.0 * sd)
        };
        let (along, across, top) = (of(|f| f.along_m), of(|f| f.across_m), of(|f| f.top_m));
        // The share that would leave no bias in this bin.
        let share =
            mean(bin.iter().map(|f| PUSH_BACK * f.half_width_m - f.along_m)) / mean(bin.iter().map(|f| f.half_width_m));
        println!(
            "rocks {low}-{high} m: {} found, recall {recall:.2}; along {:.1} +- {:.1} cm, across {:.1} +- {:.1}, top {:.1} +- {:.1}; share {share:.2}",
            bin.len(),
            along.0,
            along.1,
            across.0,
            across.1,
            top.0,
            top.1
        );
        assert!(bin.len() >= 30, "{} rocks of {low}-{high} m", bin.len());
        assert!(along.0.abs() <= 2.0, "rocks of {low}-{high} m lie {:.1} cm off along the line of sight", along.0);
        assert!(across.0.abs() <= 2.0, "rocks of {low}-{high} m lie {:.1} cm off across it", across.0);
    }
    assert!(precision >= 0.85, "{precision}");
}

#[test]
fn dist_extracted_features_beat_dead_reckoning_and_come_near_to_points() {
    let study = Study::new();
    let scenario = Scenario::a();
    let (mut reckoned_m, mut points_m, mut extracted_m, mut landmarks) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut counts, mut registered_m) = (Vec::new(), Vec::new());
    let rings = 1..=20.min(*seeds().end());
    for seed in rings {
        let ring = study.ring(seed, &scenario);
        let noise = scenario.noise();
        reckoned_m.push(run(&SlamParams::DeadReckoning, &ring.drive, &noise, seed).ate_m);
        points_m.push(fastslam(&ring.drive, &scenario, params(100), seed).ate_m);
        let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Slam, step: 0 };
        let drive = &ring.drive;
        for registration in [false, true] {
            let method = SlamParams::Fastslam(FastslamParams { registration, ..params(100) });
            let mut slam = Slam::new(&method, &noise, &drive.truth[0], &drive.rover_from_sensor).expect("a filter");
            let mut errors = Vec::new();
            for (k, truth) in drive.truth.iter().enumerate() {
                let streams = streams.at_step(k as u32);
                slam.step(&drive.readings[k]).expect("upright");
                if let Some(sweep) = &ring.sweeps[k] {
                    let estimate = slam.observe(&sweep.returns, &streams).expect("upright");
                    if !registration {
                        counts.push((f64::from(estimate.features), f64::from(estimate.matched)));
                    }
                }
                let estimate = slam.estimate();
                errors.push((error(&estimate.pose, truth), estimate.covariance));
            }
            if registration {
                registered_m.push(ate_m(&errors));
            } else {
                extracted_m.push(ate_m(&errors));
                landmarks.push(f64::from(slam.estimate().landmarks));
            }
        }
    }
    let better = mean(extracted_m.iter().zip(&reckoned_m).map(|(e, r)| f64::from(u8::from(e < r))));
    let (reckoned_m, points_m, extracted_m) = (mean(reckoned_m), mean(points_m), mean(extracted_m));
    let registered_m = mean(registered_m);
    println!(
        "ring: extracted {extracted_m:.3} m, points {points_m:.3}, dead reckoning {reckoned_m:.3}; better in {:.0} %; {:.1} features a scan, {:.1} matched; {:.0} landmarks",
        100.0 * better,
        mean(counts.iter().map(|c| c.0)),
        mean(counts.iter().map(|c| c.1)),
        mean(landmarks)
    );
    assert!(extracted_m <= 1.5 * points_m, "{extracted_m} {points_m}");
    assert!(extracted_m <= 0.9 * reckoned_m, "{extracted_m} {reckoned_m}");
    println!("with sweeps laid on one another {registered_m:.3} m");
    assert!(registered_m <= 0.9 * extracted_m, "{registered_m} {extracted_m}");
}

#[test]
fn dist_registration_alone_beats_dead_reckoning_and_owns_up_to_its_errors() {
    let study = Study::new();
    let scenario = Scenario::a();
    let (mut reckoned_m, mut registered_m, mut of_ends) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 1..=20.min(*seeds().end()) {
        let ring = study.ring(seed, &scenario);
        let (drive, noise) = (&ring.drive, scenario.noise());
        reckoned_m.push(run(&SlamParams::DeadReckoning, drive, &noise, seed).ate_m);
        let method = SlamParams::Registration(RegistrationParams::default());
        let mut slam = Slam::new(&method, &noise, &drive.truth[0], &drive.rover_from_sensor).expect("a filter");
        let mut errors = Vec::new();
        for (k, truth) in drive.truth.iter().enumerate() {
            slam.step(&drive.readings[k]).expect("upright");
            if let Some(sweep) = &ring.sweeps[k] {
                let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Slam, step: k as u32 };
                slam.observe(&sweep.returns, &streams).expect("upright");
            }
            let estimate = slam.estimate();
            // Nothing is drawn, so that no ancestor can be lost.
            assert!(!estimate.sigma_optimistic && slam.ancestors() == 1);
            errors.push((error(&estimate.pose, truth), estimate.covariance));
        }
        registered_m.push(ate_m(&errors));
        of_ends.push(nees::<3>(errors.last().expect("a step"), 0));
    }
    let (registered_m, reckoned_m, of_ends) = (mean(registered_m), mean(reckoned_m), mean(of_ends));
    println!(
        "ring: registration alone {registered_m:.3} m, dead reckoning {reckoned_m:.3}; NEES of the position {of_ends:.2}"
    );
    assert!(registered_m <= 0.7 * reckoned_m, "{registered_m} {reckoned_m}");
    // Of the means of 20 honest drives 99.9 % lie between 1.5 and 5.1; long drives have headings that err less than they tell.
    assert!((1.0..=5.1).contains(&of_ends), "{of_ends}");
}
