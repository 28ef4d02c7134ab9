//! f̂ from motor torques: the Kalman filter of Wahrburg et al., "Cartesian contact force estimation for
//! robotic manipulators using Kalman filters and the generalized momentum" (CASE 2015).
//!
//! With p = M q̇, the torques τ of the motors and those of friction τ_f, and f̂ that the robot exerts on
//! the environment: ṗ = τ − τ_f + Cᵀ q̇ − G − Jᵀ f̂. No acceleration is needed. The state is (p, f̂), f̂ a
//! random walk, and M q̇ is what is measured.
//!
//! How fast f̂ walks decides the filter's lag. The model (6) must know that lag, so it is the other way
//! round here. With P the covariance of p, a walk of J⁻ᵀ (Q + 2 P / T_est) J⁻¹ / T_est², Q being that of
//! the torques' noise, solves the filter's Riccati equation such that along every axis, at every pose, its
//! gain of p is T_est times that of f̂: the lag of f̂ is T_est, and its overshoot at most 4 %.
//!
//! What friction and masses are off by is no noise that a filter could average: it is in f̂ for as long
//! as it lasts. What of it free motion has taught ([`torque_learning`](super::torque_learning)) is taken out, and the
//! variance of the rest is added to the filter's.

use nalgebra::{SMatrix, SVector};

use super::torque_learning::{Regressors, Shares};
use super::{Sample, Settings};
use crate::quantities::Instant;
use crate::robot::{ArmDynamics, JointFriction, Posture, TaskAxes};
use crate::surface::Surface;

/// A tool so far above the surface presses on nothing, m.
const CLEAR: f64 = 0.01;
/// In so many lags of f̂ a force has faded from it.
const FADED: f64 = 5.0;

/// Share of J Jᵀ that keeps it invertible where J is not, far above rounding.
const LEAST_SEEN: f64 = 1e-9;

/// Standard deviations within which f̂ is. What friction and masses are off by stays as it is: it does
/// not come again and again, as noise does, until it has passed any band.
const BAND_DEVIATIONS: f64 = 3.0;

/// What f̂ of this covariance may be off by on an axis, N or N m: three standard deviations.
pub(crate) fn band<const D: usize>(covariance: &SMatrix<f64, D, D>, axis: usize) -> f64 {
    BAND_DEVIATIONS * libm::sqrt(covariance[(axis, axis)])
}

/// The same of the force along a direction, N.
pub(crate) fn band_along<const D: usize>(covariance: &SMatrix<f64, D, D>, direction: &SVector<f64, D>) -> f64 {
    BAND_DEVIATIONS * libm::sqrt(direction.dot(&(covariance * direction)).max(0.0))
}

/// What the observer knows of the arm, and how well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueModel<const N: usize> {
    /// The arm with its masses; all rotors are on their joints.
    pub dynamics: ArmDynamics<N>,
    /// Friction of the joints.
    pub friction: [JointFriction; N],
    /// Standard deviation of each link's mass, as a share of it.
    pub mass_tolerance: f64,
    /// Standard deviation of the torque that accelerates each joint, as a share of it.
    pub acceleration_tolerance: f64,
    /// Standard deviation of the noise of each torque in N m, above zero.
    pub torque_noise: SVector<f64, N>,
    /// Standard deviation of the noise of q̇ in rad/s, above zero.
    pub velocity_noise: f64,
}

/// f̂ and how sure it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate<const D: usize> {
    /// f̂ in N and N m: robot on environment, base frame, at the TCP.
    pub wrench: SVector<f64, D>,
    /// Its covariance, in products of N and N m: of the filter, and of friction and masses.
    pub covariance: SMatrix<f64, D, D>,
}

/// The filter after a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MomentumObserver<const N: usize, const D: usize> {
    boot_id: u64,
    stamp: Instant,
    /// τ − τ_f + Cᵀ q̇ − G at the sample, N m.
    drive: SVector<f64, N>,
    momentum: SVector<f64, N>,
    /// Variance of each joint's torque by what passes, now or within the lag, (N m)².
    passing: SVector<f64, N>,
    /// f̂ by friction and masses as they are told.
    told: SVector<f64, D>,
    estimate: Estimate<D>,
    learned: Learned<N>,
    /// Covariance of p, of p with f̂, and of f̂.
    variance: SMatrix<f64, N, N>,
    shared: SMatrix<f64, N, D>,
    force: SMatrix<f64, D, D>,
}

/// What a sample says.
struct Seen<const N: usize, const D: usize> {
    /// M q̇.
    momentum: SVector<f64, N>,
    /// Covariance of its noise.
    noise: SMatrix<f64, N, N>,
    drive: SVector<f64, N>,
    /// Jᵀ, and its inverse: what torques are as a wrench.
    to_torque: SMatrix<f64, N, D>,
    to_wrench: SMatrix<f64, D, N>,
    /// Variance of the torques' noise.
    torque: SVector<f64, N>,
    /// Friction and weights, as told.
    regressors: Regressors<N>,
    /// Variance of the torques by friction that is no share of what is told.
    stuck: SVector<f64, N>,
    acceleration_tolerance: f64,
    /// Whether the tool is well above the surface.
    is_clear: bool,
}

/// What free motion has taught.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Learned<const N: usize> {
    shares: Shares<N>,
    /// Of which f̂ shows what friction and masses are off by, with its lag.
    lagged: Regressors<N>,
    /// Since when the tool has been clear of the surface, s.
    clear: f64,
}

impl<const N: usize, const D: usize> Seen<N, D> {
    fn new(
        model: &TorqueModel<N>,
        sample: &Sample<N, D>,
        posture: &Posture<N, D>,
        surface: &Surface<D>,
        inverse: &SMatrix<f64, N, D>,
    ) -> Self {
        let here = model.dynamics.at(&sample.joint_position);
        let motion = here.momentum(&sample.joint_velocity);
        let weights = here.link_weights();
        let friction = |joint: usize| &model.friction[joint];
        let velocity = |joint: usize| sample.joint_velocity[joint];
        let rubbing = SVector::from_fn(|joint, _| friction(joint).torque(velocity(joint)));
        let stuck = SVector::from_fn(|joint, _| friction(joint).variance(velocity(joint), model.velocity_noise));
        let mass = here.mass_matrix();
        let to_wrench = inverse.transpose();
        Self {
            momentum: motion.momentum,
            noise: mass * mass * (model.velocity_noise * model.velocity_noise),
            drive: sample.joint_torque - rubbing + motion.carried - weights.column_sum(),
            to_torque: posture.jacobian().transpose(),
            to_wrench,
            torque: model.torque_noise.component_mul(&model.torque_noise),
            regressors: Regressors { friction: rubbing, weights },
            stuck,
            acceleration_tolerance: model.acceleration_tolerance,
            is_clear: surface_height(surface, posture) > CLEAR,
        }
    }

    /// Variance of the torques by what is neither a share of friction nor of a weight: a joint that may stick,
    /// and torques that accelerate.
    fn passing(&self, accelerating: &SVector<f64, N>) -> SVector<f64, N> {
        self.stuck + (accelerating * self.acceleration_tolerance).map(|torque| torque * torque)
    }

    /// f̂ from that by friction and masses as they are told, with the covariance of the filter.
    fn estimate(
        &self,
        told: &SVector<f64, D>,
        filter: &SMatrix<f64, D, D>,
        passing: &SVector<f64, N>,
        learned: &Learned<N>,
    ) -> Estimate<D> {
        let lasting = learned.shares.covariance(&self.regressors) + SMatrix::from_diagonal(passing);
        Estimate {
            wrench: told - self.to_wrench * learned.shares.torque(&learned.lagged),
            covariance: filter + self.to_wrench * lasting * self.to_wrench.transpose(),
        }
    }

    /// The variance of f̂ by the noise of one sample's torques.
    fn force_noise(&self) -> SMatrix<f64, D, D> {
        self.to_wrench * SMatrix::from_diagonal(&self.torque) * self.to_wrench.transpose()
    }
}

impl<const N: usize> Learned<N> {
    /// After a step of `h` seconds, of an f̂ (by what is told) with this covariance of the filter.
    fn after<const D: usize>(
        &self,
        model: &TorqueModel<N>,
        seen: &Seen<N, D>,
        (told, filter): (&SVector<f64, D>, &SMatrix<f64, D, D>),
        passing: &SVector<f64, N>,
        (h, lag): (f64, f64),
    ) -> Self {
        let left = libm::exp(-h / lag);
        let mut after = Self {
            shares: self.shares,
            lagged: self.lagged.lagged(&seen.regressors, left),
            clear: if seen.is_clear { self.clear + h } else { 0.0 },
        };
        if after.clear > FADED * lag {
            let torque = seen.to_torque * told - after.shares.torque(&after.lagged);
            let noise = (seen.to_torque * filter * seen.to_torque.transpose()).diagonal();
            // Within the lag of f̂ samples say the same again and again.
            let again = (2.0 * lag / h).max(1.0);
            let variance = (noise + passing) * again;
            after.shares.learn(&after.lagged, &torque, &variance, &model.told_shares(), h);
        }
        after
    }
}

impl<const N: usize> TorqueModel<N> {
    /// Friction and masses as they are told.
    fn told_shares(&self) -> Shares<N> {
        Shares::told(&self.friction, self.mass_tolerance)
    }
}

/// How far above the surface the TCP is, m.
fn surface_height<const N: usize, const D: usize>(surface: &Surface<D>, posture: &Posture<N, D>) -> f64 {
    surface.height(&posture.pose().position) - surface.height(&surface.contact.position)
}

/// Of these task axes the one along which a force loads the joints least.
pub(super) fn unseen<const N: usize, const D: usize>(axes: TaskAxes, posture: &Posture<N, D>) -> usize {
    let gram = posture.jacobian() * posture.jacobian().transpose();
    let never_zero = SMatrix::identity() * (LEAST_SEEN * gram.trace());
    let Some(inverse) = (gram + never_zero).try_inverse() else { return 0 };
    (0..D)
        .filter(|axis| axes.has(*axis))
        .max_by(|one, other| inverse[(*one, *one)].total_cmp(&inverse[(*other, *other)]))
        .unwrap_or(0)
}

fn symmetric<const K: usize>(matrix: &SMatrix<f64, K, K>) -> SMatrix<f64, K, K> {
    (matrix + matrix.transpose()) * 0.5
}

impl<const N: usize, const D: usize> MomentumObserver<N, D> {
    /// f̂ after the sample.
    pub(super) fn estimate(&self) -> &Estimate<D> {
        &self.estimate
    }

    /// After a sample; `last` is the filter after the one before. The first of a run, and one after a
    /// pause, counts as one of an arm that does not accelerate. `None` where J has no inverse: some force
    /// moves no joint then.
    pub(super) fn followed(
        last: Option<&Self>,
        model: &TorqueModel<N>,
        settings: &Settings<N, D>,
        sample: &Sample<N, D>,
        posture: &Posture<N, D>,
    ) -> Option<Self> {
        let inverse = posture.least_norm_inverse().ok()?;
        let seen = Seen::new(model, sample, posture, &settings.surface, &inverse.matrix);
        let lag = settings.wrench_time_constant.max();
        let since = |last: &Self| sample.stamp.since(last.stamp);
        let follows = |last: &&Self| last.boot_id == sample.boot_id && since(last) <= settings.timing.pause();
        Some(match last.filter(follows) {
            Some(last) if since(last).seconds() > 0.0 => last.after(model, &seen, since(last).seconds(), lag, sample),
            Some(last) => *last,
            None => {
                // Friction is what it was before the pause.
                let shares = last.map_or_else(|| model.told_shares(), |last| last.learned.shares);
                Self::first(&seen, sample, shares)
            }
        })
    }

    fn first(seen: &Seen<N, D>, sample: &Sample<N, D>, shares: Shares<N>) -> Self {
        let force = seen.force_noise();
        let learned = Learned { shares, lagged: seen.regressors, clear: 0.0 };
        let told = seen.to_wrench * seen.drive;
        Self {
            boot_id: sample.boot_id,
            stamp: sample.stamp,
            drive: seen.drive,
            momentum: seen.momentum,
            told,
            estimate: seen.estimate(&told, &force, &seen.stuck, &learned),
            learned,
            passing: seen.stuck,
            variance: seen.noise,
            shared: SMatrix::zeros(),
            force,
        }
    }

    /// A step of `h` seconds, in which J counts as constant and the torques as a straight line.
    fn after(&self, model: &TorqueModel<N>, seen: &Seen<N, D>, h: f64, lag: f64, sample: &Sample<N, D>) -> Self {
        let (to_torque, jacobian) = (&seen.to_torque, seen.to_torque.transpose());
        let by_momentum = seen.to_wrench * self.variance * seen.to_wrench.transpose();
        let walk = (seen.force_noise() * (h * h) + by_momentum * (2.0 * h / lag)) / (lag * lag);
        let walked = to_torque * walk;
        let predicted = self.momentum + ((self.drive + seen.drive) * 0.5 - to_torque * self.told) * h;
        // A walk of f̂ within the step adds up to a third of it in p, and half of it in what they share.
        let cross = self.shared * jacobian;
        let variance = self.variance - (cross + cross.transpose()) * h
            + (to_torque * self.force * jacobian + walked * jacobian / 3.0) * (h * h)
            + SMatrix::from_diagonal(&seen.torque) * (h * h);
        let shared = self.shared - (to_torque * self.force + walked * 0.5) * h;
        let force = self.force + walk;
        let innovation = seen.momentum - predicted;
        let Some(factor) = (variance + seen.noise).cholesky() else {
            return Self::first(seen, sample, self.learned.shares);
        };
        // Gains are P S⁻¹, S symmetric.
        let (of_momentum, of_force) = (factor.solve(&variance), factor.solve(&shared));
        let force = symmetric(&(force - shared.transpose() * of_force));
        let told = self.told + of_force.transpose() * innovation;
        // What stuck, or was accelerated, fades from f̂ with its lag.
        let left = libm::exp(-h / lag);
        let passing = seen.passing(&(seen.drive - to_torque * told));
        let passing = passing.zip_map(&self.passing, |now, before| now.max(before * left * left));
        let learned = self.learned.after(model, seen, (&told, &force), &passing, (h, lag));
        Self {
            boot_id: sample.boot_id,
            stamp: sample.stamp,
            drive: seen.drive,
            momentum: predicted + of_momentum.transpose() * innovation,
            told,
            estimate: seen.estimate(&told, &force, &passing, &learned),
            learned,
            passing,
            // P − P S⁻¹ P = R S⁻¹ P, without a difference.
            variance: symmetric(&(seen.noise * of_momentum)),
            shared: seen.noise * of_force,
            force,
        }
    }
}

#[cfg(test)]
mod tests;
