//! The environment: a stiff plane, (11) and (19)-(21).

use nalgebra::{SMatrix, SVector, Vector3};

use crate::robot::Pose;

/// A plane that pushes back along its normal, in the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Environment<const D: usize> {
    /// K_e (20), D×D, in N/m.
    pub stiffness: SMatrix<f64, D, D>,
    /// Ψ(q_contact): the pose of the TCP at which the wrench is zero.
    pub contact: Pose,
    /// Outward normal of the surface (out of the material, towards the robot) as a task direction of length 1; its
    /// rotational components are zero.
    pub normal: SVector<f64, D>,
}

impl<const D: usize> Environment<D> {
    /// The plane through the contact point with the given outward `normal` (any length above zero; components beyond the
    /// task axes are ignored) and the stiffness along it in N/m.
    ///
    /// (20) with (19) and (21): Tᵀ diag(0, k) T = k n nᵀ, n the second row of T.
    pub fn plane(normal_stiffness: f64, normal: &Vector3<f64>, contact: Pose) -> Self {
        let normal = SVector::<f64, D>::from_fn(|axis, _| if axis < 3 { normal[axis] } else { 0.0 }).normalize();
        Self { stiffness: normal * normal.transpose() * normal_stiffness, contact, normal }
    }

    /// Force in N with which a wrench presses on the surface: −nᵀf, positive in contact.
    pub fn pressing_force(&self, wrench: &SVector<f64, D>) -> f64 {
        -self.normal.dot(wrench)
    }

    /// Force in N with which the spring says that a TCP at `pose` presses: k times its depth below the surface, which is negative
    /// above it.
    pub fn spring_force(&self, pose: &Pose) -> f64 {
        let indentation = pose.difference::<D>(&self.contact);
        self.pressing_force(&(self.stiffness * indentation))
    }

    /// Stiffness k in N/m along the normal: nᵀ K_e n.
    pub fn normal_stiffness(&self) -> f64 {
        self.normal.dot(&(self.stiffness * self.normal))
    }

    /// Moves the surface by `height` m along its outward normal.
    pub(crate) fn raise(&mut self, height: f64) {
        for axis in 0..D.min(3) {
            self.contact.position[axis] += height * self.normal[axis];
        }
    }

    /// Height in m of a position along the outward normal.
    pub(crate) fn height(&self, position: &Vector3<f64>) -> f64 {
        (0..D.min(3)).map(|axis| self.normal[axis] * position[axis]).sum()
    }

    /// Speed in m/s of a twist out of the surface: nᵀṗ, negative when approaching.
    pub fn outward_speed(&self, twist: &SVector<f64, D>) -> f64 {
        self.normal.dot(twist)
    }
}

/// Outward normal of a plane that falls by `angle` rad towards +x: T_planeᵀ (0, 1)ᵀ of (20), (21). Figures 2 and 5 show that sense.
pub fn tilted_normal(angle: f64) -> Vector3<f64> {
    Vector3::new(libm::sin(angle), libm::cos(angle), 0.0)
}
