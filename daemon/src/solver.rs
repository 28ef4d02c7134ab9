//! The solver that a configuration chooses, and when it ends.

use admittance_core::condensation::MAX_ROWS;
use admittance_core::parameters::Parameters;
use admittance_core::qp::{ActiveSet, Answer, Qp, QpOutcome, QpSolver, SolverCapacity};
use admittance_host::clock::monotonic_ns;

use crate::clarabel_solver::{ClarabelSettings, ClarabelSolver};
use crate::config::{MpcSection, SolverName};

/// Either solver behind the core's trait.
#[derive(Debug)]
pub(crate) struct Solver {
    method: Method,
    /// When it last ended, ns of CLOCK_MONOTONIC; 0 since that was taken.
    ended: u64,
}

#[derive(Debug)]
enum Method {
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
        let method = match mpc.solver {
            SolverName::ActiveSet => {
                let capacity = SolverCapacity { variables: axes * steps + 1, rows: MAX_ROWS };
                let storage = vec![0.0; capacity.storage_len()].into_boxed_slice();
                let solver = ActiveSet::new(capacity, mpc.max_iterations, storage);
                Method::ActiveSet(Box::new(solver.expect("storage of the length that the capacity says")))
            }
            SolverName::Clarabel => {
                let settings = ClarabelSettings { tolerance: mpc.solver_tolerance, max_iterations: mpc.max_iterations };
                Method::Clarabel(ClarabelSolver::new(settings))
            }
        };
        Self { method, ended: 0 }
    }

    /// When it ended, ns of CLOCK_MONOTONIC; 0 when it has not been called since.
    pub(crate) fn take_end(&mut self) -> u64 {
        std::mem::take(&mut self.ended)
    }
}

impl QpSolver for Solver {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        let outcome = match &mut self.method {
            Method::ActiveSet(solver) => solver.solve(qp, answer, expired),
            Method::Clarabel(solver) => solver.solve(qp, answer, expired),
        };
        self.ended = monotonic_ns();
        outcome
    }
}
