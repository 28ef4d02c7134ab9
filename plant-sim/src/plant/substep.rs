//! A step over which the joint reference is constant: joints, surface, tool and wrench estimate.

use nalgebra::SVector;

use super::pressing::Pressing;
use super::{Divergence, Plant, contact_of, substep_of};
use crate::seconds;
use crate::tool_inertia::Tool;

impl<const N: usize, const D: usize> Plant<N, D> {
    /// Whether the TCP cannot reach the surface in this time: a bound from joint speeds.
    pub(super) fn stays_free(&self, duration_ns: u64, reference: &SVector<f64, N>) -> bool {
        let Some(surface) = &self.parameters.surface else { return true };
        if self.contact.penetration >= 0.0 {
            return false;
        }
        let Some(speed) = self.parameters.joints.most_speed(&self.joints, reference) else { return false };
        self.contact.penetration + (speed.dot(&self.reach) + surface.most_speed()) * seconds(duration_ns) < 0.0
    }

    /// Whether a single step of a free arm shows the same as many short ones.
    pub(super) fn steps_are_exact(&self, reference: &SVector<f64, N>) -> bool {
        // What a tool's inertia adds is no straight line over a long step, nor is a velocity that is
        // reported with a lag.
        let shows_speed = self.tool().is_some() || self.parameters.velocity_lag_s > 0.0;
        let Some(speed) = self.parameters.joints.most_speed(&self.joints, reference) else { return false };
        if shows_speed && speed.iter().any(|speed| *speed > 0.0) {
            return false;
        }
        self.parameters.surface.is_none() || self.delay_line.is_none() || self.parameters.estimate.is_zero()
    }

    /// What hangs on the sensor.
    fn tool(&self) -> Option<&Tool> {
        self.parameters.sensor.as_ref().map(|sensor| &sensor.tool).filter(|tool| tool.mass > 0.0)
    }

    /// What accelerates the tool at this instant.
    fn inertia_of_tool(&self, reference: &SVector<f64, N>) -> SVector<f64, D> {
        self.tool().map_or_else(SVector::zeros, |tool| {
            let acceleration = self.parameters.joints.acceleration(&self.joints, reference);
            let wrench = tool.inertia(&self.parameters.chain, &self.joints, &acceleration);
            SVector::from_fn(|axis, _| wrench[axis])
        })
    }

    /// A step; where the TCP is then is not looked at as long as it is known to be free.
    pub(super) fn substep(&mut self, duration_ns: u64, reference: &SVector<f64, N>, is_free: bool) {
        let step = if duration_ns == self.usual_substep.duration_ns {
            self.usual_substep
        } else {
            substep_of(&self.parameters, duration_ns)
        };
        // A reference that jumps lets the accelerations jump.
        let inertia = self.inertia_of_tool(reference);
        self.parameters.estimate.jump(&(inertia - self.tool_inertia));
        let load = Pressing {
            chain: &self.parameters.chain,
            surface: self.parameters.surface.as_ref(),
            creep: &self.creep,
            time_s: self.time_s(),
            kinematics: &self.kinematics,
            contact: &self.contact,
        };
        let joint = self.joints.velocity.iamax();
        let velocity_rad_s = self.joints.velocity[joint];
        if !self.parameters.joints.advance(&step.joints, &mut self.joints, reference, &load) {
            // Before the motion the sample's time is below zero, and near enough.
            let time_s = if self.motion_began_ns.is_some() { self.time_s() } else { self.scenario_time_s() };
            self.divergence.get_or_insert(Divergence { time_s, joint, velocity_rad_s });
        }
        self.now_ns += duration_ns;
        if !is_free {
            self.look(duration_ns);
        }
        self.tool_inertia = self.inertia_of_tool(reference);
        let (_, shown) = self.parameters.joints.shown(&self.joints);
        self.reported_velocity += (shown - self.reported_velocity) * step.velocity_share;
        let pressing = SVector::from_fn(|axis, _| if axis < 3 { self.contact.force[axis] } else { 0.0 });
        self.parameters.estimate.advance(&step.estimate, &(pressing + self.tool_inertia));
        if !self.delay_line.is_none() {
            self.delay_line.push(self.now_ns, self.parameters.estimate.estimate());
        }
    }

    /// Where the TCP is after a step of this length, and what it presses on.
    pub(super) fn look(&mut self, duration_ns: u64) {
        let time_s = self.time_s();
        self.kinematics = self.parameters.chain.kinematics(&self.joints.position);
        let surface = self.parameters.surface.as_ref();
        if let Some(surface) = surface {
            self.creep = surface.crept(&self.creep, &self.kinematics.pose.position, seconds(duration_ns), time_s);
        }
        self.contact = contact_of(surface, &self.kinematics, &self.joints.velocity, &self.creep, time_s);
        self.peaks.add(&self.contact);
        let touches = self.contact.touches;
        self.contact_losses += u32::from(self.touched && !touches);
        self.touched = touches;
    }
}
