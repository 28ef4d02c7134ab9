//! Small degenerate problems from bytes, and what must hold of the solver's answers to them: shared
//! by the fuzz target (`fuzz/`) and the test that replays its inputs without a fuzzer.

mod combination;
mod decoding;
mod examination;

use std::fmt;

use admittance_core::mpc::qp::{ActiveSet, Answer, Qp, QpOutcome, QpSolver, RowState, SolverCapacity, padded};
use arbitrary::Unstructured;

pub use decoding::{MAX_ROWS, MAX_VARIABLES, weight};
use examination::{Finding, Scale};

use crate::judge::Plea;
use crate::random_qp::DenseQp;

/// Iterations that the solver may take: far more than there are ways to need, so that reaching it
/// means a cycle.
const MAX_ITERATIONS: u32 = 1000;
/// Iterations of a failed run that are looked at for what went wrong.
const WAY: u32 = 100;

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
    /// Infeasible or not, or by how much, depends on less than the solver's tolerances; or on
    /// rounding.
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
}

impl Case {
    /// Solves the problem in several ways and looks for what must not be; `Err` says what was
    /// found.
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

        // Rounding excuses nothing in plain numbers; in others what it can do is measured at the
        // farthest point on the way, and so is what rows that nearly depend on others may be missed
        // by there, or what rounding makes of their multipliers: beyond what is negligible the
        // solver gives up.
        let mut is_excused = |plea: &Plea, guess: &[RowState]| {
            let has_given_up = matches!(plea.outcome, QpOutcome::Failed { .. }) && self.is_nearly_dependent;
            let has_gone_too_far =
                |plea: &Plea| scale.is_far(&qp, plea) || scale.is_drowned_by_working(&self.problem, plea);
            let is_beyond = |plea: &Plea| scale.is_drowned(&qp, plea) || has_given_up && has_gone_too_far(plea);
            let mut way = (0..WAY).map(|limit| solver.solve(&qp, guess.to_vec(), limit).0);
            !self.is_plain && !is_solved(plea) && way.any(|plea| is_beyond(&plea))
        };
        let cold_finding = match scale.examine(&self.problem, &cold, self.is_plain) {
            Err(_) if is_excused(&cold, &nothing()) => Finding::Undecided,
            other => other.map_err(|what| format!("cold: {what}"))?,
        };
        let warm_finding = match scale.examine(&self.problem, &warm, self.is_plain) {
            Err(_) if is_excused(&warm, &self.guess) => Finding::Undecided,
            other => other.map_err(|what| format!("guessed: {what}"))?,
        };
        match (&cold_finding, &warm_finding) {
            (Finding::Solved { tolerance: a }, Finding::Solved { tolerance: b }) => {
                let worth = |a, b| scale.worth(&qp, a, b, self.is_plain);
                let given = if self.is_plain { scale.given(&self.problem, &cold, &warm) } else { 0.0 };
                let tolerance = a + b + (worth(&cold, &warm) + worth(&warm, &cold)).sqrt() + given;
                scale.compare(&cold, &warm, tolerance)?;
                Ok(Verdict::Solved)
            }
            (Finding::Infeasible, Finding::Infeasible) => Ok(Verdict::Infeasible),
            // Where residual and certificate both check, they contradict each other by less than
            // their tolerances.
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
