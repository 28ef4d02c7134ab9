//! What a joint moves: its link, and all that hangs on it, as one rigid body.

use admittance_core::robot::{LinkInertia, rotation_from_rpy};
use nalgebra::{Matrix3, Vector3};
use urdf_rs::{JointType, Link};

use super::document::Described;
use super::frame::Frame;
use super::marked::shown;
use super::tree::Tree;
use super::xml::{Refused, Shown};

/// Least principal moment of a part without extent, as a share of the tensor's largest entry: what
/// rounding leaves of zero.
const ROUNDING: f64 = 1e-9;

/// The body that moves with a joint's child.
#[derive(Debug, Clone, Default)]
pub(super) struct Body {
    /// In the frame of the joint; `None` where the URDF gives no mass to any of its links.
    pub(super) inertia: Option<LinkInertia>,
    /// Its links, the joint's own first.
    pub(super) links: Vec<String>,
    /// Joints within it that the arm does not move, as if they were at zero.
    pub(super) held_joints: Vec<String>,
}

impl Body {
    /// All from `link` on but what hangs on the arm's next joint.
    pub(super) fn of(
        described: &Described,
        tree: &Tree<'_>,
        link: &str,
        next_joint: Option<&str>,
    ) -> Result<Self, Refused> {
        let mut body = Self::default();
        let mut parts = Vec::new();
        let mut open = vec![(link, Frame::identity())];
        while let Some((link, frame)) = open.pop() {
            let is_own = body.links.is_empty();
            body.links.push(link.to_owned());
            let found = described.robot.links.iter().find(|found| found.name == link);
            if let Some(found) = found.filter(|_| described.links.get(link).is_some_and(|said| said.inertial)) {
                parts.extend(part(described, found, &frame, is_own)?);
            }
            for joint in tree.joints_below(link).iter().filter(|joint| Some(joint.name.as_str()) != next_joint) {
                if joint.joint_type != JointType::Fixed {
                    body.held_joints.push(joint.name.clone());
                }
                open.push((&joint.child.link, frame.then(&Frame::of(&joint.origin))));
            }
        }
        body.inertia = joined(&parts);
        Ok(body)
    }
}

/// A link's mass in the frame of its body; `None` for a link that is a frame only.
fn part(described: &Described, link: &Link, frame: &Frame, is_own: bool) -> Result<Option<LinkInertia>, Refused> {
    let refused = |what: String, accepted: &str| {
        let line = described.links.get(&link.name).and_then(|said| said.line);
        Refused::new(line, format!("link {}: {what}; accepted: {accepted}", Shown(&link.name)))
    };
    let (mass, told) = (link.inertial.mass.value, &link.inertial.inertia);
    let tensor = Matrix3::new(told.ixx, told.ixy, told.ixz, told.ixy, told.iyy, told.iyz, told.ixz, told.iyz, told.izz);
    if mass == 0.0 && tensor == Matrix3::zeros() && !is_own {
        return Ok(None);
    }
    if mass <= 0.0 {
        return Err(refused(
            format!("its mass is {} kg", shown(mass)),
            "a mass above 0, or no <inertial>, which is then marked as to be filled in",
        ));
    }
    let principal = tensor.symmetric_eigenvalues();
    // A part of a body may be a point; that the body then has a tensor is seen in the end.
    let least = if is_own { f64::MIN_POSITIVE } else { -ROUNDING * tensor.amax() };
    if principal.min() < least {
        return Err(refused(
            format!("the principal moments of its inertia are {:?} kg m^2", <[f64; 3]>::from(principal)),
            "moments above 0, or no <inertial>, which is then marked as to be filled in",
        ));
    }
    let origin = &link.inertial.origin;
    let turned = |rotation: &Matrix3<f64>, tensor: &Matrix3<f64>| {
        // Nothing is computed where nothing turns: the numbers stay those of the URDF.
        if *rotation == Matrix3::identity() { *tensor } else { rotation * tensor * rotation.transpose() }
    };
    let in_link = turned(&rotation_from_rpy(*origin.rpy), &tensor);
    Ok(Some(LinkInertia {
        mass,
        center_of_gravity: frame.pose.position + frame.pose.rotation * Vector3::from(*origin.xyz),
        inertia: turned(&frame.pose.rotation, &in_link),
    }))
}

/// Several bodies that are one, in the frame that all are given in.
fn joined(parts: &[LinkInertia]) -> Option<LinkInertia> {
    if let [] | [_] = parts {
        return parts.first().copied();
    }
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    let moment = parts.iter().fold(Vector3::zeros(), |sum, part| sum + part.center_of_gravity * part.mass);
    let center_of_gravity = moment / mass;
    let inertia = parts.iter().fold(Matrix3::zeros(), |sum, part| {
        let away = part.center_of_gravity - center_of_gravity;
        let steiner = (Matrix3::identity() * away.norm_squared() - away * away.transpose()) * part.mass;
        sum + part.inertia + steiner
    });
    Some(LinkInertia { mass, center_of_gravity, inertia })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_points_are_a_dumbbell_about_their_middle() {
        let point = |x: f64, mass: f64| LinkInertia {
            mass,
            center_of_gravity: Vector3::new(x, 0.0, 1.0),
            inertia: Matrix3::zeros(),
        };
        let dumbbell = joined(&[point(0.0, 1.0), point(3.0, 2.0)]).expect("two parts");
        assert_eq!((dumbbell.mass, dumbbell.center_of_gravity), (3.0, Vector3::new(2.0, 0.0, 1.0)));
        // 1 kg · (2 m)² + 2 kg · (1 m)² across the rod, none about it.
        let expected = Matrix3::from_diagonal(&Vector3::new(0.0, 6.0, 6.0));
        assert!((dumbbell.inertia - expected).amax() < 1e-12, "{}", dumbbell.inertia);
        assert!(joined(&[]).is_none());
    }
}
