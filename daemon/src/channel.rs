//! What the real-time thread and the service thread tell each other: wait-free rings of fixed size, one direction each.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use admittance_core::ResetRefused;
use admittance_core::mode::StopReason;
use ipc_types::{CommandSample, TASK_AXES};
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

/// What the service thread knows of one cycle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CycleRecord {
    pub(crate) report: CycleReport,
    pub(crate) state_sequence: u64,
    pub(crate) command_sequence: u64,
    pub(crate) mode: u32,
    pub(crate) motion: u32,
    pub(crate) stop_reason: u32,
    pub(crate) active_axes: u32,
    pub(crate) verdict: u32,
    pub(crate) verdict_axis: u32,
    pub(crate) verdict_side: u32,
    pub(crate) verdict_margin: f64,
    pub(crate) verdict_time_s: f64,
    pub(crate) fallback_count: u64,
    pub(crate) late_count: u64,
    pub(crate) missed_count: u64,
    pub(crate) rejected_count: u64,
    pub(crate) compute_time_ns: u64,
    pub(crate) wrench: [f64; TASK_AXES],
    pub(crate) velocity_offset: [f64; TASK_AXES],
}

impl CycleRecord {
    pub(crate) fn new(command: &CommandSample, report: CycleReport, wrench: [f64; TASK_AXES]) -> Self {
        Self {
            report,
            state_sequence: command.state_sequence,
            command_sequence: command.sequence,
            mode: command.mode,
            motion: command.motion,
            stop_reason: command.stop_reason,
            active_axes: command.active_axes,
            verdict: command.verdict,
            verdict_axis: command.verdict_axis,
            verdict_side: command.verdict_side,
            verdict_margin: command.verdict_margin,
            verdict_time_s: command.verdict_time_s,
            fallback_count: command.fallback_count,
            late_count: command.late_count,
            missed_count: command.missed_count,
            rejected_count: command.rejected_count,
            compute_time_ns: command.compute_time_ns,
            wrench,
            velocity_offset: command.velocity_offset,
        }
    }
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
    pub(crate) records: Producer<CycleRecord>,
    pub(crate) progress: Arc<Progress>,
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
            records: record_producer,
            progress: Arc::clone(&progress),
        },
        ServiceEnd { orders: order_producer, replies: reply_consumer, records: record_consumer, progress },
    )
}
