//! Shards -> scenes on all threads -> shards written in order.
//!
//! Threads take scenes across shard borders, so one shard may keep all of them busy. Outputs are put back in order and each
//! shard is handed over whole; nothing that is written depends on the number of threads. Memory is bounded by the scenes in
//! flight: a thread may run at most a window ahead of the shard that is being put together.

use std::collections::{BTreeMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::sync::{Condvar, Mutex};

use super::{Prepared, Scratch, StageTimes, run_scene};
use crate::corpus::SceneOutput;

/// What happens while a corpus is built, for progress and logs.
#[derive(Debug)]
pub enum Event<'a> {
    /// A scene's rows are there (or its failure).
    Scene { output: &'a SceneOutput, times: &'a StageTimes },
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

/// Scenes that may be taken, and how far the shards have been put together.
struct Queue {
    scenes: VecDeque<u64>,
    taken: usize,
    handed_over: usize,
}

/// Builds `shards` (ascending) and hands each over, whole and in order, to `write`.
pub fn generate<E: std::error::Error + Send + 'static>(
    prepared: &Prepared,
    shards: &[u64],
    threads: usize,
    stop: &AtomicBool,
    mut on_event: impl FnMut(Event),
    mut write: impl FnMut(u64, Vec<SceneOutput>) -> Result<(), E>,
) -> Result<Outcome, BuildError<E>> {
    let per_shard = u64::from(prepared.plan.scenes_per_shard);
    let scenes: VecDeque<u64> = shards.iter().flat_map(|s| s * per_shard..(s + 1) * per_shard).collect();
    let order: Vec<u64> = scenes.iter().copied().collect();
    // A window of two scenes a thread beyond a whole shard keeps every thread busy while the slowest scene finishes.
    let window = per_shard as usize + 2 * threads;
    let queue = Mutex::new(Queue { scenes, taken: 0, handed_over: 0 });
    let room = Condvar::new();
    let quit = AtomicBool::new(false);
    let halted = || stop.load(Ordering::Relaxed) || quit.load(Ordering::Relaxed);
    let (sender, receiver) = mpsc::channel();

    let next_scene = || -> Option<u64> {
        let mut queue = queue.lock().expect("no thread panics while it holds the queue");
        while !halted() && !queue.scenes.is_empty() && queue.taken >= queue.handed_over + window {
            // Woken when a shard is handed over; the timeout notices a stop signal.
            let tick = std::time::Duration::from_millis(50);
            queue = room.wait_timeout(queue, tick).expect("no thread panics while it holds the queue").0;
        }
        if halted() {
            return None;
        }
        queue.taken += 1;
        queue.scenes.pop_front()
    };

    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|k| format!("scene-{k}"))
        .build()
        .map_err(|e| BuildError::Threads { threads, reason: e.to_string() })?;
    pool.in_place_scope(|scope| {
        for _ in 0..threads {
            let sender = sender.clone();
            let next_scene = &next_scene;
            scope.spawn(move |_| {
                let mut scratch = Scratch::default();
                while let Some(scene) = next_scene() {
                    let mut times = StageTimes::new();
                    let result =
                        catch_unwind(AssertUnwindSafe(|| run_scene(prepared, scene, &mut scratch, &mut times)));
                    let panicked = result.is_err();
                    let message = (scene, result.map_err(panic_message), times);
                    if sender.send(message).is_err() || panicked {
                        break;
                    }
                }
            });
        }
        drop(sender);

        let mut waiting: BTreeMap<u64, SceneOutput> = BTreeMap::new();
        let mut shard_outputs: Vec<SceneOutput> = Vec::new();
        let mut next = 0;
        for (scene, result, times) in receiver {
            let output = match result {
                Ok(output) => output,
                Err(message) => {
                    quit.store(true, Ordering::Relaxed);
                    return Err(BuildError::Panic { scene, message });
                }
            };
            on_event(Event::Scene { output: &output, times: &times });
            waiting.insert(scene, output);
            while let Some(output) = order.get(next).and_then(|scene| waiting.remove(scene)) {
                next += 1;
                shard_outputs.push(output);
                if shard_outputs.len() as u64 == per_shard {
                    let shard = order[next - 1] / per_shard;
                    if let Err(error) = write(shard, std::mem::take(&mut shard_outputs)) {
                        quit.store(true, Ordering::Relaxed);
                        return Err(BuildError::Write(error));
                    }
                    queue.lock().expect("no thread panics while it holds the queue").handed_over = next;
                    room.notify_all();
                }
            }
        }
        Ok(if next == order.len() { Outcome::Done } else { Outcome::Interrupted })
    })
}

fn panic_message(payload: Box<dyn std::any::Any + Send>) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_string());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
