//! A plant that a motion controller of another program leads: commands, and when they act, are its business.

use admittance_client::{Applied, Rotation};
use ipc_types::{MAX_JOINTS, TASK_AXES, TruthSample};
use nalgebra::SVector;

use super::{CycleTiming, Plant};
use crate::faults::FaultKind;

/// What the leading controller says about the current cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Led {
    /// Of publishing and answering.
    pub timing: CycleTiming,
    /// What the joints follow at the instant of the sample.
    pub applied: Applied,
    /// Whether a command that is due within this cycle is missing.
    pub missed: bool,
    /// Commands that were missed so far.
    pub missed_commands: u64,
}

impl<const N: usize, const D: usize> Plant<N, D> {
    /// Another program leads the arm so from the next sample on: ṗ0 in m/s and rad/s, base frame. Before the motion begins
    /// and after it the arm stands all the same.
    pub fn lead(&mut self, twist: &[f64; TASK_AXES]) {
        let next = SVector::from_fn(|axis, _| twist[axis]);
        let now = self.lead.map_or_else(SVector::zeros, |[now, _]| now);
        self.lead = Some([now, next]);
    }

    /// Axes of the tool's frame in the base frame, as columns.
    pub fn tool_axes(&self) -> Rotation {
        let rotation = self.kinematics.pose.rotation;
        std::array::from_fn(|column| std::array::from_fn(|row| rotation[(row, column)]))
    }

    /// When the cycle of the current sample ends, in ns.
    pub fn cycle_end_ns(&self) -> u64 {
        self.began_ns + self.cycle_ns()
    }

    /// Whether the controller can see commands at the current sample: a fault may hide them.
    pub fn shows_commands(&self) -> bool {
        !self.fault(FaultKind::CommandLoss)
    }

    /// The truth at the instant of the current sample; call it before [`Self::follow`].
    pub fn led_truth(&mut self, led: &Led) -> TruthSample {
        self.truth(led)
    }

    /// The joints follow this from here to `until_ns`, at most to the end of the cycle.
    pub fn follow(&mut self, applied: &Applied, until_ns: u64) {
        let twist = self.twist_reference();
        let reference = self.reference_of(applied, &twist);
        self.dead_time.push(self.now_ns, &reference);
        self.integrate_until(until_ns.min(self.cycle_end_ns()), self.began_ns);
    }

    /// The joints follow these speeds in rad/s or m/s, whatever the commanded motion, from here to `until_ns`, at most to
    /// the end of the cycle.
    pub fn follow_joints(&mut self, speeds: &[f64; MAX_JOINTS], until_ns: u64) {
        let is_braked = self.fault(FaultKind::DrivesDisabled);
        let reference = SVector::from_fn(|joint, _| if is_braked { 0.0 } else { speeds[joint] });
        self.dead_time.push(self.now_ns, &reference);
        self.integrate_until(until_ns.min(self.cycle_end_ns()), self.began_ns);
    }

    /// Goes on to the next sample, when the joints were led to the end of the cycle. `has_received` says whether the
    /// controller ever had a command: the motion may wait for it.
    pub fn arrive(&mut self, has_received: bool) {
        let (twist, cycle_ns) = (self.twist_reference(), self.cycle_ns());
        self.enter_sample(has_received);
        self.lead_on(&twist, cycle_ns);
    }
}
