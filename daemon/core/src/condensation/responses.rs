//! What one joint does after its velocity reference was 1 rad/s during one step, and what that costs: scalars that depend
//! on horizon and weights only, computed once.

use crate::cost::Weights;
use crate::horizon::Horizon;
use crate::qp::padded;

/// Views of the tables. Columns are steps in reversed order: column s belongs to the input of step H − 1 − s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Responses<'a, const N: usize> {
    /// Numbers between rows.
    stride: usize,
    position: &'a [f64],
    velocity: &'a [f64],
    cost: &'a [f64],
}

/// Rows are padded so that whole groups can be read from any column on.
const fn stride_of(steps: usize) -> usize {
    padded(steps + 1)
}

/// Numbers in all tables.
pub(super) const fn table_len<const N: usize>(steps: usize) -> usize {
    3 * N * steps * stride_of(steps)
}

impl<'a, const N: usize> Responses<'a, N> {
    /// The tables that [`fill`] has written.
    pub(super) fn of(tables: &'a [f64], steps: usize) -> Self {
        let table = table_len::<N>(steps) / 3;
        let (position, rest) = tables.split_at(table);
        let (velocity, rest) = rest.split_at(table);
        Self { stride: stride_of(steps), position, velocity, cost: &rest[..table] }
    }

    fn row(&self, table: &'a [f64], instant: usize, joint: usize) -> &'a [f64] {
        let at = (instant * N + joint) * self.stride;
        &table[at..at + self.stride]
    }

    /// q of a joint at the end of step `step`, rad per rad/s.
    pub(super) fn position(&self, step: usize, joint: usize) -> &'a [f64] {
        self.row(self.position, step, joint)
    }

    /// q̇ of a joint at the end of step `step`.
    pub(super) fn velocity(&self, step: usize, joint: usize) -> &'a [f64] {
        self.row(self.velocity, step, joint)
    }

    /// Joint-space cost of references in the steps of column `reversed` and of each column, per (rad/s)²; a row for each
    /// joint, and the numbers between rows. Over an even horizon only what the last step adds to the cost of the two
    /// columns before.
    pub(super) fn cost(&self, reversed: usize) -> (&'a [f64], usize) {
        (&self.cost[reversed * N * self.stride..(reversed + 1) * N * self.stride], self.stride)
    }
}

/// Writes the tables; O(N H³) work.
pub(super) fn fill<const N: usize, const D: usize>(
    tables: &mut [f64],
    horizon: &Horizon<N, D>,
    weights: &Weights<N, D>,
) {
    let steps = horizon.steps();
    let h = steps.len();
    let (stride, table) = (stride_of(h), table_len::<N>(h) / 3);
    tables[..3 * table].fill(0.0);
    let (position, rest) = tables.split_at_mut(table);
    let (velocity, cost) = rest.split_at_mut(table);
    for joint in 0..N {
        for input in 0..h {
            let (mut q, mut v) = (0.0, 0.0);
            for (k, step) in steps.iter().enumerate().skip(input) {
                let r = if k == input { 1.0 } else { 0.0 };
                q += step.position_by_velocity[joint] * v + step.position_by_reference[joint] * r;
                v = step.velocity_decay[joint] * v + step.velocity_by_reference[joint] * r;
                let at = (k * N + joint) * stride + h - 1 - input;
                (position[at], velocity[at]) = (q, v);
            }
        }
    }
    // Task weights mix the joints: their cost goes through the outputs of the TCP.
    let Weights::Joint { position: by_position, velocity: by_velocity, .. } = weights else { return };
    let first = if horizon.is_even() { h - 1 } else { 0 };
    for joint in 0..N {
        for (r, s) in (0..h).flat_map(|r| (r..h).map(move |s| (r, s))) {
            cost[(r * N + joint) * stride + s] = (first..h)
                .map(|k| {
                    let at = (k * N + joint) * stride;
                    by_position[joint] * position[at + r] * position[at + s]
                        + by_velocity[joint] * velocity[at + r] * velocity[at + s]
                })
                .sum();
        }
    }
}
