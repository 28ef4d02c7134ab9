//! What free motion shows of friction and masses: by which shares they are other than told.
//!
//! In the air nothing presses, and what the observer still shows as a wrench is what the torques of friction
//! and weights are off by: r = F φ + W μ, with F the told friction of each joint, W the told weight of each link
//! as the joints feel it, and φ, μ the shares. They are learned by a Kalman filter, with what is told as
//! their prior: no share leaves three of its deviations. A share learned at one speed holds for another, and for
//! a joint that turns round.

use nalgebra::{SMatrix, SVector};

use crate::robot::JointFriction;

/// Deviations of what was told that a share is within.
const MOST: f64 = 3.0;
/// A residual beyond so many deviations is no friction: something presses, unseen.
const STRANGE: f64 = 3.0;
/// In so many seconds friction may have become any that was told to be likely: it warms up.
const FORGOTTEN: f64 = 300.0;

/// What the torques of a sample are made of, or were within the lag of f̂.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Regressors<const N: usize> {
    /// Told friction, N m.
    pub(super) friction: SVector<f64, N>,
    /// Told weights, one link a column, N m.
    pub(super) weights: SMatrix<f64, N, N>,
}

impl<const N: usize> Regressors<N> {
    /// On to those of a sample, of which this share is left after the lag.
    pub(super) fn lagged(&self, now: &Self, left: f64) -> Self {
        Self {
            friction: now.friction + (self.friction - now.friction) * left,
            weights: now.weights + (self.weights - now.weights) * left,
        }
    }
}

/// The shares, and how sure they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shares<const N: usize> {
    friction: SVector<f64, N>,
    masses: SVector<f64, N>,
    /// Covariance of friction, of friction with masses, and of masses.
    of_friction: SMatrix<f64, N, N>,
    shared: SMatrix<f64, N, N>,
    of_masses: SMatrix<f64, N, N>,
}

impl<const N: usize> Shares<N> {
    /// What is told, within its tolerances.
    pub(super) fn told(friction: &[JointFriction; N], mass_tolerance: f64) -> Self {
        let of = |joint: usize| friction[joint].tolerance * friction[joint].tolerance;
        Self {
            friction: SVector::zeros(),
            masses: SVector::zeros(),
            of_friction: SMatrix::from_diagonal(&SVector::from_fn(|joint, _| of(joint))),
            shared: SMatrix::zeros(),
            of_masses: SMatrix::from_diagonal_element(mass_tolerance * mass_tolerance),
        }
    }

    /// The torques beyond those that are told, N m.
    pub(super) fn torque(&self, of: &Regressors<N>) -> SVector<f64, N> {
        of.friction.component_mul(&self.friction) + of.weights * self.masses
    }

    /// Their covariance, (N m)².
    pub(super) fn covariance(&self, of: &Regressors<N>) -> SMatrix<f64, N, N> {
        let friction = SMatrix::from_diagonal(&of.friction);
        let cross = friction * self.shared * of.weights.transpose();
        friction * self.of_friction * friction
            + cross
            + cross.transpose()
            + of.weights * self.of_masses * of.weights.transpose()
    }

    /// Learns from the torques that a sample in the air leaves unexplained, N m, each with a variance of
    /// what is neither friction nor weight; `elapsed` s after the one before.
    pub(super) fn learn(
        &mut self,
        of: &Regressors<N>,
        left: &SVector<f64, N>,
        variance: &SVector<f64, N>,
        prior: &Self,
        elapsed: f64,
    ) {
        let share = (elapsed / FORGOTTEN).min(1.0);
        let before = (self.friction, self.masses);
        self.of_friction += (prior.of_friction - self.of_friction) * share;
        self.of_masses += (prior.of_masses - self.of_masses) * share;
        self.shared -= self.shared * share;
        for joint in 0..N {
            let by_friction = of.friction[joint];
            let by_masses = of.weights.row(joint).transpose();
            let with_friction = self.of_friction.column(joint) * by_friction + self.shared * by_masses;
            let with_masses = self.shared.row(joint).transpose() * by_friction + self.of_masses * by_masses;
            let expected = by_friction * with_friction[joint] + by_masses.dot(&with_masses);
            let all = expected + variance[joint];
            // Less what the joints before this one have just explained of it.
            let learned = by_friction * (self.friction - before.0)[joint] + by_masses.dot(&(self.masses - before.1));
            let left = left[joint] - learned;
            if !(all > 0.0 && left * left <= STRANGE * STRANGE * all) {
                continue;
            }
            self.friction += with_friction * (left / all);
            self.masses += with_masses * (left / all);
            self.of_friction -= with_friction * with_friction.transpose() / all;
            self.shared -= with_friction * with_masses.transpose() / all;
            self.of_masses -= with_masses * with_masses.transpose() / all;
        }
        for joint in 0..N {
            let within = |value: f64, variance: f64| {
                let most = MOST * libm::sqrt(variance);
                value.clamp(-most, most)
            };
            self.friction[joint] = within(self.friction[joint], prior.of_friction[(joint, joint)]);
            self.masses[joint] = within(self.masses[joint], prior.of_masses[(joint, joint)]);
        }
    }
}
