//! The working set W of the dual method, in the coordinates y = U z, in which H is the identity:
//! the normals of its rows as Cᵀ = Q R with orthonormal columns in Q. Orthogonalising twice instead
//! of factoring C Cᵀ keeps nearly parallel rows apart: on a plane the force rows of two axes are
//! parallel, and those of successive steps nearly so.

mod projection;
#[cfg(test)]
mod tests;

use core::ops::Range;

use wide::f64x4;

use super::lanes::{LANES, Tile, groups, groups_mut, norm_squared, padded, products, subtract_rows};
use super::{MAX_VARIABLES, RowState};
use projection::Projection;

/// Part of its length that has to be left of a normal for once to be enough, squared: a hundredth.
/// What rounding leaves of the others in it, some 1e-16 of its length before, is 1e-14 of it then:
/// two digits of orthogonality, and a hundredth of what `projection` takes for rounding.
const ONCE: f64 = 1e-2 * 1e-2;
/// The same for a thorough set, which gives nothing away: that of Daniel, Gragg, Kaufman & Stewart.
const ONCE_THOROUGH: f64 = 0.5;

/// One row of W.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    pub row: u16,
    pub side: RowState,
    /// The bound that is met, with the sign of the normal c: cᵀy = bound.
    pub bound: f64,
    /// λ ≥ 0.
    pub multiplier: f64,
    /// ‖c‖: what λ is multiplied with to be compared between rows of different units.
    pub length: f64,
    /// 1 over its diagonal element of R.
    inverse_pivot: f64,
    /// Columns before this one are zero in this column of Q.
    start: usize,
}

impl Member {
    const NONE: Self = Self {
        row: 0,
        side: RowState::Inactive,
        bound: 0.0,
        multiplier: 0.0,
        length: 0.0,
        inverse_pivot: 0.0,
        start: 0,
    };

    pub(super) fn new(row: usize, side: RowState, bound: f64) -> Self {
        Self { row: row as u16, side, bound, ..Self::NONE }
    }

    /// How hard it pushes: λ ‖c‖.
    pub(super) fn push(&self) -> f64 {
        self.multiplier * self.length
    }
}

/// (cos a + sin b, cos b − sin a).
#[inline(always)]
fn turned((a, b): (f64, f64), cos: f64, sin: f64) -> (f64, f64) {
    (cos * a + sin * b, cos * b - sin * a)
}

pub(super) struct WorkingSet<'a> {
    pub members: &'a mut [Member; MAX_VARIABLES],
    pub len: usize,
    /// Columns of Q, four a block; zero behind the last one in its block.
    pub q: &'a mut [Tile],
    /// Columns of R in the same way; below the diagonal anything.
    pub r: &'a mut [Tile],
    pub stride: usize,
    /// Whether every column of Q is to be orthogonal to rounding, whatever that takes.
    pub is_thorough: bool,
}

pub(super) const NO_MEMBERS: [Member; MAX_VARIABLES] = [Member::NONE; MAX_VARIABLES];

impl WorkingSet<'_> {
    pub(super) fn contains(&self, row: usize) -> bool {
        self.members[..self.len].iter().any(|member| usize::from(member.row) == row)
    }

    /// The tiles of the block that a column of Q is in.
    fn block_of(&self, column: usize) -> Range<usize> {
        let (block, groups) = (column / LANES, self.stride / LANES);
        block * groups..(block + 1) * groups
    }

    /// An element of R.
    fn element(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.r[column / LANES * (self.stride / LANES) + row / LANES][column % LANES][row % LANES]
    }

    /// Every block of Q from column `start` of it on.
    fn blocks(&self, start: usize) -> impl Iterator<Item = &[Tile]> {
        let blocks = self.q.chunks_exact(self.stride / LANES).take(self.len.div_ceil(LANES));
        blocks.map(move |block| &block[start / LANES..])
    }

    /// Before this column all of Q is zero.
    fn start(&self) -> usize {
        self.members[..self.len].iter().fold(self.stride, |start, member| start.min(member.start))
    }

    /// c ← c − Q Qᵀ c, d ← Qᵀ c, for a c that is zero before `start`; 2 to 4 len·stride
    /// multiplications.
    pub(super) fn project(&self, c: &mut [f64], d: &mut [f64], start: usize) -> Projection {
        let whole = norm_squared(&c[start..]);
        d[..padded(self.len)].fill(0.0);
        let start = start.min(self.start());
        let c = &mut groups_mut(c)[start / LANES..];
        let (mut last, mut rest) = (whole, whole);
        let once = if self.is_thorough { ONCE_THOROUGH } else { ONCE };
        // Twice is always enough.
        for _ in 0..2 {
            for (columns, d) in self.blocks(start).zip(groups_mut(d)) {
                let parts = products(columns, c);
                subtract_rows(c, &parts, columns);
                (0..LANES).for_each(|i| d[i] += parts[i]);
            }
            rest = norm_squared(c.as_flattened());
            if rest > once * last {
                break;
            }
            last = rest;
        }
        Projection::new(whole, rest, start)
    }

    /// Appends a member whose normal has been projected: `c` is what is left of it, `d` its part
    /// within W.
    pub(super) fn push(&mut self, member: Member, projection: &Projection, c: &[f64], d: &[f64]) {
        let (length, column) = (libm::sqrt(projection.rest), self.len);
        let inverse_pivot = 1.0 / length;
        let block = self.block_of(column);
        for (tile, c) in self.q[block].iter_mut().zip(groups(c)) {
            if column % LANES == 0 {
                *tile = [[0.0; LANES]; LANES];
            }
            tile[column % LANES] = c.map(|c| c * inverse_pivot);
        }
        let block = self.block_of(column);
        for (tile, d) in self.r[block].iter_mut().zip(groups(d)).take(column / LANES + 1) {
            if column % LANES == 0 {
                *tile = [[0.0; LANES]; LANES];
            }
            tile[column % LANES] = *d;
        }
        *self.element(column, column) = length;
        let whole = libm::sqrt(projection.whole);
        self.members[column] = Member { length: whole, inverse_pivot, start: projection.start, ..member };
        self.len += 1;
    }

    /// Takes member `index` out; 4 (len − index) stride multiplications for the rotations that make
    /// R triangular again.
    /// `d` is rotated with Q; [`Self::release`] needs it.
    pub(super) fn remove(&mut self, index: usize, d: &mut [f64]) {
        self.rotate_out(index, d);
        self.drop_last();
    }

    /// Takes member `index` out from under a projected c, which gets back the part that only that
    /// member took away.
    pub(super) fn release(
        &mut self,
        index: usize,
        projection: &Projection,
        c: &mut [f64],
        d: &mut [f64],
    ) -> Projection {
        self.rotate_out(index, d);
        let (last, start) = (self.len - 1, projection.start);
        let part = f64x4::splat(d[last]);
        let block = &self.q[self.block_of(last)];
        for (c, tile) in groups_mut(c).iter_mut().zip(block).skip(start / LANES) {
            *c = f64x4::new(tile[last % LANES]).mul_add(part, f64x4::new(*c)).to_array();
        }
        d[last] = 0.0;
        self.drop_last();
        Projection::new(projection.whole, norm_squared(&c[start / LANES * LANES..]), start)
    }

    /// Makes member `index` the last one, and the last column of Q what only it adds to the span.
    fn rotate_out(&mut self, index: usize, d: &mut [f64]) {
        let last = self.len - 1;
        // From the right: a column leaves R, those behind it move up and have one number below the
        // diagonal.
        for column in index..last {
            let (here, there) = (self.block_of(column), self.block_of(column + 1));
            for (here, there) in here.zip(there).take((column + 1) / LANES + 1) {
                self.r[here][column % LANES] = self.r[there][(column + 1) % LANES];
            }
        }
        for i in index..last {
            let (a, b) = (*self.element(i, i), *self.element(i + 1, i));
            let inverse_pivot = 1.0 / libm::sqrt(a * a + b * b);
            let (cos, sin) = (a * inverse_pivot, b * inverse_pivot);
            // Whole blocks: what stands below the diagonal may be rotated as well.
            let ((top, a), (bottom, b)) = ((i / LANES, i % LANES), ((i + 1) / LANES, (i + 1) % LANES));
            for tiles in self.r.chunks_exact_mut(self.stride / LANES).take(last / LANES + 1).skip(i / LANES) {
                for column in 0..LANES {
                    let pair = (tiles[top][column][a], tiles[bottom][column][b]);
                    (tiles[top][column][a], tiles[bottom][column][b]) = turned(pair, cos, sin);
                }
            }
            (d[i], d[i + 1]) = turned((d[i], d[i + 1]), cos, sin);
            let start = self.members[i].start.min(self.members[i + 1].start);
            self.rotate(i, start, cos, sin);
            self.members[i] = Member { start, inverse_pivot, ..self.members[i + 1] };
            self.members[i + 1].start = start;
        }
    }

    fn drop_last(&mut self) {
        let last = self.len - 1;
        let block = self.block_of(last);
        self.q[block.clone()].iter_mut().for_each(|tile| tile[last % LANES] = [0.0; LANES]);
        self.r[block].iter_mut().take(last / LANES + 1).for_each(|tile| tile[last % LANES] = [0.0; LANES]);
        self.len = last;
    }

    /// Rotates columns (i, i + 1) of Q from `start` on to (cos q_i + sin q_{i+1}, cos q_{i+1} − sin
    /// q_i).
    fn rotate(&mut self, i: usize, start: usize, cos: f64, sin: f64) {
        let (cos, sin) = (f64x4::splat(cos), f64x4::splat(sin));
        let (here, there) = (self.block_of(i), self.block_of(i + 1));
        for (here, there) in here.zip(there).skip(start / LANES) {
            let (a, b) = (f64x4::new(self.q[here][i % LANES]), f64x4::new(self.q[there][(i + 1) % LANES]));
            self.q[here][i % LANES] = cos.mul_add(a, sin * b).to_array();
            self.q[there][(i + 1) % LANES] = sin.mul_neg_add(a, cos * b).to_array();
        }
    }

    /// 1 over the diagonal elements of R in a block; 0 behind the last one.
    fn inverse_pivots(&self, block: usize) -> [f64; LANES] {
        let members = &self.members[..self.len];
        core::array::from_fn(|i| members.get(block * LANES + i).map_or(0.0, |member| member.inverse_pivot))
    }

    /// d ← R⁻¹ d; zero behind it in its last group.
    pub(super) fn solve(&self, d: &mut [f64]) {
        for block in (0..self.len.div_ceil(LANES)).rev() {
            let (tiles, pivots) = (&self.r[self.block_of(block * LANES)], self.inverse_pivots(block));
            let (above, here) = groups_mut(d).split_at_mut(block);
            let mut found = here[0];
            for i in (0..LANES).rev() {
                found[i] *= pivots[i];
                (0..i).for_each(|k| found[k] -= found[i] * tiles[block][i][k]);
            }
            here[0] = found;
            subtract_rows(above, &found, tiles);
        }
    }

    /// d ← R⁻ᵀ d; zero behind it in its last group.
    fn solve_transposed(&self, d: &mut [f64]) {
        for block in 0..self.len.div_ceil(LANES) {
            let (tiles, pivots) = (&self.r[self.block_of(block * LANES)], self.inverse_pivots(block));
            let (above, here) = groups_mut(d).split_at_mut(block);
            let known = products(&tiles[..block], above);
            let mut found: [f64; LANES] = core::array::from_fn(|i| here[0][i] - known[i]);
            for i in 0..LANES {
                (0..i).for_each(|k| found[i] -= found[k] * tiles[block][i][k]);
                found[i] *= pivots[i];
            }
            here[0] = found;
        }
    }

    /// How far the normal of member `index` is from the span of the others.
    pub(super) fn distance(&self, index: usize, scratch: &mut [f64]) -> f64 {
        let scratch = &mut scratch[..padded(self.len)];
        scratch.fill(0.0);
        scratch[index] = 1.0;
        self.solve_transposed(scratch);
        1.0 / libm::sqrt(norm_squared(scratch))
    }

    /// Moves y to where C y is larger by d, by member (zero behind them), if that is at most
    /// `reach` away.
    pub(super) fn raise(&self, d: &mut [f64], y: &mut [f64], reach: f64) {
        self.solve_transposed(d);
        if norm_squared(&d[..padded(self.len)]) > reach * reach {
            return;
        }
        let start = self.start();
        let y = &mut groups_mut(y)[start / LANES..];
        for (columns, d) in self.blocks(start).zip(groups(d)) {
            subtract_rows(y, &d.map(|d| -d), columns);
        }
    }

    /// The nearest point to `y0` with C y = bounds, into `y`; into `d` its λ: y = y0 + Cᵀ λ.
    pub(super) fn nearest(&mut self, y0: &[f64], y: &mut [f64], d: &mut [f64]) {
        y.copy_from_slice(y0);
        // v = R⁻ᵀ bounds − Qᵀ y0, y = y0 + Q v, λ = R⁻¹ v.
        d[..padded(self.len)].fill(0.0);
        for (d, member) in d.iter_mut().zip(&self.members[..self.len]) {
            *d = member.bound;
        }
        self.solve_transposed(d);
        let start = self.start();
        let (y0, y) = (&groups(y0)[start / LANES..], &mut groups_mut(y)[start / LANES..]);
        for (columns, d) in self.blocks(start).zip(groups_mut(d)) {
            let parts = products(columns, y0);
            *d = core::array::from_fn(|i| d[i] - parts[i]);
            subtract_rows(y, &d.map(|d| -d), columns);
        }
        self.solve(d);
    }
}
