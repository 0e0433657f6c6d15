//! Data to stdout; a reader that has seen enough (`| head`) ends the program quietly.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

/// Writes to stdout.
pub(super) fn put(text: Arguments) {
    match std::io::stdout().lock().write_fmt(text) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
        Err(error) => {
            eprintln!("cannot write to stdout: {error}");
            std::process::exit(i32::from(super::Failure::TRY_AGAIN));
        }
    }
}

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

pub(super) use {out, outln};
