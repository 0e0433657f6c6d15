//! A config -> what each choice between speed and accuracy costs, the error it brings, and what it is worth. All of it is measured.
//!
//! ```text
//! surrogate   drawn pose errors as large as the reference's own
//! settings    a reference, the same with other draws, and alternatives that change one knob (or a preset's)
//! measure     the same scenes at every setting, interleaved: times, ranges, poses, cells
//! compare       matched cells: changed labels, shifted features
//! judging     common test scenes of the reference: the own kinds of yard, and each held-out family
//! learning    classifiers trained at every setting, at four sizes (sizes), on common random numbers
//! rounds      more trainings and test scenes until what matters is resolved or the time is over
//! combine     the most promising combinations of knobs, measured likewise
//! worth       learning curves over CPU time (curve), gains at equal CPU with intervals over scenes and trainings (resample)
//! farther     what is told better, and the reference, on many times the scenes
//! recommend   what is told to be better
//! summary     one row a setting: a report  ->  table, records (Parquet), chart (SVG), JSON
//! ```
//!
//! Same addresses, so the same yards, drives and draws at every setting. What changes the yard or what is modelled is not an error;
//! it is measured alike and reported apart. All but the times, and what is told and combined by equal times, is the same for any number of
//! threads.

pub(crate) mod chart;
mod combine;
mod compare;
mod curve;
mod curve_grids;
mod farther;
mod filters;
mod front;
mod grid;
mod judging;
mod knobs;
mod learning;
mod measure;
mod missed;
mod ranges;
mod recommend;
pub(crate) mod records;
pub(crate) mod report;
mod resample;
mod rounds;
pub(crate) mod settings;
pub(crate) mod sizes;
mod summary;
mod surrogate;
pub(crate) mod table;
#[cfg(test)]
mod tests;
mod words;
mod worth;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use crate::config::ConfigError;
use crate::corpus::Split;
use crate::episode::Prepared;
use crate::parallel::{PoolError, panic_message};
use crate::plan::Plan;
use crate::slam::params::SurrogateParams;
use crate::sweep::PatternError;
use crate::train::TrainError;

use measure::Measured;
pub(crate) use measure::inputs;
pub(crate) use report::Report;
pub(crate) use settings::Group;
use settings::Settings;
pub(crate) use words::points;

/// What is measured, and how.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    pub config: PathBuf,
    /// Overrides of the config, as `--set` takes them; they hold at every setting.
    pub sets: Vec<String>,
    /// Made at every setting.
    pub scenes: u64,
    /// Scenes to judge by, of the own kinds and of each held-out family.
    pub test_scenes: u64,
    /// Groups of settings; empty = all.
    pub only: Vec<Group>,
    /// Combinations of knobs that are measured beside single ones, at most.
    pub combinations: usize,
    /// Times the scenes on which what is told better, and the reference, are measured again; 1 = they are not.
    pub farther: u64,
    /// Trainings of each classifier in a round; from 2 on there is an interval.
    pub seeds: u64,
    /// Half-width of gains, as a share of balanced accuracy, until which rounds follow.
    pub resolve: Option<f64>,
    /// No round is begun that would end later; with neither of the two there is one round.
    pub time: Option<Duration>,
    pub threads: usize,
}

impl Options {
    /// Whether the settings of a group are measured.
    fn wants(&self, group: Group) -> bool {
        self.only.is_empty() || self.only.contains(&group)
    }
}

/// What happens meanwhile.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Event {
    /// Before the first scene: settings of the pipeline, and scenes.
    Start { settings: usize, scenes: usize, trainings: usize },
    /// One scene was made at every setting.
    Scene { done: usize, of: usize },
    /// One scene was made to judge by.
    TestScene { done: usize, of: usize },
    /// One classifier was trained.
    Training { done: usize, of: usize },
    /// So many rounds are over and another follows; the half-width of the gain that is known least.
    Round { done: u64, half_width: Option<f64> },
}

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TradeoffError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Pattern(#[from] PatternError),
    #[error("the classifier of '{setting}': {source}")]
    Train { setting: String, source: Box<TrainError> },
    #[error("a scene panicked: {message}; this is a bug of marsyard: please report it with the config")]
    Panic { message: String },
    #[error(transparent)]
    Threads(#[from] PoolError),
    #[error(
        "there is no setting to measure: of {groups} the config has nothing that could be turned, or all of it stands so already; leave --only out, or \
         name other groups"
    )]
    NoSetting { groups: String },
    #[error("none of {scenes} scenes could be made at the reference setting; the first said: {reason}")]
    NoScene { scenes: usize, reason: String },
    #[error(
        "classifiers cannot be judged: none of the {scenes} test scenes' families holds traversable and untraversable cells; put obstacles into the \
         config's yards, or give more by --test-scenes"
    )]
    OneClass { scenes: u64 },
}

/// What the work gives; its panic as an error.
fn caught<T>(work: impl FnOnce() -> T) -> Result<T, TradeoffError> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| TradeoffError::Panic { message: panic_message(panic) })
}

/// Measures; `None` where `stop` was raised before the end.
pub(crate) fn run(
    options: &Options,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Report>, TradeoffError> {
    let begun = Instant::now();
    let reference = settings::reference(&options.config, &options.sets)?;
    measure::refuse_if_none_can_be_made(&reference, &scenes(&reference, options.scenes), stop)?;
    let Some(surrogate) = surrogate_of(&reference, options, stop)? else { return Ok(None) };
    let settings = settings::settings(options, &surrogate)?;
    if !options.only.is_empty() && settings.list.iter().all(|setting| setting.group.is_none()) {
        let groups: Vec<&str> = options.only.iter().map(|group| group.name()).collect();
        return Err(TradeoffError::NoSetting { groups: groups.join(", ") });
    }
    let Some(scenes) = measured(&settings, options, stop, tell)? else { return Ok(None) };
    let Some(report) = rounds::rounds(&settings, &scenes, options, begun, stop, tell)? else { return Ok(None) };
    drop(scenes);
    let report = combine::add(report, options, &settings, stop, tell)?;
    farther::add(report, options, stop, tell).map(Some)
}

/// Pose errors as large as the reference's, where it is asked for them; `None` where `stop` was raised before the end.
fn surrogate_of(
    reference: &Plan,
    options: &Options,
    stop: &AtomicBool,
) -> Result<Option<SurrogateParams>, TradeoffError> {
    if !options.wants(Group::Slam) {
        return Ok(Some(SurrogateParams::default()));
    }
    surrogate::calibrated(reference, &scenes(reference, options.scenes), options.threads, stop)
}

/// The scenes at all settings; `None` where `stop` was raised before the end.
fn measured(
    settings: &Settings,
    options: &Options,
    stop: &AtomicBool,
    tell: &mut (dyn FnMut(Event) + Send),
) -> Result<Option<Measured>, TradeoffError> {
    let scenes = scenes(settings.reference(), options.scenes);
    let prepared = settings.plans().map(|plan| Prepared::new(plan.clone())).collect::<Result<Vec<_>, _>>()?;
    tell(Event::Start {
        settings: prepared.len(),
        scenes: scenes.len(),
        trainings: learning::most_trainings(settings, options),
    });
    measure::measure(&prepared, &scenes, options.threads, stop, tell)
}

/// Scenes of the plan's train split, evenly spread, so that no setting is chosen by the test split; beyond the plan's end where it
/// has too few (more scenes only add shards).
fn scenes(plan: &Plan, count: u64) -> Vec<u64> {
    let is_train = |scene: &u64| Split::of_shard(plan.shard_of(*scene)) == Split::Train;
    let own: Vec<u64> = (0..plan.scenes).filter(is_train).collect();
    let there = own.len() as u64;
    if there >= count {
        (0..count).map(|k| own[(k * there / count) as usize]).collect()
    } else {
        (0..).filter(is_train).take(count as usize).collect()
    }
}
