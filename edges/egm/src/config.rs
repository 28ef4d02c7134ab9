//! The edge's own file. What it shares with the daemon (the arm, the cycle, where they meet) is in the daemon's file alone.

use std::net::{IpAddr, SocketAddr};

use admittance_host::config::ConfigError;
use admittance_host::realtime::RealtimeSection;
use admittance_host::twist_section::TwistSection;
use admittance_host::{config_file, config_section};
use admittance_runner::config::{Config, WrenchSourceName};
use egm_messages::JointUnit;
use ipc_types::MAX_JOINTS;

config_section! {
    /// The robot on the other end.
    pub struct EgmSection {
        /// Where the robot's messages are awaited: an address of this host, and a UDP port.
        listen: String = "0.0.0.0:6510".to_owned(), length 1..=64;
        /// The address that the robot sends from; what comes from elsewhere is not looked at.
        robot_address: String, length 1..=64;
        /// The fastest that each joint may be told to move, base first; of a prismatic joint in mm/s. Speeds above are
        /// brought down, all joints alike. A message in which a joint moves half as fast again is not believed.
        joint_speed_limit_deg_s: Vec<f64>, unit "deg/s, mm/s", range 0.1..=10000.0, length 2..=8;
        /// What the robot's torqueRef is multiplied by, one value for each joint, base first, to be the torque of its motor
        /// in N m on the joint's side, positive the way the joint turns: 1 where the robot gives just that, the gear
        /// ratio where it gives the motor's own torque, a negative value where it counts the other way. Required with
        /// wrench.source = "motor_torque" of the daemon's file; torqueRef is not looked at when absent.
        torque_factor: Option<Vec<f64>>, unit "1", range -10000.0..=10000.0, length 2..=8;
    }
    cross_check addresses_and_factors;
}

config_section! {
    /// The whole file.
    pub struct EdgeConfig {
        /// The robot on the other end.
        egm: EgmSection;
        /// Other programs lead the arm; when absent the robot's own program does, by planned.joints.
        twist: Option<TwistSection>;
        /// How the thread runs that answers the robot.
        realtime: RealtimeSection;
    }
}

config_file!(EdgeConfig);

fn addresses_and_factors(egm: &EgmSection, path: &str, errors: &mut Vec<ConfigError>) {
    if egm.listen.parse::<SocketAddr>().is_err() {
        let accepted = "an IP address and a port, such as \"0.0.0.0:6510\"";
        errors.push(ConfigError::new(format!("{path}.listen"), format!("{:?}", egm.listen), accepted));
    }
    if egm.robot_address.parse::<IpAddr>().is_err() {
        let accepted = "an IP address, such as \"192.168.125.1\"";
        errors.push(ConfigError::new(format!("{path}.robot_address"), format!("{:?}", egm.robot_address), accepted));
    }
    for (joint, factor) in egm.torque_factor.iter().flatten().enumerate() {
        if *factor == 0.0 {
            let accepted = "any value but 0, which would leave nothing of the torque";
            errors.push(ConfigError::new(format!("{path}.torque_factor[{joint}]"), "0".to_owned(), accepted));
        }
    }
}

/// What each joint of the daemon's arm is given in on the robot's side.
pub fn units(daemon: &Config) -> Vec<JointUnit> {
    let unit = |joint: &admittance_host::robot_description::JointDescription| match joint.kind {
        admittance_host::robot_description::KindName::Revolute => JointUnit::Degree,
        admittance_host::robot_description::KindName::Prismatic => JointUnit::Millimetre,
    };
    daemon.robot.joint.iter().map(unit).collect()
}

impl EgmSection {
    /// The speed limits in rad/s or m/s, for joints in these units.
    ///
    /// # Errors
    /// A sentence, when there is not one for each joint of the daemon's arm.
    pub fn speed_limit(&self, units: &[JointUnit]) -> Result<[f64; MAX_JOINTS], String> {
        let told = one_per_joint("egm.joint_speed_limit_deg_s", &self.joint_speed_limit_deg_s, units.len())?;
        let mut limits = [f64::INFINITY; MAX_JOINTS];
        for ((limit, told), unit) in limits.iter_mut().zip(told).zip(units) {
            *limit = unit.to_si(*told);
        }
        Ok(limits)
    }

    /// What torqueRef is multiplied by; `None` where it is not looked at.
    ///
    /// # Errors
    /// A sentence, when there is not one for each of the joints, or none though the daemon needs torques.
    pub fn torque_factors(&self, joints: usize, source: WrenchSourceName) -> Result<Option<[f64; MAX_JOINTS]>, String> {
        match &self.torque_factor {
            Some(told) => {
                let told = one_per_joint("egm.torque_factor", told, joints)?;
                Ok(Some(std::array::from_fn(|joint| told.get(joint).copied().unwrap_or(0.0))))
            }
            None if source == WrenchSourceName::MotorTorque => Err(format!(
                "egm.torque_factor is absent: accepted: {joints} values, since wrench.source = \"motor_torque\" in the daemon's \
                 file, and without them no torque reaches it"
            )),
            None => Ok(None),
        }
    }
}

fn one_per_joint<'a>(key: &str, told: &'a [f64], joints: usize) -> Result<&'a [f64], String> {
    if told.len() == joints {
        return Ok(told);
    }
    let found = told.len();
    Err(format!("{key} has {found} values: accepted: {joints}, one for each [[robot.joint]] of the daemon's file"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use admittance_host::config::parse;

    const TEXT: &str = "[egm]\nrobot_address = \"192.168.125.1\"\njoint_speed_limit_deg_s = [90.0, 90.0]\n";

    #[test]
    fn what_is_wrong_is_named_with_what_is_accepted() {
        let sound: EdgeConfig = parse(TEXT, "edge.toml").expect("valid");
        assert_eq!(sound.egm.listen, "0.0.0.0:6510");
        let cases = [
            ("[egm]\nlisten = \"6510\"", "egm.listen = \"6510\""),
            ("[egm]\nport = 6510", "egm.port"),
            ("robot_address = \"robot\"", "egm.robot_address = \"robot\""),
            ("joint_speed_limit_deg_s = [0.0, 1.0]", "egm.joint_speed_limit_deg_s[0] = 0"),
            ("torque_factor = [1.0, 0.0]", "egm.torque_factor[1] = 0"),
        ];
        for (line, expected) in cases {
            let key = line.rsplit('\n').next().and_then(|line| line.split(' ').next()).unwrap_or_default();
            let kept: String = TEXT.lines().filter(|known| !known.starts_with(key)).map(|l| format!("{l}\n")).collect();
            let text = match line.strip_prefix("[egm]\n") {
                Some(line) => kept.replacen("[egm]", &format!("[egm]\n{line}"), 1),
                None => format!("{kept}{line}\n"),
            };
            let error = parse::<EdgeConfig>(&text, "edge.toml").expect_err(expected).to_string();
            assert!(error.contains(expected) && error.contains("accepted"), "{error}");
        }
    }

    #[test]
    fn limits_are_one_for_each_joint_in_its_unit() {
        let egm = parse::<EdgeConfig>(TEXT, "edge.toml").expect("valid").egm;
        let limits = egm.speed_limit(&[JointUnit::Degree, JointUnit::Millimetre]).expect("two");
        assert!((limits[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!((limits[1] - 0.09).abs() < 1e-15);
        assert!(egm.speed_limit(&[JointUnit::Degree; 6]).expect_err("six").contains("has 2 values: accepted: 6"));
    }

    #[test]
    fn who_needs_torques_is_to_say_what_they_are() {
        use WrenchSourceName::{MotorTorque, Sample};
        let egm = |more: &str| parse::<EdgeConfig>(&format!("{TEXT}{more}"), "edge.toml").expect("valid").egm;
        assert_eq!(egm("").torque_factors(2, Sample), Ok(None));
        let absent = egm("").torque_factors(2, MotorTorque).expect_err("nobody knows what they are");
        assert!(absent.contains("egm.torque_factor is absent: accepted: 2 values"), "{absent}");
        let told = egm("torque_factor = [101.0, -1.0]\n");
        for source in [Sample, MotorTorque] {
            let factors = told.torque_factors(2, source).expect("two").expect("told");
            assert_eq!(factors[..3], [101.0, -1.0, 0.0]);
        }
        assert!(told.torque_factors(6, Sample).expect_err("six").contains("has 2 values: accepted: 6"));
    }
}
