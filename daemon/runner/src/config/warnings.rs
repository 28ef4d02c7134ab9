//! What is accepted and yet hardly meant.

use admittance_core::belief::{NOISE_DEVIATIONS, NoiseWindow};
use admittance_core::quantities::{AXIS_NAMES, Span, is_linear, wrench_unit};
use admittance_host::config::short;
use nalgebra::Vector3;

use super::plausibility::{MOST_FORCE_N_M, contact_distance_m, reach_m};
use super::{Config, LawName, WrenchSourceName};
use crate::task_frame::TaskFrame;

/// What a solve takes on a fast machine, in s: no answer is in time below it.
const FASTEST_ANSWER_S: f64 = 50e-6;
/// Of a normal's length 1 so much may be missing along the arm's axes: half a degree.
const NEGLIGIBLE_LEAN: f64 = 4e-5;

impl Config {
    /// Sentences about this (checked) configuration, for whoever loads it.
    pub fn warnings(&self) -> Vec<String> {
        [
            self.noise(),
            self.unknown_surface_without_noise(),
            self.unknown_surface_without_mpc(),
            self.lag_tolerance_without_mpc(),
            self.dynamics_without_gears(),
            self.distance(),
            self.normal_beside_the_arm(),
            self.budget(),
            self.forces(),
        ]
        .concat()
    }

    fn dynamics_without_gears(&self) -> Vec<String> {
        let Some(dynamics) = &self.dynamics else { return Vec::new() };
        let gives = dynamics.joint.iter().any(|joint| joint.gear_stiffness_n_m_rad.is_some());
        if self.wrench.source == WrenchSourceName::MotorTorque || gives && self.control.law == LawName::Mpc {
            return Vec::new();
        }
        vec![
            "[dynamics] is not looked at: the wrench comes from the samples, and no impact is reckoned with; give \
             dynamics.joint[..].gear_stiffness_n_m_rad with control.law = \"mpc\", or wrench.source = \"motor_torque\", or leave \
             it out"
                .to_owned(),
        ]
    }

    fn noise(&self) -> Vec<String> {
        let (contact, noise) = (&self.contact, self.environment.wrench_noise_n);
        let least = NOISE_DEVIATIONS * noise;
        let is_noisy = |axis: &usize| {
            is_linear(*axis) && contact.admittance_axes[*axis] && contact.activation_threshold[*axis] < least
        };
        let warning = |axis: usize| {
            format!(
                "contact.activation_threshold[{axis}] = {} N on {} is below {NOISE_DEVIATIONS} standard deviations of the wrench's \
                 noise (environment.wrench_noise_n = {} N): noise alone may count as a contact; give at least {} N",
                short(contact.activation_threshold[axis]),
                AXIS_NAMES.get(axis).unwrap_or(&"?"),
                short(noise),
                short(least),
            )
        };
        let axes = 0..contact.admittance_axes.len();
        axes.clone().filter(is_noisy).map(warning).chain(axes.filter_map(|axis| self.blunt_without_lag(axis))).collect()
    }

    /// Of an axis on which the force without the lag of its estimate is mostly noise.
    fn blunt_without_lag(&self, axis: usize) -> Option<String> {
        let (contact, told) = (&self.contact, if is_linear(axis) { self.environment.wrench_noise_n } else { 0.0 });
        let (noise, whose) = if told > 0.0 {
            (told, "as told")
        } else {
            (contact.activation_threshold[axis] / NOISE_DEVIATIONS, "what the activation threshold leaves room for")
        };
        let (limit, lag) = (contact.force_limit[axis], contact.wrench_time_constant_s[axis]);
        let sampling_time_s = self.control.sampling_time_s;
        let window = NoiseWindow::of(noise, limit, lag, Span::from_seconds(sampling_time_s));
        let length_s = window.samples as f64 * sampling_time_s;
        let allowed = if told > 0.0 { window.noise } else { window.excess };
        let unit = wrench_unit(axis);
        (contact.admittance_axes[axis] && window.excess > 0.0).then(|| {
            format!(
                "contact.force_limit[{axis}] = {limit} {unit} on {}: the force without the lag of its estimate is counted \
                 (ForceExceeded) only {allowed:.1} {unit} above that, since noise of {noise} {unit} ({whose}) may be \
                 {:.1} {unit} in it over the longest window, {length_s:.3} s of contact.wrench_time_constant_s = {lag} s; \
                 give a higher limit, a shorter time constant, or less noise",
                AXIS_NAMES.get(axis).unwrap_or(&"?"),
                window.noise,
            )
        })
    }

    /// A surface out of reach is an error; its point alone may be far.
    fn distance(&self) -> Vec<String> {
        let reach = reach_m(self);
        let far = contact_distance_m(self).filter(|(point, _)| *point > reach);
        let warning = |(point, _)| {
            format!(
                "environment.contact_point_m = {:?} is {} m away from the first joint, and the arm's links reach {} m: it \
                 stands for the surface only if that is a plane as far as there",
                self.environment.contact_point_m.unwrap_or_default().map(short),
                short(point),
                short(reach)
            )
        };
        far.map(warning).into_iter().collect()
    }

    /// A normal that leans out of what the arm moves along is laid into it.
    fn normal_beside_the_arm(&self) -> Vec<String> {
        let normal = Vector3::from(self.environment.surface_normal).normalize();
        let seen = TaskFrame::of(self).vector(normal);
        let axes: Vec<usize> = self.robot.linear_axes().collect();
        let part = axes.iter().map(|axis| seen[*axis] * seen[*axis]).sum::<f64>().sqrt();
        if part > 1.0 - NEGLIGIBLE_LEAN {
            return Vec::new();
        }
        let names: Vec<&str> = axes.iter().map(|axis| AXIS_NAMES[*axis]).collect();
        vec![format!(
            "environment.surface_normal = {:?} has a part beside {}, along which alone the arm moves: it is taken for a surface \
             across them; for one that leans so, normal_stiffness_n_m is {:.3} times what a motion feels, and the normal force \
             {:.3} times the one that is kept below force_limit",
            self.environment.surface_normal,
            names.join(" "),
            1.0 / (part * part),
            1.0 / part,
        )]
    }

    fn budget(&self) -> Vec<String> {
        let budget = self.control.answer_budget_s;
        if budget >= FASTEST_ANSWER_S {
            return Vec::new();
        }
        vec![format!(
            "control.answer_budget_s = {} s: an answer takes {} s or more on fast machines, so every cycle in contact would \
             be a fallback; give at least that",
            short(budget),
            short(FASTEST_ANSWER_S)
        )]
    }

    /// Limits and guards that no arm of this size gets to.
    fn forces(&self) -> Vec<String> {
        let most = MOST_FORCE_N_M * reach_m(self);
        let contact = &self.contact;
        let limits = contact
            .force_limit
            .iter()
            .enumerate()
            .filter(|(axis, _)| contact.admittance_axes[*axis] && is_linear(*axis));
        let limits = limits.map(|(axis, limit)| {
            (format!("contact.force_limit[{axis}] ({})", AXIS_NAMES.get(axis).unwrap_or(&"?")), Some(*limit))
        });
        let stopping = [
            ("stopping.force_guard_n".to_owned(), self.stopping.force_guard_n),
            ("stopping.mismatch_n".to_owned(), self.stopping.mismatch_n),
            ("stopping.stop_force_n".to_owned(), self.stopping.stop_force_n),
        ];
        let beyond =
            limits.chain(stopping).filter_map(|(key, force)| Some((key, force.filter(|force| *force > most)?)));
        let warning = |(key, force)| {
            format!(
                "{key} = {} N protects nothing: an arm that reaches {} m presses with {} N at most",
                short(force),
                short(reach_m(self)),
                short(most)
            )
        };
        beyond.map(warning).collect()
    }
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;

    #[test]
    fn a_threshold_within_the_noise_is_warned_of() {
        let text = include_str!("../../../../deploy/demo/mpc-default.toml");
        let mut config: Config = parse(text, "mpc-default.toml").unwrap();
        assert_eq!(config.warnings(), Vec::<String>::new());
        // β is 5 N on both axes.
        config.environment.wrench_noise_n = 1.0;
        assert_eq!(config.warnings(), Vec::<String>::new());
        config.environment.wrench_noise_n = 1.5;
        let warnings = config.warnings();
        assert_eq!(warnings.len(), 2);
        assert!(warnings[1].contains("activation_threshold[1] = 5 N on y"), "{}", warnings[1]);
        assert!(warnings[1].contains("at least 7.5 N"), "{}", warnings[1]);
        config.contact.admittance_axes[0] = false;
        assert_eq!(config.warnings().len(), 1);
    }

    #[test]
    fn noise_that_no_window_takes_out_of_the_force_is_warned_of() {
        let text = include_str!("../../../../deploy/demo/mpc-default.toml");
        let mut config: Config = parse(text, "mpc-default.toml").unwrap();
        config.control.sampling_time_s = 0.001;
        config.contact.wrench_time_constant_s = vec![0.02, 0.1];
        assert_eq!(config.warnings(), Vec::<String>::new());
        config.contact.force_limit[1] = 20.0;
        let warnings = config.warnings();
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        for part in ["force_limit[1] = 20 N on y", "only 18.3 N above", "noise of 1 N", "23.3 N", "0.031 s of"] {
            assert!(warnings[0].contains(part), "{}", warnings[0]);
        }
        config.environment.wrench_noise_n = 0.2;
        assert_eq!(config.warnings(), Vec::<String>::new(), "little enough");
    }

    fn planar(changes: impl FnOnce(&mut Config)) -> Config {
        let text = include_str!("../../../../deploy/demo/mpc-default.toml");
        let mut config: Config = parse(text, "mpc-default.toml").unwrap();
        changes(&mut config);
        config
    }

    #[test]
    fn what_no_arm_does_is_warned_of() {
        let one = |config: Config| {
            let warnings = config.warnings();
            assert_eq!(warnings.len(), 1, "{warnings:?}");
            warnings.into_iter().next().unwrap_or_default()
        };
        let text = one(planar(|config| config.control.answer_budget_s = 1e-5));
        assert!(text.starts_with("control.answer_budget_s = 1e-5 s: an answer takes 5e-5 s"), "{text}");
        let text = one(planar(|config| config.contact.force_limit[1] = 1e5));
        assert!(
            text.starts_with("contact.force_limit[1] (y) = 100000 N protects nothing: an arm that reaches 2 m"),
            "{text}"
        );
        let text = one(planar(|config| config.stopping.force_guard_n = Some(1e5)));
        assert!(text.starts_with("stopping.force_guard_n = 100000 N"), "{text}");
        // Along the surface, so that its plane stays within reach.
        let text = one(planar(|config| config.environment.contact_point_m = Some([1.32 + 9.063, 0.68 - 4.226, 0.0])));
        assert!(text.contains("reach 2 m"), "{text}");
    }

    #[test]
    fn a_normal_that_leans_out_of_the_arm_s_axes_is_warned_of() {
        let text = include_str!("../../../../deploy/robots/planar-three.toml");
        let mut config: Config = parse(text, "planar-three.toml").unwrap();
        assert_eq!(config.warnings(), Vec::<String>::new());
        config.environment.surface_normal = [0.0, 0.8, 0.6];
        let warnings = config.warnings();
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        for part in ["[0.0, 0.8, 0.6] has a part beside x y", "1.562 times what a motion feels", "1.250 times the one"]
        {
            assert!(warnings[0].contains(part), "{part}: {}", warnings[0]);
        }
    }

    #[test]
    fn what_no_motion_mends_is_an_error() {
        let errors = |config: Config| {
            let mut errors = Vec::new();
            admittance_host::config::Section::check(&config, "", &mut errors);
            errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
        };
        assert_eq!(errors(planar(|_| ())), "");
        let text = errors(planar(|config| config.environment.contact_point_m = Some([5.0, 5.0, 0.0])));
        assert!(
            text.starts_with(
                "environment.contact_point_m = [5.0, 5.0, 0.0]: accepted: a point on a surface within reach"
            ),
            "{text}"
        );
        let text = errors(planar(|config| config.robot.tool.origin_m = [0.0; 3]));
        assert!(text.contains("robot.joint = links of 1 m in all"), "{text}");
    }
}
