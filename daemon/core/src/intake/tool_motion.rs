//! The tool's inertia in the given wrench. A sensor between flange and tool feels m a besides what
//! presses, a being the acceleration of the tool's centre of gravity, and shows it through the same
//! filter T_est. No acceleration is measured, and none is needed: of the velocity v, which follows
//! from q̇, the filter makes (v − LP(v)) / T_est of v̇, LP being the filter itself.
//!
//! The tool counts as a point mass. With the momenta per mass p = (v, r × v) about the TCP, r from
//! the TCP to the centre of gravity, the wrench that accelerates it is m (ṗ − (0, ṙ × v_TCP)).
//!
//! Some controllers report q̇ late, by a filter that nobody told of; when an arm brakes hard, m times
//! the acceleration that is missed looks like a force. So v is taken from q as well, whose
//! differences need no report, but see a jump of the acceleration a part of a cycle late. What both
//! show is force.

use nalgebra::{SVector, Vector3, Vector6};

use super::{Sample, Settings};
use crate::quantities::{Instant, Span, on_task_axes};
use crate::robot::Posture;
use crate::turn::Turn;

/// How the tool has moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ToolMotion<const N: usize, const D: usize> {
    seen: Option<Seen<N>>,
    /// With q̇ as it is reported.
    by_velocity: Moved<D>,
    /// With q̇ as the positions show it.
    by_position: Moved<D>,
}

/// The joints of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen<const N: usize> {
    boot_id: u64,
    stamp: Instant,
    /// q in rad.
    position: SVector<f64, N>,
    /// The mean q̇ since the sample before, in rad/s, and since when.
    mean: Option<(SVector<f64, N>, Span)>,
}

/// The motion by one of the two velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Moved<const D: usize> {
    /// p, on the task axes: m/s, then m²/s.
    momentum: SVector<f64, D>,
    /// ṙ × v_TCP on the rotational axes, m²/s².
    carried: SVector<f64, D>,
    /// What a tool of 1 kg adds to the wrench, as the filter shows it: m/s², then m²/s².
    felt: SVector<f64, D>,
}

impl<const N: usize, const D: usize> ToolMotion<N, D> {
    /// A tool that has not been accelerated for long.
    pub(super) fn steady() -> Self {
        Self::feeling(&Vector6::zeros())
    }

    /// A tool of which the filter still shows this acceleration, before any sample.
    pub(super) fn feeling(acceleration: &Vector6<f64>) -> Self {
        let felt = SVector::from_fn(|axis, _| acceleration[axis]);
        let moved = Moved { momentum: SVector::zeros(), carried: SVector::zeros(), felt };
        Self { seen: None, by_velocity: moved, by_position: moved }
    }

    /// After a sample taken in `posture`. Between samples p counts as a straight line; in another
    /// run of the motion controller, and after a pause, the tool counts as steady.
    pub(super) fn followed(&self, settings: &Settings<N, D>, sample: &Sample<N, D>, posture: &Posture<N, D>) -> Self {
        if settings.conditioning.tool_mass == 0.0 {
            return Self::steady();
        }
        let center = &settings.conditioning.tool_center_of_gravity;
        let at = |velocity: &SVector<f64, N>, felt| Moved::at(center, posture, velocity, felt);
        let first = |from: &Self| Self {
            seen: Some(Seen::first(sample)),
            by_velocity: at(&sample.joint_velocity, from.by_velocity.felt),
            by_position: at(&sample.joint_velocity, from.by_position.felt),
        };
        let Some(last) = &self.seen else { return first(self) };
        let elapsed = sample.stamp.since(last.stamp);
        if last.boot_id != sample.boot_id || elapsed > settings.timing.pause() {
            return first(&Self::steady());
        }
        if elapsed.seconds() <= 0.0 {
            return *self;
        }
        let (seen, by_position) = last.then(sample, elapsed);
        let lags = &settings.wrench_time_constant;
        let after = |last: &Moved<D>, velocity| at(velocity, last.felt).filtered(last, elapsed, lags);
        Self {
            seen: Some(seen),
            by_velocity: after(&self.by_velocity, &sample.joint_velocity),
            by_position: after(&self.by_position, &by_position),
        }
    }

    /// Goes over to the frame that a turn leads to.
    pub(super) fn turn(&mut self, turn: &Turn) {
        for Moved { momentum, carried, felt } in [&mut self.by_velocity, &mut self.by_position] {
            (*momentum, *carried, *felt) = (turn.twist(momentum), turn.twist(carried), turn.twist(felt));
        }
    }

    /// What a tool of 1 kg adds to the wrench: m/s², then m²/s².
    pub(super) fn felt(&self) -> &SVector<f64, D> {
        &self.by_velocity.felt
    }

    /// The same with velocities from the positions.
    pub(super) fn felt_by_position(&self) -> &SVector<f64, D> {
        &self.by_position.felt
    }
}

impl<const N: usize> Seen<N> {
    fn first<const D: usize>(sample: &Sample<N, D>) -> Self {
        Self { boot_id: sample.boot_id, stamp: sample.stamp, position: sample.joint_position, mean: None }
    }

    /// The next sample, and q̇ at it: the slope there of the parabola through the last three positions.
    fn then<const D: usize>(&self, sample: &Sample<N, D>, elapsed: Span) -> (Self, SVector<f64, N>) {
        let seconds = elapsed.seconds();
        let mean = (sample.joint_position - self.position) / seconds;
        let velocity =
            self.mean.map_or(mean, |(before, since)| mean + (mean - before) * (seconds / (seconds + since.seconds())));
        (Self { mean: Some((mean, elapsed)), ..Self::first(sample) }, velocity)
    }
}

impl<const D: usize> Moved<D> {
    /// `center`: the centre of gravity in the frame of the TCP, m; `velocity`: q̇ in rad/s.
    fn at<const N: usize>(
        center: &Vector3<f64>,
        posture: &Posture<N, D>,
        velocity: &SVector<f64, N>,
        felt: SVector<f64, D>,
    ) -> Self {
        let (linear, angular) = posture.velocity(velocity);
        let lever = posture.pose().rotation * center;
        let turning = angular.cross(&lever);
        let velocity = linear + turning;
        Self {
            momentum: on_task_axes(&velocity, &lever.cross(&velocity)),
            carried: on_task_axes(&Vector3::zeros(), &turning.cross(&linear)),
            felt,
        }
    }

    /// With what the filter shows so long after `last`; `lags`: T_est per axis in s.
    fn filtered(self, last: &Self, elapsed: Span, lags: &SVector<f64, D>) -> Self {
        let seconds = elapsed.seconds();
        let felt = SVector::from_fn(|axis, _| {
            let change = (self.momentum[axis] - last.momentum[axis]) / seconds;
            let force = change - 0.5 * (self.carried[axis] + last.carried[axis]);
            let left = if lags[axis] > 0.0 { libm::exp(-seconds / lags[axis]) } else { 0.0 };
            left * last.felt[axis] + (1.0 - left) * force
        });
        Self { felt, ..self }
    }
}
