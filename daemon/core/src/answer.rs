//! What a cycle answers once it is clear what to do: the offset of its instant from the plan, within the limits, with the pose that
//! it is meant for.

use nalgebra::SVector;

use crate::contact::Contact;
use crate::controller::{Controller, Pose};
use crate::feasibility::Verdict;
use crate::outcome::{Motion, Outcome, Source};
use crate::plan::nanoseconds;
use crate::qp::QpSolver;
use crate::robot::right_inverse;
use crate::sample::Sample;
use crate::stopping;

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// How long a command stays valid after it acts, in ns: its own cycle and the fallbacks that may follow.
    pub fn validity(&self) -> u64 {
        let timing = &self.parameters.timing;
        nanoseconds(timing.sampling_time * f64::from(1 + timing.max_consecutive_fallbacks))
    }

    pub(crate) fn idle(&mut self, sample: &Sample<N, D>) -> Outcome<N, D> {
        self.contact = Contact::none();
        self.set_plan(sample.stamp, SVector::zeros());
        let mut outcome = self.unposed(Source::None, sample.stamp);
        outcome.twist_command = sample.twist_reference;
        outcome
    }

    /// Held; but ṗ0 may move the arm out of the surface, slowly. A ṗ0 that the limits do not let slow down is held too.
    pub(crate) fn stopped(&mut self, sample: &Sample<N, D>) -> Outcome<N, D> {
        let kinematics = self.parameters.chain.kinematics(&sample.joint_position);
        let bound = self.parameters.minimum_reciprocal_condition;
        let inverse = right_inverse(&kinematics.task_jacobian::<D>(), bound);
        match (stopping::retreat_twist(&self.parameters, &sample.twist_reference), inverse) {
            (Some(twist), Ok(inverse))
                if sample.drives_enabled && self.within_limits(&(twist - sample.twist_reference)) =>
            {
                self.set_plan(sample.stamp, twist - sample.twist_reference);
                let outcome = self.outcome(Source::Retreat);
                self.finish(outcome, sample, &Pose { kinematics, inverse })
            }
            _ => self.hold(sample.stamp),
        }
    }

    /// Whether no limit would cut `offset`: a cut one does not lead where it was meant to.
    pub(crate) fn within_limits(&self, offset: &SVector<f64, D>) -> bool {
        offset.iter().zip(&self.parameters.limits.offset).all(|(offset, limit)| offset.abs() <= *limit)
    }

    pub(crate) fn hold(&mut self, stamp: u64) -> Outcome<N, D> {
        self.set_plan(stamp, SVector::zeros());
        let mut outcome = self.unposed(Source::None, stamp);
        outcome.motion = Motion::Hold;
        outcome
    }

    /// An outcome with the plan's offset for the instant `now`, at the last known pose: there is no usable sample.
    pub(crate) fn unposed(&mut self, source: Source, now: u64) -> Outcome<N, D> {
        let mut outcome = self.outcome(source);
        outcome.limited = self.plan.limit(&self.parameters.limits.offset);
        self.counters.limited += u64::from(outcome.limited);
        let offset = self.plan.at(now).unwrap_or_else(SVector::zeros);
        self.offset = offset;
        outcome.velocity_offset = offset;
        if let Some(last) = &self.last
            && offset.iter().any(|o| *o != 0.0)
        {
            outcome.twist_command = last.twist_reference + offset;
            let kinematics = self.parameters.chain.kinematics(&last.joint_position);
            let bound = self.parameters.minimum_reciprocal_condition;
            if let Ok(inverse) = right_inverse(&kinematics.task_jacobian::<D>(), bound) {
                outcome.joint_velocity_offset = inverse.joint_velocity(&offset);
            }
        }
        outcome
    }

    /// A plan of one step: `offset` as long as the command is valid.
    pub(crate) fn set_plan(&mut self, stamp: u64, offset: SVector<f64, D>) {
        let validity = self.validity();
        self.plan.restart(stamp);
        self.plan.push(offset, validity as f64 * 1e-9);
        self.planned = false;
    }

    pub(crate) fn outcome(&self, source: Source) -> Outcome<N, D> {
        Outcome {
            motion: Motion::Offset,
            mode: self.mode,
            source,
            verdict: Verdict::None,
            stop_reason: self.stop_reason,
            active_axes: self.contact.mask(),
            velocity_offset: SVector::zeros(),
            joint_velocity_offset: SVector::zeros(),
            twist_command: SVector::zeros(),
            fault: None,
            iterations: 0,
            expired_at: None,
            limited: false,
        }
    }

    /// Takes the offset of this sample from the plan, within the limits.
    pub(crate) fn finish(
        &mut self,
        mut outcome: Outcome<N, D>,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
    ) -> Outcome<N, D> {
        outcome.limited = self.plan.limit(&self.parameters.limits.offset);
        self.counters.limited += u64::from(outcome.limited);
        let offset = self.plan.at(sample.stamp).unwrap_or_else(SVector::zeros);
        self.offset = offset;
        outcome.mode = self.mode;
        outcome.stop_reason = self.stop_reason;
        outcome.velocity_offset = offset;
        outcome.joint_velocity_offset = pose.inverse.joint_velocity(&offset);
        outcome.twist_command = sample.twist_reference + offset;
        outcome
    }
}
