//! Cycles without a solution or without a sample: how long plans stand in, and how a stop ends.

use super::{Bridge, Cause, ContactMemory, Mode, Stopping, Supervisor, Task};
use crate::intake::SampleFault;
use crate::mpc::Solution;
use crate::quantities::{Instant, Span};

impl<const D: usize> Supervisor<D> {
    /// Whether a stop has lasted as long as it may.
    pub(crate) fn is_overdue(&self, now: Instant) -> bool {
        let Mode::Stopping(stopping) = &self.mode else { return false };
        now.since(stopping.since) > self.settings.stop_timeout
    }

    /// The stop has come to rest.
    pub(crate) fn rest(&mut self, at: Instant) {
        self.apply(Cause::Rest, at);
    }

    /// Records the outcome of a task. Returns whether it leads to another one.
    #[must_use]
    pub(crate) fn conclude<P>(&mut self, task: Task, solution: &Solution<P>, stamp: Instant) -> bool {
        if let (Task::Press, Solution::Infeasible { .. }) = (task, solution) {
            self.apply(Cause::Infeasible, stamp);
            return true;
        }
        let (Mode::Contact(ContactMemory { unsolved, .. }) | Mode::Stopping(Stopping { unsolved, .. })) =
            &mut self.mode
        else {
            return false;
        };
        let cause = match solution {
            Solution::Planned { .. } => {
                *unsolved = 0;
                return false;
            }
            Solution::Expired { .. } => Cause::FallbackExhausted,
            Solution::Infeasible { .. } | Solution::Failed { .. } => Cause::SolverFailed,
        };
        *unsolved += 1;
        if self.is_plan_exhausted() {
            self.apply(cause, stamp);
        }
        false
    }

    /// Whether more cycles in a row had no solution than a plan may cover.
    pub(crate) fn is_plan_exhausted(&self) -> bool {
        let unsolved = match &self.mode {
            Mode::Contact(memory) => memory.unsolved,
            Mode::Stopping(stopping) => stopping.unsolved,
            Mode::Idle(_) | Mode::Free { .. } | Mode::Stopped(_) => 0,
        };
        unsolved > self.settings.timing.max_consecutive_fallbacks
    }

    /// There has been no usable sample for `silence` (`None` before the first one): how to go on.
    pub(crate) fn bridge(
        &mut self,
        fault: &SampleFault,
        now: Instant,
        silence: Option<Span>,
        can_retreat: bool,
    ) -> Bridge {
        let cause = match fault {
            SampleFault::Silence => Cause::Silence,
            SampleFault::Stale { .. } => Cause::SampleStale,
            SampleFault::JointCount { .. } => Cause::JointCount,
            SampleFault::NotFinite { .. }
            | SampleFault::Implausible { .. }
            | SampleFault::WrenchInvalid
            | SampleFault::TorqueInvalid
            | SampleFault::WrenchUnseen { .. }
            | SampleFault::WrenchSaturated { .. }
            | SampleFault::FromFuture { .. }
            | SampleFault::Unnumbered
            | SampleFault::NotFollowing
            | SampleFault::OutOfOrder { .. }
            | SampleFault::Jump { .. } => Cause::SampleInvalid,
        };
        let plan_lasts = self.settings.timing.bridge();
        let is_bridged = silence.is_some_and(|silence| silence <= plan_lasts);
        let retreats = can_retreat && silence.is_some_and(|silence| silence <= plan_lasts + self.settings.retreat_time);
        match self.mode {
            Mode::Free { .. } if is_bridged => return Bridge::Ramp,
            Mode::Contact(_) | Mode::Stopping(_) if is_bridged => return Bridge::Plan,
            Mode::Contact(_) | Mode::Stopping(_) => {
                self.apply(cause, now);
                if retreats {
                    return Bridge::Retreat;
                }
                self.apply(Cause::RetreatOver, now);
            }
            // Before the first sample there is nothing to miss.
            Mode::Idle(_) if silence.is_none() => {}
            Mode::Idle(_) | Mode::Free { .. } | Mode::Stopped(_) => self.apply(cause, now),
        }
        if matches!(self.mode, Mode::Idle(_)) && !self.holds() { Bridge::Rest } else { Bridge::Hold }
    }
}
