//! Short vectors in SIMD registers, one number per joint or axis, and matrices of them; and the
//! motion of the joints written with them.

use nalgebra::SVector;
use wide::f64x4;

use crate::mpc::model::{CARRIED, Step};
use crate::mpc::qp::LANES;

/// Groups of numbers in a short vector.
const GROUPS: usize = 2;
/// Longest short vector.
const LONGEST: usize = GROUPS * LANES;

/// The numbers of a vector.
pub(super) fn array<const K: usize>(vector: &SVector<f64, K>) -> &[f64; K] {
    &vector.data.0[0]
}

/// A vector of K ≤ 8 numbers. The lanes beyond them are zero, or arbitrary after
/// [`SimdVector::splat`] until they are multiplied by zeros.
#[derive(Debug, Clone, Copy)]
pub(super) struct SimdVector<const K: usize>([f64x4; GROUPS]);

impl<const K: usize> SimdVector<K> {
    /// Groups that are not zero throughout: what is left of the loops below.
    const USED: usize = K.div_ceil(LANES);
    pub(super) const ZERO: Self = {
        assert!(K <= LONGEST, "a short vector");
        Self([f64x4::ZERO; GROUPS])
    };

    #[inline(always)]
    pub(super) fn new(numbers: &[f64; K]) -> Self {
        let mut vector = Self::ZERO;
        let (whole, rest) = numbers.as_chunks::<LANES>();
        for (group, numbers) in vector.0.iter_mut().zip(whole) {
            *group = f64x4::new(*numbers);
        }
        if !rest.is_empty() {
            let mut last = [0.0; LANES];
            last[..rest.len()].copy_from_slice(rest);
            vector.0[whole.len()] = f64x4::new(last);
        }
        vector
    }

    #[inline(always)]
    pub(super) fn of(vector: &SVector<f64, K>) -> Self {
        Self::new(array(vector))
    }

    #[inline(always)]
    pub(super) fn splat(number: f64) -> Self {
        Self([f64x4::splat(number); GROUPS])
    }

    #[inline(always)]
    pub(super) fn array(self) -> [f64; K] {
        let groups = self.0.map(f64x4::to_array);
        core::array::from_fn(|k| groups[k / LANES][k % LANES])
    }

    #[inline(always)]
    fn each(self, with: impl Fn(usize, f64x4) -> f64x4) -> Self {
        let mut vector = self;
        for group in 0..Self::USED {
            vector.0[group] = with(group, self.0[group]);
        }
        vector
    }

    /// self · factors + addend, number by number.
    #[inline(always)]
    pub(super) fn times_plus(self, factors: Self, addend: Self) -> Self {
        self.each(|group, value| value.mul_add(factors.0[group], addend.0[group]))
    }

    #[inline(always)]
    pub(super) fn times(self, factors: Self) -> Self {
        self.each(|group, value| value * factors.0[group])
    }

    #[inline(always)]
    pub(super) fn plus(self, addend: Self) -> Self {
        self.each(|group, value| value + addend.0[group])
    }

    #[inline(always)]
    pub(super) fn minus(self, subtrahend: Self) -> Self {
        self.each(|group, value| value - subtrahend.0[group])
    }

    #[inline(always)]
    pub(super) fn dot(self, other: Self) -> f64 {
        let first = self.0[0] * other.0[0];
        (1..Self::USED).fold(first, |sum, group| self.0[group].mul_add(other.0[group], sum)).reduce_add()
    }
}

/// An R×C matrix, and its transpose.
#[derive(Debug, Clone, Copy)]
pub(super) struct SimdMatrix<const R: usize, const C: usize> {
    /// Its rows.
    pub rows: [[f64; C]; R],
    /// Its columns.
    pub columns: [[f64; R]; C],
}

impl<const R: usize, const C: usize> SimdMatrix<R, C> {
    #[inline(always)]
    pub(super) fn of_rows(rows: [[f64; C]; R]) -> Self {
        Self { rows, columns: core::array::from_fn(|c| core::array::from_fn(|r| rows[r][c])) }
    }

    #[inline(always)]
    pub(super) fn of_columns(columns: [[f64; R]; C]) -> Self {
        let SimdMatrix { rows, columns } = SimdMatrix::<C, R>::of_rows(columns);
        Self { rows: columns, columns: rows }
    }

    /// A x.
    #[inline(always)]
    pub(super) fn times(&self, x: SimdVector<C>) -> SimdVector<R> {
        product(&self.rows, &self.columns, x)
    }

    /// Aᵀ y.
    #[inline(always)]
    pub(super) fn transposed_times(&self, y: SimdVector<R>) -> SimdVector<C> {
        product(&self.columns, &self.rows, y)
    }
}

/// A x from the rows and columns of A.
#[inline(always)]
fn product<const R: usize, const C: usize>(
    rows: &[[f64; C]; R],
    columns: &[[f64; R]; C],
    x: SimdVector<C>,
) -> SimdVector<R> {
    if let [row] = rows.as_slice() {
        return SimdVector::splat(SimdVector::new(row).dot(x));
    }
    let factors = x.array();
    if let [column] = columns.as_slice() {
        return SimdVector::splat(factors[0]).times(SimdVector::new(column));
    }
    let mut sum = SimdVector::<R>::ZERO;
    for c in 0..C {
        sum = SimdVector::splat(factors[c]).times_plus(SimdVector::new(&columns[c]), sum);
    }
    sum
}

/// q, and the C numbers that joints carry beside it, at the start of a step; or the sensitivities
/// to them on the way back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joints<const N: usize, const C: usize> {
    pub position: SimdVector<N>,
    pub carried: [SimdVector<N>; C],
}

impl<const N: usize, const C: usize> Joints<N, C> {
    pub(super) const ZERO: Self = Self { position: SimdVector::ZERO, carried: [SimdVector::ZERO; C] };

    /// q after an interval: q + Σ a_c c + b r.
    #[inline(always)]
    pub(super) fn position_after(
        &self,
        a: &[SVector<f64, N>; CARRIED],
        b: &SVector<f64, N>,
        reference: SimdVector<N>,
    ) -> SimdVector<N> {
        reference.times_plus(SimdVector::of(b), self.moved(a))
    }

    /// q + Σ a_c c.
    #[inline(always)]
    fn moved(&self, a: &[SVector<f64, N>; CARRIED]) -> SimdVector<N> {
        self.carried.iter().zip(a).fold(self.position, |sum, (carried, a)| carried.times_plus(SimdVector::of(a), sum))
    }

    /// One step forward under a joint velocity reference.
    #[inline(always)]
    pub(super) fn advance<const D: usize>(&mut self, step: &Step<N, D>, reference: SimdVector<N>) {
        self.position = self.position_after(&step.position_by, &step.position_by_reference, reference);
        let before = self.carried;
        for to in 0..C {
            let pushed = reference.times(SimdVector::of(&step.carried_by_reference[to]));
            self.carried[to] = before
                .iter()
                .zip(&step.carried_by[to])
                .fold(pushed, |sum, (carried, by)| carried.times_plus(SimdVector::of(by), sum));
        }
    }

    /// Where the joints would come to rest under zero reference.
    #[inline(always)]
    pub(super) fn rest_position(&self, until_rest: &[SVector<f64, N>; CARRIED]) -> SimdVector<N> {
        self.moved(until_rest)
    }

    /// For sensitivities: those of one to [`Self::rest_position`].
    #[inline(always)]
    pub(super) fn resting(until_rest: &[SVector<f64, N>; CARRIED], position: SimdVector<N>) -> Self {
        Self { position, carried: core::array::from_fn(|c| position.times(SimdVector::of(&until_rest[c]))) }
    }

    /// For sensitivities: one step back. Returns the sensitivity to the reference during the step.
    #[inline(always)]
    pub(super) fn back<const D: usize>(&mut self, step: &Step<N, D>) -> SimdVector<N> {
        let pushed = self.carried[0].times(SimdVector::of(&step.carried_by_reference[0]));
        let mut reference = self.position.times_plus(SimdVector::of(&step.position_by_reference), pushed);
        for to in 1..C {
            reference = self.carried[to].times_plus(SimdVector::of(&step.carried_by_reference[to]), reference);
        }
        let after = self.carried;
        for from in 0..C {
            let moved = self.position.times(SimdVector::of(&step.position_by[from]));
            self.carried[from] = after
                .iter()
                .zip(&step.carried_by)
                .fold(moved, |sum, (carried, by)| carried.times_plus(SimdVector::of(&by[from]), sum));
        }
        reference
    }

    /// For sensitivities at the start of a step: adds those of q at a point within it. Returns the
    /// sensitivity to the reference.
    #[inline(always)]
    pub(super) fn seed(
        &mut self,
        a: &[SVector<f64, N>; CARRIED],
        b: &SVector<f64, N>,
        position: SimdVector<N>,
    ) -> SimdVector<N> {
        self.position = self.position.plus(position);
        for (carried, a) in self.carried.iter_mut().zip(a) {
            *carried = position.times_plus(SimdVector::of(a), *carried);
        }
        position.times(SimdVector::of(b))
    }
}
