//! Talk to stderr: text for people, JSON lines for machines.

use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use super::output::errln;
use super::place::StoreFault;
use super::{Failure, LogFormat};

/// Sets the log up for the whole process.
pub(super) fn start(format: LogFormat) {
    // A writer whose reader has gone must not panic on telling so.
    let layer =
        tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_target(false).log_internal_errors(false);
    // What libraries log (an HTTP client its requests, say) is neither asked for nor known to be free of secrets.
    let ours = Targets::new().with_target("marsyard", LevelFilter::INFO);
    match format {
        LogFormat::Json => {
            let layer = layer.json().flatten_event(true).with_filter(ours);
            tracing_subscriber::registry().with(layer).init();
        }
        LogFormat::Text => {
            let ansi = std::io::IsTerminal::is_terminal(&std::io::stderr());
            let layer = layer.without_time().with_level(false).with_ansi(ansi).with_filter(ours);
            tracing_subscriber::registry().with(layer).init();
        }
    }
}

/// Says why a verb failed.
pub(super) fn failure(format: LogFormat, failure: &Failure) {
    match format {
        LogFormat::Json => {
            // One event for the whole, one for each fault of a config, each with its cure.
            let help = failure.report.help().map(|help| help.to_string()).unwrap_or_default();
            match failure.report.downcast_ref::<StoreFault>() {
                Some(StoreFault { kind, place, .. }) => {
                    tracing::error!(
                        event = "store_fault",
                        kind,
                        place,
                        exit_code = failure.code,
                        help,
                        "{}",
                        failure.report
                    );
                }
                None => tracing::error!(exit_code = failure.code, help, "{}", failure.report),
            }
            for fault in failure.report.related().into_iter().flatten() {
                let help = fault.help().map(|help| help.to_string()).unwrap_or_default();
                tracing::error!(exit_code = failure.code, help, "{fault}");
            }
        }
        LogFormat::Text => errln!("{:?}", failure.report),
    }
}
