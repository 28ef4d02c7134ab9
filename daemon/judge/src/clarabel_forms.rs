//! An MPC problem in the two forms that suit Clarabel, with the settings that solve them fastest and reliably: each set up
//! once with the pattern of a sequence, then updated in place. Iterative refinement and presolve are off. Without equilibration
//! the condensed form is often faster, while the sparse form is not solved any more; so both are tried.

use admittance_core::constraints::RowKind;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use crate::problem_file::{ProblemFile, Record};
use crate::sequence::{Runner, Sequence, Start};

/// Entries of a sparse matrix.
#[derive(Debug, Clone, Default)]
struct Entries {
    at: Vec<(usize, usize)>,
    values: Vec<f64>,
}

impl Entries {
    fn push(&mut self, row: usize, column: usize, value: f64) {
        self.at.push((column, row));
        self.values.push(value);
    }

    /// The order of the entries by column and row.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.at.len()).collect();
        order.sort_by_key(|&index| self.at[index]);
        order
    }

    fn matrix(&self, order: &[usize], rows: usize, columns: usize) -> CscMatrix<f64> {
        let mut starts = vec![0; columns + 1];
        for (column, _) in &self.at {
            starts[column + 1] += 1;
        }
        for column in 0..columns {
            starts[column + 1] += starts[column];
        }
        CscMatrix::new(
            rows,
            columns,
            starts,
            order.iter().map(|&index| self.at[index].1).collect(),
            order.iter().map(|&index| self.values[index]).collect(),
        )
    }
}

/// One problem in a form: ½ xᵀPx + qᵀx, A x = or ≤ b. Every problem of a sequence has the same pattern.
#[derive(Debug, Clone, Default)]
pub struct Form {
    hessian: Entries,
    gradient: Vec<f64>,
    matrix: Entries,
    bounds: Vec<f64>,
    equalities: usize,
}

impl Form {
    /// With states and inputs as variables, the dynamics as equalities.
    pub fn sparse(file: &ProblemFile, record: &Record) -> Self {
        let (nx, nd, nu, nc, h) = (file.states(), file.joints, file.inputs, file.forces, file.horizon);
        // x_k from k = 1 on, then u_k.
        let (state, input) = (|k: usize| (k - 1) * nx, |k: usize| h * nx + k * nu);
        let mut form = Self { gradient: vec![0.0; h * (nx + nu)], equalities: h * nx, ..Self::default() };
        for k in 1..=h {
            for i in 0..nx {
                form.hessian.push(state(k) + i, state(k) + i, 2.0 * file.state_weight[i]);
                form.gradient[state(k) + i] = -2.0 * file.state_weight[i] * record.set_point[i];
            }
        }
        for (k, i) in (0..h).flat_map(|k| (0..nu).map(move |i| (k, i))) {
            form.hessian.push(input(k) + i, input(k) + i, 2.0 * file.input_weight[i]);
        }
        for (k, i) in (0..h).flat_map(|k| (0..nx).map(move |i| (k, i))) {
            let row = form.bounds.len();
            let mut right = record.c[i];
            form.matrix.push(row, state(k + 1) + i, 1.0);
            let structural = |j: usize| j == i || (i < nd && j == i + nd) || (i >= 2 * nd && j < nd);
            for j in (0..nx).filter(|&j| structural(j)) {
                let a = record.a[i * nx + j];
                if k == 0 {
                    right += a * record.initial[j];
                } else {
                    form.matrix.push(row, state(k) + j, -a);
                }
            }
            for j in (0..nu).filter(|_| (nd..2 * nd).contains(&i)) {
                form.matrix.push(row, input(k) + j, -record.b[i * nu + j]);
            }
            form.bounds.push(right);
        }
        for sign in [1.0, -1.0] {
            for (k, axis) in (2..=h).flat_map(|k| (0..nc).map(move |axis| (k, axis))) {
                // In hundreds of newtons.
                let scale = sign * 0.01;
                for joint in 0..nd {
                    form.matrix.push(form.bounds.len(), state(k) + joint, scale * record.f[axis * nd + joint]);
                }
                let bound = if sign > 0.0 { record.f_upper[axis] } else { record.f_lower[axis] };
                form.bounds.push(scale * (bound - record.f0[axis]));
            }
            for (k, joint) in (0..h).flat_map(|k| (0..nd).map(move |joint| (k, joint))) {
                for i in 0..nu {
                    form.matrix.push(form.bounds.len(), input(k) + i, sign * record.jacobian_inverse[joint * nu + i]);
                }
                form.bounds.push(sign * if sign > 0.0 { record.v_upper[joint] } else { record.v_lower[joint] });
            }
        }
        form
    }

    /// With the inputs alone as variables; what cannot act on a row is left out of it.
    pub fn condensed<const N: usize, const M: usize>(
        runner: &mut Runner<N, M>,
        sequence: &Sequence<N, M>,
        index: usize,
    ) -> Self {
        runner.solve(sequence, index, Start::Cold, |_, rows, qp, _, _| {
            // An input that does not act at once does not act on its own step.
            let (n, delay) = (qp.variables, sequence.horizon.first_reached());
            let mut form = Self { gradient: qp.gradient[..n].to_vec(), ..Self::default() };
            for (row, column) in (0..n).flat_map(|column| (0..=column).map(move |row| (row, column))) {
                form.hessian.push(row, column, qp.hessian[row * qp.stride + column]);
            }
            let mut coefficients = vec![0.0; qp.stride];
            for sign in [1.0, -1.0] {
                for row in 0..qp.row_count {
                    coefficients.fill(0.0);
                    qp.rows.coefficients(row, &mut coefficients);
                    let Some(bounded) = rows.layout.row(row) else { continue };
                    let acting = match bounded.kind {
                        RowKind::Force => 0..sequence.horizon.force_points()[bounded.instant].step + 1 - delay,
                        RowKind::JointPosition => 0..bounded.instant + 1 - delay,
                        RowKind::Rate => bounded.instant.saturating_sub(1)..bounded.instant + 1,
                        _ => bounded.instant..bounded.instant + 1,
                    };
                    let columns: Vec<usize> = acting.flat_map(|step| rows.inputs_of(step)).collect();
                    debug_assert!(
                        (0..n).all(|column| coefficients[column] == 0.0 || columns.contains(&column)),
                        "{bounded:?}: every input that acts is in the form"
                    );
                    for column in columns {
                        form.matrix.push(form.bounds.len(), column, sign * qp.weight[row] * coefficients[column]);
                    }
                    let bound = if sign > 0.0 { qp.upper[row] } else { qp.lower[row] };
                    form.bounds.push(sign * qp.weight[row] * bound);
                }
            }
            form
        })
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
    /// Sets Clarabel up with the first problem of a sequence.
    ///
    /// # Panics
    /// Never: the forms have matching sizes.
    pub fn new(form: &Form) -> Self {
        Self::with_equilibration(form, true)
    }

    /// As [`Self::new`], with or without equilibration.
    ///
    /// # Panics
    /// Never: the forms have matching sizes.
    pub fn with_equilibration(form: &Form, equilibrate: bool) -> Self {
        let (hessian_order, matrix_order) = (form.hessian.order(), form.matrix.order());
        let (n, rows) = (form.gradient.len(), form.bounds.len());
        let settings = DefaultSettings {
            verbose: false,
            equilibrate_enable: equilibrate,
            iterative_refinement_enable: false,
            presolve_enable: false,
            input_sparse_dropzeros: false,
            max_threads: 1,
            ..DefaultSettings::default()
        };
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

    /// The values of a problem in the order in which the solver wants them: prepared outside of what is timed.
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
