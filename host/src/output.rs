//! What programs print: never a panic when nobody reads it any more, and fatal errors as such in
//! the journal.

use std::any::Any;
use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::exit::ExitCode;
use crate::logging::stderr_is_journal;

/// Unwinds from where nobody read what was printed, so that everything on the way is cleaned up.
struct Unread(io::Error);

/// What the macro [`say!`](crate::say) does: prints a line to stdout. Where that fails it does not
/// return: [`until_unread`] does.
pub fn say_line(text: Arguments<'_>) {
    let mut stdout = io::stdout().lock();
    if let Err(error) = stdout.write_fmt(text).and_then(|()| stdout.write_all(b"\n")) {
        // Not a panic: no hook speaks of it.
        resume_unwind(Box::new(Unread(error)));
    }
}

/// What the macro [`remark!`](crate::remark) does: prints a line to stderr, if somebody reads it.
pub fn remark_line(text: Arguments<'_>) {
    let mut stderr = io::stderr().lock();
    let _ = stderr.write_fmt(text).and_then(|()| stderr.write_all(b"\n"));
}

/// Prints a line to stdout. When its reader has gone the program ends: see [`output::until_unread`](until_unread).
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => { $crate::output::say_line(format_args!($($text)*)) };
}

/// Prints a line to stderr, if somebody reads it.
#[macro_export]
macro_rules! remark {
    ($($text:tt)*) => { $crate::output::remark_line(format_args!($($text)*)) };
}

/// Runs a tool. Where the reader of what it [says](crate::say) has gone (`status | head -1`) it ends
/// quietly, by SIGPIPE as other tools do; where writing fails for another reason, such as on a full
/// disk, with [`ExitCode::IoError`].
///
/// # Panics
/// When `tool` does.
pub fn until_unread(program: &str, tool: impl FnOnce() -> ExitCode) -> ExitCode {
    // What `tool` leaves half done is gone with it: nothing is used after it has unwound.
    match catch_unwind(AssertUnwindSafe(tool)) {
        Ok(code) => code,
        Err(payload) => match unread(payload) {
            Ok(Unread(error)) if error.kind() == ErrorKind::BrokenPipe => end_by_sigpipe(),
            Ok(Unread(error)) => {
                fatal(program, &format!("stdout: {error}"));
                ExitCode::IoError
            }
            Err(payload) => resume_unwind(payload),
        },
    }
}

fn unread(payload: Box<dyn Any + Send>) -> Result<Unread, Box<dyn Any + Send>> {
    payload.downcast().map(|unread| *unread)
}

fn end_by_sigpipe() -> ExitCode {
    // SAFETY: the default action is no code of this process, and both calls take numbers alone.
    unsafe {
        libc::signal(libc::SIGPIPE, libc::SIG_DFL);
        libc::raise(libc::SIGPIPE);
    }
    // Only with SIGPIPE blocked.
    ExitCode::IoError
}

/// Says why a program ends; in the journal with priority 3 (err).
pub fn fatal(program: &str, why: &str) {
    // The journal takes the priority of a line from its start: sd-daemon(3).
    let priority = if stderr_is_journal() { "<3>" } else { "" };
    let text = format!("{program}: {why}");
    text.lines().for_each(|line| remark_line(format_args!("{priority}{line}")));
}

/// Lets panics reach the journal as fatal errors; elsewhere they are reported as always.
pub fn report_panics(program: &'static str) {
    if stderr_is_journal() {
        std::panic::set_hook(Box::new(move |panic| {
            fatal(program, &format!("{panic}\n{}", std::backtrace::Backtrace::capture()));
        }));
    }
}
