//! The working set W of the dual method, in the coordinates y = U z, in which H is the identity: the normals of its rows
//! as Cᵀ = Q R with orthonormal columns in Q. Orthogonalising twice instead of factoring C Cᵀ keeps nearly parallel rows
//! apart: on a plane the force rows of two axes are parallel, and those of successive steps nearly so.

use super::lanes::{dot, dot4, norm_squared, padded, rotate, subtract, subtract4};
use super::{MAX_VARIABLES, RowState};

/// Below this part of its length, what is left of a normal after taking away the others is rounding: the row depends on
/// them. Coefficients carry about 1e-12 of rounding; rows that differ by less than this have the same effect.
const DEPENDENT: f64 = 1e-9;

/// One row of W.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    pub row: u16,
    pub side: RowState,
    /// The bound that is met, with the sign of the normal c: cᵀy = bound.
    pub bound: f64,
    /// λ ≥ 0.
    pub multiplier: f64,
    /// ‖c‖: λ ‖c‖ is comparable between rows of different units.
    pub length: f64,
    /// Columns before this one are zero in this column of Q.
    start: usize,
}

impl Member {
    const NONE: Self = Self { row: 0, side: RowState::Inactive, bound: 0.0, multiplier: 0.0, length: 0.0, start: 0 };

    pub(super) fn new(row: usize, side: RowState, bound: f64) -> Self {
        Self { row: row as u16, side, bound, ..Self::NONE }
    }
}

/// How a new normal c stands to W, from [`WorkingSet::project`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Projection {
    /// ‖c‖².
    pub whole: f64,
    /// ‖c − Q Qᵀ c‖².
    pub rest: f64,
    /// Whether c is a combination of the normals in W.
    pub dependent: bool,
    start: usize,
}

pub(super) struct WorkingSet<'a> {
    pub members: &'a mut [Member; MAX_VARIABLES],
    pub len: usize,
    /// Columns of Q, stride apart.
    pub q: &'a mut [f64],
    /// Columns of R, stride apart.
    pub r: &'a mut [f64],
    pub stride: usize,
}

pub(super) const NO_MEMBERS: [Member; MAX_VARIABLES] = [Member::NONE; MAX_VARIABLES];

impl WorkingSet<'_> {
    fn column(&self, index: usize) -> &[f64] {
        &self.q[index * self.stride..(index + 1) * self.stride]
    }

    /// c ← c − Q Qᵀ c, d ← Qᵀ c, for a c that is zero before `start`; 2 to 4 len·stride multiplications.
    pub(super) fn project(&self, c: &mut [f64], d: &mut [f64], start: usize) -> Projection {
        let before = norm_squared(&c[start..]);
        d[..padded(self.len)].fill(0.0);
        let start = self.members[..self.len].iter().fold(start, |start, member| start.min(member.start));
        let mut last = before;
        let mut rest = before;
        // Twice is enough; once, where at least a tenth of the length is left: that costs one digit of orthogonality.
        for _ in 0..2 {
            self.take_away(c, d, start);
            rest = norm_squared(&c[start..]);
            if rest > 0.01 * last {
                break;
            }
            last = rest;
        }
        let dependent = rest <= before * (DEPENDENT * DEPENDENT) || rest.is_nan();
        Projection { whole: before, rest, dependent, start }
    }

    fn take_away(&self, c: &mut [f64], d: &mut [f64], start: usize) {
        let c = &mut c[start..];
        let whole = self.len / 4 * 4;
        for first in (0..whole).step_by(4) {
            let columns = [0, 1, 2, 3].map(|i| &self.column(first + i)[start..]);
            let parts = dot4(columns, c);
            subtract4(c, parts, columns);
            for (d, part) in d[first..].iter_mut().zip(parts) {
                *d += part;
            }
        }
        for index in whole..self.len {
            let column = &self.column(index)[start..];
            let part = dot(column, c);
            subtract(c, part, column);
            d[index] += part;
        }
    }

    /// Appends a member whose normal has been projected: `c` is what is left of it, `d` its part within W.
    pub(super) fn push(&mut self, member: Member, projection: &Projection, c: &[f64], d: &[f64]) {
        let length = libm::sqrt(projection.rest);
        let member = Member { length: libm::sqrt(projection.whole), start: projection.start, ..member };
        let at = self.len * self.stride;
        let inverse = 1.0 / length;
        for (q, c) in self.q[at..at + self.stride].iter_mut().zip(c) {
            *q = c * inverse;
        }
        self.r[at..at + self.len].copy_from_slice(&d[..self.len]);
        self.r[at + self.len] = length;
        self.members[self.len] = member;
        self.len += 1;
    }

    /// Takes member `index` out; 4 (len − index) stride multiplications for the rotations that make R triangular again.
    pub(super) fn remove(&mut self, index: usize) {
        let stride = self.stride;
        let last = self.len - 1;
        // From the right: a column leaves R, those behind it move up and have one number below the diagonal.
        for column in index..last {
            let (left, right) = self.r.split_at_mut((column + 1) * stride);
            left[column * stride..column * stride + column + 2].copy_from_slice(&right[..column + 2]);
        }
        for i in index..last {
            let (a, b) = (self.r[i * stride + i], self.r[i * stride + i + 1]);
            let length = libm::sqrt(a * a + b * b);
            let (cos, sin) = (a / length, b / length);
            for column in i..last {
                let pair = &mut self.r[column * stride + i..column * stride + i + 2];
                let (top, bottom) = (pair[0], pair[1]);
                pair[0] = cos * top + sin * bottom;
                pair[1] = cos * bottom - sin * top;
            }
            let start = self.members[i].start.min(self.members[i + 1].start);
            let (left, right) = self.q.split_at_mut((i + 1) * stride);
            rotate(&mut left[i * stride + start..], &mut right[start..stride], cos, sin);
            self.members[i] = Member { start, ..self.members[i + 1] };
            self.members[i + 1].start = start;
        }
        self.len = last;
    }

    /// d ← R⁻¹ d.
    pub(super) fn solve(&self, d: &mut [f64]) {
        for index in (0..self.len).rev() {
            let column = &self.r[index * self.stride..];
            d[index] /= column[index];
            let factor = d[index];
            for (d, r) in d[..index].iter_mut().zip(column) {
                *d -= factor * r;
            }
        }
    }

    /// The nearest point to `y0` with C y = bounds, into `y`, and its multipliers: y = y0 + Cᵀ λ.
    pub(super) fn nearest(&mut self, y0: &[f64], y: &mut [f64], d: &mut [f64]) {
        y.copy_from_slice(y0);
        // v = R⁻ᵀ bounds − Qᵀ y0, y = y0 + Q v, λ = R⁻¹ v.
        for index in 0..self.len {
            let column = &self.r[index * self.stride..(index + 1) * self.stride];
            let mut known = 0.0;
            for (d, r) in d[..index].iter().zip(column) {
                known += d * r;
            }
            d[index] = (self.members[index].bound - known) / column[index];
        }
        for index in 0..self.len {
            let start = self.members[index].start;
            let part = dot(&self.column(index)[start..], &y0[start..]);
            d[index] -= part;
        }
        for index in 0..self.len {
            let start = self.members[index].start;
            subtract(&mut y[start..], -d[index], &self.q[index * self.stride + start..(index + 1) * self.stride]);
        }
        self.solve(d);
        for (member, lambda) in self.members[..self.len].iter_mut().zip(d.iter()) {
            member.multiplier = *lambda;
        }
    }
}
