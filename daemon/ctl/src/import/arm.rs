//! The arm between two links: its joints, with fixed ones folded in, and what they move.

use admittance_core::quantities::AXIS_NAMES;
use admittance_core::robot::{self, Chain, JointKind, SUPPORTED_ARMS, TaskAxes};
use admittance_core::with_arm;
use admittance_runner::config::has_regular_pose;
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

/// Furthest that a prismatic joint may slide either way, in m.
const MOST_SLID: f64 = 100.0;
/// Reciprocal condition from which a Jacobian counts as regular: that of the printed file.
pub(super) const LEAST_CONDITION: f64 = 0.001;

/// A joint that moves, and its body.
#[derive(Debug, Clone)]
pub(super) struct ArmJoint {
    pub(super) name: String,
    /// In the frame of the joint before it, or of the base link.
    pub(super) frame: Frame,
    /// Of length 1.
    pub(super) axis: [f64; 3],
    /// Whether it turns or slides: rad or m below.
    pub(super) kind: JointKind,
    /// rad or m; `None` for a continuous joint.
    pub(super) position: Option<[f64; 2]>,
    /// Whether an end of that is its `<safety_controller>`'s, within the one of its `<limit>`.
    pub(super) is_soft: bool,
    /// rad/s or m/s; `None` where the URDF says none.
    pub(super) speed: Option<f64>,
    /// N m or N; likewise.
    pub(super) effort: Option<f64>,
    /// Viscous (N m s/rad or N s/m) and dry friction (N m or N); likewise.
    pub(super) friction: Option<[f64; 2]>,
    pub(super) body: Body,
}

/// A chain of joints that turn or slide.
#[derive(Debug, Clone)]
pub(super) struct Arm {
    /// Of the URDF.
    pub(super) name: String,
    pub(super) task_axes: usize,
    /// Those that the joints can move the tip on; all when `None`.
    pub(super) controlled: Option<Vec<usize>>,
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
        if !with_arm!((moving.len(), AXIS_NAMES.len()), <_N, _D> => true, else false) {
            let names: Vec<_> = moving.iter().take(20).map(|joint| Shown(&joint.name).to_string()).collect();
            let why = format!(
                "{} joints move between --base {} and --tip {}: {}; accepted: {SUPPORTED_ARMS}",
                moving.len(),
                Shown(base),
                Shown(tip),
                names.join(", ")
            );
            return Err(Refused::new(None, why));
        }
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
        let task_axes = if is_planar(&joints, &frame) { PLANE } else { AXIS_NAMES.len() };
        let controlled = controlled(&joints, &frame, task_axes);
        Ok(Self { name: described.robot.name.clone(), task_axes, controlled, joints, tool: frame })
    }

    /// Whether the joints can move the tip on a task axis.
    pub(super) fn controls(&self, axis: usize) -> bool {
        axis < self.task_axes && self.controlled.as_ref().is_none_or(|axes| axes.contains(&axis))
    }

    /// The names of the axes that are controlled; `None` of all.
    pub(super) fn controlled_names(&self) -> Option<Vec<String>> {
        let names = |axes: &Vec<usize>| axes.iter().map(|axis| AXIS_NAMES[*axis].to_owned()).collect();
        self.controlled.as_ref().map(names)
    }
}

/// x and y, the axes of an arm of two joints that moves in that plane alone.
const PLANE: usize = 2;
/// Entries of a Jacobian, in m or 1, that are zero but for rounding: URDFs write pi/2 with some digits.
const ROUNDING: f64 = 1e-4;

/// The chain of these joints, as the daemon has it; `None` where they are not N.
fn chain<const N: usize>(joints: &[ArmJoint], tool: &Frame) -> Option<Chain<N>> {
    let joints = joints.iter().map(|joint| robot::Joint {
        origin: joint.frame.pose.position,
        rotation: joint.frame.pose.rotation,
        axis: joint.axis.into(),
        kind: joint.kind,
    });
    Chain::new(joints.collect::<Vec<_>>().try_into().ok()?, tool.pose).ok()
}

/// Whether these are two joints that move the tip in the plane of x and y, and turn it about z, wherever they are.
fn is_planar(joints: &[ArmJoint], tool: &Frame) -> bool {
    let Some(chain) = chain::<PLANE>(joints, tool) else { return false };
    [[0.0, 0.0], [0.9, -0.4]].into_iter().all(|q| {
        let jacobian = chain.kinematics(&q.into()).jacobian;
        jacobian.fixed_rows::<3>(2).amax() < ROUNDING
    })
}

/// The axes that can be controlled, x before y and so on, as many as are independent; `None` where
/// these are all, or none.
fn controlled(joints: &[ArmJoint], tool: &Frame, task_axes: usize) -> Option<Vec<usize>> {
    fn of<const N: usize, const D: usize>(joints: &[ArmJoint], tool: &Frame) -> Option<Vec<usize>> {
        let chain = chain::<N>(joints, tool)?;
        if D < AXIS_NAMES.len() || has_regular_pose::<N, D>(&chain, LEAST_CONDITION) {
            return None;
        }
        let is_regular = |axes: &[usize]| {
            TaskAxes::of(axes.iter().copied())
                .is_some_and(|axes| has_regular_pose::<N, D>(&chain.with_axes(axes), LEAST_CONDITION))
        };
        let more = |so_far: Vec<usize>, axis: usize| {
            let with = [so_far.as_slice(), &[axis]].concat();
            if with.len() <= N && is_regular(&with) { with } else { so_far }
        };
        Some((0..D).fold(Vec::new(), more)).filter(|axes| !axes.is_empty())
    }
    with_arm!((joints.len(), task_axes), <N, D> => of::<N, D>(joints, tool), else None)
}

fn can_be_imported(joint: &Joint, said: Said) -> Result<(), Refused> {
    let refused = |why: &str| Err(Refused::new(said.line, format!("joint {}: {why}", Shown(&joint.name))));
    if joint.mimic.is_some() {
        return refused(
            "it mimics another joint, and has no drive of its own; accepted: no <mimic> between base and tip",
        );
    }
    let kind = match joint.joint_type {
        JointType::Revolute | JointType::Continuous | JointType::Prismatic | JointType::Fixed => return Ok(()),
        JointType::Floating => "floating",
        JointType::Planar => "planar",
        JointType::Spherical => "spherical",
    };
    refused(&format!(
        "it is {kind}; accepted between base and tip: revolute, continuous, prismatic and fixed joints; begin or end the arm at it"
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
        kind: match joint.joint_type {
            JointType::Prismatic => JointKind::Prismatic,
            _ => JointKind::Revolute,
        },
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

/// The ends of a revolute joint in rad, or of a prismatic one in m, and whether one is of its `<safety_controller>`.
fn position(joint: &Joint, said: Said) -> Result<([f64; 2], bool), Refused> {
    let refused = |why: String| Err(Refused::new(said.line, format!("joint {}: {why}", Shown(&joint.name))));
    let is_prismatic = joint.joint_type == JointType::Prismatic;
    let needed = [("lower", said.lower), ("upper", said.upper), ("velocity", said.velocity), ("effort", said.effort)];
    let absent: Vec<&str> = needed.into_iter().filter(|(_, is_said)| !is_said).map(|(name, _)| name).collect();
    if !absent.is_empty() {
        return refused(format!(
            "its <limit> lacks {}; say it{}",
            absent.join(", "),
            if is_prismatic { "" } else { ", or make it type=\"continuous\" where it turns without end" }
        ));
    }
    let hard = [joint.limit.lower, joint.limit.upper];
    let [lower, upper] = hard.map(shown);
    if hard[0] >= hard[1] {
        return refused(format!("lower = {lower} and upper = {upper} of its <limit>; accepted: lower below upper"));
    }
    if is_prismatic && hard.iter().any(|end| end.abs() > MOST_SLID) {
        return refused(format!(
            "lower = {lower} and upper = {upper} of its <limit>, in m; accepted: up to {MOST_SLID} m either way; \
             millimetres have to be converted"
        ));
    }
    if !is_prismatic && hard.iter().any(|end| (MOST_TURNED..NO_LIMIT).contains(&end.abs())) {
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
