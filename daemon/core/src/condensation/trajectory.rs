//! g, the gradient of the cost (18a) at zero input: the free trajectory forward, one adjoint sweep backward.

use super::SLACK_UNIT;
use super::joints::{Joints, array, combine};
use super::rows::MpcRows;
use crate::cost::Weights;
use crate::plan::MAX_STEPS;

/// What happens without inputs: joints at the start of every step and at the end of the last, wrench estimates at the end
/// of every step.
pub(super) struct FreeTrajectory<const N: usize, const M: usize> {
    joints: [Joints<N>; MAX_STEPS + 1],
    /// By position among the wrench axes.
    wrench: [[f64; M]; MAX_STEPS],
}

impl<const N: usize, const M: usize> FreeTrajectory<N, M> {
    /// Where [`write_gradient`] writes.
    #[inline(always)]
    pub(super) fn empty() -> Self {
        Self { joints: [Joints::ZERO; MAX_STEPS + 1], wrench: [[0.0; M]; MAX_STEPS] }
    }

    /// Joints at the start of step `step`.
    pub(super) fn joints(&self, step: usize) -> &Joints<N> {
        &self.joints[step]
    }
}

/// The constants of the wrench estimate for the axes that have one, in their order: K_e J by rows and by joint, offset.
struct Estimates<const N: usize, const M: usize> {
    gradients: [[f64; N]; M],
    by_joint: [[f64; M]; N],
    offset: [f64; M],
    set_point: [f64; M],
    weight: [f64; M],
    decay: [f64; M],
    by_start: [f64; M],
    by_end: [f64; M],
}

impl<const N: usize, const M: usize> Estimates<N, M> {
    fn new<const D: usize>(rows: &MpcRows<'_, N, D, M>) -> Self {
        let (model, prediction) = (rows.model, rows.prediction);
        let (Weights::Joint { wrench, .. } | Weights::Task { wrench, .. }) = prediction.weights;
        let mut estimates = Self {
            gradients: [[0.0; N]; M],
            by_joint: [[0.0; M]; N],
            offset: [0.0; M],
            set_point: [0.0; M],
            weight: [0.0; M],
            decay: [0.0; M],
            by_start: [0.0; M],
            by_end: [0.0; M],
        };
        for (index, &axis) in prediction.wrench_axes.as_slice().iter().enumerate() {
            estimates.gradients[index] = model.wrench_gradient.data.0[axis];
            (0..N).for_each(|joint| estimates.by_joint[joint][index] = estimates.gradients[index][joint]);
            estimates.offset[index] = model.wrench_offset[axis];
            estimates.set_point[index] = prediction.set_point.wrench[axis];
            estimates.weight[index] = wrench[axis];
        }
        estimates
    }

    /// f_lin.
    #[inline(always)]
    fn linear(&self, position: &[f64; N]) -> [f64; M] {
        let force = combine(&self.by_joint, position);
        core::array::from_fn(|index| force[index] + self.offset[index])
    }

    /// The filter's constants of one step.
    #[inline(always)]
    fn take_step<const D: usize>(&mut self, rows: &MpcRows<'_, N, D, M>, step: usize) {
        let step = &rows.horizon.steps()[step];
        for (index, &axis) in rows.prediction.wrench_axes.as_slice().iter().enumerate() {
            self.decay[index] = step.wrench_decay[axis];
            self.by_start[index] = step.wrench_by_start[axis];
            self.by_end[index] = step.wrench_by_end[axis];
        }
    }
}

/// Writes the free trajectory, and g; zero beyond the variables.
// Apart from its neighbours: in one function they would share too few registers.
#[inline(never)]
pub(super) fn write_gradient<const N: usize, const D: usize, const M: usize>(
    rows: &MpcRows<'_, N, D, M>,
    gradient: &mut [f64],
    free: &mut FreeTrajectory<N, M>,
) {
    let prediction = rows.prediction;
    let steps = rows.horizon.steps();
    let mut estimates = Estimates::new(rows);
    let initial = &prediction.initial;
    let mut joints = Joints { position: *array(&initial.joint_position), velocity: *array(&initial.joint_velocity) };
    free.joints[0] = joints;
    let mut wrench = [0.0; M];
    for (value, &axis) in wrench.iter_mut().zip(prediction.wrench_axes.as_slice()) {
        *value = initial.wrench[axis];
    }
    let mut linear = estimates.linear(&joints.position);
    for (k, step) in steps.iter().enumerate() {
        if k == 0 || !rows.horizon.is_even() {
            estimates.take_step(rows, k);
        }
        joints.advance(step, array(&prediction.known_reference[k]));
        let after = estimates.linear(&joints.position);
        for index in 0..M {
            wrench[index] = estimates.decay[index] * wrench[index]
                + estimates.by_start[index] * linear[index]
                + estimates.by_end[index] * after[index];
        }
        linear = after;
        free.joints[k + 1] = joints;
        free.wrench[k] = wrench;
    }
    gradient.fill(0.0);
    if let Some(price) = prediction.slack_price {
        gradient[rows.variables() - 1] = price * SLACK_UNIT;
    }
    let mut costate = Joints::<N>::ZERO;
    let mut push = [0.0; M];
    for (k, step) in steps.iter().enumerate().rev() {
        if !rows.horizon.is_even() {
            estimates.take_step(rows, k);
        }
        add_joint_cost(rows, &free.joints[k + 1], &mut costate);
        for index in 0..M {
            push[index] += estimates.weight[index] * (free.wrench[k][index] - estimates.set_point[index]);
        }
        // Sensitivity to q at the end of the step, through q itself and through f̂ there.
        let at_end = combine(&estimates.gradients, &core::array::from_fn(|j| estimates.by_end[j] * push[j]));
        (0..N).for_each(|i| costate.position[i] += at_end[i]);
        let reference = costate.back(step);
        rows.add_to_inputs(k, &reference, gradient);
        let at_start = combine(&estimates.gradients, &core::array::from_fn(|j| estimates.by_start[j] * push[j]));
        (0..N).for_each(|i| costate.position[i] += at_start[i]);
        (0..M).for_each(|j| push[j] *= estimates.decay[j]);
    }
}

/// costate += Q (x − x⁰) of q and q̇.
#[inline(always)]
fn add_joint_cost<const N: usize, const D: usize, const M: usize>(
    rows: &MpcRows<'_, N, D, M>,
    joints: &Joints<N>,
    costate: &mut Joints<N>,
) {
    let set_point = &rows.prediction.set_point;
    let (q0, v0) = (array(&set_point.joint_position), array(&set_point.joint_velocity));
    let q: [f64; N] = core::array::from_fn(|i| joints.position[i] - q0[i]);
    let v: [f64; N] = core::array::from_fn(|i| joints.velocity[i] - v0[i]);
    match rows.prediction.weights {
        Weights::Joint { position, velocity, .. } => {
            let (position, velocity) = (array(position), array(velocity));
            for i in 0..N {
                costate.position[i] += position[i] * q[i];
                costate.velocity[i] += velocity[i] * v[i];
            }
        }
        Weights::Task { position, velocity, .. } => {
            // Jᵀ W J; J by columns, one for each joint.
            let columns = &rows.prediction.jacobian.data.0;
            let (position, velocity) = (array(position), array(velocity));
            let (dp, dv) = (combine(columns, &q), combine(columns, &v));
            for i in 0..N {
                for d in 0..D {
                    costate.position[i] += columns[i][d] * position[d] * dp[d];
                    costate.velocity[i] += columns[i][d] * velocity[d] * dv[d];
                }
            }
        }
    }
}
