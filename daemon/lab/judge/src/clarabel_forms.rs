//! An MPC problem in the two forms that suit Clarabel, with the settings that solve them fastest
//! and reliably: each set up once with the pattern of a sequence, then updated in place. Iterative
//! refinement and presolve are off. Without equilibration the condensed form is often faster, while
//! the sparse form is not solved any more; so both are tried.

mod entries;
mod instance;
mod sparse;

pub use instance::Instance;

use admittance_core::mpc::constraints::RowKind;

use crate::sequence::{Runner, Sequence, Start};
use entries::Entries;
use sparse::SparseBuilder;

/// One problem in a form: ½ xᵀPx + qᵀx, A x = or ≤ b. Every problem of a sequence has the same
/// pattern.
#[derive(Debug, Clone, Default)]
pub struct Form {
    hessian: Entries,
    gradient: Vec<f64>,
    matrix: Entries,
    bounds: Vec<f64>,
    equalities: usize,
}

impl Form {
    /// With states and inputs as variables, the dynamics as equalities. The inputs come last, step
    /// by step.
    pub fn sparse<const N: usize, const M: usize>(sequence: &Sequence<N, M>, index: usize) -> Self {
        SparseBuilder::new(sequence, &sequence.problems[index]).build()
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
                    let bound = if sign > 0.0 { qp.upper[row] } else { qp.lower[row] };
                    if bound.is_infinite() {
                        continue;
                    }
                    coefficients.fill(0.0);
                    qp.rows.coefficients(row, &mut coefficients);
                    let Some(bounded) = rows.layout.row(row) else { continue };
                    let acting = match bounded.kind {
                        RowKind::Force => 0..sequence.horizon.force_points()[bounded.instant].step + 1 - delay,
                        RowKind::RestPosition => 0..bounded.instant + 1,
                        RowKind::Rate => bounded.instant.saturating_sub(1)..bounded.instant + 1,
                        _ => bounded.instant..bounded.instant + 1,
                    };
                    let columns: Vec<usize> = acting.flat_map(|step| rows.inputs_of(step)).collect();
                    assert!(
                        (0..n).all(|column| coefficients[column] == 0.0 || columns.contains(&column)),
                        "{bounded:?}: every input that acts is in the form"
                    );
                    for column in columns {
                        form.matrix.push(form.bounds.len(), column, sign * qp.weight[row] * coefficients[column]);
                    }
                    form.bounds.push(sign * qp.weight[row] * bound);
                }
            }
            form
        })
    }
}
