//! The rehearsal of docs/commissioning.md, and what it is told of: a plant that ends leaves the
//! surface, and what comes next works.

use std::process::Command;

use end_to_end::session::{
    MPC_PAPER, PAPER_SCENARIO, PATIENT, ctl_command, drive_plant, output, start_daemon, until, wait_for_log, with_keys,
    write,
};
use end_to_end::{Child, PATIENCE, PrivateIpc, binaries, page, undisturbed};
use ipc_types::TruthSample;

const COMMISSIONING: &str = include_str!("../../docs/commissioning.md");
/// What the scenario commands.
const MOTION_S: f64 = 2.0;

fn patient() -> String {
    with_keys(MPC_PAPER, &PATIENT)
}

fn scenario() -> String {
    with_keys(PAPER_SCENARIO, &[("timing.command_delay_s", "0.001")])
}

/// How often the daemon has reported a contact.
fn contacts(daemon: &Child) -> usize {
    daemon.stderr().matches("INFO Contact").count()
}

/// Clear of the surface, and at rest.
fn assert_clear(truth: &TruthSample) {
    assert!(truth.in_contact == 0 && truth.penetration_m < -0.005, "{} m deep", truth.penetration_m);
    let speed = truth.tcp_twist.iter().map(|v| v * v).sum::<f64>().sqrt();
    assert!(speed < 1e-3, "{speed} m/s");
}

#[test]
fn the_commands_of_the_page_touch_stop_and_touch_again() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let settings = ipc.settings();
        let config = write(&ipc, "daemon.toml", &patient());
        let scenario = write(&ipc, "scenario.toml", &scenario());
        let place = format!("--root-path {} --prefix {}", settings.root_path.display(), settings.prefix);
        let programs = binaries();
        // As typed, with what was built for the tests, in a place of their own, and with patience.
        let typed = |line: &str| {
            line.replace("cargo run --release -p plant-sim --", &programs.plant_sim.to_string_lossy())
                .replace("cargo run --release -p admittanced --", &programs.admittanced.to_string_lossy())
                .replace("cargo run --release --", &programs.admittancectl.to_string_lossy())
                .replace("--config deploy/demo/mpc-paper.toml", &format!("--config {} {place}", config.display()))
                .replace(
                    "--scenario plant-sim/scenarios/paper.toml",
                    &format!("--scenario {} {place}", scenario.display()),
                )
        };
        let lines = page::commands(COMMISSIONING, "Rehearse by hand\n");
        assert!(lines[0].contains("-p admittanced") && lines.len() == 9, "{lines:#?}");
        let mut daemon = start_daemon(&ipc, &config);
        // The second terminal: one shell, each command there after the one before.
        let script = lines[1..].iter().map(|line| format!("echo \"== {line}\"\n{} || exit 9\n", typed(line)));
        let script = write(&ipc, "second-terminal.sh", &script.collect::<String>());
        let (code, said) = output(Command::new("sh").arg("-c").arg(format!("exec sh {} 2>&1", script.display())));
        println!("{said}");
        assert_eq!(code, Some(0), "each command does what the page says: {said}\n{}", daemon.report());
        let parts: Vec<&str> = said.split("== cargo run").collect();
        for (part, expected) in parts[1..].iter().zip([
            "retreated: the tool is",
            "",
            "",
            "from Contact over a stop at a low force to Stopped",
            "Stopped (Disabled)",
            "reset: from Stopped (Disabled) to Idle",
            "disabled -> enabled",
            "retreated: the tool is",
        ]) {
            assert!(part.contains(expected), "{expected:?} is missing in {part}");
        }
        assert!(parts[2].contains("\nFree") || parts[2].contains("\nIdle"), "{}", parts[2]);
        wait_for_log(&mut daemon, "INFO Contact");
        assert_eq!(contacts(&daemon), 3, "{}", daemon.report());
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}

#[test]
fn a_plant_that_is_asked_to_end_in_contact_retreats_first() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &patient());
        let scenario = write(&ipc, "scenario.toml", &scenario());
        let mut daemon = start_daemon(&ipc, &config);
        for (turn, signal) in [libc::SIGINT, libc::SIGTERM].into_iter().enumerate() {
            let mut was_sent = false;
            let truths = drive_plant(&ipc, &scenario, |plant, truth| {
                if !was_sent && truth.scenario_time_s > 1.2 {
                    assert_eq!(truth.in_contact, 1);
                    plant.signal(signal);
                    was_sent = true;
                }
            });
            let last = truths.last().expect("a run");
            assert!(was_sent && last.scenario_time_s < MOTION_S, "the motion was ended by the signal");
            assert_clear(last);
            assert_eq!(contacts(&daemon), turn + 1, "{}", daemon.report());
        }
        assert!(!daemon.stderr().contains("Stop"), "{}", daemon.report());
        let (code, text) = output(&mut ctl_command(&ipc, "status", &config));
        assert!(code == Some(0) && (text.starts_with("Free") || text.starts_with("Idle")), "{text}");
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}

/// A daemon that has ended keeps the arm where it is: the plant then leaves by itself.
#[test]
fn a_plant_leaves_the_surface_without_a_daemon_too() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &patient());
        let mut daemon = start_daemon(&ipc, &config);
        let mut was_sent = false;
        let truths = drive_plant(&ipc, &write(&ipc, "scenario.toml", &scenario()), |_, truth| {
            if !was_sent && truth.scenario_time_s > 1.2 {
                daemon.terminate();
                was_sent = true;
            }
        });
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
        assert_eq!(until(&truths, MOTION_S).last().expect("a run").in_contact, 1, "held where it was");
        assert_clear(truths.last().expect("a run"));
    });
}
