//! The edge's own file. What it shares with the daemon (the arm, the cycle, where they meet) is in the daemon's file alone.

use std::net::{IpAddr, SocketAddr};

use admittance_host::config::ConfigError;
use admittance_host::realtime::RealtimeSection;
use admittance_host::{config_file, config_section};
use admittance_runner::config::Config;
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
    }
    cross_check addresses;
}

config_section! {
    /// The whole file.
    pub struct EdgeConfig {
        /// The robot on the other end.
        egm: EgmSection;
        /// How the thread runs that answers the robot.
        realtime: RealtimeSection;
    }
}

config_file!(EdgeConfig);

fn addresses(egm: &EgmSection, path: &str, errors: &mut Vec<ConfigError>) {
    if egm.listen.parse::<SocketAddr>().is_err() {
        let accepted = "an IP address and a port, such as \"0.0.0.0:6510\"";
        errors.push(ConfigError::new(format!("{path}.listen"), format!("{:?}", egm.listen), accepted));
    }
    if egm.robot_address.parse::<IpAddr>().is_err() {
        let accepted = "an IP address, such as \"192.168.125.1\"";
        errors.push(ConfigError::new(format!("{path}.robot_address"), format!("{:?}", egm.robot_address), accepted));
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
        let told = &self.joint_speed_limit_deg_s;
        if told.len() != units.len() {
            return Err(format!(
                "egm.joint_speed_limit_deg_s has {} values: accepted: {}, one for each [[robot.joint]] of the daemon's file",
                told.len(),
                units.len()
            ));
        }
        let mut limits = [f64::INFINITY; MAX_JOINTS];
        for ((limit, told), unit) in limits.iter_mut().zip(told).zip(units) {
            *limit = unit.to_si(*told);
        }
        Ok(limits)
    }
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
}
