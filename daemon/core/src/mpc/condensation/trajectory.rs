//! g, the gradient of the cost (18a) at zero input: the free trajectory forward, one adjoint sweep
//! backward.

use nalgebra::{SMatrix, SVector};

use super::SLACK_UNIT;
use super::rows::MpcRows;
use super::simd::{Joints, SimdMatrix, SimdVector};
use crate::mpc::cost::Weights;
use crate::mpc::model::Step;

/// What happens without inputs: joints at the start of every step and at the end of the last,
/// wrench estimates at the end of every step.
pub(super) struct FreeTrajectory<'a, const N: usize, const M: usize, const C: usize> {
    position: &'a mut [[f64; N]],
    carried: &'a mut [[[f64; N]; C]],
    /// By position among the wrench axes.
    wrench: &'a mut [[f64; M]],
}

#[inline(always)]
fn joints_of<const N: usize, const C: usize>(position: &[f64; N], carried: &[[f64; N]; C]) -> Joints<N, C> {
    Joints { position: SimdVector::new(position), carried: core::array::from_fn(|c| SimdVector::new(&carried[c])) }
}

/// Length of a trajectory's storage, of joints that carry so many numbers.
pub(super) const fn trajectory_len<const N: usize, const D: usize>(steps: usize, carried: usize) -> usize {
    (1 + carried) * N * (steps + 1) + D * steps
}

impl<'a, const N: usize, const M: usize, const C: usize> FreeTrajectory<'a, N, M, C> {
    /// Where [`write_gradient`] writes, at the start of `storage`.
    pub(super) fn within(storage: &'a mut [f64], steps: usize) -> Self {
        let (position, rest) = storage.split_at_mut(N * (steps + 1));
        let (carried, rest) = rest.split_at_mut(C * N * (steps + 1));
        let wrench = &mut rest[..M * steps];
        Self {
            position: position.as_chunks_mut().0,
            carried: carried.as_chunks_mut().0.as_chunks_mut().0,
            wrench: wrench.as_chunks_mut().0,
        }
    }

    /// Joints at the start of step `step`, or at the end of the last.
    #[inline(always)]
    pub(super) fn joints_at(&self, step: usize) -> Joints<N, C> {
        joints_of(&self.position[step], &self.carried[step])
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
    fn new<const D: usize, const C: usize>(rows: &MpcRows<'_, N, D, M, C>) -> Self {
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

    /// K_e J (Σ A_c c + B r).
    // Separate, because Euler steps do not need it.
    #[inline(never)]
    fn followed_within<const D: usize, const C: usize>(
        &self,
        axes: &[usize],
        step: &Step<N, D>,
        joints: &Joints<N, C>,
        reference: SimdVector<N>,
    ) -> SimdVector<M> {
        let mut followed = [0.0; M];
        for ((followed, gradient), &axis) in followed.iter_mut().zip(&self.gradients.rows).zip(axes) {
            let moved = reference.times(column(&step.wrench_by_reference, axis));
            let moved = joints
                .carried
                .iter()
                .zip(&step.wrench_by)
                .fold(moved, |sum, (carried, by)| carried.times_plus(column(by, axis), sum));
            *followed = moved.dot(SimdVector::new(gradient));
        }
        SimdVector::new(&followed)
    }

    /// What `push`, the sensitivity to the estimates at the end of a step, means for the motion
    /// within it: adds it to that of what the joints carry at the start, and gives that of r.
    #[inline(never)]
    fn sensitivity_within<const D: usize, const C: usize>(
        &self,
        axes: &[usize],
        step: &Step<N, D>,
        push: SimdVector<M>,
        costate: &mut Joints<N, C>,
    ) -> SimdVector<N> {
        let mut reference = SimdVector::ZERO;
        for ((push, gradient), &axis) in push.array().into_iter().zip(&self.gradients.rows).zip(axes) {
            let pushed = SimdVector::new(gradient).times(SimdVector::splat(push));
            for (carried, by) in costate.carried.iter_mut().zip(&step.wrench_by) {
                *carried = pushed.times_plus(column(by, axis), *carried);
            }
            reference = pushed.times_plus(column(&step.wrench_by_reference, axis), reference);
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

/// A or B of one axis in a step.
#[inline(always)]
fn column<const N: usize, const D: usize>(by: &SMatrix<f64, N, D>, axis: usize) -> SimdVector<N> {
    SimdVector::new(&by.data.0[axis])
}

/// Writes the free trajectory, and g; zero beyond the variables.
// Kept out of its callers: inlined together they would run out of registers.
#[inline(never)]
pub(super) fn write_gradient<const N: usize, const D: usize, const M: usize, const C: usize>(
    rows: &MpcRows<'_, N, D, M, C>,
    gradient: &mut [f64],
    free: &mut FreeTrajectory<'_, N, M, C>,
) {
    let (prediction, is_even) = (rows.prediction, rows.horizon.is_even());
    let follows_within = rows.horizon.follows_within();
    let (steps, axes) = (rows.horizon.steps(), prediction.wrench_axes.as_slice());
    let estimates = Estimates::new(rows);
    let mut filter = Filter::of(axes, &steps[0]);
    let initial = &prediction.initial;
    let carried = initial.carried();
    let mut joints = Joints::<N, C> {
        position: SimdVector::of(&initial.joint_position),
        carried: core::array::from_fn(|c| SimdVector::of(&carried[c])),
    };
    let mut wrench: SimdVector<M> = pick(axes, &initial.wrench);
    (free.position[0], free.carried[0]) = (joints.position.array(), joints.carried.map(SimdVector::array));
    let places = free.position[1..].iter_mut().zip(&mut free.carried[1..]).zip(free.wrench.iter_mut());
    for ((step, reference), ((position, carried), wrench_after)) in
        steps.iter().zip(prediction.known_reference).zip(places)
    {
        if !is_even {
            filter = Filter::of(axes, step);
        }
        let reference = SimdVector::of(reference);
        let followed = estimates.linear(joints.position).times(filter.by_start);
        wrench = wrench.times_plus(filter.decay, followed);
        if follows_within {
            wrench = wrench.plus(estimates.followed_within(axes, step, &joints, reference));
        }
        joints.advance(step, reference);
        (*position, *carried) = (joints.position.array(), joints.carried.map(SimdVector::array));
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
    let fading = input_weight.times(pick(inputs, &prediction.set_point.fading_input));
    let mut costate = Joints::<N, C>::ZERO;
    let mut push = SimdVector::<M>::ZERO;
    // Variables stand in reversed time order: backward in time is forward in g.
    let joints =
        free.position[1..].iter().zip(&free.carried[1..]).map(|(position, carried)| joints_of(position, carried));
    let backward = steps.iter().zip(joints).zip(&*free.wrench).rev();
    let mut weight = estimates.weight;
    for ((k, ((step, joints), wrench)), place) in
        (0..steps.len()).rev().zip(backward).zip(gradient.as_chunks_mut::<M>().0)
    {
        // Even steps count once each.
        let share = (!is_even).then(|| rows.horizon.share(k));
        if let Some(share) = share {
            filter = Filter::of(axes, step);
            weight = estimates.weight.times(SimdVector::splat(share));
        }
        let left = rows.horizon.left_in(k);
        let velocity = SimdVector::of(&prediction.set_point.fading_velocity)
            .times_plus(SimdVector::splat(left), SimdVector::of(&prediction.set_point.joint_velocity));
        add_joint_cost(rows, &jacobian, &joints, velocity, share, &mut costate);
        push = SimdVector::new(wrench).minus(estimates.set_point).times_plus(weight, push);
        let mut reference = costate.back(step);
        if follows_within {
            reference = reference.plus(estimates.sensitivity_within(axes, step, push, &mut costate));
        }
        let wanted = fading.times_plus(SimdVector::splat(left), wanted);
        let off = share.map_or(wanted, |share| wanted.times(SimdVector::splat(share)));
        *place = rows.inputs.transposed_times(reference).minus(off).array();
        costate.position = costate.position.plus(estimates.gradients.transposed_times(push.times(filter.by_start)));
        push = push.times(filter.decay);
    }
}

/// costate += `share` Q (x − x⁰) of q and q̇, with q̇0 = `velocity` in this step (rad/s, m/s of a sliding joint).
#[inline(always)]
fn add_joint_cost<const N: usize, const D: usize, const M: usize, const C: usize>(
    rows: &MpcRows<'_, N, D, M, C>,
    jacobian: &SimdMatrix<D, N>,
    joints: &Joints<N, C>,
    velocity: SimdVector<N>,
    share: Option<f64>,
    costate: &mut Joints<N, C>,
) {
    let mut q = joints.position.minus(SimdVector::of(&rows.prediction.set_point.joint_position));
    let mut v = joints.carried[0].minus(velocity);
    if let Some(share) = share {
        (q, v) = (q.times(SimdVector::splat(share)), v.times(SimdVector::splat(share)));
    }
    match rows.prediction.weights {
        Weights::Joint { position, velocity, .. } => {
            costate.position = q.times_plus(SimdVector::of(position), costate.position);
            costate.carried[0] = v.times_plus(SimdVector::of(velocity), costate.carried[0]);
        }
        Weights::Task { position, velocity, .. } => {
            // Jᵀ W J.
            let pushed = |x: SimdVector<N>, weight: &SVector<f64, D>| {
                jacobian.transposed_times(jacobian.times(x).times(SimdVector::of(weight)))
            };
            costate.position = costate.position.plus(pushed(q, position));
            costate.carried[0] = costate.carried[0].plus(pushed(v, velocity));
        }
    }
}
