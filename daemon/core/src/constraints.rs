//! The force constraints (18d), (18e): f_min ≤ s·f_lin ≤ f_max on every bounded axis, from step k = `FIRST_STEP` on.

/// First step whose force the input can reach under Euler: u_0 moves q̇_1 and q_2.
pub const FIRST_STEP: usize = 2;

/// Bounds of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisBound {
    /// The task axis.
    pub axis: usize,
    /// s: sign of the contact on this axis, +1 or −1.
    pub sign: f64,
    /// Lower bound of s·f_lin in N; −∞ where there is none.
    pub minimum: f64,
    /// Upper bound of s·f_lin in N.
    pub maximum: f64,
}

/// The bounded axes of one cycle, at most D.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceBounds<const D: usize> {
    bounds: [AxisBound; D],
    len: usize,
}

impl<const D: usize> ForceBounds<D> {
    /// No axis bounded.
    pub fn none() -> Self {
        Self {
            bounds: [AxisBound { axis: 0, sign: 1.0, minimum: f64::NEG_INFINITY, maximum: f64::INFINITY }; D],
            len: 0,
        }
    }

    /// Adds the bound of one more axis; beyond D it is ignored, since each axis has one bound.
    pub fn push(&mut self, bound: AxisBound) {
        if self.len < D {
            self.bounds[self.len] = bound;
            self.len += 1;
        }
    }

    /// The bounds, in the order in which each step's rows stand.
    pub fn as_slice(&self) -> &[AxisBound] {
        &self.bounds[..self.len]
    }

    /// Number of constraint rows over a horizon of H steps.
    pub fn rows(&self, horizon: usize) -> usize {
        self.len * (horizon + 1).saturating_sub(FIRST_STEP)
    }

    /// Axis bound and step k that constraint row `row` belongs to; rows stand step by step.
    pub fn row(&self, row: usize) -> (&AxisBound, usize) {
        (&self.bounds[row % self.len.max(1)], FIRST_STEP + row / self.len.max(1))
    }
}
