//! A surface of which only a range is told: what such a range must be.

use admittance_core::belief::SurfaceStiffness;
use admittance_host::config::{ConfigError, short};

use super::{Config, ContactPointName, EnvironmentSection, LawName};

/// Greatest stiffness of a range over its least. A touch is seen at β: in the hardest surface the
/// tool is by then so many times less deep than in the softest, and the horizon, the nodes of the
/// belief and the linear model would have to serve both. Studied up to 50.
const WIDEST: f64 = 100.0;

impl EnvironmentSection {
    /// Least and greatest stiffness in N/m of a surface that is not known; `None` where it is told,
    /// by a range of length zero as well.
    pub(crate) fn unknown_stiffness(&self) -> Option<(f64, f64)> {
        self.stiffness_range_n_m.filter(|[least, most]| least < most).map(|[least, most]| (least, most))
    }
}

impl EnvironmentSection {
    /// What an impact is reckoned with.
    pub(crate) fn in_impact(&self) -> SurfaceStiffness {
        SurfaceStiffness {
            pressed: self.stiffness_range_n_m.map_or(self.normal_stiffness_n_m, |[_, most]| most),
            in_impact: self.impact_stiffness_n_m,
            most_in_impact: self.most_impact_stiffness_n_m,
        }
    }
}

impl Config {
    /// Of a range with a law that has no model of the surface.
    pub(super) fn unknown_surface_without_mpc(&self) -> Vec<String> {
        let range = self.environment.unknown_stiffness().filter(|_| self.control.law == LawName::Damping);
        let warning = |(least, most)| {
            format!(
                "environment.stiffness_range_n_m = [{}, {}] N/m with control.law = \"damping\": the range has no effect on \
                 what that law commands; leave it out, or set control.law = \"mpc\"",
                short(least),
                short(most)
            )
        };
        range.map(warning).into_iter().collect()
    }

    /// Of an arm or a wrench that may lag longer, with the law that does not predict it.
    pub(super) fn lag_tolerance_without_mpc(&self) -> Vec<String> {
        // Of a tool's inertia it is told to touch and guards, which every law has.
        let has_tool = self.wrench.tool_mass_kg > 0.0;
        let of_wrench = if has_tool { 0.0 } else { self.contact.wrench_lag_tolerance };
        let told = [
            ("control.lag_tolerance_s", self.control.lag_tolerance_s, " s"),
            ("contact.wrench_lag_tolerance", of_wrench, ""),
        ];
        let without_effect = |(key, tolerance, unit): (&str, f64, &str)| {
            format!(
                "{key} = {tolerance}{unit} with control.law = \"damping\": the tolerance has no effect on what that \
                 law commands; leave it out, or set control.law = \"mpc\""
            )
        };
        let is_damping = self.control.law == LawName::Damping;
        told.into_iter().filter(|(_, tolerance, _)| is_damping && *tolerance > 0.0).map(without_effect).collect()
    }

    /// Of a range with a wrench that is told to be free of noise.
    pub(super) fn unknown_surface_without_noise(&self) -> Vec<String> {
        let environment = &self.environment;
        if environment.unknown_stiffness().is_none() || environment.wrench_noise_n > 0.0 {
            return Vec::new();
        }
        vec![
            "environment.wrench_noise_n = 0 N with environment.stiffness_range_n_m: what is believed of the surface is as \
             narrow as a wrench without noise makes it; give its standard deviation at rest"
                .to_owned(),
        ]
    }
}

/// Range and tolerance go together.
pub(super) fn check(environment: &EnvironmentSection, path: &str, errors: &mut Vec<ConfigError>) {
    let told = environment.normal_stiffness_n_m;
    let mut wants = |key: &str, found: String, accepted: String| {
        errors.push(ConfigError::new(format!("{path}.{key}"), found, accepted));
    };
    if let Some([least, most]) = environment.stiffness_range_n_m {
        let found = || format!("[{least:?}, {most:?}]");
        if least > most {
            wants("stiffness_range_n_m", found(), "the least stiffness first".to_owned());
        } else if most > WIDEST * least {
            let accepted = format!("a greatest stiffness of at most {WIDEST} times the least");
            wants("stiffness_range_n_m", found(), accepted);
        } else if !(least..=most).contains(&told) {
            wants("stiffness_range_n_m", found(), format!("a range with {path}.normal_stiffness_n_m = {told:?} in it"));
        }
    }
    if let (Some(likely), Some(most)) = (environment.impact_stiffness_n_m, environment.most_impact_stiffness_n_m)
        && most < likely
    {
        let accepted = format!("at least {path}.impact_stiffness_n_m = {likely:?}, or absent");
        wants("most_impact_stiffness_n_m", format!("{most:?}"), accepted);
    }
    let is_unknown = environment.unknown_stiffness().is_some();
    // A range of length zero is there and yet none: that has to be said.
    let without_range = |value: &str| match environment.stiffness_range_n_m {
        Some([least, most]) if least == most => format!(
            "{value} with {path}.stiffness_range_n_m = [{least:?}, {most:?}] N/m, which tells one stiffness; or a range \
             whose least is below its most"
        ),
        Some(_) | None => format!("{value} without a range in {path}.stiffness_range_n_m"),
    };
    let is_told = environment.contact == ContactPointName::Configured;
    if environment.normal_tolerance_rad > 0.0 && !is_unknown {
        wants("normal_tolerance_rad", format!("{:?}", environment.normal_tolerance_rad), without_range("0"));
    }
    match environment.contact_tolerance_m {
        None if is_unknown && is_told => {
            let accepted =
                format!("a tolerance above 0 with {path}.stiffness_range_n_m, or {path}.contact = \"detected\"");
            wants("contact_tolerance_m", "absent".to_owned(), accepted);
        }
        Some(found) if !is_unknown => {
            wants("contact_tolerance_m", format!("{found:?}"), without_range("absent"));
        }
        Some(found) if !is_told => {
            wants("contact_tolerance_m", format!("{found:?}"), format!("absent with {path}.contact = \"detected\""));
        }
        Some(_) | None => {}
    }
}

#[cfg(test)]
mod tests {
    use admittance_host::config::{Section, parse};

    use super::*;

    /// The errors and warnings of the default profile with these changes.
    fn said(changes: impl FnOnce(&mut EnvironmentSection)) -> (String, Vec<String>) {
        let text = include_str!("../../../../deploy/demo/mpc-default.toml");
        let mut config: Config = parse(text, "mpc-default.toml").unwrap();
        changes(&mut config.environment);
        let mut errors = Vec::new();
        config.check("", &mut errors);
        (errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "), config.warnings())
    }

    #[test]
    fn a_range_has_its_errors() {
        let detected = |range: [f64; 2]| {
            said(|environment| {
                environment.stiffness_range_n_m = Some(range);
                environment.contact = ContactPointName::Detected;
                environment.wrench_noise_n = 0.5;
            })
        };
        assert_eq!(detected([1e4, 5e5]), (String::new(), Vec::new()));
        for (range, accepted) in [
            ([5e5, 1e4], "the least stiffness first"),
            ([2e3, 5e5], "at most 100 times the least"),
            ([2e5, 5e5], "environment.normal_stiffness_n_m = 100000.0 in it"),
        ] {
            let (errors, _) = detected(range);
            assert!(errors.contains("environment.stiffness_range_n_m") && errors.contains(accepted), "{errors}");
        }
    }

    #[test]
    fn the_hardest_in_an_impact_is_no_softer_than_the_likeliest() {
        let told = |likely: f64, most: f64| {
            said(|environment| {
                (environment.impact_stiffness_n_m, environment.most_impact_stiffness_n_m) = (Some(likely), Some(most));
            })
        };
        assert_eq!(told(2e5, 2e5).0, "");
        let (errors, _) = told(2e5, 1e5);
        let whole = "environment.most_impact_stiffness_n_m = 100000.0: accepted: at least \
                     environment.impact_stiffness_n_m = 200000.0, or absent";
        assert!(errors.contains(whole), "{errors}");
    }

    #[test]
    fn a_tolerance_goes_with_a_range() {
        let (errors, _) = said(|environment| environment.contact_tolerance_m = Some(1e-3));
        assert!(errors.contains("contact_tolerance_m = 0.001: accepted: absent without a range"), "{errors}");
        let (errors, _) = said(|environment| environment.stiffness_range_n_m = Some([1e4, 5e5]));
        assert!(errors.contains("contact_tolerance_m") && errors.contains("a tolerance above 0"), "{errors}");
        let (errors, warnings) = said(|environment| {
            environment.stiffness_range_n_m = Some([1e4, 5e5]);
            environment.contact_tolerance_m = Some(1e-3);
        });
        assert_eq!(errors, "");
        assert!(warnings.len() == 1 && warnings[0].contains("wrench_noise_n = 0 N"), "{warnings:?}");
        // A range of length zero is a stiffness: there is nothing that a tolerance could belong to.
        for (key, accepted) in [("contact_tolerance_m = 0.001", "absent"), ("normal_tolerance_rad = 0.1", "0")] {
            let (errors, _) = said(|environment| {
                environment.stiffness_range_n_m = Some([1e5, 1e5]);
                environment.contact_tolerance_m = Some(1e-3);
                environment.normal_tolerance_rad = 0.1;
            });
            let whole = format!(
                "environment.{key}: accepted: {accepted} with environment.stiffness_range_n_m = [100000.0, 100000.0] N/m, \
                 which tells one stiffness; or a range whose least is below its most"
            );
            assert!(errors.contains(&whole), "{errors}");
        }
        assert_eq!(said(|environment| environment.stiffness_range_n_m = Some([1e5, 1e5])), (String::new(), Vec::new()));
    }

    #[test]
    fn a_range_that_the_law_does_not_use_is_warned_of() {
        let text = include_str!("../../../../deploy/demo/mpc-default.toml");
        let mut config: Config = parse(text, "mpc-default.toml").unwrap();
        config.control.law = LawName::Damping;
        assert_eq!(config.unknown_surface_without_mpc(), Vec::<String>::new());
        assert_eq!(config.lag_tolerance_without_mpc(), Vec::<String>::new());
        config.control.lag_tolerance_s = 0.005;
        let of_lag = "control.lag_tolerance_s = 0.005 s with control.law = \"damping\": the tolerance has no effect";
        assert!(config.warnings().iter().any(|warning| warning.starts_with(of_lag)), "{:?}", config.warnings());
        config.contact.wrench_lag_tolerance = 0.25;
        let of_wrench =
            "contact.wrench_lag_tolerance = 0.25 with control.law = \"damping\": the tolerance has no effect";
        assert!(config.warnings().iter().any(|warning| warning.starts_with(of_wrench)), "{:?}", config.warnings());
        config.wrench.tool_mass_kg = 2.0;
        assert!(!config.warnings().iter().any(|warning| warning.starts_with(of_wrench)), "{:?}", config.warnings());
        config.environment.stiffness_range_n_m = Some([1e4, 5e5]);
        let warnings = config.warnings();
        assert!(
            warnings.iter().any(|warning| warning.starts_with(
                "environment.stiffness_range_n_m = [10000, 500000] N/m with control.law = \"damping\": the range has no effect"
            )),
            "{warnings:?}"
        );
    }
}
