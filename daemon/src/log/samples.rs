//! What is logged about how state samples come: missed ones, jumps of their sequence, those that
//! nobody notified.

use admittance_core::intake::Arrival;
use admittance_core::quantities::Span;

use crate::channel::CycleRecord;

/// Samples over which it is judged whether they are notified.
const JUDGED: u64 = 25;

/// What has accumulated since the last lines.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// Samples since that was judged, and how many of them were found without a notification.
    taken: u64,
    unnotified: u64,
    missed: u64,
    /// Longest time between two samples of which some were missed.
    longest: Span,
    /// The last jump: to which sequence, over how many.
    jump: Option<(u64, u64)>,
}

impl Samples {
    /// Takes note of a cycle.
    pub(super) fn cycle(&mut self, record: &CycleRecord) {
        let Some(Arrival { age, missed, skipped, .. }) = record.report.arrival else { return };
        self.taken += 1;
        self.unnotified += u64::from(record.report.is_unnotified);
        if missed > 0 {
            self.missed = self.missed.saturating_add(missed);
            self.longest = if age > self.longest { age } else { self.longest };
        }
        if skipped > 0 {
            self.jump = Some((record.sample.state.sequence, skipped));
        }
    }

    /// Logs what has accumulated. Returns whether there was anything.
    pub(super) fn flush(&mut self) -> bool {
        let (missed, longest) = (std::mem::take(&mut self.missed), std::mem::take(&mut self.longest));
        let jump = self.jump.take();
        if missed > 0 {
            tracing::warn!(
                count = missed,
                "state samples missed: what the law acted on became up to {:.1} ms old",
                longest.seconds() * 1e3
            );
        }
        if let Some((sequence, skipped)) = jump {
            tracing::warn!(
                "sequence jumped by {skipped} to {sequence}, in no time for so many samples: it must go up by one \
                 with every sample"
            );
        }
        self.flush_unnotified() || missed > 0 || jump.is_some()
    }

    fn flush_unnotified(&mut self) -> bool {
        if self.taken < JUDGED {
            return false;
        }
        let (taken, unnotified) = (std::mem::take(&mut self.taken), std::mem::take(&mut self.unnotified));
        // One now and then is a machine that was busy between publishing and notifying.
        let forgets = 2 * unnotified > taken;
        if forgets {
            tracing::warn!(
                count = unnotified,
                "state samples found without a notification, and answered late: the motion controller must notify \
                 state-arrival after each sample that it publishes"
            );
        }
        forgets
    }
}
