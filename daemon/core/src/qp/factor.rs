//! The Cholesky factor H = Uᵀ U and the two substitutions with it.

use wide::f64x4;

use super::lanes::{LANES, dot4, groups, groups_mut, subtract4};

/// Groups of columns in a tile: as many as stay in registers.
const TILE: usize = 3;

/// Four rows of some groups of columns.
type Tile<const G: usize> = [[f64x4; G]; LANES];

/// U, upper triangular, padded with the identity to whole groups.
pub(super) struct Factor<'a> {
    /// Stride×stride row-major.
    pub u: &'a mut [f64],
    /// 1 / U_ii.
    pub inverse_diagonal: &'a mut [f64],
    pub stride: usize,
}

impl Factor<'_> {
    /// Factors H (n×stride row-major, upper triangle). False when H is not numerically positive definite.
    ///
    /// n³/6 multiplications and as many additions, in blocks of four rows: a tile of U is kept in registers while all rows
    /// above are subtracted from it.
    pub(super) fn compute(&mut self, hessian: &[f64], n: usize) -> bool {
        let stride = self.stride;
        let mut positive = true;
        for first in (0..stride).step_by(LANES) {
            let (above, rest) = self.u.split_at_mut(first * stride);
            let (block, _) = rest.split_at_mut(LANES * stride);
            let rows = &hessian[first * stride..(first + LANES) * stride];
            let mut part = tile::<1>(rows, stride, first, first, n);
            subtract_above(&mut part, above, stride, first, first);
            let mut diagonal = part.map(|[row]| row.to_array());
            let inverse = &mut self.inverse_diagonal[first..first + LANES];
            for i in 0..LANES {
                positive &= diagonal[i][i] > 0.0;
                let root = libm::sqrt(diagonal[i][i]);
                inverse[i] = 1.0 / root;
                for j in i..LANES {
                    diagonal[i][j] *= inverse[i];
                }
                for k in i + 1..LANES {
                    for j in k..LANES {
                        diagonal[k][j] -= diagonal[i][k] * diagonal[i][j];
                    }
                }
            }
            put(block, stride, first, &diagonal.map(|row| [f64x4::new(row)]));
            let inverse: [f64; LANES] = [inverse[0], inverse[1], inverse[2], inverse[3]];
            let mut column = first + LANES;
            while column < stride {
                let groups = (stride - column) / LANES;
                if groups >= TILE {
                    column += panel::<TILE>(rows, block, above, &diagonal, &inverse, (stride, first, column, n));
                } else {
                    column += panel::<1>(rows, block, above, &diagonal, &inverse, (stride, first, column, n));
                }
            }
        }
        // A NaN fails the comparison above.
        positive
    }

    /// x ← U⁻ᵀ x, for an x that is zero before `start` (a multiple of [`LANES`]); (stride − start)²/2 multiplications.
    pub(super) fn solve_transposed(&self, x: &mut [f64], start: usize) {
        let stride = self.stride;
        for first in (start..stride).step_by(LANES) {
            let rows = &self.u[first * stride..(first + LANES) * stride];
            let (head, tail) = x[first..stride].split_at_mut(LANES);
            let inverse = &self.inverse_diagonal[first..first + LANES];
            let u = |i: usize, j: usize| rows[i * stride + first + j];
            let a = head[0] * inverse[0];
            let b = (head[1] - u(0, 1) * a) * inverse[1];
            let c = (head[2] - u(0, 2) * a - u(1, 2) * b) * inverse[2];
            let d = (head[3] - u(0, 3) * a - u(1, 3) * b - u(2, 3) * c) * inverse[3];
            head.copy_from_slice(&[a, b, c, d]);
            let after = |i: usize| &rows[i * stride + first + LANES..(i + 1) * stride];
            subtract4(tail, [a, b, c, d], [after(0), after(1), after(2), after(3)]);
        }
    }

    /// x ← U⁻¹ x; stride²/2 multiplications.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let stride = self.stride;
        for first in (0..stride).step_by(LANES).rev() {
            let rows = &self.u[first * stride..(first + LANES) * stride];
            let (head, tail) = x[first..stride].split_at_mut(LANES);
            let inverse = &self.inverse_diagonal[first..first + LANES];
            let after = |i: usize| &rows[i * stride + first + LANES..(i + 1) * stride];
            let known = dot4([after(0), after(1), after(2), after(3)], tail);
            let u = |i: usize, j: usize| rows[i * stride + first + j];
            let d = (head[3] - known[3]) * inverse[3];
            let c = (head[2] - known[2] - u(2, 3) * d) * inverse[2];
            let b = (head[1] - known[1] - u(1, 2) * c - u(1, 3) * d) * inverse[1];
            let a = (head[0] - known[0] - u(0, 1) * b - u(0, 2) * c - u(0, 3) * d) * inverse[0];
            head.copy_from_slice(&[a, b, c, d]);
        }
    }
}

/// One tile of the rows of U from `first` on, right of the diagonal block. Gives the number of its columns.
#[inline(always)]
fn panel<const G: usize>(
    rows: &[f64],
    block: &mut [f64],
    above: &[f64],
    diagonal: &[[f64; LANES]; LANES],
    inverse: &[f64; LANES],
    (stride, first, column, n): (usize, usize, usize, usize),
) -> usize {
    let mut part = tile::<G>(rows, stride, first, column, n);
    subtract_above(&mut part, above, stride, first, column);
    substitute(&mut part, diagonal, inverse);
    put(block, stride, column, &part);
    G * LANES
}

/// Some columns of a block of four rows of H, the first of which is row `first`; those of the identity beyond n.
#[inline(always)]
fn tile<const G: usize>(rows: &[f64], stride: usize, first: usize, column: usize, n: usize) -> Tile<G> {
    let mut tile = [[f64x4::ZERO; G]; LANES];
    for (i, row) in tile.iter_mut().enumerate() {
        for (g, group) in row.iter_mut().enumerate() {
            let at = column + g * LANES;
            let mut values = groups(&rows[i * stride + at..])[0];
            if at + LANES > n {
                for (j, value) in values.iter_mut().enumerate().filter(|(j, _)| first + i >= n || at + j >= n) {
                    *value = if first + i == at + j { 1.0 } else { 0.0 };
                }
            }
            *group = f64x4::new(values);
        }
    }
    tile
}

#[inline(always)]
fn put<const G: usize>(block: &mut [f64], stride: usize, column: usize, tile: &Tile<G>) {
    for (i, row) in tile.iter().enumerate() {
        for (to, from) in groups_mut(&mut block[i * stride + column..]).iter_mut().zip(row) {
            *to = from.to_array();
        }
    }
}

/// tile −= Σ_k U[k, first..]ᵀ U[k, column..] over the rows above.
#[inline(always)]
fn subtract_above<const G: usize>(tile: &mut Tile<G>, above: &[f64], stride: usize, first: usize, column: usize) {
    let mut sums = *tile;
    for row in above.chunks_exact(stride) {
        let left = groups(&row[first..first + LANES])[0];
        let right = groups(&row[column..column + G * LANES]);
        let right: [f64x4; G] = core::array::from_fn(|g| f64x4::new(right[g]));
        for i in 0..LANES {
            let left = f64x4::splat(left[i]);
            for g in 0..G {
                sums[i][g] = left.mul_neg_add(right[g], sums[i][g]);
            }
        }
    }
    *tile = sums;
}

/// tile ← U_dd⁻ᵀ tile, with the four by four diagonal block.
#[inline(always)]
fn substitute<const G: usize>(tile: &mut Tile<G>, diagonal: &[[f64; LANES]; LANES], inverse: &[f64; LANES]) {
    for i in 0..LANES {
        for g in 0..G {
            tile[i][g] *= f64x4::splat(inverse[i]);
        }
        for k in i + 1..LANES {
            for g in 0..G {
                tile[k][g] = tile[i][g].mul_neg_add(f64x4::splat(diagonal[i][k]), tile[k][g]);
            }
        }
    }
}
