//! The arm: serial chains of revolute joints, their forward kinematics Ψ(q), Jacobian J(q) and its inverse.
//!
//! Frames: everything is expressed in the base frame; the tool centre point (TCP) is the chain's last frame.
//! Task axes: the first D of [x, y, z, rx, ry, rz]; D = 2 for a planar arm (x, y), D = 6 for a spatial one.

mod chain;
mod redundancy;

pub use chain::{Chain, ChainError, Joint, Kinematics, Pose, rotation_from_rpy};
pub use redundancy::{InverseJacobian, Singular, right_inverse};
