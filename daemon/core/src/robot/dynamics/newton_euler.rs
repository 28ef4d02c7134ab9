//! Inverse dynamics by the recursive Newton-Euler algorithm (Featherstone, table 5.1).

use nalgebra::{Matrix3, SVector, Vector6};

use super::at::DynamicsAt;
use super::spatial::{Force, Motion};

impl<const N: usize> DynamicsAt<'_, N> {
    /// M q̈ + C q̇ + G + Jᵀ f̂ in N m or N: what the motors give without friction (1). Velocity in
    /// rad/s or m/s, acceleration in rad/s² or m/s²; the wrench in N and N m, which the robot exerts
    /// on the environment at the TCP, base frame.
    pub fn torque(
        &self,
        velocity: &SVector<f64, N>,
        acceleration: &SVector<f64, N>,
        wrench: &Vector6<f64>,
    ) -> SVector<f64, N> {
        // Gravity is an upward acceleration of the base.
        let mut a = Motion { linear: -self.arm.gravity, ..Motion::ZERO };
        let mut v = Motion::ZERO;
        let mut forces = [Force::ZERO; N];
        for joint in 0..N {
            let moving = self.motion(joint, velocity[joint]);
            v = self.placements[joint].body_has(&v) + moving;
            a = self.placements[joint].body_has(&a) + self.motion(joint, acceleration[joint]) + v.cross(&moving);
            let inertia = &self.arm.links[joint];
            forces[joint] = inertia * &a + v.cross_force(&(inertia * &v));
        }
        if let Some(last) = forces.last_mut() {
            *last += self.exerted(wrench);
        }
        let mut torque = SVector::zeros();
        for joint in (0..N).rev() {
            torque[joint] = self.along(joint, &forces[joint]) + self.arm.reflected[joint] * acceleration[joint];
            if joint > 0 {
                let handed_on = self.placements[joint].parent_has(&forces[joint]);
                forces[joint - 1] += handed_on;
            }
        }
        torque
    }

    /// C q̇ + G + Jᵀ f̂: the torque without any acceleration.
    pub fn bias(&self, velocity: &SVector<f64, N>, wrench: &Vector6<f64>) -> SVector<f64, N> {
        self.torque(velocity, &SVector::zeros(), wrench)
    }

    /// G(q) in N m or N: the torque that holds the arm at rest.
    pub fn gravity_torque(&self) -> SVector<f64, N> {
        self.torque(&SVector::zeros(), &SVector::zeros(), &Vector6::zeros())
    }

    /// What the last link has to give for the robot to exert this wrench, in that link's frame.
    fn exerted(&self, wrench: &Vector6<f64>) -> Force {
        let rotation = self.placements.iter().fold(Matrix3::identity(), |so_far, next| so_far * next.rotation);
        let force = rotation.tr_mul(&wrench.fixed_rows::<3>(0).into_owned());
        let moment = rotation.tr_mul(&wrench.fixed_rows::<3>(3).into_owned());
        Force { moment: moment + self.arm.chain.tool().position.cross(&force), force }
    }
}
