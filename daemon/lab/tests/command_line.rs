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
