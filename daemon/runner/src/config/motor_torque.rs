//! What a wrench from motor torques wants of the other sections.

use admittance_host::config::ConfigError;
use admittance_host::robot_description::KindName;

use super::{Config, ContactPointName, GivenInName, GivenSignName, LawName, WrenchSourceName};

/// Checks that the observer has its masses and q̇ as it is, and that nothing is told of a
/// wrench that is not looked at.
pub(super) fn check_motor_torque(config: &Config, errors: &mut Vec<ConfigError>) {
    let wrench = &config.wrench;
    if wrench.source != WrenchSourceName::MotorTorque {
        return;
    }
    let mut wants = |key: &str, found: String, accepted: &str| {
        errors.push(ConfigError::new(key, found, format!("{accepted}, since wrench.source = \"motor_torque\"")));
    };
    if config.dynamics.is_none() {
        wants("dynamics", "absent".to_owned(), "a [dynamics] section with masses and friction of every joint");
    }
    if config.robot.joint.iter().any(|joint| joint.kind == KindName::Prismatic) {
        wants("robot.joint.kind", "\"prismatic\"".to_owned(), "\"revolute\": friction is told for joints that turn");
    }
    if config.robot.controlled_axes.is_some() {
        // What presses on an axis that is not controlled loads the joints as well.
        wants("robot.controlled_axes", "given".to_owned(), "no such key, all axes");
    }
    if config.control.law == LawName::Damping {
        // It follows f̂ in the air too, where f̂ is what friction and masses are off by.
        wants("control.law", "\"damping\"".to_owned(), "\"mpc\"");
    }
    if config.environment.contact == ContactPointName::Detected {
        wants("environment.contact", "\"detected\"".to_owned(), "\"configured\": what is lasting is no noise");
    }
    if let Some(range) = config.environment.stiffness_range_n_m.filter(|range| range[0] < range[1]) {
        wants("environment.stiffness_range_n_m", format!("{range:?}"), "a range of length zero, or no such key");
    }
    if config.robot.report_lag_s() > 0.0 {
        wants("robot.velocity_loop.report_lag_s", format!("{}", config.robot.report_lag_s()), "0");
    }
    if wrench.given_in != GivenInName::Base {
        wants("wrench.given_in", "\"sensor\"".to_owned(), "\"base\"");
    }
    if wrench.sign != GivenSignName::OnEnvironment {
        wants("wrench.sign", "\"reaction\"".to_owned(), "\"on_environment\"");
    }
    if wrench.bias != [0.0; 6] {
        wants("wrench.bias", format!("{:?}", wrench.bias), "no such key");
    }
    if let Some(saturation) = &wrench.saturation {
        wants("wrench.saturation", format!("{saturation:?}"), "no such key");
    }
    if wrench.tool_mass_kg > 0.0 {
        wants("wrench.tool_mass_kg", format!("{}", wrench.tool_mass_kg), "0: the tool belongs to the last link");
    }
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;

    const NOTHING: (&str, &str) = ("[wrench]", "[wrench]");

    /// The six-joint arm with its wrench from torques, masses of so many joints, and this text in the
    /// place of that; its errors, if any.
    fn error(joints: usize, (old, new): (&str, &str)) -> String {
        let text = include_str!("../../../../deploy/robots/six-joint.toml");
        let mut text = text.replace("[wrench]", "[wrench]\nsource = \"motor_torque\"").replace("saturation = ", "# ");
        for _ in 0..joints {
            text += "\n[[dynamics.joint]]\nmass_kg = 2.0\ncenter_of_gravity_m = [0.0, 0.0, 0.1]\n\
                     inertia_kg_m2 = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]\nviscous_friction_n_m_s_rad = 1.0\n\
                     coulomb_friction_n_m = 2.0\n";
        }
        assert!(text.contains(old), "{old}");
        parse::<Config>(&text.replace(old, new), "six-joint.toml")
            .map_or_else(|error| error.to_string(), |_| String::new())
    }

    #[test]
    fn it_wants_masses_friction_one_lag_and_no_sensor() {
        assert_eq!(error(6, NOTHING), "");
        let wants =
            |found: String, parts: &[&str]| parts.iter().for_each(|part| assert!(found.contains(part), "{found}"));
        wants(error(0, NOTHING), &["dynamics", "absent", "masses and friction of every joint"]);
        wants(error(5, NOTHING), &["dynamics.joint", "5 tables", "6 tables"]);
        wants(error(6, ("coulomb_friction_n_m = 2.0\n", "")), &["dynamics.joint[0].coulomb_friction_n_m"]);
        wants(error(6, ("0.1, 0.1, 0.1, 0.0", "0.1, 0.1, 0.3, 0.0")), &["dynamics.joint[0].inertia_kg_m2"]);
        let lags = ("wrench_time_constant_s = [0.02, 0.02,", "wrench_time_constant_s = [0.02, 0.01,");
        wants(error(6, lags), &["contact.wrench_time_constant_s", "above 0 s on all axes"]);
        wants(error(6, ("sign = \"on_environment\"", "sign = \"reaction\"")), &["wrench.sign", "on_environment"]);
        let tool = ("tool_mass_kg = 0.0", "tool_mass_kg = 1.0");
        wants(error(6, tool), &["wrench.tool_mass_kg", "belongs to the last link"]);
        let slides = ("[[robot.joint]]\n", "[[robot.joint]]\nkind = \"prismatic\"\n");
        wants(error(6, slides), &["robot.joint.kind", "joints that turn"]);
        let axes = ("[robot]\n", "[robot]\ncontrolled_axes = [\"z\"]\n");
        wants(error(6, axes), &["robot.controlled_axes", "all axes"]);
        let range =
            ("[environment]\n", "[environment]\nstiffness_range_n_m = [1e4, 5e5]\ncontact_tolerance_m = 0.001\n");
        wants(error(6, range), &["environment.stiffness_range_n_m", "length zero"]);
        // Without it nobody asks.
        assert_eq!(error(0, ("source = \"motor_torque\"", "source = \"sample\"")), "");
    }
}
