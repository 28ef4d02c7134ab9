//! Over even steps: what one joint has done at the end of the horizon after its velocity reference
//! was 1 rad/s during one step, and what that costs. Scalars that depend on horizon and weights
//! only, computed once.

use crate::mpc::cost::Weights;
use crate::mpc::horizon::Horizon;
use crate::mpc::model::{CARRIED, Step};
use crate::mpc::qp::{LANES, padded};

/// Views of the tables. Columns are steps in reversed order: column s belongs to the input of step
/// H − 1 − s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Responses<'a, const N: usize, const D: usize> {
    steps: usize,
    position: &'a [[f64; N]],
    velocity: &'a [[f64; N]],
    wrench: &'a [[[f64; N]; D]],
    cost: &'a [[[f64; LANES]; N]],
}

/// Numbers in the table of positions, and in that of velocities, rounded up to whole groups.
const fn motion_len<const N: usize>(steps: usize) -> usize {
    padded(N * steps)
}

/// Numbers in all tables.
pub(super) const fn table_len<const N: usize, const D: usize>(steps: usize) -> usize {
    (2 + D) * motion_len::<N>(steps) + N * steps * padded(steps)
}

impl<'a, const N: usize, const D: usize> Responses<'a, N, D> {
    /// The tables that [`fill`] has written.
    pub(super) fn of(tables: &'a [f64], steps: usize) -> Self {
        let (position, rest) = tables.split_at(motion_len::<N>(steps));
        let (velocity, rest) = rest.split_at(motion_len::<N>(steps));
        let (wrench, cost) = rest.split_at(D * motion_len::<N>(steps));
        let cost = cost.as_chunks().0.as_chunks().0;
        let wrench = &wrench.as_chunks().0.as_chunks().0[..steps];
        Self {
            steps,
            position: &position.as_chunks().0[..steps],
            velocity: &velocity.as_chunks().0[..steps],
            wrench,
            cost,
        }
    }

    /// q of the joints, filtered as each axis's wrench estimate is, by column.
    pub(super) fn estimates(&self) -> &'a [[[f64; N]; D]] {
        self.wrench
    }

    /// q of the joints, rad per rad/s, by column.
    pub(super) fn positions(&self) -> &'a [[f64; N]] {
        self.position
    }

    /// q̇ of the joints, by column.
    pub(super) fn velocities(&self) -> &'a [[f64; N]] {
        self.velocity
    }

    /// For each column: what the last step adds to the joint-space cost of references in the two
    /// columns before, and in those before each column, per (rad/s)²: groups of columns, of each
    /// group one joint after the other.
    pub(super) fn costs(&self) -> impl Iterator<Item = &'a [[[f64; LANES]; N]]> {
        self.cost.chunks_exact(self.steps.div_ceil(LANES)).take(self.steps)
    }
}

/// What a joint and the wrench filters have done: q, what the joint carries, and q filtered as the
/// wrench estimate of each axis is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Response<const D: usize> {
    pub(super) position: f64,
    pub(super) carried: [f64; CARRIED],
    pub(super) filtered: [f64; D],
}

impl<const D: usize> Response<D> {
    pub(super) const NONE: Self = Self { position: 0.0, carried: [0.0; CARRIED], filtered: [0.0; D] };

    /// After one step of joint `joint` under the reference `r`.
    pub(super) fn advance<const N: usize>(&mut self, step: &Step<N, D>, joint: usize, r: f64) {
        let (q, before) = (self.position, self.carried);
        let moved = |by: &dyn Fn(usize) -> f64| -> f64 { (0..CARRIED).map(|from| by(from) * before[from]).sum() };
        for (axis, f) in self.filtered.iter_mut().enumerate() {
            let e = step.wrench_decay[axis];
            let moved = moved(&|from| step.wrench_by[from][(joint, axis)]);
            *f = e * *f + (1.0 - e) * q + moved + step.wrench_by_reference[(joint, axis)] * r;
        }
        self.position = q + moved(&|from| step.position_by[from][joint]) + step.position_by_reference[joint] * r;
        for (to, carried) in self.carried.iter_mut().enumerate() {
            *carried = moved(&|from| step.carried_by[to][from][joint]) + step.carried_by_reference[to][joint] * r;
        }
    }

    /// At the end of each step from `first` on, after a reference of 1 rad/s during `first`.
    pub(super) fn to_reference<const N: usize>(
        horizon: &Horizon<N, D>,
        joint: usize,
        first: usize,
    ) -> impl Iterator<Item = (usize, Self)> {
        let steps = horizon.steps().iter().enumerate().skip(first);
        steps.scan(Self::NONE, move |response, (k, step)| {
            response.advance(step, joint, if k == first { 1.0 } else { 0.0 });
            Some((k, *response))
        })
    }
}

/// Writes the tables; O(N H²) work.
pub(super) fn fill<const N: usize, const D: usize>(
    tables: &mut [f64],
    horizon: &Horizon<N, D>,
    weights: &Weights<N, D>,
) {
    let h = horizon.steps().len();
    let width = padded(h);
    let (position, rest) = tables.split_at_mut(motion_len::<N>(h));
    let (velocity, rest) = rest.split_at_mut(motion_len::<N>(h));
    let (wrench, cost) = rest.split_at_mut(D * motion_len::<N>(h));
    let wrench: &mut [[[f64; N]; D]] = wrench.as_chunks_mut().0.as_chunks_mut().0;
    for joint in 0..N {
        // The response at the end of the horizon to a reference during the step `column` steps
        // before the last.
        for (column, response) in Response::to_reference(horizon, joint, 0) {
            (position[column * N + joint], velocity[column * N + joint]) = (response.position, response.carried[0]);
            for (by_joint, filtered) in wrench[column].iter_mut().zip(response.filtered) {
                by_joint[joint] = filtered;
            }
        }
    }
    // Task weights mix the joints: their cost goes through the outputs of the TCP.
    let Weights::Joint { position: by_position, velocity: by_velocity, .. } = weights else { return };
    for joint in 0..N {
        for (r, s) in (0..h).flat_map(|r| (r..h).map(move |s| (r, s))) {
            let (q, v) = (|column: usize| position[column * N + joint], |column: usize| velocity[column * N + joint]);
            cost[(r * width + s / LANES * LANES) * N + joint * LANES + s % LANES] =
                by_position[joint] * q(r) * q(s) + by_velocity[joint] * v(r) * v(s);
        }
    }
}
