//! Defaults of earlier versions: a recorded configuration means what it meant when it was recorded.

use admittance_runner::config::Config;

/// The version whose defaults hold for keys that a recorded configuration does not give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Defaults {
    /// Those of version 0.1, whose records are of version 6 at most: one input per cycle, at every
    /// sampling time.
    OneInput,
    /// The present ones.
    Present,
}

impl Defaults {
    /// Those of a recording with records of this version: they say it themselves, where the metadata is
    /// damaged.
    pub(super) fn of(record_version: u32) -> Self {
        if record_version < 7 { Self::OneInput } else { Self::Present }
    }

    /// Gives the keys that are absent, and whose default has changed since, the value of then.
    pub(super) fn complete(self, config: &mut Config) {
        match self {
            Self::OneInput => config.mpc.inputs_per_cycle = config.mpc.inputs_per_cycle.or(Some(1)),
            Self::Present => {}
        }
    }
}
