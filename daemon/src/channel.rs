//! What the real-time thread and the service thread tell each other: wait-free rings of fixed size, one direction each.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use admittance_core::ResetRefused;
use admittance_core::mode::StopReason;
use ipc_types::{CommandSample, RecordSample};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::cycle::{Cycle, CycleReport};

/// From the service thread.
pub(crate) enum Order {
    /// End control, and the thread when that is done.
    Stop(StopReason),
    /// Leave Stopped.
    Reset { force: bool },
    /// Take this controller from the next cycle on.
    Replace(Box<dyn Cycle + Send>),
}

/// From the real-time thread, about an order.
pub(crate) enum Reply {
    /// What became of a reset.
    Reset(Result<(), ResetRefused>),
    /// The controller that is no longer used, for the service thread to free; the new one itself when it was refused.
    Replaced { unused: Box<dyn Cycle + Send>, refused: Option<&'static str> },
}

/// What the service thread knows of one cycle, or of an order.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CycleRecord {
    /// What is published.
    pub(crate) sample: RecordSample,
    /// What the log says besides: details of a fault, of a singular pose, of a wrong rate.
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
    pub(crate) orders: Consumer<Order>,
    pub(crate) replies: Producer<Reply>,
    pub(crate) progress: Arc<Progress>,
    records: Producer<CycleRecord>,
    /// Records so far, dropped ones included.
    recorded: u64,
}

impl RealtimeEnd {
    /// Completes a record with what the law says after it, and leaves it to the service thread; never waits for it.
    pub(crate) fn record(
        &mut self,
        mut sample: RecordSample,
        report: CycleReport,
        command: &CommandSample,
        cycle: &dyn Cycle,
    ) {
        self.recorded += 1;
        let counters = cycle.counters();
        sample.sequence = self.recorded;
        sample.boot_id = command.boot_id;
        sample.dropped_count = self.progress.dropped();
        sample.limited_count = counters.limited;
        sample.contact_losses = counters.contacts_lost;
        sample.iterations = report.iterations;
        sample.fault = report.fault_code().code();
        sample.limited = u32::from(report.limited);
        sample.contact_point = cycle.contact_point();
        sample.command = *command;
        if self.records.push(CycleRecord { sample, report }).is_err() {
            self.progress.drop_record();
        }
    }
}

/// The service thread's ends.
pub(crate) struct ServiceEnd {
    pub(crate) orders: Producer<Order>,
    pub(crate) replies: Consumer<Reply>,
    pub(crate) records: Consumer<CycleRecord>,
    pub(crate) progress: Arc<Progress>,
}

/// Orders and replies that may wait.
const ORDERS: usize = 8;
/// Records that may wait: a second at 4 kHz.
const RECORDS: usize = 4096;

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
        ServiceEnd { orders: order_producer, replies: reply_consumer, records: record_consumer, progress },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{config::Config, cycle};

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
