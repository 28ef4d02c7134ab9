//! g, the gradient of the cost (18a) at zero input: the free trajectory forward, one adjoint sweep
//! backward.

use nalgebra::SVector;

use super::SLACK_UNIT;
use super::rows::MpcRows;
use super::simd::{Joints, SimdMatrix, SimdVector};
use crate::mpc::cost::Weights;
use crate::mpc::model::Step;

/// What happens without inputs: joints at the start of every step and at the end of the last,
/// wrench estimates at the end of every step.
pub(super) struct FreeTrajectory<'a, const N: usize, const M: usize> {
    joints: &'a mut [[[f64; N]; 2]],
    /// By position among the wrench axes.
    wrench: &'a mut [[f64; M]],
}

#[inline(always)]
fn joints_of<const N: usize>([position, velocity]: &[[f64; N]; 2]) -> Joints<N> {
    Joints { position: SimdVector::new(position), velocity: SimdVector::new(velocity) }
}

/// Length of a trajectory's storage.
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
        joints_of(&self.joints[step])
    }
}

/// The constants of the wrench estimates for the axes that have one, in their order; of the others
/// zero.
struct Estimates<const N: usize, const M: usize> {
    /// K_e J.
    gradients: SimdMatrix<M, N>,
    offset: SimdVector<M>,
    set_point: SimdVector<M>,
    weight: SimdVector<M>,
}

impl<const N: usize, const M: usize> Estimates<N, M> {
    #[inline(always)]
    fn new<const D: usize>(rows: &MpcRows<'_, N, D, M>) -> Self {
        let (model, prediction) = (rows.model, rows.prediction);
        let (Weights::Joint { wrench, .. } | Weights::Task { wrench, .. }) = prediction.weights;
        let axes = prediction.wrench_axes.as_slice();
        let gradients =
            core::array::from_fn(|index| axes.get(index).map_or([0.0; N], |&axis| model.wrench_gradient.data.0[axis]));
        Self {
            gradients: SimdMatrix::of_rows(gradients),
            offset: pick(axes, &model.wrench_offset),
            set_point: pick(axes, &prediction.set_point.wrench),
            weight: pick(axes, wrench),
        }
    }

    /// f_lin.
    #[inline(always)]
    fn linear(&self, position: SimdVector<N>) -> SimdVector<M> {
        self.gradients.times(position).plus(self.offset)
    }

    /// K_e J (A q̇ + B r).
    // Separate, because Euler steps do not need it.
    #[inline(never)]
    fn followed_within<const D: usize>(
        &self,
        axes: &[usize],
        step: &Step<N, D>,
        velocity: SimdVector<N>,
        reference: SimdVector<N>,
    ) -> SimdVector<M> {
        let mut followed = [0.0; M];
        for ((followed, gradient), &axis) in followed.iter_mut().zip(&self.gradients.rows).zip(axes) {
            let (by_velocity, by_reference) = within(step, axis);
            let moved = velocity.times_plus(by_velocity, reference.times(by_reference));
            *followed = moved.dot(SimdVector::new(gradient));
        }
        SimdVector::new(&followed)
    }

    /// What `push`, the sensitivity to the estimates at the end of a step, means for the motion
    /// within it: adds it to that of q̇ at the start, and gives that of r.
    #[inline(never)]
    fn sensitivity_within<const D: usize>(
        &self,
        axes: &[usize],
        step: &Step<N, D>,
        push: SimdVector<M>,
        costate: &mut Joints<N>,
    ) -> SimdVector<N> {
        let mut reference = SimdVector::ZERO;
        for ((push, gradient), &axis) in push.array().into_iter().zip(&self.gradients.rows).zip(axes) {
            let (by_velocity, by_reference) = within(step, axis);
            let pushed = SimdVector::new(gradient).times(SimdVector::splat(push));
            costate.velocity = pushed.times_plus(by_velocity, costate.velocity);
            reference = pushed.times_plus(by_reference, reference);
        }
        reference
    }
}

/// The numbers of these axes.
#[inline(always)]
fn pick<const D: usize, const M: usize>(axes: &[usize], by_axis: &SVector<f64, D>) -> SimdVector<M> {
    SimdVector::new(&core::array::from_fn(|index| axes.get(index).map_or(0.0, |&axis| by_axis[axis])))
}

/// e and 1 − e of the wrench estimates in one step.
#[derive(Clone, Copy)]
struct Filter<const M: usize> {
    decay: SimdVector<M>,
    by_start: SimdVector<M>,
}

impl<const M: usize> Filter<M> {
    #[inline(always)]
    fn of<const N: usize, const D: usize>(axes: &[usize], step: &Step<N, D>) -> Self {
        let decay = pick(axes, &step.wrench_decay);
        Self { decay, by_start: SimdVector::splat(1.0).minus(decay) }
    }
}

/// A and B of one axis in a step.
#[inline(always)]
fn within<const N: usize, const D: usize>(step: &Step<N, D>, axis: usize) -> (SimdVector<N>, SimdVector<N>) {
    (SimdVector::new(&step.wrench_by_velocity.data.0[axis]), SimdVector::new(&step.wrench_by_reference.data.0[axis]))
}

/// Writes the free trajectory, and g; zero beyond the variables.
// Kept out of its callers: inlined together they would run out of registers.
#[inline(never)]
pub(super) fn write_gradient<const N: usize, const D: usize, const M: usize>(
    rows: &MpcRows<'_, N, D, M>,
    gradient: &mut [f64],
    free: &mut FreeTrajectory<'_, N, M>,
) {
    let (prediction, is_even) = (rows.prediction, rows.horizon.is_even());
    let follows_within = rows.horizon.follows_within();
    let (steps, axes) = (rows.horizon.steps(), prediction.wrench_axes.as_slice());
    let estimates = Estimates::new(rows);
    let mut filter = Filter::of(axes, &steps[0]);
    let initial = &prediction.initial;
    let mut joints =
        Joints { position: SimdVector::of(&initial.joint_position), velocity: SimdVector::of(&initial.joint_velocity) };
    let mut wrench: SimdVector<M> = pick(axes, &initial.wrench);
    free.joints[0] = [joints.position.array(), joints.velocity.array()];
    let places = free.joints[1..].iter_mut().zip(free.wrench.iter_mut());
    for ((step, reference), (joints_after, wrench_after)) in steps.iter().zip(prediction.known_reference).zip(places) {
        if !is_even {
            filter = Filter::of(axes, step);
        }
        let reference = SimdVector::of(reference);
        let followed = estimates.linear(joints.position).times(filter.by_start);
        wrench = wrench.times_plus(filter.decay, followed);
        if follows_within {
            wrench = wrench.plus(estimates.followed_within(axes, step, joints.velocity, reference));
        }
        joints.advance(step, reference);
        *joints_after = [joints.position.array(), joints.velocity.array()];
        *wrench_after = wrench.array();
    }
    let n = M * steps.len();
    gradient[n..].fill(0.0);
    if let Some(slack) = &prediction.slack {
        gradient[n] = slack.price * SLACK_UNIT;
    }
    // Only task weights need it.
    let jacobian = match prediction.weights {
        Weights::Joint { .. } => SimdMatrix::of_columns([[0.0; D]; N]),
        Weights::Task { .. } => SimdMatrix::of_columns(prediction.jacobian.data.0),
    };
    let inputs = prediction.inputs.as_slice();
    let input_weight: SimdVector<M> = pick(inputs, &prediction.input_weight);
    let wanted = input_weight.times(pick(inputs, &prediction.set_point.input));
    let mut costate = Joints::<N>::ZERO;
    let mut push = SimdVector::<M>::ZERO;
    // Variables stand in reversed time order: backward in time is forward in g.
    let backward = steps.iter().zip(&free.joints[1..]).zip(&*free.wrench).rev();
    let mut weight = estimates.weight;
    for ((k, ((step, joints), wrench)), place) in
        (0..steps.len()).rev().zip(backward).zip(gradient.as_chunks_mut::<M>().0)
    {
        let share = rows.horizon.share(k);
        if !is_even {
            filter = Filter::of(axes, step);
            weight = estimates.weight.times(SimdVector::splat(share));
        }
        add_joint_cost(rows, &jacobian, &joints_of(joints), share, &mut costate);
        push = SimdVector::new(wrench).minus(estimates.set_point).times_plus(weight, push);
        let mut reference = costate.back(step);
        if follows_within {
            reference = reference.plus(estimates.sensitivity_within(axes, step, push, &mut costate));
        }
        let off = wanted.times(SimdVector::splat(share));
        *place = rows.inputs.transposed_times(reference).minus(off).array();
        costate.position = costate.position.plus(estimates.gradients.transposed_times(push.times(filter.by_start)));
        push = push.times(filter.decay);
    }
}

/// costate += `share` Q (x − x⁰) of q and q̇.
#[inline(always)]
fn add_joint_cost<const N: usize, const D: usize, const M: usize>(
    rows: &MpcRows<'_, N, D, M>,
    jacobian: &SimdMatrix<D, N>,
    joints: &Joints<N>,
    share: f64,
    costate: &mut Joints<N>,
) {
    let (set_point, share) = (&rows.prediction.set_point, SimdVector::splat(share));
    let q = joints.position.minus(SimdVector::of(&set_point.joint_position)).times(share);
    let v = joints.velocity.minus(SimdVector::of(&set_point.joint_velocity)).times(share);
    match rows.prediction.weights {
        Weights::Joint { position, velocity, .. } => {
            costate.position = q.times_plus(SimdVector::of(position), costate.position);
            costate.velocity = v.times_plus(SimdVector::of(velocity), costate.velocity);
        }
        Weights::Task { position, velocity, .. } => {
            // Jᵀ W J.
            let pushed = |x: SimdVector<N>, weight: &SVector<f64, D>| {
                jacobian.transposed_times(jacobian.times(x).times(SimdVector::of(weight)))
            };
            costate.position = costate.position.plus(pushed(q, position));
            costate.velocity = costate.velocity.plus(pushed(v, velocity));
        }
    }
}
