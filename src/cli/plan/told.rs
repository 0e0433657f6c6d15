//! A plan without a budget, in words and as JSON: what the config models, what each part of it costs, and what the whole build takes.
//!
//! In: the plan, the estimate that some of its scenes gave, and the warnings. Out: standard output, or one JSON object.

use std::time::Duration;

use serde_json::json;

use super::words::{absent, parts};
use super::{machine, machine_json};
use crate::cli::output::{out, outln};
use crate::cli::progress::{counted, human, si};
use crate::config::fidelity::Setting;
use crate::corpus::Split;
use crate::corpus::advice::{Views, cut_short_of};
use crate::measure::estimate::{self, Estimate, FamilyCost, Figure};
use crate::plan::Plan;

/// Beyond so many times the CPU time over the threads, other work is taken to hold a build up.
const BUSY: f64 = 1.3;

/// `own_choices`: what the config names in place of what its `fidelity` would set.
pub(super) fn tell(
    plan: &Plan,
    estimate: Option<&Estimate>,
    asks_parts: bool,
    own_choices: &[Setting],
    warnings: &[String],
) {
    outln!(
        "{}: {} scenes in {} shards of {}, seed {}",
        plan.name,
        plan.scenes,
        plan.shards(),
        plan.scenes_per_shard,
        plan.seed
    );
    let of = |split| (0..plan.shards()).filter(|&s| Split::of_shard(s) == split).count();
    outln!("shards: {} train, {} validation, {} test", of(Split::Train), of(Split::Validation), of(Split::Test));
    warnings.iter().for_each(|warning| outln!("warning: {warning}"));
    if let Some(fidelity) = plan.fidelity {
        let sets: Vec<String> = fidelity.settings().iter().map(|(key, value)| format!("{key}: {value}")).collect();
        outln!("fidelity {}: {}", fidelity.name(), sets.join(", "));
        for (key, value) in own_choices {
            outln!("  but the config names {key} itself, which wins: --set '{key}={value}' takes that of the word");
        }
        if !own_choices.is_empty() && plan.families.len() > 1 {
            outln!("  (a family that names such a key keeps its own: --set families.N.KEY=VALUE)");
        }
    }
    let of_families: Vec<_> = (0..plan.families.len()).map(|family| parts(plan, family)).collect();
    let common = common(&of_families);
    if !common.is_empty() {
        outln!("\nevery family, besides what is told of each");
        tell_lines(&common);
    }
    for (k, family) in plan.families.iter().enumerate() {
        let held = if family.hold_out { ", held out for the test split" } else { "" };
        outln!("\nfamily {} ({:.1} % of the scenes{held})", family.name, 100.0 * plan.expected_share(k));
        let own: Vec<_> = of_families[k].iter().filter(|line| !common.contains(line)).cloned().collect();
        tell_lines(&own);
        if let Some(cost) = estimate.map(|estimate| &estimate.families[k])
            && asks_parts
        {
            tell_parts(cost);
        }
    }
    outln!("\nnot named in the config, so not modelled and not paid for: {}", absent(plan).join(", "));
    if let Some(estimate) = estimate {
        tell_cost(estimate);
        let mut views = Views::default();
        estimate.contents.iter().for_each(|content| views += &content.views);
        if views.scans > 0 {
            out!("\n{views}");
        }
        outln!("drives that end before their length or goal: {}", cut_short_of(&estimate.contents));
        estimate.advice.iter().for_each(|advice| outln!("{advice}"));
    }
}

/// A part and what it is set to.
type Line = (&'static str, String);

/// What several families all are, so that it is told once; nothing of a single one.
fn common(of_families: &[Vec<Line>]) -> Vec<Line> {
    let [first, others @ ..] = of_families else { return Vec::new() };
    if others.is_empty() {
        return Vec::new();
    }
    first.iter().filter(|line| others.iter().all(|other| other.contains(line))).cloned().collect()
}

fn tell_lines(lines: &[Line]) {
    for (part, detail) in lines {
        outln!("  {part:<14} {detail}");
    }
}

fn tell_parts(cost: &FamilyCost) {
    let Some(scene_s) = cost.scene_s else {
        // A family of which the plan has no scene costs nothing.
        if cost.scenes == 0 {
            return;
        }
        outln!("  what each part costs was not reached in the time: raise --limit");
        return;
    };
    outln!("  what each part costs: CPU ms a scene, less those of the same scenes without it, \u{b1} a standard error");
    outln!("    {:<14} {:>9.2}", "one attempt", 1e3 * scene_s);
    let (told, lost): (Vec<_>, Vec<_>) = cost.parts.iter().copied().partition(|(_, price)| price.is_told_apart());
    for (part, price) in &told {
        let saves = if price.cpu_s < 0.0 { "  saves more behind it than it costs" } else { "" };
        let (cost_ms, error_ms) = (1e3 * price.cpu_s, 1e3 * price.standard_error_s);
        outln!("    {:<14} {cost_ms:>9.2} \u{b1} {error_ms:.2}{saves}", part.name());
    }
    let names = |of: &[(estimate::Part, estimate::PartCost)]| {
        of.iter().map(|(part, _)| part.name()).collect::<Vec<_>>().join(", ")
    };
    let (measured, once): (Vec<_>, Vec<_>) =
        lost.into_iter().partition(|(_, price)| price.standard_error_s.is_finite());
    if let Some(bound_s) = measured.iter().map(|(_, price)| price.most_s()).reduce(f64::max) {
        outln!("    not told apart from nothing, below {:.2} ms each: {}", 1e3 * bound_s, names(&measured));
    }
    if !once.is_empty() && once.len() == cost.parts.len() {
        outln!("    its parts were measured on one scene alone, so without an error: raise --limit");
    } else if !once.is_empty() {
        outln!("    measured on one scene alone, so without an error: {}", names(&once));
    }
}

fn tell_cost(estimate: &Estimate) {
    outln!(
        "\ncost, measured on {} of its scenes, {} at a time, on {}; CPU ms a scene",
        estimate.scenes,
        estimate.threads,
        machine()
    );
    for (stage, cpu_s) in &estimate.stages {
        outln!("  {stage:<12} {:>9.2}", 1e3 * cpu_s);
    }
    for (table, cpu_s) in &estimate.tables {
        outln!("    {:<10} {:>9.2}", table.name(), 1e3 * cpu_s);
    }
    outln!(
        "\nwhole build: {} rows of cells ({}), {}B on disk ({}), {} on {} ({}), {} of CPU",
        si(estimate.rows.value),
        error(&estimate.rows),
        si(estimate.bytes.value),
        error(&estimate.bytes),
        human(Duration::from_secs_f64(estimate.wall_s.value)),
        counted(estimate.threads as u64, "thread"),
        error(&estimate.wall_s),
        human(Duration::from_secs_f64(estimate.cpu_s.value))
    );
    if [&estimate.rows, &estimate.bytes, &estimate.wall_s].iter().any(|figure| !figure.relative_error().is_finite()) {
        outln!("  \u{b1} ?: no family had two measured scenes, so no error can be told; raise --sample or --limit");
    }
    // Waiting for the place is of all threads together, as CPU time is.
    let storing_s = estimate.storage.as_ref().map_or(0.0, |storage| storage.build_s);
    let free_s = (estimate.cpu_s.value + storing_s) / estimate.threads as f64;
    if estimate.wall_s.value > BUSY * free_s {
        outln!(
            "  measured beside other work: on free cores it would take some {}",
            human(Duration::from_secs_f64(free_s))
        );
    }
    let needed = si(estimate.needed_bytes_per_s());
    match &estimate.storage {
        None => outln!("storage: must take {needed}B/s, or it holds the build up; --out PLACE measures it"),
        Some(storage) => {
            let share = storage.build_s / threads_s(estimate).max(1e-9);
            outln!(
                "storage: the build makes {needed}B/s, {} takes {}B/s (measured with a shard): {:.1} % of the time",
                storage.place,
                si(storage.bytes_per_s),
                100.0 * share
            );
            if share > 0.5 {
                outln!("warning: storage is what bounds this build; another --out, or fewer columns, would be faster");
            }
        }
    }
}

/// Seconds of all threads together.
fn threads_s(estimate: &Estimate) -> f64 {
    estimate.wall_s.value * estimate.threads as f64
}

/// One standard error of the sample.
fn error(figure: &Figure) -> String {
    match 100.0 * figure.relative_error() {
        percent if percent.is_finite() => format!("\u{b1} {percent:.1} %"),
        _ => "\u{b1} ?".into(),
    }
}

pub(super) fn as_json(
    plan: &Plan,
    estimate: Option<&Estimate>,
    own_choices: &[Setting],
    warnings: &[String],
) -> serde_json::Value {
    let families = plan.families.iter().enumerate().map(|(k, family)| {
        let words: serde_json::Map<_, _> = parts(plan, k).into_iter().map(|(k, v)| (k.into(), v.into())).collect();
        let cost = estimate.map(|estimate| &estimate.families[k]);
        let prices: Option<serde_json::Map<_, _>> = cost.filter(|cost| cost.scene_s.is_some()).map(|cost| {
            let price = |(part, price): &(estimate::Part, estimate::PartCost)| {
                let value = json!({"cpu_s": price.cpu_s, "standard_error_s": price.standard_error_s});
                (part.name().to_string(), value)
            };
            cost.parts.iter().map(price).collect()
        });
        json!({
            "name": family.name, "weight": family.weight, "hold_out": family.hold_out,
            "scenes": cost.map(|cost| cost.scenes), "parts": words,
            "views": estimate.map(|estimate| &estimate.contents[k].views),
            "drives": estimate.map(|estimate| &estimate.contents[k]).map(|of| json!({"driven": of.driven(), "cut_short": of.cut_short})),
            "cpu_s_of_one_attempt": cost.and_then(|cost| cost.scene_s), "cpu_s_of_parts": prices,
        })
    });
    let families: Vec<_> = families.collect();
    json!({
        "name": plan.name, "seed": plan.seed, "scenes": plan.scenes, "shards": plan.shards(),
        "scene_plan_hash": plan.scene_plan_hash(), "fidelity": plan.fidelity,
        "own_choices": own_choices.iter().map(|(key, _)| key).collect::<Vec<_>>(), "warnings": warnings,
        "families": families, "absent": absent(plan), "estimate": estimate.map(estimate_json),
    })
}

fn estimate_json(estimate: &Estimate) -> serde_json::Value {
    let figure = |figure: &Figure| json!({"value": figure.value, "standard_error": figure.standard_error});
    let stages: serde_json::Map<_, _> =
        estimate.stages.iter().map(|(name, cpu_s)| ((*name).to_string(), (*cpu_s).into())).collect();
    let tables: serde_json::Map<_, _> =
        estimate.tables.iter().map(|(table, cpu_s)| (table.name().to_string(), (*cpu_s).into())).collect();
    let failed: u64 = estimate.contents.iter().map(|content| content.failed).sum();
    let storage = estimate.storage.as_ref().map(|storage| {
        json!({
            "place": storage.place, "bytes_per_s": storage.bytes_per_s, "thread_s": storage.build_s,
        })
    });
    json!({
        "machine": machine_json(), "families_not_reached": estimate.not_reached,
        "scenes_measured": estimate.scenes, "scenes_failed": failed, "advice": estimate.advice, "threads": estimate.threads,
        "cpu_s": figure(&estimate.cpu_s), "wall_s": figure(&estimate.wall_s), "rows": figure(&estimate.rows),
        "bytes": figure(&estimate.bytes), "needed_bytes_per_s": estimate.needed_bytes_per_s(),
        "stage_cpu_s_per_scene": stages, "table_cpu_s_per_scene": tables, "storage": storage,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_what_all_families_are_is_told_once() {
        let family = |slam: &str, rocks: &str| vec![("slam", slam.to_owned()), ("rocks", rocks.to_owned())];
        let (a, b, c) = (family("truth", "5"), family("truth", "6"), family("truth", "5"));
        assert_eq!(common(&[a.clone(), b, c]), [("slam", "truth".to_owned())]);
        assert_eq!(common(&[a]), []);
        assert_eq!(common(&[]), []);
    }
}
