//! The velocity-controlled joints, equation (4): T_V q̈ + q̇ = q̇_ref for each joint, solved
//! exactly.

use nalgebra::SVector;

/// First-order velocity loops of N joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLoop<const N: usize> {
    time_constant_s: SVector<f64, N>,
}

/// The effect of an interval of constant velocity reference on the loops; it depends on the
/// interval's length alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointStep<const N: usize> {
    duration_s: f64,
    /// e^(−h/T_V) per joint.
    decay: SVector<f64, N>,
    /// T_V (1 − e^(−h/T_V)) per joint, in s: how far a unit of velocity error carries the joint.
    carry_s: SVector<f64, N>,
}

impl<const N: usize> JointLoop<N> {
    /// Loops with the time constants T_V in s, all above zero.
    pub fn new(time_constant_s: SVector<f64, N>) -> Self {
        Self { time_constant_s }
    }

    /// The step of an interval of `duration_s`.
    pub fn step(&self, duration_s: f64) -> JointStep<N> {
        // exp_m1: 1 − e^(−x) loses its digits where x is small, and substeps are short.
        let lost = self.time_constant_s.map(|time_constant| -(-duration_s / time_constant).exp_m1());
        JointStep { duration_s, decay: lost.map(|lost| 1.0 - lost), carry_s: lost.component_mul(&self.time_constant_s) }
    }
}

impl<const N: usize> JointStep<N> {
    /// Joint position in rad and velocity in rad/s at the end of the interval, from those at its
    /// start and the velocity reference in rad/s, constant over the interval.
    pub fn advance(&self, position: &mut SVector<f64, N>, velocity: &mut SVector<f64, N>, reference: &SVector<f64, N>) {
        let error = *velocity - reference;
        *position += reference * self.duration_s + error.component_mul(&self.carry_s);
        *velocity = reference + error.component_mul(&self.decay);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn step_response_is_the_analytic_one_whatever_the_steps() {
        let time_constant = Vector2::new(0.015, 0.010);
        let reference = Vector2::new(0.4, -0.7);
        let joints = JointLoop::new(time_constant);
        for steps in [1, 7, 400] {
            let (mut position, mut velocity) = (Vector2::new(0.3, -1.2), Vector2::new(-0.1, 0.25));
            let (position_0, velocity_0) = (position, velocity);
            let step = joints.step(0.02 / f64::from(steps));
            for _ in 0..steps {
                step.advance(&mut position, &mut velocity, &reference);
            }
            for joint in 0..2 {
                let (tau, target) = (time_constant[joint], reference[joint]);
                let decay = (-0.02 / tau).exp();
                let expected_velocity = target + (velocity_0[joint] - target) * decay;
                let expected_position =
                    position_0[joint] + target * 0.02 + (velocity_0[joint] - target) * tau * (1.0 - decay);
                assert!((velocity[joint] - expected_velocity).abs() < 1e-13, "{steps} steps, joint {joint}");
                assert!((position[joint] - expected_position).abs() < 1e-13, "{steps} steps, joint {joint}");
            }
        }
    }
}
