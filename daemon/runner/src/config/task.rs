//! `[task]`: the frame whose directions the lists over task axes speak of.

use admittance_core::quantities::AXIS_NAMES;
use admittance_core::with_arm;
use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};
use nalgebra::Matrix3;

use super::plausibility::poses;
use super::{Config, ContactPointName, WrenchSourceName};
use crate::task_frame::TaskFrame;

config_enum! {
    /// The frame of the task: its directions x y z at the TCP.
    pub enum FrameName {
        /// The robot's base frame.
        Base = "base",
        /// A fixed frame: the base frame turned by rpy_rad.
        Rpy = "rpy",
        /// A fixed frame: z is environment.surface_normal, x is along the surface and as near to the
        /// base frame's x as that allows (to its y where the normal is along x).
        Surface = "surface",
        /// The frame of the TCP, as [robot.tool] has it: it turns with the tool, and is followed every
        /// cycle.
        Tool = "tool",
    }
}

config_section! {
    /// The directions of the task: of all lists over task axes, of limits, thresholds, weights, of
    /// the verdict, and of the wrench as the law sees it. State and command samples stay in the base
    /// frame, and so do positions and surface_normal in this file. Which directions give way say axes
    /// or contact.admittance_axes; the others follow the twist reference.
    pub struct TaskSection {
        /// Whose directions they are.
        frame: FrameName = FrameName::Base;
        /// With frame = "rpy": orientation of the task frame in the base frame: fixed-axis roll,
        /// pitch, yaw.
        rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
        /// The directions that give way, by their names, such as ["z"]: in place of
        /// contact.admittance_axes.
        axes: Option<Vec<String>>, length 1..=6;
    }
    cross_check rpy_is_used;
}

fn rpy_is_used(task: &TaskSection, path: &str, errors: &mut Vec<ConfigError>) {
    if task.frame != FrameName::Rpy && task.rpy_rad != [0.0; 3] {
        let accepted = format!("no such key, or {path}.frame = \"rpy\"");
        errors.push(ConfigError::new(format!("{path}.rpy_rad"), format!("{:?}", task.rpy_rad), accepted));
    }
}

impl Config {
    /// The directions of task.axes as contact.admittance_axes, where that is not given: everything else
    /// looks there.
    pub(super) fn with_named_axes(mut self) -> Self {
        if let (Some(axes), true) = (&self.task.axes, self.contact.admittance_axes.is_empty()) {
            self.contact.admittance_axes = gives_way(axes, self.robot.task_axes).collect();
        }
        self
    }
}

fn gives_way(axes: &[String], task_axes: u32) -> impl Iterator<Item = bool> {
    AXIS_NAMES.iter().take(task_axes as usize).map(|name| axes.iter().any(|axis| axis == name))
}

/// Which directions give way is said once, and of directions that the arm controls.
pub(super) fn check_gives_way(config: &Config, errors: &mut Vec<ConfigError>) {
    let (told, controlled) = (&config.contact.admittance_axes, config.robot.controlled());
    let Some(axes) = &config.task.axes else {
        for (axis, _) in told.iter().enumerate().filter(|(axis, gives_way)| **gives_way && !controlled.has(*axis)) {
            let accepted = "false on an axis that is not one of robot.controlled_axes";
            errors.push(ConfigError::new(format!("contact.admittance_axes[{axis}]"), true, accepted));
        }
        if !told.contains(&true) {
            let accepted = "at least one true; or task.axes with names, and no such key";
            let found = if told.is_empty() { "absent" } else { "all false" };
            errors.push(ConfigError::new("contact.admittance_axes", found, accepted));
        }
        return;
    };
    let known = AXIS_NAMES.iter().take(config.robot.task_axes as usize).enumerate();
    let known: Vec<&str> = known.filter(|(axis, _)| controlled.has(*axis)).map(|(_, name)| *name).collect();
    for (index, axis) in axes.iter().enumerate() {
        if !known.contains(&axis.as_str()) || axes[..index].contains(axis) {
            let accepted = format!("each once, of the directions that the arm controls: {}", known.join(" "));
            errors.push(ConfigError::new(format!("task.axes[{index}]"), format!("{axis:?}"), accepted));
        }
    }
    if !told.iter().copied().eq(gives_way(axes, config.robot.task_axes)) {
        let accepted = format!("no such key, since task.axes = {axes:?}");
        errors.push(ConfigError::new("contact.admittance_axes", format!("{told:?}"), accepted));
    }
}

/// How far in rad a direction may lean out of those that an arm controls: rounding.
const NEGLIGIBLE: f64 = 1e-9;

/// What a frame other than the base frame wants of the other sections.
pub(super) fn check_task_frame(config: &Config, errors: &mut Vec<ConfigError>) {
    let frame = config.task.frame;
    if frame == FrameName::Base {
        return;
    }
    let mut wants = |key: &str, found: String, accepted: &str| {
        errors.push(ConfigError::new(key, found, format!("{accepted} with task.frame = \"{frame}\"")));
    };
    // A replay that begins after earlier contacts has the point in the base frame, to the last bit.
    if config.environment.contact == ContactPointName::Detected {
        wants("environment.contact", "\"detected\"".to_owned(), "\"configured\"");
    }
    if config.environment.unknown_stiffness().is_some() {
        let found = format!("{:?}", config.environment.stiffness_range_n_m.unwrap_or_default());
        wants("environment.stiffness_range_n_m", found, "no such key");
    }
    if config.wrench.source == WrenchSourceName::MotorTorque {
        wants("wrench.source", "\"motor_torque\"".to_owned(), "\"sample\"");
    }
    if frame == FrameName::Tool {
        let lags = &config.contact.wrench_time_constant_s;
        let differs = |half: &[f64]| half.iter().any(|lag| *lag != half[0]);
        if lags.chunks(3).any(differs) {
            let accepted = "one value for x y z and one for rx ry rz: what the filter remembers turns with the tool,";
            wants("contact.wrench_time_constant_s", format!("{lags:?}"), accepted);
        }
    }
    if let Some(leans) = leaning(config) {
        let accepted = format!(
            "\"base\", or a frame whose directions the arm can control each by itself: its {leans} is not along those of the \
             base frame that robot.task_axes and robot.controlled_axes name"
        );
        errors.push(ConfigError::new("task.frame", format!("\"{frame}\""), accepted));
    }
}

/// A controlled direction of the frame that leans out of the arm's own, by its name.
fn leaning(config: &Config) -> Option<&'static str> {
    let (controlled, axes) = (config.robot.controlled(), config.robot.task_axes as usize);
    let has = |axis: usize| axis < axes && controlled.has(axis);
    let frames = match config.task.frame {
        FrameName::Tool => tool_frames(config),
        FrameName::Base | FrameName::Rpy | FrameName::Surface => {
            TaskFrame::of(config).axes().copied().into_iter().collect()
        }
    };
    let leans = |of: usize| {
        let (direction, first) = (of % 3, of - of % 3);
        (0..3)
            .filter(|other| has(of) && !has(first + other))
            .any(|other| frames.iter().any(|frame| frame[(other, direction)].abs() > NEGLIGIBLE))
    };
    (0..AXIS_NAMES.len()).find(|axis| leans(*axis)).map(|axis| AXIS_NAMES[axis])
}

/// How the tool may stand.
fn tool_frames(config: &Config) -> Vec<Matrix3<f64>> {
    fn of<const N: usize>(config: &Config) -> Option<Vec<Matrix3<f64>>> {
        let chain = config.robot.chain::<N>()?;
        Some(poses::<N>().map(|position| chain.kinematics(&position).pose.rotation).collect())
    }
    let (joints, axes) = (config.robot.joint.len(), config.robot.task_axes);
    with_arm!((joints, axes), <N, _D> => of::<N>(config), else None).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;

    /// The errors of a file with these texts replaced.
    fn errors(text: &str, changes: &[(&str, &str)]) -> String {
        let mut text = text.to_owned();
        for (old, new) in changes {
            assert!(text.contains(old), "{old}");
            text = text.replacen(old, new, 1);
        }
        parse::<Config>(&text, "changed.toml").map_or_else(|error| error.to_string(), |_| String::new())
    }

    const SIX: &str = include_str!("../../../../deploy/robots/six-joint.toml");
    const SCARA: &str = include_str!("../../../../deploy/robots/scara.toml");
    const PLANAR: &str = include_str!("../../../../deploy/demo/mpc-default.toml");

    fn framed(task: &str) -> String {
        format!("[task]\n{task}\n[control]")
    }

    #[test]
    fn every_frame_is_accepted_where_the_arm_can_have_it() {
        for task in [
            "frame = \"base\"",
            "frame = \"surface\"",
            "frame = \"tool\"",
            "frame = \"rpy\"\nrpy_rad = [0.1, 0.2, 3.0]",
        ] {
            assert_eq!(errors(SIX, &[("[control]", &framed(task))]), "", "{task}");
        }
        // About the axis that it has.
        for text in [SCARA, PLANAR] {
            assert_eq!(errors(text, &[("[control]", &framed("frame = \"rpy\"\nrpy_rad = [0.0, 0.0, 0.3]"))]), "");
            assert_eq!(errors(text, &[("[control]", &framed("frame = \"tool\""))]), "");
        }
    }

    const GIVES_WAY: &str = "admittance_axes = [true, true, true, false, false, false]\n";

    #[test]
    fn directions_that_give_way_may_be_named() {
        let named = |axes: &str| framed(&format!("frame = \"tool\"\naxes = {axes}"));
        let text = SIX.replacen(GIVES_WAY, "", 1).replacen("[control]", &named("[\"rx\", \"z\"]"), 1);
        let config: Config = parse(&text, "named.toml").unwrap_or_else(|errors| panic!("{errors}"));
        assert_eq!(config.contact.admittance_axes, [false, false, true, true, false, false]);
        // The same again is nothing wrong, and anything else is.
        assert_eq!(errors(SIX, &[("[control]", &named("[\"x\", \"y\", \"z\"]"))]), "");
        for (axes, list, parts) in [
            (
                "[\"z\"]",
                GIVES_WAY,
                &["contact.admittance_axes = [true, ", "no such key, since task.axes = [\"z\"]"][..],
            ),
            ("[\"z\", \"up\"]", "", &["task.axes[1] = \"up\"", "x y z rx ry rz"]),
            ("[\"z\", \"z\"]", "", &["task.axes[1] = \"z\"", "each once"]),
            ("[]", "", &["task.axes = []", "1 to 6"]),
        ] {
            let found = errors(SIX, &[(GIVES_WAY, list), ("[control]", &named(axes))]);
            parts.iter().for_each(|part| assert!(found.contains(part), "{part}: {found:?}"));
        }
        let found = errors(SIX, &[(GIVES_WAY, "")]);
        assert!(found.contains("contact.admittance_axes = absent") && found.contains("task.axes"), "{found:?}");
        let frame = framed("axes = [\"rx\"]");
        let found = errors(SCARA, &[(GIVES_WAY, ""), ("[control]", &frame)]);
        assert!(found.contains("task.axes[0] = \"rx\"") && found.contains("controls: x y z rz"), "{found:?}");
    }

    #[test]
    fn what_a_frame_cannot_have_is_named() {
        let wants = |text: &str, changes: &[(&str, &str)], parts: &[&str]| {
            let found = errors(text, changes);
            parts.iter().for_each(|part| assert!(found.contains(part), "{part}: {found:?}"));
        };
        let tool = framed("frame = \"tool\"");
        let tool = ("[control]", tool.as_str());
        wants(
            SIX,
            &[("[control]", &framed("frame = \"flange\""))],
            &["task.frame", "flange", "\"surface\" or \"tool\""],
        );
        let rpy = framed("frame = \"tool\"\nrpy_rad = [0.1, 0.0, 0.0]");
        wants(SIX, &[("[control]", &rpy)], &["task.rpy_rad = [0.1, 0.0, 0.0]", "task.frame = \"rpy\""]);
        wants(SIX, &[("[control]", &framed("frame = \"rpy\"\nrpy_rad = [0.1, nan, 0.0]"))], &["task.rpy_rad[1]"]);
        let detected = ("[environment]\n", "[environment]\ncontact = \"detected\"\n");
        wants(SIX, &[tool, detected], &["environment.contact = \"detected\"", "with task.frame = \"tool\""]);
        let range =
            ("[environment]\n", "[environment]\nstiffness_range_n_m = [1e4, 5e5]\ncontact_tolerance_m = 0.001\n");
        wants(SIX, &[tool, range], &["environment.stiffness_range_n_m", "no such key with task.frame"]);
        wants(SIX, &[tool, ("[wrench]", "[wrench]\nsource = \"motor_torque\"")], &["wrench.source", "\"sample\" with"]);
        let lags = ("wrench_time_constant_s = [0.02, 0.02, 0.02,", "wrench_time_constant_s = [0.02, 0.02, 0.01,");
        wants(SIX, &[tool, lags], &["contact.wrench_time_constant_s", "one value for x y z"]);
        // A fixed frame keeps its filters where they are.
        assert_eq!(errors(SIX, &[("[control]", &framed("frame = \"surface\"")), lags]), "");
        // Tilted, of an arm that cannot tilt.
        for text in [SCARA, PLANAR] {
            let tilted = framed("frame = \"rpy\"\nrpy_rad = [0.2, 0.0, 0.0]");
            wants(text, &[("[control]", &tilted)], &["task.frame = \"rpy\"", "robot.controlled_axes"]);
        }
        wants(PLANAR, &[("[control]", &framed("frame = \"surface\""))], &["task.frame = \"surface\"", "its y"]);
    }
}
