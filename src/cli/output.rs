//! Data to stdout, talk to stderr. A reader of stdout that has seen enough (`| head`) ends the program quietly; one of
//! stderr ends the talk, not the work.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

/// `print!`, without the panic when nobody reads on.
macro_rules! out {
    ($($part:tt)*) => { $crate::cli::output::put(format_args!($($part)*)) };
}

/// `println!`, without the panic when nobody reads on.
macro_rules! outln {
    ($($part:tt)*) => {{
        $crate::cli::output::put(format_args!($($part)*));
        $crate::cli::output::put(format_args!("\n"));
    }};
}

/// `eprintln!`, without the panic when nobody reads on.
macro_rules! errln {
    ($($part:tt)*) => { $crate::cli::output::tell(format_args!($($part)*)) };
}

/// Writes to stdout.
pub(super) fn put(text: Arguments) {
    match std::io::stdout().lock().write_fmt(text) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
        Err(error) => {
            errln!("cannot write to stdout: {error}");
            std::process::exit(i32::from(super::Failure::TRY_AGAIN));
        }
    }
}

/// Writes a line to stderr, as JSON with `--log json`; where nobody listens there is nobody to tell.
pub(super) fn tell(text: Arguments) {
    if super::log::takes(text) {
        return;
    }
    let _ = std::io::stderr().lock().write_fmt(format_args!("{text}\n"));
}

/// Words of a file that anybody may have written, without the control characters by which a terminal would obey them.
pub(super) fn printable(text: &str) -> String {
    text.chars().map(|letter| if letter.is_control() { '\u{fffd}' } else { letter }).collect()
}

pub(super) use {errln, out, outln};
