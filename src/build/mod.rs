//! Shards -> scenes on all threads -> rows of shards in the making -> shards, each handed over whole.
//!
//! Threads take scenes across shard borders, so one shard may keep all of them busy. Outputs are put back in order, and the
//! thread that is free next lays their rows into their shard before it takes another scene: a shard's work is spread over the
//! time of its scenes, and a thread that puts one in its place holds nobody up. What a shard holds depends on no number of threads;
//! which of two shards is put first may. Memory is bounded by the scenes in flight, for a thread may run at most a window
//! ahead of the scenes whose rows are appended, and by the bytes of two shards in the making and of one a thread that is put in its place.

mod open_shards;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::sync::{Condvar, Mutex};
use std::time::{Duration, Instant};

use self::open_shards::{OpenShards, ReadyScenes};
use crate::corpus::{CorpusError, CorpusSpec, FinishedShard, ShardWriter};
use crate::episode::SceneOutput;
use crate::episode::{Prepared, Scratch, StageHashes, StageRecord, run_scene};
use crate::random::Drawn;

/// What happens while a corpus is built, for progress and logs.
#[derive(Debug)]
pub enum Event<'a, T> {
    /// A scene's rows are there (or its failure).
    Scene { output: &'a SceneOutput, record: &'a StageRecord },
    /// A shard was handed over: what came of it, and how long threads worked on it beside its scenes.
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
    /// StageRecord the hashes of each stage's f64 results.
    pub hashes: bool,
}

/// Where scenes come from: a plan, or a test.
trait Scenes: Sync {
    fn per_shard(&self) -> usize;
    fn make(&self, scene: u64, scratch: &mut Scratch, record: &mut StageRecord) -> SceneOutput;
    fn family(&self, scene: u64) -> &str;
}

impl Scenes for Prepared {
    fn per_shard(&self) -> usize {
        self.plan.scenes_per_shard as usize
    }

    fn make(&self, scene: u64, scratch: &mut Scratch, record: &mut StageRecord) -> SceneOutput {
        run_scene(self, scene, scratch, record)
    }

    fn family(&self, scene: u64) -> &str {
        &self.plan.family_of(scene).name
    }
}

/// Where the rows of scenes go: the shards of a corpus, or a test.
trait Sink: Sync {
    /// A shard in the making.
    type Open: Send;
    /// What came of it.
    type Written: Send;
    type Error: std::error::Error + Send + 'static;

    fn open(&self, shard: u64) -> Result<Self::Open, Self::Error>;
    /// Takes a shard's scenes in order.
    fn push(&self, open: &mut Self::Open, scene: SceneOutput) -> Result<(), Self::Error>;
    /// After the last of its scenes.
    fn close(&self, open: Self::Open) -> Result<Self::Written, Self::Error>;
}

/// Shards of a corpus, and what is done with those that are whole.
struct Shards<'a, P> {
    spec: &'a CorpusSpec,
    put: P,
}

impl<'a, T: Send, P: Fn(FinishedShard) -> Result<T, CorpusError> + Sync> Sink for Shards<'a, P> {
    type Open = ShardWriter<'a>;
    type Written = T;
    type Error = CorpusError;

    fn open(&self, shard: u64) -> Result<ShardWriter<'a>, CorpusError> {
        ShardWriter::new(self.spec, shard)
    }

    fn push(&self, open: &mut ShardWriter<'a>, scene: SceneOutput) -> Result<(), CorpusError> {
        open.push(&scene)
    }

    fn close(&self, open: ShardWriter<'a>) -> Result<T, CorpusError> {
        (self.put)(open.finish()?)
    }
}

/// What threads may take, and how far the rows are appended.
struct Queue<W> {
    shards: OpenShards<W>,
    taken: usize,
    /// Scenes that have come back and stand in order, or wait for those before them.
    back: usize,
    /// Scenes whose rows are appended.
    appended: usize,
}

/// What a thread does next.
enum Task<W> {
    Scene(u64),
    Append(ReadyScenes<W>),
}

/// What a thread has done.
enum Message<T, E> {
    Scene(Box<SceneOutput>, StageRecord),
    Unsteady { scene: u64, first: String, second: String },
    Shard { shard: u64, written: T, took: Duration },
    Refused(E),
    Panic { shard: u64, message: String },
}

impl<T, E> Message<T, E> {
    /// The thread that says it takes no further task.
    fn is_last(&self) -> bool {
        matches!(self, Message::Unsteady { .. } | Message::Panic { .. } | Message::Refused(_))
    }
}

/// Builds the job's shards and hands each over, whole, to `put`; several at a time, from any thread.
///
/// `on_event` is called on the caller's thread.
pub fn generate<T: Send>(
    prepared: &Prepared,
    spec: &CorpusSpec,
    job: Job,
    on_event: impl FnMut(Event<T>),
    put: impl Fn(FinishedShard) -> Result<T, CorpusError> + Sync,
) -> Result<Outcome, BuildError<CorpusError>> {
    build(prepared, &Shards { spec, put }, job, on_event)
}

fn build<S: Sink>(
    scenes: &impl Scenes,
    sink: &S,
    job: Job,
    mut on_event: impl FnMut(Event<S::Written>),
) -> Result<Outcome, BuildError<S::Error>> {
    let Job { shards, threads, stop, hashes } = job;
    let per_shard = scenes.per_shard();
    let all = shards.len() * per_shard;
    let scene_at = |k: usize| shards[k / per_shard] * per_shard as u64 + (k % per_shard) as u64;
    // A window of two scenes a thread beyond a whole shard keeps every thread busy while the slowest scene finishes.
    let window = per_shard + 2 * threads;
    let queue = Mutex::new(Queue { shards: OpenShards::new(), taken: 0, back: 0, appended: 0 });
    let queue = || queue.lock().expect("no thread panics while it holds the queue");
    let changed = Condvar::new();
    let quit = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();

    let next_task = || -> Option<Task<S::Open>> {
        let mut queue = queue();
        loop {
            if quit.load(Ordering::Relaxed) {
                return None;
            }
            if let Some(rows) = queue.shards.take() {
                return Some(Task::Append(rows));
            }
            let stopped = stop.load(Ordering::Relaxed);
            if queue.appended == all || stopped && queue.back == queue.taken {
                return None;
            }
            if !stopped && queue.taken < all && queue.taken < queue.appended + window {
                queue.taken += 1;
                return Some(Task::Scene(scene_at(queue.taken - 1)));
            }
            // Woken when rows may be appended or were appended; the timeout notices a stop signal.
            let tick = Duration::from_millis(50);
            queue = changed.wait_timeout(queue, tick).expect("no thread panics while it holds the queue").0;
        }
    };
    // Whoever lays the last rows of a shard closes it.
    let append =
        |ReadyScenes { shard, open, scenes }: ReadyScenes<S::Open>| -> Result<Option<Message<_, _>>, S::Error> {
            let started = Instant::now();
            let mut open = open.map_or_else(|| sink.open(shard), Ok)?;
            let count = scenes.len();
            scenes.into_iter().try_for_each(|scene| sink.push(&mut open, scene))?;
            let whole = {
                let mut queue = queue();
                queue.appended += count;
                changed.notify_all();
                queue.shards.appended((shard, open), count, started.elapsed(), per_shard)
            };
            let Some((open, took)) = whole else { return Ok(None) };
            let started = Instant::now();
            sink.close(open).map(|written| Some(Message::Shard { shard, written, took: took + started.elapsed() }))
        };
    let do_task = |task, scratch: &mut Scratch| match task {
        Task::Scene(scene) => Some(make_scene(scenes, scene, hashes, scratch)),
        Task::Append(rows) => {
            let shard = rows.shard;
            match catch_unwind(AssertUnwindSafe(|| append(rows))) {
                Err(panic) => Some(Message::Panic { shard, message: panic_message(panic) }),
                Ok(appended) => appended.unwrap_or_else(|error| Some(Message::Refused(error))),
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
                    let Some(message) = do_task(task, &mut scratch) else { continue };
                    let last = message.is_last();
                    if sender.send(message).is_err() || last {
                        break;
                    }
                }
            });
        }
        drop(sender);

        let mut waiting: BTreeMap<u64, SceneOutput> = BTreeMap::new();
        let (mut next, mut written_shards) = (0, 0);
        let end_with = |error| {
            quit.store(true, Ordering::Relaxed);
            changed.notify_all();
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
                    let mut queue = queue();
                    while next < all
                        && let Some(output) = waiting.remove(&scene_at(next))
                    {
                        queue.shards.add(shards[next / per_shard], output);
                        next += 1;
                    }
                    queue.back += 1;
                    changed.notify_all();
                }
                Message::Refused(error) => return end_with(BuildError::Write(error)),
                Message::Shard { shard, written, took } => {
                    written_shards += 1;
                    on_event(Event::Shard { shard, written: &written, took });
                }
            }
        }
        Ok(if written_shards == shards.len() { Outcome::Done } else { Outcome::Interrupted })
    })
}

/// One scene; one that panics twice with the same words has failed.
fn make_scene<T, E>(scenes: &impl Scenes, scene: u64, hashes: bool, scratch: &mut Scratch) -> Message<T, E> {
    let once = |scratch: &mut Scratch| {
        let mut record = StageRecord { hashes: hashes.then(StageHashes::new), ..StageRecord::default() };
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
            return Message::Scene(Box::new(output), StageRecord::default());
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
