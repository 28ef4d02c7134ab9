//! Problems (18) for the tests of the condensation: on the paper's arm, and arbitrary ones for any
//! arm.

use admittance_core::mpc::condensation::{Capacity, InputAxes, MpcRows, Prediction, Slack, Workspace};
use admittance_core::mpc::constraints::{AxisBound, Constraints, DriveBounds, ForceBounds, NormalSpeed, Softened};
use admittance_core::mpc::cost::{SetPoint, Weights};
use admittance_core::mpc::horizon::Horizon;
use admittance_core::mpc::model::{Discretization, Model, State};
use admittance_core::robot::{Interval, Reference, VelocityLoops};
use nalgebra::{SMatrix, SVector, Vector2};

use super::{joint_weights, model, parameters, pushing, task_weights};

pub(crate) const UNIFORM: [f64; 5] = [0.004; 5];
pub(crate) const UNEVEN: [f64; 4] = [0.002, 0.004, 0.003, 0.006];

pub(crate) const SLACKS: [Option<Slack>; 3] = [
    None,
    Some(Slack { softened: Softened::Maximum, price: 30.0, curvature: 0.003 }),
    Some(Slack { softened: Softened::Minimum, price: 20.0, curvature: 0.2 }),
];

pub(crate) const DISCRETIZATIONS: [Discretization; 2] = [Discretization::Euler, Discretization::Zoh];

/// The first step at whose end an input can have moved a joint: under Euler it cannot in its own.
pub(crate) fn first_reached(discretization: Discretization) -> usize {
    match discretization {
        Discretization::Euler => 1,
        Discretization::Zoh => 0,
    }
}

/// Time constant in s with which parts of the set points fade in all of these problems.
const FADING: f64 = 0.01;

/// The mean of what is left of them in step `step`, by Simpson's rule.
pub(crate) fn left_in<const N: usize, const D: usize>(problem: &Problem<N, D>, step: usize) -> f64 {
    const PARTS: usize = 64;
    let durations: Vec<f64> = problem.horizon.steps().iter().map(|step| step.duration).collect();
    let start: f64 = durations[..step].iter().sum();
    let at = |part: usize| (-(start + durations[step] * part as f64 / PARTS as f64) / FADING).exp();
    let weight = |part: usize| if part == 0 || part == PARTS { 1.0 } else { 2.0 * (1 + part % 2) as f64 };
    (0..=PARTS).map(|part| weight(part) * at(part)).sum::<f64>() / (3 * PARTS) as f64
}

/// N in one unit of the slack variable.
pub(crate) const SLACK_UNIT: f64 = 100.0;

/// A problem (18) on the paper's arm: in contact with `force` N, approaching at `speed`, the joints
/// moving accordingly times `moving`.
pub(crate) struct Case {
    pub(crate) discretization: Discretization,
    pub(crate) axes: [bool; 2],
    pub(crate) weights: Weights<2, 2>,
    pub(crate) steps: &'static [f64],
    /// T_est in s.
    pub(crate) estimate: f64,
    pub(crate) force: f64,
    pub(crate) speed: f64,
    pub(crate) moving: f64,
}

pub(crate) struct Problem<const N: usize, const D: usize> {
    pub(crate) model: Model<N, D>,
    pub(crate) horizon: Horizon<N, D>,
    pub(crate) prediction: Prediction<'static, N, D>,
}

impl Case {
    pub(crate) fn problem(&self) -> Problem<2, 2> {
        let parameters = parameters();
        let sample = pushing(self.force, self.speed, 1);
        let q = sample.joint_position;
        let model = model(&parameters, &q);
        let velocity = |twist: &Vector2<f64>| model.jacobian_inverse * twist;
        let moving = velocity(&sample.twist_reference) * self.moving;
        // The estimate lags behind.
        let initial = State::moving(q, moving, sample.wrench.0.fixed_rows::<2>(0) * 0.8);
        let mut bounds = ForceBounds::none();
        for axis in (0..2).filter(|&axis| self.axes[axis]) {
            bounds.push(AxisBound { axis, sign: -1.0, minimum: 0.1, maximum: 200.0 });
        }
        // ṗ0, and on an axis without input an offset that fades: another twist in every step.
        let known_twist = |step: usize| {
            let offset = if self.axes[0] { 0.0 } else { 0.05 / (1.0 + step as f64) };
            sample.twist_reference + Vector2::new(offset, 0.0)
        };
        let known_reference: Vec<_> = (0..self.steps.len()).map(|step| velocity(&known_twist(step))).collect();
        let prediction = Prediction {
            initial,
            known_reference: known_reference.leak(),
            drift: SVector::zeros(),
            inputs: InputAxes::from_mask(&self.axes),
            previous_input: Vector2::zeros(),
            wrench_axes: InputAxes::from_mask(&self.axes),
            constraints: Constraints::of_force(bounds),
            set_point: SetPoint {
                joint_position: q + Vector2::new(0.002, -0.003),
                joint_velocity: velocity(&sample.twist_reference),
                wrench: Vector2::new(1.0, -2.0),
                input: Vector2::new(0.02, -0.05),
                fading_velocity: velocity(&Vector2::new(0.01, 0.04)),
                fading_input: Vector2::new(0.01, 0.04),
            },
            weights: Box::leak(Box::new(self.weights)),
            jacobian: parameters.chain.kinematics(&q).task_jacobian(),
            input_weight: Vector2::new(10.0, 15.0),
            slack: None,
        };
        let horizon =
            Horizon::new(self.discretization, self.steps, |_| &[], &parameters.loops, &Vector2::repeat(self.estimate))
                .fading_with(FADING);
        Problem { model, horizon, prediction }
    }
}

pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for axes in [[true, true], [false, true]] {
        for weights in [joint_weights(), task_weights()] {
            for steps in [&UNIFORM[..], &UNEVEN[..]] {
                for estimate in [0.020, 0.0] {
                    // An easy contact; pressing near f_max and still going in; hardly touching and
                    // leaving.
                    for (force, speed, moving) in [(60.0, 0.05, 0.0), (205.0, 0.08, 0.3), (12.0, -0.03, 0.3)] {
                        for discretization in DISCRETIZATIONS {
                            cases.push(Case { discretization, axes, weights, steps, estimate, force, speed, moving });
                        }
                    }
                }
            }
        }
    }
    cases
}

/// Numbers between −1 and 1 that look random and are the same in every run (Knuth's generator for
/// 64 bits).
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector<const K: usize>(&mut self, size: f64) -> SVector<f64, K> {
        SVector::from_fn(|_, _| size * self.next())
    }

    pub(crate) fn matrix<const R: usize, const C: usize>(&mut self, size: f64) -> SMatrix<f64, R, C> {
        SMatrix::from_fn(|_, _| size * self.next())
    }

    /// Between a half and one and a half of `size`.
    pub(crate) fn positive<const K: usize>(&mut self, size: f64) -> SVector<f64, K> {
        SVector::from_fn(|_, _| size * (1.0 + 0.5 * self.next()))
    }

    /// With zero inside; the first lower and the last upper bound are missing.
    pub(crate) fn interval<const K: usize>(&mut self, size: f64) -> Interval<K> {
        let mut interval = Interval { lower: -self.positive(size), upper: self.positive(size) };
        interval.lower[0] = f64::NEG_INFINITY;
        interval.upper[K - 1] = if K > 1 { f64::INFINITY } else { size };
        interval
    }
}

/// The shape of an arbitrary problem; its numbers come from [`Numbers`].
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    pub(crate) discretization: Discretization,
    pub(crate) steps: Vec<f64>,
    /// How many axes have an input: the last ones, so that an axis and its position among the
    /// inputs differ.
    pub(crate) inputs: usize,
    pub(crate) by_task: bool,
    /// T_est of even and of odd axes in s.
    pub(crate) estimate: [f64; 2],
    pub(crate) slack: Option<Slack>,
    /// Without the wrench state and the bounded force of one axis, without some task weights.
    pub(crate) partial: bool,
    pub(crate) loops: Loops,
}

/// Speed loops of a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Loops {
    /// (4).
    Plain,
    /// Of second order and of first, with dead times.
    Mixed,
}

/// Parts of the first three steps at which the force is bounded too, if an input reaches them.
pub(crate) const INSIDE: [f64; 2] = [0.25, 0.6];

/// An instant at which the force is bounded.
pub(crate) struct Point {
    pub(crate) step: usize,
    /// Part of the step, up to 1.
    pub(crate) part: f64,
    /// In s from the sample.
    pub(crate) time: f64,
}

impl Shape {
    pub(crate) fn inside(&self, step: usize) -> &'static [f64] {
        if step < 3 { &INSIDE } else { &[] }
    }

    pub(crate) fn force_points(&self) -> Vec<Point> {
        let mut points = Vec::new();
        for k in first_reached(self.discretization)..self.steps.len() {
            let start: f64 = self.steps[..k].iter().sum();
            for &part in self.inside(k).iter().chain(&[1.0]) {
                points.push(Point { step: k, part, time: start + part * self.steps[k] });
            }
        }
        points
    }

    /// Speed loops, and T_est.
    pub(crate) fn lags<const N: usize, const D: usize>(&self) -> (VelocityLoops<N>, SVector<f64, D>) {
        let estimate = |axis: usize| self.estimate[axis % 2] * (1.0 + 0.1 * axis as f64);
        let mut loops = VelocityLoops::first_order(SVector::from_fn(|i, _| 0.010 + 0.002 * i as f64));
        if self.loops == Loops::Mixed {
            // Every third of first order; the last waits for as long as the shortest step lasts.
            let shortest = self.steps.iter().copied().fold(f64::INFINITY, f64::min);
            loops.damping = SVector::from_fn(|i, _| [0.5, 0.0, 1.3][i % 3]);
            loops.dead_time = SVector::from_fn(|i, _| 0.003 + shortest * i as f64 / (N - 1) as f64);
        }
        (loops, SVector::from_fn(|axis, _| estimate(axis)))
    }

    pub(crate) fn problem<const N: usize, const D: usize>(&self, numbers: &mut Numbers) -> Problem<N, D> {
        let initial = State {
            joint_position: numbers.vector(1.0),
            joint_velocity: numbers.vector(0.3),
            joint_acceleration: numbers.vector(10.0),
            earlier_reference: numbers.vector(0.5),
            wrench: numbers.vector(50.0),
        };
        let wrench_gradient = numbers.matrix(1e4);
        let model = Model::<N, D> {
            jacobian_inverse: numbers.matrix(1.0),
            wrench_gradient,
            wrench_offset: numbers.vector::<D>(100.0) - wrench_gradient.tr_mul(&initial.joint_position),
        };
        let first = D - self.inputs;
        let mut force = ForceBounds::none();
        // From the last to the first: the order of the bounds need not be that of the axes.
        for axis in (first + usize::from(self.partial)..D).rev() {
            let sign = if axis % 2 == 0 { 1.0 } else { -1.0 };
            let minimum = if axis == first { f64::NEG_INFINITY } else { 1.0 + axis as f64 };
            force.push(AxisBound { axis, sign, minimum, maximum: 100.0 + axis as f64 });
        }
        let wrench = numbers.positive(1e-3);
        let weights = if self.by_task {
            let (mut position, mut velocity) = (numbers.positive::<D>(500.0), numbers.positive::<D>(1000.0));
            if self.partial {
                (position[0], position[D - 1], velocity[D / 2]) = (0.0, 0.0, 0.0);
            }
            Weights::Task { position, velocity, wrench }
        } else {
            Weights::Joint { position: numbers.positive(1e3), velocity: numbers.positive(1e3), wrench }
        };
        let known_reference: Vec<SVector<f64, N>> = self.steps.iter().map(|_| numbers.vector(1.0)).collect();
        let prediction = Prediction {
            initial,
            known_reference: known_reference.leak(),
            drift: numbers.vector(0.1),
            inputs: InputAxes::from_mask(&std::array::from_fn(|axis| axis >= first)),
            previous_input: numbers.vector(0.5),
            wrench_axes: InputAxes::from_mask(&std::array::from_fn(|axis| {
                axis >= first && !(self.partial && axis == D - 1)
            })),
            constraints: Constraints {
                force,
                joint_speed: Some(numbers.interval(3.0)),
                drives: Some(Box::leak(Box::new(DriveBounds {
                    acceleration: numbers.positive(20.0),
                    // Over the longer steps some are no bound.
                    jerk: numbers.positive(6000.0),
                    before: Reference {
                        velocity: numbers.vector::<N>(1.0).into(),
                        acceleration: numbers.vector::<N>(9.0).into(),
                    },
                    without_inputs: std::array::from_fn(|_| numbers.vector(1.0)),
                }))),
                rest_position: Some(numbers.interval(2.0)),
                offset: Some(numbers.interval(0.5)),
                rate: Some(numbers.interval(20.0)),
                normal_speed: Some(NormalSpeed {
                    normal: numbers.vector(1.0),
                    least: std::array::from_fn(|_| numbers.next()),
                }),
            },
            set_point: SetPoint {
                joint_position: initial.joint_position + numbers.vector::<N>(0.01),
                joint_velocity: numbers.vector(0.3),
                wrench: numbers.vector(5.0),
                input: numbers.vector(0.3),
                fading_velocity: numbers.vector(0.3),
                fading_input: numbers.vector(0.3),
            },
            weights: Box::leak(Box::new(weights)),
            jacobian: numbers.matrix(1.0),
            input_weight: numbers.positive(10.0),
            slack: self.slack,
        };
        let (loops, estimate) = self.lags();
        let horizon = Horizon::new(self.discretization, &self.steps, |step| self.inside(step), &loops, &estimate)
            .fading_with(FADING);
        Problem { model, horizon, prediction }
    }
}

/// Every number of inputs up to six, over steps that fill groups of [`LANES`] and do not.
pub(crate) fn shapes() -> Vec<Shape> {
    let mut shapes = Vec::new();
    let estimates = [[0.020, 0.030], [0.020, 0.0], [0.0, 0.0]];
    for inputs in 1..=6 {
        for steps in [1, 2, 3, 5, 8] {
            let even = vec![0.004; steps];
            let uneven: Vec<_> = (0..steps).map(|step| UNEVEN[step % UNEVEN.len()]).collect();
            for steps in [even, uneven] {
                for (by_task, partial) in [(false, false), (false, true), (true, false), (true, true)] {
                    let estimate = estimates[shapes.len() / 3 % estimates.len()];
                    let [euler, exact] = DISCRETIZATIONS;
                    for (discretization, loops) in [(euler, Loops::Plain), (exact, Loops::Plain), (exact, Loops::Mixed)]
                    {
                        let (steps, slack) = (steps.clone(), SLACKS[shapes.len() % SLACKS.len()]);
                        shapes.push(Shape { discretization, steps, inputs, by_task, estimate, slack, partial, loops });
                    }
                }
            }
        }
    }
    shapes
}

impl<const N: usize, const D: usize> Problem<N, D> {
    /// Q: blocks on q and q̇, diagonal on f̂.
    pub(crate) fn weights(&self) -> (SMatrix<f64, N, N>, SMatrix<f64, N, N>, SVector<f64, D>) {
        let jacobian = self.prediction.jacobian;
        let task = |w: &SVector<f64, D>| jacobian.transpose() * SMatrix::<f64, D, D>::from_diagonal(w) * jacobian;
        match self.prediction.weights {
            Weights::Joint { position, velocity, wrench } => {
                (SMatrix::from_diagonal(position), SMatrix::from_diagonal(velocity), *wrench)
            }
            Weights::Task { position, velocity, wrench } => (task(position), task(velocity), *wrench),
        }
    }

    /// The joint velocity reference in step `step` under the inputs `z`, in the order of time.
    pub(crate) fn reference(&self, z: &[f64], step: usize) -> SVector<f64, N> {
        let prediction = &self.prediction;
        prediction.known_reference[step] + prediction.drift + self.model.jacobian_inverse * self.input(z, step)
    }

    /// u_k by task axis.
    pub(crate) fn input(&self, z: &[f64], step: usize) -> SVector<f64, D> {
        let (axes, mut twist) = (self.prediction.inputs.as_slice(), SVector::zeros());
        for (index, &axis) in axes.iter().enumerate() {
            twist[axis] = z[step * axes.len() + index];
        }
        twist
    }

    /// x_0, …, x_H under the inputs `z`, in the order of time.
    pub(crate) fn trajectory(&self, z: &[f64]) -> Vec<State<N, D>> {
        self.drifting(z, &self.prediction.drift)
    }

    /// The same with another drift.
    pub(crate) fn drifting(&self, z: &[f64], drift: &SVector<f64, N>) -> Vec<State<N, D>> {
        let mut states = vec![self.prediction.initial];
        for (k, step) in self.horizon.steps().iter().enumerate() {
            states.push(self.model.advance(step, &states[k], &(self.reference(z, k) - drift)));
        }
        states
    }
}

/// Where the variables, in the order of time, stand in the QP.
pub(crate) fn order<const N: usize, const D: usize, const M: usize, const C: usize>(
    rows: &MpcRows<'_, N, D, M, C>,
    steps: usize,
) -> Vec<usize> {
    let inputs = (0..steps).flat_map(|step| rows.inputs_of(step));
    inputs.chain(steps * M..rows.variables()).collect()
}

pub(crate) fn workspace<const N: usize, const D: usize>(
    horizon: &Horizon<N, D>,
    weights: &Weights<N, D>,
) -> Workspace<Vec<f64>> {
    let capacity = Capacity::new::<N, D>(horizon.steps().len(), horizon.carried());
    // An earlier cycle must leave no trace.
    Workspace::new(horizon, weights, vec![f64::NAN; capacity.storage_len()]).expect("long enough")
}

pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()))
}
