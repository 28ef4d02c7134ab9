//! What is looked at before the law, and stops it: the contact that begins or is lost, the force where the limits or the model
//! say that it cannot be.

use crate::controller::{Controller, Pose};
use crate::mode::{Mode, StopReason};
use crate::parameters::{ContactPoint, ContactSign, Law, LowerBound};
use crate::qp::QpSolver;
use crate::sample::Sample;
use crate::stopping;

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// Which axes are in contact now, which have reached f_min, and where the surface is.
    pub(crate) fn follow_contact(&mut self, sample: &Sample<N, D>, pose: &Pose<N, D>) {
        let by_surface = (self.parameters.mpc.sign == ContactSign::Normal).then_some(&self.surface_signs);
        self.contact = self.contact.update(&self.parameters.thresholds, by_surface, &sample.wrench);
        for axis in 0..D {
            if let Some(sign) = self.contact.sign(axis) {
                self.reached[axis] |= sign * sample.wrench[axis] >= self.parameters.mpc.minimum_force[axis];
            }
        }
        if let ContactPoint::Detected { wrench_noise } = self.parameters.contact_point {
            let lag = self.wrench_lag();
            let environment = &mut self.parameters.environment;
            let in_contact = self.contact.is_any();
            self.detection.update(environment, sample, &pose.kinematics, in_contact, lag, wrench_noise);
        }
    }

    /// Axes that have been released have not reached f_min when they join again.
    pub(crate) fn forget_released(&mut self) {
        for axis in 0..D {
            self.reached[axis] &= self.contact.sign(axis).is_some();
        }
        if !self.contact.is_any() {
            self.deepest = [0.0; D];
            // What an earlier contact was like must not decide the last bits of the next one: a replay may begin between them.
            self.warm_start.forget();
        }
    }

    /// Whether the minimum force holds: contact that is lost now is lost against the law.
    pub(crate) fn should_keep_contact(&self, sample: &Sample<N, D>) -> bool {
        let mpc = &self.parameters.mpc;
        self.parameters.law == Law::Mpc
            && mpc.lower_bound == LowerBound::OnceReached
            && !stopping::is_outward(&self.parameters, &sample.twist_reference)
            && self.reached.contains(&true)
    }

    /// Why this sample's force stops the arm.
    pub(crate) fn guard(&mut self, sample: &Sample<N, D>, pose: &Pose<N, D>) -> Option<StopReason> {
        let guards = self.parameters.guards;
        let pressing = self.parameters.environment.pressing_force(&sample.wrench);
        let is_known = self.contact.is_any() || self.parameters.contact_point == ContactPoint::Configured;
        let force = self.parameters.environment.spring_force(&pose.kinematics.pose);
        let measured = (!is_known).then_some(pressing);
        self.expected.follow(sample.stamp, force.max(0.0), self.wrench_lag(), measured);
        if matches!(self.stop_reason, Some(StopReason::MeasuredForce | StopReason::ModelDisagrees)) {
            self.believe(pressing, force);
        }
        let (mpc, thresholds) = (&self.parameters.mpc, &self.parameters.thresholds);
        if let Some(beyond) = guards.force {
            let is_beyond =
                |axis: usize| thresholds.admittance[axis] && sample.wrench[axis].abs() > mpc.force_limit[axis] + beyond;
            if (0..D).any(is_beyond) {
                return Some(StopReason::MeasuredForce);
            }
        }
        // Friction may turn the sign of one axis, never that of the force along the normal.
        let felt = self.surface_signs.axes(&thresholds.admittance).map(|axis| thresholds.activation[axis]);
        let pulls = pressing < -felt.fold(f64::INFINITY, f64::min);
        if mpc.sign == ContactSign::Normal && self.mode == Mode::Free && pulls {
            return Some(StopReason::ModelDisagrees);
        }
        let is_off = guards.mismatch.is_some_and(|most| (pressing - self.expected.pressing).abs() > most);
        self.mismatches = if is_off && self.mode == Mode::Contact { self.mismatches + 1 } else { 0 };
        (self.mismatches > 0 && self.mismatches >= guards.mismatch_cycles).then_some(StopReason::ModelDisagrees)
    }

    /// Moves the contact point to where the measured pressing force says that it is: a stop that the model's error led to must
    /// not trust that model, which says that the spring presses with `force` (N, below 0 above the surface).
    fn believe(&mut self, pressing: f64, force: f64) {
        let environment = &mut self.parameters.environment;
        // At least what f̂ shows, which lags behind; then what it shows beyond what it should.
        let missing = if pressing > force { pressing - force } else { pressing - self.expected.pressing };
        environment.raise(missing / environment.normal_stiffness());
        (self.expected.pressing, self.expected.force) = (pressing, force + missing);
    }

    /// T_est of the axes that feel the surface, in s.
    fn wrench_lag(&self) -> f64 {
        let felt = self.surface_signs.axes(&self.parameters.thresholds.admittance).next().unwrap_or(0);
        self.parameters.wrench_time_constant[felt]
    }
}

/// The pressing force that f̂ should show: what the filter (6) makes of the spring at the measured poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Expected {
    /// N.
    pub(crate) pressing: f64,
    /// The spring's force at the last sample, N.
    force: f64,
    /// ns.
    stamp: u64,
}

impl Expected {
    pub(crate) fn nothing() -> Self {
        Self { pressing: 0.0, force: 0.0, stamp: 0 }
    }

    /// On to the sample stamped `stamp`, where the spring's `force` is known; or from the `measured` pressing force anew,
    /// where the surface is not known yet. The force counts as a straight line between samples.
    fn follow(&mut self, stamp: u64, force: f64, lag: f64, measured: Option<f64>) {
        let elapsed = stamp.saturating_sub(self.stamp) as f64 * 1e-9;
        self.pressing = match measured {
            Some(measured) => measured,
            None if lag > 0.0 && elapsed > 0.0 => {
                let left = libm::exp(-elapsed / lag);
                let by_end = 1.0 - (1.0 - left) * lag / elapsed;
                left * self.pressing + (1.0 - left) * self.force + by_end * (force - self.force)
            }
            None => force,
        };
        (self.force, self.stamp) = (force, stamp);
    }
}
