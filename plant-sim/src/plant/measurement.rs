//! The plant's output at the instant of a sample: the state as sensors see it, and the truth.

use admittance_client::Applied;
use ipc_types::{MAX_JOINTS, Motion, StateSample, TASK_AXES, TruthSample};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

use super::{Led, Plant};
use crate::environment::Contact;

/// What the shell measured about one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CycleTiming {
    /// From the stamp to the visible command, in ns; 0 = not seen.
    pub answer_time_ns: u64,
    /// By how much the state sample was published late, in ns.
    pub lateness_ns: u64,
}

/// The largest forces since the last sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peaks {
    normal_force: f64,
    force: Vector3<f64>,
}

impl Peaks {
    pub(super) fn of(contact: &Contact) -> Self {
        Self { normal_force: contact.normal_force, force: contact.force }
    }

    pub(super) fn add(&mut self, contact: &Contact) {
        self.normal_force = self.normal_force.max(contact.normal_force);
        for (peak, value) in self.force.iter_mut().zip(contact.force.iter()) {
            if value.abs() > peak.abs() {
                *peak = *value;
            }
        }
    }
}

impl<const N: usize, const D: usize> Plant<N, D> {
    /// Builds the sample of the current instant.
    pub(super) fn measure(&mut self) {
        let ((mut position, _), mut velocity) = (self.parameters.joints.shown(&self.joints), self.reported_velocity);
        let mut wrench = if self.delay_line.is_none() {
            *self.parameters.estimate.estimate()
        } else {
            self.delay_line.delayed(self.now_ns)
        };
        self.parameters.noise.add(&mut position, &mut velocity, &mut wrench);
        self.update_velocity_reference();
        if self.parameters.faults.repeats(self.index) && self.sequence > 1 {
            return;
        }
        self.sample = StateSample {
            sequence: self.sequence,
            stamp_ns: self.now_ns,
            boot_id: self.parameters.boot_id,
            applied_command_sequence: self.playback.applied_sequence(),
            joint_count: N as u32,
            wrench_valid: 1,
            drives_enabled: 1,
            plays_plan: 1,
            joint_position: pad(position.as_slice()),
            joint_velocity: pad(velocity.as_slice()),
            joint_position_reference: pad(self.position_reference.as_slice()),
            twist_reference: pad(self.twist_reference().as_slice()),
            wrench: self.parameters.sensor.map_or_else(
                || pad(wrench.as_slice()),
                |sensor| {
                    let at_tcp = pad::<TASK_AXES>(wrench.as_slice());
                    sensor.reading(&at_tcp.into(), &self.kinematics.pose.rotation).into()
                },
            ),
            joint_torque: self.parameters.joints.torque().map_or([0.0; MAX_JOINTS], |torque| pad(torque.as_slice())),
            torque_valid: u32::from(self.parameters.joints.torque().is_some()),
            follows_joint_velocity: u32::from(self.parameters.follows_joint_velocity),
            joint_velocity_reference: pad(self.velocity_reference.as_slice()),
        };
        self.parameters.faults.falsify(&mut self.sample, self.index, self.parameters.sampling_time_ns);
    }

    pub(super) fn truth(&mut self, led: &Led) -> TruthSample {
        let pose = &self.kinematics.pose;
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.rotation));
        let (motion, offset) = match led.applied {
            Applied::Offset(offset) => (Motion::Offset, offset),
            Applied::Hold => (Motion::Hold, [0.0; TASK_AXES]),
        };
        let truth = TruthSample {
            sequence: self.sequence,
            stamp_ns: self.now_ns,
            boot_id: self.parameters.boot_id,
            answer_time_ns: led.timing.answer_time_ns,
            missed_commands: led.missed_commands,
            lateness_ns: led.timing.lateness_ns,
            in_contact: u32::from(self.contact.touches),
            contact_losses: self.contact_losses,
            motion: motion.code(),
            missed: u32::from(led.missed),
            scenario_time_s: self.scenario_time_s(),
            normal_force_n: self.contact.normal_force,
            penetration_m: self.contact.penetration,
            peak_normal_force_n: self.peaks.normal_force,
            joint_position: pad(self.joints.position.as_slice()),
            joint_velocity: pad(self.joints.velocity.as_slice()),
            tcp_position: pose.position.into(),
            tcp_rotation: rotation.scaled_axis().into(),
            tcp_twist: (self.kinematics.jacobian * self.joints.velocity).into(),
            wrench: pad(self.contact.force.as_slice()),
            peak_wrench: pad(self.peaks.force.as_slice()),
            velocity_offset: pad(&offset[..D]),
        };
        self.peaks = Peaks::of(&self.contact);
        truth
    }
}

fn pad<const LENGTH: usize>(values: &[f64]) -> [f64; LENGTH] {
    const { assert!(LENGTH == TASK_AXES || LENGTH == MAX_JOINTS) };
    std::array::from_fn(|index| values.get(index).copied().unwrap_or(0.0))
}
