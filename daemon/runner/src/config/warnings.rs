//! What is accepted and yet hardly meant.

use super::Config;
use admittance_core::belief::{NOISE_DEVIATIONS, NoiseWindow};
use admittance_core::quantities::{AXIS_NAMES, Span, is_linear, wrench_unit};

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
                "contact.force_limit[{axis}] = {limit} {unit} on {}: the force without the lag of its estimate is counted                  (ForceExceeded) only {allowed:.1} {unit} above that, since noise of {noise} {unit} ({whose}) may be \
                 {:.1} {unit} in it over the longest window, {length_s:.3} s of contact.wrench_time_constant_s = {lag} s;                  give a higher limit, a shorter time constant, or less noise",
                AXIS_NAMES.get(axis).unwrap_or(&"?"),
                window.noise,
            )
        })
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
}
