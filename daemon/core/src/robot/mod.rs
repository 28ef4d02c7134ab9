//! The arm: a serial chain of revolute or prismatic joints, its forward kinematics Ψ(q), Jacobian J(q) and
//! J⁻¹(q), and the dynamics of its rigid bodies (1).
//!
//! Everything is expressed in the base frame; the tool centre point (TCP) is the chain's last
//! frame.
//!
//! ```
//! use admittance_core::robot::{Chain, Joint, JointKind, Pose, Posture};
//! use nalgebra::{Matrix3, Vector2, Vector3};
//!
//! let frame = |x| Pose { position: Vector3::new(x, 0.0, 0.0), rotation: Matrix3::identity() };
//! let identity = Matrix3::identity();
//! let kind = JointKind::Revolute;
//! let joint = |x| Joint { origin: frame(x).position, rotation: identity, axis: Vector3::z(), kind };
//! // Two links of 1 m in a plane, the elbow bent by a right angle.
//! let chain = Chain::new([joint(0.0), joint(1.0)], frame(1.0))?;
//! let posture = Posture::<2, 2>::new(&chain, &Vector2::new(0.0, std::f64::consts::FRAC_PI_2));
//! assert!((posture.pose().position - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-12);
//! let inverse = posture.inverse(0.05).expect("far from singular");
//! let up = inverse.joint_velocity(&Vector2::new(0.0, 0.1));
//! assert!((posture.jacobian() * up - Vector2::new(0.0, 0.1)).norm() < 1e-12);
//! # Ok::<(), admittance_core::robot::ChainError>(())
//! ```

mod arms;
mod chain;
mod dynamics;
mod friction;
mod inverse;
mod limits;
mod null_space;
mod posture;
mod task_axes;
mod velocity_loops;

pub use admittance_drive_limits::{DriveLimits, Reference};
pub use arms::SUPPORTED_ARMS;
pub use chain::{Chain, ChainError, Joint, JointKind, Kinematics, Pose, rotation_from_rpy};
pub use dynamics::{ArmDynamics, DynamicsAt, DynamicsError, LinkInertia, Momentum};
pub use friction::JointFriction;
pub use inverse::{InverseDamping, InverseJacobian, Resolution, Singular, resolved_inverse, right_inverse};
pub use limits::{Drives, Interval, MotionLimits};
pub use null_space::NullSpace;
pub use posture::Posture;
pub use task_axes::TaskAxes;
pub use velocity_loops::VelocityLoops;
