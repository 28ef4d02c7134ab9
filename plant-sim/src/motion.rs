//! The commanded motion: a list of phases of constant TCP velocity ṗ0, and the joint position q0
//! that follows them.

use admittance_core::robot::{Chain, Singular};
use nalgebra::SVector;

/// Smallest reciprocal condition number (Frobenius norm) at which the plant still inverts J. Far
/// below any pose that a scenario uses: it tells a singular arm from a merely awkward one.
pub const MINIMUM_RECIPROCAL_CONDITION: f64 = 1e-4;

/// What is commanded in a phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Commanded<const N: usize, const D: usize> {
    /// ṗ0 in m/s and rad/s.
    pub twist: SVector<f64, D>,
    /// Joint velocity in rad/s or m/s of which the part counts that leaves the TCP where it is.
    pub beside: SVector<f64, N>,
}

/// Phases of constant commanded velocity, in whole samples from the start of the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct CommandedMotion<const N: usize, const D: usize> {
    /// First sample after each phase, and what is commanded in it.
    phases: Vec<(i64, Commanded<N, D>)>,
}

impl<const N: usize, const D: usize> CommandedMotion<N, D> {
    /// Phases of so many samples each.
    pub fn new(phases: impl IntoIterator<Item = (i64, Commanded<N, D>)>) -> Self {
        let mut end = 0;
        let phases = phases.into_iter().map(|(samples, commanded)| {
            end += samples;
            (end, commanded)
        });
        Self { phases: phases.collect() }
    }

    /// ṗ0 from the sample with this index (0 = start of the motion) to the next; zero before and
    /// after the motion.
    pub fn twist(&self, index: i64) -> SVector<f64, D> {
        self.at(index).map_or_else(SVector::zeros, |commanded| commanded.twist)
    }

    /// What is commanded beside it, likewise.
    pub fn beside(&self, index: i64) -> SVector<f64, N> {
        self.at(index).map_or_else(SVector::zeros, |commanded| commanded.beside)
    }

    fn at(&self, index: i64) -> Option<&Commanded<N, D>> {
        let phases = if index < 0 { &[] } else { &self.phases[..] };
        phases.iter().find(|(end, _)| index < *end).map(|(_, commanded)| commanded)
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

/// q̇0 at q0: J⁻¹(q0) ṗ0, and of `beside` (rad/s or m/s) the part that leaves the TCP where it is.
///
/// # Errors
/// [`Singular`] when J(q0) has no inverse that can be trusted.
pub fn commanded_joint_velocity<const N: usize, const D: usize>(
    chain: &Chain<N>,
    position: &SVector<f64, N>,
    twist: &SVector<f64, D>,
    beside: &SVector<f64, N>,
) -> Result<SVector<f64, N>, Singular> {
    if beside.iter().all(|value| *value == 0.0) {
        return joint_velocity(chain, position, twist);
    }
    let kinematics = chain.kinematics(position);
    let inverse = kinematics.inverse::<D>(MINIMUM_RECIPROCAL_CONDITION)?;
    Ok(inverse.joint_velocity(&(twist - kinematics.task_jacobian::<D>() * beside)) + beside)
}

/// q0 after `duration_s` of the commanded velocity: q̇0 of [`commanded_joint_velocity`] by one step of
/// the classic Runge-Kutta method.
///
/// # Errors
/// [`Singular`] when the command passes through a singular pose.
pub fn advance_reference<const N: usize, const D: usize>(
    chain: &Chain<N>,
    position: &SVector<f64, N>,
    twist: &SVector<f64, D>,
    beside: &SVector<f64, N>,
    duration_s: f64,
) -> Result<SVector<f64, N>, Singular> {
    if twist.iter().chain(beside).all(|value| *value == 0.0) {
        return Ok(*position);
    }
    let half = 0.5 * duration_s;
    let first = commanded_joint_velocity(chain, position, twist, beside)?;
    let second = commanded_joint_velocity(chain, &(position + first * half), twist, beside)?;
    let third = commanded_joint_velocity(chain, &(position + second * half), twist, beside)?;
    let fourth = commanded_joint_velocity(chain, &(position + third * duration_s), twist, beside)?;
    Ok(position + (first + (second + third) * 2.0 + fourth) * (duration_s / 6.0))
}
