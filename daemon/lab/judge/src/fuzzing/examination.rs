//! What must hold of an answer. Lengths and tolerances are taken in the coordinates of the solver,
//! y = U z with H = Uᵀ U, where a row is c = U⁻ᵀ a and rounding is to be measured. U here is
//! computed anew, from what is in the problem only.

use admittance_core::mpc::qp::{Qp, QpOutcome, RowState, certificate_gap, kkt_residual, padded};

use super::MAX_ITERATIONS;
use super::combination::{Combination, Combinations};
use crate::judge::Plea;
use crate::random_qp::DenseQp;

/// Violation times weight that the solver leaves by design.
const FEASIBLE: f64 = 1e-10;
/// Part of its length below which the solver takes a row for a combination of others, by design.
const DEPENDENT: f64 = 1e-9;
/// The same of a row that is exchanged for others without end: then it is missed by what is negligible, by design.
const NEARLY_DEPENDENT: f64 = 1e-7;
/// Part of the longest of the normals that it is a combination of, below which what is left of a
/// row is rounding, by design.
const COMBINED: f64 = 1e-12;
/// Violation times weight by which bounds may contradict each other and be met nevertheless, by
/// design.
const NEGLIGIBLE: f64 = 1e-6;
/// |z_i| that a certificate of infeasibility has to hold for.
const REACH: f64 = 1e3;
/// Roundings that may add up in one result: sums of 16 products one after the other in Cholesky
/// factor, projection, rotations and substitutions, and up to two digits that the solver gives away
/// by orthogonalising once only.
const ROUNDING: f64 = 1e3 * f64::EPSILON;

/// An answer that is no fault in itself.
pub(super) enum Finding {
    /// Solved; by how much y may be off.
    Solved { tolerance: f64 },
    /// Infeasible, proven.
    Infeasible,
    /// Nothing proven, for a reason that the solver is not to blame for.
    Undecided,
}

/// The lengths that rounding is relative to.
pub(super) struct Scale {
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

pub(super) fn length(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl Scale {
    pub(super) fn of(problem: &DenseQp) -> Option<Self> {
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
    pub(super) fn normal(&self, a: &[f64]) -> Vec<f64> {
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

    /// Whether a few roundings violate a row by more than the solver tolerates: then it adds and
    /// removes rows because of rounding, and may end anywhere. Where it has no solution, z is where
    /// it was last.
    pub(super) fn is_drowned(&self, qp: &Qp<'_>, plea: &Plea) -> bool {
        self.in_rows(qp, 4.0 * f64::EPSILON * self.of_answer(plea)) >= FEASIBLE
    }

    /// The same with what the working set's own multipliers come to, which an answer without a
    /// solution does not tell: between rows that nearly depend on one another they are as large as
    /// y goes over what is left of their normals.
    pub(super) fn is_drowned_by_working(&self, problem: &DenseQp, plea: &Plea) -> bool {
        let pushed = Combinations::of(self, problem, plea).pushed(self, problem, plea);
        self.in_rows(&problem.qp(), 4.0 * f64::EPSILON * pushed) >= FEASIBLE
    }

    /// Whether y is so long that a row that is dependent to the solver may be missed by more than
    /// it neglects.
    pub(super) fn is_far(&self, qp: &Qp<'_>, plea: &Plea) -> bool {
        self.in_rows(qp, DEPENDENT * self.length(&plea.z)) >= NEGLIGIBLE
    }

    /// How far a row of W may be from its bound: what the solver tolerates, and rounding.
    fn off(&self, qp: &Qp<'_>, row: usize, rounding: f64) -> f64 {
        FEASIBLE / qp.weight[row] + rounding * self.rows[row]
    }

    /// What the multipliers of `a` make of its being off its bounds, and of `b` being beyond them.
    /// With the same of `b` that bounds the square of their distance, however nearly parallel rows
    /// are:
    /// |y_a − y_b|² = Σ λ_a cᵀ(y_a − y_b) − Σ λ_b cᵀ(y_a − y_b).
    ///
    /// Plain numbers meet their bounds but for rounding, which is in the tolerance already: of these only what
    /// `b` is seen to be beyond counts, which is what the solver tolerates; of what may be rounding, [`Self::given`].
    pub(super) fn worth(&self, qp: &Qp<'_>, a: &Plea, b: &Plea, is_plain: bool) -> f64 {
        let rounding = ROUNDING * self.of_answer(a);
        let mut values = vec![0.0; padded(qp.row_count)];
        qp.rows.values(&b.z, &mut values);
        let worth = |(row, y): (usize, &f64)| {
            let off = self.off(qp, row, rounding);
            let beyond = (values[row] - qp.upper[row]).max(qp.lower[row] - values[row]);
            let distance = match is_plain {
                true if beyond > rounding * self.rows[row] => beyond,
                true => 0.0,
                false => off + beyond.max(off),
            };
            y.abs() * distance
        };
        a.multipliers[..qp.row_count].iter().enumerate().map(worth).sum()
    }

    /// How far y goes for the working sets of both to give as much as one of them is seen to be further beyond its bounds than
    /// the other: however little that is, of rows that are nearly parallel it is far.
    pub(super) fn given(&self, problem: &DenseQp, a: &Plea, b: &Plea) -> f64 {
        let qp = problem.qp();
        let beyond = |plea: &Plea| {
            let mut values = vec![0.0; padded(qp.row_count)];
            qp.rows.values(&plea.z, &mut values);
            let bounds = qp.lower.iter().zip(qp.upper);
            values.iter().zip(bounds).map(|(value, (lower, upper))| value - value.max(*lower).min(*upper)).collect()
        };
        let (beyond_a, beyond_b): (Vec<f64>, Vec<f64>) = (beyond(a), beyond(b));
        let is_held = |row: usize| [a, b].iter().any(|plea| plea.working[row] != RowState::Inactive);
        let both = Combinations::of_rows(self, problem, &is_held, DEPENDENT);
        both.length_of(|row| beyond_b[row] - beyond_a[row])
    }

    /// Looks at one answer by itself.
    pub(super) fn examine(&self, problem: &DenseQp, plea: &Plea, is_plain: bool) -> Result<Finding, String> {
        if plea.outcome.iterations() > MAX_ITERATIONS {
            return Err(format!("{:?}, more than {MAX_ITERATIONS}", plea.outcome));
        }
        match plea.outcome {
            QpOutcome::Solved { .. } => self.examine_solution(problem, plea, is_plain),
            QpOutcome::Infeasible { .. } => self.examine_certificate(&problem.qp(), plea, is_plain),
            outcome => Err(format!("{outcome:?}")),
        }
    }

    fn examine_solution(&self, problem: &DenseQp, plea: &Plea, is_plain: bool) -> Result<Finding, String> {
        let qp = &problem.qp();
        let mut scratch = vec![0.0; 3 * qp.stride + padded(qp.row_count)];
        let residual = kkt_residual(qp, &plea.z, &plea.multipliers, &mut scratch);
        let rounding = ROUNDING * self.of_answer(plea);
        let off = |row: usize| self.off(qp, row, rounding);
        let products = plea.multipliers[..qp.row_count].iter().enumerate().map(|(row, y)| y.abs() * off(row));
        // The residual is Uᵀ times that of y.
        let (stationarity, complementarity) = (rounding * self.largest, products.fold(0.0, f64::max));
        // Written so that NaN fails.
        if !(residual.stationarity <= stationarity && residual.complementarity <= complementarity) {
            return Err(format!("{residual:?}, allowed {stationarity:e} and {complementarity:e}"));
        }
        let mut values = vec![0.0; padded(qp.row_count)];
        qp.rows.values(&plea.z, &mut values);
        let (mut combinations, mut is_contradicted) = (None, false);
        for (row, value) in values[..qp.row_count].iter().enumerate() {
            let (state, y) = (plea.working[row], plea.multipliers[row]);
            let (is_consistent, slack) = match state {
                RowState::Inactive => (y == 0.0, 0.0),
                RowState::Lower => (y <= 0.0, value - qp.lower[row]),
                RowState::Upper => (y >= 0.0, qp.upper[row] - value),
            };
            if !(is_consistent && slack.abs() <= off(row)) {
                return Err(format!("row {row} is {state:?} with multiplier {y:e} and {slack:e} from its bound"));
            }
            let violation = (value - qp.upper[row]).max(qp.lower[row] - value);
            if state != RowState::Inactive || violation <= off(row) {
                continue;
            }
            let combinations = combinations.get_or_insert_with(|| Combinations::of(self, problem, plea));
            let combination = combinations.of_row(self, problem, row);
            let allowed = self.implied(qp, plea, row, &combination, rounding);
            let contradiction =
                if self.is_nearly_implied(row, &combination) { NEGLIGIBLE / qp.weight[row] } else { 0.0 };
            // In plain numbers no bounds contradict each other by so little.
            let is_let_be = !is_plain && violation > allowed && violation <= allowed + contradiction;
            is_contradicted |= is_let_be;
            if !(violation <= allowed || is_let_be) {
                return Err(format!(
                    "row {row} violated by {violation:e}, {:e} of its scale, allowed {allowed:e}; {:e} of its length are left",
                    violation * qp.weight[row],
                    combination.rest / self.rows[row]
                ));
            }
        }
        Ok(if is_contradicted { Finding::Undecided } else { Finding::Solved { tolerance: rounding } })
    }

    /// What may be left of a row's normal that counts as a combination of others: a part of its length.
    fn least(&self, row: usize, part: f64) -> f64 {
        // The solver and this do not round alike.
        (1.0 + 1e-6) * part * self.rows[row]
    }

    /// Whether the working set all but spans a row's normal.
    fn is_implied(&self, row: usize, combination: &Combination) -> bool {
        self.is_within(row, combination, DEPENDENT)
    }

    /// Whether it does where rows are exchanged for one another without end.
    fn is_nearly_implied(&self, row: usize, combination: &Combination) -> bool {
        self.is_within(row, combination, NEARLY_DEPENDENT)
    }

    fn is_within(&self, row: usize, combination: &Combination, part: f64) -> bool {
        let longest =
            combination.parts.iter().fold(0.0_f64, |most, (row, part, _)| most.max(part.abs() * self.rows[*row]));
        combination.rest <= self.least(row, part).max(COMBINED * longest)
    }

    /// By how much a row may be violated, as `ActiveSet` promises, where no bounds contradict each
    /// other: Σ |f_i o_i| + ‖e‖ ‖y‖ more than what is tolerated, with c = Σ f_i c_i + e and each
    /// member off by rounding.
    fn implied(&self, qp: &Qp<'_>, plea: &Plea, row: usize, combination: &Combination, rounding: f64) -> f64 {
        let off = self.off(qp, row, rounding);
        if !self.is_implied(row, combination) {
            return off;
        }
        // One member may be left out of the sum: then its own part is in e.
        let own = combination.parts.iter().map(|(_, part, distance)| part.abs() * distance);
        let left = own.map(|own| combination.rest.hypot(own)).filter(|left| *left <= self.least(row, DEPENDENT));
        let left = left.fold(combination.rest, f64::max);
        let members: f64 = combination.parts.iter().map(|(row, part, _)| part.abs() * rounding * self.rows[*row]).sum();
        off + members + left * self.length(&plea.z)
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
        // Rows that are nearly dependent, not only by rounding, are so to the solver: that is how
        // it is made.
        let is_nearly_dependent = left > ROUNDING * all && left <= DEPENDENT * all;
        // How much is missing, in any z, and how much of that is nothing to the solver.
        let pushing = || y.iter().enumerate().filter(|(_, y)| **y != 0.0);
        let bound = |row: usize, y: f64| if y > 0.0 { qp.upper[row] } else { qp.lower[row] };
        let missing = pushing().map(|(row, y)| -y * bound(row, *y)).sum::<f64>();
        let rounding = ROUNDING * self.of_answer(plea);
        let nothing = pushing().map(|(row, y)| y.abs() * self.off(qp, row, rounding)).sum::<f64>();
        // The row that can't be met has a multiplier of one; without it there is no certificate to
        // speak of.
        let is_certificate = pushing().any(|(_, y)| y.abs() >= 0.5);
        if !is_plain && is_certificate && (is_nearly_dependent || missing.abs() <= nothing) {
            return Ok(Finding::Undecided);
        }
        Err(format!("the certificate proves nothing: {left:e} of {all:e} left, {missing:e} missing, {y:?}"))
    }

    /// Whether two solutions are one.
    pub(super) fn compare(&self, a: &Plea, b: &Plea, tolerance: f64) -> Result<(), String> {
        let difference: Vec<f64> = a.z.iter().zip(&b.z).map(|(a, b)| a - b).collect();
        let apart = self.length(&difference);
        if apart > tolerance {
            return Err(format!("solutions {apart:e} apart, allowed {tolerance:e}"));
        }
        Ok(())
    }
}
