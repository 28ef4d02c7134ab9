//! Small degenerate problems from bytes, and what must hold of the solver's answers to them: shared by the fuzz target
//! (`fuzz/`) and the test that replays its inputs without a fuzzer.
//!
//! Lengths and tolerances are taken in the coordinates of the solver, y = U z with H = Uᵀ U, where a row is c = U⁻ᵀ a and
//! rounding is to be measured. U here is computed anew, from what is in the problem only.

use std::fmt;

use admittance_core::qp::{
    ActiveSet, Answer, KktResidual, Qp, QpOutcome, QpSolver, RowState, SolverCapacity, certificate_gap, kkt_residual,
    padded,
};
use arbitrary::{Result as Decoded, Unstructured};

use crate::judge::Plea;
use crate::random_qp::DenseQp;

/// Most variables of a problem from bytes.
pub const MAX_VARIABLES: usize = 16;
/// Most rows of a problem from bytes.
pub const MAX_ROWS: usize = 24;
/// Iterations that the solver may take: far more than there are ways to need, so that reaching it means a cycle.
const MAX_ITERATIONS: u32 = 1000;
/// Iterations of a failed run that are looked at for what went wrong.
const WAY: u32 = 100;

/// Violation times weight that the solver leaves by design.
const FEASIBLE: f64 = 1e-10;
/// Part of its length below which the solver takes a row for a combination of others, by design.
const DEPENDENT: f64 = 1e-9;
/// |z_i| that a certificate of infeasibility has to hold for.
const REACH: f64 = 1e3;
/// Roundings that may add up in one result: sums of 16 products one after the other in Cholesky factor, projection,
/// rotations and substitutions, and one digit that the solver gives away by orthogonalising once only.
const ROUNDING: f64 = 1e3 * f64::EPSILON;

/// The numbers that problems are made of.
struct Numbers {
    /// Zeros and ones most often: what is exactly parallel, coinciding or met with equality is what gives trouble.
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

/// A problem, a guess and a time limit from bytes.
#[derive(Debug, Clone)]
pub struct Case {
    /// The problem.
    pub problem: DenseQp,
    /// The guess of the working set.
    pub guess: Vec<RowState>,
    /// The time is up at this question after the first.
    pub questions: u32,
    /// Whether the numbers are so plain that rounding excuses nothing.
    pub is_plain: bool,
    /// Whether some row all but depends on others: by 1e-6 to 1e-12.
    pub is_nearly_dependent: bool,
}

/// What a case that shows no fault came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Solved from nothing and from the guess, alike.
    Solved,
    /// Infeasible from nothing and from the guess, with certificates that check.
    Infeasible,
    /// Infeasible or not, or by how much, depends on less than the solver's tolerances; or on rounding.
    Undecided,
}

impl Case {
    /// Reads a case. Any bytes give one: what is missing counts as zeros.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let mut bytes = Unstructured::new(bytes);
        // Reading past the end gives zeros, and errors only for a type that has no values.
        Self::read(&mut bytes).unwrap_or_else(|_| Self {
            problem: DenseQp::new(1, |_, _| 1.0, |_| 0.0),
            guess: Vec::new(),
            questions: 0,
            is_plain: true,
            is_nearly_dependent: false,
        })
    }

    fn read(bytes: &mut Unstructured<'_>) -> Decoded<Self> {
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
    // The value at (1, 1, …), through which many rows go then: a vertex with more rows than variables.
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

impl Case {
    /// Solves the problem in several ways and looks for what must not be; `Err` says what was found.
    pub fn check(&self) -> Result<Verdict, String> {
        let qp = self.problem.qp();
        let scale = Scale::of(&self.problem).ok_or("the target made a Hessian that is not positive definite")?;
        let nothing = || vec![RowState::Inactive; qp.row_count];
        let mut solver = Solver::new(qp.variables, qp.row_count, 0.0);
        let (cold, questions) = solver.solve(&qp, nothing(), u32::MAX);
        let (warm, _) = solver.solve(&qp, self.guess.clone(), u32::MAX);

        // What was solved before, what is in the storage and how large it is must not matter.
        let (again, _) = solver.solve(&qp, nothing(), u32::MAX);
        same_bits(&cold, &again).map_err(|what| format!("the same solver, again: {what}"))?;
        let (larger, _) = Solver::new(MAX_VARIABLES + 3, MAX_ROWS + 5, f64::NAN).solve(&qp, nothing(), u32::MAX);
        same_bits(&cold, &larger).map_err(|what| format!("another solver: {what}"))?;

        let limit = self.questions;
        let (short, asked) = solver.solve(&qp, nothing(), limit);
        if questions <= limit {
            same_bits(&cold, &short).map_err(|what| format!("time enough: {what}"))?;
        } else if !matches!(short.outcome, QpOutcome::Expired { iterations } if iterations <= limit)
            || asked != limit + 1
        {
            return Err(format!("time up at question {limit}: {:?} after {asked} questions", short.outcome));
        }

        // Rounding excuses nothing in plain numbers; in others what it can do is measured at the farthest point on the way.
        // Rows that are dependent to the solver, 1e-9, and yet differ by more than it tolerates, 1e-10, it may go on
        // exchanging for one another.
        let mut is_excused = |plea: &Plea, guess: &[RowState]| {
            let is_exchanging = matches!(plea.outcome, QpOutcome::Failed { .. }) && self.is_nearly_dependent;
            let mut is_drowned =
                || (0..WAY).any(|limit| scale.is_drowned(&qp, &solver.solve(&qp, guess.to_vec(), limit).0));
            !self.is_plain && !is_solved(plea) && (is_exchanging || is_drowned())
        };
        let cold_finding = match scale.examine(&qp, &cold, self.is_plain) {
            Err(_) if is_excused(&cold, &nothing()) => Finding::Undecided,
            other => other.map_err(|what| format!("cold: {what}"))?,
        };
        let warm_finding = match scale.examine(&qp, &warm, self.is_plain) {
            Err(_) if is_excused(&warm, &self.guess) => Finding::Undecided,
            other => other.map_err(|what| format!("guessed: {what}"))?,
        };
        match (&cold_finding, &warm_finding) {
            (Finding::Solved { tolerance: a }, Finding::Solved { tolerance: b }) => {
                let worth = 2.0 * (scale.worth(&qp, &cold) + scale.worth(&qp, &warm));
                let tolerance = a + b + if self.is_plain { 0.0 } else { worth.sqrt() };
                scale.compare(&cold, &warm, tolerance)?;
                Ok(Verdict::Solved)
            }
            (Finding::Infeasible, Finding::Infeasible) => Ok(Verdict::Infeasible),
            // Where residual and certificate both check, they contradict each other by less than their tolerances.
            _ if self.is_plain => Err(format!("cold {:?}, guessed {:?}", cold.outcome, warm.outcome)),
            _ => Ok(Verdict::Undecided),
        }
    }
}

/// The core's solver, which can be told when its time is up.
struct Solver(ActiveSet<Vec<f64>>);

impl Solver {
    fn new(variables: usize, rows: usize, storage: f64) -> Self {
        let capacity = SolverCapacity { variables, rows };
        let solver = ActiveSet::new(capacity, MAX_ITERATIONS, vec![storage; capacity.storage_len()]);
        Self(solver.expect("a number of variables that the solver takes"))
    }

    /// Solves; `expired` says no `limit` times, then yes. Gives the number of questions as well.
    fn solve(&mut self, qp: &Qp<'_>, working: Vec<RowState>, limit: u32) -> (Plea, u32) {
        let (z, multipliers) = (vec![0.0; qp.stride], vec![0.0; padded(qp.row_count)]);
        let mut plea = Plea { outcome: QpOutcome::Failed { iterations: 0 }, z, multipliers, working };
        let mut answer = Answer { z: &mut plea.z, multipliers: &mut plea.multipliers, working: &mut plea.working };
        let mut questions = 0;
        let mut expired = || {
            questions += 1;
            questions > limit
        };
        plea.outcome = self.0.solve(qp, &mut answer, &mut expired);
        (plea, questions)
    }
}

fn is_solved(plea: &Plea) -> bool {
    matches!(plea.outcome, QpOutcome::Solved { .. })
}

/// What is wrong if two answers differ in any bit.
fn same_bits(a: &Plea, b: &Plea) -> Result<(), String> {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let is_same = a.outcome == b.outcome
        && a.working == b.working
        && bits(&a.z) == bits(&b.z)
        && bits(&a.multipliers) == bits(&b.multipliers);
    if is_same { Ok(()) } else { Err(format!("{a:?} became {b:?}")) }
}

/// An answer that is no fault in itself.
enum Finding {
    /// Solved; by how much y may be off.
    Solved { tolerance: f64 },
    /// Infeasible, proven.
    Infeasible,
    /// Nothing proven, for a reason that the solver is not to blame for.
    Undecided,
}

/// The lengths that rounding is relative to.
struct Scale {
    variables: usize,
    /// L, lower triangular, n×n row-major, H = L Lᵀ: U transposed.
    factor: Vec<f64>,
    /// ‖H‖^½ or more.
    largest: f64,
    /// ‖U⁻ᵀ g‖.
    unconstrained: f64,
    /// ‖U⁻ᵀ a‖ of each row.
    rows: Vec<f64>,
}

fn length(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl Scale {
    fn of(problem: &DenseQp) -> Option<Self> {
        let (n, stride) = (problem.variables, padded(problem.variables));
        let mut factor = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| factor[i * n + k] * factor[j * n + k]).sum();
                let rest = problem.hessian[j * stride + i] - known;
                if i == j && rest <= 0.0 {
                    return None;
                }
                factor[i * n + j] = if i == j { rest.sqrt() } else { rest / factor[j * n + j] };
            }
        }
        let largest = length(&factor);
        let mut scale = Self { variables: n, factor, largest, unconstrained: 0.0, rows: Vec::new() };
        scale.unconstrained = length(&scale.normal(&problem.gradient));
        scale.rows = (0..problem.rows.count()).map(|row| length(&scale.normal(problem.rows.row(row)))).collect();
        Some(scale)
    }

    /// U⁻ᵀ a.
    fn normal(&self, a: &[f64]) -> Vec<f64> {
        let n = self.variables;
        let mut c: Vec<f64> = a[..n].to_vec();
        for i in 0..n {
            let known: f64 = (0..i).map(|k| self.factor[i * n + k] * c[k]).sum();
            c[i] = (c[i] - known) / self.factor[i * n + i];
        }
        c
    }

    /// ‖U z‖.
    fn length(&self, z: &[f64]) -> f64 {
        let n = self.variables;
        let y: Vec<f64> = (0..n).map(|i| (i..n).map(|k| self.factor[k * n + i] * z[k]).sum()).collect();
        length(&y)
    }

    /// What all numbers of which y is the sum come to: what rounding is relative to.
    fn of_answer(&self, plea: &Plea) -> f64 {
        let pushed: f64 = self.rows.iter().zip(&plea.multipliers).map(|(c, y)| c * y.abs()).sum();
        self.largest * length(&plea.z) + self.unconstrained + pushed
    }

    /// The most that `length` in y is in a row, times its weight.
    fn in_rows(&self, qp: &Qp<'_>, length: f64) -> f64 {
        self.rows.iter().zip(qp.weight).map(|(c, weight)| length * c * weight).fold(0.0, f64::max)
    }

    /// Whether a few roundings violate a row by more than the solver tolerates: then it adds and removes rows because of
    /// rounding, and may end anywhere. Where it has no solution, z is where it was last.
    fn is_drowned(&self, qp: &Qp<'_>, plea: &Plea) -> bool {
        self.in_rows(qp, 4.0 * f64::EPSILON * self.of_answer(plea)) >= FEASIBLE
    }

    /// How far a row of W may be from its bound: what the solver tolerates, and rounding.
    fn off(&self, qp: &Qp<'_>, row: usize, rounding: f64) -> f64 {
        FEASIBLE / qp.weight[row] + rounding * self.rows[row]
    }

    /// What being off the bounds by that much is worth, Σ |y| off: twice that of two answers bounds the square of their
    /// distance, however nearly parallel rows are.
    fn worth(&self, qp: &Qp<'_>, plea: &Plea) -> f64 {
        let rounding = ROUNDING * self.of_answer(plea);
        plea.multipliers[..qp.row_count].iter().enumerate().map(|(row, y)| y.abs() * self.off(qp, row, rounding)).sum()
    }

    /// Looks at one answer by itself.
    fn examine(&self, qp: &Qp<'_>, plea: &Plea, is_plain: bool) -> Result<Finding, String> {
        if plea.outcome.iterations() > MAX_ITERATIONS {
            return Err(format!("{:?}, more than {MAX_ITERATIONS}", plea.outcome));
        }
        match plea.outcome {
            QpOutcome::Solved { .. } => self.examine_solution(qp, plea),
            QpOutcome::Infeasible { .. } => self.examine_certificate(qp, plea, is_plain),
            outcome => Err(format!("{outcome:?}")),
        }
    }

    fn examine_solution(&self, qp: &Qp<'_>, plea: &Plea) -> Result<Finding, String> {
        let mut scratch = vec![0.0; 3 * qp.stride + padded(qp.row_count)];
        let residual = kkt_residual(qp, &plea.z, &plea.multipliers, &mut scratch);
        let rounding = ROUNDING * self.of_answer(plea);
        let off = |row: usize| self.off(qp, row, rounding);
        let products = plea.multipliers[..qp.row_count].iter().enumerate().map(|(row, y)| y.abs() * off(row));
        let allowed = KktResidual {
            // The residual is Uᵀ times that of y.
            stationarity: rounding * self.largest,
            violation: FEASIBLE + self.in_rows(qp, rounding),
            complementarity: products.fold(0.0, f64::max),
        };
        let is_allowed = residual.stationarity <= allowed.stationarity
            && residual.violation <= allowed.violation
            && residual.complementarity <= allowed.complementarity;
        if !is_allowed {
            return Err(format!("{residual:?}, allowed {allowed:?}"));
        }
        let mut values = vec![0.0; padded(qp.row_count)];
        qp.rows.values(&plea.z, &mut values);
        for (row, value) in values[..qp.row_count].iter().enumerate() {
            let (state, y) = (plea.working[row], plea.multipliers[row]);
            let (is_consistent, slack) = match state {
                RowState::Inactive => (y == 0.0, 0.0),
                RowState::Lower => (y <= 0.0, value - qp.lower[row]),
                RowState::Upper => (y >= 0.0, qp.upper[row] - value),
            };
            // Written so that NaN fails.
            if !(is_consistent && slack.abs() <= off(row)) {
                return Err(format!("row {row} is {state:?} with multiplier {y:e} and {slack:e} from its bound"));
            }
        }
        Ok(Finding::Solved { tolerance: rounding })
    }

    fn examine_certificate(&self, qp: &Qp<'_>, plea: &Plea, is_plain: bool) -> Result<Finding, String> {
        let y = &plea.multipliers;
        let mut scratch = vec![0.0; qp.stride];
        if certificate_gap(qp, y, REACH, &|_| true, &mut scratch).is_some() {
            return Ok(Finding::Infeasible);
        }
        // A contradiction so small that it holds for a shorter reach only.
        if !is_plain && certificate_gap(qp, y, 1.0, &|_| true, &mut scratch).is_some() {
            return Ok(Finding::Undecided);
        }
        // What is left of Σ y a, which should be nothing; the check has put it there.
        let left = length(&self.normal(&scratch));
        let all: f64 = self.rows.iter().zip(y).map(|(c, y)| c * y.abs()).sum();
        // Rows that are nearly dependent, not only by rounding, are so to the solver: that is how it is made.
        let is_nearly_dependent = left > ROUNDING * all && left <= DEPENDENT * all;
        // How much is missing, in any z, and how much of that is nothing to the solver.
        let pushing = || y.iter().enumerate().filter(|(_, y)| **y != 0.0);
        let bound = |row: usize, y: f64| if y > 0.0 { qp.upper[row] } else { qp.lower[row] };
        let missing = pushing().map(|(row, y)| -y * bound(row, *y)).sum::<f64>();
        let rounding = ROUNDING * self.of_answer(plea);
        let nothing = pushing().map(|(row, y)| y.abs() * self.off(qp, row, rounding)).sum::<f64>();
        // The row that can't be met has a multiplier of one; without it there is no certificate to speak of.
        let is_certificate = pushing().any(|(_, y)| y.abs() >= 0.5);
        if !is_plain && is_certificate && (is_nearly_dependent || missing.abs() <= nothing) {
            return Ok(Finding::Undecided);
        }
        Err(format!("the certificate proves nothing: {left:e} of {all:e} left, {missing:e} missing, {y:?}"))
    }

    /// Whether two solutions are one.
    fn compare(&self, a: &Plea, b: &Plea, tolerance: f64) -> Result<(), String> {
        let difference: Vec<f64> = a.z.iter().zip(&b.z).map(|(a, b)| a - b).collect();
        let apart = self.length(&difference);
        if apart > tolerance {
            return Err(format!("solutions {apart:e} apart, allowed {tolerance:e}"));
        }
        Ok(())
    }
}

/// As the lines of a test that makes the problem.
impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (problem, n) = (&self.problem, self.problem.variables);
        let stride = padded(n);
        let hessian: Vec<&[f64]> = problem.hessian.chunks(stride).take(n).map(|row| &row[..n]).collect();
        writeln!(f, "let hessian = {hessian:?};")?;
        writeln!(f, "let gradient = {:?};", &problem.gradient[..n])?;
        writeln!(f, "let mut problem = DenseQp::new({n}, |i, j| hessian[i][j], |i| gradient[i]);")?;
        for row in 0..problem.rows.count() {
            let (a, lower, upper) = (&problem.rows.row(row)[..n], problem.lower[row], problem.upper[row]);
            writeln!(f, "problem.push(&{a:?}, {lower:?}, {upper:?});")?;
        }
        writeln!(f, "problem.weight = vec!{:?};", problem.weight)?;
        writeln!(f, "let guess = vec!{:?};", self.guess)?;
        writeln!(f, "// {}", if self.is_plain { "plain numbers" } else { "hard numbers" })
    }
}
