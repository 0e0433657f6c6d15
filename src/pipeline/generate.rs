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

use super::{Prepared, Scratch, StageTimes, run_scene};
use crate::corpus::SceneOutput;

/// What happens while a corpus is built, for progress and logs.
#[derive(Debug)]
pub enum Event<'a, T> {
    /// A scene's rows are there (or its failure).
    Scene { output: &'a SceneOutput, times: &'a StageTimes },
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
    /// A bug: stages return errors for what a config can cause.
    #[error("scene {scene} panicked: {message}; this is a bug of marsyard: please report it with the plan")]
    Panic { scene: u64, message: String },
    #[error("could not start {threads} threads: {reason}")]
    Threads { threads: usize, reason: String },
}

/// What threads may take, and how far the shards are written.
struct Queue {
    scenes: VecDeque<u64>,
    /// Shards whose scenes are all there.
    whole: VecDeque<(u64, Vec<SceneOutput>)>,
    taken: usize,
    /// Scenes of the shards that are written.
    written: usize,
    /// Scenes of all shards.
    all: usize,
}

/// What a thread does next.
enum Task {
    Scene(u64),
    Shard(u64, Vec<SceneOutput>),
}

/// What a thread has done.
enum Message<T, E> {
    Scene { scene: u64, output: Result<SceneOutput, String>, times: StageTimes },
    Shard { shard: u64, written: Result<T, E>, took: Duration },
}

/// Builds `shards` (ascending) and hands each over, whole, to `write`; several at a time, from any thread.
///
/// `on_event` is called on the caller's thread. When `stop` is raised, shards that are whole are still written.
pub fn generate<T: Send, E: std::error::Error + Send + 'static>(
    prepared: &Prepared,
    shards: &[u64],
    threads: usize,
    stop: &AtomicBool,
    mut on_event: impl FnMut(Event<T>),
    write: impl Fn(u64, Vec<SceneOutput>) -> Result<T, E> + Sync,
) -> Result<Outcome, BuildError<E>> {
    let per_shard = prepared.plan.scenes_per_shard as usize;
    let scenes: VecDeque<u64> = shards.iter().flat_map(|s| s * per_shard as u64..(s + 1) * per_shard as u64).collect();
    let order: Vec<u64> = scenes.iter().copied().collect();
    // A window of two scenes a thread beyond a whole shard keeps every thread busy while the slowest scene finishes.
    let window = per_shard + 2 * threads;
    let queue = Mutex::new(Queue { all: scenes.len(), scenes, whole: VecDeque::new(), taken: 0, written: 0 });
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
            if stop.load(Ordering::Relaxed) || queue.written == queue.all {
                return None;
            }
            if queue.taken < queue.written + window
                && let Some(scene) = queue.scenes.pop_front()
            {
                queue.taken += 1;
                return Some(Task::Scene(scene));
            }
            // Woken when a shard is whole or written; the timeout notices a stop signal.
            let tick = Duration::from_millis(50);
            queue = news.wait_timeout(queue, tick).expect("no thread panics while it holds the queue").0;
        }
    };
    let do_task = |task: Task, scratch: &mut Scratch| match task {
        Task::Scene(scene) => {
            let mut times = StageTimes::new();
            let result = catch_unwind(AssertUnwindSafe(|| run_scene(prepared, scene, scratch, &mut times)));
            Message::Scene { scene, output: result.map_err(panic_message), times }
        }
        Task::Shard(shard, outputs) => {
            let (started, scenes) = (Instant::now(), outputs.len());
            let written = write(shard, outputs);
            queue.lock().expect("no thread panics while it holds the queue").written += scenes;
            news.notify_all();
            Message::Shard { shard, written, took: started.elapsed() }
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
                    let panicked = matches!(message, Message::Scene { output: Err(_), .. });
                    if sender.send(message).is_err() || panicked {
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
                Message::Scene { scene, output: Err(message), .. } => {
                    return end_with(BuildError::Panic { scene, message });
                }
                Message::Scene { scene, output: Ok(output), times } => {
                    on_event(Event::Scene { output: &output, times: &times });
                    waiting.insert(scene, output);
                }
                Message::Shard { written: Err(error), .. } => return end_with(BuildError::Write(error)),
                Message::Shard { shard, written: Ok(written), took } => {
                    written_shards += 1;
                    on_event(Event::Shard { shard, written: &written, took });
                }
            }
            while let Some(output) = order.get(next).and_then(|scene| waiting.remove(scene)) {
                next += 1;
                shard_outputs.push(output);
                if shard_outputs.len() == per_shard {
                    let whole = (order[next - 1] / per_shard as u64, std::mem::take(&mut shard_outputs));
                    queue.lock().expect("no thread panics while it holds the queue").whole.push_back(whole);
                    news.notify_one();
                }
            }
        }
        Ok(if written_shards == shards.len() { Outcome::Done } else { Outcome::Interrupted })
    })
}

fn panic_message(payload: Box<dyn std::any::Any + Send>) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_string());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
