//! `plan --hours`: what to build in the time, on the cores and on the disk that there are.
//!
//! The study of the config says what each setting is worth; a few scenes made here say how fast this machine is, and how many rows and
//! bytes a scene has. The answer is a setting and a number of scenes, with the next best choice and with what makes such a corpus weak; `--write`
//! writes it as a config.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::answer::Answer;
use super::place::{check_new, free_place, telling};
use super::{PlanArgs, study};
use crate::cli::options::default_threads;
use crate::cli::output::outln;
use crate::cli::progress::si;
use crate::cli::{Failure, LogFormat, config_failure};
use crate::config;
use crate::corpus::advice::{self, Content};
use crate::measure::budget::{Budget, Choice, DISK_MARGIN, Here, choices, pays_few_scenes};
use crate::measure::estimate::{self, Estimate, Options, RowCost};
use crate::measure::study::{Study, StudySetting};
use crate::measure::tradeoff::report::Told;
use crate::plan::Plan;

/// From so many shards on each split has one.
const LEAST_SHARDS: u64 = 7;
/// A smaller build is cut into so many: 14 train, 3 validate, 3 test.
const SHARDS: u64 = 20;
/// Choices that are told in words.
pub(super) const TOLD: usize = 2;
/// Settings that scenes are made of at most.
const MOST_MEASURED: usize = 3;
/// A size is told to be extrapolated from so many times the largest that was measured.
const EXTRAPOLATED: f64 = 1.05;

pub(super) fn run(args: &PlanArgs, plan: &Plan, hours: f64, log: LogFormat, stop: &AtomicBool) -> Result<(), Failure> {
    let asked = &args.budget;
    if let Some(path) = &asked.write {
        check_new(path, plan)?;
    }
    let (study_file, study) = study::of(args, plan, log, stop)?;
    let of_few_scenes = study.clone().of_few_scenes();
    let cores = asked.cores.unwrap_or_else(default_threads);
    let disk_bytes = asked.disk.or_else(|| super::free_bytes(&args.place(plan)).map(|bytes| bytes as f64));
    let budget = Budget { wall_s: 3600.0 * hours, cores: cores as f64, disk_bytes, rows: asked.rows };

    let begun = Instant::now();
    let left = || super::most(args).saturating_sub(begun.elapsed());
    let measured = |setting: &StudySetting, sets: &[String]| measure(args, setting, sets, cores, left(), stop);
    let reference = &study.settings[0];
    let mut base = measured(reference, &[])?;
    let first = choices(&study, &budget, |_| base.here, 1).into_iter().next();
    let first = first.ok_or_else(|| too_little(args, &budget, &base.here))?;
    let own = u64::from(plan.scenes_per_shard);
    let per_shard = if first.scenes >= LEAST_SHARDS * own { own } else { (first.scenes / SHARDS).max(1) };
    let small_shards = Vec::from_iter((per_shard != own).then(|| format!("scenes_per_shard={per_shard}")));
    // The config's own number of scenes may be no multiple of these.
    let scenes = (first.scenes / per_shard).max(LEAST_SHARDS) * per_shard;
    let as_built = [small_shards.as_slice(), &[format!("scenes={scenes}")]].concat();
    // Small shards take more bytes a scene.
    if per_shard != own && !left().is_zero() {
        base = measured(reference, &as_built)?;
    }
    // What is told is told by scenes of its own; once it is measured, another may be told.
    let base_here = base.here;
    let mut known = BTreeMap::from([(reference.name.as_str(), base)]);
    let (study, all) = loop {
        let row_cost = RowCost::median(known.values().filter_map(|known| known.row_cost));
        let here = |setting: &StudySetting| {
            let own = known.get(setting.name.as_str()).map_or(base_here, |known| known.here);
            of_common_rows(own, base_here.rows_per_scene * setting.rows_beside(reference), row_cost)
        };
        let study = if pays_few_scenes(&study, &budget, here) { &of_few_scenes } else { &study };
        let mut all = choices(study, &budget, here, per_shard);
        all.retain(|choice| choice.scenes >= LEAST_SHARDS);
        let told = all.iter().take(TOLD).map(|choice| choice.setting);
        match told.into_iter().find(|setting| !known.contains_key(setting.name.as_str())) {
            Some(setting) if known.len() < MOST_MEASURED && !left().is_zero() => {
                known.insert(&setting.name, measured(setting, &as_built)?);
            }
            _ => break (study, all),
        }
    };
    let Some(best) = all.first() else { return Err(too_little(args, &budget, &base_here)) };

    let mut sets = best.setting.sets.clone();
    sets.push(format!("scenes={}", best.scenes));
    sets.extend(small_shards);
    let sets = telling(args, sets)?;
    let to_build = Plan { scenes: best.scenes, scenes_per_shard: per_shard as u32, ..plan.clone() };
    let measured_here: Vec<String> = known.keys().map(|name| (*name).to_owned()).collect();
    let of_best = known.remove(best.setting.name.as_str()).or_else(|| known.remove(reference.name.as_str()));
    let mut contents = of_best.map(|known| known.contents).unwrap_or_default();
    for (content, test_scenes) in contents.iter_mut().zip(estimate::test_scenes(&to_build)) {
        content.test_scenes = test_scenes;
    }
    let warnings = warnings(args, plan, study, &study_file, cores);
    let place = free_place(args, plan, &sets)?;
    let answer = Answer {
        args,
        plan,
        study,
        study_file: &study_file,
        hours,
        cores,
        disk_bytes,
        choices: &all,
        measured_here,
        sets,
        place,
        warnings,
        advice: advice::advise(&contents),
    };
    if args.json {
        outln!("{:#}", answer.json());
    } else {
        answer.tell();
    }
    if let Some(path) = &asked.write {
        answer.write(path)?;
    }
    Ok(())
}

/// What is told by some scenes of a setting that were made here.
struct Made {
    here: Here,
    /// Where there were rows to read.
    row_cost: Option<RowCost>,
    contents: Vec<Content>,
}

fn measure(
    args: &PlanArgs,
    setting: &StudySetting,
    sets: &[String],
    cores: usize,
    most: Duration,
    stop: &AtomicBool,
) -> Result<Made, Failure> {
    let sets = [args.config.sets.as_slice(), &setting.sets, sets].concat();
    let plan = config::load(&args.config.config, &sets).map_err(config_failure)?;
    let options = Options {
        threads: cores.min(default_threads()),
        scenes: None,
        limit: Duration::from_secs_f64(0.5 * args.limit),
        parts_limit: Duration::ZERO,
        most,
        place: None,
        for_training: true,
        stop,
    };
    let estimate = super::measured(&plan, &options)?;
    let here = here(&estimate, plan.scenes as f64, setting);
    Ok(Made { here, row_cost: estimate.row_cost, contents: estimate.contents })
}

/// With rows as the reference's sample has them, for each setting's sample is of other scenes; the study had the same scenes of both. What a row takes in
/// training is one figure for all settings, whose columns are the same.
fn of_common_rows(own: Here, rows_per_scene: f64, row_cost: RowCost) -> Here {
    // Scenes without a row have bytes all the same.
    let has_rows = own.rows_per_scene > 0.0 && rows_per_scene > 0.0;
    let scale = if has_rows { rows_per_scene / own.rows_per_scene } else { 1.0 };
    Here { bytes_per_scene: scale * own.bytes_per_scene, rows_per_scene, row_cost, ..own }
}

fn here(estimate: &Estimate, scenes: f64, setting: &StudySetting) -> Here {
    let (writing, making): (Vec<_>, Vec<_>) = estimate.stages.iter().partition(|(stage, _)| *stage == "writing");
    let sum = |stages: &[&(&str, f64)]| stages.iter().map(|(_, cpu_s)| cpu_s).sum::<f64>();
    Here {
        slowness: sum(&making) / setting.scene_cpu_s(),
        writing_cpu_s: sum(&writing),
        bytes_per_scene: estimate.bytes.value / scenes,
        rows_per_scene: estimate.rows.value / scenes,
        row_cost: estimate.row_cost.unwrap_or_default(),
    }
}

/// What speaks against the study, and against the machine.
fn warnings(args: &PlanArgs, plan: &Plan, study: &Study, study_file: &Path, cores: usize) -> Vec<String> {
    let mut warnings = study::doubts(args, plan, study, study_file);
    let written = study.as_written();
    if written.told == Some(Told::Worse) {
        warnings.push(format!(
            "the config as it is asked for ({}) is told to be worse than the study's reference at equal CPU: the reference is planned in its place",
            written.name
        ));
    }
    if cores > default_threads() {
        warnings.push(format!(
            "measured on {}: hours are extrapolated to {cores} cores as fast as these, each free",
            super::machine()
        ));
    }
    warnings
}

/// How far a choice is from what was measured of its setting.
pub(super) fn extrapolated(choice: &Choice) -> Option<String> {
    let measured = |scenes: u64| format!("{scenes} scenes that train and stop");
    let (smallest, largest) = (choice.setting.sizes[0].scenes, choice.setting.largest().scenes);
    if choice.beyond > EXTRAPOLATED {
        Some(format!(
            "extrapolated: {:.1} times the largest size that the study measured of it ({})",
            choice.beyond,
            measured(largest)
        ))
    } else if choice.beyond * (largest as f64) < smallest as f64 {
        Some(format!(
            "extrapolated: fewer than the smallest size that the study measured of it ({})",
            measured(smallest)
        ))
    } else {
        None
    }
}

fn too_little(args: &PlanArgs, budget: &Budget, here: &Here) -> Failure {
    let short = |asked: Option<f64>, a_scene: f64| asked.filter(|asked| *asked < LEAST_SHARDS as f64 * a_scene);
    let least = LEAST_SHARDS as f64;
    let bytes_of_scene = DISK_MARGIN * here.bytes_per_scene;
    let (what, help) = match (short(budget.disk_bytes, bytes_of_scene), short(budget.rows, here.rows_per_scene)) {
        (Some(bytes), _) => (
            format!("{}B of disk hold", si(bytes)),
            format!(
                "{LEAST_SHARDS} scenes take some {}B: {}, or fewer tables",
                si(least * bytes_of_scene),
                if args.budget.disk.is_some() { "more --disk" } else { "free some, or take another --out" }
            ),
        ),
        (None, Some(rows)) => (
            format!("{} rows hold", si(rows)),
            format!("{LEAST_SHARDS} scenes have some {} rows: more --rows", si(least * here.rows_per_scene)),
        ),
        (None, None) => (format!("{} h are enough for", budget.wall_s / 3600.0), "more --hours or --cores".into()),
    };
    Failure::usage(miette::miette!(
        help = help,
        "{what} fewer than {LEAST_SHARDS} scenes of any setting, and a corpus that can be trained on has as many shards"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_rows_are_of_one_sample_and_bytes_go_with_them() {
        let cost = RowCost { reading_s: 1.0, ..RowCost::default() };
        let own = Here {
            slowness: 2.0,
            writing_cpu_s: 0.1,
            bytes_per_scene: 5000.0,
            rows_per_scene: 100.0,
            row_cost: RowCost::default(),
        };
        let of = |own: Here, rows: f64| {
            let made = of_common_rows(own, rows, cost);
            assert_eq!((made.slowness, made.writing_cpu_s, made.row_cost), (2.0, 0.1, cost));
            (made.rows_per_scene, made.bytes_per_scene)
        };
        assert_eq!(of(own, 120.0), (120.0, 6000.0));
        // Scenes without rows, here or in the reference's sample, have the bytes that they were found to have.
        assert_eq!(of(Here { rows_per_scene: 0.0, ..own }, 120.0), (120.0, 5000.0));
        assert_eq!(of(own, 0.0), (0.0, 5000.0));
    }
}
