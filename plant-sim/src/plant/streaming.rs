//! References on their way to drives that refuse jumps: one per interval, counted from where commands act.

use admittance_client::{Drives, Stream};
use ipc_types::MAX_JOINTS;
use nalgebra::SVector;

/// The stream, and what went through it since a cycle began.
#[derive(Debug, Clone)]
pub(super) struct Streaming<const N: usize> {
    stream: Stream,
    next_ns: u64,
    asked: Vec<SVector<f64, N>>,
    given: Vec<SVector<f64, N>>,
}

impl<const N: usize> Streaming<N> {
    /// References are due with the commands of a first sample stamped `first_stamp_ns`. `longest_ns` is that of a cycle.
    pub(super) fn new(drives: Drives, first_stamp_ns: u64, command_delay_ns: u64, longest_ns: u64) -> Self {
        let room = (longest_ns / drives.interval_ns + 2) as usize;
        Self {
            next_ns: first_stamp_ns + command_delay_ns % drives.interval_ns,
            stream: Stream::new(drives),
            asked: Vec::with_capacity(room),
            given: Vec::with_capacity(room),
        }
    }

    /// When the next reference is due, in ns.
    pub(super) fn next_ns(&self) -> u64 {
        self.next_ns
    }

    /// The reference at `now_ns` where `wanted` is asked for; `None` between two of them.
    pub(super) fn next(&mut self, now_ns: u64, wanted: &SVector<f64, N>) -> Option<SVector<f64, N>> {
        if now_ns < self.next_ns {
            return None;
        }
        self.next_ns = now_ns + self.stream.interval_ns();
        let padded: [f64; MAX_JOINTS] = std::array::from_fn(|joint| if joint < N { wanted[joint] } else { 0.0 });
        let given = self.stream.next(&padded);
        let given = SVector::from_fn(|joint, _| given[joint]);
        // Only as much as there is room for: this runs in real time too.
        if self.asked.len() < self.asked.capacity() {
            self.asked.push(*wanted);
            self.given.push(given);
        }
        Some(given)
    }

    /// The brakes have closed.
    pub(super) fn stand(&mut self) {
        self.stream.stand();
    }

    /// Another cycle begins.
    pub(super) fn forget(&mut self) {
        self.asked.clear();
        self.given.clear();
    }

    /// The references of this cycle: what was asked for, and what was given.
    pub(super) fn of_cycle(&self) -> (&[SVector<f64, N>], &[SVector<f64, N>]) {
        (&self.asked, &self.given)
    }
}
