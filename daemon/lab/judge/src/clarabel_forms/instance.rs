//! Clarabel, set up once and updated from problem to problem.

use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use super::Form;
use super::entries::Entries;

/// What all instances have in common: data can be updated, in the calling thread.
fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        presolve_enable: false,
        input_sparse_dropzeros: false,
        max_threads: 1,
        ..DefaultSettings::default()
    }
}

/// Clarabel, set up for the pattern of a sequence.
pub struct Instance {
    solver: DefaultSolver<f64>,
    hessian_order: Vec<usize>,
    matrix_order: Vec<usize>,
}

impl std::fmt::Debug for Instance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Clarabel with {} entries in A", self.matrix_order.len())
    }
}

impl Instance {
    /// Sets Clarabel up with the first problem of a sequence, with or without equilibration;
    /// tolerances are its own.
    ///
    /// # Panics
    /// Never: the forms have matching sizes.
    pub fn new(form: &Form, equilibrate: bool) -> Self {
        let settings =
            DefaultSettings { equilibrate_enable: equilibrate, iterative_refinement_enable: false, ..settings() };
        Self::with_settings(form, settings)
    }

    /// As [`Self::new`], to compare solutions, not speed: with a tolerance, and what it takes to
    /// reach that.
    ///
    /// # Panics
    /// Never: the forms have matching sizes.
    pub fn exact(form: &Form, tolerance: f64) -> Self {
        let settings =
            DefaultSettings { tol_gap_abs: tolerance, tol_gap_rel: tolerance, tol_feas: tolerance, ..settings() };
        Self::with_settings(form, settings)
    }

    fn with_settings(form: &Form, settings: DefaultSettings<f64>) -> Self {
        let (hessian_order, matrix_order) = (form.hessian.order(), form.matrix.order());
        let (n, rows) = (form.gradient.len(), form.bounds.len());
        let mut cones = vec![SupportedConeT::NonnegativeConeT(rows - form.equalities)];
        if form.equalities > 0 {
            cones.insert(0, SupportedConeT::ZeroConeT(form.equalities));
        }
        let solver = DefaultSolver::new(
            &form.hessian.matrix(&hessian_order, n, n),
            &form.gradient,
            &form.matrix.matrix(&matrix_order, rows, n),
            &form.bounds,
            &cones,
            settings,
        );
        Self { solver: solver.expect("a form of matching sizes"), hessian_order, matrix_order }
    }

    /// The values of a problem in the order in which the solver wants them: prepared outside of
    /// what is timed.
    pub fn prepare(&self, form: &Form) -> (Vec<f64>, Vec<f64>) {
        let pick = |entries: &Entries, order: &[usize]| order.iter().map(|&index| entries.values[index]).collect();
        (pick(&form.hessian, &self.hessian_order), pick(&form.matrix, &self.matrix_order))
    }

    /// The variables of the last solution, in the order of the form.
    pub fn solution(&self) -> &[f64] {
        &self.solver.solution.x
    }

    /// Updates the data and solves; false when the solver did not reach its tolerance.
    pub fn solve(&mut self, form: &Form, (hessian, matrix): &(Vec<f64>, Vec<f64>)) -> bool {
        let updated = self.solver.update_data(hessian, &form.gradient, matrix, &form.bounds).is_ok();
        self.solver.solve();
        updated && self.solver.solution.status == SolverStatus::Solved
    }
}
