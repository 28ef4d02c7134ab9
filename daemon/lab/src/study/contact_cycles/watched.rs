//! The solver of the law, watched.

use std::sync::{Arc, Mutex, PoisonError};

use admittance_core::mpc::QpSolver;
use admittance_core::mpc::qp::{Answer, Qp, QpOutcome};

/// What the solver answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Outcomes {
    /// Problems.
    pub(super) solves: u64,
    /// Problems that are proven infeasible.
    pub(super) infeasible: u64,
    /// Problems that it gave up.
    pub(super) failed: u64,
    /// Iterations of all of them.
    pub(super) iterations: u64,
    /// Most iterations of a problem.
    pub(super) iterations_max: u32,
}

/// The outcomes, as whoever runs the controller sees them.
#[derive(Debug, Clone, Default)]
pub(super) struct Shared(Arc<Mutex<Outcomes>>);

impl Shared {
    pub(super) fn get(&self) -> Outcomes {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// For the solver, and for whoever runs it.
pub(super) fn pair() -> (Shared, Shared) {
    let shared = Shared::default();
    (shared.clone(), shared)
}

/// A solver whose outcomes are counted.
#[derive(Debug)]
pub(super) struct Watched<S> {
    solver: S,
    outcomes: Shared,
}

impl<S> Watched<S> {
    pub(super) fn new(solver: S, outcomes: Shared) -> Self {
        Self { solver, outcomes }
    }
}

impl<S: QpSolver> QpSolver for Watched<S> {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        let outcome = self.solver.solve(qp, answer, expired);
        let mut seen = self.outcomes.0.lock().unwrap_or_else(PoisonError::into_inner);
        seen.solves += 1;
        seen.infeasible += u64::from(matches!(outcome, QpOutcome::Infeasible { .. }));
        seen.failed += u64::from(matches!(outcome, QpOutcome::Failed { .. }));
        seen.iterations += u64::from(outcome.iterations());
        seen.iterations_max = seen.iterations_max.max(outcome.iterations());
        outcome
    }
}
