//! The environment, equations (11) and (19)-(21): a plane, or a cylinder, that pushes back like a
//! spring, and never pulls.
//!
//! For the planar arm the paper's K_e = Tᵀ diag(0, k) T with T = [cos α, −sin α; sin α, cos α] is
//! the stiffness k along Tᵀ (0, 1) = (sin α, cos α): with α above zero the surface falls toward +x,
//! and what is pushed down on it slides to +x, as in the paper's figure 5.

use nalgebra::Vector3;

use crate::maxwell::{Creep, Maxwell};

/// A plane or a cylinder with a one-sided spring, an optional damper, optional creep and optional Coulomb
/// friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// A point of the undeformed surface in the base frame, in m.
    pub point: Vector3<f64>,
    /// Unit vector out of the material, into free space, in the base frame: there, and on a plane
    /// everywhere.
    pub normal: Vector3<f64>,
    /// 1/radius of a cylinder in 1/m; above zero it falls away to both sides, below zero it is a
    /// hollow. 0 is a plane.
    pub curvature: f64,
    /// Direction of its axis, length 1, at a right angle to the normal.
    pub axis: Vector3<f64>,
    /// Stiffness along the normal in N/m.
    pub stiffness: f64,
    /// Damping along the normal in N s/m.
    pub damping: f64,
    /// What makes it creep, if anything.
    pub maxwell: Option<Maxwell>,
    /// Coulomb friction coefficient, 0 = none.
    pub friction: f64,
    /// Sliding speed in m/s at which friction reaches 1/√2 of its full value: it makes Coulomb's
    /// jump at zero speed smooth.
    pub slip_velocity: f64,
}

/// The contact at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Depth of the TCP below the undeformed plane in m; negative is a gap.
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

impl Surface {
    /// Depth of a point below the undeformed surface in m; negative is a gap.
    pub fn penetration(&self, position: &Vector3<f64>) -> f64 {
        if self.curvature == 0.0 {
            return self.normal.dot(&(self.point - position));
        }
        let (across, radial) = self.radial(position);
        // (1 − |n + κ u|) / κ without the loss of digits of a large radius.
        -(2.0 * self.normal.dot(&across) + self.curvature * across.norm_squared()) / (1.0 + radial.norm())
    }

    /// Unit vector out of the material where a point is.
    pub fn normal_at(&self, position: &Vector3<f64>) -> Vector3<f64> {
        if self.curvature == 0.0 { self.normal } else { self.radial(position).1.normalize() }
    }

    /// From the point of the surface to a position, at a right angle to the axis, u; and n + κ u, which
    /// leads out of the surface at it.
    fn radial(&self, position: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let way = position - self.point;
        let across = way - self.axis * self.axis.dot(&way);
        (across, self.normal + across * self.curvature)
    }

    /// Whether the force depends on the velocity of the TCP.
    pub fn needs_velocity(&self) -> bool {
        self.damping > 0.0 || self.friction > 0.0
    }

    /// The creep when the TCP has gone to `position` (m) in a straight line for `duration_s`.
    #[must_use]
    pub fn crept(&self, creep: &Creep, position: &Vector3<f64>, duration_s: f64) -> Creep {
        self.maxwell
            .map_or(*creep, |maxwell| maxwell.advanced(self.stiffness, creep, self.penetration(position), duration_s))
    }

    /// The contact of a TCP at `position` (m) that moves with `velocity` (m/s): f_n = max(0, k δ +
    /// d δ̇) while δ > 0, and friction μ f_n along the sliding direction (the robot drags the
    /// environment along). A surface that creeps adds k₁ (δ − s), while it is touched where it is.
    pub fn contact(&self, position: &Vector3<f64>, velocity: &Vector3<f64>, creep: &Creep) -> Contact {
        let penetration = self.penetration(position);
        let free = self.maxwell.map_or(0.0, |maxwell| maxwell.free_depth(self.stiffness, creep));
        if penetration <= free {
            return Contact::none(penetration);
        }
        let creeping = self.maxwell.map_or(0.0, |maxwell| maxwell.stiffness * (penetration - creep.extension));
        let spring = self.stiffness * penetration + creeping;
        let normal = self.normal_at(position);
        let normal_force = (spring - self.damping * normal.dot(velocity)).max(0.0);
        let mut force = normal * -normal_force;
        if self.friction > 0.0 {
            let sliding = velocity - normal * normal.dot(velocity);
            force += sliding * (self.friction * normal_force / sliding.norm().hypot(self.slip_velocity));
        }
        Contact { penetration, touches: true, normal_force, force }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface() -> Surface {
        Surface {
            point: Vector3::new(1.32, 0.68, 0.0),
            normal: planar_normal(25f64.to_radians()),
            curvature: 0.0,
            axis: Vector3::z(),
            stiffness: 1e5,
            damping: 0.0,
            maxwell: None,
            friction: 0.0,
            slip_velocity: 1e-3,
        }
    }

    #[test]
    fn force_is_stiffness_matrix_times_penetration() {
        // (20), (21) spelled out: K_e = Tᵀ diag(0, k) T, f = K_e (p − p_contact).
        let (sine, cosine) = 25f64.to_radians().sin_cos();
        let t = nalgebra::Matrix2::new(cosine, -sine, sine, cosine);
        let k = t.transpose() * nalgebra::Matrix2::new(0.0, 0.0, 0.0, 1e5) * t;
        let offset = Vector3::new(0.0004, -0.0011, 0.0);
        let contact = surface().contact(&(surface().point + offset), &Vector3::zeros(), &Creep::default());
        let expected = k * offset.xy();
        assert!((contact.force.xy() - expected).norm() < 1e-9, "{} {expected}", contact.force);
        assert!(contact.force.y < 0.0, "pushing down on a floor is a negative y force");
        assert!((contact.normal_force - contact.force.norm()).abs() < 1e-9);
        assert!(k.determinant().abs() < 1e-3, "the plane resists along its normal alone");
    }

    #[test]
    fn surface_never_pulls_and_gives_no_energy() {
        let surface = Surface { damping: 300.0, friction: 0.3, ..surface() };
        // Press in and out on a sine with a sideways sweep: the work done on the environment is
        // never negative.
        let (mut work, mut largest, steps) = (0.0, 0.0f64, 20_000);
        for index in 0..steps {
            let phase = std::f64::consts::TAU * f64::from(index) / f64::from(steps);
            let depth = 0.002 * phase.sin();
            let velocity = surface.normal * (-0.002 * phase.cos()) + Vector3::new(0.0, 0.0, 0.003 * phase.sin());
            let contact = surface.contact(&(surface.point - surface.normal * depth), &velocity, &Creep::default());
            assert!(contact.normal_force >= 0.0);
            assert!(contact.force.dot(&surface.normal) <= 0.0, "a pull at depth {depth}");
            work += contact.force.dot(&velocity) * std::f64::consts::TAU / f64::from(steps);
            largest = largest.max(contact.normal_force);
        }
        assert!(largest > 199.0 && work > 1e-3, "peak {largest} N, work {work} J");
    }

    #[test]
    fn a_cylinder_is_round() {
        for (curvature, at_the_middle) in [(5.0, 1.0), (-5.0, -1.0)] {
            let surface = Surface { curvature, ..surface() };
            let middle = surface.point - surface.normal * 0.2 * at_the_middle;
            for angle in [-0.8_f64, 0.0, 0.3, 1.0] {
                let out = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), angle) * surface.normal;
                // 1 mm in the material, anywhere along its axis.
                let position = middle + out * at_the_middle * (0.2 - 0.001 * at_the_middle) + Vector3::z() * angle;
                assert!((surface.penetration(&position) - 0.001).abs() < 1e-12, "{angle}");
                assert!((surface.normal_at(&position) - out).norm() < 1e-12, "{angle}");
                let force = surface.contact(&position, &Vector3::zeros(), &Creep::default()).force;
                assert!((force + out * 100.0).norm() < 1e-6, "{force}");
            }
        }
        let (plane, flat) = (surface(), Surface { curvature: 1e-9, ..surface() });
        let position = plane.point + Vector3::new(0.3, -0.2, 0.1);
        assert!((plane.penetration(&position) - flat.penetration(&position)).abs() < 1e-9);
    }

    #[test]
    fn friction_drags_along_the_sliding_direction() {
        let surface = Surface { friction: 0.3, ..surface() };
        let sliding = Vector3::new(surface.normal.y, -surface.normal.x, 0.0) * 0.1;
        let inside = surface.point - surface.normal * 0.001;
        let contact = surface.contact(&inside, &sliding, &Creep::default());
        let along = contact.force.dot(&sliding.normalize());
        assert!((along / contact.normal_force - 0.3).abs() < 1e-4, "friction {along} N");
        assert!((contact.force.dot(&surface.normal) + contact.normal_force).abs() < 1e-9);
        let slow = surface.contact(&inside, &(sliding * 1e-6), &Creep::default());
        assert!(slow.force.dot(&sliding.normalize()) < 0.01, "no jump at zero speed");
    }
}
