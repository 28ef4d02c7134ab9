//! What the program says to its command line alone.

use std::process::Command;

#[test]
fn help_has_an_example_and_a_wrong_option_is_named() {
    let run = |option: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_admittanced")).arg(option).output().expect("it starts");
        (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let (code, text) = run("--help");
    assert_eq!((code, text.contains("Example")), (Some(0), true), "{text}");
    let (code, text) = run("--confg");
    assert_eq!((code, text.contains("--confg")), (Some(64), true), "{text}");
}
