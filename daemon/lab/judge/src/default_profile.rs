//! Sequences of the shape that the `default` profile gives its problems: uneven steps, the force
//! bounded inside the first of them too, limits of joint speeds, joint positions, of the rate of
//! the offset and of its speed into the surface, task-space weights on the velocity, an input on
//! every admittance axis. Each is a simulated approach that meets the surface on the way, closed by
//! the solver's own first input; from a seed, and the same for the same seed. Limits are such that
//! every kind of row acts: they follow from what the same approach does without them.

mod limits;

use admittance_core::mpc::condensation::InputAxes;
use admittance_core::mpc::constraints::{AxisBound, Constraints, ForceBounds, NormalSpeed};
use admittance_core::mpc::cost::{SetPoint, Weights};
use admittance_core::mpc::horizon::Horizon;
use admittance_core::mpc::model::{Discretization, Model, State};
use admittance_core::mpc::qp::QpOutcome;
use admittance_core::output::MAX_STEPS;
use admittance_core::robot::Interval;
use admittance_core::robot::{
    Chain, ChainError, Joint, JointKind, Pose, Posture, Singular, VelocityLoops, rotation_from_rpy,
};
use admittance_core::surface::Surface;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::sequence::{Problem, Runner, Sequence, Start};
use limits::Limits;

/// Problems of a sequence.
pub const PROBLEMS: usize = 80;
/// Lengths of the steps in sampling times.
const STEPS: [f64; 16] = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0];
/// Steps within which the force is bounded too.
const STEPS_WITH_POINTS: usize = 3;
/// Where within them.
const QUARTERS: [f64; 3] = [0.25, 0.5, 0.75];

/// T_est in s.
const WRENCH_TIME_CONSTANT: f64 = 0.02;
/// Along the normal, N/m.
const STIFFNESS: f64 = 1e5;
/// Pressing force beyond which the contact is felt, N: below it the force bounds are far away.
const FELT: f64 = 5.0;
/// f_max, N.
const FORCE_LIMIT: f64 = 150.0;
/// f_min, N: from where it has been reached.
const MINIMUM_FORCE: f64 = 6.0;
/// Bound of a force that is not bounded yet, N: a row stays a row, so that all problems have one
/// pattern.
const FAR: f64 = 1e5;
/// Axes with a smaller component of the normal have no lower bound.
const LEAST_NORMAL_COMPONENT: f64 = 0.1;
/// Factor of the speed where an impact was too fast.
const SLOWER: f64 = 0.9;
/// Speeds that are tried.
const ATTEMPTS: u32 = 16;

/// Why there is no sequence for a seed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GenerationError {
    /// The arm is described wrongly.
    #[error("the arm: {0}")]
    Arm(#[from] ChainError),
    /// The arm came to a singular pose.
    #[error("problem {problem}: singular pose (reciprocal condition {reciprocal_condition:e})")]
    Singular {
        /// The problem, from 0.
        problem: usize,
        /// Of J.
        reciprocal_condition: f64,
    },
    /// A problem that the solver did not solve.
    #[error("problem {problem}: {outcome:?} instead of a solution")]
    Unsolved {
        /// The problem, from 0.
        problem: usize,
        /// What the solver answered.
        outcome: QpOutcome,
    },
}

/// An approach: the arm, where it starts and what it meets.
struct Approach<const N: usize> {
    chain: Chain<N>,
    start: SVector<f64, N>,
    loops: VelocityLoops<N>,
    /// Outward normal of the surface.
    normal: Vector3<f64>,
    /// T_s in s.
    sampling_time: f64,
    /// Commanded speed against the normal, m/s.
    speed: f64,
    /// Commanded speed along the surface, m/s.
    tangential_speed: f64,
    /// Problem, from 0, after which the surface would be met at the commanded speed; not whole.
    impact: f64,
}

/// Two joints in a plane, with an input on both axes, sampled every `sampling_time` s.
///
/// # Errors
/// [`GenerationError`] when the solver leaves a problem unsolved.
pub fn planar(sampling_time: f64, seed: u64) -> Result<Sequence<2, 2>, GenerationError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut between = |from: f64, to: f64| from + (to - from) * rng.random_range(0.0..1.0_f64);
    let identity = Matrix3::identity();
    let kind = JointKind::Revolute;
    let joint = |x: f64| Joint { origin: Vector3::new(x, 0.0, 0.0), rotation: identity, axis: Vector3::z(), kind };
    let tool = Pose { position: Vector3::x(), rotation: identity };
    let angle = between(0.2, 0.6);
    generate(Approach {
        chain: Chain::new([joint(0.0), joint(1.0)], tool)?,
        start: SVector::from([1.3 + between(-0.1, 0.1), -1.4 + between(-0.1, 0.1)]),
        loops: VelocityLoops::first_order(SVector::from([0.015, 0.010])),
        normal: Vector3::new(angle.sin(), angle.cos(), 0.0),
        sampling_time,
        speed: between(0.15, 0.25),
        tangential_speed: between(0.02, 0.08),
        impact: between(20.0, 30.0),
    })
}

/// Six joints with an input on the first M axes, sampled every millisecond.
///
/// # Errors
/// [`GenerationError`] when the solver leaves a problem unsolved.
pub fn spatial<const M: usize>(seed: u64) -> Result<Sequence<6, M>, GenerationError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut between = |from: f64, to: f64| from + (to - from) * rng.random_range(0.0..1.0_f64);
    let joint = |origin: [f64; 3], rpy: [f64; 3], axis: f64| Joint {
        origin: Vector3::from(origin),
        rotation: rotation_from_rpy(rpy),
        axis: Vector3::z() * axis,
        kind: JointKind::Revolute,
    };
    let half = std::f64::consts::FRAC_PI_2;
    // A six-joint arm of 1.3 m reach.
    let joints = [
        joint([0.0, 0.0, 0.1807], [0.0; 3], 1.0),
        joint([0.0; 3], [-half, 0.0, 0.0], -1.0),
        joint([-0.6127, 0.0, 0.0], [0.0; 3], -1.0),
        joint([-0.57155, 0.0, -0.17415], [0.0; 3], -1.0),
        joint([0.0, 0.11985, 0.0], [-half, 0.0, 0.0], 1.0),
        joint([0.0, 0.11655, 0.0], [half, 2.0 * half, 2.0 * half], 1.0),
    ];
    let tool = Pose { position: Vector3::new(0.0, 0.0, 0.15), rotation: Matrix3::identity() };
    // One axis can only press along it; with more the surface is tilted, so that all its forces are
    // one normal force.
    let normal =
        if M == 1 { Vector3::x() } else { Vector3::new(between(0.3, 0.6), between(-0.4, 0.4), 1.0).normalize() };
    let start = SVector::from([0.3, 1.2, -1.8, 2.2, 1.57, 0.3]);
    generate(Approach {
        chain: Chain::new(joints, tool)?,
        start: start.map(|q: f64| q + between(-0.1, 0.1)),
        loops: VelocityLoops::first_order(SVector::from([0.015, 0.015, 0.012, 0.010, 0.010, 0.010])),
        normal,
        sampling_time: 0.001,
        speed: between(0.15, 0.25),
        tangential_speed: between(0.02, 0.08),
        impact: between(20.0, 30.0),
    })
}

/// The first N of a direction's components; rotations are zero.
fn task_direction<const N: usize>(direction: &Vector3<f64>) -> SVector<f64, N> {
    SVector::from_fn(|axis, _| if axis < 3 { direction[axis] } else { 0.0 })
}

fn empty_sequence<const N: usize, const M: usize>(approach: &Approach<N>) -> Sequence<N, M> {
    let durations = STEPS.map(|step| step * approach.sampling_time);
    let inside = |step: usize| if step < STEPS_WITH_POINTS { &QUARTERS[..] } else { &[] };
    let by_axis = |translation: f64, rotation: f64| {
        SVector::<f64, N>::from_fn(|axis, _| if axis < 3 { translation } else { rotation })
    };
    Sequence {
        horizon: Horizon::new(
            Discretization::Euler,
            &durations,
            inside,
            &approach.loops,
            &SVector::repeat(WRENCH_TIME_CONSTANT),
        )
        // Early steps weigh more than their time: harder impacts for the solver.
        .counting_steps(),
        inputs: InputAxes::from_mask(&std::array::from_fn(|axis| axis < M)),
        wrench_axes: InputAxes::from_mask(&std::array::from_fn(|axis| axis < M.min(3))),
        weights: Weights::Task { position: SVector::zeros(), velocity: by_axis(1.0, 0.1), wrench: by_axis(1e-8, 0.0) },
        input_weight: by_axis(1e-2, 1e-2),
        problems: Vec::new(),
    }
}

/// Force bounds of the axes with an input, of a surface with the given normal.
fn force_bounds<const N: usize, const M: usize>(normal: &SVector<f64, N>, felt: bool, pressed: bool) -> ForceBounds<N> {
    let mut bounds = ForceBounds::none();
    for axis in 0..M.min(N).min(3) {
        // The arm presses against the normal.
        let (sign, component) = (if normal[axis] > 0.0 { -1.0 } else { 1.0 }, normal[axis].abs());
        let maximum = if felt { FORCE_LIMIT } else { FAR };
        let minimum = if pressed && component >= LEAST_NORMAL_COMPONENT { MINIMUM_FORCE * component } else { -FAR };
        bounds.push(AxisBound { axis, sign, minimum, maximum });
    }
    bounds
}

/// The fastest approach, slowed down from the given one, whose impact can be held within the
/// limits: the hardest for a solver.
fn generate<const N: usize, const M: usize>(mut approach: Approach<N>) -> Result<Sequence<N, M>, GenerationError> {
    let attempt = |approach: &Approach<N>| {
        let free = approach_surface::<N, M>(approach, &Limits::wide(&approach.start))?;
        approach_surface(approach, &Limits::met_by(&free, &approach.start, &task_direction(&approach.normal)))
    };
    for _ in 1..ATTEMPTS {
        match attempt(&approach) {
            Err(GenerationError::Unsolved { outcome: QpOutcome::Infeasible { .. }, .. }) => approach.speed *= SLOWER,
            answer => return answer,
        }
    }
    attempt(&approach)
}

fn approach_surface<const N: usize, const M: usize>(
    approach: &Approach<N>,
    limits: &Limits<N>,
) -> Result<Sequence<N, M>, GenerationError> {
    let mut sequence = empty_sequence::<N, M>(approach);
    let mut runner = Runner::new(&sequence);
    let step = Discretization::Euler.step(
        approach.sampling_time,
        &approach.loops,
        &SVector::<f64, N>::repeat(WRENCH_TIME_CONSTANT),
    );
    let normal = task_direction::<N>(&approach.normal);
    let tangent = approach.normal.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::y);
    let command = task_direction::<N>(&(approach.normal * -approach.speed + tangent * approach.tangential_speed));
    let mut contact = approach.chain.kinematics(&approach.start).pose;
    contact.position -= approach.normal * (approach.speed * approach.impact * approach.sampling_time);
    let surface = Surface::<N>::plane(STIFFNESS, &approach.normal, contact);

    let mut x = State::<N, N>::zeros();
    x.joint_position = approach.start;
    let mut q0 = approach.start;
    let mut input = SVector::<f64, N>::zeros();
    let (mut felt, mut pressed) = (false, false);
    for index in 0..PROBLEMS {
        let singular =
            |Singular { reciprocal_condition }| GenerationError::Singular { problem: index, reciprocal_condition };
        let posture = Posture::<N, N>::new(&approach.chain, &x.joint_position);
        let inverse = *posture.inverse(1e-4).map_err(singular)?;
        let commanded = inverse.joint_velocity(&command);
        if index == 0 {
            x.joint_velocity = commanded;
        }
        let model = Model::new(&surface, &posture, &x.joint_position).map_err(singular)?;
        let pressing = surface.pressing_force(&model.linear_wrench(&x.joint_position));
        felt |= surface.pressing_force(&x.wrench) > FELT;
        pressed |= pressing > 2.0 * MINIMUM_FORCE && felt;
        let within = |room: f64| Interval { lower: SVector::repeat(-room), upper: SVector::repeat(room) };
        // As of an arm that turns while it slides, away from the surface here.
        let drift = commanded * -0.003;
        let problem = |force| Problem {
            model,
            initial: x,
            known_reference: vec![commanded - drift; STEPS.len()],
            drift,
            constraints: Constraints {
                drives: None,
                force,
                joint_speed: Some(limits.speed),
                rest_position: Some(limits.position),
                offset: None,
                rate: Some(within(limits.rate)),
                normal_speed: Some(NormalSpeed { normal, least: [-limits.inward_speed; MAX_STEPS] }),
            },
            set_point: SetPoint {
                joint_position: q0,
                joint_velocity: commanded,
                wrench: SVector::zeros(),
                input: SVector::zeros(),
                fading_velocity: SVector::zeros(),
                fading_input: SVector::zeros(),
            },
            jacobian: *posture.jacobian(),
            previous_input: input,
            solution: Vec::new(),
        };
        let mut solve = |sequence: &mut Sequence<N, M>, force| {
            sequence.problems.truncate(index);
            sequence.problems.push(problem(force));
            runner.solve(sequence, index, Start::Cold, |outcome, rows, _, answer, _| {
                let by_step = (0..STEPS.len()).flat_map(|step| answer.z[rows.inputs_of(step)].to_vec());
                (outcome, by_step.collect::<Vec<f64>>())
            })
        };
        let (mut outcome, mut inputs) = solve(&mut sequence, force_bounds::<N, M>(&normal, felt, pressed));
        if pressed && matches!(outcome, QpOutcome::Infeasible { .. }) {
            // The lower bound is given up where it cannot be met, as in the controller.
            (outcome, inputs) = solve(&mut sequence, force_bounds::<N, M>(&normal, felt, false));
        }
        if !matches!(outcome, QpOutcome::Solved { .. }) {
            return Err(GenerationError::Unsolved { problem: index, outcome });
        }
        input = SVector::from_fn(|axis, _| if axis < M { inputs[axis] } else { 0.0 });
        sequence.problems[index].solution = inputs;
        // The surface pushes but does not pull.
        let plant = if pressing > 0.0 {
            model
        } else {
            Model { wrench_gradient: SMatrix::zeros(), wrench_offset: SVector::zeros(), ..model }
        };
        x = plant.advance(&step, &x, &inverse.joint_velocity(&(command + input)));
        q0 += commanded * approach.sampling_time;
    }
    Ok(sequence)
}
