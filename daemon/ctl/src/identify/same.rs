//! Whether recordings are of one arm with one sensor, and each of them of another motion.

use std::fmt::Debug;
use std::path::Path;

use admittance_runner::config::Config;

use super::track::Track;

/// What both recordings have to be alike in, and is not: key, and both values.
struct Difference {
    key: String,
    found: String,
    accepted: String,
}

/// Checks a recording's configuration against that of the first one. Keys that are to be found may
/// differ: commissioning puts them in between two recordings.
pub(super) fn check_arm(path: &Path, first: &Config, own: &Config) -> Result<(), String> {
    let Some(Difference { key, found, accepted }) = difference(first, own) else { return Ok(()) };
    Err(format!("{}: {key} = {found}: accepted is {accepted}, as in the first recording", path.display()))
}

fn difference(first: &Config, own: &Config) -> Option<Difference> {
    let mut all = Vec::new();
    let mut add = |key: String, found: &dyn Debug, accepted: &dyn Debug| {
        all.push(Difference { key, found: format!("{found:?}"), accepted: format!("{accepted:?}") });
    };
    add("control.sampling_time_s".to_owned(), &own.control.sampling_time_s, &first.control.sampling_time_s);
    add("robot.task_axes".to_owned(), &own.robot.task_axes, &first.robot.task_axes);
    add(
        "robot.joint".to_owned(),
        &format_args!("{} joints", own.robot.joint.len()),
        &format_args!("{} joints", first.robot.joint.len()),
    );
    for (number, (own, first)) in own.robot.joint.iter().zip(&first.robot.joint).enumerate() {
        let key = |name: &str| format!("robot.joint[{number}].{name}");
        add(key("origin_m"), &own.origin_m, &first.origin_m);
        add(key("origin_rpy_rad"), &own.origin_rpy_rad, &first.origin_rpy_rad);
        add(key("axis"), &own.axis, &first.axis);
    }
    let (tool, first_tool) = (&own.robot.tool, &first.robot.tool);
    add("robot.tool.origin_m".to_owned(), &tool.origin_m, &first_tool.origin_m);
    add("robot.tool.origin_rpy_rad".to_owned(), &tool.origin_rpy_rad, &first_tool.origin_rpy_rad);
    let (wrench, first_wrench) = (&own.wrench, &first.wrench);
    add("wrench.given_in".to_owned(), &wrench.given_in, &first_wrench.given_in);
    add("wrench.sign".to_owned(), &wrench.sign, &first_wrench.sign);
    add("wrench.sensor_origin_m".to_owned(), &wrench.sensor_origin_m, &first_wrench.sensor_origin_m);
    add("wrench.sensor_rpy_rad".to_owned(), &wrench.sensor_rpy_rad, &first_wrench.sensor_rpy_rad);
    add("wrench.saturation".to_owned(), &wrench.saturation, &first_wrench.saturation);
    add("wrench.gravity_m_s2".to_owned(), &wrench.gravity_m_s2, &first_wrench.gravity_m_s2);
    let normal = |config: &Config| config.environment.surface_normal;
    add("environment.surface_normal".to_owned(), &normal(own), &normal(first));
    all.into_iter().find(|one| one.found != one.accepted)
}

/// Checks that none of a recording's samples is in what was read already: they would count twice.
pub(super) fn check_new(path: &Path, read: &[Track], new: &[Track]) -> Result<(), String> {
    if new.iter().any(|new| read.iter().any(|read| read.overlaps(new))) {
        let accepted = "accepted are recordings of different motions";
        return Err(format!(
            "{}: the motion in it was given already, under this name or another: {accepted}",
            path.display()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;

    #[test]
    fn another_arm_or_sensor_is_named_and_what_is_to_be_found_may_differ() {
        let text = include_str!("../../../../deploy/robots/six-joint.toml");
        let config = |text: &str| -> Config { parse(text, "test").expect("a configuration") };
        let said = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            check_arm(Path::new("b.mcap"), &config(text), &config(&text.replacen(from, to, 1)))
        };
        assert_eq!(said("tool_mass_kg = 0.0", "tool_mass_kg = 1.0"), Ok(()));
        assert_eq!(said("normal_stiffness_n_m = 1e5", "normal_stiffness_n_m = 2e5"), Ok(()));
        for (from, to, expected) in [
            (
                "origin_m = [0.0, 0.0, 0.15]",
                "origin_m = [0.0, 0.0, 0.16]",
                "robot.tool.origin_m = [0.0, 0.0, 0.16]: accepted is [0.0, 0.0, 0.15]",
            ),
            ("origin_m = [0.0, 0.0, 0.1807]", "origin_m = [0.0, 0.0, 0.18]", "robot.joint[0].origin_m = "),
            (
                "sign = \"on_environment\"",
                "sign = \"reaction\"",
                "b.mcap: wrench.sign = Reaction: accepted is OnEnvironment",
            ),
        ] {
            let why = said(from, to).expect_err("refused");
            assert!(why.contains(expected), "{why}");
        }
    }
}
