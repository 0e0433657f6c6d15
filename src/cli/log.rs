//! Talk to stderr: text for people, JSON lines for machines.

use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use std::fmt::Arguments;
use std::sync::atomic::{AtomicBool, Ordering};

use super::output::errln;
use super::place::StoreFault;
use super::{Failure, LogFormat};
use crate::config::ConfigError;

/// Whether what is told goes out as JSON, a line each.
static IS_JSON: AtomicBool = AtomicBool::new(false);

/// Sets the log up for the whole process.
pub(super) fn start(format: LogFormat) {
    // A writer whose reader has gone must not panic on telling so.
    let layer =
        tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_target(false).log_internal_errors(false);
    // What libraries log (an HTTP client its requests, say) is neither asked for nor known to be free of secrets.
    let ours = Targets::new().with_target("marsyard", LevelFilter::INFO);
    IS_JSON.store(format == LogFormat::Json, Ordering::Relaxed);
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

/// Writes a line as JSON where machines listen, and says whether it did.
pub(super) fn takes(text: Arguments) -> bool {
    let is_json = IS_JSON.load(Ordering::Relaxed);
    if is_json {
        let text = text.to_string();
        match text.trim().strip_prefix("warning: ") {
            Some(warning) => tracing::warn!("{warning}"),
            None => tracing::info!("{}", text.trim()),
        }
    }
    is_json
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
            for fault in failure.report.downcast_ref::<ConfigError>().into_iter().flat_map(|error| &error.faults) {
                tracing::error!(
                    exit_code = failure.code,
                    file = fault.file(),
                    line = fault.line,
                    column = fault.column,
                    help = fault.cure.as_deref().unwrap_or_default(),
                    "{}",
                    fault.rule
                );
            }
        }
        LogFormat::Text => errln!("{:?}", failure.report),
    }
}
