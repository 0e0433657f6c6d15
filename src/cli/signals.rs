//! Signals -> flags: what asks a verb to stop, and what must not end it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;

use super::Failure;

/// SIGINT and SIGTERM ask the verb to stop; a second one ends the process at once.
pub(super) fn stop_on_signals() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // Order matters: the first signal finds the flag down and raises it, the second finds it up.
        flag::register_conditional_shutdown(signal, i32::from(Failure::TRY_AGAIN), Arc::clone(&stop))
            .and_then(|_| flag::register(signal, Arc::clone(&stop)))
            .map_err(|e| Failure::failed(format!("cannot listen for signal {signal}: {e}")))?;
    }
    Ok(stop)
}

/// A file that grows past `ulimit -f` is an error like a full disk, not the process's death.
pub(super) fn survive_file_size_limits() -> Result<(), Failure> {
    flag::register(SIGXFSZ, Arc::default())
        .map(drop)
        .map_err(|e| Failure::failed(format!("cannot listen for signal {SIGXFSZ}: {e}")))
}
