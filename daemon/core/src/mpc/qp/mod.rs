//! The quadratic program and who solves it. The core builds it ([`crate::mpc::condensation`]),
//! solves it ([`ActiveSet`]) and checks what comes back ([`kkt_residual`], [`certificate_gap`]);
//! another solver may stand in through [`QpSolver`].
#![allow(clippy::needless_range_loop, reason = "formulas index several arrays at once")]

mod active_set;
mod check;
mod factor;
mod lanes;
mod working_set;

pub use active_set::{ActiveSet, SolverCapacity};
pub use check::{KktResidual, certificate_gap, kkt_residual};
pub(crate) use lanes::{ALIGNMENT, CACHE_LINE, before_cache_line, fill_last_group};
pub use lanes::{LANES, padded};

/// Largest number of variables that [`ActiveSet`] takes: six axes over 32 steps, and a slack.
pub const MAX_VARIABLES: usize = 6 * 32 + 1;

/// min ½ zᵀ H z + gᵀ z subject to lower ≤ A z ≤ upper, dense, H positive definite.
///
/// Rows of H are `stride` numbers apart, and z, g are as long: n rounded up to a multiple of
/// [`LANES`]. Bounds and weights are as long as the number of rows rounded up likewise, unbounded
/// beyond it.
#[derive(Clone, Copy)]
pub struct Qp<'a> {
    /// Number n of variables z. Of an MPC: inputs in reversed time order, the last step's first,
    /// the axes of one step together; m/s and rad/s.
    pub variables: usize,
    /// n rounded up to a multiple of [`LANES`].
    pub stride: usize,
    /// H, n×stride row-major; only the upper triangle is read.
    pub hessian: &'a [f64],
    /// g.
    pub gradient: &'a [f64],
    /// A.
    pub rows: &'a dyn Rows,
    /// Number of constraint rows.
    pub row_count: usize,
    /// Lower bounds; −∞ where there is none.
    pub lower: &'a [f64],
    /// Upper bounds; ∞ where there is none.
    pub upper: &'a [f64],
    /// 1 over a value that counts as large for the row, in its unit: what tolerances are relative
    /// to.
    pub weight: &'a [f64],
}

/// The constraint matrix A, by what is done with it.
pub trait Rows {
    /// out ← A z; `out` is at least as long as there are rows.
    fn values(&self, z: &[f64], out: &mut [f64]);

    /// Writes row `row` of A into `out` (stride long) from the returned column on, a multiple of
    /// [`LANES`]; before it the row is zero, and `out` is left as it is.
    fn coefficients(&self, row: usize, out: &mut [f64]) -> usize;

    /// out ← out + Aᵀ y.
    fn add_transposed(&self, multipliers: &[f64], out: &mut [f64]);
}

/// Whether a row is in the working set: met with equality at the solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RowState {
    /// Not in the working set.
    #[default]
    Inactive,
    /// At its lower bound.
    Lower,
    /// At its upper bound.
    Upper,
}

/// The rows of a working set, in ascending order.
pub(crate) fn members_of(working: &[RowState]) -> impl Iterator<Item = (usize, RowState)> {
    // Few rows of many are in it: the others are passed over many at a time.
    const WIDTH: usize = 16;
    let is_empty = |rows: &[RowState]| rows.iter().fold(true, |empty, state| empty & (*state == RowState::Inactive));
    let parts = working.chunks(WIDTH).enumerate().filter(move |(_, rows)| !is_empty(rows));
    let rows = parts.flat_map(|(part, rows)| (part * WIDTH..).zip(rows));
    rows.filter(|(_, state)| **state != RowState::Inactive).map(|(row, state)| (row, *state))
}

/// Where a solver writes its answer.
#[derive(Debug)]
pub struct Answer<'a> {
    /// z, stride long; zero beyond n.
    pub z: &'a mut [f64],
    /// Multiplier of each row: positive where the upper bound pushes, negative where the lower
    /// does. After [`QpOutcome::Infeasible`] they are the certificate: Aᵀy = 0 and Σ y⁺ upper − Σ
    /// y⁻ lower < 0.
    pub multipliers: &'a mut [f64],
    /// The working set, one entry a row: a guess before, that of the answer (or of the certificate)
    /// after; when the time was up, how far it came: a guess to go on from. A wrong guess costs
    /// time, nothing else.
    pub working: &'a mut [RowState],
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
    /// The solver gave up: iteration limit, numerical trouble, or a problem larger than it was set
    /// up for.
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

/// A solver for [`Qp`], set up beforehand for every size that can occur. It remembers nothing of
/// earlier problems that could change an answer: what a warm start needs is in [`Answer::working`].
pub trait QpSolver {
    /// Solves `qp`. `expired` is asked between iterations; once it answers true the solver returns
    /// at once.
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome;
}
