//! The study that a budget is planned by: the one that is named, the one that is found, or one made here in a stated time.
//!
//! Made here: `tradeoff` of presets and pose estimates, on few scenes, then on more. What a measurement takes is a part that grows with its
//! scenes and a part that does not, for short trainings are as long on any number. The first tells their sum, the second, of four times as
//! many scenes at most, tells them apart, and the last has what half of the time left pays, with rounds of other trainings and test scenes until
//! gains are resolved or the time is over. It is written where `tradeoff` writes its own, so that it is made once. Where the time does not pay twice
//! the scenes, what was measured is the study.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::PlanArgs;
use crate::cli::options::{default_threads, typed_sets};
use crate::cli::output::errln;
use crate::cli::progress::{counted, human};
use crate::cli::{Failure, LogFormat, tradeoff};
use crate::config;
use crate::measure::study::{Study, StudyError, StudySetting};
use crate::measure::tradeoff::{Group, Options, TradeoffError};
use crate::plan::Plan;
use crate::shell;

/// Scenes of the first measurement: ten train, and of these an eighth, a quarter and a half are different numbers.
const FIRST_SCENES: u64 = 12;
/// The second has at most so many times as many.
const GROWTH: f64 = 4.0;
/// The share of the time left that the last measurement's first round is planned for: a second one of other trainings and test scenes
/// tells settings apart that one does not.
const FIRST_ROUND: f64 = 0.5;
/// The share that a measurement may be expected to take: judging grows a little faster than scenes do.
const MOST_OF_TIME: f64 = 0.9;
/// Labelled cells of all scenes that train and stop. They are held in memory at every setting: some 4 GB.
const MOST_CELLS: f64 = 2.5e6;
/// The fewest scenes to judge by, of each group that judges; else half as many as there are to learn from, all groups together.
const LEAST_TEST_SCENES: u64 = 6;
/// An interval needs two; three are what shipped studies have.
const SEEDS: u64 = 3;
/// Half-width of gains from which on no further round is worth its time, as a share of balanced accuracy.
const RESOLVED: f64 = 0.003;

/// The study, and its file.
pub(super) fn of(args: &PlanArgs, plan: &Plan, log: LogFormat, stop: &AtomicBool) -> Result<(PathBuf, Study), Failure> {
    let asked = &args.budget;
    let known = |(path, study)| (path, with_written(args, plan, study));
    if let Some(path) = &asked.study {
        return Study::read(path).map(|study| known((path.clone(), study))).map_err(|error| failure(&error, args));
    }
    let found = Study::find(&args.config.config, &plan.name).map(known);
    let Some(minutes) = asked.study_minutes else { return found.map_err(|error| failure(&error, args)) };
    let reason = match found {
        Ok((path, study)) => match doubts(args, plan, &study, &path).into_iter().next() {
            Some(doubt) => doubt,
            None => {
                let file = path.display();
                say(
                    log,
                    &format!(
                        "{file} is of this config as it stands, and no other is made; move it away to have another"
                    ),
                );
                return Ok((path, study));
            }
        },
        Err(error) => error.to_string(),
    };
    say(log, &reason);
    make(args, plan, Duration::from_secs_f64(60.0 * minutes), log, stop).map(known)
}

/// With the setting that makes the plan as it is asked for, if there is one.
fn with_written(args: &PlanArgs, plan: &Plan, study: Study) -> Study {
    let asked_for = of_scenes(plan);
    let makes = |setting: &StudySetting| {
        let sets = [study.sets.as_slice(), &setting.sets].concat();
        config::load(&args.config.config, &sets).is_ok_and(|made| of_scenes(&made) == asked_for)
    };
    let written = if is_of_this_state(args, &study) { study.settings.iter().position(makes) } else { None };
    Study { written, ..study }
}

/// Hash of what a plan's scenes are like; how many lie in a shard makes no other scenes.
fn of_scenes(plan: &Plan) -> String {
    Plan { scenes_per_shard: 1, ..plan.clone() }.scene_plan_hash()
}

/// Whether the study's settings, over what is asked for, make what was measured.
fn is_of_this_state(args: &PlanArgs, study: &Study) -> bool {
    let with_reference =
        |sets: &[String]| config::load(&args.config.config, &[sets, &study.settings[0].sets].concat()).ok();
    // What it was made of is the file as it was then.
    let Some(there) = with_reference(&study.sets).filter(|there| there.scene_plan_hash() == study.scene_plan_hash)
    else {
        return false;
    };
    with_reference(&args.config.sets).is_some_and(|here| of_scenes(&here) == of_scenes(&there))
}

fn say(log: LogFormat, words: &str) {
    match log {
        LogFormat::Json => tracing::info!(event = "study", words),
        LogFormat::Text => errln!("{words}"),
    }
}

/// A measurement that was made.
#[derive(Clone, Copy, Debug)]
struct Made {
    scenes: u64,
    took_s: f64,
}

/// One that is to be made.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Next {
    scenes: u64,
    /// Whether it fills the time.
    is_last: bool,
}

fn make(
    args: &PlanArgs,
    plan: &Plan,
    time: Duration,
    log: LogFormat,
    stop: &AtomicBool,
) -> Result<(PathBuf, Study), Failure> {
    let begun = Instant::now();
    let place = tradeoff::default_place(plan);
    let outputs = tradeoff::outputs(&place, &args.config.config)?;
    let judging = plan.families.iter().filter(|family| family.hold_out).count().max(1) as u64;
    let mut made = Vec::new();
    let mut next = Next { scenes: FIRST_SCENES, is_last: false };
    let (report, study) = loop {
        let left = time.saturating_sub(begun.elapsed());
        let options = Options {
            config: args.config.config.clone(),
            sets: args.config.sets.clone(),
            scenes: next.scenes,
            test_scenes: (next.scenes / (2 * judging)).max(LEAST_TEST_SCENES),
            only: vec![Group::Presets, Group::Slam],
            combinations: 0,
            farther: 1,
            seeds: SEEDS,
            resolve: next.is_last.then_some(RESOLVED),
            time: next.is_last.then_some(left),
            threads: default_threads(),
        };
        let scenes = counted(next.scenes, "scene");
        say(log, &format!("a study of {scenes}, in the {} that are left", human(left)));
        let measured_from = Instant::now();
        let report = tradeoff::measure(&options, log, stop).map_err(|error| measuring_failure(error, args))?;
        let report = report.ok_or_else(tradeoff::interrupted)?;
        let study =
            Study::of(&report).filter(|study| study.fault().is_none()).ok_or_else(|| no_curve(args, &scenes))?;
        made.push(Made { scenes: next.scenes, took_s: measured_from.elapsed().as_secs_f64() });
        if next.is_last {
            break (report, study);
        }
        let left_s = time.saturating_sub(begun.elapsed()).as_secs_f64();
        match following(&made, left_s, most_scenes(&study)) {
            Some(more) => next = more,
            None => break (report, study),
        }
    };
    tradeoff::write(&report, outputs)?;
    say(
        log,
        &format!("written: {}/study.json, and what it was made from, in {}", place.display(), human(begun.elapsed())),
    );
    Ok((place.join("study.json"), study))
}

/// Scenes whose cells memory holds, as many a scene as those of the reference have.
fn most_scenes(study: &Study) -> f64 {
    let largest = study.settings[0].largest();
    // Five in six scenes train.
    let cells_per_scene = 1.2 * largest.train_rows / largest.scenes as f64;
    MOST_CELLS / cells_per_scene
}

/// The measurement that the time left pays; none where that is not of twice the scenes.
fn following(made: &[Made], left_s: f64, most_scenes: f64) -> Option<Next> {
    let last = made.last()?;
    let (fixed_s, scene_s) = match made {
        [.., before, last] => {
            let rise_s = (last.took_s - before.took_s) / (last.scenes - before.scenes) as f64;
            // At least a tenth grows with the scenes, whatever the noise of the times says.
            let scene_s = rise_s.clamp(0.1 * last.took_s / last.scenes as f64, last.took_s / last.scenes as f64);
            (last.took_s - scene_s * last.scenes as f64, scene_s)
        }
        _ => (0.0, last.took_s / last.scenes as f64),
    };
    let paid = |share: f64| ((share * left_s - fixed_s) / scene_s.max(1e-6)).min(most_scenes);
    let (twice, second) = (2.0 * last.scenes as f64, GROWTH * last.scenes as f64);
    let wanted = paid(FIRST_ROUND).max(twice);
    let is_last = made.len() > 1 || wanted <= second;
    let scenes = if is_last { wanted } else { second };
    (scenes <= paid(MOST_OF_TIME)).then_some(Next { scenes: scenes as u64, is_last })
}

/// What speaks against a study: it is of another config, of another state of it, or of another training.
pub(super) fn doubts(args: &PlanArgs, plan: &Plan, study: &Study, file: &Path) -> Vec<String> {
    let (file, command) = (file.display(), command(args));
    let cure = format!("--study-minutes 10 makes a new one, and so does `{command}`");
    let mut doubts = Vec::new();
    // A config that a plan wrote has another name, and is the same config where its yards and rovers are.
    if !is_of_this_state(args, study) {
        doubts.push(if plan.name == study.name {
            format!("{file} was made of another state of this config: what it says of accuracy is of that; {cure}")
        } else {
            format!(
                "{file} was made of another config, '{}': what it says of accuracy is of that; --study-minutes 10 makes one of this, and so does `{command}`",
                study.name
            )
        });
    } else if study.written.is_none() {
        doubts.push(format!(
            "none of the settings of {file} is this config as it is asked for: the command below overrides its own choices by settings that the study knows; {cure}"
        ));
    }
    if !study.is_trained_as_now(plan) {
        doubts.push(format!(
            "{file} was made with another training than the default of `marsyard train` now: hours to train and accuracy are of that; {cure}"
        ));
    }
    doubts
}

/// Scenes of a study of presets and pose estimates, as it is advised.
const SCENES: u64 = 160;

/// The command that follows the reference, and what is recommended, to four times as many scenes as a study did.
pub(super) fn farther(args: &PlanArgs, measured_scenes: u64) -> String {
    format!("{} --farther {}", command(args), (4 * measured_scenes).div_ceil(SCENES).max(8))
}

fn command(args: &PlanArgs) -> String {
    let sets = typed_sets(&args.config.sets);
    format!(
        "marsyard tradeoff {}{sets} --only presets,slam --scenes {SCENES} --seeds 3",
        shell::word(args.config.config.display())
    )
}

fn failure(error: &StudyError, args: &PlanArgs) -> Failure {
    let command = command(args);
    let help = match error {
        StudyError::None { .. } => {
            format!(
                "--study-minutes 10 makes one first; so does `{command}`, in its own time; --study FILE names another"
            )
        }
        StudyError::Unreadable { .. } => format!("`{command}` makes one"),
    };
    Failure::usage(miette::miette!(help = help, "--hours: {error}"))
}

fn measuring_failure(error: TradeoffError, args: &PlanArgs) -> Failure {
    match error {
        TradeoffError::OneClass { scenes } => Failure::usage(miette::miette!(
            help = format!("put obstacles into the config's yards; or `{} --test-scenes 100`", command(args)),
            "--study-minutes: none of {scenes} scenes' families holds traversable and untraversable cells, so nothing can be judged by them"
        )),
        other => tradeoff::failure(other),
    }
}

fn no_curve(args: &PlanArgs, scenes: &str) -> Failure {
    Failure::usage(miette::miette!(
        help = format!("put obstacles into the config's yards; or `{}` with more --scenes", command(args)),
        "--study-minutes: of {scenes} some hold no cells to learn, so that the reference has no curve; nothing was written"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_the_next_measurement_is_what_the_time_left_pays() {
        let of = |made: &[(u64, f64)], left_s: f64, most: f64| {
            let made: Vec<Made> = made.iter().map(|&(scenes, took_s)| Made { scenes, took_s }).collect();
            following(&made, left_s, most).map(|next| (next.scenes, next.is_last))
        };
        let first = (12, 30.0);
        // No part is known to be fixed: 2.5 s a scene. Half the time pays 20, all of it 36: twice the scenes.
        assert_eq!(of(&[first], 100.0, 1e6), Some((24, true)));
        assert_eq!(of(&[first], 60.0, 1e6), None);
        assert_eq!(of(&[first], 1000.0, 1e6), Some((48, false)));
        // 48 scenes took 48 s: half a second a scene, and 24 s besides.
        assert_eq!(of(&[first, (48, 48.0)], 200.0, 1e6), Some((152, true)));
        assert_eq!(of(&[first, (48, 48.0)], 200.0, 100.0), Some((100, true)));
        assert_eq!(of(&[first, (48, 48.0)], 200.0, 90.0), None);
        assert_eq!(of(&[first, (48, 48.0)], 60.0, 1e6), None);
        // Times that fell: a tenth grows all the same. Nothing is left: nothing follows.
        assert_eq!(of(&[first, (48, 20.0)], 40.0, 1e6), Some((96, true)));
        assert_eq!(of(&[first], 0.0, 1e6), None);
    }
}
