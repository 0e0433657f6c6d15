//! Shards -> scenes on all threads -> rows of shards in the making -> shards, each handed over whole.
//!
//! Threads take scenes across shard borders, so one shard may keep all of them busy. Outputs are put back in order within their shard, and
//! the thread that is free next appends their rows before another scene is begun (`open_shards`); a shard with all its rows is put in its
//! place by the thread that is free next. What a shard holds depends on no number of threads; which of two shards is put first may.
//! Memory is bounded: one scene a thread in the making, some that wait in each open shard, and the bytes of the open shards: few, unless
//! scenes wait for their rows, and at most three for two threads; and of as many shards more as tasks are out, while those are put in place.

mod open_shards;
mod scenes;

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use self::open_shards::{OpenShards, ReadyScenes};
pub(super) use self::scenes::sample_scene;
use self::scenes::{Scenes, make_scene};
use crate::corpus::{CorpusError, CorpusSpec, FinishedShard, ShardWriter};
use crate::episode::{Prepared, SceneOutput, Scratch, StageRecord};
use crate::parallel::{self, PoolError, Schedule, panic_message};

/// What happens while a corpus is built, for progress and logs.
#[derive(Debug)]
pub(crate) enum Event<'a, T> {
    /// A scene's rows are there (or its failure).
    Scene { output: &'a SceneOutput, record: &'a StageRecord },
    /// A shard was handed over: what came of it, and how long threads worked on it beside its scenes.
    Shard { shard: u64, written: &'a T, took: Duration },
}

/// How a build ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
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
    #[error(transparent)]
    Threads(#[from] PoolError),
}

/// What is built, and by how many.
#[derive(Clone, Copy)]
pub(crate) struct Job<'a> {
    /// Ascending.
    pub shards: &'a [u64],
    pub threads: usize,
    /// When it is raised, shards that are whole are still written.
    pub stop: &'a AtomicBool,
    /// Record the hashes of each stage's f64 results.
    pub hashes: bool,
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
struct CorpusSink<'a, P> {
    spec: &'a CorpusSpec,
    put: P,
}

impl<'a, T: Send, P: Fn(FinishedShard) -> Result<T, CorpusError> + Sync> Sink for CorpusSink<'a, P> {
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

/// What a thread does next.
enum Task<W> {
    Scene(u64),
    Append(ReadyScenes<W>),
    /// All scenes are appended; what was spent on the shard until then.
    Close {
        shard: u64,
        writer: W,
        took: Duration,
    },
}

/// What a thread has done.
enum Message<W, T, E: std::error::Error + 'static> {
    Scene(Box<SceneOutput>, StageRecord),
    Appended { shard: u64, writer: W, scenes: usize, took: Duration },
    Shard { shard: u64, written: T, took: Duration },
    Failed(BuildError<E>),
}

/// Of the threads that write into a sink.
type SinkMessage<S> = Message<<S as Sink>::Open, <S as Sink>::Written, <S as Sink>::Error>;

/// What is left to do, and who is told of what is done.
struct Shards<'a, S: Sink, F> {
    open: OpenShards<'a, S::Open>,
    /// Shards that only need to be put in their place.
    whole: Vec<Task<S::Open>>,
    stop: &'a AtomicBool,
    on_event: F,
    written: usize,
    failed: Option<BuildError<S::Error>>,
}

impl<S: Sink, F: FnMut(Event<S::Written>)> Schedule for Shards<'_, S, F> {
    type Task = Task<S::Open>;
    type Output = SinkMessage<S>;

    fn next(&mut self) -> Option<Task<S::Open>> {
        let to_write = self.whole.pop().or_else(|| self.open.next_append().map(Task::Append));
        to_write.or_else(|| {
            let is_stopped = self.stop.load(Ordering::Relaxed);
            if is_stopped { None } else { self.open.next_scene().map(Task::Scene) }
        })
    }

    fn take(&mut self, message: Self::Output) -> ControlFlow<()> {
        match message {
            Message::Scene(output, record) => {
                (self.on_event)(Event::Scene { output: &output, record: &record });
                self.open.add(*output);
            }
            Message::Appended { shard, writer, scenes, took } => {
                let whole = self.open.appended(shard, writer, scenes, took);
                self.whole.extend(whole.map(|(writer, took)| Task::Close { shard, writer, took }));
            }
            Message::Shard { shard, written, took } => {
                self.written += 1;
                (self.on_event)(Event::Shard { shard, written: &written, took });
            }
            Message::Failed(error) => {
                self.failed = Some(error);
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }
}

/// Builds the job's shards and hands each over, whole, to `put`; several at a time, from any thread.
///
/// `on_event` is called on the caller's thread.
pub(crate) fn build_shards<T: Send>(
    prepared: &Prepared,
    spec: &CorpusSpec,
    job: Job,
    on_event: impl FnMut(Event<T>),
    put: impl Fn(FinishedShard) -> Result<T, CorpusError> + Sync,
) -> Result<Outcome, BuildError<CorpusError>> {
    build(prepared, &CorpusSink { spec, put }, job, on_event)
}

fn build<S: Sink>(
    scenes: &impl Scenes,
    sink: &S,
    job: Job,
    on_event: impl FnMut(Event<S::Written>),
) -> Result<Outcome, BuildError<S::Error>> {
    let Job { shards, threads, stop, hashes } = job;
    let open = OpenShards::new(shards, scenes.per_shard(), threads);
    let mut schedule = Shards::<S, _> { open, whole: Vec::new(), stop, on_event, written: 0, failed: None };
    parallel::run(threads, &mut schedule, |task, scratch: &mut Scratch| match task {
        Task::Scene(scene) => match make_scene(scenes, scene, hashes, scratch) {
            Ok((output, record)) => Message::Scene(Box::new(output), record),
            Err(error) => Message::Failed(error),
        },
        Task::Append(ReadyScenes { shard, writer, scenes }) => guarded(shard, || append(sink, shard, writer, scenes)),
        Task::Close { shard, writer, took } => guarded(shard, || {
            let started = Instant::now();
            let written = sink.close(writer)?;
            Ok(Message::Shard { shard, written, took: took + started.elapsed() })
        }),
    })?;
    match schedule.failed {
        Some(error) => Err(error),
        None if schedule.written == shards.len() => Ok(Outcome::Done),
        None => Ok(Outcome::Interrupted),
    }
}

/// Appends scenes, in order, to a shard that is opened for the first of them.
fn append<S: Sink>(
    sink: &S,
    shard: u64,
    writer: Option<S::Open>,
    scenes: Vec<SceneOutput>,
) -> Result<SinkMessage<S>, S::Error> {
    let started = Instant::now();
    let mut writer = writer.map_or_else(|| sink.open(shard), Ok)?;
    let count = scenes.len();
    scenes.into_iter().try_for_each(|scene| sink.push(&mut writer, scene))?;
    Ok(Message::Appended { shard, writer, scenes: count, took: started.elapsed() })
}

/// Work on a shard; one that fails or panics ends the build.
fn guarded<W, T, E>(shard: u64, work: impl FnOnce() -> Result<Message<W, T, E>, E>) -> Message<W, T, E>
where
    E: std::error::Error + 'static,
{
    match catch_unwind(AssertUnwindSafe(work)) {
        Err(panic) => Message::Failed(BuildError::Panic { shard, message: panic_message(panic) }),
        Ok(done) => done.unwrap_or_else(|error| Message::Failed(BuildError::Write(error))),
    }
}

#[cfg(test)]
mod tests;
