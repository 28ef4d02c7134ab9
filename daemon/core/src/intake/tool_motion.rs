//! The tool's inertia in the given wrench. A sensor between flange and tool feels m a besides what
//! presses, a being the acceleration of the tool's centre of gravity, and shows it through the same
//! filter T_est. No acceleration is measured, and none is needed: of the velocity v, which follows
//! from q̇, the filter makes (v − LP(v)) / T_est of v̇, LP being the filter itself.
//!
//! The tool counts as a point mass. With the momenta per mass p = (v, r × v) about the TCP, r from
//! the TCP to the centre of gravity, the wrench that accelerates it is m (ṗ − (0, ṙ × v_TCP)).

use nalgebra::{SVector, Vector3, Vector6};

use super::{Sample, Settings};
use crate::quantities::{Instant, on_task_axes};
use crate::robot::Posture;

/// How the tool has moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ToolMotion<const D: usize> {
    seen: Option<Seen<D>>,
    /// What a tool of 1 kg adds to the wrench, as the filter shows it: m/s², then m²/s².
    felt: SVector<f64, D>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen<const D: usize> {
    boot_id: u64,
    stamp: Instant,
    /// p, on the task axes: m/s, then m²/s.
    momentum: SVector<f64, D>,
    /// ṙ × v_TCP on the rotational axes, m²/s².
    carried: SVector<f64, D>,
}

impl<const D: usize> ToolMotion<D> {
    /// A tool that has not been accelerated for long.
    pub(super) fn steady() -> Self {
        Self { seen: None, felt: SVector::zeros() }
    }

    /// A tool of which the filter still shows this acceleration, before any sample.
    pub(super) fn feeling(acceleration: &Vector6<f64>) -> Self {
        Self { seen: None, felt: SVector::from_fn(|axis, _| acceleration[axis]) }
    }

    /// After a sample taken in `posture`. Between samples p counts as a straight line; in another
    /// run of the motion controller, and after a pause, the tool counts as steady.
    pub(super) fn followed<const N: usize>(
        &self,
        settings: &Settings<N, D>,
        sample: &Sample<N, D>,
        posture: &Posture<N, D>,
    ) -> Self {
        if settings.conditioning.tool_mass == 0.0 {
            return *self;
        }
        let now = Seen::of(&settings.conditioning.tool_center_of_gravity, sample, posture);
        let seen = Some(now);
        let Some(last) = &self.seen else { return Self { seen, ..*self } };
        let elapsed = now.stamp.since(last.stamp);
        if last.boot_id != now.boot_id || elapsed > settings.timing.pause() {
            return Self { seen, ..Self::steady() };
        }
        let seconds = elapsed.seconds();
        if seconds <= 0.0 {
            return *self;
        }
        let felt = SVector::from_fn(|axis, _| {
            let change = (now.momentum[axis] - last.momentum[axis]) / seconds;
            let force = change - 0.5 * (now.carried[axis] + last.carried[axis]);
            let lag = settings.wrench_time_constant[axis];
            let left = if lag > 0.0 { libm::exp(-seconds / lag) } else { 0.0 };
            left * self.felt[axis] + (1.0 - left) * force
        });
        Self { seen, felt }
    }

    /// What a tool of 1 kg adds to the wrench: m/s², then m²/s².
    pub(super) fn felt(&self) -> &SVector<f64, D> {
        &self.felt
    }
}

impl<const D: usize> Seen<D> {
    /// `center`: the centre of gravity in the frame of the TCP, m.
    fn of<const N: usize>(center: &Vector3<f64>, sample: &Sample<N, D>, posture: &Posture<N, D>) -> Self {
        let (linear, angular) = posture.velocity(&sample.joint_velocity);
        let lever = posture.pose().rotation * center;
        let turning = angular.cross(&lever);
        let velocity = linear + turning;
        Self {
            boot_id: sample.boot_id,
            stamp: sample.stamp,
            momentum: on_task_axes(&velocity, &lever.cross(&velocity)),
            carried: on_task_axes(&Vector3::zeros(), &turning.cross(&linear)),
        }
    }
}
