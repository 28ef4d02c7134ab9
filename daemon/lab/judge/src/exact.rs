//! The solution of a QP from its working set, in double-double arithmetic (about 31 digits): what
//! decides where the solver and the judge differ. It uses nothing of either except the claim which
//! rows are met with equality, and checks that claim.

use std::ops::{Add, Div, Mul, Neg, Sub};

use admittance_core::mpc::qp::RowState;

use crate::random_qp::DenseQp;

/// Violation of a row, relative to the larger of 1 and its bound, and multiplier of the wrong sign,
/// relative to the larger of 1 and the gradient, that count as none: coinciding rows meet in a
/// point only to the rounding of their coefficients.
const ROUNDING: f64 = 1e-14;
/// Pivot relative to the largest entry of its row below which the rows of the working set depend on
/// one another.
const SINGULAR: f64 = 1e-24;

/// The unevaluated sum of two numbers, the second at most half a unit in the last place of the
/// first.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Double(f64, f64);

impl Double {
    const ZERO: Self = Self(0.0, 0.0);

    /// a + b, exactly.
    fn sum(a: f64, b: f64) -> Self {
        let sum = a + b;
        let part = sum - a;
        Self(sum, (a - (sum - part)) + (b - part))
    }

    /// As [`Self::sum`] where |a| ≥ |b|.
    fn quick_sum(a: f64, b: f64) -> Self {
        let sum = a + b;
        Self(sum, b - (sum - a))
    }

    fn abs(self) -> f64 {
        self.0.abs()
    }
}

impl From<f64> for Double {
    fn from(value: f64) -> Self {
        Self(value, 0.0)
    }
}

impl Neg for Double {
    type Output = Self;

    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl Add for Double {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (large, small) = (Self::sum(self.0, other.0), Self::sum(self.1, other.1));
        let first = Self::quick_sum(large.0, large.1 + small.0);
        Self::quick_sum(first.0, first.1 + small.1)
    }
}

impl Sub for Double {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Double {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = self.0 * other.0;
        // The rounding error of a product is a number.
        let rest = self.0.mul_add(other.0, -product);
        Self::quick_sum(product, rest + (self.0 * other.1 + self.1 * other.0))
    }
}

impl Div for Double {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.0 / other.0;
        let rest = self - other * Self::from(first);
        let second = rest.0 / other.0;
        let rest = rest - other * Self::from(second);
        Self::quick_sum(first, second) + Self::from(rest.0 / other.0)
    }
}

/// Solves in place, rows first scaled, by elimination with the largest pivot of each column; `None`
/// when there is none.
fn eliminate(mut system: Vec<Vec<Double>>) -> Option<Vec<Double>> {
    let size = system.len();
    for row in &mut system {
        let largest = row[..size].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        if largest == 0.0 {
            return None;
        }
        row.iter_mut().for_each(|entry| *entry = *entry / Double::from(largest));
    }
    for column in 0..size {
        let pivot = (column..size).max_by(|&a, &b| system[a][column].abs().total_cmp(&system[b][column].abs()))?;
        system.swap(column, pivot);
        let (above, below) = system.split_at_mut(column + 1);
        let pivot = &above[column];
        if pivot[column].abs().is_nan() || pivot[column].abs() <= SINGULAR {
            return None;
        }
        for row in below.iter_mut().filter(|row| row[column] != Double::ZERO) {
            let factor = row[column] / pivot[column];
            for (entry, above) in row[column..].iter_mut().zip(&pivot[column..]) {
                *entry = *entry - factor * *above;
            }
        }
    }
    let mut solution = vec![Double::ZERO; size];
    for row in (0..size).rev() {
        let known = (row + 1..size).fold(system[row][size], |sum, column| sum - system[row][column] * solution[column]);
        solution[row] = known / system[row][row];
    }
    Some(solution)
}

/// z of the solution, when the rows of `working` are those that are met with equality there: the
/// equations that they give with the gradient are solved, then every row has to be met and every
/// multiplier to have its sign. Those conditions are sufficient, H being positive definite. `None`
/// when they do not hold.
pub fn solution(problem: &DenseQp, working: &[RowState]) -> Option<Vec<f64>> {
    let (qp, n) = (problem.qp(), problem.variables);
    let bound_of = |row: usize, state: RowState| match state {
        RowState::Inactive => None,
        RowState::Lower => Some((row, qp.lower[row], -1.0)),
        RowState::Upper => Some((row, qp.upper[row], 1.0)),
    };
    let active: Vec<(usize, f64, f64)> =
        working.iter().enumerate().filter_map(|(row, state)| bound_of(row, *state)).collect();
    let size = n + active.len();
    let mut system = vec![vec![Double::ZERO; size + 1]; size];
    for (i, equation) in system.iter_mut().enumerate().take(n) {
        for (j, entry) in equation.iter_mut().enumerate().take(n) {
            // The upper triangle is what counts.
            *entry = qp.hessian[i.min(j) * qp.stride + i.max(j)].into();
        }
        equation[size] = (-qp.gradient[i]).into();
    }
    for (index, &(row, bound, _)) in active.iter().enumerate() {
        for (i, &coefficient) in problem.rows.row(row)[..n].iter().enumerate() {
            system[i][n + index] = coefficient.into();
            system[n + index][i] = coefficient.into();
        }
        system[n + index][size] = bound.into();
    }
    let solution = eliminate(system)?;
    let (z, multipliers) = solution.split_at(n);
    let steep = qp.gradient[..n].iter().fold(1.0_f64, |most, g| most.max(g.abs()));
    let pushes = active.iter().zip(multipliers).all(|(&(row, _, sign), multiplier)| {
        qp.lower[row] == qp.upper[row] || sign * multiplier.0 >= -ROUNDING * steep
    });
    let is_met = |row: usize| {
        let coefficients = &problem.rows.row(row)[..n];
        let value = coefficients.iter().zip(z).fold(Double::ZERO, |sum, (a, z)| sum + Double::from(*a) * *z);
        let within = |excess: Double, bound: f64| excess.0 <= ROUNDING * bound.abs().max(1.0);
        let (lower, upper) = (qp.lower[row], qp.upper[row]);
        (lower == f64::NEG_INFINITY || within(Double::from(lower) - value, lower))
            && (upper == f64::INFINITY || within(value - Double::from(upper), upper))
    };
    (pushes && (0..qp.row_count).all(is_met)).then(|| z.iter().map(|z| z.0).collect())
}
