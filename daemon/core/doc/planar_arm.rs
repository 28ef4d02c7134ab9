// The paper's arm, surface and weights (section IV), for the examples in the documentation and the
// tests.

use admittance_core::belief::{ContactPoint, ContactSign, Thresholds};
use admittance_core::intake::{Conditioning, Timing, WrenchSource};
use admittance_core::mpc::Weights;
use admittance_core::mpc::{Discretization, ForcePoints, InputSelection, InwardSpeed, LowerBound, Options};
use admittance_core::output::{Law, MAX_STEPS};
use admittance_core::{Parameters, Stopping};
use admittance_core::quantities::Span;
use admittance_core::robot::{Chain, Joint, JointKind, MotionLimits, Pose, VelocityLoops};
use admittance_core::supervisor::{Guards, OnContactLost, OnInfeasible, Policy};
use admittance_core::surface::Surface;
use nalgebra::{Matrix3, Vector2, Vector3};

pub(super) fn planar_arm() -> Parameters<2, 2> {
    // The surface falls by 25° towards +x.
    let tilt = 25_f64.to_radians();
    let normal = Vector3::new(tilt.sin(), tilt.cos(), 0.0);
    let axis = Vector3::z();
    let kind = JointKind::Revolute;
    let joint = |x| Joint { origin: Vector3::new(x, 0.0, 0.0), rotation: Matrix3::identity(), axis, kind };
    let frame = |x, y| Pose { position: Vector3::new(x, y, 0.0), rotation: Matrix3::identity() };
    Parameters {
        chain: Chain::new([joint(0.0), joint(1.0)], frame(1.0, 0.0)).expect("a chain"),
        minimum_reciprocal_condition: 0.01,
        redundancy: None,
        loops: VelocityLoops::first_order(Vector2::new(0.015, 0.010)),
        wrench_time_constant: Vector2::repeat(0.020),
        wrench_dead_time: Span::default(),
        wrench_noise: Vector2::zeros(),
        wrench_source: WrenchSource::Sample,
        impact: None,
        conditioning: Conditioning::none(),
        surface: Surface::plane(1e5, &normal, frame(1.32, 0.68)),
        thresholds: Thresholds {
            admittance: [true, true],
            activation: Vector2::repeat(5.0),
            release: Vector2::repeat(5.0),
        },
        sign: ContactSign::Wrench,
        law: Law::Mpc,
        mpc: Options {
            discretization: Discretization::Euler,
            steps: [0.004; MAX_STEPS],
            horizon: 5,
            inputs: InputSelection::Active,
            inward_speed: InwardSpeed::Free,
            // (23a)
            weights: Weights::Joint {
                position: Vector2::repeat(1e3),
                velocity: Vector2::repeat(1e3),
                wrench: Vector2::repeat(1e-3),
            },
            input_weight: Vector2::repeat(10.0),
            force_limit: Vector2::repeat(200.0),
            minimum_force: Vector2::repeat(0.1),
            limit_tolerance: 0.0,
            lag_tolerance: 0.0,
            wrench_lag_tolerance: 0.0,
            lower_bound: LowerBound::Always,
            force_points: ForcePoints::StepEnds,
            models_delay: false,
            normal_force_reference: 0.0,
            solution_tolerance: 1e-5,
        },
        limits: MotionLimits {
            offset: Vector2::repeat(2.0),
            release_rate: 10.0,
            inward_rate: None,
            outward_rate: None,
            joint_speed: None,
            joint_position: None,
            drives: None,
        },
        contact_point: ContactPoint::Configured,
        policy: Policy { on_infeasible: OnInfeasible::Halt, on_contact_lost: OnContactLost::Continue },
        guards: Guards { force: None, mismatch: None, mismatch_cycles: 3 },
        timing: Timing {
            sampling_time: Span::from_seconds(0.004),
            command_delay: Span::ZERO,
            max_sample_age: Span::from_seconds(0.012),
            max_consecutive_fallbacks: 3,
        },
        stopping: Stopping {
            retreat_speed: 0.05,
            retreat_time: Span::from_seconds(0.1),
            stop_force: 100.0,
            stop_timeout: Span::from_seconds(1.0),
        },
        start_enabled: true,
    }
}

