//! What the real-time thread and the service thread tell each other: wait-free rings of fixed size,
//! one direction each.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use admittance_core::supervisor::{EnableRefused, Ending, ResetRefused};
use admittance_core::vocabulary::ModeName as Mode;
use ipc_types::{CommandSample, RecordSample};
use rtrb::{Consumer, Producer, RingBuffer};

use admittance_runner::cycle::{Cycle, CycleReport};

/// From the service thread.
pub(crate) enum Order {
    /// End control; on shutdown the thread as well, when that is done.
    Stop(Ending),
    /// Let control begin.
    Enable,
    /// Leave Stopped.
    Reset { force: bool },
    /// Take this controller from the next cycle on.
    Replace { new: Box<dyn Cycle>, kind: Replacement },
}

/// Why a controller is replaced, which decides in which modes it may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Replacement {
    /// The configuration was read again: not in contact, where model and bounds would be exchanged
    /// under the force.
    Reload,
    /// Another law or environment: not in contact either.
    Behaviour,
    /// Another force limit: in every mode. In contact the next verdict is about it.
    ForceLimit,
    /// Another bias: only in Free, where there is no force that could be mistaken for one.
    Bias,
}

impl Replacement {
    /// Why not in this mode.
    pub(crate) fn refused_in(self, mode: Mode) -> Option<&'static str> {
        match (self, mode) {
            (Self::ForceLimit, _) | (Self::Bias, Mode::Free) => None,
            (Self::Bias, _) => Some("a wrench can be tared in free motion only: accepted in mode Free"),
            (Self::Reload | Self::Behaviour, Mode::Contact | Mode::Stopping) => {
                Some("the arm is in contact: accepted in the modes Idle, Free and Stopped")
            }
            (Self::Reload | Self::Behaviour, Mode::Idle | Mode::Free | Mode::Stopped) => None,
        }
    }
}

/// An order with its number and its deadline.
pub(crate) struct Ticket {
    /// What the reply carries.
    pub(crate) number: u64,
    /// ns of CLOCK_MONOTONIC; it is not carried out after that.
    pub(crate) until_ns: u64,
    /// What is ordered.
    pub(crate) order: Order,
}

/// From the real-time thread, one reply to every order.
pub(crate) struct Reply {
    /// Of the order.
    pub(crate) number: u64,
    /// What became of it.
    pub(crate) outcome: Outcome,
}

/// What became of an order.
pub(crate) enum Outcome {
    /// Of Stop: the mode in which it found the controller, and whether control was enabled.
    Stopping { mode: Mode, was_enabled: bool },
    /// Of Enable: the mode, and whether that changed anything.
    Enabled(Result<(Mode, bool), EnableRefused>),
    /// Of Reset.
    Reset(Result<(), ResetRefused>),
    /// Of Replace: the controller that is no longer used, for the service thread to free; the new
    /// one itself when it was refused.
    Replaced { unused: Box<dyn Cycle>, refused: Option<&'static str> },
    /// It came after its deadline; nothing was done. The order is given back, for the service
    /// thread to free.
    Late {
        #[expect(dead_code, reason = "held to be freed by the service thread: the real-time thread frees nothing")]
        order: Order,
    },
}

/// What the service thread knows of one cycle, or of an order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CycleRecord {
    /// What is published.
    pub(crate) sample: RecordSample,
    /// Further details for the log: of a fault, of a singular pose, of a wrong rate.
    pub(crate) report: CycleReport,
}

/// What both threads see.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    /// Turns of the real-time loop, waits that timed out included.
    turns: AtomicU64,
    /// Records dropped because the ring was full.
    dropped: AtomicU64,
}

impl Progress {
    pub(crate) fn turn(&self) {
        self.turns.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn turns(&self) -> u64 {
        self.turns.load(Ordering::Relaxed)
    }

    pub(crate) fn drop_record(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

/// The real-time thread's ends.
pub(crate) struct RealtimeEnd {
    pub(crate) orders: Consumer<Ticket>,
    pub(crate) replies: Producer<Reply>,
    pub(crate) progress: Arc<Progress>,
    records: Producer<CycleRecord>,
    /// Records so far, dropped ones included.
    recorded: u64,
}

impl RealtimeEnd {
    /// Completes a record with the law's state, and passes it to the service thread; never waits
    /// for it.
    pub(crate) fn record(
        &mut self,
        mut sample: RecordSample,
        report: CycleReport,
        command: &CommandSample,
        cycle: &dyn Cycle,
    ) {
        self.recorded += 1;
        sample.sequence = self.recorded;
        sample.boot_id = command.boot_id;
        sample.dropped_count = self.progress.dropped();
        report.write(&mut sample);
        cycle.write(&mut sample);
        sample.command = *command;
        if self.records.push(CycleRecord { sample, report }).is_err() {
            self.progress.drop_record();
        }
    }
}

/// The service thread's ends.
pub(crate) struct ServiceEnd {
    orders: Producer<Ticket>,
    replies: Consumer<Reply>,
    /// Number of the last order.
    ordered: u64,
    pub(crate) records: Consumer<CycleRecord>,
    pub(crate) progress: Arc<Progress>,
}

/// Why an order has no regular reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum OrderError {
    /// The real-time thread has ended, or takes no orders.
    #[error("the real-time thread takes no orders: it is ending")]
    Ending,
    /// Its end came first.
    #[error("the real-time thread did not take the order in time; nothing was done")]
    Late,
}

impl ServiceEnd {
    /// What became of an order, if that is known by now.
    pub(crate) fn outcome_of(&mut self, number: u64) -> Option<Result<Outcome, OrderError>> {
        while let Ok(Reply { number: of, outcome }) = self.replies.pop() {
            match outcome {
                // The reply to an order that nobody waits for any more.
                _ if of != number => {}
                Outcome::Late { .. } => return Some(Err(OrderError::Late)),
                outcome => return Some(Ok(outcome)),
            }
        }
        None
    }

    /// Gives an order that is carried out until `until_ns` or not at all, and returns its number.
    pub(crate) fn give(&mut self, order: Order, until_ns: u64) -> Result<u64, OrderError> {
        self.ordered += 1;
        let ticket = Ticket { number: self.ordered, until_ns, order };
        self.orders.push(ticket).map_err(|_| OrderError::Ending)?;
        Ok(self.ordered)
    }
}

/// Orders and replies that may wait.
const ORDERS: usize = 8;
/// Records that may wait: 0.4 s at 4 kHz. More would take the daemon beyond 64 MiB.
pub(crate) const RECORDS: usize = 1600;

/// Rings for one pair of threads.
pub(crate) fn channel() -> (RealtimeEnd, ServiceEnd) {
    let (order_producer, order_consumer) = RingBuffer::new(ORDERS);
    let (reply_producer, reply_consumer) = RingBuffer::new(ORDERS);
    let (record_producer, record_consumer) = RingBuffer::new(RECORDS);
    let progress = Arc::new(Progress::default());
    (
        RealtimeEnd {
            orders: order_consumer,
            replies: reply_producer,
            progress: Arc::clone(&progress),
            records: record_producer,
            recorded: 0,
        },
        ServiceEnd { orders: order_producer, replies: reply_consumer, ordered: 0, records: record_consumer, progress },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use admittance_runner::config::Config;
    use admittance_runner::cycle;

    #[test]
    fn a_full_ring_drops_and_counts() {
        let text = include_str!("../../deploy/demo/mpc-paper.toml");
        let config: Config = admittance_host::config::parse(text, "mpc-paper.toml").expect("valid");
        let cycle = cycle::build(&config).expect("an arm that is known");
        let (mut realtime, mut service) = channel();
        let mut record = || {
            realtime.record(RecordSample::zeroed(), CycleReport::default(), &CommandSample::zeroed(), &*cycle);
        };
        (0..RECORDS + 3).for_each(|_| record());
        assert_eq!(service.progress.dropped(), 3);
        let first = service.records.pop().expect("a record");
        record();
        let mut last = first.sample;
        while let Ok(record) = service.records.pop() {
            last = record.sample;
        }
        // The gap shows in the sequence.
        assert_eq!((first.sample.sequence, last.sequence, last.dropped_count), (1, RECORDS as u64 + 4, 3));
        assert_eq!(service.progress.dropped(), 3);
    }
}
