//! g, the gradient of the cost (18a) at zero input: the free trajectory forward, one adjoint sweep backward.

use super::SLACK_UNIT;
use super::joints::{Joints, array, combine};
use super::rows::MpcRows;
use crate::cost::Weights;
use crate::model::Step;

/// What happens without inputs: joints at the start of every step and at the end of the last, wrench estimates at the end
/// of every step.
pub(super) struct FreeTrajectory<'a, const N: usize, const M: usize> {
    joints: &'a mut [[[f64; N]; 2]],
    /// By position among the wrench axes.
    wrench: &'a mut [[f64; M]],
}

/// Numbers in a trajectory.
pub(super) const fn trajectory_len<const N: usize, const D: usize>(steps: usize) -> usize {
    2 * N * (steps + 1) + D * steps
}

impl<'a, const N: usize, const M: usize> FreeTrajectory<'a, N, M> {
    /// Where [`write_gradient`] writes, at the start of `storage`.
    pub(super) fn within(storage: &'a mut [f64], steps: usize) -> Self {
        let (joints, rest) = storage.split_at_mut(2 * N * (steps + 1));
        let wrench = &mut rest[..M * steps];
        Self { joints: joints.as_chunks_mut().0.as_chunks_mut().0, wrench: wrench.as_chunks_mut().0 }
    }

    /// Joints at the start of step `step`, or at the end of the last.
    #[inline(always)]
    pub(super) fn joints_at(&self, step: usize) -> Joints<N> {
        let [position, velocity] = self.joints[step];
        Joints { position, velocity }
    }

    /// q at the end of every step.
    pub(super) fn positions(&self) -> impl Iterator<Item = &[f64; N]> {
        self.joints.iter().skip(1).map(|[position, _]| position)
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
    fn take_step<const D: usize>(&mut self, rows: &MpcRows<'_, N, D, M>, step: &Step<N, D>) {
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
    free: &mut FreeTrajectory<'_, N, M>,
) {
    let (prediction, is_even) = (rows.prediction, rows.horizon.is_even());
    let steps = rows.horizon.steps();
    let mut estimates = Estimates::new(rows);
    estimates.take_step(rows, &steps[0]);
    let initial = &prediction.initial;
    let mut joints = Joints { position: *array(&initial.joint_position), velocity: *array(&initial.joint_velocity) };
    let mut wrench = [0.0; M];
    for (value, &axis) in wrench.iter_mut().zip(prediction.wrench_axes.as_slice()) {
        *value = initial.wrench[axis];
    }
    let mut linear = estimates.linear(&joints.position);
    free.joints[0] = [joints.position, joints.velocity];
    let places = free.joints[1..].iter_mut().zip(free.wrench.iter_mut());
    for ((step, reference), (joints_after, wrench_after)) in steps.iter().zip(prediction.known_reference).zip(places) {
        if !is_even {
            estimates.take_step(rows, step);
        }
        joints.advance(step, array(reference));
        let after = estimates.linear(&joints.position);
        for index in 0..M {
            wrench[index] = estimates.decay[index] * wrench[index]
                + estimates.by_start[index] * linear[index]
                + estimates.by_end[index] * after[index];
        }
        linear = after;
        *joints_after = [joints.position, joints.velocity];
        *wrench_after = wrench;
    }
    let n = M * steps.len();
    gradient[n..].fill(0.0);
    if let Some(price) = prediction.slack_price {
        gradient[n] = price * SLACK_UNIT;
    }
    let mut costate = Joints::<N>::ZERO;
    let mut push = [0.0; M];
    // Variables stand in reversed time order: backward in time is forward in g.
    let backward = steps.iter().zip(&free.joints[1..]).zip(&*free.wrench).rev();
    for (((step, &[position, velocity]), wrench), place) in backward.zip(gradient.as_chunks_mut::<M>().0) {
        if !is_even {
            estimates.take_step(rows, step);
        }
        add_joint_cost(rows, &Joints { position, velocity }, &mut costate);
        for index in 0..M {
            push[index] += estimates.weight[index] * (wrench[index] - estimates.set_point[index]);
        }
        // Sensitivity to q at the end of the step, through q itself and through f̂ there.
        let at_end = combine(&estimates.gradients, &core::array::from_fn(|j| estimates.by_end[j] * push[j]));
        (0..N).for_each(|i| costate.position[i] += at_end[i]);
        *place = combine(&rows.by_joint, &costate.back(step));
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
