//! The arms of the study, as the judge knows them: it shares no model code with the controller.

mod chain;
mod planar_two;
mod rows;

use nalgebra::Matrix3;

pub(crate) use chain::{Chain, Joint, Kind};
pub(crate) use planar_two::PlanarTwo;
pub(crate) use rows::{Rows, least_norm, product, unseen};

/// An arm.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Arm {
    /// Two joints in the plane of x and y.
    PlanarTwo(PlanarTwo),
    /// Any other.
    Chain(Chain),
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn of_two(q: &[f64]) -> [f64; 2] {
    [q[0], q[1]]
}

impl Arm {
    /// Number of joints.
    pub(crate) fn joints(&self) -> usize {
        match self {
            Self::PlanarTwo(_) => 2,
            Self::Chain(chain) => chain.joints.len(),
        }
    }

    /// How many of x y z rx ry rz its twists and wrenches have.
    pub(crate) fn task_axes(&self) -> usize {
        match self {
            Self::PlanarTwo(_) => 2,
            Self::Chain(_) => 6,
        }
    }

    /// TCP position in m, base frame.
    pub(crate) fn tcp(&self, q: &[f64]) -> [f64; 3] {
        match self {
            Self::PlanarTwo(arm) => {
                let [x, y] = arm.tcp(of_two(q));
                [x, y, 0.0]
            }
            Self::Chain(chain) => chain.tcp(q).translation.vector.into(),
        }
    }

    /// The TCP's axes in the base frame, as columns.
    pub(crate) fn tool_axes(&self, q: &[f64]) -> Matrix3<f64> {
        match self {
            Self::PlanarTwo(_) => {
                let (sine, cosine) = (q[0] + q[1]).sin_cos();
                Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0)
            }
            Self::Chain(chain) => chain.tcp(q).rotation.to_rotation_matrix().into_inner(),
        }
    }

    /// ∂TCP/∂q in m and rad, a row for each task axis, base frame.
    pub(crate) fn jacobian(&self, q: &[f64]) -> Rows {
        match self {
            Self::PlanarTwo(arm) => arm.jacobian(of_two(q)).map(Vec::from).to_vec(),
            Self::Chain(chain) => chain.jacobian(q).to_vec(),
        }
    }

    /// Speed of the TCP along `direction` per joint speed, in m/rad or 1.
    pub(crate) fn lever(&self, q: &[f64], direction: [f64; 3]) -> Vec<f64> {
        let jacobian = self.jacobian(q);
        let along = |joint: usize| jacobian.iter().zip(direction).map(|(row, part)| row[joint] * part).sum();
        (0..self.joints()).map(along).collect()
    }

    /// Joint velocity in rad/s or m/s of least norm for a TCP twist on these axes; not finite in a
    /// singular pose.
    pub(crate) fn joint_velocity(&self, q: &[f64], axes: &[usize], twist: &[f64]) -> Vec<f64> {
        match self {
            Self::PlanarTwo(arm) => arm.joint_velocity(of_two(q), [twist[0], twist[1]]).to_vec(),
            Self::Chain(chain) => {
                let jacobian = chain.jacobian(q);
                let rows = axes.iter().map(|axis| jacobian[*axis].clone()).collect();
                let wanted: Vec<f64> = axes.iter().map(|axis| twist[*axis]).collect();
                least_norm(&rows, &wanted)
            }
        }
    }

    /// Smallest over largest singular value of the Jacobian on these axes: 0 where the arm is singular,
    /// 1 at best.
    pub(crate) fn reciprocal_condition(&self, q: &[f64], axes: &[usize]) -> f64 {
        match self {
            Self::PlanarTwo(arm) => arm.reciprocal_condition(of_two(q)),
            Self::Chain(chain) => chain.reciprocal_condition(q, axes),
        }
    }
}

/// A joint's speed loop T_V q̈ + q̇ = q̇_ref over `time_s` of a constant reference: (way in rad or m,
/// speed).
pub(crate) fn lag(time_constant_s: f64, speed: f64, reference: f64, time_s: f64) -> (f64, f64) {
    let lost = -(-time_s / time_constant_s).exp_m1();
    (reference * time_s + (speed - reference) * time_constant_s * lost, speed + (reference - speed) * lost)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lag_is_the_step_response() {
        let (moved, speed) = lag(0.01, 0.0, 2.0, 0.02);
        assert!((speed - 2.0 * (1.0 - (-2f64).exp())).abs() < 1e-15);
        assert!((moved - 2.0 * (0.02 - 0.01 * (1.0 - (-2f64).exp()))).abs() < 1e-15);
    }

    #[test]
    fn levers_are_speeds_along_a_direction() {
        let arm = Arm::PlanarTwo(PlanarTwo { links_m: [0.7, 0.4] });
        let (q, twist, direction) = ([0.4, -1.1], [0.3, -0.2], [0.6, 0.8, 0.0]);
        let speed = arm.joint_velocity(&q, &[0, 1], &twist);
        let along: f64 = arm.lever(&q, direction).iter().zip(&speed).map(|(lever, speed)| lever * speed).sum();
        assert!((along - dot([twist[0], twist[1], 0.0], direction)).abs() < 1e-12);
    }
}
