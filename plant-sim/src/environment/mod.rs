//! The environment, equations (11) and (19)-(21): a surface that pushes back like a spring, and
//! never pulls.
//!
//! For the planar arm the paper's K_e = Tᵀ diag(0, k) T with T = [cos α, −sin α; sin α, cos α] is
//! the stiffness k along Tᵀ (0, 1) = (sin α, cos α): with α above zero the surface falls toward +x,
//! and what is pushed down on it slides to +x, as in the paper's figure 5.

mod law;
mod plate;
mod section;
mod shape;
mod stiffness_step;

pub use law::Law;
pub use plate::PlateMotion;
pub use section::{
    HardeningSection, HuntCrossleySection, PlateSection, ShapeName, StiffnessStepSection, SurfaceSection,
};
pub use shape::Shape;
pub use stiffness_step::StiffnessStep;

use nalgebra::{Matrix3, Vector3};

use crate::maxwell::{Creep, Maxwell};

/// A surface with a one-sided spring, an optional damper, optional creep and optional Coulomb
/// friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// A point of the undeformed surface in the base frame, in m.
    pub point: Vector3<f64>,
    /// Unit vector out of the material, into free space, in the base frame: there, and on a plane
    /// everywhere.
    pub normal: Vector3<f64>,
    /// How it goes on from there.
    pub shape: Shape,
    /// Stiffness along the normal in N/m.
    pub stiffness: f64,
    /// Where that changes.
    pub step: Option<StiffnessStep>,
    /// How the force grows with the depth.
    pub law: Law,
    /// Damping along the normal in N s/m.
    pub damping: f64,
    /// What makes it creep, if anything.
    pub maxwell: Option<Maxwell>,
    /// Coulomb friction coefficient, 0 = none.
    pub friction: f64,
    /// Sliding speed in m/s at which friction reaches 1/√2 of its full value: it makes Coulomb's
    /// jump at zero speed smooth.
    pub slip_velocity: f64,
    /// How it moves along the normal; `None` rests.
    pub plate: Option<PlateMotion>,
}

/// The contact at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Depth of the TCP below the undeformed surface in m; negative is a gap.
    pub penetration: f64,
    /// Whether the TCP touches the surface, which may not yet be back where it was.
    pub touches: bool,
    /// Force along the inward normal in N, never negative.
    pub normal_force: f64,
    /// Force that the robot exerts on the environment in N, base frame. It has no moment about the
    /// TCP: a point touches.
    pub force: Vector3<f64>,
}

impl Contact {
    /// No contact, this far below the surface (negative: above it).
    pub fn none(penetration: f64) -> Self {
        Self { penetration, touches: false, normal_force: 0.0, force: Vector3::zeros() }
    }
}

/// Outward normal of the planar arm's surface with the inclination α in rad: Tᵀ (0, 1) of (20),
/// (21).
pub fn planar_normal(inclination_rad: f64) -> Vector3<f64> {
    Vector3::new(inclination_rad.sin(), inclination_rad.cos(), 0.0)
}

/// Times are in s from the start of the arm's motion.
impl Surface {
    /// Depth of a point below the undeformed surface in m; negative is a gap.
    pub fn penetration(&self, position: &Vector3<f64>, time_s: f64) -> f64 {
        self.shape.penetration(&self.normal, &self.place(position, time_s))
    }

    /// Unit vector out of the material where a point is.
    pub fn normal_at(&self, position: &Vector3<f64>, time_s: f64) -> Vector3<f64> {
        self.shape.normal_at(&self.normal, &self.place(position, time_s))
    }

    /// Where its point is, in m.
    pub fn point_at(&self, time_s: f64) -> Vector3<f64> {
        self.plate.map_or(self.point, |plate| self.point + self.normal * plate.at(time_s).0)
    }

    /// From the point of the surface to a position.
    fn place(&self, position: &Vector3<f64>, time_s: f64) -> Vector3<f64> {
        position - self.point_at(time_s)
    }

    /// A velocity as the surface sees it.
    fn relative(&self, velocity: &Vector3<f64>, time_s: f64) -> Vector3<f64> {
        self.plate.map_or(*velocity, |plate| velocity - self.normal * plate.at(time_s).1)
    }

    /// Speed in m/s that the surface never exceeds.
    pub(crate) fn most_speed(&self) -> f64 {
        self.plate.map_or(0.0, |plate| plate.most_speed())
    }

    /// Whether the force depends on the velocity of the TCP.
    pub fn needs_velocity(&self) -> bool {
        self.damping > 0.0 || self.friction > 0.0 || self.law.needs_velocity()
    }

    /// The creep when the TCP has gone to `position` (m) in a straight line for `duration_s`.
    #[must_use]
    pub fn crept(&self, creep: &Creep, position: &Vector3<f64>, duration_s: f64, time_s: f64) -> Creep {
        self.maxwell.map_or(*creep, |maxwell| {
            maxwell.advanced(self.stiffness, creep, self.penetration(position, time_s), duration_s)
        })
    }

    /// The contact of a TCP at `position` (m) that moves with `velocity` (m/s): f_n = max(0, f(δ) +
    /// d δ̇) while δ > 0, and friction μ f_n along the sliding direction (the robot drags the
    /// environment along). A surface that creeps adds k₁ (δ − s), while it is touched where it is.
    pub fn contact(&self, position: &Vector3<f64>, velocity: &Vector3<f64>, creep: &Creep, time_s: f64) -> Contact {
        let (place, velocity) = (self.place(position, time_s), self.relative(velocity, time_s));
        let penetration = self.shape.penetration(&self.normal, &place);
        let free = self.maxwell.map_or(0.0, |maxwell| maxwell.free_depth(self.stiffness, creep));
        if penetration <= free {
            return Contact::none(penetration);
        }
        let stiffness = self.stiffness_at(&place);
        let creeping = self.maxwell.map_or(0.0, |maxwell| maxwell.stiffness * (penetration - creep.extension));
        let spring = self.law.force(stiffness, penetration) + creeping;
        let damping = self.damping + self.law.damping(stiffness, penetration);
        let normal = self.shape.normal_at(&self.normal, &place);
        let normal_force = (spring - damping * normal.dot(&velocity)).max(0.0);
        let mut force = normal * -normal_force;
        if self.friction > 0.0 {
            let sliding = velocity - normal * normal.dot(&velocity);
            force += sliding * (self.friction * normal_force / sliding.norm().hypot(self.slip_velocity));
        }
        Contact { penetration, touches: true, normal_force, force }
    }

    /// Force over velocity, N s/m, of damping and friction in such a contact: what an implicit step
    /// needs to stay stable where a tool sticks, or weighs little.
    pub fn resistance(
        &self,
        position: &Vector3<f64>,
        velocity: &Vector3<f64>,
        contact: &Contact,
        time_s: f64,
    ) -> Matrix3<f64> {
        if contact.normal_force <= 0.0 {
            return Matrix3::zeros();
        }
        let (place, velocity) = (self.place(position, time_s), self.relative(velocity, time_s));
        let normal = self.shape.normal_at(&self.normal, &place);
        let damping = self.damping + self.law.damping(self.stiffness_at(&place), contact.penetration);
        let sliding = velocity - normal * normal.dot(&velocity);
        let friction = self.friction * contact.normal_force / sliding.norm().hypot(self.slip_velocity);
        Matrix3::identity() * friction + normal * normal.transpose() * (damping - friction)
    }

    /// The hardest that a tool finds it, N/m: at the depth that a mass in kg reaches which hits it at a
    /// speed in m/s.
    pub(crate) fn hardest(&self, mass: f64, speed: f64) -> f64 {
        let stiffness = self.step.map_or(self.stiffness, |step| step.stiffness.max(self.stiffness));
        let depth = self.law.depth_of(stiffness, 0.5 * mass * speed * speed);
        self.law.tangent(stiffness, depth) + self.maxwell.map_or(0.0, |maxwell| maxwell.stiffness)
    }

    /// Stiffness in N/m at a place, from the surface's point.
    fn stiffness_at(&self, place: &Vector3<f64>) -> f64 {
        self.step.map_or(self.stiffness, |step| step.stiffness_at(self.stiffness, place))
    }
}

#[cfg(test)]
mod tests;
