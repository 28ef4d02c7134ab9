//! The solver that a configuration chooses.

use admittance_core::condensation::MAX_ROWS;
use admittance_core::parameters::Parameters;
use admittance_core::qp::{ActiveSet, Answer, Qp, QpOutcome, QpSolver, SolverCapacity};

use crate::clarabel_solver::{ClarabelSettings, ClarabelSolver};
use crate::config::{MpcSection, SolverName};

/// Either solver behind the core's trait.
#[derive(Debug)]
pub(crate) enum Solver {
    /// The core's own.
    ActiveSet(Box<ActiveSet<Box<[f64]>>>),
    /// The reference.
    Clarabel(ClarabelSolver),
}

impl Solver {
    /// The solver for every problem that a controller with these parameters can pose.
    pub(crate) fn new<const N: usize, const D: usize>(mpc: &MpcSection, parameters: &Parameters<N, D>) -> Self {
        let axes = parameters.thresholds.admittance.iter().filter(|admittance| **admittance).count();
        let steps = parameters.mpc.steps().len();
        match mpc.solver {
            SolverName::ActiveSet => {
                let capacity = SolverCapacity { variables: axes * steps + 1, rows: MAX_ROWS };
                let storage = vec![0.0; capacity.storage_len()].into_boxed_slice();
                let solver = ActiveSet::new(capacity, mpc.max_iterations, storage);
                Self::ActiveSet(Box::new(solver.expect("storage of the length that the capacity says")))
            }
            SolverName::Clarabel => {
                let settings = ClarabelSettings { tolerance: mpc.solver_tolerance, max_iterations: mpc.max_iterations };
                Self::Clarabel(ClarabelSolver::new(settings))
            }
        }
    }
}

impl QpSolver for Solver {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        match self {
            Self::ActiveSet(solver) => solver.solve(qp, answer, expired),
            Self::Clarabel(solver) => solver.solve(qp, answer, expired),
        }
    }
}
