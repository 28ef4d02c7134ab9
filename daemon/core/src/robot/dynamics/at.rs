//! The arm with its masses, and the same at one joint position.

use nalgebra::{SVector, Vector3};

use super::inertia::LinkInertia;
use super::spatial::{Force, Motion, Placement, SpatialInertia};
use crate::robot::chain::Moved;
use crate::robot::{Chain, JointKind};
use crate::turn::Turn;

/// A chain of N joints with masses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmDynamics<const N: usize> {
    pub(super) chain: Chain<N>,
    pub(super) links: [SpatialInertia; N],
    /// kg m² on the joints' side, of prismatic ones kg.
    pub(super) reflected: SVector<f64, N>,
    /// m/s², base frame.
    pub(super) gravity: Vector3<f64>,
}

/// Why masses do not make an arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DynamicsError {
    /// No body has such a mass distribution.
    Link {
        /// Index of the link, from 0.
        link: usize,
    },
    /// Not finite, or below zero.
    ReflectedInertia {
        /// Index of the joint, from 0.
        joint: usize,
    },
    /// Not finite.
    Gravity,
}

impl core::fmt::Display for DynamicsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Link { link } => write!(
                f,
                "link {link}: mass and inertia must be those of a body: mass above zero, a symmetric tensor, its principal \
                 moments above zero and none above the sum of the others"
            ),
            Self::ReflectedInertia { joint } => {
                write!(f, "joint {joint}: the reflected inertia must be finite and at least zero")
            }
            Self::Gravity => write!(f, "gravity must be finite"),
        }
    }
}

impl core::error::Error for DynamicsError {}

/// The dynamics at one joint position q: what its answers share is computed once.
#[derive(Debug, Clone, Copy)]
pub struct DynamicsAt<'a, const N: usize> {
    pub(super) arm: &'a ArmDynamics<N>,
    /// Of each link in the one before it, base first.
    pub(super) placements: [Placement; N],
}

impl<const N: usize> ArmDynamics<N> {
    /// A chain whose joint i moves `links[i]`; the last link has the tool. `reflected` is each
    /// rotor's inertia times its gear ratio squared, kg m² (of a prismatic joint kg): it resists its own joint's acceleration.
    /// That the rotors ride on links, and turn with them, is in the links' masses; their gyroscopic
    /// moments are left out. `gravity` in m/s², base frame.
    ///
    /// # Errors
    /// [`DynamicsError`] names the first value that no arm has.
    pub fn new(
        chain: Chain<N>,
        links: [LinkInertia; N],
        reflected: SVector<f64, N>,
        gravity: Vector3<f64>,
    ) -> Result<Self, DynamicsError> {
        if let Some(link) = links.iter().position(|link| !link.is_physical()) {
            return Err(DynamicsError::Link { link });
        }
        if let Some(joint) = reflected.iter().position(|inertia| !(inertia.is_finite() && *inertia >= 0.0)) {
            return Err(DynamicsError::ReflectedInertia { joint });
        }
        if !gravity.iter().all(|component| component.is_finite()) {
            return Err(DynamicsError::Gravity);
        }
        Ok(Self { chain, links: links.map(|link| link.spatial()), reflected, gravity })
    }

    /// The same arm in the base frame that a turn leads to.
    #[must_use]
    pub(crate) fn seen_from(&self, turn: &Turn) -> Self {
        Self { chain: self.chain.seen_from(turn), gravity: turn.vector(&self.gravity), ..*self }
    }

    /// At the joint position q in rad or m.
    pub fn at(&self, q: &SVector<f64, N>) -> DynamicsAt<'_, N> {
        let placements = core::array::from_fn(|index| {
            let joint = &self.chain.joints()[index];
            match joint.moved(q[index]) {
                Moved::Turned(turn) => Placement { rotation: joint.rotation * turn, origin: joint.origin },
                Moved::Slid(way) => Placement { rotation: joint.rotation, origin: joint.origin + joint.rotation * way },
            }
        });
        DynamicsAt { arm: self, placements }
    }
}

impl<const N: usize> DynamicsAt<'_, N> {
    /// What a joint at this speed (rad/s or m/s) does, in its link's frame, S q̇: moving leaves the
    /// axis where it is.
    pub(super) fn motion(&self, joint: usize, speed: f64) -> Motion {
        let joint = &self.arm.chain.joints()[joint];
        match joint.kind {
            JointKind::Revolute => Motion::turn(&joint.axis, speed),
            JointKind::Prismatic => Motion::slide(&joint.axis, speed),
        }
    }

    /// The part of a force on the joint's link that the joint itself has to give, Sᵀ f.
    pub(super) fn along(&self, joint: usize, force: &Force) -> f64 {
        let joint = &self.arm.chain.joints()[joint];
        match joint.kind {
            JointKind::Revolute => joint.axis.dot(&force.moment),
            JointKind::Prismatic => joint.axis.dot(&force.force),
        }
    }
}
