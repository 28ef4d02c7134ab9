//! The inertia of a tool: what a sensor between flange and tool feels when the tool is accelerated.
//!
//! The tool counts as a point mass at its centre of gravity, moved by the true joints. Left out are
//! its rotational inertia about that centre, and whatever bends between sensor and tool.

use admittance_core::robot::Chain;
use nalgebra::{Rotation3, SVector, Unit, Vector3, Vector6};

use crate::joint_loop::JointState;

/// What hangs on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tool {
    /// kg.
    pub mass: f64,
    /// Its centre of gravity in the frame of the TCP, m.
    pub center_of_gravity: Vector3<f64>,
}

impl Tool {
    /// The wrench in N and N m, about the TCP in the base frame, that accelerates the tool as the
    /// joints move it: `motion` with the joint accelerations in rad/s².
    pub fn inertia<const N: usize>(
        &self,
        chain: &Chain<N>,
        motion: &JointState<N>,
        acceleration: &SVector<f64, N>,
    ) -> Vector6<f64> {
        let (lever, point) = self.acceleration(chain, motion, acceleration);
        let force = point * self.mass;
        let torque = lever.cross(&force);
        Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
    }

    /// From the TCP to the centre of gravity in m, and the acceleration of the latter in m/s², base
    /// frame: J q̈ + J̇ q̇, from link to link.
    fn acceleration<const N: usize>(
        &self,
        chain: &Chain<N>,
        motion: &JointState<N>,
        acceleration: &SVector<f64, N>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let (mut omega, mut alpha, mut linear) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        let mut rotation = Rotation3::identity();
        let further = |linear: Vector3<f64>, omega: &Vector3<f64>, alpha: &Vector3<f64>, arm: &Vector3<f64>| {
            linear + alpha.cross(arm) + omega.cross(&omega.cross(arm))
        };
        for (index, joint) in chain.joints().iter().enumerate() {
            linear = further(linear, &omega, &alpha, &(rotation * joint.origin));
            rotation *= Rotation3::from_matrix_unchecked(joint.rotation);
            let axis = rotation * joint.axis;
            let turning = axis * motion.velocity[index];
            alpha += axis * acceleration[index] + omega.cross(&turning);
            omega += turning;
            rotation *= Rotation3::from_axis_angle(&Unit::new_unchecked(joint.axis), motion.position[index]);
        }
        let tool = chain.tool();
        let lever = rotation * (tool.rotation * self.center_of_gravity);
        (lever, further(linear, &omega, &alpha, &(rotation * tool.position + lever)))
    }
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;
    use crate::scenario::Scenario;

    /// Position of the centre of gravity and of the TCP, by the kinematics alone.
    fn places(chain: &Chain<6>, tool: &Tool, q: &SVector<f64, 6>) -> (Vector3<f64>, Vector3<f64>) {
        let pose = chain.kinematics(q).pose;
        (pose.position + pose.rotation * tool.center_of_gravity, pose.position)
    }

    #[test]
    fn it_is_the_second_derivative_of_where_the_tool_is() {
        let text = include_str!("../scenarios/six-joint.toml");
        let chain: Chain<6> = parse::<Scenario>(text, "six-joint.toml").unwrap().robot.chain().unwrap();
        let tool = Tool { mass: 3.0, center_of_gravity: Vector3::new(0.04, -0.07, 0.11) };
        let position = SVector::from([0.3, 1.2, -1.8, 2.2, 1.57, 0.3]);
        let velocity = SVector::from([0.7, -1.1, 0.9, 1.3, -0.6, 2.0]);
        let acceleration = SVector::from([4.0, 9.0, -12.0, 5.0, 20.0, -30.0]);
        let motion = JointState { velocity, ..JointState::at_rest(position) };
        let h = 1e-4;
        let at = |t: f64| places(&chain, &tool, &(position + velocity * t + acceleration * (0.5 * t * t)));
        let ((before, _), (here, tcp), (after, _)) = (at(-h), at(0.0), at(h));
        let force = (before + after - here * 2.0) * (tool.mass / (h * h));
        let torque = (here - tcp).cross(&force);
        let found = tool.inertia(&chain, &motion, &acceleration);
        assert!((found.fixed_rows::<3>(0) - force).norm() < 1e-3 * force.norm(), "{found} {force}");
        assert!((found.fixed_rows::<3>(3) - torque).norm() < 1e-3 * torque.norm(), "{found} {torque}");
    }
}
