//! Every mistake in every key, and mistakes in declarations.

use std::collections::BTreeSet;

use admittance_host::config::mutation::{MutationKind, check_every_key, mutations};
use admittance_host::config::{ConfigError, Kind, Section, parse};
use admittance_host::{config_file, config_section};

use crate::sample::{Config, Noise, VALID, with};

#[test]
fn every_key_is_driven_through_every_mistake() {
    let count = check_every_key::<Config>(VALID).unwrap_or_else(|failures| panic!("{}", failures.join("\n")));
    assert!(count > 100, "{count}");

    let keys = Config::keys("");
    let mutations = mutations(&keys, VALID);
    let kinds: BTreeSet<_> = mutations.iter().map(|mutation| format!("{:?}", mutation.kind)).collect();
    assert_eq!(kinds.len(), 11, "a sample with every kind of key has every kind of mistake: {kinds:?}");
    let expected = |key: &str, kind, value: &str| {
        let found = mutations.iter().any(|m| m.key == key && m.kind == kind && m.value == value);
        assert!(found, "{key} {kind:?} {value}");
    };
    expected("control.sampling_time_s", MutationKind::TooHigh, "0.10000000000000002");
    expected("control.horizon", MutationKind::TooLow, "0");
    expected("control.stiffness_n_per_m", MutationKind::TooLow, "0.0");
    expected("control.stop_force_n", MutationKind::TooHigh, "1000.0");
    expected("control.seed", MutationKind::TooLow, "-1");
    expected("control.surface[0][0]", MutationKind::NotANumber, "nan");
    expected("control.laws[0]", MutationKind::NotAChoice, "\"none_of_these\"");
    expected("robot.joint[0].length_m", MutationKind::Missing, "");
    expected("robot.joint", MutationKind::TooShort, "[]");
    expected("robot.joint[0].time_constant_s", MutationKind::Infinite, "inf");
    expected("noise.deviation_n", MutationKind::Missing, "");
    expected("cell", MutationKind::TooShort, "\"x\"");
    for key in keys.iter().filter(|key| !matches!(key.kind, Kind::Section(_))) {
        let path = key.path.replace("[]", "[0]");
        let wrong_type = mutations.iter().any(|m| m.key == path && m.kind == MutationKind::WrongType);
        let unknown = mutations.iter().any(|m| m.key == format!("{path}x") && m.kind == MutationKind::Unknown);
        assert!(wrong_type && unknown, "{path}");
    }
}

#[test]
fn verify_refuses_an_outcome_that_does_not_fit() {
    let all = mutations(&Config::keys(""), VALID);
    let valid = parse::<Config>(VALID, "");
    let other = parse::<Config>(&with("law = \"high_damping\"", "law = 1\nhorizon = 99\nhorizom = 4"), "");
    for mutation in &all {
        let fits_valid = mutation.kind == MutationKind::Omitted;
        assert_eq!(mutation.verify(&valid).is_ok(), fits_valid, "{mutation:?}");
        // It has an error of control.law's type and of a misspelt horizon too, but with another
        // value and another key.
        assert!(mutation.verify(&other).is_err(), "{mutation:?}");
    }
}

config_section! {
    /// A section with mistakes in its declaration.
    pub struct Misdeclared {
        /// A default that its own range does not accept.
        speed_m_s: f64 = 2.0, unit "m/s", range 0.0..=1.0;
        /// A list with such a default.
        angles_rad: [f64; 2] = [0.0, 4.0], unit "rad", range -3.2..=3.2;
        /// A number without a unit.
        count: u32 = 1;
        /// A key that another one needs, though it has a default.
        noise: Option<Noise>;
    }
    cross_check count_two_needs_noise;
}

config_file!(Misdeclared);

fn count_two_needs_noise(section: &Misdeclared, _: &str, errors: &mut Vec<ConfigError>) {
    if section.count == 2 && section.noise.is_none() {
        errors.push(ConfigError::new("count", 2, "1, or a [noise]"));
    }
}

#[test]
fn mistakes_of_a_declaration_are_found() {
    let text = "speed_m_s = 0.5\nangles_rad = [1.0, 1.0]\ncount = 2\nnoise.deviation_n = 1.0";
    let failures = check_every_key::<Misdeclared>(text).unwrap_err();
    assert_eq!(
        failures,
        [
            "speed_m_s: default: default = 2.0: accepted: 0 to 1 m/s",
            "angles_rad: default: default[1] = 4.0: accepted: -3.2 to 3.2 rad",
            "count: a number without a unit (\"1\" if it has no dimension)",
        ],
        "and nothing about noise, which only a rule between keys needs"
    );
    assert_eq!(check_every_key::<Misdeclared>("count = 2").unwrap_err().len(), 1, "not valid to begin with");
}
