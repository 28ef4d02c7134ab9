//! Vector operations in groups of [`LANES`] numbers. Every slice has a multiple of [`LANES`] elements; the order of operations,
//! and so each bit of a result, depends on lengths only. Products are added without being rounded in between where the
//! processor can (x86-64-v3).

use wide::f64x4;

/// Numbers in a group.
pub const LANES: usize = 4;

/// `length` rounded up to whole groups.
pub const fn padded(length: usize) -> usize {
    length.div_ceil(LANES) * LANES
}

/// A slice as groups.
#[inline(always)]
pub(crate) fn groups(x: &[f64]) -> &[[f64; LANES]] {
    x.as_chunks().0
}

#[inline(always)]
pub(crate) fn groups_mut(x: &mut [f64]) -> &mut [[f64; LANES]] {
    x.as_chunks_mut().0
}

#[inline(always)]
fn sum(x: f64x4) -> f64 {
    let [a, b, c, d] = x.to_array();
    (a + b) + (c + d)
}

/// aᵀb, of the shorter length.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums side by side hide the latency of the addition.
    let mut sums = [f64x4::ZERO; 4];
    let (a4, a_rest) = groups(a).as_chunks::<4>();
    let (b4, b_rest) = groups(b).as_chunks::<4>();
    for (a, b) in a4.iter().zip(b4) {
        for i in 0..4 {
            sums[i] = f64x4::new(a[i]).mul_add(f64x4::new(b[i]), sums[i]);
        }
    }
    for (a, b) in a_rest.iter().zip(b_rest) {
        sums[0] = f64x4::new(*a).mul_add(f64x4::new(*b), sums[0]);
    }
    sum((sums[0] + sums[1]) + (sums[2] + sums[3]))
}

/// Four dot products with one vector: [aᵀx, bᵀx, cᵀx, dᵀx].
#[inline(always)]
pub(super) fn dot4(rows: [&[f64]; 4], x: &[f64]) -> [f64; 4] {
    let x = groups(x);
    let rows = rows.map(|row| &groups(row)[..x.len()]);
    let mut sums = [f64x4::ZERO; 4];
    for (group, x) in x.iter().enumerate() {
        let x = f64x4::new(*x);
        for i in 0..4 {
            sums[i] = f64x4::new(rows[i][group]).mul_add(x, sums[i]);
        }
    }
    sums.map(sum)
}

/// x −= factor · a.
#[inline(always)]
pub(super) fn subtract(x: &mut [f64], factor: f64, a: &[f64]) {
    let factor = f64x4::splat(factor);
    for (x, a) in groups_mut(x).iter_mut().zip(groups(a)) {
        *x = f64x4::new(*a).mul_neg_add(factor, f64x4::new(*x)).to_array();
    }
}

/// x −= Σ factors_i · rows_i.
#[inline(always)]
pub(super) fn subtract4(x: &mut [f64], factors: [f64; 4], rows: [&[f64]; 4]) {
    let x = groups_mut(x);
    let rows = rows.map(|row| &groups(row)[..x.len()]);
    let factors = factors.map(f64x4::splat);
    for (group, x) in x.iter_mut().enumerate() {
        let mut value = f64x4::new(*x);
        for i in 0..4 {
            value = f64x4::new(rows[i][group]).mul_neg_add(factors[i], value);
        }
        *x = value.to_array();
    }
}

/// Σ x².
pub(super) fn norm_squared(x: &[f64]) -> f64 {
    dot(x, x)
}

/// Rotates (a, b) to (cos a + sin b, cos b − sin a).
pub(super) fn rotate(a: &mut [f64], b: &mut [f64], cos: f64, sin: f64) {
    let (cos, sin) = (f64x4::splat(cos), f64x4::splat(sin));
    for (a, b) in groups_mut(a).iter_mut().zip(groups_mut(b)) {
        let (old_a, old_b) = (f64x4::new(*a), f64x4::new(*b));
        *a = cos.mul_add(old_a, sin * old_b).to_array();
        *b = sin.mul_neg_add(old_a, cos * old_b).to_array();
    }
}
