//! A state sample as the motion controller gives it, what can be wrong with it, and its form once
//! the law may use it.

use admittance_vocabulary::FaultName;
use nalgebra::{SMatrix, SVector};

use super::{Arrival, band};
use crate::quantities::{AXIS_NAMES, GivenWrench, Instant, Span, wrench_unit};
use crate::robot::{Chain, JointKind, Posture};
use crate::turn::Turn;

/// A state sample of the motion controller, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<const N: usize, const D: usize> {
    /// Counts up by one per sample.
    pub sequence: u64,
    /// Instant of measurement.
    pub stamp: Instant,
    /// Run of the motion controller; another value means that it restarted.
    pub boot_id: u64,
    /// Number of joints in the sender's arrays; must be N.
    pub joint_count: u32,
    /// Whether the sender marks `wrench` as valid.
    pub wrench_valid: bool,
    /// Whether the drives follow the reference.
    pub drives_enabled: bool,
    /// q in rad.
    pub joint_position: SVector<f64, N>,
    /// q̇ in rad/s.
    pub joint_velocity: SVector<f64, N>,
    /// q0 in rad: commanded joint position, advancing with the command whatever the offset does.
    pub joint_position_reference: SVector<f64, N>,
    /// q̇0 in rad/s or m/s: commanded joint velocity, to which the sender's joints add what the law tells
    /// them; `None` of one that resolves ṗ0 + Δṗ itself, by the least norm.
    pub joint_velocity_reference: Option<SVector<f64, N>>,
    /// ṗ0 in m/s and rad/s, base frame.
    pub twist_reference: SVector<f64, D>,
    /// The wrench as it is given.
    pub wrench: GivenWrench,
    /// Whether the sender marks `joint_torque` as valid.
    pub torque_valid: bool,
    /// τ of the motors in N m, on the joints' side of the gears; friction and rotors are still in it.
    pub joint_torque: SVector<f64, N>,
}

/// A sample that the law may use, with everything that follows from it alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Accepted<const N: usize, const D: usize> {
    /// Instant of measurement.
    pub stamp: Instant,
    /// How it follows the previously accepted sample.
    pub arrival: Arrival,
    /// Whether the samples come at another rate than the configured one.
    pub is_rate_wrong: bool,
    /// Whether the drives follow the reference.
    pub drives_enabled: bool,
    /// q in rad.
    pub joint_position: SVector<f64, N>,
    /// q̇ in rad/s.
    pub joint_velocity: SVector<f64, N>,
    /// q0 in rad.
    pub joint_position_reference: SVector<f64, N>,
    /// q̇0 in rad/s or m/s, where the joints follow it.
    pub joint_velocity_reference: Option<SVector<f64, N>>,
    /// ṗ0 in m/s and rad/s, base frame.
    pub twist_reference: SVector<f64, D>,
    /// f̂ in N and N·m: what the robot exerts on the environment, base frame, at the TCP.
    pub wrench: SVector<f64, D>,
    /// The same with the tool's inertia as the joint positions show it, not q̇.
    pub wrench_by_position: SVector<f64, D>,
    /// What of f̂ may be the tool's inertia, with the sign of what was taken for that, N and N·m: as much of it as T_est may be
    /// off by.
    pub feigned_wrench: SVector<f64, D>,
    /// Covariance of f̂ in products of N and N·m, as motor torques show it; zero of a wrench that is
    /// given.
    pub wrench_covariance: SMatrix<f64, D, D>,
    /// Ψ, J and J⁻¹ at q.
    pub posture: Posture<N, D>,
}

impl<const N: usize, const D: usize> Accepted<N, D> {
    /// What f̂ may be off by per axis in N and N·m: the band of motor torques, or what the tool's inertia may feign.
    pub(crate) fn unsure(&self) -> SVector<f64, D> {
        self.torque_band() + self.feigned_wrench.abs()
    }

    /// What f̂ from motor torques may be off by per axis in N and N·m; zero of a wrench that is given.
    pub(crate) fn torque_band(&self) -> SVector<f64, D> {
        SVector::from_fn(|axis, _| band(&self.wrench_covariance, axis))
    }

    /// Goes over to the frame that a turn leads to; `chain` is the arm in it.
    pub(crate) fn turn(&mut self, chain: &Chain<N>, turn: &Turn) {
        let Self { twist_reference, wrench, wrench_by_position, feigned_wrench, .. } = self;
        for vector in [twist_reference, wrench, wrench_by_position, feigned_wrench] {
            *vector = turn.twist(vector);
        }
        self.wrench_covariance = turn.matrix(&self.wrench_covariance);
        self.posture = Posture::new(chain, &self.joint_position);
    }
}

/// A vector of the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// q.
    JointPosition,
    /// q̇.
    JointVelocity,
    /// q0.
    JointPositionReference,
    /// q̇0.
    JointVelocityReference,
    /// ṗ0.
    TwistReference,
    /// f̂.
    Wrench,
    /// τ.
    JointTorque,
}

impl Field {
    /// The field's name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::JointPosition => "joint_position",
            Self::JointVelocity => "joint_velocity",
            Self::JointPositionReference => "joint_position_reference",
            Self::JointVelocityReference => "joint_velocity_reference",
            Self::TwistReference => "twist_reference",
            Self::Wrench => "wrench",
            Self::JointTorque => "joint_torque",
        }
    }

    /// Whether every value is finite and plausible for an arm.
    pub(super) fn check(self, values: &[f64]) -> Result<(), SampleFault> {
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return Err(SampleFault::NotFinite { field: self, index });
        }
        let implausible = values.iter().position(|value| value.abs() > LARGEST_VALUE);
        implausible.map_or(Ok(()), |index| Err(SampleFault::Implausible { field: self, index }))
    }
}

/// Largest magnitude of a value in its SI unit.
const LARGEST_VALUE: f64 = 1e6;

impl<const N: usize, const D: usize> Sample<N, D> {
    pub(super) fn check_joint_count(&self) -> Result<(), SampleFault> {
        let (found, expected) = (self.joint_count, N as u32);
        if found == expected { Ok(()) } else { Err(SampleFault::JointCount { found, expected }) }
    }

    /// Checks everything but the wrench.
    pub(super) fn check_motion(&self) -> Result<(), SampleFault> {
        Field::JointPosition.check(self.joint_position.as_slice())?;
        Field::JointVelocity.check(self.joint_velocity.as_slice())?;
        Field::JointPositionReference.check(self.joint_position_reference.as_slice())?;
        if let Some(reference) = &self.joint_velocity_reference {
            Field::JointVelocityReference.check(reference.as_slice())?;
        }
        Field::TwistReference.check(self.twist_reference.as_slice())
    }

    /// Whether the sender's joints follow what the law resolves.
    pub(super) fn check_following(&self) -> Result<(), SampleFault> {
        self.joint_velocity_reference.map_or(Err(SampleFault::NotFollowing), |_| Ok(()))
    }

    /// Checks f̂ as it follows from the given wrench, of which a component may be `saturated`.
    pub(super) fn check_wrench(&self, wrench: &SVector<f64, D>, saturated: Option<usize>) -> Result<(), SampleFault> {
        Field::Wrench.check(wrench.as_slice())?;
        if !self.wrench_valid {
            return Err(SampleFault::WrenchInvalid);
        }
        saturated.map_or(Ok(()), |index| Err(SampleFault::WrenchSaturated { index }))
    }

    /// Checks the torques of the motors.
    pub(super) fn check_torque(&self) -> Result<(), SampleFault> {
        if !self.torque_valid {
            return Err(SampleFault::TorqueInvalid);
        }
        Field::JointTorque.check(self.joint_torque.as_slice())
    }
}

/// Why a sample never reaches the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SampleFault {
    /// Another number of joints than N.
    JointCount {
        /// The number in the sample.
        found: u32,
        /// N.
        expected: u32,
    },
    /// A value is NaN or infinite.
    NotFinite {
        /// The field.
        field: Field,
        /// Index in the field, from 0.
        index: usize,
    },
    /// A value exceeds 1e6 (rad, m, N and so on), more than any arm has. Results computed from it
    /// would overflow or lose precision.
    Implausible {
        /// The field.
        field: Field,
        /// Index in the field, from 0.
        index: usize,
    },
    /// The law is to resolve redundancy, and the sender's joints don't follow what it resolves.
    NotFollowing,
    /// The sender marks the wrench as invalid.
    WrenchInvalid,
    /// The sender marks the torques as invalid that the wrench is to follow from.
    TorqueInvalid,
    /// The torques show the wrench too badly: near a singular pose, or by their friction.
    WrenchUnseen {
        /// Task axis, from 0.
        axis: usize,
        /// Standard deviation of f̂ on it in N or N·m; infinite where J has no inverse.
        deviation: f64,
    },
    /// The wrench is at the end of the sensor's range: the real one may be larger.
    WrenchSaturated {
        /// Component of the given wrench, from 0.
        index: usize,
    },
    /// Older than allowed.
    Stale {
        /// Its age.
        age: Span,
    },
    /// Stamped more than one T_s ahead.
    FromFuture {
        /// How far ahead.
        ahead: Span,
    },
    /// Its sequence is 0: samples count from 1.
    Unnumbered,
    /// Its sequence or stamp is not later than the last one's.
    OutOfOrder {
        /// Its sequence.
        sequence: u64,
        /// The last accepted one.
        last: u64,
    },
    /// A joint is not where it can have moved since the sample before.
    Jump {
        /// The joint, from 0.
        joint: usize,
        /// By how much it is off, in rad or m.
        off: f64,
        /// The most that it can have moved, in rad or m.
        most: f64,
        /// Which of the two.
        kind: JointKind,
    },
    /// There was no sample at all for longer than allowed.
    Silence,
}

impl SampleFault {
    /// Its name.
    pub fn name(&self) -> FaultName {
        match self {
            Self::JointCount { .. } => FaultName::JointCount,
            Self::NotFinite { .. } => FaultName::NotFinite,
            Self::Implausible { .. } => FaultName::Implausible,
            Self::NotFollowing => FaultName::NotFollowing,
            Self::WrenchInvalid | Self::TorqueInvalid | Self::WrenchUnseen { .. } => FaultName::WrenchInvalid,
            Self::WrenchSaturated { .. } => FaultName::WrenchSaturated,
            Self::Stale { .. } => FaultName::Stale,
            Self::FromFuture { .. } => FaultName::FromFuture,
            Self::Unnumbered => FaultName::Unnumbered,
            Self::OutOfOrder { .. } => FaultName::OutOfOrder,
            Self::Jump { .. } => FaultName::Jump,
            Self::Silence => FaultName::Silence,
        }
    }
}

impl core::fmt::Display for SampleFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::JointCount { found, expected } => {
                write!(f, "joint_count = {found}: this daemon is configured for {expected} joints")
            }
            Self::NotFinite { field, index } => write!(f, "{}[{index}] is not finite", field.name()),
            Self::Implausible { field, index } => {
                write!(f, "{}[{index}] is beyond ±{LARGEST_VALUE:e}, larger than any arm's", field.name())
            }
            Self::NotFollowing => f.write_str(
                "follows_joint_velocity = 0: with [redundancy] the motion controller must give joint_velocity_reference and \
                 let its joints add joint_velocity_offset to it",
            ),
            Self::WrenchInvalid => f.write_str("wrench_valid = 0: the motion controller marks its wrench as invalid"),
            Self::TorqueInvalid => f.write_str(
                "torque_valid = 0: the motion controller marks its torques as invalid, and wrench.source = \"motor_torque\" \
                 has no other wrench",
            ),
            Self::WrenchUnseen { axis, deviation } => write!(
                f,
                "the torques do not show the wrench on axis {}: standard deviation {deviation:.1} {}, accepted: at most a \
                 third of contact.force_limit; J is nearly singular, or friction and masses are told too vaguely",
                AXIS_NAMES[*axis],
                wrench_unit(*axis)
            ),
            Self::WrenchSaturated { index } => {
                write!(f, "wrench[{index}] is at the end of the sensor's range, wrench.saturation")
            }
            Self::Stale { age } => write!(f, "stamp_ns is {} ns old, older than max_sample_age_s", age.nanoseconds()),
            Self::FromFuture { ahead } => {
                write!(
                    f,
                    "stamp_ns is {} ns ahead of CLOCK_MONOTONIC, more than one sampling time",
                    ahead.nanoseconds()
                )
            }
            Self::Unnumbered => f.write_str(
                "sequence = 0: the motion controller must number its samples, from 1, one more with every sample",
            ),
            Self::OutOfOrder { sequence, last } => {
                write!(f, "sequence {sequence} or its stamp does not follow the last accepted sample {last}")
            }
            Self::Jump { joint, off, most, kind } => write!(
                f,
                "joint_position[{joint}] jumped by {off:.4} {unit}, accepted: at most {most:.4} {unit} since the sample before \
                 (twice limits.joint_speed_rad_s, 20 {unit}/s without it)",
                unit = kind.unit()
            ),
            Self::Silence => f.write_str("no sample for longer than max_sample_age_s"),
        }
    }
}
