//! A [`Case`] from bytes.

use admittance_core::mpc::qp::RowState;
use arbitrary::{Result as Decoded, Unstructured};

use super::Case;
use crate::random_qp::DenseQp;

/// Most variables of a problem from bytes.
pub const MAX_VARIABLES: usize = 16;
/// Most rows of a problem from bytes.
pub const MAX_ROWS: usize = 24;

/// The numbers that problems are made of.
struct Numbers {
    /// Zeros and ones most often: what is exactly parallel, coinciding or met with equality is what
    /// gives trouble.
    values: &'static [f64],
    /// By how much a row or a bound misses another.
    apart: &'static [f64],
    /// How far the diagonal of H spreads either way.
    half_decades: &'static [i32],
}

/// With these, rows depend exactly or are clearly apart.
const PLAIN: Numbers = Numbers {
    values: &[
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 4.0, -4.0, 0.25, 3.0, 8.0,
    ],
    apart: &[0.0, 0.5, 1.0, -1.0],
    half_decades: &[0, 0, 1, 2, 4, 7],
};
/// With these, much is nearly so: to around [`DEPENDENT`].
const HARD: Numbers = Numbers {
    values: &[
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 4.0, -4.0, 0.25, 3.0, 8.0,
        0.1, -0.7, 1e-3, -1e-3, 1e3, -1e3,
    ],
    apart: &[0.0, 1e-6, -1e-7, 1e-8, -1e-9, 1e-10, -1e-11, 1e-12],
    half_decades: &[0, 0, 1, 2, 4, 7],
};
const FACTORS: [f64; 8] = [1.0, -1.0, 1.0, -1.0, 2.0, -0.5, 3.0, -0.25];

impl Case {
    pub(super) fn read(bytes: &mut Unstructured<'_>) -> Decoded<Self> {
        let variables: usize = bytes.int_in_range(1..=MAX_VARIABLES)?;
        let row_count: usize = bytes.int_in_range(0..=MAX_ROWS)?;
        let questions = bytes.int_in_range(0..=31)?;
        let is_plain: bool = bytes.arbitrary()?;
        let numbers = if is_plain { &PLAIN } else { &HARD };
        let mut problem = read_objective(bytes, numbers, variables)?;
        let mut is_nearly_dependent = false;
        for index in 0..row_count {
            let (row, apart) = read_row(bytes, numbers, &problem)?;
            is_nearly_dependent |= apart != 0.0 && apart.abs() < 1e-3;
            let (lower, upper) = read_bounds(bytes, numbers, &problem, &row)?;
            problem.push(&row, lower, upper);
            problem.weight[index] = weight(&row, lower, upper);
        }
        let guess = (0..row_count)
            .map(|_| bytes.choose(&[RowState::Inactive, RowState::Lower, RowState::Upper]).copied())
            .collect::<Decoded<_>>()?;
        Ok(Self { problem, guess, questions, is_plain, is_nearly_dependent })
    }
}

/// 1 over what counts as large for a row: its coefficients (z of one) and its bounds.
pub fn weight(row: &[f64], lower: f64, upper: f64) -> f64 {
    let large = row.iter().chain([&lower, &upper]).filter(|value| value.is_finite());
    let large = large.fold(0.0_f64, |large, value| large.max(value.abs()));
    if large > 0.0 { 1.0 / large } else { 1.0 }
}

/// H = diagonal over up to seven decades + terms of rank one, and g.
fn read_objective(bytes: &mut Unstructured<'_>, numbers: &Numbers, variables: usize) -> Decoded<DenseQp> {
    let half_decades: i32 = *bytes.choose(numbers.half_decades)?;
    let mut diagonal = Vec::new();
    let mut gradient = Vec::new();
    for _ in 0..variables {
        let exponent = if half_decades == 0 { 0 } else { bytes.int_in_range(-half_decades..=half_decades)? };
        diagonal.push(10.0_f64.powf(0.5 * f64::from(exponent)));
        gradient.push(*bytes.choose(numbers.values)?);
    }
    let mut terms: Vec<Vec<f64>> = Vec::new();
    for _ in 0..bytes.int_in_range(0..=3)? {
        // In the scale of each variable, or all alike: then the small ones drown.
        let is_scaled: bool = bytes.arbitrary()?;
        let scale = |i: usize| if is_scaled { f64::sqrt(diagonal[i]) } else { 1.0 };
        let term = (0..variables).map(|i| Ok(scale(i) * bytes.choose(numbers.values)?.clamp(-3.0, 3.0)));
        terms.push(term.collect::<Decoded<_>>()?);
    }
    let entry = |i: usize, j: usize| {
        let ridge = if i == j { diagonal[i] } else { 0.0 };
        ridge + terms.iter().map(|term| term[i] * term[j]).sum::<f64>()
    };
    Ok(DenseQp::new(variables, entry, |i| gradient[i]))
}

/// A row, and by how much of its size it misses being a combination of others.
fn read_row(bytes: &mut Unstructured<'_>, numbers: &Numbers, problem: &DenseQp) -> Decoded<(Vec<f64>, f64)> {
    let (variables, count) = (problem.variables, problem.rows.count());
    let earlier = |bytes: &mut Unstructured<'_>| -> Decoded<Vec<f64>> {
        let (row, factor) = (bytes.choose_index(count)?, *bytes.choose(&FACTORS)?);
        Ok(problem.rows.row(row)[..variables].iter().map(|a| factor * a).collect())
    };
    let kind = bytes.int_in_range(0..=7_u8)?;
    let mut row = vec![0.0; variables];
    let mut apart = 0.0;
    match kind {
        // Nothing: met by all or by none.
        0 => {}
        // A limit of one variable.
        1 | 2 => row[bytes.choose_index(variables)?] = *bytes.choose(&FACTORS)?,
        // An earlier one, or the sum of two; or all but that.
        3..=5 if count > 0 => {
            row = earlier(bytes)?;
            if kind == 4 {
                row.iter_mut().zip(earlier(bytes)?).for_each(|(sum, a)| *sum += a);
            }
            if kind == 5 {
                let size = row.iter().fold(0.0_f64, |size, a| size.max(a.abs()));
                let column = bytes.choose_index(variables)?;
                apart = *bytes.choose(numbers.apart)?;
                row[column] += size * apart;
            }
        }
        // As a force: the variables from some on.
        6 => {
            let first = bytes.choose_index(variables)?;
            row[first..].fill(*bytes.choose(&FACTORS)?);
        }
        _ => {
            for a in &mut row {
                *a = *bytes.choose(numbers.values)?;
            }
        }
    }
    Ok((row, apart))
}

fn read_bounds(bytes: &mut Unstructured<'_>, numbers: &Numbers, problem: &DenseQp, row: &[f64]) -> Decoded<(f64, f64)> {
    let (a, b) = (*bytes.choose(numbers.values)?, *bytes.choose(numbers.values)?);
    // The value at (1, 1, …), through which many rows go then: a vertex with more rows than
    // variables.
    let through: f64 = row.iter().sum();
    let count = problem.rows.count();
    Ok(match bytes.int_in_range(0..=7_u8)? {
        0 => (a.min(b), a.max(b)),
        1 => (a, a),
        2 => (f64::NEG_INFINITY, a),
        3 => (a, f64::INFINITY),
        4 => (f64::NEG_INFINITY, through),
        5 => (through - a.abs(), through + b.abs()),
        // Those of the row before, or just beyond its upper bound.
        6 if count > 0 => (problem.lower[count - 1], problem.upper[count - 1]),
        7 if count > 0 && problem.upper[count - 1].is_finite() => {
            let apart = *bytes.choose(numbers.apart)?;
            (problem.upper[count - 1] + apart, f64::INFINITY)
        }
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    })
}
