//! The paper's planar arm (section IV) with the weights (23), and samples of it.

mod planar {
    include!("../../../doc/planar_arm.rs");
}
pub(crate) mod golden_arm;
pub(crate) mod golden_chain;
pub(crate) mod problems;
pub(crate) mod scripted;

use std::ops::{Deref, DerefMut};

use admittance_core::Controller;
use admittance_core::Outcome;
use admittance_core::Parameters;
use admittance_core::intake::{Event, Sample};
use admittance_core::mpc::Weights;
use admittance_core::mpc::condensation::{Capacity, MAX_ROWS};
use admittance_core::mpc::model::Model;
use admittance_core::mpc::qp::{ActiveSet, QpSolver, SolverCapacity};
use admittance_core::output::{MAX_STEPS, Plan};
use admittance_core::quantities::{GivenWrench, Instant, Span};
use admittance_core::robot::Posture;
use nalgebra::{Vector2, Vector6};

pub(crate) const STIFFNESS: f64 = 1e5;
pub(crate) const TILT: f64 = 25.0 * std::f64::consts::PI / 180.0;
pub(crate) const CONTACT: [f64; 2] = [1.32, 0.68];
/// T_s in ns.
pub(crate) const CYCLE: u64 = 4_000_000;

pub(crate) fn normal() -> Vector2<f64> {
    Vector2::new(TILT.sin(), TILT.cos())
}

/// The paper's arm.
pub(crate) fn parameters() -> Parameters<2, 2> {
    planar::planar_arm()
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
    Model::new(&parameters.surface, &Posture::new(&parameters.chain, q), q).expect("not singular")
}

/// Joint position, elbow q2 < 0, with the TCP `depth` m below the contact point.
pub(crate) fn indented(depth: f64) -> Vector2<f64> {
    let p = Vector2::from(CONTACT) - normal() * depth;
    let q2 = -((p.norm_squared() - 2.0) / 2.0).acos();
    Vector2::new(p.y.atan2(p.x) - q2.sin().atan2(1.0 + q2.cos()), q2)
}

/// A sample at rest that presses with `force` N along the normal (0: just touching, negative: in
/// the air), ṗ0 = 0.
pub(crate) fn pressing(force: f64, sequence: u64) -> Sample<2, 2> {
    let q = indented(force / STIFFNESS);
    Sample {
        sequence,
        stamp: at(1_000_000_000 + sequence * CYCLE),
        boot_id: 7,
        joint_count: 2,
        wrench_valid: true,
        drives_enabled: true,
        joint_position: q,
        joint_velocity: Vector2::zeros(),
        joint_position_reference: q,
        joint_velocity_reference: None,
        twist_reference: Vector2::zeros(),
        wrench: given(-normal() * force.max(0.0)),
        torque_valid: false,
        joint_torque: Vector2::zeros(),
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

/// A controller of the planar arm, with the plan of its last answer.
pub(crate) struct PlanarController<S> {
    controller: Controller<2, 2, S, Vec<f64>>,
    plan: Plan<2>,
}

impl<S: QpSolver> PlanarController<S> {
    pub(crate) fn step(
        &mut self,
        event: Event<'_, 2, 2>,
        now: Instant,
        expired: &mut dyn FnMut() -> bool,
    ) -> Outcome<2, 2> {
        let answer = self.controller.step(event, now, expired);
        self.plan = *answer.plan;
        answer.outcome
    }

    pub(crate) fn plan(&self) -> &Plan<2> {
        &self.plan
    }
}

impl<S> Deref for PlanarController<S> {
    type Target = Controller<2, 2, S, Vec<f64>>;

    fn deref(&self) -> &Self::Target {
        &self.controller
    }
}

impl<S> DerefMut for PlanarController<S> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.controller
    }
}

pub(crate) fn controller<S: QpSolver>(parameters: Parameters<2, 2>, solver: S) -> PlanarController<S> {
    let storage = vec![0.0; Capacity::new::<2, 2>(parameters.mpc.horizon, 1).storage_len()];
    let controller = Controller::new(parameters, solver, storage).expect("valid parameters");
    PlanarController { controller, plan: Plan::empty() }
}

/// One cycle at the instant of the sample, with unlimited time.
pub(crate) fn step<S: QpSolver>(controller: &mut PlanarController<S>, sample: &Sample<2, 2>) -> Outcome<2, 2> {
    controller.step(Event::Sample(sample), sample.stamp, &mut || false)
}

/// The instant at so many ns.
pub(crate) fn at(nanoseconds: u64) -> Instant {
    Instant::from_nanoseconds(nanoseconds)
}

/// So many ns.
pub(crate) fn ns(nanoseconds: u64) -> Span {
    Span::from_nanoseconds(nanoseconds)
}

/// A wrench as the sample gives it, of which the arm controls two axes.
pub(crate) fn given(wrench: Vector2<f64>) -> GivenWrench {
    GivenWrench(Vector6::new(wrench.x, wrench.y, 0.0, 0.0, 0.0, 0.0))
}
