//! The quadratic program and who solves it. The core builds it ([`crate::condensation`]) and checks what comes back
//! ([`kkt_residual`], [`certificate_gap`]); the solver itself is given by the shell.

mod check;

pub use check::{KktResidual, certificate_gap, kkt_residual};

/// min ½ zᵀ H z + gᵀ z subject to lower ≤ A z ≤ upper, dense, H positive definite.
#[derive(Debug, Clone, Copy)]
pub struct Qp<'a> {
    /// Number n of variables z: inputs in time order, the axes of one step together; m/s and rad/s.
    pub variables: usize,
    /// Number of constraint rows.
    pub rows: usize,
    /// H, n×n row-major, both triangles.
    pub hessian: &'a [f64],
    /// g, n.
    pub gradient: &'a [f64],
    /// A, rows×n row-major.
    pub matrix: &'a [f64],
    /// Lower bounds, rows; −∞ where there is none.
    pub lower: &'a [f64],
    /// Upper bounds, rows.
    pub upper: &'a [f64],
}

impl Qp<'_> {
    /// Row `row` of A.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.matrix[row * self.variables..(row + 1) * self.variables]
    }
}

/// Where a solver writes its answer.
#[derive(Debug)]
pub struct Answer<'a> {
    /// z, n.
    pub z: &'a mut [f64],
    /// Multiplier of each row, rows: positive where the upper bound pushes, negative where the lower does. After
    /// [`QpOutcome::Infeasible`] they are the certificate: Aᵀy = 0 and Σ y⁺ upper − Σ y⁻ lower < 0.
    pub multipliers: &'a mut [f64],
}

/// What became of a QP. Only `Solved` has put a solution into [`Answer::z`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QpOutcome {
    /// Solved to the solver's tolerance.
    Solved {
        /// Iterations taken.
        iterations: u32,
    },
    /// No z meets all rows; the multipliers hold the certificate.
    Infeasible {
        /// Iterations taken.
        iterations: u32,
    },
    /// `expired` answered true.
    Expired {
        /// The iteration at which it did.
        iterations: u32,
    },
    /// The solver gave up: iteration limit, numerical trouble, or a problem larger than it was set up for.
    Failed {
        /// Iterations taken.
        iterations: u32,
    },
}

impl QpOutcome {
    /// Iterations taken.
    pub fn iterations(self) -> u32 {
        match self {
            Self::Solved { iterations }
            | Self::Infeasible { iterations }
            | Self::Expired { iterations }
            | Self::Failed { iterations } => iterations,
        }
    }
}

/// A solver for [`Qp`], set up beforehand for every size that can occur.
pub trait QpSolver {
    /// Solves `qp`. `expired` is asked between iterations; once it answers true the solver returns at once.
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome;

    /// Solves `qp` with its upper bounds softened by one common slack t ≥ 0 at the cost `penalty`·t, and without its lower
    /// bounds: for a penalty above the sum of the multipliers that is the least violation there is, and among its
    /// minimisers the cheapest. Never infeasible.
    fn solve_least_violating(
        &mut self,
        qp: &Qp<'_>,
        penalty: f64,
        answer: &mut Answer<'_>,
        expired: &mut dyn FnMut() -> bool,
    ) -> QpOutcome;
}
