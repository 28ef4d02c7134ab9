//! Spatial vectors (Featherstone, chapter 2) of a body in the body's own frame, at its origin.

use core::ops::{Add, AddAssign, Mul};

use nalgebra::{Matrix3, Vector3};

/// A spatial motion: velocity, or acceleration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// rad/s or rad/s².
    pub(super) angular: Vector3<f64>,
    /// Of the body's point at the origin, m/s or m/s².
    pub(super) linear: Vector3<f64>,
}

/// A spatial force.
#[derive(Debug, Clone, Copy)]
pub(super) struct Force {
    /// About the origin, N m.
    pub(super) moment: Vector3<f64>,
    /// N.
    pub(super) force: Vector3<f64>,
}

/// Where a body's frame is in its parent's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    /// Its columns are the body's axes in the parent's frame.
    pub(super) rotation: Matrix3<f64>,
    /// Its origin in the parent's frame, m.
    pub(super) origin: Vector3<f64>,
}

/// A rigid body's inertia about its frame's origin, by its ten parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpatialInertia {
    /// m in kg.
    pub(super) mass: f64,
    /// m c in kg m.
    pub(super) first_moment: Vector3<f64>,
    /// I_c − m c× c× in kg m².
    pub(super) rotational: Matrix3<f64>,
}

impl Motion {
    pub(super) const ZERO: Self = Self { angular: Vector3::new(0.0, 0.0, 0.0), linear: Vector3::new(0.0, 0.0, 0.0) };

    /// A turn about an axis through the origin.
    pub(super) fn turn(axis: &Vector3<f64>, speed: f64) -> Self {
        Self { angular: axis * speed, linear: Vector3::zeros() }
    }

    /// A slide along an axis.
    pub(super) fn slide(axis: &Vector3<f64>, speed: f64) -> Self {
        Self { angular: Vector3::zeros(), linear: axis * speed }
    }

    /// self × other, (2.33).
    pub(super) fn cross(&self, other: &Self) -> Self {
        Self {
            angular: self.angular.cross(&other.angular),
            linear: self.angular.cross(&other.linear) + self.linear.cross(&other.angular),
        }
    }

    /// self ×* force, (2.34).
    pub(super) fn cross_force(&self, force: &Force) -> Force {
        Force {
            moment: self.angular.cross(&force.moment) + self.linear.cross(&force.force),
            force: self.angular.cross(&force.force),
        }
    }

    /// Power in W when a force acts in this velocity.
    pub(super) fn dot(&self, force: &Force) -> f64 {
        self.angular.dot(&force.moment) + self.linear.dot(&force.force)
    }
}

impl Add for Motion {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }
}

impl Force {
    pub(super) const ZERO: Self = Self { moment: Vector3::new(0.0, 0.0, 0.0), force: Vector3::new(0.0, 0.0, 0.0) };
}

impl Add for Force {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { moment: self.moment + other.moment, force: self.force + other.force }
    }
}

impl AddAssign for Force {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Placement {
    /// The parent's motion as the body's frame has it, ⁱX_λ m.
    pub(super) fn body_has(&self, motion: &Motion) -> Motion {
        let linear = motion.linear + motion.angular.cross(&self.origin);
        Motion { angular: self.rotation.tr_mul(&motion.angular), linear: self.rotation.tr_mul(&linear) }
    }

    /// A force on the body as the parent's frame has it, λX*ᵢ f.
    pub(super) fn parent_has(&self, force: &Force) -> Force {
        let turned = self.rotation * force.force;
        Force { moment: self.rotation * force.moment + self.origin.cross(&turned), force: turned }
    }

    /// The body's inertia as the parent's frame has it, (2.66).
    pub(super) fn inertia_for_parent(&self, inertia: &SpatialInertia) -> SpatialInertia {
        let (mass, p) = (inertia.mass, &self.origin);
        let h = self.rotation * inertia.first_moment;
        let first_moment = h + p * mass;
        // − p× h× − (h + m p)× p×: with a× b× = b aᵀ − (a·b) 1.
        // Written out, as the parallel axis theorem of a link is.
        let trace = p.dot(&h) + first_moment.dot(p);
        let shift = Matrix3::from_fn(|row, column| {
            let diagonal = if row == column { trace } else { 0.0 };
            diagonal - h[row] * p[column] - p[row] * first_moment[column]
        });
        let turned = self.rotation * inertia.rotational * self.rotation.transpose();
        SpatialInertia { mass, first_moment, rotational: turned + shift }
    }
}

impl Add for SpatialInertia {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            first_moment: self.first_moment + other.first_moment,
            rotational: self.rotational + other.rotational,
        }
    }
}

/// Momentum of a body that moves so.
impl Mul<&Motion> for &SpatialInertia {
    type Output = Force;

    fn mul(self, motion: &Motion) -> Force {
        Force {
            moment: self.rotational * motion.angular + self.first_moment.cross(&motion.linear),
            force: motion.linear * self.mass - self.first_moment.cross(&motion.angular),
        }
    }
}
