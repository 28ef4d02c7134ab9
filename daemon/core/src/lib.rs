//! MPC-based admittance control after Wahrburg & Listmann, "MPC-based Admittance Control for
//! Robotic Manipulators" (CDC 2016), as a pure state machine: no clock, no I/O, no heap. Equation
//! numbers in parentheses are the paper's.
//!
//! [`Controller::step`] is one cycle. It reads as the data path:
//!
//! | stage | takes | gives |
//! |---|---|---|
//! | [`intake`] | a sample, the time | an accepted sample with f̂ and its kinematics, or a fault |
//! | [`belief`] | accepted samples | what is believed about the surface, and which axes touch it |
//! | [`supervisor`] | sample, belief, solution | the mode with its data, and the task of the MPC |
//! | [`mpc`] | a problem | its solution: plan, verdict, iterations |
//! | [`output`] | plan or fallback | the movement of this instant, within the limits |
//!
//! The base frame is the frame in which all this is expressed. The runner may choose another one than the
//! robot's, by [`Parameters::seen_from`] and [`Controller::turn`].
//!
//! # Glossary
//! | symbol | name in code | meaning |
//! |---|---|---|
//! | N, D | `N`, `D` | joints; task axes, the first D of x y z rx ry rz, of which [`robot::TaskAxes`] are controlled |
//! | m, H | `inputs.len()`, `horizon` | axes with an input in this cycle; steps of the prediction |
//! | q, q̇ | `joint_position`, `joint_velocity` | rad, rad/s; of a prismatic joint m, m/s |
//! | f̂ | `wrench` | wrench on the environment at the TCP, estimated, in the base frame; N, N·m |
//! | f_lin | `linear_wrench` | the spring's wrench, linear in q (16) |
//! | ṗ0, Δṗ | `twist_reference`, `velocity_offset` | commanded TCP twist, and what is added to it |
//! | x = \[q; q̇; f̂\] | [`mpc::model::State`] | state of the prediction (7) |
//! | Ψ, J, J⁻¹ | [`robot::Posture`] | forward kinematics, Jacobian, its inverse at the measured q |
//! | T_V, Λ_TV | `time_constant` | joint speed loops (4), (9); s |
//! | q̈, ω, ζ | `joint_acceleration`, `frequency`, `damping` | of speed loops of second order; rad/s², rad/s, 1 |
//! | r, V | `reference`, `columns` | joint velocity reference J⁻¹ ṗ; columns of J⁻¹ with an input |
//! | T_est, Λ_Test | `wrench_time_constant` | wrench estimate (6), (12); s, 0 means f̂ = f |
//! | K_e | `stiffness` | environment (11), (20) in the base frame; N/m |
//! | β | `activation` | section III.C; N |
//! | f_max, f_min | `force_limit`, `minimum_force` | bounds of s·f_lin on an active axis (18d, e) |
//! | s | `sign` | sign of the contact of an active axis: +1 or −1 |
//! | Q, R | [`mpc::Weights`], `input_weight` | weights of (18a) |
//!
//! # A cycle
//! ```
//! use admittance_core::intake::{Event, Sample};
//! use admittance_core::mpc::{ActiveSet, Verdict};
//! use admittance_core::quantities::{GivenWrench, Instant, Span};
//! use admittance_core::vocabulary::{ModeName, Source};
//! use admittance_core::{Controller, ParameterError};
//! use nalgebra::{Vector2, Vector6};
//! # mod planar { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/doc/planar_arm.rs")); }
//! # use planar::planar_arm;
//!
//! // The paper's arm with the weights (23): two joints, two axes, 4 ms.
//! let parameters = planar_arm();
//! // All memory comes from outside: a cycle allocates nothing.
//! let capacity = parameters.solver_capacity();
//! let storage = vec![0.0; capacity.storage_len()];
//! let solver = ActiveSet::new(capacity, 100, storage).expect("as long as asked");
//! let mut controller = Controller::new(parameters, solver, vec![0.0; parameters.storage_len()])?;
//!
//! // At rest just above the surface, told to go down at 0.05 m/s.
//! let above = Vector2::new(1.2097, -1.4682);
//! let mut sample = Sample {
//!     sequence: 1,
//!     stamp: Instant::from_nanoseconds(1_000_000_000),
//!     boot_id: 7,
//!     joint_count: 2,
//!     wrench_valid: true,
//!     drives_enabled: true,
//!     joint_position: above,
//!     joint_velocity: Vector2::zeros(),
//!     joint_position_reference: above,
//!     joint_velocity_reference: None,
//!     twist_reference: Vector2::new(0.0, -0.05),
//!     wrench: GivenWrench(Vector6::zeros()),
//!     torque_valid: false,
//!     joint_torque: Vector2::zeros(),
//! };
//! let answer = controller.step(Event::Sample(&sample), sample.stamp, &mut || false);
//! assert_eq!(answer.outcome.mode, ModeName::Free);
//!
//! // The next sample feels the surface: above 5 N on both axes the MPC takes over.
//! sample.sequence += 1;
//! sample.stamp = sample.stamp + Span::from_seconds(0.004);
//! sample.wrench = GivenWrench(Vector6::new(-6.0, -13.0, 0.0, 0.0, 0.0, 0.0));
//! let answer = controller.step(Event::Sample(&sample), sample.stamp, &mut || false);
//! assert_eq!(answer.outcome.mode, ModeName::Contact);
//! assert!(matches!(answer.outcome.verdict, Verdict::Feasible { .. }));
//! assert_eq!(answer.outcome.movement.source, Source::Mpc);
//! // Should the next answer be late, the motion controller goes on with the plan.
//! assert_eq!(answer.plan.steps().len(), 5);
//! # Ok::<(), ParameterError>(())
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod belief;
mod cycle;
mod cycle_output;
pub mod intake;
pub mod mpc;
pub mod output;
mod parameters;
pub mod quantities;
pub mod redundancy;
pub mod robot;
pub mod supervisor;
pub mod surface;
mod turn;

pub use admittance_vocabulary as vocabulary;

pub use cycle::Controller;
pub use cycle_output::{Counters, CycleOutput, Outcome};
pub use parameters::{ParameterError, Parameters, Stopping};
pub use turn::Turn;

#[cfg(test)]
extern crate self as admittance_core;
#[cfg(test)]
#[path = "../tests/core/common/mod.rs"]
#[allow(dead_code, reason = "shared with the tests of whole cycles")]
mod common;
