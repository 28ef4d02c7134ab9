//! The seam between the plant and what its joints are: the speed loops of (4), or the rigid bodies
//! of (1) with their drives.

use nalgebra::{SVector, Vector3};

use crate::joint_loop::{JointLoop, JointState, JointStep};
use crate::rigid_body::{Load, Overload, RigidBody};

/// The joints of a plant.
#[derive(Debug, Clone)]
pub enum Joints<const N: usize> {
    /// They follow their reference as (4) says, whatever they press on.
    FirstOrder(JointLoop<N>),
    /// They have masses, and the contact pushes back.
    RigidBody(Box<RigidBody<N>>),
}

/// What of a step depends on its length alone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PreparedStep<const N: usize> {
    duration_ns: u64,
    /// Of the loops of (4).
    loops: Option<JointStep<N>>,
}

impl<const N: usize> Joints<N> {
    /// The step of an interval.
    pub(crate) fn prepare(&self, duration_ns: u64) -> PreparedStep<N> {
        let loops = match self {
            Self::FirstOrder(loops) => Some(loops.step(crate::seconds(duration_ns))),
            Self::RigidBody(_) => None,
        };
        PreparedStep { duration_ns, loops }
    }

    /// The state at the end of a step under a velocity reference in rad/s; false where it is no longer
    /// finite.
    #[must_use]
    pub(crate) fn advance(
        &mut self,
        step: &PreparedStep<N>,
        state: &mut JointState<N>,
        reference: &SVector<f64, N>,
        load: &impl Load<N>,
    ) -> bool {
        match self {
            Self::FirstOrder(loops) => {
                let step = step.loops.unwrap_or_else(|| loops.step(crate::seconds(step.duration_ns)));
                step.advance(state, reference);
                true
            }
            Self::RigidBody(arm) => arm.advance(state, reference, step.duration_ns, load),
        }
    }

    /// Joint accelerations in rad/s² under a velocity reference in rad/s; of rigid bodies the mean of
    /// the last step.
    pub(crate) fn acceleration(&self, state: &JointState<N>, reference: &SVector<f64, N>) -> SVector<f64, N> {
        match self {
            Self::FirstOrder(loops) => loops.acceleration(state, reference),
            Self::RigidBody(_) => state.acceleration,
        }
    }

    /// Speeds in rad/s that the joints do not exceed while the reference stays; `None` where masses
    /// swing as they will.
    pub(crate) fn most_speed(&self, state: &JointState<N>, reference: &SVector<f64, N>) -> Option<SVector<f64, N>> {
        match self {
            Self::FirstOrder(loops) => Some(loops.most_speed(state, reference)),
            Self::RigidBody(_) => None,
        }
    }

    /// Drives that cannot hold the arm where it has just been brought to rest.
    pub(crate) fn overloads(&self) -> Vec<Overload> {
        match self {
            Self::FirstOrder(_) => Vec::new(),
            Self::RigidBody(arm) => arm.overloads().collect(),
        }
    }

    /// Position in rad and velocity in rad/s as the encoders show them.
    pub(crate) fn shown(&self, state: &JointState<N>) -> (SVector<f64, N>, SVector<f64, N>) {
        match self {
            Self::FirstOrder(_) => (state.position, state.velocity),
            Self::RigidBody(arm) => arm.shown(),
        }
    }

    /// The torques that the drives command, on the joints' side, N m; `None` of joints without masses.
    pub(crate) fn torque(&self) -> Option<&SVector<f64, N>> {
        match self {
            Self::FirstOrder(_) => None,
            Self::RigidBody(arm) => Some(arm.torque()),
        }
    }

    /// The same joints at rest at a position in rad, where the arm presses with a force in N, base frame.
    #[must_use]
    pub(crate) fn resting_at(&self, start: &SVector<f64, N>, pressing: &Vector3<f64>) -> Self {
        match self {
            Self::FirstOrder(loops) => Self::FirstOrder(*loops),
            Self::RigidBody(arm) => Self::RigidBody(Box::new(arm.resting_at(start, pressing))),
        }
    }

    /// The same joints without what makes their way jump with its start.
    #[must_use]
    pub(crate) fn smooth(&self) -> Self {
        match self {
            Self::FirstOrder(loops) => Self::FirstOrder(*loops),
            Self::RigidBody(arm) => Self::RigidBody(Box::new(arm.without_encoder_steps())),
        }
    }
}
