//! Rigid-body dynamics of a chain, the paper's equation (1):
//!
//! M(q) q̈ + C(q, q̇) q̇ + G(q) + τ_fric + τ_ext = τ_mot
//!
//! Here is everything but friction, which belongs to the drives. f̂ is the wrench that the robot
//! exerts on the environment, so τ_ext = Jᵀ f̂: pressing costs motor torque.
//!
//! The algorithms are those of R. Featherstone, Rigid Body Dynamics Algorithms (2008), with his
//! symbols: quantities of a body are spatial vectors in the body's own frame. "Torque" is what a
//! joint's motor gives: N m, of a prismatic joint N, and M has the units that follow from it.
//!
//! | question | answer | algorithm |
//! |---|---|---|
//! | which torques does a motion take? | [`DynamicsAt::torque`] | recursive Newton-Euler, table 5.1 |
//! | what is M(q)? | [`DynamicsAt::mass_matrix`] | composite rigid bodies, table 6.2 |
//! | what does it weigh in an impact? | [`ArmDynamics::effective_mass`] | M⁻¹ by Cholesky, Khatib 1987 |
//! | what is p, and what carries it on? | [`DynamicsAt::momentum`] | one pass out, one back |
//! | what does each link ask for? | [`DynamicsAt::link_weights`] | its weight handed on |
//! | which motion do torques bring about? | [`DynamicsAt::acceleration`] | M⁻¹ by Cholesky, section 6.1 |
//!
//! ```
//! use admittance_core::robot::{ArmDynamics, Chain, Joint, JointKind, LinkInertia, Pose};
//! use nalgebra::{Matrix3, Vector1, Vector3, Vector6};
//!
//! // A rod of 1 m and 2 kg that hangs on an axis along y; gravity pulls along −z.
//! let identity = Matrix3::identity();
//! let kind = JointKind::Revolute;
//! let joint = Joint { origin: Vector3::zeros(), rotation: identity, axis: Vector3::y(), kind };
//! let tool = Pose { position: Vector3::new(1.0, 0.0, 0.0), rotation: identity };
//! let chain = Chain::new([joint], tool)?;
//! let inertia = Matrix3::from_diagonal(&Vector3::new(1e-4, 1.0 / 6.0, 1.0 / 6.0));
//! let rod = LinkInertia { mass: 2.0, center_of_gravity: Vector3::new(0.5, 0.0, 0.0), inertia };
//! let arm = ArmDynamics::new(chain, [rod], Vector1::zeros(), Vector3::new(0.0, 0.0, -9.81))?;
//!
//! let level = arm.at(&Vector1::new(0.0));
//! // It is held by m g l / 2, against the sense in which it would fall.
//! assert!((level.gravity_torque()[0] + 9.81).abs() < 1e-12);
//! // Let go of, its tip falls with 3/2 g.
//! let falling = level.acceleration(&Vector1::zeros(), &Vector1::zeros(), &Vector6::zeros());
//! assert!((falling.expect("finite")[0] - 1.5 * 9.81).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod at;
mod effective_mass;
mod energy;
mod forward;
mod inertia;
mod link_weights;
mod mass_matrix;
mod momentum;
mod newton_euler;
mod spatial;

pub use at::{ArmDynamics, DynamicsAt, DynamicsError};
pub use inertia::LinkInertia;
pub use momentum::Momentum;
