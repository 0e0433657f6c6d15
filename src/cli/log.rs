//! Talk to stderr: text for people, JSON lines for machines.

use super::output::errln;
use super::{Failure, LogFormat};

/// Sets the log up for the whole process.
pub(super) fn start(format: LogFormat) {
    // A writer whose reader has gone must not panic on telling so.
    let builder = tracing_subscriber::fmt().with_writer(std::io::stderr).with_target(false).log_internal_errors(false);
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
        LogFormat::Json => {
            // One event for the whole, one for each fault of a config, each with its cure.
            let help = failure.report.help().map(|help| help.to_string()).unwrap_or_default();
            tracing::error!(exit_code = failure.code, help, "{}", failure.report);
            for fault in failure.report.related().into_iter().flatten() {
                let help = fault.help().map(|help| help.to_string()).unwrap_or_default();
                tracing::error!(exit_code = failure.code, help, "{fault}");
            }
        }
        LogFormat::Text => errln!("{:?}", failure.report),
    }
}
