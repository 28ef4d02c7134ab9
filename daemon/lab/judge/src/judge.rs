//! The judge: Clarabel at a tolerance of 1e-10, on the same problem; where it goes on disagreeing
//! at finer ones, [`exact`] decides.

use admittance_core::mpc::qp::{
    ActiveSet, Answer, Qp, QpOutcome, QpSolver, SolverCapacity, certificate_gap, kkt_residual,
};
use admittance_core::mpc::qp::{RowState, padded};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use crate::exact;
use crate::random_qp::DenseQp;

/// Tolerance of the judge.
const TOLERANCE: f64 = 1e-10;
/// Its tolerances, tried in turn while there is a difference; a tolerance that it cannot reach
/// gives no judgement.
const APPEAL_TOLERANCES: [f64; 3] = [1e-12, 1e-13, 1e-14];
/// Largest difference of two solutions, relative to the larger of 1 and the solution.
const SOLUTION: f64 = 1e-7;
/// Largest difference from the exact solution, likewise, of an answer that the judge does not
/// share.
const PROVEN: f64 = 1e-9;
/// Largest KKT residual of an answer.
const RESIDUAL: f64 = 1e-9;
/// |z_i| that a certificate of infeasibility has to hold for.
const REACH: f64 = 1e3;
/// Iterations that the solver may take.
const MAX_ITERATIONS: u32 = 2000;

/// What became of many problems.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Solved by both.
    pub solved: usize,
    /// Infeasible for both, with a certificate that checks.
    pub infeasible: usize,
    /// Solved by both, but alike only after the judge has looked again at a finer tolerance.
    pub appeals: usize,
    /// Clarabel's answer remains different, and the solver's is the exact one: Clarabel is off.
    pub judge_off: usize,
    /// Clarabel could not say at its tolerance.
    pub excluded: usize,
    /// Most iterations.
    pub most_iterations: u32,
    /// Seeds of problems on which they disagree, with what they say.
    pub disagreements: Vec<(u64, String)>,
}

/// What Clarabel says.
enum Sentence {
    Solved(Vec<f64>),
    Infeasible,
    None,
}

fn judge(problem: &DenseQp, tolerance: f64) -> Sentence {
    let (qp, n) = (problem.qp(), problem.variables);
    // Equalities first, then the finite bounds.
    let is_equality = |row: usize| qp.lower[row] == qp.upper[row];
    let mut rows: Vec<(f64, usize, f64)> = Vec::new();
    for row in (0..qp.row_count).filter(|&row| is_equality(row)) {
        rows.push((1.0, row, qp.upper[row]));
    }
    let equalities = rows.len();
    for row in (0..qp.row_count).filter(|&row| !is_equality(row)) {
        for (sign, bound) in [(1.0, qp.upper[row]), (-1.0, -qp.lower[row])] {
            if bound.is_finite() {
                rows.push((sign, row, bound));
            }
        }
    }
    let hessian = dense(n, n, |row, column| if row <= column { qp.hessian[row * qp.stride + column] } else { 0.0 });
    let matrix = dense(rows.len(), n, |row, column| rows[row].0 * problem.rows.row(rows[row].1)[column]);
    let bounds: Vec<f64> = rows.iter().map(|row| row.2).collect();
    let cones = [SupportedConeT::ZeroConeT(equalities), SupportedConeT::NonnegativeConeT(rows.len() - equalities)];
    let settings = DefaultSettings {
        verbose: false,
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        max_threads: 1,
        ..DefaultSettings::default()
    };
    let mut solver = DefaultSolver::new(&hessian, &qp.gradient[..n], &matrix, &bounds, &cones, settings)
        .expect("a convex problem of matching sizes");
    solver.solve();
    match solver.solution.status {
        SolverStatus::Solved => Sentence::Solved(solver.solution.x.clone()),
        SolverStatus::PrimalInfeasible => Sentence::Infeasible,
        _ => Sentence::None,
    }
}

fn dense(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> CscMatrix<f64> {
    let (mut starts, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for column in 0..columns {
        for (row, value) in (0..rows).map(|row| (row, entry(row, column))).filter(|(_, value)| *value != 0.0) {
            indices.push(row);
            values.push(value);
        }
        starts.push(indices.len());
    }
    CscMatrix::new(rows, columns, starts, indices, values)
}

/// The core's solver on a problem of any size.
#[derive(Debug)]
pub struct Defendant {
    solver: ActiveSet<Vec<f64>>,
    scratch: Vec<f64>,
}

/// An answer of the core's solver.
#[derive(Debug, Clone)]
pub struct Plea {
    /// The outcome.
    pub outcome: QpOutcome,
    /// z, stride long.
    pub z: Vec<f64>,
    /// Multipliers, one a row.
    pub multipliers: Vec<f64>,
    /// The working set.
    pub working: Vec<RowState>,
}

impl Defendant {
    /// For problems of at most this many variables and rows.
    ///
    /// # Panics
    /// When that is more variables than the solver takes.
    pub fn new(variables: usize, rows: usize) -> Self {
        let capacity = SolverCapacity { variables, rows };
        let solver = ActiveSet::new(capacity, MAX_ITERATIONS, vec![0.0; capacity.storage_len()]);
        Self {
            solver: solver.expect("a number of variables that the solver takes"),
            scratch: vec![0.0; 3 * padded(variables) + padded(rows)],
        }
    }

    /// Solves from the given working set.
    pub fn solve(&mut self, qp: &Qp<'_>, working: Vec<RowState>) -> Plea {
        let (z, multipliers) = (vec![0.0; qp.stride], vec![0.0; padded(qp.row_count)]);
        let mut plea = Plea { outcome: QpOutcome::Failed { iterations: 0 }, z, multipliers, working };
        let mut answer = Answer { z: &mut plea.z, multipliers: &mut plea.multipliers, working: &mut plea.working };
        plea.outcome = self.solver.solve(qp, &mut answer, &mut || false);
        plea
    }

    /// What is wrong with an answer in itself: residual or certificate. `None` when nothing is.
    pub fn fault(&mut self, qp: &Qp<'_>, plea: &Plea) -> Option<String> {
        match plea.outcome {
            QpOutcome::Solved { .. } => {
                let residual = kkt_residual(qp, &plea.z, &plea.multipliers, &mut self.scratch);
                (!residual.is_within(RESIDUAL)).then(|| format!("{residual:?}"))
            }
            QpOutcome::Infeasible { .. } => certificate_gap(qp, &plea.multipliers, REACH, &|_| true, &mut self.scratch)
                .is_none()
                .then(|| "the certificate proves nothing".to_owned()),
            outcome => Some(format!("{outcome:?}")),
        }
    }

    /// Compares the solver with the judge on the random problems of some seeds, cold and from a
    /// guess that is partly wrong.
    pub fn try_seeds(&mut self, seeds: impl IntoIterator<Item = u64>) -> Tally {
        self.try_problems(seeds.into_iter().map(|seed| (seed, DenseQp::random(seed))))
    }

    /// As [`Self::try_seeds`], on problems with their seeds.
    pub fn try_problems(&mut self, problems: impl IntoIterator<Item = (u64, DenseQp)>) -> Tally {
        let mut tally = Tally::default();
        for (seed, problem) in problems {
            let qp = problem.qp();
            let cold = self.solve(&qp, vec![RowState::Inactive; qp.row_count]);
            tally.most_iterations = tally.most_iterations.max(cold.outcome.iterations());
            let mut disagree = |what: String| tally.disagreements.push((seed, what));
            if let Some(fault) = self.fault(&qp, &cold) {
                disagree(fault);
                continue;
            }
            // Every third row of the answer forgotten, every seventh row guessed wrong.
            let mut guess = cold.working.clone();
            for (row, state) in guess.iter_mut().enumerate() {
                match (row % 3, row % 7) {
                    (_, 0) => *state = RowState::Upper,
                    (0, _) => *state = RowState::Inactive,
                    _ => {}
                }
            }
            let warm = self.solve(&qp, guess);
            let is_solved = |plea: &Plea| matches!(plea.outcome, QpOutcome::Solved { .. });
            if let Some(fault) = self.fault(&qp, &warm) {
                disagree(format!("warm: {fault}"));
                continue;
            }
            if is_solved(&cold) != is_solved(&warm) {
                disagree(format!("cold {:?}, warm {:?}", cold.outcome, warm.outcome));
                continue;
            }
            match (judge(&problem, TOLERANCE), is_solved(&cold)) {
                (Sentence::Solved(expected), true) => {
                    let difference = |expected: &[f64]| {
                        let size = expected.iter().fold(1.0_f64, |size, z| size.max(z.abs()));
                        let both = expected.iter().zip(cold.z.iter().zip(&warm.z));
                        both.fold(0.0_f64, |most, (z, (cold, warm))| most.max((cold - z).abs()).max((warm - z).abs()))
                            / size
                    };
                    let mut most = difference(&expected);
                    // A gap of 1e-10 leaves a badly scaled solution open by more than that: the
                    // judge looks again.
                    if most > SOLUTION {
                        tally.appeals += 1;
                        for tolerance in APPEAL_TOLERANCES {
                            let Sentence::Solved(expected) = judge(&problem, tolerance) else { break };
                            most = difference(&expected);
                            if most <= SOLUTION {
                                break;
                            }
                        }
                    }
                    if most <= SOLUTION {
                        tally.solved += 1;
                        continue;
                    }
                    // The judge can be wrong, but that has to be proved: the solver's working set
                    // must be that of the exact solution, and its answer much closer to that than
                    // to the judge's.
                    match exact::solution(&problem, &cold.working).map(|exact| difference(&exact)) {
                        Some(off) if off <= PROVEN => tally.judge_off += 1,
                        Some(off) => {
                            disagree(format!("off by {off:.1e} of the exact solution, {most:.1e} of the judge's"))
                        }
                        None => disagree(format!("solutions differ by {most:.1e} of their size, and no proof")),
                    }
                }
                (Sentence::Infeasible, false) => tally.infeasible += 1,
                (Sentence::None, _) => tally.excluded += 1,
                (Sentence::Solved(_), false) => disagree("solved by the judge, infeasible for the solver".to_owned()),
                (Sentence::Infeasible, true) => disagree("infeasible for the judge, solved by the solver".to_owned()),
            }
        }
        tally
    }
}
