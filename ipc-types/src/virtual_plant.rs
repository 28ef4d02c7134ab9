//! The other end of the wire in virtual time.

use crate::{CommandSample, StateSample, TruthSample};

/// A plant that gives samples and takes commands without ports and without a clock.
pub trait VirtualPlant {
    /// The state sample of the current instant; `None` when it is not published.
    fn sample(&self) -> Option<&StateSample>;

    /// The current instant in ns of the plant's clock.
    fn now_ns(&self) -> u64;

    /// Takes the answer to the current sample, visible at once, and goes on to the next. What was
    /// true at the instant of the sample, its peaks those since the sample before.
    ///
    /// # Errors
    /// Why the plant does not accept the command; it has gone on all the same.
    fn advance(&mut self, answer: Option<&CommandSample>) -> Result<TruthSample, String>;

    /// Whether the motion is over.
    fn is_finished(&self) -> bool;
}
