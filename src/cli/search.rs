//! Searches for a network that is small and good: the paper's sweep over one to three hidden layers.
//!
//! The verb reads the rows, chooses the networks, and talks; what is learnt, and which networks go on, is `search`'s.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::options::{default_threads, labels_set, parse_threads, read_share};
use super::output::{errln, out};
use super::place::{check_folder, corpus_failure, must_be_local};
use super::progress::SearchProgress;
use super::signals::stop_on_signals;
use super::train::{goes_on, open_source, run_folder, train_failure};
use super::{Failure, LogFormat, config_failure};
use crate::config;
use crate::corpus::{Build, LocalFolder, Split, owner};
use crate::search::leaderboard::shown_interval;
use crate::search::networks::{DEEPEST, Hidden, WIDEST, full, grid, sample, shown};
use crate::search::over_scenes::ValidationScenes;
use crate::search::{Entry, Leaderboard, Outcome, Setup, journal, leaderboard, search};
use crate::shell;
use crate::train::memory::Held;
use crate::train::params::FilterParams;
use crate::train::rows::only_class;
use crate::train::{Sources, TrainParams, folder, scenes};

/// Train many networks a little, the better ones longer; say how small one may be, and write the config that trains it.
///
/// All networks learn each row once, one network per thread. The best share of them, and every network that no smaller one
/// beats, learn more; and so on, until the last rung has all epochs. The run folder holds search.jsonl (a line
/// for each network and rung, as it is finished), search.json, search.svg and train.yaml: the config of the smallest network
/// whose validation error is above the best by at most --margin, a share of it.
#[derive(Debug, Args)]
#[command(after_help = owner::RULE, after_long_help = format!("Start with:  marsyard search corpora/quickstart\n\
    then:        marsyard train corpora/quickstart --config runs/quickstart-search-1/train.yaml\n\n{}", owner::RULE))]
pub(super) struct SearchArgs {
    /// The folder or URL of a finished corpus.
    corpus: PathBuf,
    /// A training config (YAML); its `network.hidden` and `epochs` do not apply. Default: all defaults, and the Kalman filter of
    /// configs/train/ekf.yaml unless `--set` names another.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Override a key of the config: --set features=listed (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Search all 33,824 networks of one to three hidden layers of up to 32 neurons (the paper's sweep), instead of a grid. At the
    /// default rows and epochs some 3.5 CPU hours, 2 h on two free cores, with AVX-512; what it takes here is measured and said before
    /// the first network is trained.
    #[arg(long, conflicts_with_all = ["widths", "layers"])]
    full: bool,
    /// Widths of the grid, with commas between, or behind the corpus with blanks: all combinations of them in each number of layers.
    #[arg(long, value_delimiter = ',', num_args = 1.., value_name = "NEURONS", default_value = "2,4,8,16,24,32", value_parser = parse_width)]
    widths: Vec<usize>,
    /// Most hidden layers of the grid.
    #[arg(long, default_value_t = DEEPEST)]
    layers: usize,
    /// Search a random share of these networks: --sample 0.01 of --full measures what all of it would take.
    #[arg(long, default_value_t = 1.0, value_name = "SHARE", value_parser = parse_share)]
    sample: f64,
    /// Rows to learn, of at least a hundred scenes drawn from the train split.
    #[arg(long, default_value_t = 20_000, value_parser = parse_rows)]
    rows: usize,
    /// Rows to judge by, of at least a hundred scenes drawn from the validation split.
    #[arg(long, default_value_t = 10_000, value_parser = parse_rows)]
    validation_rows: usize,
    /// Passes over the rows in the last rung, at most.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    epochs: u32,
    /// Rungs: in the first each row is learnt once, in the last in all epochs, those between grow by one factor.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=8))]
    rungs: u8,
    /// Share of the networks that goes on from each rung; 1 trains all to the end.
    #[arg(long, default_value_t = 0.25, value_name = "SHARE", value_parser = parse_share)]
    keep: f64,
    /// By what share of the best validation error the chosen network's may be above it: 10% or 0.1.
    #[arg(long, default_value = "10%", value_name = "SHARE", value_parser = parse_margin)]
    margin: f64,
    /// Labels for another rover, as in `marsyard train`.
    #[arg(long, value_name = "RULE")]
    labels: Option<String>,
    /// Of scenes, initial weights, the order of rows and the sample; short for --set seed=N.
    #[arg(long)]
    seed: Option<u64>,
    /// The run folder, which must not be there yet; default: runs/<corpus>-search-1, or the next free number.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Go on in the run folder where a search was interrupted; begin where nothing is there. Default --out: the last number.
    #[arg(long)]
    resume: bool,
    /// Networks trained at a time; never changes a bit.
    #[arg(long, default_value_t = default_threads(), value_parser = parse_threads)]
    threads: usize,
}

fn parse_share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => Err(format!("'{text}' is not a share in (0, 1]")),
    }
}

/// `10%` or `0.1`; none is the best network itself.
fn parse_margin(text: &str) -> Result<f64, String> {
    match read_share(text) {
        Some(margin) if (0.0..=1.0).contains(&margin) => Ok(margin),
        _ => Err(format!("'{text}' is no share from 0 to 1 of the best error: a tenth above it is 10% or 0.1")),
    }
}

fn parse_width(text: &str) -> Result<usize, String> {
    text.trim()
        .parse()
        .map_err(|_| format!("'{text}' is no number of neurons: --widths 4,8,16, or --widths 4 8 16 behind the corpus"))
}

fn parse_rows(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(rows) if rows > 0 => Ok(rows),
        _ => Err(format!("'{text}' is no number of rows from 1 on")),
    }
}

/// What networks learn by where there is no config and `--set` names no filter: as configs/train/ekf.yaml has it.
const KALMAN_FILTER: &str = "filter={ekf: {}}";

impl SearchArgs {
    fn params(&self) -> Result<TrainParams, Failure> {
        // The smallest of networks is looked for, and they learn most from a row by the Kalman filter.
        let names_filter = self.config.is_some() || self.sets.iter().any(|set| set.starts_with("filter"));
        let own = (!names_filter).then(|| KALMAN_FILTER.to_owned()).into_iter();
        let mut sets: Vec<String> = own.chain(self.sets.iter().cloned()).collect();
        sets.extend(self.labels.as_deref().map(labels_set).transpose()?);
        sets.extend(self.seed.map(|seed| format!("seed={seed}")));
        config::load_train(self.config.as_deref(), &sets).map_err(config_failure)
    }

    fn networks(&self, seed: u64) -> Result<Vec<Hidden>, Failure> {
        let refuse = |what: String, help: String| Err(Failure::usage(miette::miette!(help = help, "{what}")));
        if let Some(width) = self.widths.iter().find(|&&width| !(1..=4096).contains(&width)) {
            return refuse(format!("--widths: {width} is not in 1..=4096"), "for example: --widths 4,8,16,32".into());
        }
        if !(1..=8).contains(&self.layers) {
            return refuse(format!("--layers: {} is not in 1..=8", self.layers), "for example: --layers 3".into());
        }
        let mut widths = self.widths.clone();
        widths.sort_unstable();
        widths.dedup();
        let most = widths.len().checked_pow(self.layers as u32).unwrap_or(usize::MAX);
        if most > 1_000_000 {
            return refuse(
                format!("{} widths in {} layers are more than a million networks", widths.len(), self.layers),
                format!("name fewer widths; --full is all up to {WIDEST} neurons in {DEEPEST} layers"),
            );
        }
        let all = if self.full { full() } else { grid(&widths, self.layers) };
        let networks = sample(all, self.sample, seed);
        if networks.is_empty() {
            return refuse(format!("--sample {} of these networks is none", self.sample), "give a larger share".into());
        }
        Ok(networks)
    }
}

pub(super) fn run(args: &SearchArgs, log: LogFormat) -> Result<(), Failure> {
    let params = args.params()?;
    let networks = args.networks(params.seed)?;
    check_folder(&args.corpus)?;
    args.out.iter().try_for_each(|out| must_be_local("--out", out))?;
    let source = open_source(&args.corpus, 1.0)?;
    let name = source.name.clone();
    let mut data = json!({
        "corpus": name,
        "corpus_id": source.corpus_id,
        "manifest_sha256": source.manifest_sha256,
        journal::SHARDS: source.shards_sha256,
        "rows": args.rows,
        "validation_rows": args.validation_rows,
    });
    let out = run_folder(args.out.as_deref(), &format!("{name}-search"), args.resume)?;
    if args.config.as_ref().is_some_and(|config| owner::is_same_file(config, &out.join(folder::CONFIG))) {
        let refused = owner::foreign(out.display().to_string(), folder::CONFIG, owner::IS_INPUT);
        return Err(corpus_failure(refused));
    }
    let sources = Sources::new(vec![source], &params.features, params.labels.clone()).map_err(train_failure)?;
    data["features"] = json!(sources.features);
    let draw = |split, rows| scenes::draw(&sources, split, rows, params.seed).map_err(train_failure);
    let train = draw(Split::Train, args.rows)?;
    if let (Some(label), false) = (only_class(train.rows.counts()), params.allow_one_class) {
        let help = "draw more with --rows, build scenes with both (`marsyard inspect` says what is weak), choose other --labels, or --set allow_one_class=true";
        let rows = train.rows.len();
        return Err(Failure::usage(miette::miette!(
            help = help,
            "all {rows} rows to learn that were drawn are {label}: a network could only learn to say so"
        )));
    }
    let validation = draw(Split::Validation, args.validation_rows)?;
    let mut progress = SearchProgress::new(&out, &name, (&train, &validation), args.threads, log);
    let to_train = params.clone();
    let held = Held::new(&sources.features, train.rows, validation.rows, &[1.0], &params).map_err(train_failure)?;
    let setup = Setup {
        scenes: ValidationScenes::new(&held, &validation.of_row),
        held,
        params: TrainParams { epochs: args.epochs, ..params },
        networks,
        rungs: usize::from(args.rungs),
        keep: args.keep,
        margin: args.margin,
        threads: args.threads,
        data,
        config_of: Box::new(move |hidden| {
            let mut params = to_train.clone();
            params.network.hidden = hidden.to_vec();
            config::train_yaml(&params)
        }),
        out,
        resume: args.resume,
    };
    let stop = stop_on_signals()?;
    let outcome = search(&setup, &stop, &mut |event| progress.take(&event));
    progress.finish();
    let goes_on = |failure| goes_on(failure, &setup.out);
    match outcome.map_err(train_failure).map_err(goes_on)? {
        Outcome::Interrupted { entries } => Err(Failure::new(Failure::TRY_AGAIN, interrupted(&setup, entries))),
        Outcome::Done(board, entries) => {
            write_report(&setup, &progress).map_err(goes_on)?;
            tell_end(args, &setup, &board, &entries, log);
            Ok(())
        }
    }
}

fn interrupted(setup: &Setup, entries: usize) -> miette::Report {
    miette::miette!(
        help = format!("the same command with --resume --out {} goes on from here", shell::word(setup.out.display())),
        "interrupted with {entries} trainings in the journal"
    )
}

/// Times, which are no part of what a search finds.
fn write_report(setup: &Setup, progress: &SearchProgress) -> Result<(), Failure> {
    let report = json!({
        "wall_s": progress.elapsed().as_secs_f64(),
        "trainings": progress.done_here(),
        "expected_thread_s": progress.expected_thread_s(),
        "thread_s": progress.thread_s(),
        "threads": setup.threads,
        "build": Build::of_this_binary(),
    });
    folder::write_report(&LocalFolder::new(&setup.out), progress.done_here() == 0, &report).map_err(corpus_failure)
}

fn tell_end(args: &SearchArgs, setup: &Setup, board: &Leaderboard, entries: &[Entry], log: LogFormat) {
    let chosen = board.chosen.as_ref().map(|line| shown(&line.hidden)).unwrap_or_default();
    if log == LogFormat::Json {
        let best = entries.first().and_then(|entry| entry.validation_error);
        let above = board.chosen.as_ref().and_then(|line| line.above_best);
        let (above_best, half_width) = (above.map(|above| above.mean), above.map(|above| above.half_width));
        tracing::info!(event = "done", run = %setup.out.display(), networks = board.networks, chosen, best_validation_error = best, above_best, half_width);
        return;
    }
    out!("{}", leaderboard::table(entries, &setup.scenes, setup.margin));
    for (number, rung) in (1..).zip(&board.rungs).take(board.rungs.len().saturating_sub(1)) {
        if let Some(rho) = rung.rank_correlation {
            let last = entries.len();
            errln!(
                "rung {number} ({} rows) ranks the {last} networks of the last rung as it does: rho {rho:.2}",
                rung.rows
            );
        }
    }
    if board.chosen.is_none() {
        errln!("no network has a finite validation error: look at the features, and at the filter's settings");
        return;
    }
    let config = setup.out.join(folder::CONFIG);
    errln!(
        "> {chosen}: the smallest network within {:.1} % of the best validation error{}{}\nnext: marsyard train {} --config {}",
        100.0 * setup.margin,
        over_scenes(board),
        if matches!(setup.params.filter, FilterParams::Ekf(_)) { BY_KALMAN_FILTER } else { "" },
        shell::word(args.corpus.display()),
        shell::word(config.display())
    );
}

/// What a search by the extended Kalman filter does not compare with.
const BY_KALMAN_FILTER: &str = "\nlearnt by the Kalman filter, each alone; what train takes by default, larger and by batches, is not among them (docs/accuracy.md sets the two beside each other)";

/// How sure that is.
fn over_scenes(board: &Leaderboard) -> String {
    let best = board.leaderboard.first().and_then(|line| line.error);
    let above = board.chosen.as_ref().and_then(|line| line.above_best);
    let is_best = board.chosen.as_ref() == board.leaderboard.first();
    let Some(scenes) = board.validation_scenes else { return String::new() };
    let above = if is_best { String::new() } else { format!(",\n  {} above it", shown_interval(above)) };
    let best = shown_interval(best);
    format!(" ({best}){above} (95 % over {scenes} validation scenes; the best of many looks better than it is)")
}
