//! The surface as an arm with masses feels it within a step.

use admittance_core::robot::{Chain, Kinematics};
use nalgebra::{SVector, Vector6};

use super::contact_of;
use crate::environment::{Contact, Surface};
use crate::maxwell::Creep;
use crate::rigid_body::{Load, Pressed};

/// What the arm presses on, from the beginning of a step on.
pub(super) struct Pressing<'a, const N: usize> {
    pub(super) chain: &'a Chain<N>,
    /// `None` is free space.
    pub(super) surface: Option<&'a Surface>,
    /// As it was at the beginning.
    pub(super) creep: &'a Creep,
    /// Of the beginning, in s from the start of the motion.
    pub(super) time_s: f64,
    /// Of the beginning, where the plant has just looked.
    pub(super) kinematics: &'a Kinematics<N>,
    pub(super) contact: &'a Contact,
}

impl<const N: usize> Load<N> for Pressing<'_, N> {
    fn at(&self, position: &SVector<f64, N>, velocity: &SVector<f64, N>, elapsed_s: f64) -> Pressed<N> {
        let Some(surface) = self.surface else { return Pressed::nothing() };
        let time_s = self.time_s + elapsed_s;
        let (kinematics, contact) = if elapsed_s > 0.0 {
            let kinematics = self.chain.kinematics(position);
            let contact = contact_of(Some(surface), &kinematics, velocity, self.creep, time_s);
            (kinematics, contact)
        } else {
            (*self.kinematics, *self.contact)
        };
        let force = &contact.force;
        let wrench = Vector6::new(force.x, force.y, force.z, 0.0, 0.0, 0.0);
        let resists = contact.normal_force > 0.0 && surface.needs_velocity();
        let resistance = resists.then(|| {
            let jacobian = kinematics.jacobian.fixed_rows::<3>(0).into_owned();
            let tcp_velocity = jacobian * velocity;
            let matrix = surface.resistance(&kinematics.pose.position, &tcp_velocity, &contact, time_s);
            jacobian.transpose() * matrix * jacobian
        });
        Pressed { wrench, resistance }
    }
}
