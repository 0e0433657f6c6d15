//! Shards -> scenes on all threads -> shards, each handed over whole.
//!
//! Threads take scenes across shard borders, so one shard may keep all of them busy. Outputs are put back in order; the thread
//! that is free next takes a whole shard before it takes another scene, so writing holds nobody up. What a shard holds depends
//! on no number of threads; which of two shards is written first may. Memory is bounded by the scenes in flight: a thread may
//! run at most a window ahead of the shards that are written.

use std::collections::{BTreeMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::sync::{Condvar, Mutex};
use std::time::{Duration, Instant};

use super::{Hashes, Prepared, Record, Scratch, run_scene};
use crate::corpus::SceneOutput;
use crate::random::Drawn;

/// What happens while a corpus is built, for progress and logs.
#[derive(Debug)]
pub enum Event<'a, T> {
    /// A scene's rows are there (or its failure).
    Scene { output: &'a SceneOutput, record: &'a Record },
    /// A shard was handed over: what came of it, and how long that took.
    Shard { shard: u64, written: &'a T, took: Duration },
}

/// How a build ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All shards were handed over.
    Done,
    /// Asked to stop: the shards handed over are whole, the rest was discarded.
    Interrupted,
}

/// Why a build ended early.
#[derive(Debug, thiserror::Error)]
pub enum BuildError<E: std::error::Error + 'static> {
    #[error(transparent)]
    Write(E),
    /// The same scene twice, with two ends.
    #[error(
        "scene {scene} panicked ({first}), and again it {second}: the same scene twice must end alike, so this machine or its \
             memory is not to be trusted; the same command again, here or elsewhere, goes on"
    )]
    Unsteady { scene: u64, first: String, second: String },
    /// A library out of memory, or a bug: what cannot be written is an error.
    #[error(
        "shard {shard} panicked while it was written: {message}; where memory is short, fewer --threads take less, and the same \
             command goes on; otherwise this is a bug of marsyard: please report it with the plan"
    )]
    Panic { shard: u64, message: String },
    #[error("could not start {threads} threads: {reason}")]
    Threads { threads: usize, reason: String },
}

/// What is built, and by how many.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// Ascending.
    pub shards: &'a [u64],
    pub threads: usize,
    /// When it is raised, shards that are whole are still written.
    pub stop: &'a AtomicBool,
    /// Record the hashes of each stage's f64 results.
    pub hashes: bool,
}

/// Where scenes come from: a plan, or a test.
trait Scenes: Sync {
    fn per_shard(&self) -> usize;
    fn make(&self, scene: u64, scratch: &mut Scratch, record: &mut Record) -> SceneOutput;
    fn family(&self, scene: u64) -> &str;
}

impl Scenes for Prepared {
    fn per_shard(&self) -> usize {
        self.plan.scenes_per_shard as usize
    }

    fn make(&self, scene: u64, scratch: &mut Scratch, record: &mut Record) -> SceneOutput {
        run_scene(self, scene, scratch, record)
    }

    fn family(&self, scene: u64) -> &str {
        &self.plan.family_of(scene).name
    }
}

/// What threads may take, and how far the shards are written; scenes are counted along the job's shards.
struct Queue {
    /// Shards whose scenes are all there.
    whole: VecDeque<(u64, Vec<SceneOutput>)>,
    taken: usize,
    /// Scenes of the shards that are written.
    written: usize,
}

/// What a thread does next.
enum Task {
    Scene(u64),
    Shard(u64, Vec<SceneOutput>),
}

/// What a thread has done.
enum Message<T, E> {
    Scene(Box<SceneOutput>, Record),
    Unsteady { scene: u64, first: String, second: String },
    Shard { shard: u64, written: Result<T, E>, took: Duration },
    Panic { shard: u64, message: String },
}

impl<T, E> Message<T, E> {
    /// The thread that says it takes no further task.
    fn is_last(&self) -> bool {
        matches!(self, Message::Unsteady { .. } | Message::Panic { .. } | Message::Shard { written: Err(_), .. })
    }
}

/// Builds the job's shards and hands each over, whole, to `write`; several at a time, from any thread.
///
/// `on_event` is called on the caller's thread.
pub fn generate<T: Send, E: std::error::Error + Send + 'static>(
    prepared: &Prepared,
    job: Job,
    on_event: impl FnMut(Event<T>),
    write: impl Fn(u64, Vec<SceneOutput>) -> Result<T, E> + Sync,
) -> Result<Outcome, BuildError<E>> {
    build(prepared, job, on_event, write)
}

fn build<T: Send, E: std::error::Error + Send + 'static>(
    scenes: &impl Scenes,
    job: Job,
    mut on_event: impl FnMut(Event<T>),
    write: impl Fn(u64, Vec<SceneOutput>) -> Result<T, E> + Sync,
) -> Result<Outcome, BuildError<E>> {
    let Job { shards, threads, stop, hashes } = job;
    let per_shard = scenes.per_shard();
    let all = shards.len() * per_shard;
    let scene_at = |k: usize| shards[k / per_shard] * per_shard as u64 + (k % per_shard) as u64;
    // A window of two scenes a thread beyond a whole shard keeps every thread busy while the slowest scene finishes.
    let window = per_shard + 2 * threads;
    let queue = Mutex::new(Queue { whole: VecDeque::new(), taken: 0, written: 0 });
    let news = Condvar::new();
    let quit = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();

    let next_task = || -> Option<Task> {
        let mut queue = queue.lock().expect("no thread panics while it holds the queue");
        loop {
            if quit.load(Ordering::Relaxed) {
                return None;
            }
            if let Some((shard, outputs)) = queue.whole.pop_front() {
                return Some(Task::Shard(shard, outputs));
            }
            if stop.load(Ordering::Relaxed) || queue.written == all {
                return None;
            }
            if queue.taken < all && queue.taken < queue.written + window {
                queue.taken += 1;
                return Some(Task::Scene(scene_at(queue.taken - 1)));
            }
            // Woken when a shard is whole or written; the timeout notices a stop signal.
            let tick = Duration::from_millis(50);
            queue = news.wait_timeout(queue, tick).expect("no thread panics while it holds the queue").0;
        }
    };
    let do_task = |task: Task, scratch: &mut Scratch| match task {
        Task::Scene(scene) => make_scene(scenes, scene, hashes, scratch),
        Task::Shard(shard, outputs) => {
            let (started, scenes) = (Instant::now(), outputs.len());
            match catch_unwind(AssertUnwindSafe(|| write(shard, outputs))) {
                Err(panic) => Message::Panic { shard, message: panic_message(panic) },
                Ok(written) => {
                    queue.lock().expect("no thread panics while it holds the queue").written += scenes;
                    news.notify_all();
                    Message::Shard { shard, written, took: started.elapsed() }
                }
            }
        }
    };

    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|k| format!("scene-{k}"))
        .build()
        .map_err(|e| BuildError::Threads { threads, reason: e.to_string() })?;
    pool.in_place_scope(|scope| {
        for _ in 0..threads {
            let sender = sender.clone();
            let (next_task, do_task) = (&next_task, &do_task);
            scope.spawn(move |_| {
                let mut scratch = Scratch::default();
                while let Some(task) = next_task() {
                    let message = do_task(task, &mut scratch);
                    let last = message.is_last();
                    if sender.send(message).is_err() || last {
                        break;
                    }
                }
            });
        }
        drop(sender);

        let mut waiting: BTreeMap<u64, SceneOutput> = BTreeMap::new();
        let mut shard_outputs: Vec<SceneOutput> = Vec::new();
        let (mut next, mut written_shards) = (0, 0);
        let end_with = |error| {
            quit.store(true, Ordering::Relaxed);
            news.notify_all();
            Err(error)
        };
        for message in receiver {
            match message {
                Message::Unsteady { scene, first, second } => {
                    return end_with(BuildError::Unsteady { scene, first, second });
                }
                Message::Panic { shard, message } => return end_with(BuildError::Panic { shard, message }),
                Message::Scene(output, record) => {
                    on_event(Event::Scene { output: &output, record: &record });
                    waiting.insert(output.scene_id, *output);
                }
                Message::Shard { written: Err(error), .. } => return end_with(BuildError::Write(error)),
                Message::Shard { shard, written: Ok(written), took } => {
                    written_shards += 1;
                    on_event(Event::Shard { shard, written: &written, took });
                }
            }
            while next < all
                && let Some(output) = waiting.remove(&scene_at(next))
            {
                next += 1;
                shard_outputs.push(output);
                if shard_outputs.len() == per_shard {
                    let whole = (shards[(next - 1) / per_shard], std::mem::take(&mut shard_outputs));
                    queue.lock().expect("no thread panics while it holds the queue").whole.push_back(whole);
                    news.notify_one();
                }
            }
        }
        Ok(if written_shards == shards.len() { Outcome::Done } else { Outcome::Interrupted })
    })
}

/// One scene; one that panics twice with the same words has failed.
fn make_scene<T, E>(scenes: &impl Scenes, scene: u64, hashes: bool, scratch: &mut Scratch) -> Message<T, E> {
    let once = |scratch: &mut Scratch| {
        let mut record = Record { hashes: hashes.then(Hashes::new), ..Record::default() };
        let made = catch_unwind(AssertUnwindSafe(|| scenes.make(scene, scratch, &mut record)));
        made.map(|output| (output, record)).map_err(panic_message)
    };
    let first = match once(scratch) {
        Ok((output, record)) => return Message::Scene(Box::new(output), record),
        Err(first) => first,
    };
    *scratch = Scratch::default();
    let second = match once(scratch) {
        Ok(_) => "did not".to_string(),
        Err(second) if second == first => {
            *scratch = Scratch::default();
            let error = format!("panicked: {first}; this is a bug of marsyard: please report it with the plan");
            let output = SceneOutput::failed(scene, scenes.family(scene), 0, Drawn::default(), error);
            return Message::Scene(Box::new(output), Record::default());
        }
        Err(second) => format!("panicked otherwise ({second})"),
    };
    Message::Unsteady { scene, first, second }
}

fn panic_message(payload: Box<dyn std::any::Any + Send>) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_string());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}

#[cfg(test)]
mod tests;
