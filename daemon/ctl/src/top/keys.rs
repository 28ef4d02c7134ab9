//! What is typed, and whether the terminal is still there. Read here and not by crossterm, whose
//! reader loops for ever once the terminal is gone.

use std::io::{self, BufRead, StdinLock};
use std::os::fd::AsRawFd;
use std::time::Duration;

/// The keys that end `top`: q, Ctrl-C, and Esc (which other keys begin with as well).
const CTRL_C: u8 = 3;
const ESC: u8 = 27;

/// Waits for keys, for `timeout` at most. Returns whether to end: on q, Esc or Ctrl-C, or when the
/// terminal is gone.
pub(super) fn wait_for_end(stdin: &mut StdinLock<'_>, timeout: Duration) -> bool {
    let mut terminal = libc::pollfd { fd: stdin.as_raw_fd(), events: libc::POLLIN, revents: 0 };
    // SAFETY: one descriptor, valid for reading and writing during the call.
    let found = unsafe { libc::poll(&raw mut terminal, 1, timeout.as_millis() as libc::c_int) };
    match found {
        0 => false,
        // A signal: the caller looks at what it means.
        ..0 => io::Error::last_os_error().kind() != io::ErrorKind::Interrupted,
        _ if terminal.revents & libc::POLLIN == 0 => true,
        _ => {
            let (ended, taken) = match stdin.fill_buf() {
                Ok(typed) => (typed.is_empty() || ends(typed), typed.len()),
                Err(error) => (error.kind() != io::ErrorKind::Interrupted, 0),
            };
            stdin.consume(taken);
            ended
        }
    }
}

fn ends(typed: &[u8]) -> bool {
    typed == [ESC] || typed[0] != ESC && typed.iter().any(|key| [b'q', CTRL_C].contains(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_end_it_are_told_from_others() {
        assert!([&b"q"[..], b"xq", b"\x03", b"\x1b"].into_iter().all(ends));
        assert!(![&b"x"[..], b"\x1b[A", b"\x1bq", b"Q"].into_iter().any(ends));
    }
}
