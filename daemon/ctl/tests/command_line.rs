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

#[test]
fn validate_says_what_is_believed_of_the_arm() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/robots/planar.toml");
    let told = std::fs::read_to_string(file).expect("a shipped file");
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("cell.toml");
    let section = "[robot.velocity_loop]\ndamping = [0.7, 0.0]\ndead_time_s = [0.001, 0.001]\nreport_lag_s = 0.002\n";
    let surface = "[environment]\nstiffness_range_n_m = [3e4, 3e5]\ncontact_tolerance_m = 0.002\n\
                   normal_tolerance_rad = 0.1\nwrench_noise_n = 0.5\n";
    let told = told.replacen("[environment]\n", surface, 1);
    let told = told.replacen("[control]\n", "[control]\nlag_tolerance_s = 0.005\n", 1);
    let told = told.replacen("[contact]\n", "[contact]\nwrench_lag_tolerance = 0.25\n", 1);
    std::fs::write(&path, told.replacen("[[robot.joint]]", &format!("{section}\n[[robot.joint]]"), 1))
        .expect("written");
    let output = Command::new(env!("CARGO_BIN_EXE_admittancectl")).args(["validate", "-v"]).arg(&path).output();
    let output = output.expect("it starts");
    let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    assert_eq!(output.status.code(), Some(0), "{text}");
    for line in [
        "joint 0: speed loop of second order, 66.7 rad/s at -3 dB, damping 0.7, dead time 0.001 s",
        "joint 1: speed loop of first order, time constant 0.01 s, dead time 0.001 s",
        "joint velocities: reported with a lag of 0.002 s, estimated",
        "wrench: time constants [0.02, 0.02] s, dead time 0 s",
        "surface: stiffness 30000 to 300000 N/m, learned at touch (100000 N/m before it); contact point told within 2 mm; normal \
         told within 0.1 rad (5.7 degrees), learned",
        "the wrench may lag 25 % longer than that: a verdict is feasible where the limit would be kept if so much more of the \
         force were not shown yet, else AtRisk",
        "the arm may follow 0.005 s later than that: until it was halted a plan leaves 50 N free below the force limit at \
         0.1 m/s",
    ] {
        assert!(text.contains(line), "{text}");
    }
}
