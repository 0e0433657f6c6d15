//! Corpora and parameters -> a run folder: the loop itself.
//!
//! A checkpoint holds the place in the stream, the weights, the filter's memory, the best of both, the patience and the looks. It may be
//! written after any look at the validation split, and when training is interrupted; whenever that is, what follows has the same
//! bits, because the place alone says which rows come next and in which portions they are learnt.

mod checkpoint;
mod finished;
mod identity;
mod prepare;
mod summary;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde_json::Value as Json;

use self::checkpoint::Cursor;
use self::finished::Finished;
pub(crate) use self::identity::{as_noted_now, leave_unnoted};
pub(crate) use self::summary::Summary;
use super::filter::Counters;
use super::folder::{self, RunFolder};
use super::learner::Learner;
use super::looks::{Line, LookLog, Looks};
use super::stopping::{Look, Stop, Stopping};
use super::stream::{self, Course, Window};
use super::validation::Validation;
use super::{Model, Sources, TrainError, TrainParams};
use crate::cells::{CellFrame, CellParams};
use crate::drive::Rover;
use crate::plan::Family;
use crate::sweep::Sensor;

/// Checkpoints take at most this share of the time.
const CHECKPOINT_SHARE: f64 = 0.05;

/// What is trained on what.
pub struct Setup {
    pub params: TrainParams,
    /// The resolved config as text.
    pub config_yaml: String,
    pub sources: Arc<Sources>,
    pub origin: Origin,
    /// The run folder.
    pub out: PathBuf,
    pub resume: bool,
    pub init: Option<Init>,
    /// Windows read ahead; never changes a bit.
    pub ahead: usize,
}

/// What a model says of the cells that it was trained on.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    pub cells: CellParams,
    /// As [`About::frames`](crate::train::About::frames).
    pub frames: Vec<CellFrame>,
    /// As [`About::overhangs_m`](crate::train::About::overhangs_m).
    pub overhangs_m: Vec<Option<f64>>,
    /// As [`About::reach_m`](crate::train::About::reach_m).
    pub reach_m: Option<f64>,
    pub rover: Rover,
    pub sensor: Sensor,
    pub mount: [f64; 6],
}

impl Origin {
    /// What a plan says of a family's cells, rover and sensor.
    pub(crate) fn of(family: &Family) -> Origin {
        let rover = &family.drive.rover;
        let mast = rover.mount;
        let own = [mast.x_m, mast.y_m, mast.z_m, mast.yaw_deg, mast.pitch_deg, mast.roll_deg];
        Origin {
            cells: family.cells.clone(),
            frames: Vec::new(),
            overhangs_m: Vec::new(),
            reach_m: None,
            mount: family.sweep.mount.as_ref().map_or(own, |mount| mount.middle(own)),
            rover: (**rover).clone(),
            sensor: (*family.sweep.sensor).clone(),
        }
    }
}

/// A network to start from.
#[derive(Clone, Debug)]
pub struct Init {
    /// The file, for messages.
    pub path: String,
    pub model: Model,
    /// The filter's memory, where it is known.
    pub filter: Option<Vec<u8>>,
}

/// What happens while training.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// Before the first row.
    Start(&'a Start),
    /// So many rows are learnt.
    Rows(u64),
    Look {
        look: &'a Look,
        best: &'a Look,
        is_best: bool,
        /// Looks since the last improvement, which patience bounds.
        waited: u32,
        counters: Counters,
    },
    /// Training goes on from here after a kill.
    Checkpoint { rows: u64 },
    /// Something in the run folder was not as it should be, and this is done about it.
    Note(&'a str),
}

/// What is known before the first row is learnt.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    pub train_rows: u64,
    pub validation_rows: u64,
    /// Of those, what each look takes.
    pub look_rows: u64,
    pub untraversable_share: f64,
    pub weights: usize,
    pub features: Vec<String>,
    /// Features that never vary.
    pub constant: Vec<String>,
    pub class_weights: [f64; 2],
    pub validate_every: u64,
    pub stream_bytes: u64,
    /// Rows learnt before a kill.
    pub resumed_at: u64,
    /// Only one label is there.
    pub one_class: bool,
    /// Whether `--init` brought a covariance.
    pub covariance: Option<bool>,
}

/// How it ended.
#[derive(Debug)]
pub enum Outcome {
    /// The folder stays locked until it is dropped: what else is written there is written under the same lock.
    Done(Box<Summary>, RunFolder),
    /// Asked to stop; the checkpoint is written.
    Interrupted { rows: u64 },
}

/// Hears what happens, on whichever thread trains.
pub type Tell<'t> = &'t mut (dyn FnMut(Event) + Send);

/// Trains, or goes on training, until the validation error rises, the epochs are over, or `stop` is raised. It works on the threads of
/// rayon's current pool.
pub fn train(setup: &Setup, stop: &AtomicBool, tell: Tell) -> Result<Outcome, TrainError> {
    // Work inside a pool is handed to its threads without waking them each time.
    rayon::scope(|_| train_here(setup, stop, tell))
}

fn train_here(setup: &Setup, stop: &AtomicBool, tell: Tell) -> Result<Outcome, TrainError> {
    if !setup.resume && setup.out.exists() {
        // Said before the corpora are read; creating the folder says it again, whoever was faster.
        return Err(TrainError::Exists { path: setup.out.display().to_string() });
    }
    let identity = identity::of(setup);
    let begun = if setup.resume { RunFolder::resume(&setup.out)? } else { None };
    let begun = match begun {
        Some(run) => match finished::completed(setup, &run, &identity, tell)? {
            Some(summary) => return Ok(Outcome::Done(Box::new(summary), run)),
            None => Some(run),
        },
        None => None,
    };
    let training = Training::prepare(setup, identity, begun, tell)?;
    tell(Event::Start(&training.start));
    training.learn(stop, tell)
}

struct Training<'s> {
    setup: &'s Setup,
    run: RunFolder,
    identity: Json,
    validation: Validation,
    learner: Learner,
    place: Cursor,
    looks: Looks,
    log: LookLog,
    started: Instant,
    elapsed_before: Duration,
    /// When the last checkpoint was done, and how long it took.
    checkpoint: (Instant, Duration),
    start: Start,
}

impl Training<'_> {
    fn learn(mut self, stop: &AtomicBool, tell: Tell) -> Result<Outcome, TrainError> {
        // The first window is read while the network is looked at as it is before the first row.
        let windows = self.place.stopped.is_none().then(|| {
            let Cursor { epoch, window, .. } = self.place;
            let course = Course { seed: self.setup.params.seed, epoch, window, epochs: self.setup.params.epochs };
            stream::start(Arc::clone(&self.setup.sources), course, self.setup.ahead)
        });
        if self.learner.learnt.stopping.looks == 0 {
            self.look(tell)?;
            self.save(tell)?;
        }
        if let Some(mut windows) = windows {
            while let Some(window) = windows.next().transpose()? {
                let going_on = self.window(&window, stop, tell)?;
                windows.reuse(window);
                if self.place.stopped.is_some() {
                    break;
                }
                if !going_on {
                    self.save(tell)?;
                    return Ok(Outcome::Interrupted { rows: self.learner.learnt.rows });
                }
            }
        }
        if self.place.stopped.is_none() {
            if self.learner.is_ahead_of_look() {
                self.look(tell)?;
            }
            self.place.stopped = Some(Stop::Epochs);
        }
        self.save(tell)?;
        self.finish()
    }

    /// Learns what is left of a window; false where training was asked to stop.
    fn window(&mut self, window: &Window, stop: &AtomicBool, tell: Tell) -> Result<bool, TrainError> {
        if (self.place.epoch, self.place.window) != (window.epoch, window.window) {
            (self.place.epoch, self.place.window, self.place.offset) = (window.epoch, window.window, 0);
        }
        while (self.place.offset as usize) < window.order.len() {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            self.place.offset = self.learner.learn(&window.rows, &window.order, self.place.offset as usize) as u64;
            tell(Event::Rows(self.learner.learnt.rows));
            if self.learner.is_look_due() {
                self.look(tell)?;
                if self.learner.is_over() {
                    self.place.stopped = Some(Stop::Patience);
                    self.place.left_out += window.rows.left_out;
                    return Ok(true);
                }
                let (last, cost) = self.checkpoint;
                if last.elapsed().mul_f64(CHECKPOINT_SHARE) > cost {
                    self.save(tell)?;
                }
            }
        }
        self.place.left_out += window.rows.left_out;
        Ok(true)
    }

    fn look(&mut self, tell: Tell) -> Result<(), TrainError> {
        let error = self.validation.error(&self.learner.objective, &self.learner.network);
        let (look, is_best) = self.learner.look(self.place.epoch, error);
        let elapsed_s = (self.elapsed_before + self.started.elapsed()).as_secs_f64();
        let line = Line { look, best: is_best, elapsed_s };
        self.looks.push(self.learner.learnt.stopping.looks - 1, line);
        self.log.push(&line)?;
        let Stopping { best, waited, .. } = &self.learner.learnt.stopping;
        let best = best.as_ref().unwrap_or(&look);
        tell(Event::Look { look: &look, best, is_best, waited: *waited, counters: self.learner.filter.counters() });
        Ok(())
    }

    fn save(&mut self, tell: Tell) -> Result<(), TrainError> {
        let begun = Instant::now();
        self.run.write(folder::CHECKPOINT, &self.checkpoint_bytes())?;
        self.checkpoint = (Instant::now(), begun.elapsed());
        tell(Event::Checkpoint { rows: self.learner.learnt.rows });
        Ok(())
    }

    /// Reverts to the best, and writes everything that is left of a training.
    fn finish(mut self) -> Result<Outcome, TrainError> {
        self.learner.revert();
        let summary = self.summary()?;
        let run_id = identity::run_id(&self.identity);
        let scaler = self.learner.objective.scaler.clone();
        let model = summary::model_of(self.setup, run_id, scaler, self.learner.network.clone())?;
        let finished = Finished { summary, looks: self.looks, best: self.learner.best };
        let summary = finished.write(&self.run, Some(&model))?;
        Ok(Outcome::Done(Box::new(summary), self.run))
    }
}
