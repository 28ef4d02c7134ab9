//! The paper's planar arm (section IV) with the weights (23), and samples of it.

pub(crate) mod problems;
pub(crate) mod scripted;

use admittance_core::condensation::{Capacity, MAX_ROWS};
use admittance_core::contact::Thresholds;
use admittance_core::controller::{Controller, Event};
use admittance_core::cost::Weights;
use admittance_core::environment::{Environment, tilted_normal};
use admittance_core::model::{Discretization, Model};
use admittance_core::outcome::Outcome;
use admittance_core::parameters::{
    ContactPoint, ContactSign, ForcePoints, Guards, InputSelection, Law, LowerBound, MotionLimits, Mpc, OnContactLost,
    OnInfeasible, Parameters, Stopping, Timing,
};
use admittance_core::plan::MAX_STEPS;
use admittance_core::qp::{ActiveSet, QpSolver, SolverCapacity};
use admittance_core::robot::{Chain, Joint, Pose, right_inverse};
use admittance_core::sample::Sample;
use nalgebra::{Matrix3, Vector2, Vector3};

pub(crate) const STIFFNESS: f64 = 1e5;
pub(crate) const TILT: f64 = 25.0 * std::f64::consts::PI / 180.0;
pub(crate) const CONTACT: [f64; 2] = [1.32, 0.68];
/// T_s in ns.
pub(crate) const CYCLE: u64 = 4_000_000;

pub(crate) fn normal() -> Vector2<f64> {
    Vector2::new(TILT.sin(), TILT.cos())
}

pub(crate) fn parameters() -> Parameters<2, 2> {
    let axis = Vector3::z();
    let joint = |x| Joint { origin: Vector3::new(x, 0.0, 0.0), rotation: Matrix3::identity(), axis };
    let frame = |x, y| Pose { position: Vector3::new(x, y, 0.0), rotation: Matrix3::identity() };
    Parameters {
        chain: Chain::new([joint(0.0), joint(1.0)], frame(1.0, 0.0)).expect("a chain"),
        minimum_reciprocal_condition: 0.01,
        velocity_time_constant: Vector2::new(0.015, 0.010),
        wrench_time_constant: Vector2::repeat(0.020),
        environment: Environment::plane(STIFFNESS, &tilted_normal(TILT), frame(CONTACT[0], CONTACT[1])),
        thresholds: Thresholds {
            admittance: [true, true],
            activation: Vector2::repeat(5.0),
            release: Vector2::repeat(5.0),
        },
        law: Law::Mpc,
        mpc: Mpc {
            discretization: Discretization::Euler,
            steps: [0.004; MAX_STEPS],
            horizon: 5,
            inputs: InputSelection::Active,
            weights: joint_weights(),
            input_weight: Vector2::repeat(10.0),
            force_limit: Vector2::repeat(200.0),
            minimum_force: Vector2::repeat(0.1),
            limit_tolerance: 0.0,
            sign: ContactSign::Wrench,
            lower_bound: LowerBound::Always,
            force_points: ForcePoints::StepEnds,
            models_delay: false,
            normal_force_reference: 0.0,
            on_contact_lost: OnContactLost::Continue,
            on_infeasible: OnInfeasible::Halt,
            solution_tolerance: 1e-5,
        },
        limits: MotionLimits {
            offset: Vector2::repeat(2.0),
            release_rate: 10.0,
            inward_rate: None,
            outward_rate: None,
            joint_speed: None,
            joint_position: None,
        },
        contact_point: ContactPoint::Configured,
        guards: Guards { force: None, mismatch: None, mismatch_cycles: 3 },
        timing: Timing {
            sampling_time: 0.004,
            command_delay: 0.0,
            max_sample_age: 0.012,
            max_consecutive_fallbacks: 3,
        },
        stopping: Stopping { retreat_speed: 0.05, retreat_time: 0.1, stop_force: 100.0, stop_timeout: 1.0 },
        start_enabled: true,
    }
}

/// (23a).
pub(crate) fn joint_weights() -> Weights<2, 2> {
    let (position, velocity) = (Vector2::repeat(1e3), Vector2::repeat(1e3));
    Weights::Joint { position, velocity, wrench: Vector2::repeat(1e-3) }
}

pub(crate) fn task_weights() -> Weights<2, 2> {
    let (position, velocity) = (Vector2::new(400.0, 900.0), Vector2::new(1500.0, 700.0));
    Weights::Task { position, velocity, wrench: Vector2::new(1e-3, 2e-3) }
}

/// The model at the joint position `q`.
pub(crate) fn model(parameters: &Parameters<2, 2>, q: &Vector2<f64>) -> Model<2, 2> {
    let kinematics = parameters.chain.kinematics(q);
    let inverse = right_inverse(&kinematics.task_jacobian::<2>(), 0.0).expect("not singular");
    Model::new(&parameters.environment, &kinematics, &inverse, q)
}

/// Joint position, elbow q2 < 0, with the TCP `depth` m below the contact point.
pub(crate) fn indented(depth: f64) -> Vector2<f64> {
    let p = Vector2::from(CONTACT) - normal() * depth;
    let q2 = -((p.norm_squared() - 2.0) / 2.0).acos();
    Vector2::new(p.y.atan2(p.x) - q2.sin().atan2(1.0 + q2.cos()), q2)
}

/// A sample at rest that presses with `force` N along the normal (0: just touching, negative: in the air), ṗ0 = 0.
pub(crate) fn pressing(force: f64, sequence: u64) -> Sample<2, 2> {
    let q = indented(force / STIFFNESS);
    Sample {
        sequence,
        stamp: 1_000_000_000 + sequence * CYCLE,
        boot_id: 7,
        joint_count: 2,
        wrench_valid: true,
        wrench_saturated: None,
        drives_enabled: true,
        joint_position: q,
        joint_velocity: Vector2::zeros(),
        joint_position_reference: q,
        twist_reference: Vector2::zeros(),
        wrench: -normal() * force.max(0.0),
    }
}

/// The same with ṗ0 moving into the surface at `speed` m/s (out of it when negative).
pub(crate) fn pushing(force: f64, speed: f64, sequence: u64) -> Sample<2, 2> {
    Sample { twist_reference: -normal() * speed, ..pressing(force, sequence) }
}

pub(crate) fn active_set() -> ActiveSet<Vec<f64>> {
    let capacity = SolverCapacity { variables: 2 * MAX_STEPS + 1, rows: MAX_ROWS };
    ActiveSet::new(capacity, 300, vec![0.0; capacity.storage_len()]).expect("storage of that length")
}

pub(crate) type PlanarController<S> = Controller<2, 2, S, Vec<f64>>;

pub(crate) fn controller<S: QpSolver>(parameters: Parameters<2, 2>, solver: S) -> PlanarController<S> {
    let storage = vec![0.0; Capacity::new::<2, 2>(parameters.mpc.horizon).storage_len()];
    Controller::new(parameters, solver, storage).expect("valid parameters")
}

/// One cycle at the instant of the sample, with all the time in the world.
pub(crate) fn step<S: QpSolver>(controller: &mut PlanarController<S>, sample: &Sample<2, 2>) -> Outcome<2, 2> {
    controller.step(Event::Sample(sample), sample.stamp, &mut || false)
}
