//! A schedule of tasks -> their outputs, on a pool of threads.
//!
//! The calling thread keeps the schedule: it hands out tasks and takes outputs one at a time, so a schedule needs no lock and may talk to
//! whoever waits. Outputs come in the order in which tasks end; what must be in another order is the schedule's to put in order, so that
//! nothing that is made depends on the number of threads. A few tasks more than threads are out at a time: a thread that has ended one
//! finds the next without waiting for the caller.
//!
//! `for_each` and `map` are schedules of a list of items; `on_every_thread` does one thing on all threads at once; `ReadAhead` is
//! a sequence that another thread makes before it is asked for.

mod read_ahead;

use std::marker::PhantomData;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, TryLockError, mpsc};

pub(crate) use read_ahead::ReadAhead;

/// What is to be done, and what becomes of it.
pub trait Schedule {
    type Task: Send;
    type Output: Send;

    /// A task that may begin now; asked again after each output. It is over when there is none while no task is out.
    fn next(&mut self) -> Option<Self::Task>;

    /// Takes what came of a task; [`Break`](ControlFlow::Break): no further task is begun, and outputs still to come are dropped.
    fn take(&mut self, output: Self::Output) -> ControlFlow<()>;
}

/// Threads that the system does not give.
#[derive(Debug, thiserror::Error)]
#[error("could not start {threads} threads: {reason}; fewer --threads take less")]
pub struct PoolError {
    pub threads: usize,
    pub reason: String,
}

/// Tasks that are out at a time: one a thread, and some that wait for the first thread that is free.
pub(crate) fn most_out(threads: usize) -> usize {
    threads + 1 + threads / 4
}

/// Works a schedule off on `threads` threads; each has its own scratch. A task that panics panics here.
pub(crate) fn run<S: Schedule, M: Default + Send>(
    threads: usize,
    schedule: &mut S,
    work: impl Fn(S::Task, &mut M) -> S::Output + Sync,
) -> Result<(), PoolError> {
    let threads = threads.max(1);
    let pool = pool(threads)?;
    let scratch: Vec<Mutex<M>> = (0..threads).map(|_| Mutex::default()).collect();
    let (sender, outputs) = mpsc::channel();
    let one_task = |task: S::Task| {
        let own = &scratch[rayon::current_thread_index().expect("a thread of the pool")];
        // A thread alone holds its scratch, and a panic ends the whole. A task that waited for rayon's threads might be given another one
        // meanwhile, which would wait for this scratch for ever.
        let mut own = match own.try_lock() {
            Ok(own) => own,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => panic!("a task of a schedule must not wait for rayon's threads"),
        };
        work(task, &mut own)
    };
    let one_task = &one_task;
    let most_out = most_out(threads);
    pool.in_place_scope(|scope| {
        let mut out = 0;
        let mut is_open = true;
        loop {
            while is_open
                && out < most_out
                && let Some(task) = schedule.next()
            {
                let sender = sender.clone();
                out += 1;
                scope.spawn(move |_| {
                    // The receiver is gone only where a panic is on its way up.
                    _ = sender.send(catch_unwind(AssertUnwindSafe(|| one_task(task))));
                });
            }
            if out == 0 {
                return;
            }
            let output = outputs.recv().expect("this thread holds a sender");
            out -= 1;
            let output = output.unwrap_or_else(|panic| resume_unwind(panic));
            is_open = is_open && schedule.take(output).is_continue();
        }
    });
    Ok(())
}

fn pool(threads: usize) -> Result<rayon::ThreadPool, PoolError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("worker-{k}")).build();
    pool.map_err(|error| PoolError { threads, reason: error.to_string() })
}

/// What `work` returns on each of `threads` threads that all do it at once: how long it takes while the others take caches, memory and
/// hyper-threads. A thread that panics panics here.
pub(crate) fn on_every_thread<T: Send>(threads: usize, work: impl Fn() -> T + Sync) -> Result<Vec<T>, PoolError> {
    Ok(pool(threads.max(1))?.broadcast(|_| work()))
}

/// Works items off; `take` gets what `work` makes of each, on the caller's thread, in the order in which they end. False where `stop` was
/// raised before the last was begun; the first error of either ends the whole.
pub(crate) fn for_each<T: Send, U: Send, M: Default + Send, E: Send + From<PoolError>>(
    threads: usize,
    items: Vec<T>,
    stop: &AtomicBool,
    work: impl Fn(T, &mut M) -> Result<U, E> + Sync,
    take: impl FnMut(U) -> Result<(), E>,
) -> Result<bool, E> {
    let threads = threads.min(items.len());
    let mut items = Items { waiting: items.into_iter(), stop, take, failed: None, output: PhantomData };
    run(threads, &mut items, work)?;
    match items.failed {
        Some(error) => Err(error),
        None => Ok(items.waiting.len() == 0),
    }
}

/// Items -> what `work` makes of each, in their order. `tell` hears, on the caller's thread, how many are done. `None` where `stop` was
/// raised before the last was begun; the first error ends the whole.
///
/// ```
/// use std::sync::atomic::AtomicBool;
///
/// use marsyard::parallel::{self, PoolError};
///
/// let stop = AtomicBool::new(false);
/// let items: Vec<u64> = (0..100).collect();
/// let squares = parallel::map(4, items, &stop, |item, _: &mut ()| Ok::<u64, PoolError>(item * item), |_| ())?;
/// // In the items' order, whichever thread was first: the sum of squares is n (n + 1) (2 n + 1) / 6.
/// let squares = squares.expect("nobody raised the stop");
/// assert!(squares.is_sorted());
/// assert_eq!(squares.iter().sum::<u64>(), 99 * 100 * 199 / 6);
/// # Ok::<(), PoolError>(())
/// ```
pub fn map<T: Send, U: Send, M: Default + Send, E: Send + From<PoolError>>(
    threads: usize,
    items: Vec<T>,
    stop: &AtomicBool,
    work: impl Fn(T, &mut M) -> Result<U, E> + Sync,
    mut tell: impl FnMut(usize),
) -> Result<Option<Vec<U>>, E> {
    let mut outputs: Vec<Option<U>> = items.iter().map(|_| None).collect();
    let mut done = 0;
    let numbered = items.into_iter().enumerate().collect();
    let work = |(k, item), scratch: &mut M| Ok::<_, E>((k, work(item, scratch)?));
    for_each(threads, numbered, stop, work, |(k, output): (usize, U)| {
        outputs[k] = Some(output);
        done += 1;
        tell(done);
        Ok(())
    })?;
    Ok(outputs.into_iter().collect())
}

/// The schedule of [`for_each`].
struct Items<'a, T, U, E, F> {
    waiting: std::vec::IntoIter<T>,
    stop: &'a AtomicBool,
    take: F,
    failed: Option<E>,
    output: PhantomData<U>,
}

impl<T: Send, U: Send, E: Send, F: FnMut(U) -> Result<(), E>> Schedule for Items<'_, T, U, E, F> {
    type Task = T;
    type Output = Result<U, E>;

    fn next(&mut self) -> Option<T> {
        if self.stop.load(Ordering::Relaxed) { None } else { self.waiting.next() }
    }

    fn take(&mut self, output: Result<U, E>) -> ControlFlow<()> {
        self.failed = output.and_then(&mut self.take).err();
        if self.failed.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// What a panic said.
pub(crate) fn panic_message(payload: Box<dyn std::any::Any + Send>) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_string());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}

#[cfg(test)]
mod tests;
