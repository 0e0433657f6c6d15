//! What several verbs take alike, and say alike of a plan: threads, labels, the config or corpus that is named.

use std::path::{Path, PathBuf};

use super::place::is_config;
use super::{Failure, config_failure};
use crate::config;
use crate::plan::{Plan, Split};
use crate::shell;

/// As many as there are cores to be used.
pub(super) fn default_threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Where a plan is built when no place is named.
pub(super) fn default_out(plan: &Plan) -> PathBuf {
    PathBuf::from("corpora").join(&plan.name)
}

/// More than any machine has cores for.
const MOST_THREADS: usize = 4096;

pub(super) fn parse_threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("at least one thread is needed".into()),
        Ok(threads) if threads > MOST_THREADS => Err(format!("at most {MOST_THREADS} threads are started")),
        Ok(threads) => Ok(threads),
        Err(e) => Err(format!("'{text}': {e}")),
    }
}

/// A number above 0, of minutes, seconds or points.
pub(super) fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number < 1e6 => Ok(number),
        _ => Err(format!("'{text}' is not a number above 0 and below 1000000")),
    }
}

/// Finite numbers, between commas.
pub(super) fn parse_three(text: &str) -> Result<[f64; 3], String> {
    numbers(text, "three")
}

pub(super) fn parse_six(text: &str) -> Result<[f64; 6], String> {
    numbers(text, "six")
}

/// As many finite numbers, between commas; `count`: the number of them as a word.
fn numbers<const N: usize>(text: &str, count: &str) -> Result<[f64; N], String> {
    let values: Vec<f64> = text
        .split(',')
        .map(|value| value.trim().parse::<f64>().map_err(|e| format!("'{value}': {e}")))
        .collect::<Result<_, _>>()?;
    let numbers: [f64; N] =
        values.try_into().map_err(|v: Vec<f64>| format!("{} numbers, {count} are needed", v.len()))?;
    if numbers.iter().all(|v| v.is_finite()) { Ok(numbers) } else { Err("a number is not finite".into()) }
}

/// `1%` or `0.01` as a share; `None` of what is no number.
pub(super) fn read_share(text: &str) -> Option<f64> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 100.0));
    Some(number.trim().parse::<f64>().ok()? / unit)
}

/// Overrides as they are typed behind a command.
pub(super) fn typed_sets<'s>(sets: impl IntoIterator<Item = &'s String>) -> String {
    sets.into_iter().map(|set| format!(" --set {}", shell::quoted(set))).collect()
}

/// A place as it is typed behind a command.
pub(super) fn typed_out(out: &Path) -> String {
    format!(" --out {}", shell::quoted(out.display()))
}

/// A rule of labels as an override.
pub(super) fn labels_set(rule: &str) -> Result<String, Failure> {
    Ok(format!("labels={}", rule_mapping(rule)?))
}

/// `taller_than_m=0.2,max_ground_slope_deg=20` as a mapping of YAML; a mapping as it is.
pub(super) fn rule_mapping(rule: &str) -> Result<String, Failure> {
    if rule.trim_start().starts_with('{') {
        return Ok(rule.into());
    }
    let mut parts = Vec::new();
    for part in rule.split(',').map(str::trim) {
        parts.push(match part.split_once('=') {
            Some((key @ ("taller_than_wheel" | "taller_than_m"), value)) => format!("obstacle: {{{key}: {value}}}"),
            Some((key @ ("min_obstacle_points" | "max_ground_slope_deg" | "min_margin_m" | "max_drop_m"), value)) => format!("{key}: {value}"),
            None if ["all", "as_built"].contains(&part) => format!("obstacle: {part}"),
            _ => {
                return Err(Failure::usage(miette::miette!(
                    help = "for example: --labels taller_than_wheel=0.15, or --labels taller_than_m=0.2,max_ground_slope_deg=20",
                    "--labels: '{part}' is not part of a rule"
                )));
            }
        });
    }
    Ok(format!("{{{}}}", parts.join(", ")))
}

/// The plan of a config file, a plan.yaml or a corpus; and the place of the corpus, if it is one.
pub(super) fn plan_of<'p>(place: &'p Path, sets: &[String]) -> Result<(Plan, Option<&'p Path>), Failure> {
    let (file, corpus) = if is_config(place) { (place.into(), None) } else { (place.join("plan.yaml"), Some(place)) };
    let (plan, remarks) = config::load_with_remarks(&file, sets).map_err(config_failure)?;
    // A corpus was remarked on when it was built.
    if corpus.is_none() && !file.ends_with("plan.yaml") {
        remarks.iter().for_each(|remark| tracing::warn!("warning: {remark}"));
    }
    Ok((plan, corpus))
}

/// Refuses a scene that the plan does not have.
pub(super) fn check_scene(plan: &Plan, scene: u64) -> Result<(), Failure> {
    if scene < plan.scenes {
        return Ok(());
    }
    Err(Failure::usage(miette::miette!(
        help = format!("scenes are numbered 0 to {}", plan.scenes - 1),
        "--scene {scene}: the plan has {} scenes",
        plan.scenes
    )))
}

/// What a plan of so few shards leaves out.
pub(super) fn split_warnings(plan: &Plan) -> Vec<String> {
    let empty = |split| !(0..plan.shards().min(20)).any(|shard| Split::of_shard(shard) == split);
    let names: Vec<&str> = Split::ALL.into_iter().filter(|&split| empty(split)).map(Split::name).collect();
    let mut warnings = Vec::new();
    if !names.is_empty() {
        let names = names.join(" and ");
        warnings.push(format!("no shard is in the {names} split; from 7 shards on there is one in each: raise scenes or lower scenes_per_shard"));
    }
    if empty(Split::Test) {
        let held_out = plan.families.iter().filter(|family| family.hold_out);
        let names: Vec<&str> = held_out.map(|family| family.name.as_str()).collect();
        warnings.extend((!names.is_empty()).then(|| {
            format!(
                "held out for the test split, which has no shard, so that no scene of them is built: {}",
                names.join(", ")
            )
        }));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_label_rules_become_overrides() {
        let set = |rule| labels_set(rule).map_err(|failure| failure.report.to_string());
        assert_eq!(set("all").unwrap(), "labels={obstacle: all}");
        assert_eq!(
            set("taller_than_m=0.2, max_ground_slope_deg=20").unwrap(),
            "labels={obstacle: {taller_than_m: 0.2}, max_ground_slope_deg: 20}"
        );
        assert_eq!(set("{obstacle: all}").unwrap(), "labels={obstacle: all}");
        assert!(set("tall").unwrap_err().contains("'tall' is not part of a rule"));
    }
}
