//! Any serial chain of joints that turn or slide, by quaternions: the judge shares no model code with
//! the controller.

use nalgebra::{Isometry3, Matrix6, Translation3, Unit, UnitQuaternion, Vector3};

use super::product;

/// 1 rad/s at so many metres counts as much as 1 m/s where a condition is asked for.
const TURN_LEVER_M: f64 = 0.3;

/// How a joint moves along its axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Turns about it: rad.
    Turns,
    /// Slides along it: m.
    Slides,
}

/// One joint, in the manner of URDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Joint {
    /// Origin in the parent's frame, m.
    pub(crate) origin_m: [f64; 3],
    /// Fixed-axis roll, pitch, yaw in the parent's frame, rad.
    pub(crate) rpy_rad: [f64; 3],
    /// Axis in the joint's frame; of length 1.
    pub(crate) axis: [f64; 3],
    /// How it moves.
    pub(crate) kind: Kind,
}

/// A chain and its tool.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chain {
    /// Base first.
    pub(crate) joints: Vec<Joint>,
    /// The TCP in the last link's frame: position in m, and fixed-axis roll, pitch, yaw in rad.
    pub(crate) tool_m: [f64; 3],
    pub(crate) tool_rpy_rad: [f64; 3],
}

fn frame(origin_m: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Isometry3<f64> {
    let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    let turned = about(Vector3::z_axis(), yaw) * about(Vector3::y_axis(), pitch) * about(Vector3::x_axis(), roll);
    Isometry3::from_parts(Translation3::from(origin_m), turned)
}

impl Chain {
    /// Where the TCP is and how it stands, base frame.
    pub(super) fn tcp(&self, q: &[f64]) -> Isometry3<f64> {
        self.walk(q, |_, _, _| ())
    }

    /// ∂TCP/∂q: rows x y z in m, rx ry rz in rad, base frame.
    pub(super) fn jacobian(&self, q: &[f64]) -> [Vec<f64>; 6] {
        let mut axes = Vec::with_capacity(self.joints.len());
        let tcp = self.walk(q, |origin, axis, kind| axes.push((origin, axis, kind))).translation.vector;
        let mut jacobian = [const { Vec::new() }; 6];
        for (origin, axis, kind) in axes {
            let (moved, turned) = match kind {
                Kind::Turns => (axis.cross(&(tcp - origin)), axis),
                Kind::Slides => (axis, Vector3::zeros()),
            };
            let column = moved.iter().chain(turned.iter());
            jacobian.iter_mut().zip(column).for_each(|(row, value)| row.push(*value));
        }
        jacobian
    }

    /// Walks from the base to the TCP, and shows each joint's origin and axis in the base frame.
    fn walk(&self, q: &[f64], mut seen: impl FnMut(Vector3<f64>, Vector3<f64>, Kind)) -> Isometry3<f64> {
        let mut at = Isometry3::identity();
        for (joint, q) in self.joints.iter().zip(q) {
            at *= frame(joint.origin_m, joint.rpy_rad);
            let axis = Vector3::from(joint.axis);
            seen(at.translation.vector, at.rotation * axis, joint.kind);
            at *= match joint.kind {
                Kind::Turns => UnitQuaternion::from_axis_angle(&Unit::new_unchecked(axis), *q) * Isometry3::identity(),
                Kind::Slides => Isometry3::from_parts(Translation3::from(axis * *q), UnitQuaternion::identity()),
            };
        }
        at * frame(self.tool_m, self.tool_rpy_rad)
    }

    /// Smallest over largest singular value of some rows of the Jacobian, with a lever for those that
    /// turn.
    pub(super) fn reciprocal_condition(&self, q: &[f64], axes: &[usize]) -> f64 {
        let jacobian = self.jacobian(q);
        let weight = |axis: usize| if axis < 3 { 1.0 } else { TURN_LEVER_M };
        let gram = |a: usize, b: usize| weight(a) * weight(b) * product(&jacobian[a], &jacobian[b]);
        // Where there is no row: a number between the least and the largest eigenvalue.
        let gram = Matrix6::from_fn(|row, column| match (axes.get(row), axes.get(column)) {
            (Some(row), Some(column)) => gram(*row, *column),
            _ if row == column => gram(axes[0], axes[0]),
            _ => 0.0,
        });
        let squares = gram.symmetric_eigenvalues();
        (squares.min().max(0.0) / squares.max()).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain() -> Chain {
        let turns = |origin_m, rpy_rad, axis| Joint { origin_m, rpy_rad, axis, kind: Kind::Turns };
        let slides =
            Joint { origin_m: [0.1, 0.2, 0.3], rpy_rad: [0.4, -0.2, 0.1], axis: [0.6, 0.0, 0.8], kind: Kind::Slides };
        let joints = vec![
            turns([0.0, 0.0, 0.4], [0.0; 3], [0.0, 0.0, 1.0]),
            slides,
            turns([0.0, 0.3, 0.0], [1.2, 0.0, 0.3], [0.0, 1.0, 0.0]),
            turns([0.5, 0.0, 0.1], [0.0, -0.7, 0.0], [0.8, 0.6, 0.0]),
        ];
        Chain { joints, tool_m: [0.02, -0.05, 0.2], tool_rpy_rad: [0.3, 0.2, 0.1] }
    }

    #[test]
    fn the_jacobian_is_the_derivative_of_the_pose() {
        let (chain, q, h) = (chain(), [0.4, 0.1, -1.1, 0.7], 1e-6);
        let jacobian = chain.jacobian(&q);
        for joint in 0..q.len() {
            let at = |sign: f64| {
                let mut q = q;
                q[joint] += sign * h;
                chain.tcp(&q)
            };
            let (ahead, behind) = (at(1.0), at(-1.0));
            let moved = (ahead.translation.vector - behind.translation.vector) / (2.0 * h);
            let turned = (ahead.rotation * behind.rotation.inverse()).scaled_axis() / (2.0 * h);
            for axis in 0..3 {
                assert!((jacobian[axis][joint] - moved[axis]).abs() < 1e-8, "{joint}");
                assert!((jacobian[axis + 3][joint] - turned[axis]).abs() < 1e-8, "{joint}");
            }
        }
    }

    #[test]
    fn two_links_in_a_plane_are_the_closed_form() {
        let turns = |x| Joint { origin_m: [x, 0.0, 0.0], rpy_rad: [0.0; 3], axis: [0.0, 0.0, 1.0], kind: Kind::Turns };
        let chain = Chain { joints: vec![turns(0.0), turns(0.7)], tool_m: [0.4, 0.0, 0.0], tool_rpy_rad: [0.0; 3] };
        let (planar, q) = (super::super::PlanarTwo { links_m: [0.7, 0.4] }, [0.4, -1.1]);
        let tcp = chain.tcp(&q).translation.vector;
        assert!((tcp.xy() - nalgebra::Vector2::from(planar.tcp(q))).norm() < 1e-15);
        let condition = chain.reciprocal_condition(&q, &[0, 1]);
        assert!((condition - planar.reciprocal_condition(q)).abs() < 1e-12);
    }
}
