//! The running counts of a record.

use ipc_types::RecordSample;

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
