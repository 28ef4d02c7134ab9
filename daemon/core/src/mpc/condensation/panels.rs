//! Panels of responses: columns are inputs, in groups of [`LANES`], and of each group one output
//! after the other. Rows of H are sums of panel rows times factors.

use wide::f64x4;

use crate::mpc::qp::{LANES, MAX_VARIABLES};

/// Some columns of one row.
pub(super) type Group = [f64; LANES];

/// Most groups of columns.
const MAX_GROUPS: usize = MAX_VARIABLES.div_ceil(LANES);

/// A panel of K outputs at the start of `storage`, and the rest of it.
pub(super) fn panel<const K: usize>(storage: &mut [f64], groups: usize) -> (&mut [[Group; K]], &mut [f64]) {
    let (panel, rest) = storage.split_at_mut(groups * K * LANES);
    (&mut panel.as_chunks_mut().0.as_chunks_mut().0[..groups], rest)
}

/// The outputs' entries in a column.
#[inline(always)]
pub(super) fn entries<const K: usize>(panel: &[[Group; K]], column: usize) -> [f64; K] {
    let group = &panel[column / LANES];
    core::array::from_fn(|output| group[output][column % LANES])
}

#[inline(always)]
pub(super) fn put<const K: usize>(panel: &mut [[Group; K]], column: usize, entries: &[f64; K]) {
    let group = &mut panel[column / LANES];
    for output in 0..K {
        group[output][column % LANES] = entries[output];
    }
}

#[inline(always)]
pub(super) fn product<const K: usize>(a: &[f64; K], b: &[f64; K]) -> [f64; K] {
    core::array::from_fn(|k| a[k] * b[k])
}

/// What is added to a row of H from its first group on: factors times the rows of a panel.
pub(super) struct Terms<'a, const K: usize> {
    factors: [f64; K],
    panel: &'a [[Group; K]],
}

pub(super) const NOTHING: Terms<'static, 0> = Terms { factors: [], panel: &[[]; MAX_GROUPS] };

impl<'a, const K: usize> Terms<'a, K> {
    #[inline(always)]
    pub(super) fn new(panel: &'a [[Group; K]], index: usize, factors: [f64; K]) -> Self {
        Self { factors, panel: &panel[index / LANES..] }
    }

    /// Σ_o w_o s_o s_oᵀ, of row `index`.
    #[inline(always)]
    pub(super) fn squared(panel: &'a [[Group; K]], index: usize, weight: &[f64; K]) -> Self {
        Self::new(panel, index, product(weight, &entries(panel, index)))
    }
}

/// row ← start, or itself, plus the terms.
#[inline(always)]
pub(super) fn add<const A: usize, const B: usize>(
    row: &mut [Group],
    start: Option<&[Group]>,
    left: &Terms<'_, A>,
    right: &Terms<'_, B>,
) {
    let (by_left, by_right) = (left.factors.map(f64x4::splat), right.factors.map(f64x4::splat));
    let sum = |start: Group, left: &[Group; A], right: &[Group; B]| {
        // Two sums side by side hide the latency of the addition.
        let (mut total, mut other) = (f64x4::new(start), f64x4::ZERO);
        for t in 0..A {
            total = by_left[t].mul_add(f64x4::new(left[t]), total);
        }
        for t in 0..B {
            let right = f64x4::new(right[t]);
            other = if t > 0 { by_right[t].mul_add(right, other) } else { by_right[t] * right };
        }
        if B > 0 { (total + other).to_array() } else { total.to_array() }
    };
    let terms = left.panel.iter().zip(right.panel);
    match start {
        Some(start) => {
            for ((value, start), (left, right)) in row.iter_mut().zip(start).zip(terms) {
                *value = sum(*start, left, right);
            }
        }
        None => {
            for (value, (left, right)) in row.iter_mut().zip(terms) {
                *value = sum(*value, left, right);
            }
        }
    }
}
