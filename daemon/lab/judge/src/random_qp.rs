//! Random strictly convex problems, of the kinds that give a dual active-set method trouble:
//! weights over seven decades, parallel and coinciding rows, equalities, one-sided rows,
//! contradictions.

use admittance_core::mpc::qp::{Qp, Rows, padded};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Most variables of a random problem.
pub const MAX_VARIABLES: usize = 60;
/// Most rows of a random problem.
pub const MAX_ROWS: usize = 120;

/// A constraint matrix that is written down.
#[derive(Debug, Clone, Default)]
pub struct DenseRows {
    stride: usize,
    values: Vec<f64>,
}

impl DenseRows {
    /// Rows of the given length rounded up to whole groups.
    pub fn new(variables: usize) -> Self {
        Self { stride: padded(variables), values: Vec::new() }
    }

    /// Appends a row.
    pub fn push(&mut self, row: &[f64]) {
        self.values.extend_from_slice(row);
        self.values.resize(self.values.len().next_multiple_of(self.stride), 0.0);
    }

    /// Row `row`, padded with zeros.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.stride..(row + 1) * self.stride]
    }

    /// Number of rows.
    pub fn count(&self) -> usize {
        self.values.len() / self.stride
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Rows for DenseRows {
    fn values(&self, z: &[f64], out: &mut [f64]) {
        for (row, value) in out[..self.count()].iter_mut().enumerate() {
            *value = dot(self.row(row), z);
        }
    }

    fn coefficients(&self, row: usize, out: &mut [f64]) -> usize {
        out[..self.stride].copy_from_slice(self.row(row));
        0
    }

    fn add_transposed(&self, multipliers: &[f64], out: &mut [f64]) {
        for (row, multiplier) in multipliers.iter().enumerate().take(self.count()) {
            out.iter_mut().zip(self.row(row)).for_each(|(sum, a)| *sum += multiplier * a);
        }
    }
}

/// A problem that is written down.
#[derive(Debug, Clone)]
pub struct DenseQp {
    /// Number of variables.
    pub variables: usize,
    /// H, stride·stride row-major, both triangles.
    pub hessian: Vec<f64>,
    /// g, stride.
    pub gradient: Vec<f64>,
    /// A.
    pub rows: DenseRows,
    /// Lower bounds, padded with −∞.
    pub lower: Vec<f64>,
    /// Upper bounds, padded with ∞.
    pub upper: Vec<f64>,
    /// Weights, padded with 1.
    pub weight: Vec<f64>,
}

impl DenseQp {
    /// A problem without rows; H and g from functions of row and column.
    pub fn new(variables: usize, hessian: impl Fn(usize, usize) -> f64, gradient: impl Fn(usize) -> f64) -> Self {
        let stride = padded(variables);
        let entry = |row: usize, column: usize| {
            if row < variables && column < variables { hessian(row, column) } else { 0.0 }
        };
        Self {
            variables,
            hessian: (0..stride * stride).map(|at| entry(at / stride, at % stride)).collect(),
            gradient: (0..stride).map(|at| if at < variables { gradient(at) } else { 0.0 }).collect(),
            rows: DenseRows::new(variables),
            lower: Vec::new(),
            upper: Vec::new(),
            weight: Vec::new(),
        }
    }

    /// Appends a row.
    pub fn push(&mut self, row: &[f64], lower: f64, upper: f64) {
        let count = self.rows.count();
        self.rows.push(row);
        for (values, value, beyond) in [
            (&mut self.lower, lower, f64::NEG_INFINITY),
            (&mut self.upper, upper, f64::INFINITY),
            (&mut self.weight, 1.0, 1.0),
        ] {
            values.truncate(count);
            values.push(value);
            values.resize(padded(count + 1), beyond);
        }
    }

    /// The problem as solvers take it.
    pub fn qp(&self) -> Qp<'_> {
        Qp {
            variables: self.variables,
            stride: padded(self.variables),
            hessian: &self.hessian,
            gradient: &self.gradient,
            rows: &self.rows,
            row_count: self.rows.count(),
            lower: &self.lower,
            upper: &self.upper,
            weight: &self.weight,
        }
    }

    /// The problem of this seed, with at most [`MAX_VARIABLES`] and [`MAX_ROWS`]. Seeds of hard
    /// cases are kept: a seed must go on giving the same problem.
    pub fn random(seed: u64) -> Self {
        Self::random_up_to(seed, MAX_VARIABLES, MAX_ROWS)
    }

    /// The problem of this seed among those of other sizes.
    pub fn random_up_to(seed: u64, most_variables: usize, most_rows: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut number = move || rng.random_range(-1.0..1.0_f64);
        let mut upto = {
            let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
            move |most: usize| rng.random_range(0..=most)
        };
        let variables = 1 + upto(most_variables - 1);
        // Scales of the variables: alike, or over three and a half decades, which are seven of H.
        let decades = [0.0, 0.5, 1.75][upto(2)];
        let scales: Vec<f64> = (0..variables).map(|_| 10.0_f64.powf(decades * number())).collect();
        let factor: Vec<Vec<f64>> = (0..variables)
            .map(|row| (0..variables).map(|column| number() + if row == column { 2.0 } else { 0.0 }).collect())
            .collect();
        let gram = |i: usize, j: usize| factor.iter().map(|row| row[i] * row[j]).sum::<f64>() / variables as f64;
        let ridge = |i: usize, j: usize| if i == j { 0.1 } else { 0.0 };
        let pull: Vec<f64> = (0..variables).map(|i| 3.0 * number() * scales[i]).collect();
        let mut problem = Self::new(variables, |i, j| scales[i] * scales[j] * (gram(i, j) + ridge(i, j)), |i| pull[i]);
        // A point that a feasible problem allows.
        let inside: Vec<f64> = (0..variables).map(|i| number() / scales[i]).collect();
        let is_contradictory = upto(4) == 0;
        let rows = upto(most_rows.min(3 * variables));
        let mut equalities = variables / 3;
        for index in 0..rows {
            let mut row: Vec<f64> = match upto(5) {
                // As a limit of one input.
                0 | 1 => {
                    let limited = upto(variables - 1);
                    (0..variables).map(|i| if i == limited { scales[i] } else { 0.0 }).collect()
                }
                // Parallel to an earlier one, or all but the same.
                2 if index > 0 => {
                    let other = problem.rows.row(upto(index - 1))[..variables].to_vec();
                    let factor = if upto(1) == 0 { 1.0 } else { 2.0 * number() };
                    let apart = if upto(2) == 0 { 1e-3 } else { 0.0 };
                    other.iter().enumerate().map(|(i, a)| factor * a + apart * number() * scales[i]).collect()
                }
                // As a force: the inputs before some instant.
                3 => {
                    let first = upto(variables - 1);
                    (0..variables).map(|i| if i < first { 0.0 } else { scales[i] * (1.0 + 0.1 * number()) }).collect()
                }
                _ => (0..variables).map(|i| scales[i] * number()).collect(),
            };
            if row.iter().all(|a| a.abs() < 1e-6) {
                row[0] = scales[0];
            }
            let value = dot(&row, &inside);
            let room = |number: f64| 0.5 * number.abs();
            let (mut lower, mut upper) = (value - room(number()), value + room(number()));
            match upto(7) {
                0 => lower = f64::NEG_INFINITY,
                1 => upper = f64::INFINITY,
                2 if equalities > 0 => {
                    equalities -= 1;
                    (lower, upper) = (value, value);
                }
                // At the edge.
                3 => upper = value,
                _ => {}
            }
            problem.push(&row, lower, upper);
            if is_contradictory && index == rows / 2 {
                let gap = 0.01 + room(number());
                let opposite: Vec<f64> = row.iter().map(|a| -1.5 * a).collect();
                if upper.is_finite() {
                    problem.push(&opposite, f64::NEG_INFINITY, -1.5 * (upper + gap));
                }
            }
        }
        problem
    }
}
