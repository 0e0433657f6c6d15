//! The study that a budget is planned by: the one that is named, the one that is found, or one made here in a stated time.
//!
//! Made here: `tradeoff` of presets and pose estimates. A first one of few scenes tells what a scene costs, from the first scene to the last
//! network judged; the second has as many scenes as the time left pays, and then goes on by rounds of other trainings and test scenes. It is
//! written where `tradeoff` writes its own, so that it is made once. Where the time does not pay twice the first, that is the study.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::PlanArgs;
use crate::cli::options::default_threads;
use crate::cli::output::errln;
use crate::cli::progress::{counted, human};
use crate::cli::{Failure, LogFormat, config_failure, tradeoff};
use crate::measure::study::{Study, StudyError};
use crate::measure::tradeoff::settings::reference;
use crate::measure::tradeoff::{Group, Options};
use crate::plan::Plan;

/// Scenes of the first measurement; of ten that train an eighth are two, whose sizes are four different ones.
const FIRST_SCENES: u64 = 12;
/// Scenes whose cells are held in memory at every setting: beyond these the time goes into rounds.
const MOST_SCENES: u64 = 240;
/// Scenes to learn from for each to judge by.
const SCENES_PER_TEST_SCENE: u64 = 2;
/// An interval needs two; three are what shipped studies have.
const SEEDS: u64 = 3;

/// The study, and its file.
pub(super) fn of(args: &PlanArgs, plan: &Plan, log: LogFormat, stop: &AtomicBool) -> Result<(PathBuf, Study), Failure> {
    let asked = &args.budget;
    if let Some(path) = &asked.study {
        return Study::read(path).map(|study| (path.clone(), study)).map_err(|error| failure(&error, args));
    }
    let found = Study::find(&args.config.config, &plan.name);
    let Some(minutes) = asked.study_minutes else { return found.map_err(|error| failure(&error, args)) };
    match found {
        Ok((path, study)) if doubts(args, &study, &path)?.is_empty() => Ok((path, study)),
        _ => make(args, plan, Duration::from_secs_f64(60.0 * minutes), log, stop),
    }
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
    let of_scenes = |scenes: u64, time: Option<Duration>| Options {
        config: args.config.config.clone(),
        sets: args.config.sets.clone(),
        scenes,
        test_scenes: scenes / SCENES_PER_TEST_SCENE,
        only: vec![Group::Presets, Group::Slam],
        combinations: 0,
        seeds: SEEDS,
        resolve: None,
        time,
        threads: default_threads(),
    };
    errln!(
        "no study of {} as it stands: one is made in {}; first of {FIRST_SCENES} scenes, which tells what they cost",
        plan.name,
        human(time)
    );
    let mut report = tradeoff::measure(&of_scenes(FIRST_SCENES, None), log, stop)?;
    let (first, left) = (begun.elapsed(), time.saturating_sub(begun.elapsed()));
    let scenes = scenes_in(left, first);
    if scenes > FIRST_SCENES {
        errln!("took {}: now {}", human(first), counted(scenes, "scene"));
        report = tradeoff::measure(&of_scenes(scenes, Some(left)), log, stop)?;
    }
    let study = Study::of(&report).ok_or_else(|| no_curve(args, scenes))?;
    tradeoff::write(&report, outputs)?;
    errln!("written: {0}/study.json, and what it was made from, in {1}", place.display(), human(begun.elapsed()));
    Ok((place.join("study.json"), study))
}

/// Scenes that a time pays, where the first ones took `first`.
fn scenes_in(left: Duration, first: Duration) -> u64 {
    let times = (left.as_secs_f64() / first.as_secs_f64().max(1e-3)) as u64;
    (FIRST_SCENES * times.max(1)).min(MOST_SCENES)
}

/// What speaks against a study: it is of another config, of another state of it, or of another training.
pub(super) fn doubts(args: &PlanArgs, study: &Study, file: &Path) -> Result<Vec<String>, Failure> {
    let own = reference(&args.config.config, &args.config.sets).map_err(config_failure)?;
    let (file, command) = (file.display(), command(args));
    let mut doubts = Vec::new();
    if own.name != study.name {
        doubts.push(format!(
            "{file} was made of another config, '{}': what it says of accuracy is of that; `{command}` makes one of this",
            study.name
        ));
    } else if own.scene_plan_hash() != study.scene_plan_hash {
        doubts.push(format!(
            "{file} was made of another state of this config: what it says of accuracy is of that; `{command}` makes a new one"
        ));
    }
    if !study.is_trained_as_now() {
        doubts.push(format!(
            "{file} was made with another training than the default of `marsyard train` now: hours to train and accuracy are of that; \
             `{command}` makes a new one"
        ));
    }
    Ok(doubts)
}

fn command(args: &PlanArgs) -> String {
    let sets: String = args.config.sets.iter().map(|set| format!(" --set '{set}'")).collect();
    format!("marsyard tradeoff {}{sets} --only presets,slam --scenes 160 --seeds 3", args.config.config.display())
}

fn failure(error: &StudyError, args: &PlanArgs) -> Failure {
    let command = command(args);
    let help = match error {
        StudyError::None { .. } => format!(
            "--study-minutes 10 makes one first; `{command}` makes one in its own time; --study FILE names another"
        ),
        StudyError::Unreadable { .. } => format!("`{command}` makes one"),
    };
    Failure::usage(miette::miette!(help = help, "--hours: {error}"))
}

fn no_curve(args: &PlanArgs, scenes: u64) -> Failure {
    Failure::usage(miette::miette!(
        help = format!("more --study-minutes; or `{}` with more --scenes", command(args)),
        "--study-minutes: {scenes} scenes have too few cells of both classes for a curve, and nothing was written"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_scenes_are_what_the_time_left_pays() {
        let of =
            |left_s: f64, first_s: f64| scenes_in(Duration::from_secs_f64(left_s), Duration::from_secs_f64(first_s));
        // Ten times the first; one and a half of it is not twice; nothing is left; more than memory is asked for.
        assert_eq!([of(300.0, 30.0), of(45.0, 30.0), of(0.0, 30.0), of(1e5, 1.0)], [120, 12, 12, MOST_SCENES]);
    }
}
