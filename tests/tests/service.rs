//! The daemon as a service: who may start, what it says, signals, requests.

use std::path::Path;
use std::process::Command;

use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{
    CONTRADICTION, MPC_PAPER, PAPER_SCENARIO, PATIENT, ctl_command, daemon_command, output, plant_command, run_plant,
    start_daemon, wait_for_log, with_keys, write,
};
use end_to_end::{Child, Need, PATIENCE, PrivateIpc, binaries, needs, python, undisturbed};

/// Starts a program with a file that takes it a while to read, and asks it to end as soon as it
/// listens: before it can have set up anything that it does not set up first.
fn asked_to_end_at_start(ipc: &PrivateIpc, text: &str, command: impl Fn(&PrivateIpc, &Path) -> Command) -> Child {
    let file = write(ipc, "file.toml", &(text.to_owned() + &"#\n".repeat(500_000)));
    let mut child = Child::spawn(&mut command(ipc, &file));
    let catches = |status: &str| {
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
            .is_some_and(|mask| mask >> (libc::SIGTERM - 1) & 1 == 1)
    };
    let status = format!("/proc/{}/status", child.id());
    child.wait_until("it catches SIGTERM", PATIENCE, |_| {
        std::fs::read_to_string(&status).is_ok_and(|text| catches(&text))
    });
    child.terminate();
    child
}

#[test]
fn a_signal_that_comes_before_the_file_is_read_ends_them_in_order() {
    let ipc = PrivateIpc::new("planar");
    let mut daemon = asked_to_end_at_start(&ipc, MPC_PAPER, daemon_command);
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    assert!(daemon.stderr().contains("INFO ended"), "{}", daemon.report());
    let ipc = PrivateIpc::new("planar");
    let mut plant = asked_to_end_at_start(&ipc, PAPER_SCENARIO, plant_command);
    assert_eq!(plant.wait_for_exit(PATIENCE).code(), Some(0), "{}", plant.report());
}

#[test]
fn a_second_daemon_is_told_who_holds_the_instance() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let first = start_daemon(&ipc, &config);
    let (code, text) = output(&mut daemon_command(&ipc, &config));
    assert_eq!(code, Some(69), "{text}");
    assert!(text.contains(&format!("instance planar is held by process {}", first.id())), "{text}");
}

#[test]
fn what_cannot_start_says_why_with_its_exit_code() {
    let ipc = PrivateIpc::new("planar");
    let broken = write(&ipc, "broken.toml", &with_keys(MPC_PAPER, &[("control.sampling_time_s", "5.0")]));
    let (code, text) = output(&mut daemon_command(&ipc, &broken));
    assert_eq!(code, Some(78), "{text}");
    assert!(text.contains("control.sampling_time_s = 5") && text.contains("accepted"), "{text}");
    let (code, text) = output(&mut daemon_command(&ipc, &ipc.directory().join("missing.toml")));
    assert_eq!((code, text.contains("missing.toml")), (Some(66), true), "{text}");
    let (code, text) = output(Command::new(&binaries().admittanced).arg("--confg"));
    assert_eq!((code, text.contains("--confg")), (Some(64), true), "{text}");
    let (code, text) = output(Command::new(&binaries().admittanced).arg("--help"));
    assert_eq!((code, text.contains("Example")), (Some(0), true), "{text}");
    let scenario = write(&ipc, "scenario.toml", PAPER_SCENARIO);
    let (code, text) = output(plant_command(&ipc, &scenario).args(["--controller-timeout", "0.2"]));
    assert_eq!(code, Some(69), "{text}");
    assert!(text.contains("no command on admittanced/planar/command"), "{text}");
    let (code, text) = output(&mut ctl_command(&ipc, "status", &write(&ipc, "daemon.toml", MPC_PAPER)));
    assert_eq!(code, Some(69), "{text}");
    assert!(text.contains("is admittanced running"), "{text}");
}

#[test]
fn validate_says_yes_or_names_the_key() {
    let ipc = PrivateIpc::new("planar");
    let good = write(&ipc, "good.toml", MPC_PAPER);
    let bad = write(&ipc, "bad.toml", &with_keys(MPC_PAPER, &[("mpc.horizn", "5")]));
    let (code, text) = output(Command::new(&binaries().admittancectl).arg("validate").arg(&good));
    assert_eq!((code, text.contains("valid")), (Some(0), true), "{text}");
    let (code, text) = output(Command::new(&binaries().admittancectl).arg("validate").arg(&bad));
    assert_eq!(code, Some(78), "{text}");
    assert!(text.contains("mpc.horizn") && text.contains("did you mean mpc.horizon"), "{text}");
}

#[test]
fn a_threshold_within_the_noise_is_warned_of_at_start_and_reload() {
    let noisy = |noise: &str, threshold: &str| {
        with_keys(MPC_DEFAULT, &[("environment.wrench_noise_n", noise), ("contact.activation_threshold", threshold)])
    };
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", &noisy("1.5", "[5.0, 8.0]"));
    let warning =
        "WARN contact.activation_threshold[0] = 5 N on x is below 5 standard deviations of the wrench's noise";
    let mut daemon = start_daemon(&ipc, &config);
    wait_for_log(&mut daemon, warning);
    assert!(!daemon.stderr().contains("activation_threshold[1]"), "8 N are enough: {}", daemon.stderr());

    write(&ipc, "daemon.toml", &noisy("2", "[10.0, 8.0]"));
    daemon.signal(libc::SIGHUP);
    wait_for_log(&mut daemon, "WARN contact.activation_threshold[1] = 8 N on y is below 5 standard deviations");
    let (code, text) = output(Command::new(&binaries().admittancectl).arg("validate").arg(&config));
    assert_eq!((code, text.contains("warning: contact.activation_threshold[1] = 8 N")), (Some(0), true), "{text}");

    let warnings = daemon.stderr().matches("standard deviations").count();
    write(&ipc, "daemon.toml", &noisy("2", "[10.0, 10.0]"));
    daemon.signal(libc::SIGHUP);
    daemon.wait_until("a second reload", PATIENCE, |daemon| {
        daemon.stderr().matches("the new configuration is in force").count() == 2
    });
    assert_eq!(daemon.stderr().matches("standard deviations").count(), warnings, "{}", daemon.stderr());
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
}

#[test]
fn reload_takes_what_may_change_and_refuses_the_rest_with_a_reason() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let mut daemon = start_daemon(&ipc, &config);
    let mut reload = |changes: &[(&str, &str)], expected: &str| {
        write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, changes));
        daemon.signal(libc::SIGHUP);
        wait_for_log(&mut daemon, expected);
    };
    reload(&[("contact.force_limit", "[150.0, 150.0]")], "reload: the new configuration is in force");
    reload(&[("control.sampling_time_s", "0.002")], "reload refused: [control] cannot change at run time");
    write(&ipc, "daemon.toml", "this is not TOML");
    daemon.signal(libc::SIGHUP);
    wait_for_log(&mut daemon, "reload refused: ");
    let (code, text) = output(&mut ctl_command(&ipc, "status", &write(&ipc, "other.toml", MPC_PAPER)));
    assert_eq!(code, Some(0), "it goes on serving: {text}");
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
}

#[test]
fn a_stop_is_reported_and_reset_once_nothing_pushes_in() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &[&PATIENT[..], &[CONTRADICTION]].concat()));
        let mut daemon = start_daemon(&ipc, &config);
        let (code, text) = output(&mut ctl_command(&ipc, "reset", &config));
        assert_eq!((code, text.contains("not Stopped")), (Some(1), true), "{text}");

        // An infeasible contact: a stop. Then the motion leads out of the surface; the daemon lets
        // it, slowly.
        let motion = "[{ duration_s = 0.8, twist = [0.0, -0.25] }, { duration_s = 1.5, twist = [0.0, 0.2] }]";
        let changes = [("motion", motion), ("start.contact_time_s", "0.4"), ("timing.command_delay_s", "0.001")];
        let scenario = write(&ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &changes));
        let (mut refused, mut done) = (None, None);
        run_plant(&ipc, &scenario, |truth| {
            if truth.scenario_time_s > 0.65 && refused.is_none() {
                refused = Some(output(&mut ctl_command(&ipc, "reset", &config)));
            }
            if truth.scenario_time_s > 1.9 && done.is_none() {
                let status = output(ctl_command(&ipc, "status", &config).arg("--json"));
                done = Some((status, output(&mut ctl_command(&ipc, "reset", &config))));
            }
        });
        let (code, text) = refused.expect("asked while stopped");
        assert_eq!((code, text.contains("into the surface")), (Some(1), true), "{text}");
        let ((_, status), (code, text)) = done.expect("asked after the retreat");
        assert!(
            status.contains("\"stop_reason\":\"Infeasible\"") && status.contains("\"mode\":\"Stopped\""),
            "{status}"
        );
        assert_eq!((code, text.contains("from Stopped (Infeasible) to Idle")), (Some(0), true), "{text}");

        // With limits that can be met, touch again. The plant is a new one: its samples start anew.
        write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &PATIENT));
        daemon.signal(libc::SIGHUP);
        wait_for_log(&mut daemon, "reload: the new configuration is in force");
        let again = write(&ipc, "again.toml", &with_keys(PAPER_SCENARIO, &[("timing.command_delay_s", "0.001")]));
        run_plant(&ipc, &again, |_| {});
        wait_for_log(&mut daemon, "INFO Contact");
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}

#[test]
fn a_client_generated_from_the_schema_alone_drives_the_daemon() {
    undisturbed(|| {
        if !needs(Need::Python) {
            return;
        }
        let ipc = PrivateIpc::new("planar");
        let (code, schema) = output(Command::new(&binaries().admittancectl).args(["schema", "--json"]));
        assert_eq!(code, Some(0), "{schema}");
        let schema = write(&ipc, "schema.json", &schema);
        let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", MPC_PAPER));
        let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("python/schema_client.py");
        let settings = ipc.settings();
        let mut client = Command::new(python().expect("needs(Python) found one"));
        client.arg(script).arg(schema).arg(&settings.root_path).args([&settings.prefix, settings.instance.as_str()]);
        let mut client = Child::spawn(&mut client);
        let status = client.wait_for_exit(PATIENCE);
        assert!(status.success(), "{}\n{}", client.report(), daemon.report());
        let answer: serde_json::Value = serde_json::from_str(&client.stdout()).expect("one JSON object");
        println!("{answer}");
        // Some of the first pass unanswered, while the connections are being made.
        let mut unanswered = answer["unanswered"].as_array().expect("numbers").iter();
        assert!(answer["sent"] == 200 && unanswered.all(|number| number.as_u64() <= Some(10)), "{answer}");
        let opened = answer["opened"].as_array().expect("names");
        let services = ["state", "command", "record", "diagnostics", "request"];
        assert!(services.iter().all(|name| opened.contains(&(*name).into())), "{answer}");
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}
