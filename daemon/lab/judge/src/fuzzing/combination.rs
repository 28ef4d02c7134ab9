//! A row's normal as a combination of those of the working set, c = Σ f_i c_i + e with e as short
//! as can be: what a row that nearly depends on the working set may be violated by is in f and e.

use admittance_core::mpc::qp::RowState;

use super::examination::{Scale, length};
use crate::judge::Plea;
use crate::random_qp::DenseQp;

/// The working set's normals, c = U⁻ᵀ a, as Cᵀ = Q R.
pub(super) struct Combinations {
    members: Vec<usize>,
    columns: Vec<Vec<f64>>,
    /// R, column after column.
    triangle: Vec<Vec<f64>>,
}

/// How a row is a combination of the working set's.
pub(super) struct Combination {
    /// The members' rows with their part f, and how far each of their normals is from the span of
    /// the others.
    pub(super) parts: Vec<(usize, f64, f64)>,
    /// ‖e‖.
    pub(super) rest: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Combinations {
    /// Of an answer's working set.
    pub(super) fn of(scale: &Scale, problem: &DenseQp, plea: &Plea) -> Self {
        Self::of_rows(scale, problem, &|row| plea.working[row] != RowState::Inactive, 0.0)
    }

    /// Of some rows, without those of whose normal the ones before leave no more than this `part` of its length.
    pub(super) fn of_rows(scale: &Scale, problem: &DenseQp, has: &dyn Fn(usize) -> bool, part: f64) -> Self {
        let mut all = Self { members: Vec::new(), columns: Vec::new(), triangle: Vec::new() };
        for row in (0..problem.rows.count()).filter(|row| has(*row)) {
            let normal = scale.normal(problem.rows.row(row));
            let least = part * length(&normal);
            let (parts, rest) = all.project(normal);
            let pivot = length(&rest);
            if pivot > least {
                all.members.push(row);
                all.columns.push(rest.iter().map(|c| c / pivot).collect());
                all.triangle.push(parts.into_iter().chain([pivot]).collect());
            }
        }
        all
    }

    /// Qᵀ c and what is left of c, taken away twice: then that is orthogonal to rounding.
    fn project(&self, mut c: Vec<f64>) -> (Vec<f64>, Vec<f64>) {
        let mut parts = vec![0.0; self.columns.len()];
        for _ in 0..2 {
            for (part, column) in parts.iter_mut().zip(&self.columns) {
                let along = dot(&c, column);
                c.iter_mut().zip(column).for_each(|(c, q)| *c -= along * q);
                *part += along;
            }
        }
        (parts, c)
    }

    pub(super) fn of_row(&self, scale: &Scale, problem: &DenseQp, row: usize) -> Combination {
        let (mut parts, rest) = self.project(scale.normal(problem.rows.row(row)));
        self.substitute(&mut parts);
        let members = self.members.iter().zip(parts).enumerate();
        let parts = members.map(|(index, (row, part))| (*row, part, self.distance(index))).collect();
        Combination { parts, rest: length(&rest) }
    }

    /// Σ |λ_i| ‖c_i‖ of the nearest point to y0 = −U⁻ᵀ g on the bounds of the working set,
    /// y0 + Cᵀ λ with λ = R⁻¹ (R⁻ᵀ bounds − Qᵀ y0): what its rounding is relative to.
    pub(super) fn pushed(&self, scale: &Scale, problem: &DenseQp, plea: &Plea) -> f64 {
        let y0: Vec<f64> = scale.normal(&problem.gradient).iter().map(|c| -c).collect();
        let mut along = self.substitute_transposed(|member| {
            let row = self.members[member];
            match plea.working[row] {
                RowState::Lower => problem.lower[row],
                _ => problem.upper[row],
            }
        });
        along.iter_mut().zip(&self.columns).for_each(|(along, column)| *along -= dot(column, &y0));
        self.substitute(&mut along);
        let lengths = self.members.iter().map(|row| length(&scale.normal(problem.rows.row(*row))));
        along.iter().zip(lengths).map(|(multiplier, length)| multiplier.abs() * length).sum()
    }

    /// x ← R⁻¹ x.
    fn substitute(&self, x: &mut [f64]) {
        for column in (0..x.len()).rev() {
            x[column] /= self.triangle[column][column];
            for above in 0..column {
                x[above] -= self.triangle[column][above] * x[column];
            }
        }
    }

    /// 1 / ‖R⁻ᵀ e_i‖.
    fn distance(&self, index: usize) -> f64 {
        1.0 / length(&self.substitute_transposed(|member| f64::from(member == index)))
    }

    /// The shortest way along which the bound of each member's row changes by so much, ‖R⁻ᵀ b‖.
    pub(super) fn length_of(&self, change: impl Fn(usize) -> f64) -> f64 {
        length(&self.substitute_transposed(|member| change(self.members[member])))
    }

    /// R⁻ᵀ b.
    fn substitute_transposed(&self, b: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut x = Vec::with_capacity(self.columns.len());
        for (column, triangle) in self.triangle.iter().enumerate() {
            let known: f64 = triangle.iter().zip(&x).map(|(r, x)| r * x).sum();
            x.push((b(column) - known) / triangle[column]);
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What rounding leaves of a row that depends on others is no way for an answer to be off by.
    #[test]
    fn rows_that_are_parallel_take_no_one_far() {
        let mut problem = DenseQp::new(3, |i, j| if i == j { 0.1 + i as f64 } else { 0.0 }, |_| 0.0);
        problem.push(&[1.0, 1.0, 1.0], 0.0, 0.0);
        problem.push(&[0.3, 0.3, 0.3], 0.0, 0.0);
        problem.push(&[1.0, 1.0, 0.0], 0.0, 0.0);
        let scale = Scale::of(&problem).unwrap();
        let off = |part| Combinations::of_rows(&scale, &problem, &|_| true, part).length_of(|_| 1e-12);
        assert!(off(1e-9) < 1e-11, "{}", off(1e-9));
        assert!(off(0.0) > 1e-3, "{}: what the part is for", off(0.0));
    }
}
