//! Checks a config and says what it models, what each part of it costs, and what the whole build will take; or what to build in some hours.

mod answer;
mod budget;
mod budget_args;
mod place;
mod study;
mod told;
mod words;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use clap::Args;

use self::told::{as_json, tell};
use super::options::{
    default_out, default_threads, parse_positive, parse_threads, split_warnings, typed_out, typed_sets,
};
use super::output::{errln, outln};
use super::place::corpus_failure;
use super::progress::{counted, human, si};
use super::signals::stop_on_signals;
use super::{ConfigArgs, Failure, LogFormat};
use crate::build::KEEP_FREE_BYTES;
use crate::config;
use crate::config::fidelity::{SUB_RAYS, Setting};
use crate::corpus::Table;
use crate::cpu;
use crate::measure::estimate::{self, Estimate, EstimateError, Options};
use crate::plan::{Fidelity, Plan};
use crate::shell;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Scenes to build (and throw away) for the estimate; default: as many as make it good to some 3 %; 0 = check only.
    #[arg(long)]
    sample: Option<u64>,
    /// Seconds to measure for: half for the whole build, half for its parts. Where two scenes of each family, with each part and without it, take
    /// longer, up to 30, or to one and a half times the limit; a scene in hand is finished.
    #[arg(long, default_value_t = 8.0, value_name = "SECONDS", value_parser = parse_positive)]
    limit: f64,
    /// Leave out what each part costs.
    #[arg(long)]
    no_parts: bool,
    /// Where the build will write: what storage takes there is measured (by a shard that goes away again).
    #[arg(long)]
    out: Option<PathBuf>,
    /// Threads that the build will have; default: as many as this machine has cores. No more than those measure, and what is beyond them is told as such.
    #[arg(long, value_parser = parse_threads)]
    threads: Option<usize>,
    #[command(flatten)]
    budget: budget_args::BudgetArgs,
    /// One JSON object on stdout instead of text.
    #[arg(long)]
    json: bool,
}

impl PlanArgs {
    /// Where the build goes.
    fn place(&self, plan: &Plan) -> PathBuf {
        self.out.clone().unwrap_or_else(|| default_out(plan))
    }

    fn threads(&self) -> usize {
        self.threads.unwrap_or_else(default_threads)
    }

    /// With hours, what measures a whole build has no say.
    fn check_of_budget(&self) -> Result<(), Failure> {
        let of_sample = "with --hours scenes are made until rows, bytes and time are known; --limit gives that longer";
        let given = [
            ("--threads", self.threads.is_some(), "--cores says how many cores the build will have"),
            ("--sample", self.sample.is_some(), of_sample),
            ("--no-parts", self.no_parts, "with --hours no part is priced in any case"),
        ];
        budget_args::refuse(given, "is of a plan without --hours")
    }
}

pub(super) fn run(args: &PlanArgs, log: LogFormat) -> Result<(), Failure> {
    let plan = args.config.load()?;
    let stop = stop_on_signals()?;
    if let Some(hours) = args.budget.hours {
        args.check_of_budget()?;
        return budget::run(args, &plan, hours, log, &stop);
    }
    args.budget.check_unused()?;
    let half = Duration::from_secs_f64(0.5 * args.limit);
    let options = Options {
        threads: args.threads().min(default_threads()),
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
    let own_choices = own_choices(args, &plan);
    if args.json {
        outln!("{:#}", as_json(&plan, estimate.as_ref(), &own_choices, &warnings));
    } else {
        tell(&plan, estimate.as_ref(), !args.no_parts, &own_choices, &warnings);
        outln!(
            "\nwhat such scenes teach a classifier, and from how many on more teach nothing: marsyard plan {}{}{} --hours 8",
            shell::word(args.config.config.display()),
            typed_sets(&args.config.sets),
            args.out.as_deref().map_or(String::new(), typed_out)
        );
    }
    Ok(())
}

/// Of the keys that the config's `fidelity` sets, with their values, those that the config names otherwise itself.
fn own_choices(args: &PlanArgs, plan: &Plan) -> Vec<Setting> {
    let settings = plan.fidelity.map_or(&[][..], Fidelity::settings);
    let own = |(key, value): &&Setting| {
        let with_words = [args.config.sets.as_slice(), &[format!("{key}={value}")]].concat();
        let is_changed = |made: Plan| made.scene_plan_hash() != plan.scene_plan_hash();
        *key != SUB_RAYS && config::load(&args.config.config, &with_words).is_ok_and(is_changed)
    };
    settings.iter().filter(own).copied().collect()
}

/// A plan takes no longer, whatever it is asked, unless its limit is two thirds of this or more, or it is given a number of scenes.
const MOST: Duration = Duration::from_secs(30);

/// What writing the sampled scenes takes, and the last of them, before anybody is told that they are waited for.
const GRACE: Duration = Duration::from_secs(3);

fn most(args: &PlanArgs) -> Duration {
    match args.sample {
        Some(_) => Duration::MAX,
        // Writing a shard comes between the whole build and its parts, and may take half as long as the limit.
        None => MOST.max(Duration::from_secs_f64(1.5 * args.limit)),
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
    let threads = args.threads();
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

/// What is measured on, in words.
fn machine() -> String {
    let cores = counted(default_threads() as u64, "core");
    cpu::name().map_or_else(|| cores.clone(), |name| format!("{cores} of {name}"))
}

/// The same for programs.
fn machine_json() -> serde_json::Value {
    serde_json::json!({"cpu": cpu::name(), "cores": default_threads()})
}
