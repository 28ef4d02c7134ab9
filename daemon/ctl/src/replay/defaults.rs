//! Defaults of earlier versions: a recorded configuration means what it meant when it was recorded.

use admittance_runner::config::Config;

/// The version whose defaults hold for keys that a recorded configuration does not give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Defaults {
    /// Those of version 0.1: one input per cycle, at every sampling time.
    OneInput,
    /// The present ones.
    Present,
}

impl Defaults {
    /// Of the version that wrote a recording; what cannot be told is taken for the present one.
    pub(crate) fn of(version: &str) -> Self {
        if version.starts_with("0.1.") { Self::OneInput } else { Self::Present }
    }

    /// Gives the keys that are absent, and whose default has changed since, the value of then.
    pub(crate) fn complete(self, config: &mut Config) {
        match self {
            Self::OneInput => config.mpc.inputs_per_cycle = config.mpc.inputs_per_cycle.or(Some(1)),
            Self::Present => {}
        }
    }
}
