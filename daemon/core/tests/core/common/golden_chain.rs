//! The chain of a golden file's arm, as the scripts in golden write it.

use admittance_core::robot::{Chain, Joint, JointKind, Pose, rotation_from_rpy};
use serde::Deserialize;

#[derive(Deserialize)]
pub(crate) struct GoldenChain {
    pub(crate) joints: Vec<JointData>,
    tool: FrameData,
}

#[derive(Deserialize)]
pub(crate) struct JointData {
    origin: [f64; 3],
    rpy: [f64; 3],
    axis: [f64; 3],
    kind: KindName,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "snake_case")]
enum KindName {
    Revolute,
    Prismatic,
}

#[derive(Deserialize)]
struct FrameData {
    origin: [f64; 3],
    rpy: [f64; 3],
}

impl GoldenChain {
    /// # Panics
    /// When the arm has another number of joints.
    pub(crate) fn chain<const N: usize>(&self) -> Chain<N> {
        assert_eq!(self.joints.len(), N);
        let joints = std::array::from_fn(|index| {
            let joint = &self.joints[index];
            let kind = match joint.kind {
                KindName::Revolute => JointKind::Revolute,
                KindName::Prismatic => JointKind::Prismatic,
            };
            let (origin, rotation) = (joint.origin.into(), rotation_from_rpy(joint.rpy));
            Joint { origin, rotation, axis: joint.axis.into(), kind }
        });
        let tool = Pose { position: self.tool.origin.into(), rotation: rotation_from_rpy(self.tool.rpy) };
        Chain::new(joints, tool).expect("the golden arm is a chain")
    }
}
