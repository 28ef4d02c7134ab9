//! Commands under way: the command for the sample stamped t acts at t plus the command delay, so at
//! a sample some earlier commands have yet to act. They are known inputs of the model.

use nalgebra::SVector;

use crate::quantities::Instant;

/// Commands kept.
const COMMANDS: usize = 16;
/// Longest command delay that is covered, in cycles.
pub const MAX_DELAY_CYCLES: f64 = 8.0;

/// A twist that the joints follow for some time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stretch<const D: usize> {
    /// Length in s.
    pub(crate) duration: f64,
    /// Δṗ; `None` is zero joint velocity.
    pub(crate) offset: Option<SVector<f64, D>>,
}

/// The last commands, by the instants from which they act.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct UnderWay<const D: usize> {
    commands: [(Instant, Option<SVector<f64, D>>); COMMANDS],
    len: usize,
}

impl<const D: usize> UnderWay<D> {
    /// None given: ṗ0 alone.
    pub(crate) fn none() -> Self {
        Self { commands: [(Instant::default(), None); COMMANDS], len: 0 }
    }

    /// A command that acts from `from` on.
    pub(crate) fn push(&mut self, from: Instant, offset: Option<SVector<f64, D>>) {
        // A repeated answer for the same instant replaces the one before.
        while self.len > 0 && self.commands[self.len - 1].0 >= from {
            self.len -= 1;
        }
        if self.len == COMMANDS {
            self.commands.copy_within(1.., 0);
            self.len -= 1;
        }
        self.commands[self.len] = (from, offset);
        self.len += 1;
    }

    /// What acts between two instants, in order.
    pub(crate) fn between(&self, start: Instant, end: Instant) -> impl Iterator<Item = Stretch<D>> {
        let commands = &self.commands[..self.len];
        let ends =
            (0..=self.len).map(move |next| commands.get(next).map_or(end, |(from, _)| (*from).clamp(start, end)));
        let offsets =
            (0..=self.len).map(move |next| next.checked_sub(1).map_or(Some(SVector::zeros()), |at| commands[at].1));
        let mut begun = start;
        ends.zip(offsets).filter_map(move |(end, offset)| {
            let duration = end.since(begun).seconds();
            begun = begun.max(end);
            (duration > 0.0).then_some(Stretch { duration, offset })
        })
    }
}
