//! Checks a config and says what it models, what each part of it costs, and what the whole build will take; or what to build in some hours.

mod answer;
mod budget;
mod place;
mod study;
mod words;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use clap::Args;
use serde_json::json;

use self::words::{absent, parts};
use super::options::{
    default_out, default_threads, parse_positive, parse_threads, split_warnings, typed_out, typed_sets,
};
use super::output::{errln, out, outln};
use super::place::corpus_failure;
use super::progress::{counted, human, si};
use super::signals::stop_on_signals;
use super::{ConfigArgs, Failure, LogFormat};
use crate::build::KEEP_FREE_BYTES;
use crate::corpus::advice::Views;
use crate::corpus::{Split, Table};
use crate::cpu;
use crate::measure::estimate::{self, Estimate, EstimateError, FamilyCost, Figure, Options};
use crate::plan::Plan;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Scenes to build (and throw away) for the estimate; default: as many as make it good to some 3 %; 0 = check only.
    #[arg(long, conflicts_with = "hours")]
    sample: Option<u64>,
    /// Seconds to measure for: half for the whole build, half for its parts. Where a scene of each family, with each part and without it, takes
    /// longer, up to 30; a scene in hand is finished.
    #[arg(long, default_value_t = 8.0, value_name = "SECONDS", value_parser = parse_positive)]
    limit: f64,
    /// Leave out what each part costs.
    #[arg(long)]
    no_parts: bool,
    /// Where the build will write: what storage takes there is measured (by a shard that goes away again).
    #[arg(long)]
    out: Option<PathBuf>,
    /// Threads that the build will have. Measured is on no more than this machine has cores; what is beyond is told as such.
    #[arg(long, default_value_t = default_threads(), value_parser = parse_threads, conflicts_with = "hours")]
    threads: usize,
    #[command(flatten)]
    budget: budget::BudgetArgs,
    /// One JSON object on stdout instead of text.
    #[arg(long)]
    json: bool,
}

impl PlanArgs {
    /// Where the build goes.
    fn place(&self, plan: &Plan) -> PathBuf {
        self.out.clone().unwrap_or_else(|| default_out(plan))
    }
}

pub(super) fn run(args: &PlanArgs, log: LogFormat) -> Result<(), Failure> {
    let plan = args.config.load()?;
    let stop = stop_on_signals()?;
    if let Some(hours) = args.budget.hours {
        return budget::run(args, &plan, hours, log, &stop);
    }
    args.budget.check_unused()?;
    let half = Duration::from_secs_f64(0.5 * args.limit);
    let options = Options {
        threads: args.threads.min(default_threads()),
        scenes: args.sample,
        limit: half,
        parts_limit: if args.no_parts { Duration::ZERO } else { half },
        most: most(args),
        place: args.out.as_deref(),
        for_training: false,
        stop: &stop,
    };
    let estimate = (args.sample != Some(0)).then(|| measured(&plan, &options)).transpose()?;
    let mut warnings = split_warnings(&plan);
    if let Some(estimate) = &estimate {
        warnings.extend(machine_warnings(estimate, &plan, args));
    }
    if args.json {
        outln!("{:#}", as_json(&plan, estimate.as_ref(), &warnings));
    } else {
        tell(&plan, estimate.as_ref(), &warnings);
        outln!(
            "\nwhat such scenes teach a classifier, and from how many on more teach nothing: marsyard plan {}{}{} --hours 8",
            args.config.config.display(),
            typed_sets(&args.config.sets),
            args.out.as_deref().map_or(String::new(), typed_out)
        );
    }
    Ok(())
}

/// A plan takes no longer, whatever it is asked, unless it is given longer, or a number of scenes.
const MOST: Duration = Duration::from_secs(30);

/// Beyond so many times the CPU time over the threads, other work is taken to hold a build up.
const BUSY: f64 = 1.3;

/// What writing the sampled scenes takes, and the last of them, before anybody is told that they are waited for.
const GRACE: Duration = Duration::from_secs(3);

fn most(args: &PlanArgs) -> Duration {
    match args.sample {
        Some(_) => Duration::MAX,
        None => MOST.max(Duration::from_secs_f64(args.limit)),
    }
}

/// What some scenes tell; where one of them takes longer than a plan may, it is said what is waited for.
fn measured(plan: &Plan, options: &Options) -> Result<Estimate, Failure> {
    let (done, is_done) = channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            if is_done.recv_timeout(options.most.saturating_add(GRACE)) == Err(RecvTimeoutError::Timeout) {
                errln!("the time is over: no scene is begun any more, and those in hand are waited for");
            }
        });
        let estimate = estimate::estimate(plan, options).map_err(estimate_failure);
        drop(done);
        estimate
    })
}

/// What a failed or interrupted estimate is to the user.
fn estimate_failure(error: EstimateError) -> Failure {
    match error {
        EstimateError::Corpus(error) => corpus_failure(error),
        EstimateError::Interrupted => Failure::new(Failure::TRY_AGAIN, miette::Report::msg(error.to_string())),
        other => Failure::failed(other),
    }
}

fn tell(plan: &Plan, estimate: Option<&Estimate>, warnings: &[String]) {
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
        outln!("fidelity {}: {}; what the config names itself wins", fidelity.name(), sets.join(", "));
    }
    for (k, family) in plan.families.iter().enumerate() {
        let held = if family.hold_out { ", held out for the test split" } else { "" };
        outln!("\nfamily {} ({:.1} % of the scenes{held})", family.name, 100.0 * plan.expected_share(k));
        for (part, detail) in parts(plan, k) {
            outln!("  {part:<14} {detail}");
        }
        if let Some(cost) = estimate.map(|estimate| &estimate.families[k]) {
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
        estimate.advice.iter().for_each(|advice| outln!("{advice}"));
    }
}

/// What a build may take of the disk: `generate` leaves some free.
fn free_bytes(place: &Path) -> Option<u64> {
    estimate::free_bytes(place).map(|bytes| bytes.saturating_sub(KEEP_FREE_BYTES))
}

/// What this machine cannot do of what is promised for it: room on its disk, and cores.
fn machine_warnings(estimate: &Estimate, plan: &Plan, args: &PlanArgs) -> Vec<String> {
    let (mut warnings, place) = (Vec::new(), args.place(plan));
    if let Some(free_bytes) = free_bytes(&place).filter(|&free| estimate.bytes.value > free as f64) {
        let points = if plan.tables.contains(&Table::Points) { "leave out the points table, " } else { "" };
        warnings.push(format!(
            "the build takes {}B and {} has {}B for it: lower scenes, {points}or take another --out",
            si(estimate.bytes.value),
            place.display(),
            si(free_bytes as f64)
        ));
    }
    let threads = args.threads;
    if threads > estimate.threads {
        warnings.push(format!(
            "{} are asked for and this machine has {}: what is told is measured on those, and more threads make it no faster here; on {threads} \
             cores as fast as these, all free, it would be some {} (extrapolated: the CPU time over the threads)",
            counted(threads as u64, "thread"),
            counted(estimate.threads as u64, "core"),
            human(Duration::from_secs_f64(estimate.cpu_s.value / threads as f64))
        ));
    }
    if !estimate.not_reached.is_empty() {
        let (within, cure) = match args.sample {
            Some(scenes) => (format!("among {}", counted(scenes, "scene")), "--sample"),
            None => (format!("in {}", human(most(args))), "--limit"),
        };
        let families = estimate.not_reached.join(", ");
        warnings.push(format!(
            "no scene of {families} was reached {within}: they are taken to be as the others; raise {cure}"
        ));
    }
    warnings
}

fn tell_parts(cost: &FamilyCost) {
    let Some(scene_s) = cost.scene_s else { return };
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

/// What is measured on, in words.
fn machine() -> String {
    let cores = counted(default_threads() as u64, "core");
    cpu::name().map_or_else(|| cores.clone(), |name| format!("{cores} of {name}"))
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

fn as_json(plan: &Plan, estimate: Option<&Estimate>, warnings: &[String]) -> serde_json::Value {
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
            "cpu_s_of_one_attempt": cost.and_then(|cost| cost.scene_s), "cpu_s_of_parts": prices,
        })
    });
    let families: Vec<_> = families.collect();
    json!({
        "name": plan.name, "seed": plan.seed, "scenes": plan.scenes, "shards": plan.shards(),
        "scene_plan_hash": plan.scene_plan_hash(), "fidelity": plan.fidelity, "warnings": warnings,
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
        "machine": {"cpu": cpu::name(), "cores": default_threads()}, "families_not_reached": estimate.not_reached,
        "scenes_measured": estimate.scenes, "scenes_failed": failed, "advice": estimate.advice, "threads": estimate.threads,
        "cpu_s": figure(&estimate.cpu_s), "wall_s": figure(&estimate.wall_s), "rows": figure(&estimate.rows),
        "bytes": figure(&estimate.bytes), "needed_bytes_per_s": estimate.needed_bytes_per_s(),
        "stage_cpu_s_per_scene": stages, "table_cpu_s_per_scene": tables, "storage": storage,
    })
}
