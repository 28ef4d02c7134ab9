//! Clarabel behind the core's solver trait: one instance per problem size, set up once with a fixed dense pattern and
//! updated in place. (One heap allocation per solve, inside Clarabel: the notes in DESIGN except it from the rule.)

use std::sync::Arc;
use std::sync::atomic::{AtomicPtr, Ordering};

use admittance_core::constraints::FIRST_STEP;
use admittance_core::qp::{Answer, Qp, QpOutcome, QpSolver};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// Clarabel scales a problem once, from the first data it sees; so rows are scaled here, to this many newtons.
const FORCE_SCALE: f64 = 100.0;

/// Which form of a problem an instance solves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// lower ≤ A z ≤ upper.
    Hard,
    /// A z ≤ upper + t, t ≥ 0, t as the last variable.
    LeastViolating,
}

type Expired<'a> = &'a mut dyn FnMut() -> bool;

struct Instance {
    form: Form,
    variables: usize,
    rows: usize,
    solver: DefaultSolver<f64>,
    hessian: Vec<f64>,
    gradient: Vec<f64>,
    matrix: Vec<f64>,
    bounds: Vec<f64>,
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
    /// Where the termination callback finds the caller's `expired` during a solve; null otherwise.
    expired: Arc<AtomicPtr<Expired<'static>>>,
}

impl std::fmt::Debug for ClarabelSolver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ClarabelSolver({} sizes)", self.instances.len())
    }
}

impl ClarabelSolver {
    /// Instances for every number of input axes and bounded axes up to `axes`, over `horizon` steps.
    pub fn new(axes: usize, horizon: usize, settings: ClarabelSettings) -> Self {
        let expired = Arc::new(AtomicPtr::new(std::ptr::null_mut()));
        let steps = (horizon + 1).saturating_sub(FIRST_STEP);
        let mut instances = Vec::new();
        for inputs in 1..=axes {
            for bounded in 0..=axes {
                for form in [Form::Hard, Form::LeastViolating] {
                    instances.push(Instance::new(form, inputs * horizon, bounded * steps, settings, &expired));
                }
            }
        }
        Self { instances, expired }
    }

    fn run(
        &mut self,
        form: Form,
        qp: &Qp<'_>,
        penalty: f64,
        answer: &mut Answer<'_>,
        expired: Expired<'_>,
    ) -> QpOutcome {
        let size = (form, qp.variables, qp.rows);
        let fits = |instance: &&mut Instance| (instance.form, instance.variables, instance.rows) == size;
        let Some(instance) = self.instances.iter_mut().find(fits) else { return QpOutcome::Failed { iterations: 0 } };
        if !instance.load(qp, penalty) {
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

impl QpSolver for ClarabelSolver {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        self.run(Form::Hard, qp, 0.0, answer, expired)
    }

    fn solve_least_violating(
        &mut self,
        qp: &Qp<'_>,
        penalty: f64,
        answer: &mut Answer<'_>,
        expired: &mut dyn FnMut() -> bool,
    ) -> QpOutcome {
        self.run(Form::LeastViolating, qp, penalty, answer, expired)
    }
}

/// Dense matrix in compressed columns, upper triangle only where asked; every entry stored, whatever its value.
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
        form: Form,
        variables: usize,
        rows: usize,
        settings: ClarabelSettings,
        expired: &Arc<AtomicPtr<Expired<'static>>>,
    ) -> Self {
        let columns = variables + usize::from(form == Form::LeastViolating);
        let inequalities = match form {
            Form::Hard => 2 * rows,
            Form::LeastViolating => rows + 1,
        };
        let hessian = dense_pattern(columns, columns, true);
        let matrix = dense_pattern(inequalities, columns, false);
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
        let (gradient, bounds) = (vec![0.0; columns], vec![1.0; inequalities]);
        let cones = [SupportedConeT::NonnegativeConeT(inequalities)];
        let mut solver = DefaultSolver::new(&hessian, &gradient, &matrix, &bounds, &cones, solver_settings)
            .expect("a dense convex problem with fixed settings is always accepted");
        let slot = Arc::clone(expired);
        solver.set_termination_callback(move |_: &_| {
            let expired = slot.load(Ordering::Relaxed);
            // SAFETY: `run` stores a pointer to its own live closure reference before the solve and null after it, and
            // Clarabel calls back on the thread that solves; so a pointer that is not null is valid and not aliased.
            !expired.is_null() && unsafe { (*expired)() }
        });
        Self {
            form,
            variables,
            rows,
            solver,
            hessian: vec![0.0; hessian.nzval.len()],
            gradient,
            matrix: vec![0.0; matrix.nzval.len()],
            bounds,
        }
    }

    /// Copies the problem into the solver; false when it refuses it.
    fn load(&mut self, qp: &Qp<'_>, penalty: f64) -> bool {
        let n = qp.variables;
        let mut at = 0;
        for column in 0..n {
            for row in 0..=column {
                self.hessian[at] = qp.hessian[row * n + column];
                at += 1;
            }
        }
        self.gradient[..n].copy_from_slice(qp.gradient);
        let scale = FORCE_SCALE.recip();
        at = 0;
        for column in 0..n {
            for row in 0..qp.rows {
                self.matrix[at + row] = qp.matrix[row * n + column] * scale;
            }
            at += qp.rows;
            if self.form == Form::Hard {
                for row in 0..qp.rows {
                    self.matrix[at + row] = -qp.matrix[row * n + column] * scale;
                }
                at += qp.rows;
            } else {
                self.matrix[at] = 0.0;
                at += 1;
            }
        }
        for row in 0..qp.rows {
            self.bounds[row] = qp.upper[row] * scale;
            if self.form == Form::Hard {
                self.bounds[qp.rows + row] = -qp.lower[row] * scale;
            }
        }
        if self.form == Form::LeastViolating {
            // t in FORCE_SCALE newtons: its column is −1 in every row, −t ≤ 0 last; a trace of curvature for the solver.
            self.matrix[at..].fill(-1.0);
            self.bounds[qp.rows] = 0.0;
            self.gradient[n] = penalty * FORCE_SCALE;
            let last = self.hessian.len() - 1;
            self.hessian[last - n..last].fill(0.0);
            self.hessian[last] = 1e-6;
        }
        self.solver.update_data(&self.hessian, &self.gradient, &self.matrix, &self.bounds).is_ok()
    }

    fn answer(&self, qp: &Qp<'_>, answer: &mut Answer<'_>) -> QpOutcome {
        let solution = &self.solver.solution;
        let iterations = solution.iterations;
        answer.z.copy_from_slice(&solution.x[..qp.variables]);
        for row in 0..qp.rows {
            let lower = if self.form == Form::Hard { solution.z[qp.rows + row] } else { 0.0 };
            answer.multipliers[row] = (solution.z[row] - lower) / FORCE_SCALE;
        }
        match solution.status {
            SolverStatus::Solved => QpOutcome::Solved { iterations },
            SolverStatus::PrimalInfeasible => QpOutcome::Infeasible { iterations },
            SolverStatus::CallbackTerminated => QpOutcome::Expired { iterations },
            _ => QpOutcome::Failed { iterations },
        }
    }
}
