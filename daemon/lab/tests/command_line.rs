//! What the program says to its command line alone.

use std::process::Command;

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_admittance-lab")).args(arguments).output().expect("it starts");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

/// The subcommands that a help text lists.
fn commands(help: &str) -> Vec<String> {
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names = listed.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help");
    names.map(str::to_owned).collect()
}

#[test]
fn every_subcommand_has_help_and_a_wrong_one_is_named() {
    let (code, text) = run(&["--help"]);
    assert_eq!((code, text.contains("Exit codes")), (Some(0), true), "{text}");
    assert_eq!(commands(&text), ["bench", "study", "soak", "hostile", "flood"]);
    for command in commands(&text) {
        let (code, text) = run(&[&command, "--help"]);
        assert_eq!((code, text.contains("Usage")), (Some(0), true), "{command}: {text}");
        let inner = commands(&text);
        assert!(!inner.is_empty() || text.contains("Example"), "{command} has no example: {text}");
        for part in inner {
            let (code, text) = run(&[&command, &part, "--help"]);
            assert_eq!((code, text.contains("Example")), (Some(0), true), "{command} {part}: {text}");
        }
    }
    let (code, text) = run(&["sok"]);
    assert_eq!((code, text.contains("sok")), (Some(64), true), "{text}");
}

#[test]
fn what_a_study_of_surfaces_is_told_is_refused_before_it_runs() {
    for (option, value, accepted) in [
        ("--tilt-deg", "21", "accepted: 0 to 20 degrees"),
        ("--tilt-deg", "-1", "accepted: 0 to 20 degrees"),
        ("--friction", "-1", "accepted: 0 to 2"),
        ("--friction", "much", "not a number; accepted: 0 to 2"),
        ("--damping", "2e5", "accepted: 0 to 100000 N s/m"),
        ("--told-lag", "-0.5", "accepted: 0 to 10 times the true lag"),
        ("--bias-n", "-1e5", "accepted: -10000 to 10000 N"),
        ("--noise-n", "nan", "accepted: 0 to 9.9 N"),
        ("--noise-n", "10", "accepted: 0 to 9.9 N"),
        ("--noise-n", "-1", "accepted: 0 to 9.9 N"),
        ("--risk", "1.5", "accepted: 0 to 1"),
        ("--told-noise", "-1", "accepted: 0 to 10 times the true noise"),
        ("--contact-tolerance-m", "0.2", "accepted: 0 to 0.1 m"),
        ("--outside", "0.5", "accepted: 1 to 10 times the hardest"),
        ("--sampling-time", "0.003", "accepted: one of"),
        ("--inputs", "9", "1..=8"),
    ] {
        let (code, text) = run(&["study", "verdict", "--surface", "range10", "--runs", "1", option, value]);
        assert_eq!(code, Some(64), "{option} {value}: {text}");
        for part in [option, &format!("'{value}'"), accepted] {
            assert!(text.contains(part), "{option} {value} does not say {part}: {text}");
        }
    }
}

#[test]
fn what_needs_a_range_is_refused_without_one() {
    for (option, value) in [("--contact-tolerance-m", "0.001"), ("--outside", "2")] {
        let study = |surface| run(&["study", "verdict", "--surface", surface, "--runs", "2", option, value]);
        let (code, text) = study("known");
        assert_eq!((code, text.contains(&format!("{option} with --surface known"))), (Some(64), true), "{text}");
        let (code, text) = study("range10");
        assert_eq!(code, Some(0), "{text}");
    }
}

#[test]
fn a_tilt_that_is_not_learned_is_told_of() {
    let tilted =
        |surface| run(&["study", "verdict", "--surface", surface, "--tilt-deg", "2", "--bias-n", "-1", "--index", "0"]);
    let (code, text) = tilted("known");
    assert_eq!((code, text.contains("--tilt-deg 2 with --surface known")), (Some(0), true), "{text}");
    let (code, text) = tilted("range3");
    assert_eq!((code, text.contains("is not learned")), (Some(0), false), "{text}");
}

/// Whoever reads the figures with a program finds them by these names.
#[test]
fn a_study_of_robustness_has_its_figures_by_speed_and_by_cause() {
    let cell = ["--cell", "planar, 4 ms", "--runs", "6", "--seed", "3", "--json"];
    let (code, text) = run(&[&["study", "robustness"], &cell[..]].concat());
    assert_eq!(code, Some(0), "{text}");
    let begins = text.find('{').unwrap_or_else(|| panic!("no JSON: {text}"));
    let mut values = serde_json::Deserializer::from_str(&text[begins..]).into_iter::<serde_json::Value>();
    let found = values.next().expect("a value").expect("JSON");
    let counts = ["runs", "over_limit", "worst_ratio", "with_losses", "false_stops", "silent"];
    let missing = |of: &serde_json::Value, keys: &[&str]| keys.iter().any(|key| of.get(key).is_none());
    assert!(!missing(&found, &counts) && !missing(&found, &["excess_over_attainable", "by_cause"]), "{found}");
    let by_speed = found["by_speed"].as_array().expect("speeds");
    assert!(by_speed.iter().all(|speed| !missing(speed, &counts) && speed["runs"] == 2), "{found}");
    let speeds: Vec<_> = by_speed.iter().map(|speed| speed["speed"].as_f64()).collect();
    assert_eq!(speeds, [Some(1.0), Some(0.5), Some(0.25)]);
    assert_eq!(found["by_cause"].as_object().expect("causes").len(), 11);
}
