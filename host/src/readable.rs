//! Waiting for a socket.

use std::os::fd::{AsFd, AsRawFd};

/// Waits at most `timeout_ns` until there is something to read; a signal ends the wait as well. Whether there is something.
pub fn wait_until_readable(socket: &impl AsFd, timeout_ns: u64) -> bool {
    let mut readable = libc::pollfd { fd: socket.as_fd().as_raw_fd(), events: libc::POLLIN, revents: 0 };
    let timeout = libc::timespec {
        tv_sec: (timeout_ns / 1_000_000_000) as libc::time_t,
        tv_nsec: (timeout_ns % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: both structures are valid for the call, one descriptor is given, and no signal mask. A failure is a wait that
    // ended early.
    unsafe { libc::ppoll(&raw mut readable, 1, &raw const timeout, std::ptr::null()) > 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::UdpSocket;

    #[test]
    fn a_datagram_ends_the_wait_and_its_lack_does_not_for_ever() {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a port is free");
        assert!(!wait_until_readable(&socket, 1_000_000));
        socket.send_to(b"x", socket.local_addr().expect("bound")).expect("sent");
        assert!(wait_until_readable(&socket, 10_000_000_000));
    }
}
