//! The arm as rigid bodies (1): what the joints of (4) never have, masses that the contact
//! pushes back, friction, gears that give, and drives that get their torque from an error.
//!
//! Everything is on the joints' side of the gears: a rotor's inertia counts times the gear ratio
//! squared. Torques in N m, angles in rad.

mod drive;
mod friction;
mod integration;
mod joint;
mod load;
mod overload;
mod resolution;
mod section;

pub use drive::DriveParameters;
pub use friction::Friction;
pub use joint::{Gear, JointParameters};
pub use load::{Load, Pressed};
pub use overload::Overload;
pub(crate) use resolution::Spring;
pub use resolution::Unresolved;
pub use section::{DriveSection, RigidBodySection, RigidJointSection};

use admittance_core::robot::{ArmDynamics, Chain, DynamicsError, LinkInertia};
use nalgebra::{SVector, Vector3, Vector6};

use crate::joint_loop::JointState;
use drive::Drive;
use integration::Motion;
use load::Later;

/// An arm of N joints and its drives, which step by step follow a velocity reference.
#[derive(Debug, Clone)]
pub struct RigidBody<const N: usize> {
    /// As it moves: where a gear gives, without the rotor behind it.
    arm: ArmDynamics<N>,
    joints: [JointParameters; N],
    drive: Drive<N>,
    /// Of the rotors behind gears that give; elsewhere as the joint.
    rotors: Rotors<N>,
    /// What the drives give until their next tick.
    torque: SVector<f64, N>,
    until_tick_ns: u64,
}

/// The motors' side of the gears.
#[derive(Debug, Clone, Copy)]
struct Rotors<const N: usize> {
    position: SVector<f64, N>,
    velocity: SVector<f64, N>,
}

impl<const N: usize> RigidBody<N> {
    /// An arm at rest at the joint position `start` in rad, in balance: gears are wound up, and the
    /// drives hold it.
    ///
    /// # Errors
    /// [`DynamicsError`] where the masses are those of no arm.
    pub fn new(
        chain: Chain<N>,
        links: [LinkInertia; N],
        gravity: Vector3<f64>,
        joints: [JointParameters; N],
        drive: DriveParameters<N>,
        start: &SVector<f64, N>,
    ) -> Result<Self, DynamicsError> {
        let all = SVector::from_fn(|joint, _| joints[joint].reflected_inertia);
        let stiff = SVector::from_fn(|joint, _| if joints[joint].gear.is_none() { all[joint] } else { 0.0 });
        let model = ArmDynamics::new(chain, links, all, gravity)?;
        let arm = ArmDynamics::new(chain, links, stiff, gravity)?;
        Ok(Self::at_rest(arm, model, joints, drive, start, &Vector3::zeros()))
    }

    fn at_rest(
        arm: ArmDynamics<N>,
        model: ArmDynamics<N>,
        joints: [JointParameters; N],
        drive: DriveParameters<N>,
        start: &SVector<f64, N>,
        pressing: &Vector3<f64>,
    ) -> Self {
        let wrench = Vector6::new(pressing.x, pressing.y, pressing.z, 0.0, 0.0, 0.0);
        let torque = model.at(start).bias(&SVector::zeros(), &wrench);
        let wound_up = |joint: usize, gear: Gear| torque[joint] / gear.stiffness;
        let position =
            SVector::from_fn(|joint, _| start[joint] + joints[joint].gear.map_or(0.0, |gear| wound_up(joint, gear)));
        Self {
            arm,
            joints,
            drive: Drive::new(model, drive, &position, &torque),
            rotors: Rotors { position, velocity: SVector::zeros() },
            torque,
            until_tick_ns: 0,
        }
    }

    /// The same arm at rest at another joint position in rad, in balance where it presses with a force
    /// in N, base frame.
    #[must_use]
    pub fn resting_at(&self, start: &SVector<f64, N>, pressing: &Vector3<f64>) -> Self {
        let drive = self.drive.parameters().clone();
        Self::at_rest(self.arm, *self.drive.model(), self.joints, drive, start, pressing)
    }

    /// The same arm with encoders of endless resolution: where it gets to then depends smoothly on
    /// where it starts.
    pub(crate) fn without_encoder_steps(&self) -> Self {
        Self { drive: self.drive.without_encoder_steps(), ..self.clone() }
    }

    /// Goes on for so long: the drives follow `reference` in rad/s, the arm presses on `load`. Long
    /// steps are cut at the drives' ticks. False where the motion is no longer finite, or its masses
    /// cannot be inverted; the state is then the last one before.
    #[must_use]
    pub fn advance(
        &mut self,
        state: &mut JointState<N>,
        reference: &SVector<f64, N>,
        duration_ns: u64,
        load: &impl Load<N>,
    ) -> bool {
        let mut left_ns = duration_ns;
        while left_ns > 0 {
            if self.until_tick_ns == 0 {
                self.torque = self.drive.tick(&self.rotors.position, reference);
                self.until_tick_ns = self.drive.period_ns();
            }
            let step_ns = left_ns.min(self.until_tick_ns);
            let before = Motion {
                position: state.position,
                velocity: state.velocity,
                rotor_position: self.rotors.position,
                rotor_velocity: self.rotors.velocity,
            };
            let step_s = crate::seconds(step_ns);
            let elapsed_s = crate::seconds(duration_ns - left_ns);
            let Some(after) = self.step(&before, step_s, &Later { load, by_s: elapsed_s }) else { return false };
            state.acceleration = (after.velocity - before.velocity) / step_s;
            (state.position, state.velocity) = (after.position, after.velocity);
            self.rotors = Rotors { position: after.rotor_position, velocity: after.rotor_velocity };
            left_ns -= step_ns;
            self.until_tick_ns -= step_ns;
        }
        true
    }

    /// What the arm weighs at the TCP along a unit vector in the base frame, in the first instants of an
    /// impact, kg; `None` where it does not move that way.
    pub(crate) fn effective_mass(&self, position: &SVector<f64, N>, direction: &Vector3<f64>) -> Option<f64> {
        self.arm.effective_mass(position, direction)
    }

    /// The drives' torques on the joints' side, N m.
    pub(crate) fn torque(&self) -> &SVector<f64, N> {
        &self.torque
    }

    /// What the encoders show, at the motors: positions in rad and velocities in rad/s.
    pub(crate) fn shown(&self) -> (SVector<f64, N>, SVector<f64, N>) {
        (self.drive.quantised(&self.rotors.position), *self.drive.measured_velocity())
    }
}
