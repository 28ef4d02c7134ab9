//! Blocking until the motion controller notifies: with the fewest system calls, and a time limit
//! that is kept to the nanosecond. (iceoryx2's own `timed_wait` takes eight, four of them between
//! waking up and looking, and rounds to the timer tick.)

use std::cell::Cell;

use admittance_host::clock::{monotonic_ns, sleep_until_ns};
use iceoryx2::prelude::FileDescriptorBased;
use ipc_types::Listener;

/// The listener, and whether it has notifications to take.
pub(crate) struct Notifications {
    listener: Listener,
    is_pending: Cell<bool>,
}

impl Notifications {
    pub(crate) fn new(listener: Listener) -> Self {
        Self { listener, is_pending: Cell::new(false) }
    }

    /// Blocks until there is a notification, for `timeout` ns at most. It may be that of a sample
    /// that was taken already.
    pub(crate) fn block(&self, timeout: u64) {
        // SAFETY: the descriptor is neither closed nor changed here, and the listener that owns it
        // outlives the call.
        let descriptor = unsafe { self.listener.file_descriptor().native_handle() };
        let mut descriptor = libc::pollfd { fd: descriptor, events: libc::POLLIN, revents: 0 };
        let limit = libc::timespec {
            tv_sec: (timeout / 1_000_000_000) as libc::time_t,
            tv_nsec: (timeout % 1_000_000_000) as libc::c_long,
        };
        let begun = monotonic_ns();
        // SAFETY: one descriptor and a time limit, valid for the call; the signal mask stays as it
        // is.
        let found = unsafe { libc::ppoll(&raw mut descriptor, 1, &raw const limit, std::ptr::null()) };
        self.is_pending.set(found > 0);
        if found < 0 && std::io::Error::last_os_error().kind() != std::io::ErrorKind::Interrupted {
            // A failing wait must end as a silence, not as a thread that loops at real-time
            // priority.
            sleep_until_ns(begun.saturating_add(timeout));
        }
    }

    /// Takes the notifications that ended the last [`Self::block`]. Returns true if there were any:
    /// a sample may have come since the last look, and it will not be notified again.
    pub(crate) fn take(&self) -> bool {
        let was_pending = self.is_pending.replace(false);
        if was_pending {
            let _ = self.listener.try_wait(|_| {});
        }
        was_pending
    }
}
