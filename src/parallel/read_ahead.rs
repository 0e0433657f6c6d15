//! A sequence -> the same sequence, made on a thread of its own before it is asked for.
//!
//! The other half of this module serves outputs in the order in which they end, to a schedule that is called back. Here one thread makes
//! items in their order, for a caller that asks for one at a time and does its own work in between: what is read from disk while the last
//! of it is learnt. Up to `ahead` items wait, and one more is in the making, which bounds the memory.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

/// Items until the sequence ends. Dropping it ends the thread at its next item.
pub(crate) struct ReadAhead<T> {
    items: Option<Receiver<T>>,
    thread: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> ReadAhead<T> {
    /// Begins to make items.
    pub(crate) fn start(ahead: usize, items: impl Iterator<Item = T> + Send + 'static) -> ReadAhead<T> {
        let (sender, receiver) = sync_channel(ahead);
        // An item that cannot be sent: nobody takes them any more.
        let thread = std::thread::spawn(move || _ = items.map(|item| sender.send(item)).find(Result::is_err));
        ReadAhead { items: Some(receiver), thread: Some(thread) }
    }
}

impl<T> Iterator for ReadAhead<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        let item = self.items.as_ref()?.recv().ok();
        if item.is_none() {
            self.join();
        }
        item
    }
}

impl<T> ReadAhead<T> {
    /// A panic of the thread goes on here, unless this thread is panicking already.
    fn join(&mut self) {
        self.items = None;
        if let Some(thread) = self.thread.take()
            && let Err(panic) = thread.join()
            && !std::thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}

impl<T> Drop for ReadAhead<T> {
    fn drop(&mut self) {
        self.join();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn exact_the_sequence_comes_whole_and_in_order_however_far_ahead() {
        for ahead in [0, 1, 7, 1000] {
            assert_eq!(ReadAhead::start(ahead, 0..100).collect::<Vec<_>>(), (0..100).collect::<Vec<_>>());
        }
    }

    #[test]
    fn law_no_more_is_made_than_may_wait_and_nothing_for_nobody() {
        let made = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&made);
        let mut items = ReadAhead::start(3, (0..1000).inspect(move |_| _ = counted.fetch_add(1, Ordering::Relaxed)));
        assert_eq!((items.next(), items.next()), (Some(0), Some(1)));
        drop(items);
        // Two taken, three that wait, one in the making.
        assert!((2..=6).contains(&made.load(Ordering::Relaxed)), "{made:?}");
    }

    #[test]
    #[should_panic(expected = "item 5")]
    fn law_a_panic_while_an_item_is_made_reaches_the_caller() {
        ReadAhead::start(1, (0..10).inspect(|k| assert_ne!(*k, 5, "item {k}"))).for_each(drop);
    }
}
