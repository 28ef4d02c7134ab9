//! Vector operations in groups of [`LANES`] numbers. Every slice has a multiple of [`LANES`]
//! elements; the order of operations, and so each bit of a result, depends on lengths only.
//! Products are added without being rounded in between where the processor can (x86-64-v3).

use wide::f64x4;

/// Numbers in a group.
pub const LANES: usize = 4;

/// `length` rounded up to whole groups.
pub const fn padded(length: usize) -> usize {
    length.div_ceil(LANES) * LANES
}

/// Four rows of four columns; side by side, four rows of any length.
pub(super) type Tile = [[f64; LANES]; LANES];

/// Numbers in a cache line: a group that crosses from one to the next takes twice as long to read.
pub(crate) const CACHE_LINE: usize = 8;

/// Numbers that storage must have beyond what is kept in it, for [`before_cache_line`].
pub(crate) const ALIGNMENT: usize = CACHE_LINE - 1;

/// How many numbers of a storage stand before its first cache line.
pub(crate) fn before_cache_line(storage: &[f64]) -> usize {
    storage.as_ptr().align_offset(CACHE_LINE * size_of::<f64>()).min(ALIGNMENT)
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

/// Storage as tiles.
#[inline(always)]
pub(super) fn tiles_mut(storage: &mut [f64]) -> &mut [Tile] {
    storage.as_chunks_mut().0.as_chunks_mut().0
}

/// Fills the last group of a slice: what a number of elements is rounded up by, and some before.
#[inline(always)]
pub(crate) fn fill_last_group(x: &mut [f64], value: f64) {
    if let Some(group) = groups_mut(x).last_mut() {
        *group = [value; LANES];
    }
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

/// Σ x².
#[inline(always)]
pub(super) fn norm_squared(x: &[f64]) -> f64 {
    dot(x, x)
}

/// Σ (a − b)².
#[inline(always)]
pub(super) fn distance_squared(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = f64x4::ZERO;
    for (a, b) in groups(a).iter().zip(groups(b)) {
        let apart = f64x4::new(*a) - f64x4::new(*b);
        sums = apart.mul_add(apart, sums);
    }
    sum(sums)
}

/// x += factor · a.
#[inline(always)]
pub(super) fn add_scaled(x: &mut [f64], factor: f64, a: &[f64]) {
    let factor = f64x4::splat(factor);
    for (x, a) in groups_mut(x).iter_mut().zip(groups(a)) {
        *x = f64x4::new(*a).mul_add(factor, f64x4::new(*x)).to_array();
    }
}

/// max |x|; x must not contain NaN.
#[inline(always)]
pub(super) fn largest_magnitude(x: &[f64]) -> f64 {
    // Side by side as in [`dot`].
    let mut largest = [f64x4::ZERO; 4];
    let (x4, x_rest) = groups(x).as_chunks::<4>();
    for x in x4 {
        for i in 0..4 {
            largest[i] = f64x4::new(x[i]).abs().fast_max(largest[i]);
        }
    }
    for x in x_rest {
        largest[0] = f64x4::new(*x).abs().fast_max(largest[0]);
    }
    let [a, b, c, d] = largest[0].fast_max(largest[1]).fast_max(largest[2].fast_max(largest[3])).to_array();
    a.max(b).max(c.max(d))
}

/// Four rows times x.
#[inline(always)]
pub(super) fn products(rows: &[Tile], x: &[[f64; LANES]]) -> [f64; LANES] {
    // Two sums for each row hide the latency of the addition.
    let mut sums = [[f64x4::ZERO; LANES]; 2];
    let (pairs, last) = rows.as_chunks::<2>();
    let (x_pairs, x_last) = x.as_chunks::<2>();
    for (tiles, x) in pairs.iter().zip(x_pairs) {
        for (sums, (tile, x)) in sums.iter_mut().zip(tiles.iter().zip(x)) {
            let x = f64x4::new(*x);
            for i in 0..LANES {
                sums[i] = f64x4::new(tile[i]).mul_add(x, sums[i]);
            }
        }
    }
    for (tile, x) in last.iter().zip(x_last) {
        let x = f64x4::new(*x);
        for i in 0..LANES {
            sums[0][i] = f64x4::new(tile[i]).mul_add(x, sums[0][i]);
        }
    }
    let [a, b, c, d] = f64x4::transpose(core::array::from_fn(|i| sums[0][i] + sums[1][i]));
    ((a + b) + (c + d)).to_array()
}

/// x −= Σ factors_i · row i.
#[inline(always)]
pub(super) fn subtract_rows(x: &mut [[f64; LANES]], factors: &[f64; LANES], rows: &[Tile]) {
    let factors = factors.map(f64x4::splat);
    for (x, tile) in x.iter_mut().zip(rows) {
        let mut value = f64x4::new(*x);
        for i in 0..LANES {
            value = f64x4::new(tile[i]).mul_neg_add(factors[i], value);
        }
        *x = value.to_array();
    }
}
