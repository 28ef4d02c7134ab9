//! From what the joints are to do to what the robot is told: speeds of its joints, and of its external axes none.

use admittance_client::Applied;
use egm_messages::{EgmHeader, EgmJoints, EgmSensor, EgmSpeedRef, JointUnit, MessageType};
use ipc_types::{MAX_JOINTS, TASK_AXES};

use crate::arm::AnyArm;
use crate::lead::Lead;
use crate::reading::Reading;

/// Where the robot was at its last message, and where it was led.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bearing {
    /// q, rad or m.
    pub position: [f64; MAX_JOINTS],
    /// ṗ0, m/s and rad/s, base frame.
    pub twist: [f64; TASK_AXES],
    /// Whether it follows what it is sent.
    pub follows: bool,
    /// Axes beyond the arm's joints.
    pub external_axes: usize,
}

impl Bearing {
    /// Where a message shows the robot to be that is led so.
    pub fn new(reading: &Reading, lead: &Lead) -> Self {
        Self {
            position: reading.position,
            twist: lead.twist,
            follows: reading.follows,
            external_axes: reading.external_axes,
        }
    }
}

/// Joint speeds for one arm.
pub struct Guide {
    arm: Box<dyn AnyArm>,
    units: Vec<JointUnit>,
    speed_limit: [f64; MAX_JOINTS],
}

impl std::fmt::Debug for Guide {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Guide of {} joints", self.units.len())
    }
}

impl Guide {
    /// For an arm with these units of its joints and these limits of their speeds in rad/s or m/s.
    pub fn new(arm: Box<dyn AnyArm>, units: Vec<JointUnit>, speed_limit: [f64; MAX_JOINTS]) -> Self {
        Self { arm, units, speed_limit }
    }

    /// What each joint is given in on the robot's side.
    pub fn units(&self) -> &[JointUnit] {
        &self.units
    }

    /// The arm's kinematics.
    pub fn arm(&self) -> &dyn AnyArm {
        &*self.arm
    }

    /// `part` of q̇_ref = J⁻¹(q)(ṗ0 + Δṗ) in rad/s or m/s, within the limits; zeros when holding, when the robot does not
    /// follow, and where J has no inverse.
    pub fn speeds(&self, applied: &Applied, part: f64, bearing: &Bearing) -> [f64; MAX_JOINTS] {
        let Applied::Offset(offset) = applied else { return [0.0; MAX_JOINTS] };
        if !bearing.follows {
            return [0.0; MAX_JOINTS];
        }
        let twist = std::array::from_fn(|axis| bearing.twist[axis] + offset[axis]);
        let Some(mut speeds) = self.arm.joint_velocity(&bearing.position, &twist) else { return [0.0; MAX_JOINTS] };
        // All alike: the tool then goes where it was to go, slower.
        let excess = speeds.iter().zip(&self.speed_limit).map(|(speed, limit)| speed.abs() / limit).fold(1.0, f64::max);
        speeds.iter_mut().for_each(|speed| *speed *= part / excess);
        speeds
    }

    /// The message that says so.
    pub fn message(&self, sequence: u32, now_ns: u64, speeds: &[f64; MAX_JOINTS], external_axes: usize) -> EgmSensor {
        let joints = self.units.iter().zip(speeds).map(|(unit, speed)| unit.from_si(*speed)).collect();
        let external = (external_axes > 0).then(|| EgmJoints { joints: vec![0.0; external_axes] });
        EgmSensor {
            header: Some(EgmHeader {
                seqno: Some(sequence),
                // It wraps, as the robot's does.
                tm: Some((now_ns / 1_000_000) as u32),
                mtype: Some(MessageType::Correction as i32),
            }),
            // No position: with PosCorrGain 0 it would not count, and with another gain it would pull.
            planned: None,
            speed_ref: Some(EgmSpeedRef {
                joints: Some(EgmJoints { joints }),
                cartesians: None,
                external_joints: external,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use admittance_client::Rotation;

    /// Two joints that are the two axes.
    struct Table;

    impl AnyArm for Table {
        fn tool(&self, _: &[f64; MAX_JOINTS]) -> Rotation {
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        }

        fn twist(&self, _: &[f64; MAX_JOINTS], velocity: &[f64; MAX_JOINTS]) -> [f64; TASK_AXES] {
            std::array::from_fn(|axis| velocity[axis])
        }

        fn joint_velocity(&self, position: &[f64; MAX_JOINTS], twist: &[f64; TASK_AXES]) -> Option<[f64; MAX_JOINTS]> {
            let is_regular = position[0] == 0.0;
            is_regular.then(|| std::array::from_fn(|joint| twist.get(joint).copied().unwrap_or(0.0)))
        }
    }

    const BEARING: Bearing =
        Bearing { position: [0.0; MAX_JOINTS], twist: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], follows: true, external_axes: 1 };

    fn guide() -> Guide {
        let mut limits = [f64::INFINITY; MAX_JOINTS];
        limits[..2].fill(1.0);
        Guide::new(Box::new(Table), vec![JointUnit::Degree, JointUnit::Millimetre], limits)
    }

    fn offset(values: [f64; 2]) -> Applied {
        Applied::Offset([values[0], values[1], 0.0, 0.0, 0.0, 0.0])
    }

    #[test]
    fn the_offset_is_added_to_where_the_robot_is_led() {
        let speeds = guide().speeds(&offset([0.2, -0.4]), 1.0, &BEARING);
        assert!((speeds[0] - 0.3).abs() < 1e-15 && (speeds[1] + 0.4).abs() < 1e-15, "{speeds:?}");
    }

    #[test]
    fn above_a_limit_all_joints_slow_down_alike() {
        let speeds = guide().speeds(&offset([0.9, -4.0]), 1.0, &BEARING);
        assert!((speeds[0] - 0.25).abs() < 1e-15 && (speeds[1] + 1.0).abs() < 1e-15, "{speeds:?}");
    }

    #[test]
    fn a_part_is_one_of_what_the_limits_leave() {
        let speeds = guide().speeds(&offset([0.9, -4.0]), 0.5, &BEARING);
        assert!((speeds[0] - 0.125).abs() < 1e-15 && (speeds[1] + 0.5).abs() < 1e-15, "{speeds:?}");
        assert_eq!(guide().speeds(&offset([0.9, -4.0]), 0.0, &BEARING).map(f64::abs), [0.0; MAX_JOINTS]);
    }

    #[test]
    fn holding_or_not_following_or_singular_is_zero() {
        let still = [0.0; MAX_JOINTS];
        assert_eq!(guide().speeds(&Applied::Hold, 1.0, &BEARING), still);
        assert_eq!(guide().speeds(&offset([0.2, 0.2]), 1.0, &Bearing { follows: false, ..BEARING }), still);
        let mut singular = BEARING;
        singular.position[0] = 1.0;
        assert_eq!(guide().speeds(&offset([0.2, 0.2]), 1.0, &singular), still);
    }

    #[test]
    fn a_message_is_in_the_robots_units_for_all_its_axes() {
        let mut speeds = [0.0; MAX_JOINTS];
        speeds[..2].copy_from_slice(&[std::f64::consts::PI, 0.25]);
        let message = guide().message(9, 12_345_678_901, &speeds, 2);
        let header = message.header.expect("there");
        assert_eq!((header.seqno, header.tm, header.mtype), (Some(9), Some(12_345), Some(3)));
        let sent = message.speed_ref.expect("there");
        assert_eq!(sent.joints.expect("there").joints, [180.0, 250.0]);
        assert_eq!(sent.external_joints.expect("there").joints, [0.0, 0.0]);
        assert_eq!(message.planned, None);
    }
}
