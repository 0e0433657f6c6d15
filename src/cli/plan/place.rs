//! Where the choice of a budget is built and written, and by which overrides.
//!
//! In: the config as it is asked for, and the overrides that make the choice. Out: a place that is free or holds a beginning of it, the overrides that
//! say something, and refusals of files that could not be written.

use std::path::{Path, PathBuf};

use super::PlanArgs;
use crate::cli::place::must_be_local;
use crate::cli::{Failure, config_failure};
use crate::config;
use crate::corpus::plan_file;
use crate::plan::Plan;

/// Where the choice is built: where the config's builds go if that is free, or holds a beginning of it, else beside it.
pub(super) fn free_place(args: &PlanArgs, plan: &Plan, sets: &[String]) -> Result<PathBuf, Failure> {
    let sets = [args.config.sets.as_slice(), sets].concat();
    let to_build = config::load(&args.config.config, &sets).map_err(config_failure)?;
    let takes = |place: &Path| match std::fs::read(place.join(plan_file::NAME)) {
        Ok(bytes) => plan_file::head_of(&bytes).is_some_and(|there| {
            there.scene_plan_hash == to_build.scene_plan_hash()
                && there.extent.is_some_and(|extent| extent.scenes <= to_build.scenes)
        }),
        Err(_) => std::fs::read_dir(place).map_or(true, |mut inside| inside.next().is_none()),
    };
    let usual = args.place(plan);
    let Some(name) = usual.file_name().map(|name| name.to_string_lossy().into_owned()) else { return Ok(usual) };
    let beside = (1..).map(|k| {
        let again = if k > 1 { format!("-{k}") } else { String::new() };
        usual.with_file_name(format!("{name}-{}{again}", to_build.scenes))
    });
    let mut places = std::iter::once(usual.clone()).chain(beside);
    Ok(places.find(|place| takes(place)).unwrap_or(usual))
}

/// The overrides without those that say what the config says anyway.
pub(super) fn telling(args: &PlanArgs, mut sets: Vec<String>) -> Result<Vec<String>, Failure> {
    let load = |sets: &[String]| config::load(&args.config.config, &[args.config.sets.as_slice(), sets].concat());
    let whole = load(&sets).map_err(config_failure)?;
    for k in (0..sets.len()).rev() {
        let mut fewer = sets.clone();
        fewer.remove(k);
        // Without one of them the others may break a rule.
        if load(&fewer).is_ok_and(|plan| plan == whole) {
            sets = fewer;
        }
    }
    Ok(sets)
}

/// Refuses to write where it could not be written: over a file, into a folder that is not there, and a config that a single file cannot hold.
pub(super) fn check_new(path: &Path, plan: &Plan) -> Result<(), Failure> {
    must_be_local("--write", path)?;
    if let Some(file) = plan.files.first() {
        return Err(Failure::usage(miette::miette!(
            help = "leave --write out: the overrides that make the choice are printed, for `generate CONFIG --set ...`",
            "--write {}: the config reads {}, which a config elsewhere would not find",
            path.display(),
            file.path
        )));
    }
    if path.exists() {
        let help = "name a file that is not there yet, or move it away";
        return Err(Failure::usage(miette::miette!(help = help, "--write {}: is there already", path.display())));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let help = format!("make it first: mkdir -p {}", folder.display());
        return Err(Failure::usage(miette::miette!(
            help = help,
            "--write {}: there is no folder {}",
            path.display(),
            folder.display()
        )));
    }
    Ok(())
}
