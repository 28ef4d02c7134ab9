//! Where the log goes: to the journal with its fields when stderr is the journal, else to stderr as
//! text; and how much of it (see `rate`).

mod rate;

use std::io::IsTerminal;
use std::os::fd::AsRawFd;

use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt;
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

pub use rate::{tell_all_withheld, tell_withheld};

/// Environment variable with a filter such as `debug` or `admittanced=trace`.
pub const FILTER_VARIABLE: &str = "ADMITTANCE_LOG";

/// Starts logging for this process. The level is `info` unless the variable `ADMITTANCE_LOG` says
/// otherwise. Of lines of one kind most are withheld when there are many: call [`tell_withheld`]
/// now and then, and [`tell_all_withheld`] at the end.
///
/// # Errors
/// A sentence, when the filter is malformed, the journal cannot be reached, or logging was started
/// before.
pub fn init() -> Result<(), String> {
    let filter = match std::env::var(FILTER_VARIABLE) {
        Ok(text) => text
            .parse::<Targets>()
            .map_err(|error| format!("{FILTER_VARIABLE} = \"{text}\": {error}; accepted: info, debug, CRATE=LEVEL"))?,
        Err(_) => Targets::new().with_default(LevelFilter::INFO),
    };
    let registry = tracing_subscriber::registry().with(filter);
    let result = if stderr_is_journal() {
        let journal = tracing_journald::layer().map_err(|error| format!("the journal cannot be reached: {error}"))?;
        registry.with(journal.with_field_prefix(None).with_filter(rate::RateLimit)).try_init()
    } else {
        // A line that cannot be written is lost: to complain of it on the same stderr would be a
        // panic.
        let text = fmt::layer().with_writer(std::io::stderr).with_ansi(std::io::stderr().is_terminal());
        let text = text.with_target(false).log_internal_errors(false);
        registry.with(text.with_filter(rate::RateLimit)).try_init()
    };
    result.map_err(|error| error.to_string())
}

/// Whether stderr is the stream that systemd named in JOURNAL_STREAM ("device:inode").
pub(crate) fn stderr_is_journal() -> bool {
    let Ok(stream) = std::env::var("JOURNAL_STREAM") else { return false };
    // SAFETY: an all-zero stat is a valid value, and fstat only writes to it.
    let status = unsafe {
        let mut status: libc::stat = std::mem::zeroed();
        (libc::fstat(std::io::stderr().as_raw_fd(), &raw mut status) == 0).then_some(status)
    };
    status.is_some_and(|status| stream == format!("{}:{}", status.st_dev, status.st_ino))
}
