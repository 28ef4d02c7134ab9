//! `[redundancy]`: which joint velocity an arm takes for a twist (remark 1 of the paper).

use admittance_core::redundancy::{Aim, Redundancy};
use admittance_core::robot::{InverseDamping, Resolution};
use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};
use nalgebra::SVector;

use super::{Config, WeightSpace};

config_enum! {
    /// Which of the joint velocities that bring about a twist is taken.
    pub enum ResolutionName {
        /// That of least Euclidean norm, which adds rad/s and m/s where some joints slide.
        LeastNorm = "least_norm",
        /// That of least norm with a weight for each joint.
        Weighted = "weighted",
        /// The same, and beside the task the joints go to a posture.
        Posture = "posture",
        /// The same, and beside the task the joints do what they are commanded.
        Keep = "keep",
    }
}

config_section! {
    /// What the joints do that the twist leaves open: of an arm with more joints than controlled axes.
    /// Without these keys the motion controller resolves twists itself, by the least norm; with any
    /// of them the daemon does, and the motion controller has to follow joint velocities.
    pub struct RedundancySection {
        /// Which joint velocity is taken.
        resolution: ResolutionName = ResolutionName::LeastNorm;
        /// What a joint's velocity costs, relative to the others; required with resolution = "weighted", and
        /// all alike when absent from "posture" and "keep".
        joint_weights: Option<Vec<f64>>, unit "1", range 1e-6..=1e6, length 2..=8;
        /// With resolution = "posture": where the joints go beside the task.
        posture_rad: Option<Vec<f64>>, unit "rad, m", range -100.0..=100.0, length 2..=8;
        /// With resolution = "posture": part of the way to it per second; 1 when absent.
        posture_gain_1_s: Option<f64>, unit "1/s", range 0.01..=20.0;
        /// How far from limits.joint_position_min_rad and .._max_rad each joint is kept as long as others can
        /// move in its place. When absent from another resolution than "least_norm": 0.1 rad or m,
        /// and at most a tenth of the joint's range. 0 keeps it to the limit itself.
        limit_margin_rad: Option<Vec<f64>>, unit "rad, m", range 0.0..=10.0, length 2..=8;
        /// Largest part of each joint's limits.joint_speed_rad_s that such a motion takes; one that is
        /// commanded is not counted, and keeping joints from their limits may take all of it.
        speed_share: f64 = 0.25, unit "1", range 0.01..=0.9;
        /// By how much such a motion changes at most. Where limits.joint_acceleration_rad_s2 and
        /// joint_jerk_rad_s3 are told it has what the twist leaves of them besides.
        acceleration_rad_s2: f64 = 2.0, unit "rad/s^2, m/s^2", range 0.01..=1000.0;
        /// Damps J⁻¹ near singular poses: joints stay slower, and the TCP moves less than it is told. The square
        /// of λ at a singular pose, in the units of J, is that of this.
        damping_factor: Option<f64>, unit "m, 1", range 1e-6..=1.0;
        /// With damping_factor: reciprocal condition number of J below which it acts.
        damping_below: Option<f64>, unit "1", range 1e-6..=0.3;
    }
    cross_check what_is_used;
}

/// Part of a joint's range, and rad or m, of the margin that nobody chose.
const DEFAULT_MARGIN: (f64, f64) = (0.1, 0.1);
/// Gain that nobody chose, 1/s.
const DEFAULT_GAIN_1_S: f64 = 1.0;

/// Keys that belong to another resolution.
fn what_is_used(section: &RedundancySection, path: &str, errors: &mut Vec<ConfigError>) {
    let resolution = section.resolution;
    let mut wants = |key: &str, found: String, accepted: String| {
        errors.push(ConfigError::new(format!("{path}.{key}"), found, accepted));
    };
    let is_posture = resolution == ResolutionName::Posture;
    if let Some(weights) = section.joint_weights.as_ref().filter(|_| resolution == ResolutionName::LeastNorm) {
        let accepted = format!("no such key, or {path}.resolution = \"weighted\", \"posture\" or \"keep\"");
        wants("joint_weights", format!("{weights:?}"), accepted);
    }
    if section.joint_weights.is_none() && resolution == ResolutionName::Weighted {
        wants(
            "joint_weights",
            "absent".to_owned(),
            format!("one value for each joint with {path}.resolution = \"weighted\""),
        );
    }
    if let Some(posture) = section.posture_rad.as_ref().filter(|_| !is_posture) {
        wants("posture_rad", format!("{posture:?}"), format!("no such key, or {path}.resolution = \"posture\""));
    }
    if section.posture_rad.is_none() && is_posture {
        wants(
            "posture_rad",
            "absent".to_owned(),
            format!("one value for each joint with {path}.resolution = \"posture\""),
        );
    }
    if let Some(gain) = section.posture_gain_1_s.filter(|_| !is_posture) {
        wants("posture_gain_1_s", gain.to_string(), format!("no such key, or {path}.resolution = \"posture\""));
    }
    match (section.damping_factor, section.damping_below) {
        (Some(_), None) => {
            wants(
                "damping_below",
                "absent".to_owned(),
                format!("a reciprocal condition number, with {path}.damping_factor"),
            );
        }
        (None, Some(below)) => {
            wants("damping_below", below.to_string(), format!("no such key, or {path}.damping_factor too"))
        }
        (Some(_), Some(_)) | (None, None) => {}
    }
}

/// What the redundancy wants of the other sections.
pub(super) fn check_redundancy(config: &Config, errors: &mut Vec<ConfigError>) {
    let (section, joints) = (&config.redundancy, config.robot.joint.len());
    let mut wants = |key: &str, found: String, accepted: String| errors.push(ConfigError::new(key, found, accepted));
    let lists = [
        ("redundancy.joint_weights", &section.joint_weights),
        ("redundancy.posture_rad", &section.posture_rad),
        ("redundancy.limit_margin_rad", &section.limit_margin_rad),
    ];
    for (key, list) in lists {
        if let Some(list) = list.as_ref().filter(|list| list.len() != joints) {
            wants(key, format!("{} values", list.len()), format!("{joints} values, one for each joint"));
        }
    }
    let controlled = (0..config.robot.task_axes as usize).filter(|axis| config.robot.controlled().has(*axis)).count();
    if section.is_beside() && joints <= controlled {
        let found = match section.resolution {
            ResolutionName::LeastNorm => "limit_margin_rad".to_owned(),
            resolution => format!("\"{resolution}\""),
        };
        let accepted = format!(
            "\"least_norm\" without limit_margin_rad of an arm of {joints} joints that controls {controlled} axes: none is left \
             to choose (robot.controlled_axes)"
        );
        wants("redundancy.resolution", found, accepted);
    }
    let limits = config.limits.joint_position_min_rad.as_ref().zip(config.limits.joint_position_max_rad.as_ref());
    if let (Some(margin), None) = (&section.limit_margin_rad, limits) {
        let accepted = "no such key, or limits.joint_position_min_rad and limits.joint_position_max_rad";
        wants("redundancy.limit_margin_rad", format!("{margin:?}"), accepted.to_owned());
    }
    for (joint, (min, max)) in limits.map(|(min, max)| min.iter().zip(max)).into_iter().flatten().enumerate() {
        if let Some(margin) = section.limit_margin_rad.as_ref().and_then(|margin| margin.get(joint))
            && 2.0 * margin >= max - min
        {
            let accepted = format!(
                "below {}, half of the way between limits.joint_position_min_rad and .._max_rad",
                0.5 * (max - min)
            );
            wants(&format!("redundancy.limit_margin_rad[{joint}]"), margin.to_string(), accepted);
        }
        if let Some(posture) = section.posture_rad.as_ref().and_then(|posture| posture.get(joint))
            && !(min..=max).contains(&posture)
        {
            let accepted = format!("{min} to {max}, as limits.joint_position_min_rad and .._max_rad have it");
            wants(&format!("redundancy.posture_rad[{joint}]"), posture.to_string(), accepted);
        }
    }
    let least = config.control.minimum_reciprocal_condition;
    if let Some(below) = section.damping_below.filter(|below| *below <= least) {
        let accepted = format!("above control.minimum_reciprocal_condition = {least}, below which the arm is stopped");
        wants("redundancy.damping_below", below.to_string(), accepted);
    }
    if let (Some(factor), Some(_)) = (section.damping_factor, &config.limits.joint_acceleration_rad_s2) {
        // References are ramped by twists, of which a damped inverse leaves a part undone.
        let accepted = "no such key with limits.joint_acceleration_rad_s2";
        wants("redundancy.damping_factor", factor.to_string(), accepted.to_owned());
    }
    // The commanded position is of another resolution: what the joints do here is no way off it.
    if section.is_told() && config.mpc.weights == WeightSpace::Joint {
        wants("mpc.weights", "\"joint\"".to_owned(), "\"task\" with [redundancy]".to_owned());
    }
    if section.is_told() && config.mpc.position_weight.iter().any(|weight| *weight != 0.0) {
        let found = format!("{:?}", config.mpc.position_weight);
        wants("mpc.position_weight", found, "0 throughout with [redundancy]".to_owned());
    }
}

impl RedundancySection {
    /// Whether the daemon resolves twists, and not the motion controller.
    pub fn is_told(&self) -> bool {
        self.is_beside() || self.damping_factor.is_some()
    }

    /// Whether the joints may do something beside the task, or the task otherwise than by the least norm.
    fn is_beside(&self) -> bool {
        self.resolution != ResolutionName::LeastNorm || self.limit_margin_rad.is_some()
    }

    /// How twists are resolved; `None` for another number of joints.
    pub(crate) fn inverse<const N: usize>(&self) -> Option<Resolution<N>> {
        let weight = match &self.joint_weights {
            Some(weights) => Some(vector(weights)?),
            None => None,
        };
        let damping = self.damping_factor.zip(self.damping_below);
        Some(Resolution { weight, damping: damping.map(|(factor, below)| InverseDamping { factor, below }) })
    }

    /// What is done beside them; the outer `None` for another number of joints.
    pub(crate) fn beside<const N: usize>(&self, config: &Config) -> Option<Option<Redundancy<N>>> {
        if !self.is_told() {
            return Some(None);
        }
        let aim = match (self.resolution, &self.posture_rad) {
            (ResolutionName::Posture, Some(posture)) => {
                Aim::Posture { position: vector(posture)?, gain: self.posture_gain_1_s.unwrap_or(DEFAULT_GAIN_1_S) }
            }
            (ResolutionName::Keep, _) => Aim::Commanded,
            _ => Aim::Nothing,
        };
        let limit_margin = match self.margin(config) {
            Some(margin) => Some(vector(&margin)?),
            None => None,
        };
        let (speed_share, acceleration) = (self.speed_share, self.acceleration_rad_s2);
        Some(Some(Redundancy { aim, limit_margin, speed_share, acceleration }))
    }

    /// How far from its limits each joint is kept, rad or m; `None` where they are the MPC's alone.
    pub fn margin(&self, config: &Config) -> Option<Vec<f64>> {
        let limits = &config.limits;
        let (min, max) = limits.joint_position_min_rad.as_ref().zip(limits.joint_position_max_rad.as_ref())?;
        let (part, most) = DEFAULT_MARGIN;
        match &self.limit_margin_rad {
            Some(margin) => Some(margin.clone()),
            None if self.is_beside() => {
                Some(min.iter().zip(max).map(|(min, max)| ((max - min) * part).min(most)).collect())
            }
            None => None,
        }
    }
}

fn vector<const N: usize>(values: &[f64]) -> Option<SVector<f64, N>> {
    (values.len() == N).then(|| SVector::from_column_slice(values))
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;

    const SEVEN: &str = include_str!("../../../../deploy/robots/seven-joint.toml");
    const SIX: &str = include_str!("../../../../deploy/robots/six-joint.toml");
    const LIMITS: &str = "[limits]\njoint_position_min_rad = [-3.0, -2.0, -3.0, -2.0, -3.0, -2.0, -3.0]\n\
                          joint_position_max_rad = [3.0, 2.0, 3.0, 2.0, 3.0, 2.0, 3.0]";

    /// A file with this section, and perhaps limits of the joints' positions.
    fn parsed(text: &str, section: &str, with_limits: bool) -> Result<Config, String> {
        let mut text = text.replacen("[control]", &format!("[redundancy]\n{section}\n[control]"), 1);
        if with_limits {
            text = text.replacen("[limits]", LIMITS, 1);
        }
        parse::<Config>(&text, "changed.toml").map_err(|error| error.to_string())
    }

    #[test]
    fn every_resolution_is_accepted_with_what_it_wants() {
        for (section, is_told, has_margin) in [
            ("", false, false),
            ("resolution = \"least_norm\"", false, false),
            ("limit_margin_rad = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]", true, true),
            ("damping_factor = 0.1\ndamping_below = 0.05", true, false),
            ("resolution = \"weighted\"\njoint_weights = [1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 10.0]", true, true),
            (
                "resolution = \"posture\"\nposture_rad = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0]\nposture_gain_1_s = 2.0",
                true,
                true,
            ),
            ("resolution = \"keep\"\njoint_weights = [1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 10.0]", true, true),
        ] {
            let config = parsed(SEVEN, section, true).unwrap_or_else(|error| panic!("{section}: {error}"));
            assert_eq!(
                (config.redundancy.is_told(), config.redundancy.margin(&config).is_some()),
                (is_told, has_margin),
                "{section}"
            );
            assert_eq!(
                config.redundancy.beside::<7>(&config).map(|beside| beside.is_some()),
                Some(is_told),
                "{section}"
            );
        }
        // With drives that refuse jumps, but for a damped inverse, by whose twists no reference is ramped.
        let driven = SEVEN.replacen(
            "[limits]",
            "[limits]\njoint_acceleration_rad_s2 = [10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0]",
            1,
        );
        assert!(parsed(&driven, "resolution = \"keep\"", false).is_ok());
        let damped = parsed(&driven, "damping_factor = 0.1\ndamping_below = 0.05", false).expect_err("damped");
        assert!(
            damped.contains("redundancy.damping_factor = 0.1") && damped.contains("no such key with limits."),
            "{damped}"
        );
        // Of an arm without a redundant joint near its singular poses.
        assert!(parsed(SIX, "damping_factor = 0.1\ndamping_below = 0.05", false).is_ok());
    }

    #[test]
    fn what_a_resolution_cannot_have_is_named() {
        let wants = |text: &str, section: &str, parts: &[&str]| {
            let found = parsed(text, section, true).expect_err(section);
            parts.iter().for_each(|part| assert!(found.contains(part), "{part}: {found}"));
        };
        let posture = "resolution = \"posture\"\nposture_rad = ";
        wants(SEVEN, "resolution = \"null\"", &["redundancy.resolution", "null", "\"keep\""]);
        wants(SEVEN, "resolution = \"weighted\"", &["redundancy.joint_weights = absent", "\"weighted\""]);
        wants(
            SEVEN,
            "joint_weights = [1.0, 1.0]",
            &["redundancy.joint_weights = [1.0, 1.0]", "\"posture\" or \"keep\""],
        );
        wants(SEVEN, "resolution = \"keep\"\njoint_weights = [1.0, 1.0]", &["redundancy.joint_weights", "7 values"]);
        wants(
            SEVEN,
            "resolution = \"keep\"\njoint_weights = [1, 1, 1, 0, 1, 1, 1]",
            &["redundancy.joint_weights[3]", "0"],
        );
        wants(
            SEVEN,
            "resolution = \"keep\"\njoint_weights = [1, 1, 1, nan, 1, 1, 1]",
            &["redundancy.joint_weights[3]"],
        );
        wants(SEVEN, "resolution = \"posture\"", &["redundancy.posture_rad = absent"]);
        wants(SEVEN, "posture_rad = [0, 0, 0, 0, 0, 0, 0]", &["redundancy.posture_rad", "\"posture\""]);
        wants(SEVEN, "posture_gain_1_s = 1.0", &["redundancy.posture_gain_1_s = 1", "\"posture\""]);
        wants(SEVEN, &format!("{posture}[0, 0, 0, 0, 0, 2.5, 0]"), &["redundancy.posture_rad[5] = 2.5", "-2 to 2"]);
        wants(SEVEN, "limit_margin_rad = [0, 0, 0, 2, 0, 0, 0]", &["redundancy.limit_margin_rad[3] = 2", "below 2"]);
        wants(SEVEN, "damping_factor = 0.1", &["redundancy.damping_below = absent"]);
        wants(SEVEN, "damping_below = 0.05", &["redundancy.damping_below = 0.05", "damping_factor"]);
        wants(
            SEVEN,
            "damping_factor = 0.1\ndamping_below = 1e-3",
            &["redundancy.damping_below", "minimum_reciprocal_condition = 0.001"],
        );
        wants(SEVEN, "speed_share = 1.5", &["redundancy.speed_share = 1.5"]);
        wants(SEVEN, "acceleration_rad_s2 = 0", &["redundancy.acceleration_rad_s2 = 0"]);
        let without_limits = parsed(SEVEN, "limit_margin_rad = [0, 0, 0, 0, 0, 0, 0]", false).expect_err("no limits");
        assert!(without_limits.contains("limits.joint_position_min_rad"), "{without_limits}");
        let six = parsed(SIX, "resolution = \"keep\"", false).expect_err("nothing is left to choose");
        assert!(six.contains("redundancy.resolution = \"keep\"") && six.contains("6 joints"), "{six}");
        let weighed = SEVEN.replacen("position_weight = [0.0,", "position_weight = [1.0,", 1);
        wants(&weighed, "resolution = \"keep\"", &["mpc.position_weight", "0 throughout with [redundancy]"]);
    }
}
