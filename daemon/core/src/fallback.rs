//! Cycles that the law cannot answer: no usable sample, or no solution in time. In contact the last plan goes on by
//! elapsed time, then the arm retreats open loop, then it is held; nothing is read as zero and no wrench is kept.

use nalgebra::SVector;

use crate::controller::Controller;
use crate::mode::{Mode, StopReason, Transition};
use crate::outcome::{Outcome, Source};
use crate::plan::nanoseconds;
use crate::qp::QpSolver;
use crate::sample::{Sample, SampleFault};

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// A cycle without a usable sample.
    pub(crate) fn on_fault(&mut self, fault: SampleFault, now: u64) -> Outcome<N, D> {
        self.counters.rejected += 1;
        let timing = &self.parameters.timing;
        let elapsed = now.saturating_sub(self.history.last_stamp().unwrap_or(0));
        // Half a cycle of grace: `now` is later than the sample that is missing.
        let fallbacks = nanoseconds(timing.sampling_time * (f64::from(timing.max_consecutive_fallbacks) + 0.5));
        let bridged = elapsed <= fallbacks;
        let reason = match fault {
            SampleFault::Silence | SampleFault::Stale { .. } => StopReason::SampleStale,
            SampleFault::JointCount { .. } => StopReason::JointCount,
            _ => StopReason::SampleInvalid,
        };
        let mut outcome = match (self.mode, self.last) {
            (Mode::Free, Some(_)) if bridged => self.play_plan(Source::Ramp, now),
            (Mode::Free, _) if fault == SampleFault::Silence => {
                self.mode = self.mode.after(Transition::Disable);
                self.stop_reason = Some(reason);
                self.set_plan(now, SVector::zeros());
                self.unposed(Source::None, now)
            }
            (Mode::Contact | Mode::Stopping, Some(_)) if bridged => {
                self.counters.fallback += 1;
                self.play_plan(Source::Plan, now)
            }
            (Mode::Contact | Mode::Stopping, Some(last))
                if elapsed <= fallbacks + nanoseconds(self.parameters.stopping.retreat_time)
                    && self.within_limits(&self.open_loop_retreat(&last.twist_reference)) =>
            {
                self.begin_stop(reason, now);
                let offset = self.open_loop_retreat(&last.twist_reference);
                self.set_plan(now, offset);
                self.unposed(Source::Retreat, now)
            }
            (Mode::Idle, _) => {
                // Before the first sample there is nothing to miss.
                if self.last.is_some() {
                    self.stop_reason = Some(reason);
                }
                self.set_plan(now, SVector::zeros());
                self.unposed(Source::None, now)
            }
            (Mode::Stopped, _) => self.hold(now),
            _ => {
                self.halt(reason);
                self.hold(now)
            }
        };
        if matches!(self.mode, Mode::Idle | Mode::Stopped) {
            self.track.forget();
        }
        outcome.fault = Some(fault);
        outcome
    }

    /// The last plan goes on by elapsed time.
    fn play_plan(&mut self, source: Source, now: u64) -> Outcome<N, D> {
        let validity = self.validity();
        self.plan.shift(now, validity);
        self.unposed(source, now)
    }

    /// Twist that leaves the surface at the retreat speed, as an offset to the last ṗ0.
    fn open_loop_retreat(&self, twist_reference: &SVector<f64, D>) -> SVector<f64, D> {
        self.parameters.environment.normal * self.parameters.stopping.retreat_speed - twist_reference
    }

    /// [`Self::fall_back`] of a stop: one that stays without a solution leaves the surface open loop, since held on the spring it would
    /// never come to a low force.
    pub(crate) fn fall_back_while_stopping(&mut self, sample: &Sample<N, D>) -> Source {
        let is_exhausted = self.unsolved > self.parameters.timing.max_consecutive_fallbacks;
        let out = self.open_loop_retreat(&sample.twist_reference);
        if (self.planned && !is_exhausted) || !self.within_limits(&out) {
            return self.fall_back(sample);
        }
        self.counters.fallback += 1;
        self.set_plan(sample.stamp, out);
        Source::Retreat
    }

    /// The best offset there is without a solution: the last plan's for this instant; without a plan, what takes the
    /// component into the surface out of ṗ0.
    pub(crate) fn fall_back(&mut self, sample: &Sample<N, D>) -> Source {
        self.counters.fallback += 1;
        if self.planned {
            let validity = self.validity();
            self.plan.shift(sample.stamp, validity);
            return Source::Plan;
        }
        let environment = &self.parameters.environment;
        let inward = environment.outward_speed(&sample.twist_reference).min(0.0);
        self.set_plan(sample.stamp, environment.normal * -inward);
        Source::Retreat
    }
}
