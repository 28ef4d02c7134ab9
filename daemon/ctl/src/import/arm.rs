//! The arm between two links: its joints, with fixed ones folded in, and what they move.

use admittance_core::robot::SUPPORTED_ARMS;
use admittance_core::with_arm;
use urdf_rs::{Joint, JointType};

use super::body::Body;
use super::checked::Said;
use super::document::Described;
use super::frame::Frame;
use super::marked::shown;
use super::tree::Tree;
use super::xml::{Refused, Shown};

/// Furthest that a joint may turn either way, in rad: four turns. What is beyond is likely in degrees.
const MOST_TURNED: f64 = 4.0 * std::f64::consts::TAU;
/// Position in rad from which a limit is none: nobody writes so many degrees.
const NO_LIMIT: f64 = 1000.0;

/// A joint that turns, and its body.
#[derive(Debug, Clone)]
pub(super) struct ArmJoint {
    pub(super) name: String,
    /// In the frame of the joint before it, or of the base link.
    pub(super) frame: Frame,
    /// Of length 1.
    pub(super) axis: [f64; 3],
    /// rad; `None` for a continuous joint.
    pub(super) position: Option<[f64; 2]>,
    /// Whether an end of that is its `<safety_controller>`'s, within the one of its `<limit>`.
    pub(super) is_soft: bool,
    /// rad/s; `None` where the URDF says none.
    pub(super) speed: Option<f64>,
    /// N m; likewise.
    pub(super) effort: Option<f64>,
    /// Viscous (N m s/rad) and dry friction (N m); likewise.
    pub(super) friction: Option<[f64; 2]>,
    pub(super) body: Body,
}

/// A chain of joints that turn.
#[derive(Debug, Clone)]
pub(super) struct Arm {
    /// Of the URDF.
    pub(super) name: String,
    pub(super) task_axes: usize,
    pub(super) joints: Vec<ArmJoint>,
    /// Of the tip in the frame of the last joint.
    pub(super) tool: Frame,
}

impl Arm {
    pub(super) fn between(described: &Described, base: &str, tip: &str) -> Result<Self, Refused> {
        let tree = Tree::of(described)?;
        let way = tree.way(base, tip)?;
        let moving: Vec<&Joint> = way.iter().copied().filter(|joint| joint.joint_type != JointType::Fixed).collect();
        let said = |joint: &Joint| described.joints.get(&joint.name).copied().unwrap_or_default();
        for joint in &moving {
            can_be_imported(joint, said(joint))?;
        }
        let task_axes = task_axes(moving.len()).ok_or_else(|| {
            let names: Vec<_> = moving.iter().take(20).map(|joint| Shown(&joint.name).to_string()).collect();
            let why = format!(
                "{} joints turn between --base {} and --tip {}: {}; accepted: {SUPPORTED_ARMS}",
                moving.len(),
                Shown(base),
                Shown(tip),
                names.join(", ")
            );
            Refused::new(None, why)
        })?;
        let mut joints = Vec::new();
        let (mut frame, mut next) = (Frame::identity(), moving.iter().skip(1));
        for joint in way {
            frame = frame.then(&Frame::of(&joint.origin));
            if joint.joint_type != JointType::Fixed {
                let next_joint = next.next().map(|joint| joint.name.as_str());
                let body = Body::of(described, &tree, &joint.child.link, next_joint)?;
                joints.push(arm_joint(joint, said(joint), std::mem::replace(&mut frame, Frame::identity()), body)?);
            }
        }
        Ok(Self { name: described.robot.name.clone(), task_axes, joints, tool: frame })
    }
}

/// As many axes as the daemon can control with so many joints.
fn task_axes(joints: usize) -> Option<usize> {
    (2..=6).rev().find(|axes| with_arm!((joints, *axes), <_N, _D> => true, else false))
}

fn can_be_imported(joint: &Joint, said: Said) -> Result<(), Refused> {
    let refused = |why: &str| Err(Refused::new(said.line, format!("joint {}: {why}", Shown(&joint.name))));
    if joint.mimic.is_some() {
        return refused(
            "it mimics another joint, and has no drive of its own; accepted: no <mimic> between base and tip",
        );
    }
    let kind = match joint.joint_type {
        JointType::Revolute | JointType::Continuous | JointType::Fixed => return Ok(()),
        JointType::Prismatic => "prismatic",
        JointType::Floating => "floating",
        JointType::Planar => "planar",
        JointType::Spherical => "spherical",
    };
    refused(&format!(
        "it is {kind}; accepted between base and tip: revolute, continuous and fixed joints; begin or end the arm at it"
    ))
}

fn arm_joint(joint: &Joint, said: Said, frame: Frame, body: Body) -> Result<ArmJoint, Refused> {
    let refused = |why: String| Err(Refused::new(said.line, format!("joint {}: {why}", Shown(&joint.name))));
    let Some(axis) = unit(*joint.axis.xyz) else {
        return refused(format!("axis = {:?}; accepted: a vector that is not zero", *joint.axis.xyz));
    };
    let limit = &joint.limit;
    let position = match joint.joint_type {
        JointType::Continuous => None,
        _ => Some(position(joint, said)?),
    };
    // Who writes 0 means that nobody has said.
    let above_zero = |value: f64, is_said: bool| Some(value).filter(|value| is_said && *value > 0.0);
    for (name, value) in [("velocity", limit.velocity), ("effort", limit.effort)] {
        if value < 0.0 {
            let value = shown(value);
            return refused(format!("{name} = {value} of its <limit>; accepted: above 0, or 0 where it is not known"));
        }
    }
    let friction = joint.dynamics.as_ref().map(|dynamics| [dynamics.damping, dynamics.friction]);
    for (name, value) in ["damping", "friction"].into_iter().zip(friction.into_iter().flatten()) {
        if value < 0.0 {
            return refused(format!("{name} = {} of its <dynamics>; accepted: at least 0", shown(value)));
        }
    }
    Ok(ArmJoint {
        name: joint.name.clone(),
        frame,
        axis,
        position: position.map(|(ends, _)| ends),
        is_soft: position.is_some_and(|(_, is_soft)| is_soft),
        speed: above_zero(limit.velocity, said.velocity),
        effort: above_zero(limit.effort, said.effort),
        friction,
        body,
    })
}

/// Of length 1; `None` of a vector that is as good as zero.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = |vector: [f64; 3]| vector.iter().map(|part| part * part).sum::<f64>().sqrt();
    let plain = length(vector);
    // Squares of large numbers are not finite.
    let largest = vector.iter().fold(0.0_f64, |largest, part| largest.max(part.abs()));
    let (vector, length) = if plain.is_finite() {
        (vector, plain)
    } else {
        let scaled = vector.map(|part| part / largest);
        (scaled, length(scaled))
    };
    (length > 1e-6).then(|| vector.map(|part| part / length))
}

/// The ends of a revolute joint in rad, and whether one is of its `<safety_controller>`.
fn position(joint: &Joint, said: Said) -> Result<([f64; 2], bool), Refused> {
    let refused = |why: String| Err(Refused::new(said.line, format!("joint {}: {why}", Shown(&joint.name))));
    let needed = [("lower", said.lower), ("upper", said.upper), ("velocity", said.velocity), ("effort", said.effort)];
    let absent: Vec<&str> = needed.into_iter().filter(|(_, is_said)| !is_said).map(|(name, _)| name).collect();
    if !absent.is_empty() {
        return refused(format!(
            "its <limit> lacks {}; say it, or make it type=\"continuous\" where it turns without end",
            absent.join(", ")
        ));
    }
    let hard = [joint.limit.lower, joint.limit.upper];
    let [lower, upper] = hard.map(shown);
    if hard[0] >= hard[1] {
        return refused(format!("lower = {lower} and upper = {upper} of its <limit>; accepted: lower below upper"));
    }
    if hard.iter().any(|end| (MOST_TURNED..NO_LIMIT).contains(&end.abs())) {
        return refused(format!(
            "lower = {lower} and upper = {upper} of its <limit>, in rad; accepted: up to {MOST_TURNED:.1} rad either way, \
             four turns, or type=\"continuous\" where it turns without end; degrees have to be converted"
        ));
    }
    let [soft_lower, soft_upper] = said.soft;
    let ends =
        [soft_lower.map_or(hard[0], |soft| soft.max(hard[0])), soft_upper.map_or(hard[1], |soft| soft.min(hard[1]))];
    if ends[0] >= ends[1] {
        let [soft_lower, soft_upper] = said.soft.map(|soft| soft.map_or("not said".to_owned(), shown));
        return refused(format!(
            "soft_lower_limit = {soft_lower} and soft_upper_limit = {soft_upper} of its <safety_controller>; accepted: limits \
             that leave a way between lower = {lower} and upper = {upper} of its <limit>, or none"
        ));
    }
    Ok((ends, ends != hard))
}
