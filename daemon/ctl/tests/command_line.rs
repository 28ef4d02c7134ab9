//! What the tool says to its command line alone.

use std::process::Command;

#[test]
fn every_subcommand_has_help_and_a_wrong_one_is_named() {
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_admittancectl")).args(arguments).output().expect("it starts");
        (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let (code, text) = run(&["--help"]);
    assert_eq!((code, text.contains("Exit codes")), (Some(0), true), "{text}");
    let commands = text.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let commands: Vec<&str> = commands.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.contains(&"limits") && commands.contains(&"set-force-limit"), "{commands:?}");
    for command in commands.into_iter().filter(|command| *command != "help") {
        let (code, text) = run(&[command, "--help"]);
        assert_eq!((code, text.contains("Usage")), (Some(0), true), "{command}: {text}");
        assert!(text.contains("Example"), "{command} has no example: {text}");
    }
    let (code, text) = run(&["limts"]);
    assert_eq!((code, text.contains("limts")), (Some(64), true), "{text}");
}
