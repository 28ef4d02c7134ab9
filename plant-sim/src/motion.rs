//! The commanded motion: a list of phases of constant TCP velocity ṗ0, and the joint position q0
//! that follows them.

use admittance_core::robot::{Chain, Singular};
use nalgebra::SVector;

/// Smallest reciprocal condition number (Frobenius norm) at which the plant still inverts J. Far
/// below any pose that a scenario uses: it tells a singular arm from a merely awkward one.
pub const MINIMUM_RECIPROCAL_CONDITION: f64 = 1e-4;

/// Phases of constant commanded velocity, in whole samples from the start of the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandedMotion<const D: usize> {
    /// First sample after each phase, and the phase's twist in m/s and rad/s.
    phases: Vec<(i64, SVector<f64, D>)>,
}

impl<const D: usize> CommandedMotion<D> {
    /// Phases of so many samples each.
    pub fn new(phases: impl IntoIterator<Item = (i64, SVector<f64, D>)>) -> Self {
        let mut end = 0;
        let phases = phases.into_iter().map(|(samples, twist)| {
            end += samples;
            (end, twist)
        });
        Self { phases: phases.collect() }
    }

    /// ṗ0 from the sample with this index (0 = start of the motion) to the next; zero before and
    /// after the motion.
    pub fn twist(&self, index: i64) -> SVector<f64, D> {
        if index < 0 {
            return SVector::zeros();
        }
        self.phases.iter().find(|(end, _)| index < *end).map_or_else(SVector::zeros, |(_, twist)| *twist)
    }

    /// Number of samples that the motion lasts.
    pub fn samples(&self) -> i64 {
        self.phases.last().map_or(0, |(end, _)| *end)
    }
}

/// Joint velocity J⁻¹(q) ṗ in rad/s or m/s for a TCP velocity ṗ.
///
/// # Errors
/// [`Singular`] when J(q) has no inverse that can be trusted.
pub fn joint_velocity<const N: usize, const D: usize>(
    chain: &Chain<N>,
    position: &SVector<f64, N>,
    twist: &SVector<f64, D>,
) -> Result<SVector<f64, N>, Singular> {
    let inverse = chain.kinematics(position).inverse::<D>(MINIMUM_RECIPROCAL_CONDITION)?;
    Ok(inverse.joint_velocity(twist))
}

/// q0 after `duration_s` of the commanded velocity: q̇0 = J⁻¹(q0) ṗ0 by one step of the classic
/// Runge-Kutta method.
///
/// # Errors
/// [`Singular`] when the command passes through a singular pose.
pub fn advance_reference<const N: usize, const D: usize>(
    chain: &Chain<N>,
    position: &SVector<f64, N>,
    twist: &SVector<f64, D>,
    duration_s: f64,
) -> Result<SVector<f64, N>, Singular> {
    if twist.iter().all(|value| *value == 0.0) {
        return Ok(*position);
    }
    let half = 0.5 * duration_s;
    let first = joint_velocity(chain, position, twist)?;
    let second = joint_velocity(chain, &(position + first * half), twist)?;
    let third = joint_velocity(chain, &(position + second * half), twist)?;
    let fourth = joint_velocity(chain, &(position + third * duration_s), twist)?;
    Ok(position + (first + (second + third) * 2.0 + fourth) * (duration_s / 6.0))
}
