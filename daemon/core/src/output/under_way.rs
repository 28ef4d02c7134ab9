//! Commands under way: the command for the sample stamped t acts at t plus the command delay, so at
//! a sample some earlier commands have yet to act, and some have yet to reach joints with dead
//! time. They are known inputs of the model.

use nalgebra::SVector;

use crate::quantities::{Instant, Span};
use crate::redundancy::NullMotion;
use crate::turn::Turn;

/// Commands kept. Of an instant before the oldest one nothing is known: there ṗ0 alone counts,
/// without an offset.
const COMMANDS: usize = 48;
/// Longest command delay that is covered, in cycles.
pub const MAX_DELAY_CYCLES: f64 = 8.0;

/// A stretch of time in which no joint's reference changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stretch<const N: usize, const D: usize> {
    /// When it begins.
    pub(crate) begun: Instant,
    /// Length in s.
    pub(crate) duration: f64,
    /// The Δṗ that each joint follows; `None` is zero joint velocity.
    pub(crate) offset: [Option<SVector<f64, D>>; N],
}

impl<const N: usize, const D: usize> Stretch<N, D> {
    /// What each joint follows, in rad/s, from the joint velocities that an offset stands for, and what
    /// it does `beside` the task.
    pub(crate) fn references(
        &self,
        beside: &NullMotion<N>,
        dead_time: [Span; N],
        reference: impl Fn(Option<SVector<f64, D>>) -> SVector<f64, N>,
    ) -> SVector<f64, N> {
        let mut references = reference(self.offset[0]);
        for joint in 1..N {
            if self.offset[joint] != self.offset[0] {
                references[joint] = reference(self.offset[joint])[joint];
            }
        }
        match beside.followed(self.begun, dead_time, |joint| self.offset[joint].is_some()) {
            Some(beside) => references + beside,
            None => references,
        }
    }
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

    /// Goes over to the frame that a turn leads to.
    pub(super) fn turn(&mut self, turn: &Turn) {
        for (_, offset) in &mut self.commands[..self.len] {
            *offset = offset.map(|offset| turn.twist(&offset));
        }
    }

    /// What the joints follow between two instants, in order, where a command reaches each after
    /// its dead time.
    pub(crate) fn between<const N: usize>(
        &self,
        start: Instant,
        end: Instant,
        dead_time: [Span; N],
    ) -> impl Iterator<Item = Stretch<N, D>> {
        let commands = &self.commands[..self.len];
        let mut begun = start;
        core::iter::from_fn(move || {
            if begun >= end {
                return None;
            }
            let (mut next, mut reached) = (end, 0);
            let offset = core::array::from_fn(|joint| {
                // Joints with one dead time are reached by the same commands: those before the next to come.
                if joint == 0 || dead_time[joint] != dead_time[joint - 1] {
                    let acts = |(from, _): &(Instant, _)| *from + dead_time[joint];
                    reached = commands.iter().rposition(|command| acts(command) <= begun).map_or(0, |last| last + 1);
                    next = commands.get(reached).map_or(next, |command| next.min(acts(command)));
                }
                reached.checked_sub(1).map_or(Some(SVector::zeros()), |last| commands[last].1)
            });
            let stretch = Stretch { begun, duration: next.since(begun).seconds(), offset };
            begun = next;
            Some(stretch)
        })
    }

    /// Δṗ of the last command; `None` is zero joint velocity.
    pub(crate) fn latest(&self) -> Option<SVector<f64, D>> {
        self.len.checked_sub(1).map_or(Some(SVector::zeros()), |last| self.commands[last].1)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector1;

    use super::*;

    const fn at(ns: u64) -> Instant {
        Instant::from_nanoseconds(ns)
    }

    /// Of commands that act from these instants on, the one that each joint follows is the last that has
    /// reached it, whatever the dead times of the others are; and a stretch ends where that changes for any.
    #[test]
    fn a_stretch_is_of_what_has_reached_each_joint() {
        let mut under_way = UnderWay::<1>::none();
        let commands = [(1000, Some(1.0)), (1500, None), (2000, Some(3.0)), (2100, Some(4.0)), (9000, Some(5.0))];
        for (from, offset) in commands {
            under_way.push(at(from), offset.map(Vector1::new));
        }
        for dead_time in [[0; 3], [700; 3], [0, 300, 0], [300, 300, 50], [100, 0, 5000]] {
            let dead_times = dead_time.map(Span::from_nanoseconds);
            let followed = |joint: usize, now: u64| {
                let reached = commands.iter().rfind(|(from, _)| from + dead_time[joint] <= now);
                reached.map_or(Some(0.0), |(_, offset)| *offset)
            };
            for (start, end) in [(0, 500), (900, 2600), (1500, 1501), (2000, 12_000)] {
                let (mut now, mut last) = (start, None);
                for stretch in under_way.between(at(start), at(end), dead_times) {
                    assert_eq!(stretch.begun, at(now));
                    let offsets = stretch.offset.map(|offset| offset.map(|offset| offset[0]));
                    assert_ne!(last, Some(offsets), "{dead_time:?}, {now} ns: nothing has changed");
                    let lasts = (stretch.duration * 1e9).round() as u64;
                    for instant in now..now + lasts {
                        let wanted = [0, 1, 2].map(|joint| followed(joint, instant));
                        assert_eq!(offsets, wanted, "{dead_time:?}, {instant} ns");
                    }
                    (now, last) = (now + lasts, Some(offsets));
                }
                assert_eq!(now, end, "{dead_time:?}");
            }
        }
    }
}
