//! The Cholesky factor H = Uᵀ U and the two substitutions with it.
//!
//! U stands in tiles of four rows and four columns, block row after block row, padded with the
//! identity. Of a tile on the diagonal only the inverse is kept: so neither factoring nor
//! substituting waits for one division after the other.

use wide::f64x4;

use super::lanes::{LANES, Tile, groups, groups_mut, products, subtract_rows, tiles_mut};

/// Tiles side by side that stay in registers.
const ABREAST: usize = 3;

/// Some tiles side by side, by row and tile.
type Panel<const G: usize> = [[f64x4; G]; LANES];

/// U, upper triangular.
pub(super) struct Factor<'a> {
    tiles: &'a mut [Tile],
    /// Of each tile on the diagonal the inverse, by rows and by columns.
    inverses: &'a mut [[Tile; 2]],
    blocks: usize,
}

impl<'a> Factor<'a> {
    /// Numbers that it is stored in, of a problem with this stride.
    pub(super) const fn storage_len(stride: usize) -> usize {
        stride * stride + 2 * LANES * stride
    }

    /// A factor within `storage`, not computed yet.
    pub(super) fn within(storage: &'a mut [f64], stride: usize) -> Self {
        let (tiles, inverses) = storage.split_at_mut(stride * stride);
        Self { tiles: tiles_mut(tiles), inverses: tiles_mut(inverses).as_chunks_mut().0, blocks: stride / LANES }
    }

    /// Factors H (n×n, rows a stride apart, upper triangle). False when H is not numerically
    /// positive definite.
    ///
    /// n³/6 multiplications and as many additions: a few tiles of U are kept in registers while all
    /// rows above are subtracted from them.
    pub(super) fn compute(&mut self, hessian: &[f64], n: usize) -> bool {
        let blocks = self.blocks;
        let mut positive = true;
        for block in 0..blocks {
            let (above, rest) = self.tiles.split_at_mut(block * blocks);
            let rows = &hessian[block * LANES * blocks * LANES..];
            let place = Place { rows, above, blocks, block, n };
            let [[a], [b], [c], [d]] = place.panel::<1>(block);
            let (inverse, is_positive) = inverse_of_root([a, b, c, d].map(f64x4::to_array));
            positive &= is_positive;
            self.inverses[block] = [inverse, transposed(&inverse)];
            let mut column = block + 1;
            while column < blocks {
                column += match blocks - column {
                    1 => place.finish::<1>(column, &inverse, rest),
                    // Not one alone: it would wait for each of its sums.
                    2 | 4 => place.finish::<2>(column, &inverse, rest),
                    _ => place.finish::<ABREAST>(column, &inverse, rest),
                };
            }
        }
        positive
    }

    /// Tiles right of the diagonal in a block row.
    #[inline(always)]
    fn right_of_diagonal(&self, block: usize) -> &[Tile] {
        &self.tiles[block * self.blocks + block + 1..(block + 1) * self.blocks]
    }

    /// x ← U⁻ᵀ x, for an x that is zero before `start` (a multiple of [`LANES`]); (n − start)²/2
    /// multiplications.
    pub(super) fn solve_transposed(&self, x: &mut [f64], start: usize) {
        let mut rest = &mut groups_mut(x)[start / LANES..self.blocks];
        let mut block = start / LANES;
        while let Some((head, tail)) = rest.split_first_mut() {
            *head = combination(head, &self.inverses[block][0]);
            subtract_rows(tail, head, self.right_of_diagonal(block));
            (rest, block) = (tail, block + 1);
        }
    }

    /// x ← U⁻¹ x; n²/2 multiplications.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let x = &mut groups_mut(x)[..self.blocks];
        for block in (0..self.blocks).rev() {
            let (head, tail) = x[block..].split_at_mut(1);
            let known = products(self.right_of_diagonal(block), tail);
            let left = core::array::from_fn(|i| head[0][i] - known[i]);
            head[0] = combination(&left, &self.inverses[block][1]);
        }
    }
}

/// Where a block row of U is computed.
struct Place<'a> {
    /// The rows of H from those of the block on.
    rows: &'a [f64],
    /// The block rows of U above.
    above: &'a [Tile],
    blocks: usize,
    block: usize,
    n: usize,
}

impl Place<'_> {
    /// Some tiles of H, minus Σ_k U[k, block]ᵀ U[k, column..] over the rows above.
    #[inline(always)]
    fn panel<const G: usize>(&self, column: usize) -> Panel<G> {
        let stride = self.blocks * LANES;
        let mut sums: Panel<G> = core::array::from_fn(|i| {
            let row = groups(&self.rows[i * stride..]);
            let row = &row[column..column + G];
            core::array::from_fn(|g| f64x4::new(row[g]))
        });
        if (column + G) * LANES > self.n {
            // Only the last tile reaches beyond n; there the identity stands.
            for i in 0..LANES {
                let mut values = sums[i][G - 1].to_array();
                for (lane, value) in values.iter_mut().enumerate() {
                    let (row, column) = (self.block * LANES + i, (column + G - 1) * LANES + lane);
                    if row >= self.n || column >= self.n {
                        *value = if row == column { 1.0 } else { 0.0 };
                    }
                }
                sums[i][G - 1] = f64x4::new(values);
            }
        }
        for row in self.above.chunks_exact(self.blocks) {
            let (left, right) = (&row[self.block], &row[column..column + G]);
            for k in 0..LANES {
                let right: [f64x4; G] = core::array::from_fn(|g| f64x4::new(right[g][k]));
                for i in 0..LANES {
                    let left = f64x4::splat(left[k][i]);
                    for g in 0..G {
                        sums[i][g] = left.mul_neg_add(right[g], sums[i][g]);
                    }
                }
            }
        }
        sums
    }

    /// Writes some tiles of U into the block row, U_dd⁻ᵀ times what [`Self::panel`] gives; says how
    /// many.
    #[inline(always)]
    fn finish<const G: usize>(&self, column: usize, inverse: &Tile, row: &mut [Tile]) -> usize {
        let sums = self.panel::<G>(column);
        for (g, tile) in row[column..column + G].iter_mut().enumerate() {
            for j in 0..LANES {
                let mut value = sums[0][g] * f64x4::splat(inverse[0][j]);
                for i in 1..=j {
                    value = sums[i][g].mul_add(f64x4::splat(inverse[i][j]), value);
                }
                tile[j] = value.to_array();
            }
        }
        G
    }
}

/// U⁻¹ for the tile A = Uᵀ U, of which the upper triangle is read; and whether A is positive
/// definite. With A = Lᵀ D L, L of unit diagonal, U⁻¹ = L⁻¹ D^(−1/2): the roots are taken side by
/// side.
#[inline(always)]
fn inverse_of_root(a: Tile) -> (Tile, bool) {
    let d0 = a[0][0];
    let inverse = 1.0 / d0;
    let (l01, l02, l03) = (a[0][1] * inverse, a[0][2] * inverse, a[0][3] * inverse);
    let d1 = a[1][1] - l01 * a[0][1];
    let (a12, a13) = (a[1][2] - l01 * a[0][2], a[1][3] - l01 * a[0][3]);
    let (a22, a23, a33) = (a[2][2] - l02 * a[0][2], a[2][3] - l02 * a[0][3], a[3][3] - l03 * a[0][3]);
    let inverse = 1.0 / d1;
    let (l12, l13) = (a12 * inverse, a13 * inverse);
    let (d2, a23, a33) = (a22 - l12 * a12, a23 - l12 * a13, a33 - l13 * a13);
    let l23 = a23 / d2;
    let d3 = a33 - l23 * a23;
    let roots = f64x4::new([d0, d1, d2, d3]).sqrt();
    let [r0, r1, r2, r3] = (f64x4::ONE / roots).to_array();
    let (m02, m13) = (l01 * l12 - l02, l12 * l23 - l13);
    let m03 = l01 * l13 - l03 - l23 * m02;
    let rows = [
        [r0, -l01 * r1, m02 * r2, m03 * r3],
        [0.0, r1, -l12 * r2, m13 * r3],
        [0.0, 0.0, r2, -l23 * r3],
        [0.0, 0.0, 0.0, r3],
    ];
    // A NaN fails as well.
    (rows, d0 > 0.0 && d1 > 0.0 && d2 > 0.0 && d3 > 0.0)
}

#[inline(always)]
fn transposed(tile: &Tile) -> Tile {
    f64x4::transpose(tile.map(f64x4::new)).map(f64x4::to_array)
}

/// Σ_i factors_i · row i.
#[inline(always)]
fn combination(factors: &[f64; LANES], tile: &Tile) -> [f64; LANES] {
    let row = |i: usize| f64x4::new(tile[i]);
    let factor = factors.map(f64x4::splat);
    let (first, second) = (row(0) * factor[0], row(2) * factor[2]);
    (row(1).mul_add(factor[1], first) + row(3).mul_add(factor[3], second)).to_array()
}
