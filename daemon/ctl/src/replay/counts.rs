//! The running counts of a record.

use ipc_types::{Fault, RecordKind, RecordSample};

/// Running counts of a record, which a fresh controller begins at zero.
#[derive(Clone, Copy)]
pub(super) struct Counts([u64; 6]);

impl Counts {
    pub(super) fn of(record: &RecordSample) -> Self {
        let command = &record.command;
        let counts = [command.fallback_count, command.missed_count, command.rejected_count];
        let of_record = [record.limited_count, record.contact_losses, record.exceeded_count];
        Self([counts[0], counts[1], counts[2], of_record[0], of_record[1], of_record[2]])
    }

    pub(super) fn zip(self, other: Self, with: fn(u64, u64) -> u64) -> Self {
        Self(std::array::from_fn(|index| with(self.0[index], other.0[index])))
    }

    pub(super) fn write(self, record: &mut RecordSample) {
        let command = &mut record.command;
        [
            command.fallback_count,
            command.missed_count,
            command.rejected_count,
            record.limited_count,
            record.contact_losses,
            record.exceeded_count,
        ] = self.0;
    }
}

impl Counts {
    /// None yet.
    pub(super) const NONE: Self = Self([0; 6]);
}

/// What recordings of earlier versions counted besides.
#[derive(Default)]
pub(super) struct Earlier {
    /// Silences, as rejected samples: up to version 3 of the record.
    pub(super) silences: u64,
    /// Refused samples, as missed ones once another was accepted. No version tells.
    pub(super) refused: u64,
    /// Samples refused since the last that was accepted.
    waiting: u64,
    /// Run and sequence of that.
    last: Option<(u64, u64)>,
}

impl Earlier {
    /// Nothing yet; `record` is that of the last sample.
    pub(super) fn after(record: &RecordSample) -> Self {
        Self { last: Some((record.state.boot_id, record.state.sequence)), ..Self::default() }
    }

    /// Counts a replayed cycle in.
    pub(super) fn count(&mut self, replayed: &RecordSample, kind: RecordKind) {
        match kind {
            RecordKind::Silence => self.silences += 1,
            RecordKind::Sample if replayed.fault != Fault::NONE => self.waiting += 1,
            RecordKind::Sample => {
                let (boot_id, sequence) = (replayed.state.boot_id, replayed.state.sequence);
                let gap = match self.last.replace((boot_id, sequence)) {
                    Some((run, last)) if run == boot_id => sequence.saturating_sub(last).saturating_sub(1),
                    _ => 0,
                };
                self.refused += std::mem::take(&mut self.waiting).min(gap);
            }
            _ => {}
        }
    }
}
