//! A whole measurement of a small config, what is made of it, and what ends it.

use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;

use super::report::{CurveRow, Ended, GainRow, PipelineRow, Report, Row, Told};
use super::settings::tests::{all, options};
use super::settings::{Settings, Side, Variant};
use super::{
    Event, Group, Options, TradeoffError, chart, combine, farther, front, judging, recommend, records, run, settings,
    table,
};
use crate::config::load;
use crate::measure::study::Study;
use crate::slam::params::SurrogateParams;
use crate::statistics::Interval;

/// A measurement of the training tests' corpus: its knobs of casting and slam, two filters' groups.
static SMALL: LazyLock<Report> = LazyLock::new(|| measured(2));

fn measured(threads: usize) -> Report {
    let only = [Group::Cast, Group::Slam, Group::Yard, Group::Batch];
    let mut options = options("tests/fixtures/training.yaml", &["slam={fastslam: {particles: 3}}"], &only);
    options.threads = threads;
    let mut events = Vec::new();
    let report = run(&options, &AtomicBool::new(false), &mut |event| events.push(event));
    assert!(matches!(events[0], Event::Start { scenes: 8, .. }), "{events:?}");
    assert!(matches!(events.last(), Some(Event::Training { done, of }) if done == of), "{events:?}");
    report.unwrap_or_else(|error| panic!("{error}")).expect("nobody stops it")
}

fn row<'r>(report: &'r Report, name: &str) -> &'r Row {
    report.rows.iter().find(|row| row.name == name).unwrap_or_else(|| panic!("no row {name}"))
}

fn pipeline<'r>(report: &'r Report, name: &str) -> &'r PipelineRow {
    row(report, name).pipeline.as_ref().expect("a pipeline")
}

#[test]
fn equal_all_but_times_for_any_number_of_threads() {
    let (one, two) = (measured(1).timeless(), SMALL.timeless());
    assert!(one == two, "{}\n{}", serde_json::json!(one), serde_json::json!(two));
}

#[test]
fn law_the_reference_differs_in_nothing_from_itself() {
    let reference = row(&SMALL, "reference");
    let cells = pipeline(&SMALL, "reference").cells.as_ref().unwrap();
    assert!(cells.matched > 1000);
    assert_eq!((cells.appeared, cells.vanished, cells.other_label, cells.worst_shift_sd), (0, 0, 0.0, 0.0));
    // Its accuracy has noise of its own all the same.
    assert!(reference.gain().is_none() && reference.whole().unwrap().balanced_accuracy.half_width > 0.0);
    let drive = pipeline(&SMALL, "reference").drive.as_ref().unwrap();
    assert_eq!((drive.max_position_m, drive.max_turn_deg), (0.0, 0.0));
    assert!(pipeline(&SMALL, "reference").ranges.is_none());
}

#[test]
fn law_the_true_pose_has_no_error_and_claims_no_covariance() {
    let pose = pipeline(&SMALL, "truth").pose.as_ref().unwrap();
    assert_eq!((pose.position_m.unwrap().median, pose.mean_nees), (0.0, None));
    let estimated = pipeline(&SMALL, "reference").pose.as_ref().unwrap();
    assert!(estimated.position_m.unwrap().median > 0.0 && estimated.mean_nees.is_some());
    // Casting leaves the drive where it is; so does the pose estimate.
    assert_eq!(pipeline(&SMALL, "truth").drive.as_ref().unwrap().max_position_m, 0.0);
}

/// Bilinear ground is off by the square of its spacing.
#[test]
fn order_range_errors_fall_with_the_square_of_the_spacing() {
    let median = |name: &str| pipeline(&SMALL, name).ranges.as_ref().unwrap().median_m.unwrap();
    for method in ["raster", "mesh"] {
        for (coarse, fine) in [("0.2", "0.1"), ("0.1", "0.05")] {
            let ratio = median(&format!("{method} {coarse} m")) / median(&format!("{method} {fine} m"));
            assert!((3.2..4.8).contains(&ratio), "{method} {coarse} over {fine}: {ratio}");
        }
    }
}

#[test]
fn law_more_work_costs_more() {
    let cpu = |name: &str| pipeline(&SMALL, name).cpu_ms.unwrap().median;
    assert!(cpu("mesh 0.05 m") > cpu("reference") && cpu("truth") < cpu("reference"));
}

#[test]
fn law_a_curve_has_four_sizes_that_grow_in_scenes_and_in_the_cost_of_making_them() {
    for row in &SMALL.rows {
        let curve = &row.worth.as_ref().unwrap_or_else(|| panic!("no curve of {}", row.name)).curve;
        // Of seven scenes that train 1, 2, 4 and 7; one that stops.
        assert_eq!(curve.iter().map(|size| size.scenes).collect::<Vec<_>>(), [2, 3, 5, 8], "{}", row.name);
        assert!(curve.windows(2).all(|pair| pair[0].generate_cpu_s < pair[1].generate_cpu_s), "{}", row.name);
        for size in curve {
            assert!((0.3..=1.0).contains(&size.balanced_accuracy.mean), "{size:?}");
            assert_eq!((size.by_seed.len(), size.worst.clone()), (2, None));
            assert!(size.own.is_some_and(|own| (own - size.balanced_accuracy.mean).abs() < 1e-12));
            assert!(size.train_cpu_s >= size.learning_cpu_s && (0.0..=1.0).contains(&size.missed.mean));
        }
    }
}

#[test]
fn law_equal_cells_are_worth_the_same_at_equal_scenes() {
    // The reference of the fixture has three particles, and the trainer's f64 has its own training of the same cells.
    let accuracy = |name: &str| row(&SMALL, name).whole().unwrap().by_seed.clone();
    assert_ne!(accuracy("reference"), accuracy(settings::OTHER_DRAWS));
    assert_ne!(accuracy("reference"), accuracy("truth"));
    let floor = row(&SMALL, settings::OTHER_DRAWS).gain().map(|gain| gain.balanced_accuracy.mean.abs());
    assert_eq!(floor, SMALL.noise_floor);
    for row in SMALL.rows.iter().filter(|row| row.side != Side::Trainer && row.name != settings::OTHER_DRAWS) {
        let Some(gain) = row.gain() else { continue };
        let is_apart = gain.balanced_accuracy.mean.abs() > gain.balanced_accuracy.half_width.max(floor.unwrap_or(0.0));
        assert_eq!(gain.told != Told::NotApart, is_apart, "{}: {gain:?}", row.name);
    }
}

#[test]
fn law_held_out_families_judge_where_there_are_some() {
    let reference = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/mixed.yaml"), &[]).unwrap();
    let make = |there, numbers| {
        judging::make(&reference, there, numbers, 2, &AtomicBool::new(false), &mut |_| ()).unwrap().unwrap()
    };
    // As many at once as in two rounds.
    let test = make(make(judging::TestScenes::default(), 0..1), 1..2);
    assert_eq!((&test.groups, test.rows()), (&make(judging::TestScenes::default(), 0..2).groups, test.rows()));
    let held_out = reference.families.iter().filter(|family| family.hold_out).count();
    assert_eq!((test.groups.len(), test.judging().len()), (1 + held_out, held_out));
    assert!(test.groups.iter().all(|group| group.scenes == 2 && group.cells > 0), "{:?}", test.groups);
    assert!(test.groups[0].held_out.is_none() && !test.groups[0].judges);
}

#[test]
fn law_every_output_names_every_setting() {
    let (text, page) = (table::text(&SMALL), table::markdown(&SMALL));
    let drawn = chart::svg(&SMALL).expect("a chart");
    assert!(drawn.starts_with("<svg") && drawn.trim_end().ends_with("</svg>"));
    for row in &SMALL.rows {
        assert!(text.contains(&row.label()) && page.contains(&row.label()), "{}", row.label());
    }
    let is_told = |row: &&Row| row.gain().is_some_and(|gain| matches!(gain.told, Told::Better | Told::Worse));
    let mut apart = SMALL.side(Side::Pipeline).filter(is_told);
    assert!(drawn.contains("reference") && apart.all(|row| drawn.contains(&row.name)));
    for said in ["recommended pipeline: ", "recommended filter: ", "noise floor: ", "times smaller"] {
        assert!(text.contains(said) && page.contains(said), "{said}");
    }
    let json = serde_json::to_string(&*SMALL).unwrap();
    assert!(serde_json::from_str::<Report>(&json).unwrap() == *SMALL);
    let bytes = records::parquet(&SMALL).unwrap();
    let reader =
        parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(bytes)).unwrap();
    assert_eq!(reader.metadata().file_metadata().num_rows() as usize, SMALL.rows.len());
}

/// A report of settings with these gains, in points; other settings have none, and other draws gain 0.2.
fn with_gains(settings: &Settings, report: &Report, gains: &[(&str, f64)]) -> Report {
    let mut report = Report { noise_floor: Some(0.002), ..report.clone() };
    let template = row(&report, "truth").clone();
    report.rows = settings
        .list
        .iter()
        .map(|setting| {
            let mut worth = template.worth.clone().expect("a curve");
            let gain = gains.iter().find(|(name, _)| *name == setting.name);
            worth.gain = gain.map(|(_, points)| GainRow {
                cpu_s: 1.0,
                scenes: 8,
                reference_scenes: 4,
                balanced_accuracy: Interval { mean: 0.01 * points, half_width: 0.001 },
                fewer_missed: Interval { mean: 0.02 * points, half_width: 0.01 },
                told: if *points > 0.0 { Told::Better } else { Told::Worse },
            });
            Row {
                side: setting.side(),
                group: setting.group,
                name: setting.name.clone(),
                sets: setting.sets.clone(),
                may_be_recommended: setting.may_be_recommended(settings.reference()),
                worth: Some(worth),
                ..template.clone()
            }
        })
        .collect();
    report
}

#[test]
fn exact_the_best_of_each_group_combine_where_they_set_other_keys() {
    let only = [Group::Presets, Group::Contact, Group::Slam, Group::Resolution];
    let settings = all("configs/paper.yaml", &[], &only);
    let found = |gains: &[(&str, f64)], most: usize| -> Vec<String> {
        let options = Options { combinations: most, ..options("configs/paper.yaml", &[], &only) };
        let report = with_gains(&settings, &SMALL, gains);
        let found = combine::combinations(&options, &settings, &report);
        for setting in &found {
            let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/paper.yaml");
            let Variant::Plan(plan) = &setting.variant else { panic!("a plan") };
            assert!(load(&config, &setting.sets).unwrap() == **plan, "{}", setting.name);
        }
        found.into_iter().map(|setting| setting.name).collect()
    };
    let gains =
        [("draft", 2.3), ("surrogate", 2.0), ("dead_reckoning", 1.0), ("plane_fit", 0.5), ("every 2nd beam", 1.2)];
    // `draft` is the surrogate with plane_fit: the three and draft with fewer beams are one plan, and the two are measured already.
    let expected =
        ["plane_fit + surrogate + every 2nd beam", "surrogate + every 2nd beam", "plane_fit + every 2nd beam"];
    assert_eq!(found(&gains, 9), expected);
    assert_eq!(found(&gains, 1), expected[..1]);
    assert!(found(&gains, 0).is_empty());
    // What gains no more than other draws, or loses, takes no part, nor what no rover knows.
    assert!(found(&[("draft", 2.3), ("every 2nd beam", 0.1)], 9).is_empty());
    assert!(found(&[("truth", 3.0), ("every 2nd beam", 1.2), ("plane_fit", -0.1)], 9).is_empty());
}

#[test]
fn law_combinations_are_measured_beside_the_reference_and_may_be_recommended() {
    let only = [Group::Cast, Group::Slam];
    let options = Options { combinations: 1, ..options("tests/fixtures/training.yaml", &[], &only) };
    let settings = settings::settings(&options, &SurrogateParams::default()).unwrap();
    let report = with_gains(&settings, &SMALL, &[("raster 0.1 m", 0.5), ("dead_reckoning", 0.7)]);
    let made = combine::add(report.clone(), &options, &settings, &AtomicBool::new(false), &mut |_| ()).unwrap();
    let own = row(&made, "raster 0.1 m + dead_reckoning");
    assert_eq!((own.group, own.side, own.may_be_recommended), (Some(Group::Combinations), Side::Pipeline, true));
    let worth = own.worth.as_ref().unwrap();
    assert!(worth.curve.len() == 4 && worth.curve.iter().all(|size| size.by_seed.len() == 2 && size.cpu_s() > 0.0));
    assert!(
        own.sets.iter().any(|set| set == "slam=dead_reckoning") && own.sets.iter().any(|set| set.contains("raster"))
    );
    assert_eq!(made.rows.len(), report.rows.len() + 1);
    // The pipeline's settings stay together, and nothing else of them changes.
    assert!(made.rows.iter().filter(|row| row.group != Some(Group::Combinations)).eq(&report.rows));
    // A stop meanwhile leaves what there is.
    let stopped = combine::add(report.clone(), &options, &settings, &AtomicBool::new(true), &mut |_| ()).unwrap();
    assert!(stopped == Report { ended: Ended::Interrupted, ..report });
}

#[test]
fn law_what_is_recommended_is_followed_to_more_scenes() {
    let only = [Group::Cast, Group::Slam];
    let options = Options { farther: 3, ..options("tests/fixtures/training.yaml", &[], &only) };
    let settings = settings::settings(&options, &SurrogateParams::default()).unwrap();
    let mut report = with_gains(&settings, &SMALL, &[("raster 0.1 m", 0.5), ("dead_reckoning", 0.7)]);
    report.recommended_pipeline = recommend::recommend(&report.rows, Side::Pipeline);
    let followed = |threads, is_stopped| {
        let options = Options { threads, ..options.clone() };
        farther::add(report.clone(), &options, &AtomicBool::new(is_stopped), &mut |_| ()).unwrap()
    };
    let made = followed(2, false);
    // Both are told better, and one of them is recommended.
    let followed_names = ["reference", "cast: raster 0.1 m", "slam: dead_reckoning"];
    let named = &report.recommended_pipeline.as_ref().unwrap().name;
    assert!(followed_names[1..].contains(&named.as_str()), "{named}");
    for row in &made.rows {
        let (worth, is_named) = (row.worth.as_ref().unwrap(), followed_names.contains(&row.label().as_str()));
        // Of 24 scenes an eighth is no more than what there is.
        let scenes: Vec<u64> = worth.farther.iter().map(|size| size.scenes).collect();
        assert_eq!(scenes, if is_named { vec![12, 24] } else { vec![] }, "{}", row.name);
        let sound = |size: &CurveRow| size.by_seed.len() == 2 && size.cpu_s() > 0.0 && size.train_rows > 0.0;
        assert!(worth.farther.iter().all(sound));
        // In the first measurement's seconds scenes cost what they cost there: of those that all are as dear half as many take half as long.
        let per_scene = |size: &CurveRow| size.generate_cpu_s / size.scenes as f64;
        let there = per_scene(worth.curve.last().unwrap());
        assert!(worth.farther.iter().all(|size| (0.5..2.0).contains(&(per_scene(size) / there))), "{worth:?}");
    }
    // The same for any number of threads, and nothing else is changed.
    assert!(followed(1, false).timeless() == made.timeless());
    let mut without = Report { recommended_pipeline: report.recommended_pipeline.clone(), ..made.clone() };
    for worth in without.rows.iter_mut().filter_map(|row| row.worth.as_mut()) {
        worth.farther.clear();
        worth.farther_gain = None;
    }
    assert!(without == report);
    // All of it is told, drawn and kept, and a study has the longer curve of that setting.
    let told = |row: &Row| row.worth.as_ref().unwrap().farther_gain.as_ref().map(|gain| gain.told);
    assert!(made.rows.iter().all(|row| told(row).is_some() == followed_names[1..].contains(&row.label().as_str())));
    assert!(table::markdown(&made).contains("Farther: what is told better, and the reference, on more scenes"));
    assert!(chart::svg(&made).unwrap() != chart::svg(&report).unwrap());
    let json = serde_json::to_string(&made).unwrap();
    assert!(serde_json::from_str::<Report>(&json).unwrap() == made);
    let study = Study::of(&made).unwrap();
    let sizes = |name: &str| study.settings.iter().find(|setting| setting.name == name).unwrap().sizes.len();
    assert_eq!((study.fault(), sizes(named), sizes("reference"), sizes("cast: mesh 0.1 m")), (None, 6, 6, 4));
    // What is told there is what the study and the recommendation go by.
    let mut worse = made.clone();
    for gain in worse.rows.iter_mut().filter_map(|row| row.worth.as_mut()?.farther_gain.as_mut()) {
        gain.told = Told::Worse;
    }
    let told_in_study: Vec<_> =
        Study::of(&worse).unwrap().settings.into_iter().filter(|setting| setting.sizes.len() == 6).collect();
    assert!(told_in_study[1..].iter().all(|setting| setting.told == Some(Told::Worse)) && told_in_study.len() == 3);
    assert_eq!(recommend::recommend(&worse.rows, Side::Pipeline).unwrap().name, "reference");
    // What was told of fewer scenes is kept beside it, for plans of few.
    let few: Vec<_> =
        study.settings.iter().filter_map(|setting| Some((&setting.name, setting.of_few_scenes?))).collect();
    let gain_of = |name: &str| made.rows.iter().find(|row| row.label() == name).and_then(Row::gain).unwrap();
    assert_eq!(few.len(), 2);
    for (name, of_few) in few {
        let first = gain_of(name);
        assert_eq!((of_few.told, of_few.gain), (first.told, first.balanced_accuracy), "{name}");
    }
    // A stop meanwhile leaves what there is; once the scenes are as many, nothing follows.
    let stopped = followed(2, true);
    assert!(stopped == Report { ended: Ended::Interrupted, ..report.clone() });
    let once = Options { farther: 1, ..options.clone() };
    assert!(farther::add(report.clone(), &once, &AtomicBool::new(false), &mut |_| ()).unwrap() == report);
}

#[test]
fn law_the_front_is_what_no_other_beats() {
    let on_front = front::front(&SMALL);
    let all: Vec<_> = SMALL
        .side(Side::Pipeline)
        .filter(|row| row.may_be_recommended)
        .flat_map(|row| row.worth.as_ref().unwrap().sizes())
        .collect();
    for (row, size) in &on_front {
        let beats = |other: &&&CurveRow| {
            other.cpu_s() < size.cpu_s() && other.balanced_accuracy.mean >= size.balanced_accuracy.mean
        };
        assert!(all.iter().find(beats).is_none() && row.may_be_recommended);
    }
    let best = all.iter().map(|size| size.balanced_accuracy.mean).fold(0.0, f64::max);
    assert_eq!(on_front.last().unwrap().1.balanced_accuracy.mean, best);
}

/// A report of a run that is stopped after `most` rounds unless it ends before, and the half-widths of the rounds that another followed.
fn rounds_until(resolve: Option<f64>, most: u64) -> (Report, Vec<Option<f64>>) {
    let options = Options { resolve, ..options("tests/fixtures/training.yaml", &[], &[Group::Cast]) };
    let (stop, mut widths) = (AtomicBool::new(false), Vec::new());
    let told = &mut |event: Event| {
        if let Event::Round { done, half_width } = event {
            widths.push(half_width);
            stop.store(done >= most, std::sync::atomic::Ordering::Relaxed);
        }
    };
    let report = run(&options, &stop, told).unwrap().unwrap();
    (report, widths)
}

#[test]
fn law_rounds_go_on_until_what_matters_is_resolved() {
    let (once, followed) = rounds_until(None, u64::MAX);
    let first = once.widest.clone().unwrap().half_width.unwrap();
    assert_eq!((once.rounds, once.seeds, once.test[0].scenes, once.ended), (1, 2, 6, Ended::Once));
    assert!(followed.is_empty());
    // Gains are at equal CPU seconds, which no two runs have, so that a run is held to its own half-widths.
    let limit = 0.7 * first;
    let (more, followed) = rounds_until(Some(limit), u64::MAX);
    assert_eq!((more.ended, followed.len() as u64), (Ended::Resolved, more.rounds - 1));
    assert!(followed.iter().all(|width| width.is_none_or(|width| width > limit)), "{followed:?}");
    assert!(more.widest.as_ref().is_none_or(|widest| widest.half_width.is_some_and(|width| width <= limit)));
    let said = table::text(&more);
    assert!(said.contains(" trainings a size: resolved; "), "{said}");
    // Each round trains and tests as much as the first.
    let (three, _) = rounds_until(Some(1e-9), 3);
    assert_eq!((three.rounds, three.seeds, three.test[0].scenes, three.ended), (3, 6, 18, Ended::Interrupted));
    let trainings = |report: &Report| row(report, "reference").whole().unwrap().by_seed.len();
    assert_eq!((trainings(&once), trainings(&three)), (2, 6));
}

#[test]
fn equal_a_stop_after_the_first_round_leaves_what_that_gave() {
    let one = options("tests/fixtures/training.yaml", &[], &[Group::Batch]);
    let stop = AtomicBool::new(false);
    let endless = Options { resolve: Some(1e-9), ..one.clone() };
    let told =
        &mut |event: Event| stop.store(matches!(event, Event::Round { .. }), std::sync::atomic::Ordering::Relaxed);
    let report = run(&endless, &stop, told).unwrap().expect("a round is over");
    let whole = run(&one, &AtomicBool::new(false), &mut |_| ()).unwrap().unwrap();
    assert_eq!((report.rounds, report.ended), (1, Ended::Interrupted));
    assert!(Report { ended: Ended::Once, resolve: None, ..report.timeless() } == whole.timeless());
}

#[test]
fn extreme_a_raised_stop_ends_it_without_a_report() {
    let options = options("tests/fixtures/training.yaml", &[], &[Group::Batch]);
    assert!(run(&options, &AtomicBool::new(true), &mut |_| ()).unwrap().is_none());
}

#[test]
fn extreme_a_yard_where_no_scene_can_be_made_says_why_before_any_setting_is_tried() {
    // Rocks shoulder to shoulder leave no place for a rover.
    let sets = ["scene.rocks={count: 2000, diameter_m: 0.9}"];
    let options = options("tests/fixtures/training.yaml", &sets, &[Group::Cast]);
    match run(&options, &AtomicBool::new(false), &mut |event| panic!("{event:?}")) {
        Err(TradeoffError::NoScene { scenes, reason }) => {
            assert!(scenes as u64 == options.scenes && !reason.is_empty())
        }
        other => panic!("{other:?}"),
    }
}
