//! Consecutive MPC problems, solved one after the other as the controller does it: condensed,
//! warm-started from the one before, in storage that is allocated once.

use admittance_core::mpc::condensation::{Capacity, InputAxes, MAX_ROWS, MpcRows, Prediction, Workspace, condense};
use admittance_core::mpc::constraints::Constraints;
use admittance_core::mpc::cost::{SetPoint, Weights};
use admittance_core::mpc::horizon::Horizon;
use admittance_core::mpc::model::{Model, State};
use admittance_core::mpc::qp::{
    ActiveSet, Answer, KktResidual, Qp, QpOutcome, QpSolver, RowState, SolverCapacity, kkt_residual,
};
use admittance_core::mpc::warm_start::WarmStart;
use admittance_core::quantities::{Instant, Span};
use nalgebra::{SMatrix, SVector};

/// Iterations that the solver may take.
const MAX_ITERATIONS: u32 = 500;

/// One problem, for N joints and as many task axes.
#[derive(Debug, Clone)]
pub struct Problem<const N: usize> {
    /// The model.
    pub model: Model<N, N>,
    /// x_0.
    pub initial: State<N, N>,
    /// The joint velocity reference without inputs, less the drift, by step, rad/s.
    pub known_reference: Vec<SVector<f64, N>>,
    /// Joint velocity by which the TCP falls behind what J predicts, rad/s.
    pub drift: SVector<f64, N>,
    /// What is bounded.
    pub constraints: Constraints<'static, N, N>,
    /// x⁰.
    pub set_point: SetPoint<N, N>,
    /// J at the measured pose: what task weights need, else zero.
    pub jacobian: SMatrix<f64, N, N>,
    /// u_{−1}: what the rate of the first input is counted from, m/s and rad/s.
    pub previous_input: SVector<f64, N>,
    /// The exact inputs, step by step.
    pub solution: Vec<f64>,
}

/// Consecutive problems with M inputs, of joints with the speed loops (4).
#[derive(Debug, Clone)]
pub struct Sequence<const N: usize, const M: usize> {
    /// The horizon.
    pub horizon: Horizon<N, N>,
    /// Axes with an input.
    pub inputs: InputAxes<N>,
    /// Axes with a wrench state.
    pub wrench_axes: InputAxes<N>,
    /// Q.
    pub weights: Weights<N, N>,
    /// R.
    pub input_weight: SVector<f64, N>,
    /// The problems.
    pub problems: Vec<Problem<N>>,
}

impl<const N: usize, const M: usize> Sequence<N, M> {
    fn prediction<'a>(&'a self, problem: &'a Problem<N>) -> Prediction<'a, N, N> {
        Prediction {
            initial: problem.initial,
            known_reference: &problem.known_reference,
            drift: problem.drift,
            inputs: self.inputs,
            previous_input: problem.previous_input,
            wrench_axes: self.wrench_axes,
            constraints: problem.constraints,
            set_point: problem.set_point,
            weights: &self.weights,
            jacobian: problem.jacobian,
            input_weight: self.input_weight,
            slack: None,
        }
    }

    /// Stamp of a problem's sample, ns.
    fn stamp(&self, index: usize) -> Instant {
        let step = Span::from_seconds(self.horizon.steps()[0].duration);
        Instant::from_nanoseconds((index as u64 + 1) * step.nanoseconds())
    }
}

/// What the solver starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Nothing.
    Cold,
    /// The working set of the problem before.
    Warm,
}

/// Solves the problems of a sequence.
#[derive(Debug)]
pub struct Runner<const N: usize, const M: usize> {
    workspace: Workspace<Vec<f64>>,
    solver: ActiveSet<Vec<f64>>,
    warm_start: WarmStart,
}

impl<const N: usize, const M: usize> Runner<N, M> {
    /// Storage for a sequence.
    ///
    /// # Panics
    /// Never: the storage has the length that its users ask for.
    pub fn new(sequence: &Sequence<N, M>) -> Self {
        let capacity = Capacity::new::<N, N>(sequence.horizon.steps().len(), sequence.horizon.carried());
        let storage = vec![0.0; capacity.storage_len()];
        let solver = SolverCapacity { variables: capacity.variables, rows: MAX_ROWS };
        Self {
            workspace: Workspace::new(&sequence.horizon, &sequence.weights, storage).expect("storage of that length"),
            solver: ActiveSet::new(solver, MAX_ITERATIONS, vec![0.0; solver.storage_len()])
                .expect("storage of that length"),
            warm_start: WarmStart::empty(),
        }
    }

    /// Forgets all earlier problems.
    pub fn reset(&mut self) {
        self.warm_start = WarmStart::empty();
    }

    /// Condenses and solves problem `index`, then hands it with its answer to `look`.
    ///
    /// # Panics
    /// When the problem does not fit the storage: it is not of the sequence that this was made for.
    pub fn solve<T>(
        &mut self,
        sequence: &Sequence<N, M>,
        index: usize,
        start: Start,
        look: impl FnOnce(QpOutcome, &MpcRows<'_, N, N, M, 1>, &Qp<'_>, &Answer<'_>, &mut [f64]) -> T,
    ) -> T {
        let problem = &sequence.problems[index];
        let prediction = sequence.prediction(problem);
        let rows = MpcRows::<N, N, M, 1>::new(&problem.model, &sequence.horizon, &prediction).expect("M inputs");
        let mut pieces = self.workspace.pieces(&rows).expect("a problem of this sequence");
        condense(&rows, &mut pieces);
        match start {
            Start::Cold => pieces.answer.working.fill(RowState::Inactive),
            Start::Warm => {
                let working = &mut *pieces.answer.working;
                self.warm_start.guess(&rows.layout, &sequence.horizon, sequence.stamp(index), working);
            }
        }
        let (qp, mut answer, scratch) = pieces.split(&rows);
        let outcome = self.solver.solve(&qp, &mut answer, &mut || false);
        if start == Start::Warm {
            self.warm_start.learn(&rows.layout, &sequence.horizon, sequence.stamp(index), answer.working);
        }
        look(outcome, &rows, &qp, &answer, scratch)
    }

    /// Largest deviation of the inputs from the exact ones, and the residual.
    pub fn deviation(
        &mut self,
        sequence: &Sequence<N, M>,
        index: usize,
        start: Start,
    ) -> (QpOutcome, f64, KktResidual) {
        self.solve(sequence, index, start, |outcome, rows, qp, answer, scratch| {
            let exact = sequence.problems[index].solution.chunks_exact(M).enumerate();
            let deviation = exact.fold(0.0_f64, |deviation, (step, exact)| {
                let found = &answer.z[rows.inputs_of(step)];
                found.iter().zip(exact).fold(deviation, |deviation, (z, exact)| deviation.max((z - exact).abs()))
            });
            (outcome, deviation, kkt_residual(qp, answer.z, answer.multipliers, scratch))
        })
    }
}
