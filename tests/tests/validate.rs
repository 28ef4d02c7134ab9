//! Files as people name them: `validate` and reload read what is a configuration, say where it is
//! wrong, and warn of what is accepted and yet hardly meant.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use admittance_runner::config::Config;
use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{MPC_PAPER, PAPER_SCENARIO, output, start_daemon, wait_for_log, with_keys, write};
use end_to_end::{PATIENCE, PrivateIpc, binaries};

fn validate(arguments: &[&str], path: &Path) -> (Option<i32>, String) {
    output(Command::new(&binaries().admittancectl).arg("validate").args(arguments).arg(path))
}

fn pipe(path: &Path) {
    let made = Command::new("mkfifo").arg(path).status().expect("mkfifo is there");
    assert!(made.success(), "{made}");
}

#[test]
fn only_regular_files_of_bounded_size_are_read() {
    let ipc = PrivateIpc::new("planar");
    let path = ipc.directory().join("pipe.toml");
    pipe(&path);
    let large = write(&ipc, "large.toml", &(MPC_PAPER.to_owned() + &"#".repeat(1 << 20)));
    for (path, what) in
        [(path.as_path(), "a pipe"), (Path::new("/dev/zero"), "a device"), (&large, "more than 1048576 bytes")]
    {
        let (code, text) = validate(&[], path);
        assert_eq!(code, Some(66), "{text}");
        assert!(text.contains(what) && text.contains("accepted: a regular file of up to 1 MiB"), "{text}");
    }
    let full = write(&ipc, "full.toml", &(MPC_PAPER.to_owned() + &"#".repeat((1 << 20) - MPC_PAPER.len())));
    assert_eq!(validate(&[], &full).0, Some(0));
}

#[test]
fn a_reload_of_a_pipe_is_refused_and_the_daemon_goes_on() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let mut daemon = start_daemon(&ipc, &config);
    std::fs::remove_file(&config).expect("removed");
    pipe(&config);
    daemon.signal(libc::SIGHUP);
    wait_for_log(&mut daemon, "it is a pipe; accepted: a regular file");
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
}

#[test]
fn of_a_directory_every_file_is_checked() {
    let ipc = PrivateIpc::new("planar");
    let directory = ipc.directory().join("etc");
    std::fs::create_dir(&directory).expect("made");
    let (code, text) = validate(&[], &directory);
    assert!(code == Some(66) && text.contains("no file in it ends in .toml"), "{text}");
    let put = |name: &str, text: &str| std::fs::write(directory.join(name), text).expect("written");
    put("a.toml", MPC_PAPER);
    put("b.scenario.toml", PAPER_SCENARIO);
    put("c.egm.toml", include_str!("../../deploy/egm/six-joint.egm.toml"));
    put("notes.txt", "mine");
    let (code, text) = validate(&[], &directory);
    assert_eq!(code, Some(0), "{text}");
    for file in ["a.toml", "b.scenario.toml", "c.egm.toml"] {
        assert!(text.contains(&format!("{file}: valid")), "{text}");
    }
    assert!(text.contains("notes.txt: left out"), "{text}");
    put("0.toml", &with_keys(MPC_PAPER, &[("mpc.horizn", "5")]));
    pipe(&directory.join("p.toml"));
    let (code, text) = validate(&[], &directory);
    assert_ne!(code, Some(0), "{text}");
    for expected in ["did you mean mpc.horizon", "a.toml: valid", "p.toml: cannot be read: it is a pipe"] {
        assert!(text.contains(expected), "{text}");
    }
}

/// What may be said of admittance-egm, and how it is wrong, is told as for the daemon.
#[test]
fn the_edge_s_keys_are_listed_and_its_file_is_checked() {
    let ctl = || Command::new(&binaries().admittancectl);
    let (code, keys) = output(ctl().args(["validate", "--egm", "--keys"]));
    assert_eq!(code, Some(0), "{keys}");
    for key in ["egm.listen", "egm.robot_address", "egm.joint_speed_limit_deg_s", "egm.torque_factor", "realtime.cpu"] {
        assert!(keys.contains(&format!("`{key}`")), "{key}: {keys}");
    }
    let ipc = PrivateIpc::new("planar");
    let file =
        write(&ipc, "robot.egm.toml", "[egm]\nrobot_address = \"robot\"\njoint_speed_limit_deg_s = [9.0, 9.0]\n");
    let (code, said) = validate(&["--egm"], &file);
    assert_eq!(code, Some(78), "{said}");
    assert!(said.contains("robot.egm.toml:2: egm.robot_address = \"robot\": accepted: an IP address"), "{said}");
}

#[test]
fn errors_have_lines_axes_short_numbers_and_nothing_that_a_terminal_acts_on() {
    let ipc = PrivateIpc::new("planar");
    let refused = |from: &str, to: &str, expected: &str| {
        assert!(MPC_DEFAULT.contains(from), "{from}");
        let text = MPC_DEFAULT.replacen(from, to, 1);
        let line =
            1 + text.lines().position(|line| line == to.lines().next().unwrap_or_default()).expect("a whole line");
        let file = write(&ipc, "bad.toml", &text);
        let (code, said) = validate(&[], &file);
        assert_eq!(code, Some(78), "{said}");
        assert!(said.contains(&format!("bad.toml:{line}: {expected}")), "{expected}: {said}");
        assert!(!said.contains(['\u{1b}', '\u{202e}']), "{said:?}");
    };
    refused("root_path = \"user\"", "root_path = \"/\"", "ipc.root_path = \"/\": accepted: a directory of its own");
    refused(
        "instance = \"planar\"",
        "instance = \"Planar\"",
        "ipc.instance = \"Planar\": accepted: 1 to 32 characters",
    );
    refused("instance = \"planar\"", "instance = \"p\u{202e}\"", "ipc.instance = \"p\\u{202e}\"");
    refused("name = \"planar 2R\"", "name = \"\\u001b[2J\"", "robot.name = \"\\u001b[2J\": accepted: string, 1 to 64");
    refused(
        "release_threshold = [3.0, 3.0]",
        "release_threshold = [3.0, 30.000123456789012]",
        "contact.release_threshold[1] (y) = 30.000123456789012: accepted: at most contact.activation_threshold[1] = 5",
    );
    refused("instance = \"planar\"", "instance = \u{1b}", "ipc.instance = \\u{1b}: ");
    let strange = ipc.directory().join("\u{1b}[2J.toml");
    let (_, said) = validate(&[], &strange);
    assert!(said.contains("\\u{1b}[2J.toml: cannot be read") && !said.contains('\u{1b}'), "{said:?}");
}

#[test]
fn what_follows_is_printed_and_traps_are_warned_of() {
    let ipc = PrivateIpc::new("planar");
    let (code, text) = validate(&["-v"], &write(&ipc, "good.toml", MPC_DEFAULT));
    assert_eq!(code, Some(0), "{text}");
    // 12 steps: 4 of 4 ms, then growing, to 3 times the slowest joint's 15 ms at least. The first is four inputs.
    for expected in [
        "horizon: 48 ms in 15 steps, 4 of them within a cycle",
        "reach: 2 m",
        "rows and ",
        "safe speed: 0.3",
        "contact point is 1.48486 m",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    let warned = [
        ("control.answer_budget_s", "1e-5", "warning: control.answer_budget_s = 1e-5 s"),
        ("contact.force_limit", "[1e5, 1e5]", "warning: contact.force_limit[0] (x) = 100000 N protects nothing"),
        ("stopping.force_guard_n", "1e5", "warning: stopping.force_guard_n = 100000 N protects nothing"),
        ("stopping.mismatch_n", "1e5", "warning: stopping.mismatch_n = 100000 N protects nothing"),
        ("environment.contact_point_m", "[10.383, -3.546, 0.0]", "warning: environment.contact_point_m = "),
    ];
    for (key, value, expected) in warned {
        let (code, text) = validate(&[], &write(&ipc, "trap.toml", &with_keys(MPC_DEFAULT, &[(key, value)])));
        assert!(code == Some(0) && text.contains(expected), "{expected}: {code:?} {text}");
    }
    let refused = [
        ("environment.contact_point_m", "[5.0, 5.0, 0.0]", "accepted: a point on a surface within reach"),
        ("robot.tool.origin_m", "[0.0, 0.0, 0.0]", "robot.joint = links of 1 m in all"),
        // What only the law can tell, by its key all the same, on its line of the sorted file.
        (
            "contact.minimum_force",
            "[2.0, 6.0]",
            "trap.toml:5: contact.minimum_force = [2.0, 6.0]: accepted: on every axis",
        ),
    ];
    for (key, value, expected) in refused {
        let (code, text) = validate(&[], &write(&ipc, "trap.toml", &with_keys(MPC_DEFAULT, &[(key, value)])));
        assert!(code == Some(78) && text.contains(expected), "{expected}: {code:?} {text}");
    }
}

/// Four times the keys take about four times as long, not sixteen times.
#[test]
fn the_time_grows_with_the_text_and_no_faster() {
    let fastest = |keys: usize| {
        let text = format!("[control]\n{}", (0..keys).map(|key| format!("k{key} = 0\n")).collect::<String>());
        let one = || {
            let begun = Instant::now();
            let errors = admittance_host::config::parse::<Config>(&text, "many.toml").expect_err("unknown keys");
            assert_eq!(errors.errors.len(), 100);
            assert!(errors.to_string().ends_with("more errors"));
            begun.elapsed()
        };
        (0..5).map(|_| one()).min().unwrap_or(Duration::MAX)
    };
    let (few, many) = (fastest(10_000), fastest(40_000));
    assert!(many < few * 10, "10,000 keys: {few:?}, 40,000: {many:?}");
}

#[test]
fn a_file_of_as_many_keys_as_fit_is_read_to_its_end() {
    let ipc = PrivateIpc::new("planar");
    let keys: String = (0..100_000).map(|key| format!("k{key}=0\n")).collect();
    assert!((800_000..1 << 20).contains(&keys.len()), "{} bytes", keys.len());
    let path = write(&ipc, "many.toml", &format!("[control]\n{keys}"));
    let (code, text) = validate(&[], &path);
    assert_eq!((code, text.matches("many.toml:").count()), (Some(78), 101), "{text}");
    assert!(text.trim_end().ends_with("more errors"), "{text}");
}
