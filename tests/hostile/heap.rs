//! How much memory a reader holds at its worst, and whether it ends.
//!
//! The allocator counts per thread: readers run on the thread that calls them, so that tests side by side do not disturb each other.
//! What was freed elsewhere is not seen; no reader hands memory to another thread.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::{LazyLock, Mutex};
use std::time::{Duration, Instant};

pub const MIB: usize = 1 << 20;

pub struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    let held = HELD.get() + bytes;
    HELD.set(held);
    PEAK.set(PEAK.get().max(held));
}

// SAFETY: every call is handed on to the system's allocator as it came; the counters are plain numbers that allocate nothing.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.realloc(at, layout, size) }
    }
}

/// Runs a reader on a file of this size and returns what it made; more than 64 MiB + 100 times the size is a fault.
pub fn bounded<T>(file_bytes: usize, read: impl FnOnce() -> T) -> T {
    bounded_by(64 * MIB, file_bytes, read)
}

/// The same for readers that may take more for a small file, because a compressed one may hold much.
pub fn bounded_by<T>(free_bytes: usize, file_bytes: usize, read: impl FnOnce() -> T) -> T {
    let limit = (free_bytes + 100 * file_bytes) as isize;
    let _watch = StageObserver::start();
    let before = HELD.get();
    PEAK.set(before);
    let made = read();
    let taken = PEAK.get() - before;
    assert!(taken <= limit, "a file of {file_bytes} bytes took {taken} bytes of memory, more than {limit}");
    made
}

/// Readers that run now, and since when.
static RUNNING: LazyLock<Mutex<BTreeMap<String, Instant>>> = LazyLock::new(|| {
    std::thread::spawn(watch);
    Mutex::default()
});

/// No reader needs seconds for a small file; one that takes minutes hangs, and would hang the whole run.
const HANGS: Duration = Duration::from_secs(300);

fn watch() {
    loop {
        std::thread::sleep(Duration::from_secs(1));
        let running = RUNNING.lock().unwrap_or_else(|held| held.into_inner());
        if let Some((test, _)) = running.iter().find(|(_, since)| since.elapsed() > HANGS) {
            eprintln!("{test}: a reader has not ended for {HANGS:?}: it hangs");
            std::process::abort();
        }
    }
}

struct StageObserver(String);

impl StageObserver {
    fn start() -> StageObserver {
        let test = std::thread::current().name().unwrap_or("a test").to_owned();
        RUNNING.lock().unwrap_or_else(|held| held.into_inner()).insert(test.clone(), Instant::now());
        StageObserver(test)
    }
}

impl Drop for StageObserver {
    fn drop(&mut self) {
        RUNNING.lock().unwrap_or_else(|held| held.into_inner()).remove(&self.0);
    }
}

#[test]
fn exact_what_is_held_at_the_worst_is_counted() {
    let taken = |bytes: usize| {
        std::panic::catch_unwind(|| bounded_by(0, 0, || drop(std::hint::black_box(Vec::<u8>::with_capacity(bytes)))))
    };
    assert!(taken(0).is_ok() && taken(1 << 30).is_err());
    bounded(0, || (0..1000).for_each(|_| drop(std::hint::black_box(vec![0u8; MIB]))));
    assert!(std::panic::catch_unwind(|| bounded(0, || std::hint::black_box(vec![vec![1u8; MIB]; 65]))).is_err());
}
