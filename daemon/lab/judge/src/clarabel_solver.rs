//! Clarabel behind the core's solver trait: one instance per problem size, set up when that size
//! first comes, with a fixed dense pattern, and updated in place. (It allocates in every solve, as
//! Clarabel does: one more reason why it is no solver for the daemon.)

use std::sync::Arc;
use std::sync::atomic::{AtomicPtr, Ordering};

use admittance_core::mpc::qp::{Answer, LANES, Qp, QpOutcome, QpSolver, RowState};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

type Expired<'a> = &'a mut dyn FnMut() -> bool;

struct Instance {
    variables: usize,
    rows: usize,
    solver: DefaultSolver<f64>,
    hessian: Vec<f64>,
    gradient: Vec<f64>,
    matrix: Vec<f64>,
    bounds: Vec<f64>,
    row: Vec<f64>,
}

/// Settings of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClarabelSettings {
    /// Relative and absolute tolerance of gap and feasibility.
    pub tolerance: f64,
    /// Iteration limit.
    pub max_iterations: u32,
}

/// The Clarabel interior-point solver for every problem size of one controller.
pub struct ClarabelSolver {
    instances: Vec<Instance>,
    settings: ClarabelSettings,
    /// Where the termination callback finds the caller's `expired` during a solve; null otherwise.
    expired: Arc<AtomicPtr<Expired<'static>>>,
}

impl std::fmt::Debug for ClarabelSolver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ClarabelSolver({} sizes)", self.instances.len())
    }
}

impl ClarabelSolver {
    /// A solver for problems of any size.
    pub fn new(settings: ClarabelSettings) -> Self {
        Self { instances: Vec::new(), settings, expired: Arc::new(AtomicPtr::new(std::ptr::null_mut())) }
    }
}

impl QpSolver for ClarabelSolver {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        let size = (qp.variables, qp.row_count);
        let known = self.instances.iter().position(|instance| (instance.variables, instance.rows) == size);
        let index = known.unwrap_or_else(|| {
            self.instances.push(Instance::new(size.0, size.1, self.settings, &self.expired));
            self.instances.len() - 1
        });
        let instance = &mut self.instances[index];
        if !instance.load(qp) {
            return QpOutcome::Failed { iterations: 0 };
        }
        let mut expired = expired;
        let slot: *mut Expired<'_> = &raw mut expired;
        self.expired.store(slot.cast(), Ordering::Relaxed);
        instance.solver.solve();
        self.expired.store(std::ptr::null_mut(), Ordering::Relaxed);
        instance.answer(qp, answer)
    }
}

/// Dense matrix in compressed columns, upper triangle only where asked; every entry stored,
/// whatever its value.
fn dense_pattern(rows: usize, columns: usize, upper_triangle: bool) -> CscMatrix<f64> {
    let (mut starts, mut indices) = (vec![0], Vec::new());
    for column in 0..columns {
        let end = if upper_triangle { column + 1 } else { rows };
        indices.extend(0..end);
        starts.push(indices.len());
    }
    // Ones on the diagonal keep the set-up factorisation regular.
    let values = (0..columns)
        .flat_map(|column| (0..if upper_triangle { column + 1 } else { rows }).map(move |row| (row, column)))
        .map(|(row, column)| if row == column { 1.0 } else { 0.0 })
        .collect();
    CscMatrix::new(rows, columns, starts, indices, values)
}

impl Instance {
    fn new(
        variables: usize,
        rows: usize,
        settings: ClarabelSettings,
        expired: &Arc<AtomicPtr<Expired<'static>>>,
    ) -> Self {
        // Every row twice, for its two bounds.
        let inequalities = 2 * rows;
        let hessian = dense_pattern(variables, variables, true);
        let matrix = dense_pattern(inequalities, variables, false);
        let solver_settings = DefaultSettings {
            verbose: false,
            max_iter: settings.max_iterations,
            tol_gap_abs: settings.tolerance,
            tol_gap_rel: settings.tolerance,
            tol_feas: settings.tolerance,
            equilibrate_enable: false,
            iterative_refinement_enable: false,
            presolve_enable: false,
            input_sparse_dropzeros: false,
            max_threads: 1,
            ..DefaultSettings::default()
        };
        let (gradient, bounds) = (vec![0.0; variables], vec![1.0; inequalities]);
        let cones = [SupportedConeT::NonnegativeConeT(inequalities)];
        let mut solver = DefaultSolver::new(&hessian, &gradient, &matrix, &bounds, &cones, solver_settings)
            .expect("a dense convex problem with fixed settings is always accepted");
        let slot = Arc::clone(expired);
        solver.set_termination_callback(move |_: &_| {
            let expired = slot.load(Ordering::Relaxed);
            // SAFETY: `run` stores a pointer to its own live closure reference before the solve and
            // null after it, and Clarabel calls back on the thread that solves; so a pointer that
            // is not null is valid and not aliased.
            !expired.is_null() && unsafe { (*expired)() }
        });
        Self {
            variables,
            rows,
            solver,
            hessian: vec![0.0; hessian.nzval.len()],
            gradient,
            matrix: vec![0.0; matrix.nzval.len()],
            bounds,
            row: vec![0.0; variables + LANES],
        }
    }

    /// Copies the problem into the solver; false when it refuses it. Clarabel scales a problem
    /// once, from the first data it sees; so rows are scaled here, by their weights. A bound that
    /// is not there becomes 0 ≤ 1.
    fn load(&mut self, qp: &Qp<'_>) -> bool {
        let n = qp.variables;
        let mut at = 0;
        for column in 0..n {
            for row in 0..=column {
                self.hessian[at] = qp.hessian[row * qp.stride + column];
                at += 1;
            }
        }
        self.gradient.copy_from_slice(&qp.gradient[..n]);
        for row in 0..self.rows {
            self.row.fill(0.0);
            qp.rows.coefficients(row, &mut self.row[..qp.stride]);
            for (index, (sign, bound)) in [(1.0, qp.upper[row]), (-1.0, -qp.lower[row])].into_iter().enumerate() {
                let row_of_matrix = index * self.rows + row;
                let scale = if bound.is_finite() { sign * qp.weight[row] } else { 0.0 };
                self.bounds[row_of_matrix] = if bound.is_finite() { bound * qp.weight[row] } else { 1.0 };
                for (column, coefficient) in self.row[..n].iter().enumerate() {
                    self.matrix[column * 2 * self.rows + row_of_matrix] = coefficient * scale;
                }
            }
        }
        self.solver.update_data(&self.hessian, &self.gradient, &self.matrix, &self.bounds).is_ok()
    }

    fn answer(&self, qp: &Qp<'_>, answer: &mut Answer<'_>) -> QpOutcome {
        let solution = &self.solver.solution;
        let iterations = solution.iterations;
        answer.z[..qp.variables].copy_from_slice(&solution.x[..qp.variables]);
        answer.z[qp.variables..].fill(0.0);
        // An interior point has no working set.
        answer.working.fill(RowState::Inactive);
        for row in 0..self.rows {
            let multiplier = |index: usize, bound: f64| if bound.is_finite() { solution.z[index] } else { 0.0 };
            let (upper, lower) = (multiplier(row, qp.upper[row]), multiplier(self.rows + row, qp.lower[row]));
            answer.multipliers[row] = (upper - lower) * qp.weight[row];
        }
        match solution.status {
            SolverStatus::Solved => QpOutcome::Solved { iterations },
            SolverStatus::PrimalInfeasible => QpOutcome::Infeasible { iterations },
            SolverStatus::CallbackTerminated => QpOutcome::Expired { iterations },
            _ => QpOutcome::Failed { iterations },
        }
    }
}
