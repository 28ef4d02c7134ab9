//! A step over which the joint reference is constant: joints, surface, tool and wrench estimate.

use nalgebra::SVector;

use super::{Plant, contact_of, seconds, substep_of};
use crate::tool_inertia::Tool;

impl<const N: usize, const D: usize> Plant<N, D> {
    /// Whether the TCP cannot reach the surface in this time, so that a single step is exact: a
    /// bound from joint speeds.
    pub(super) fn stays_free(&self, duration_ns: u64, reference: &SVector<f64, N>) -> bool {
        let speed = self.parameters.joints.most_speed(&self.joints, reference);
        // What a tool's inertia adds is no straight line over a long step.
        // Nor is a velocity that is reported with a lag.
        let shows_speed = self.tool().is_some() || self.parameters.velocity_lag_s > 0.0;
        if shows_speed && speed.iter().any(|speed| *speed > 0.0) {
            return false;
        }
        if self.parameters.surface.is_none() {
            return true;
        }
        if !self.delay_line.is_none() && !self.parameters.estimate.is_zero() {
            return false;
        }
        self.contact.penetration + speed.dot(&self.reach) * seconds(duration_ns) < 0.0
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

    pub(super) fn substep(&mut self, duration_ns: u64, reference: &SVector<f64, N>) {
        let step = if duration_ns == self.usual_substep.duration_ns {
            self.usual_substep
        } else {
            substep_of(&self.parameters, duration_ns)
        };
        // A reference that jumps lets the accelerations jump.
        let inertia = self.inertia_of_tool(reference);
        self.parameters.estimate.jump(&(inertia - self.tool_inertia));
        step.joints.advance(&mut self.joints, reference);
        self.now_ns += duration_ns;
        self.kinematics = self.parameters.chain.kinematics(&self.joints.position);
        let surface = self.parameters.surface.as_ref();
        if let Some(surface) = surface {
            self.creep = surface.crept(&self.creep, &self.kinematics.pose.position, seconds(duration_ns));
        }
        self.contact = contact_of(surface, &self.kinematics, &self.joints.velocity, &self.creep);
        self.tool_inertia = self.inertia_of_tool(reference);
        self.reported_velocity += (self.joints.velocity - self.reported_velocity) * step.velocity_share;
        self.peaks.add(&self.contact);
        let touches = self.contact.touches;
        self.contact_losses += u32::from(self.touched && !touches);
        self.touched = touches;
        let pressing = SVector::from_fn(|axis, _| if axis < 3 { self.contact.force[axis] } else { 0.0 });
        self.parameters.estimate.advance(&step.estimate, &(pressing + self.tool_inertia));
        if !self.delay_line.is_none() {
            self.delay_line.push(self.now_ns, self.parameters.estimate.estimate());
        }
    }
}
