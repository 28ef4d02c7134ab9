//! The surface that the robot touches: a stiff plane, (11) and (19)-(21).

use nalgebra::{SMatrix, SVector, Vector3};

use crate::quantities::{linear_axes, on_task_axes};
use crate::robot::Pose;
use crate::turn::Turn;

/// Normal speed in m/s that still counts as zero.
pub(crate) const STANDSTILL: f64 = 1e-3;

/// A plane that pushes back along its normal like a spring, in the base frame.
///
/// ```
/// use admittance_core::robot::Pose;
/// use admittance_core::surface::Surface;
/// use nalgebra::{Matrix3, Vector3};
///
/// let contact = Pose { position: Vector3::new(0.4, 0.0, 0.1), rotation: Matrix3::identity() };
/// let table = Surface::<6>::plane(1e5, &Vector3::z(), contact);
/// let pressed = Pose { position: Vector3::new(0.5, 0.0, 0.0995), ..contact };
/// assert!((table.spring_force(&pressed) - 50.0).abs() < 1e-9, "half a millimetre at 1e5 N/m");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface<const D: usize> {
    /// K_e (20), D×D, in N/m.
    pub stiffness: SMatrix<f64, D, D>,
    /// Ψ(q_contact): the pose of the TCP at which the wrench is zero.
    pub contact: Pose,
    /// Outward normal (out of the material, towards the robot) as a task direction of length 1; its
    /// rotational components are zero.
    pub normal: SVector<f64, D>,
}

impl<const D: usize> Surface<D> {
    /// The plane through the contact point with the given outward `normal` (any length above zero;
    /// components beyond the task axes are ignored) and the stiffness along it in N/m.
    ///
    /// (20) with (19) and (21): Tᵀ diag(0, k) T = k n nᵀ, n the second row of T. Of a plane that
    /// falls by α towards +x, the sense of figures 2 and 5, n = (sin α, cos α).
    pub fn plane(normal_stiffness: f64, normal: &Vector3<f64>, contact: Pose) -> Self {
        let normal = on_task_axes::<D>(normal, &Vector3::zeros()).normalize();
        Self { stiffness: normal * normal.transpose() * normal_stiffness, contact, normal }
    }

    /// The same in the frame that a turn leads to.
    #[must_use]
    pub(crate) fn turned(&self, turn: &Turn) -> Self {
        let normal = turn.twist(&self.normal);
        let stiffness = normal * normal.transpose() * self.normal_stiffness();
        Self { stiffness, contact: turn.pose(&self.contact), normal }
    }

    /// The normal in the base frame.
    pub(crate) fn normal_direction(&self) -> Vector3<f64> {
        let mut normal = Vector3::zeros();
        linear_axes::<D>().for_each(|axis| normal[axis] = self.normal[axis]);
        normal
    }

    /// Force in N with which a wrench presses on the surface: −nᵀf, positive in contact.
    pub fn pressing_force(&self, wrench: &SVector<f64, D>) -> f64 {
        -self.normal.dot(wrench)
    }

    /// The linear parts of a wrench or twist: into the surface, and along it in the base frame.
    pub(crate) fn parts(&self, vector: &SVector<f64, D>) -> (f64, Vector3<f64>) {
        let inward = -self.normal.dot(vector);
        let mut beside = self.normal_direction() * inward;
        linear_axes::<D>().for_each(|axis| beside[axis] += vector[axis]);
        (inward, beside)
    }

    /// Force in N with which the spring says that a TCP at `pose` presses: k times its depth below
    /// the surface, which is negative above it.
    pub fn spring_force(&self, pose: &Pose) -> f64 {
        let indentation = pose.difference::<D>(&self.contact);
        self.pressing_force(&(self.stiffness * indentation))
    }

    /// Stiffness k in N/m along the normal: nᵀ K_e n.
    pub fn normal_stiffness(&self) -> f64 {
        self.normal.dot(&(self.stiffness * self.normal))
    }

    /// Speed in m/s of a twist out of the surface: nᵀṗ, negative when approaching.
    pub fn outward_speed(&self, twist: &SVector<f64, D>) -> f64 {
        self.normal.dot(twist)
    }

    /// Whether a twist moves away from the surface.
    pub fn is_left_by(&self, twist: &SVector<f64, D>) -> bool {
        self.outward_speed(twist) > STANDSTILL
    }

    /// Whether a twist pushes into the surface.
    pub fn is_pushed_by(&self, twist: &SVector<f64, D>) -> bool {
        self.outward_speed(twist) < -STANDSTILL
    }

    /// A twist that leads out of the surface, slowed to `speed` (m/s); `None` for any other.
    /// Rotation is left out.
    pub(crate) fn retreat_along(&self, twist: &SVector<f64, D>, speed: f64) -> Option<SVector<f64, D>> {
        let mut translation = SVector::<f64, D>::zeros();
        linear_axes::<D>().for_each(|axis| translation[axis] = twist[axis]);
        let (found, outward) = (translation.norm(), self.outward_speed(&translation));
        (outward > STANDSTILL.min(speed) && found > 0.0).then(|| translation * (speed / found).min(1.0))
    }

    /// Moves the surface by `height` m along its outward normal.
    pub(crate) fn raise(&mut self, height: f64) {
        for axis in linear_axes::<D>() {
            self.contact.position[axis] += height * self.normal[axis];
        }
    }

    /// Tilts the normal by a vector along the surface, about a position. Returns by how much deeper
    /// that position is along the new normal, m.
    pub(crate) fn tilt(&mut self, tilt: &Vector3<f64>, about: &Vector3<f64>) -> f64 {
        let before = self.height(about);
        linear_axes::<D>().for_each(|axis| self.normal[axis] += tilt[axis]);
        self.normal /= self.normal.norm();
        before - self.height(about)
    }

    /// Makes it a spring of this stiffness (N/m) that begins at this `depth` (m): the height of the
    /// contact point is −depth.
    pub(crate) fn become_spring(&mut self, stiffness: f64, depth: f64) {
        self.stiffness = self.normal * self.normal.transpose() * stiffness;
        self.raise(-depth - self.height(&self.contact.position));
    }

    /// Height in m of a position along the outward normal.
    pub(crate) fn height(&self, position: &Vector3<f64>) -> f64 {
        linear_axes::<D>().map(|axis| self.normal[axis] * position[axis]).sum()
    }
}
