//! Blocking until the other side notifies: with the fewest system calls, and a time limit
//! that is kept to the nanosecond. (iceoryx2's own `timed_wait` takes eight, four of them between
//! waking up and looking, and rounds to the timer tick.)

use iceoryx2::port::listener::ListenerWaitError;
use iceoryx2::prelude::FileDescriptorBased;
use ipc_types::Listener;

use crate::clock::{monotonic_ns, sleep_until_ns};

/// What the other side sends when a sample of its own is there.
#[derive(Debug)]
pub struct Notifications {
    listener: Listener,
}

impl Notifications {
    /// Those that this listener gets.
    pub fn new(listener: Listener) -> Self {
        Self { listener }
    }

    /// Takes what is there, so that the next [`Self::block`] waits at once: in the slack of a cycle, of one that looks for
    /// samples before it waits.
    pub fn drain(&self) {
        // What cannot be taken is looked at by the next wait.
        let _ = self.listener.try_wait(|_| {});
    }

    /// Blocks until there is a notification, for `timeout` ns at most. Returns whether there may be
    /// a sample: the notification is perhaps that of one that was taken already.
    ///
    /// One may still be missed, when its notifier stands still between two instructions while this
    /// looks twice: a caller that must not be late by the whole timeout gives a shorter one.
    pub fn block(&self, timeout: u64) -> bool {
        let begun = monotonic_ns();
        // A listener that has been notified and has not taken that yet is not sent anything more.
        // A notification in the middle of a take can leave exactly that, with an empty socket: to
        // wait on it then would be to miss all that follow. So it is waited for only after a look
        // that found nothing.
        match self.listener.try_wait(|_| {}) {
            Ok(0) => {}
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => return true,
            Err(_) => return give_up(begun, timeout),
        }
        // SAFETY: the descriptor is neither closed nor changed here, and the listener that owns it
        // outlives the call.
        let descriptor = unsafe { self.listener.file_descriptor().native_handle() };
        let mut descriptor = libc::pollfd { fd: descriptor, events: libc::POLLIN, revents: 0 };
        let left = timeout.saturating_sub(monotonic_ns() - begun);
        let limit = libc::timespec {
            tv_sec: (left / 1_000_000_000) as libc::time_t,
            tv_nsec: (left % 1_000_000_000) as libc::c_long,
        };
        // SAFETY: one descriptor and a time limit, valid for the call; the signal mask stays as it
        // is.
        let found = unsafe { libc::ppoll(&raw mut descriptor, 1, &raw const limit, std::ptr::null()) };
        let is_interrupted = || std::io::Error::last_os_error().kind() == std::io::ErrorKind::Interrupted;
        match found {
            0 => false,
            // Nothing to take, and never will be.
            1.. if descriptor.revents & libc::POLLIN == 0 => give_up(begun, timeout),
            1.. => true,
            _ if is_interrupted() => true,
            _ => give_up(begun, timeout),
        }
    }
}

/// A failing wait must end as a silence, not as a thread that loops at real-time priority.
fn give_up(begun: u64, timeout: u64) -> bool {
    sleep_until_ns(begun.saturating_add(timeout));
    false
}

#[cfg(test)]
mod tests {

    use ipc_types::services::{self, Access};
    use ipc_types::{Instance, IpcSettings};

    use super::*;

    const LONG: u64 = 20_000_000_000;

    #[test]
    fn what_is_notified_while_another_is_taken_is_not_missed() {
        let name = format!("not{:x}_", std::process::id());
        let settings = IpcSettings {
            root_path: ipc_types::users_root_path().join(&name),
            prefix: name,
            instance: Instance::new("notified").expect("a name"),
        };
        let node = settings.node("test").expect("a node");
        let service = services::state_arrival(&node, &settings.instance, Access::OpenOrCreate).expect("a service");
        let notifications = Notifications::new(service.listener().expect("a listener"));
        let notifier = service.notifier().expect("a notifier");
        assert!(!notifications.block(1_000_000), "nothing yet");
        notifier.notify().expect("notified");
        assert!(notifications.block(LONG), "notified");
        assert!(!notifications.block(1_000_000), "and taken");
        notifier.notify().expect("notified");
        notifications.drain();
        assert!(!notifications.block(1_000_000), "drained");

        // The datagram is gone and the state stays, as when it comes in the middle of a take.
        notifier.notify().expect("notified");
        // SAFETY: as in `block`.
        let socket = unsafe { notifications.listener.file_descriptor().native_handle() };
        let mut byte = [0_u8; 8];
        // SAFETY: the buffer is valid for writing its length.
        let read = unsafe { libc::recv(socket, byte.as_mut_ptr().cast(), byte.len(), libc::MSG_DONTWAIT) };
        assert_eq!(read, 1, "one notification, one datagram");
        notifier.notify().expect("notified");
        assert!(notifications.block(LONG), "notified");
        notifier.notify().expect("notified");
        assert!(notifications.block(LONG), "and every one after it");

        drop((notifications, notifier, service, node));
        ipc_types::remove_all(&settings).expect("removed");
    }
}
