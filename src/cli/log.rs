//! Talk to stderr: text for people, JSON lines for machines.

use super::{Failure, LogFormat};

/// Sets the log up for the whole process.
pub(super) fn start(format: LogFormat) {
    let builder = tracing_subscriber::fmt().with_writer(std::io::stderr).with_target(false);
    match format {
        LogFormat::Json => builder.json().flatten_event(true).init(),
        LogFormat::Text => {
            let ansi = std::io::IsTerminal::is_terminal(&std::io::stderr());
            builder.without_time().with_level(false).with_ansi(ansi).init();
        }
    }
}

/// Says why a verb failed.
pub(super) fn failure(format: LogFormat, failure: &Failure) {
    match format {
        LogFormat::Json => tracing::error!(exit_code = failure.code, "{:?}", failure.report.to_string()),
        LogFormat::Text => eprintln!("{:?}", failure.report),
    }
}
