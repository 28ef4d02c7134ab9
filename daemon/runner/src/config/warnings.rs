//! What is accepted and yet hardly meant.

use super::Config;
use admittance_core::belief::NOISE_DEVIATIONS;
use admittance_core::quantities::{AXIS_NAMES, is_linear};

impl Config {
    /// Sentences about this (checked) configuration, for whoever loads it.
    pub fn warnings(&self) -> Vec<String> {
        let (contact, noise) = (&self.contact, self.environment.wrench_noise_n);
        let least = NOISE_DEVIATIONS * noise;
        let is_noisy = |axis: &usize| {
            is_linear(*axis) && contact.admittance_axes[*axis] && contact.activation_threshold[*axis] < least
        };
        let warning = |axis: usize| {
            format!(
                "contact.activation_threshold[{axis}] = {} N on {} is below {NOISE_DEVIATIONS} standard deviations of the wrench's \
                 noise (environment.wrench_noise_n = {noise} N): noise alone may count as a contact; give at least {least} N",
                contact.activation_threshold[axis],
                AXIS_NAMES.get(axis).unwrap_or(&"?"),
            )
        };
        (0..contact.admittance_axes.len()).filter(is_noisy).map(warning).collect()
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
}
