//! The parameters of a plant.

use admittance_client::Drives;
use admittance_core::robot::Chain;
use nalgebra::SVector;

use crate::environment::Surface;
use crate::faults::Faults;
use crate::joints::Joints;
use crate::motion::CommandedMotion;
use crate::noise::Noise;
use crate::wrench_estimate::WrenchEstimate;
use crate::wrench_sensor::WrenchSensor;

/// The parameters of a plant of N joints and D task axes.
#[derive(Debug, Clone)]
pub struct PlantParameters<const N: usize, const D: usize> {
    /// Kinematics of the arm.
    pub chain: Chain<N>,
    /// What the joints are.
    pub joints: Joints<N>,
    /// How long a reference takes to reach each loop, in ns.
    pub dead_time_ns: [u64; N],
    /// Time constant of the lag with which q̇ is reported, in s; 0 = none.
    pub velocity_lag_s: f64,
    /// What the drives take; `None` is any reference.
    pub drives: Option<Drives>,
    /// Joint position at the start, in rad; the arm is at rest.
    pub start: SVector<f64, N>,
    /// What the TCP may touch; `None` is free space.
    pub surface: Option<Surface>,
    /// Wrench estimate (6), at rest.
    pub estimate: WrenchEstimate<D>,
    /// The sensor that reports the estimate; `None` reports it unchanged.
    pub sensor: Option<WrenchSensor>,
    /// Pure delay of the estimate, in ns.
    pub wrench_delay_ns: u64,
    /// Sensor noise.
    pub noise: Noise,
    /// Commanded motion.
    pub motion: CommandedMotion<N, D>,
    /// Whether the joints follow their commanded velocity and what the daemon adds to it, instead of a
    /// twist.
    pub follows_joint_velocity: bool,
    /// Scripted faults.
    pub faults: Faults,
    /// T_s in ns.
    pub sampling_time_ns: u64,
    /// When the command of a sample acts, in ns after the sample's stamp.
    pub command_delay_ns: u64,
    /// Longest interval in ns over which the contact force is taken to be a straight line.
    pub substep_ns: u64,
    /// Samples at rest before the motion starts.
    pub settle_samples: i64,
    /// Whether the motion waits for the first valid command, and the settling counts from there.
    pub wait_for_command: bool,
    /// Stamp of the first sample, in ns.
    pub first_stamp_ns: u64,
    /// Boot id of the samples, not 0.
    pub boot_id: u64,
}

impl<const N: usize, const D: usize> PlantParameters<N, D> {
    /// Samples before the motion; a motion that waits for a command needs at least one.
    pub(super) fn waiting_samples(&self) -> i64 {
        self.settle_samples.max(i64::from(self.wait_for_command))
    }
}
