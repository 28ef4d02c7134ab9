//! The minimum-force stop: minimise the largest violation of the upper force bound, then come to rest at a low force.
//!
//! Its inputs are the absolute twist, not the offset, so that pushing on with ṗ0 is not free; there is no lower bound,
//! and every admittance axis has an input.

use nalgebra::SVector;

use crate::condensation::Slack;
use crate::constraints::{AxisBound, ForceBounds, Softened};
use crate::cost::{SetPoint, Weights};
use crate::model::{Model, State};
use crate::parameters::Parameters;

/// The least violation comes before all else: its price is far above the sum of multipliers, which the cost of a twist of 1 m/s
/// bounds. The curvature is only there to make the QP strictly convex.
pub(crate) const SLACK: Slack = Slack { softened: Softened::Maximum, price: 1e3, curvature: 0.1 };
/// R of the stop, relative to its velocity weight: only enough to make the QP strictly convex.
const INPUT_WEIGHT: f64 = 1e-2;
/// Part of the least reciprocal condition number of J at which a stop begins, down to which it may go on.
pub(crate) const CONDITION_LEFT: f64 = 0.1;
/// Normal speed in m/s that still counts as zero.
const STANDSTILL: f64 = 1e-3;

/// Bounds of a stop: f_max only, the sign of each axis from the surface normal.
pub(crate) fn bounds<const N: usize, const D: usize>(parameters: &Parameters<N, D>) -> ForceBounds<D> {
    let (mut bounds, signs) = (ForceBounds::none(), parameters.surface_signs());
    for axis in 0..D {
        if let Some(sign) = signs.sign(axis).filter(|_| parameters.thresholds.admittance[axis]) {
            let (minimum, maximum) = (f64::NEG_INFINITY, parameters.mpc.force_limit[axis]);
            bounds.push(AxisBound { axis, sign, minimum, maximum });
        }
    }
    bounds
}

/// Q and R of a stop: velocity against force so that the force fades within the horizon, v = f / (k · horizon).
pub(crate) fn weights<const N: usize, const D: usize>(
    parameters: &Parameters<N, D>,
) -> (Weights<N, D>, SVector<f64, D>) {
    let stiffness = parameters.environment.stiffness.norm();
    let duration: f64 = parameters.mpc.steps().iter().sum();
    let wrench = 1.0 / (stiffness * duration * stiffness * duration);
    let weights = Weights::Task {
        position: SVector::zeros(),
        velocity: SVector::repeat(1.0),
        wrench: SVector::repeat(if wrench.is_finite() { wrench } else { 0.0 }),
    };
    (weights, SVector::repeat(INPUT_WEIGHT))
}

/// Standstill without force.
pub(crate) fn set_point<const N: usize, const D: usize>(initial: &State<N, D>) -> SetPoint<N, D> {
    SetPoint { joint_position: initial.joint_position, joint_velocity: SVector::zeros(), wrench: SVector::zeros() }
}

/// Whether the arm, when it is at `state`, may be held: it moves outward or not at all, `measured` is at most `stop_force`, and it
/// would not exceed that while it coasts to standstill. (Held at zero normal velocity alone, unequal joint lags would drive it
/// back in.)
pub(crate) fn may_rest<const N: usize, const D: usize>(
    parameters: &Parameters<N, D>,
    model: &Model<N, D>,
    state: &State<N, D>,
    measured: f64,
    outward_speed: f64,
) -> bool {
    let environment = &parameters.environment;
    let limit = parameters.stopping.stop_force;
    let coasting = peak_while_coasting(model, &parameters.velocity_time_constant, state, &-environment.normal);
    outward_speed >= -STANDSTILL && measured <= limit && coasting <= limit
}

/// Largest f_lin along `direction` (in N, summed over axes) while the arm coasts from `x` under zero joint velocity
/// reference: q(t) = q + T_V q̇ (1 − exp(−t/T_V)), seen at 32 instants over five of the largest T_V.
fn peak_while_coasting<const N: usize, const D: usize>(
    model: &Model<N, D>,
    velocity_time_constant: &SVector<f64, N>,
    x: &State<N, D>,
    direction: &SVector<f64, D>,
) -> f64 {
    const INSTANTS: u32 = 32;
    let end = 5.0 * velocity_time_constant.max();
    let mut peak = f64::NEG_INFINITY;
    for instant in 0..=INSTANTS {
        let t = end * f64::from(instant) / f64::from(INSTANTS);
        let q = SVector::from_fn(|joint, _| {
            let lag = velocity_time_constant[joint];
            x.joint_position[joint] + lag * x.joint_velocity[joint] * (1.0 - libm::exp(-t / lag))
        });
        peak = peak.max(direction.dot(&model.linear_wrench(&q)));
    }
    peak
}

/// The twist of a stopped arm: ṗ0 if it points out of the surface, slowed to `retreat_speed`; `None` where it does not.
/// Rotation is never allowed.
pub(crate) fn retreat_twist<const N: usize, const D: usize>(
    parameters: &Parameters<N, D>,
    twist_reference: &SVector<f64, D>,
) -> Option<SVector<f64, D>> {
    let translation = SVector::<f64, D>::from_fn(|axis, _| if axis < 3 { twist_reference[axis] } else { 0.0 });
    let speed = translation.norm();
    let outward = parameters.environment.outward_speed(&translation);
    (outward > STANDSTILL.min(parameters.stopping.retreat_speed) && speed > 0.0)
        .then(|| translation * (parameters.stopping.retreat_speed / speed).min(1.0))
}

/// Whether ṗ0 leads out of the surface.
pub(crate) fn is_outward<const N: usize, const D: usize>(
    parameters: &Parameters<N, D>,
    twist_reference: &SVector<f64, D>,
) -> bool {
    parameters.environment.outward_speed(twist_reference) > STANDSTILL
}

/// Whether ṗ0 pushes into the surface.
pub(crate) fn is_inward<const N: usize, const D: usize>(
    parameters: &Parameters<N, D>,
    twist_reference: &SVector<f64, D>,
) -> bool {
    parameters.environment.outward_speed(twist_reference) < -STANDSTILL
}
