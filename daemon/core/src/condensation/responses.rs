//! What one joint does after its velocity reference was 1 rad/s during one step, and what that costs: scalars that depend
//! on horizon and weights only, computed once.

use crate::cost::Weights;
use crate::horizon::Horizon;
use crate::qp::{LANES, padded};

/// Views of the tables. Columns are steps in reversed order: column s belongs to the input of step H − 1 − s.
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
    padded(N * steps * steps)
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
        let wrench = wrench.as_chunks().0.as_chunks().0;
        Self { steps, position: position.as_chunks().0, velocity: velocity.as_chunks().0, wrench, cost }
    }

    /// q of the joints, filtered as each axis's wrench estimate is, at the end of step `step`, by
    /// column.
    pub(super) fn wrench(&self, step: usize) -> &'a [[[f64; N]; D]] {
        &self.wrench[step * self.steps..(step + 1) * self.steps]
    }

    /// q of the joints at the end of step `step`, rad per rad/s, by column.
    pub(super) fn position(&self, step: usize) -> &'a [[f64; N]] {
        &self.position[step * self.steps..(step + 1) * self.steps]
    }

    /// q̇ of the joints at the end of step `step`, by column.
    pub(super) fn velocity(&self, step: usize) -> &'a [[f64; N]] {
        &self.velocity[step * self.steps..(step + 1) * self.steps]
    }

    /// For each column: joint-space cost of references in its steps and in those of each column, per (rad/s)²: groups of
    /// columns, of each group one joint after the other. Over an even horizon only what the last step adds to the cost of the
    /// two columns before.
    pub(super) fn costs(&self) -> impl Iterator<Item = &'a [[[f64; LANES]; N]]> {
        self.cost.chunks_exact(self.steps.div_ceil(LANES)).take(self.steps)
    }
}

/// Writes the tables; O(N H³) work.
pub(super) fn fill<const N: usize, const D: usize>(
    tables: &mut [f64],
    horizon: &Horizon<N, D>,
    weights: &Weights<N, D>,
) {
    let steps = horizon.steps();
    let (h, width) = (steps.len(), padded(steps.len()));
    tables.fill(0.0);
    let (position, rest) = tables.split_at_mut(motion_len::<N>(h));
    let (velocity, rest) = rest.split_at_mut(motion_len::<N>(h));
    let (wrench, cost) = rest.split_at_mut(D * motion_len::<N>(h));
    let wrench: &mut [[[f64; N]; D]] = wrench.as_chunks_mut().0.as_chunks_mut().0;
    let first = if horizon.is_even() { h - 1 } else { 0 };
    for joint in 0..N {
        for input in 0..h {
            let (mut q, mut v, mut filtered) = (0.0, 0.0, [0.0; D]);
            for (k, step) in steps.iter().enumerate().skip(input) {
                let r = if k == input { 1.0 } else { 0.0 };
                for (axis, f) in filtered.iter_mut().enumerate() {
                    let e = step.wrench_decay[axis];
                    let (by_velocity, by_reference) = (&step.wrench_by_velocity, &step.wrench_by_reference);
                    *f = e * *f + (1.0 - e) * q + by_velocity[(joint, axis)] * v + by_reference[(joint, axis)] * r;
                }
                q += step.position_by_velocity[joint] * v + step.position_by_reference[joint] * r;
                v = step.velocity_decay[joint] * v + step.velocity_by_reference[joint] * r;
                let column = k * h + h - 1 - input;
                (position[column * N + joint], velocity[column * N + joint]) = (q, v);
                for (by_joint, f) in wrench[column].iter_mut().zip(filtered) {
                    by_joint[joint] = f;
                }
            }
        }
    }
    // Task weights mix the joints: their cost goes through the outputs of the TCP.
    let Weights::Joint { position: by_position, velocity: by_velocity, .. } = weights else { return };
    for joint in 0..N {
        for (r, s) in (0..h).flat_map(|r| (r..h).map(move |s| (r, s))) {
            cost[(r * width + s / LANES * LANES) * N + joint * LANES + s % LANES] = (first..h)
                .map(|k| {
                    let (r, s) = ((k * h + r) * N + joint, (k * h + s) * N + joint);
                    let squares =
                        by_position[joint] * position[r] * position[s] + by_velocity[joint] * velocity[r] * velocity[s];
                    horizon.share(k) * squares
                })
                .sum();
        }
    }
}
