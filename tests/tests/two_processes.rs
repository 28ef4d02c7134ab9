//! Daemon and plant as two real processes over real shared memory, in real time.

use end_to_end::session::{
    CONTRADICTION, MPC_PAPER, PAPER_SCENARIO, PATIENT, daemon_command, run_plant, start_daemon, until, wait_for_log,
    with_keys, write,
};
use end_to_end::{Child, PATIENCE, PrivateIpc, undisturbed};
use ipc_types::{Motion, TruthSample};
use plant_sim::scenario::Scenario;
use plant_sim::summary::Summary;

/// Tests are not built for release: the command acts after a millisecond instead of the demo's
/// quarter.
const DELAY: (&str, &str) = ("timing.command_delay_s", "0.001");

/// What the scenario commands.
const MOTION_S: f64 = 2.0;

fn scenario(changes: &[(&str, &str)]) -> String {
    with_keys(PAPER_SCENARIO, &[&[DELAY], changes].concat())
}

/// The paper's MPC, for tests that are not about deadlines.
fn patient(changes: &[(&str, &str)]) -> String {
    with_keys(MPC_PAPER, &[&PATIENT, changes].concat())
}

/// Fails when a busy machine, and not what is `expected`, made the daemon stop.
fn assert_stopped_for(expected: &str, daemon: &Child) {
    let (log, by_machine) = (daemon.stderr(), ["SampleStale", "SamplesMissed", "FallbackExhausted", "RateMismatch"]);
    assert!(log.contains(expected) || !by_machine.iter().any(|reason| log.contains(reason)), "{log}");
}

/// Runs the paper's experiment until the daemon has stopped.
fn run_until_stopped(daemon_config: &str, scenario: &str, expected: &str) -> (Vec<TruthSample>, Child, PrivateIpc) {
    let ipc = PrivateIpc::new("planar");
    let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", daemon_config));
    let truths = run_plant(&ipc, &write(&ipc, "scenario.toml", scenario), |_| {});
    wait_for_log(&mut daemon, "Stopped");
    assert_stopped_for(expected, &daemon);
    (truths, daemon, ipc)
}

#[test]
fn the_papers_experiment_keeps_the_limit_and_the_contact() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &patient(&[])));
        let parsed: Scenario = admittance_host::config::parse(&scenario(&[]), "scenario.toml").expect("valid");
        let mut summary = Summary::of_scenario(&parsed);
        run_plant(&ipc, &write(&ipc, "scenario.toml", &scenario(&[])), |truth| summary.add(truth));
        println!("peak |f_y| {:.1} N, settled {:.1} N", summary.peak_force_y_n, summary.settled_force_y_n());
        assert!(summary.first_contact_s.is_some());
        assert!(
            summary.peak_force_y_n <= 230.0,
            "a delay of 1 ms that the paper's model does not know costs some newtons"
        );
        assert_eq!(summary.contact_losses, 0);
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}

/// Starts the experiment and sends `signal` to the daemon at this time of the scenario; the plant's
/// truth and the daemon's log.
fn stopped_at(time_s: f64, signal: i32, expected: &str) -> (Vec<TruthSample>, String) {
    let ipc = PrivateIpc::new("planar");
    let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &patient(&[])));
    let mut sent = false;
    let truths = run_plant(&ipc, &write(&ipc, "scenario.toml", &scenario(&[])), |truth| {
        if !sent && truth.scenario_time_s >= time_s {
            daemon.signal(signal);
            sent = true;
        }
    });
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    assert_stopped_for(expected, &daemon);
    (truths, daemon.stderr())
}

#[test]
fn sigterm_in_contact_ends_held_at_a_low_force() {
    undisturbed(|| {
        let (truths, log) = stopped_at(1.2, libc::SIGTERM, "Stopped: Shutdown");
        assert!(log.contains("Stopped: Shutdown"), "{log}");
        let last = until(&truths, MOTION_S).last().expect("a run");
        assert_eq!(last.motion, Motion::Hold.code());
        println!("resting force {:.1} N", last.normal_force_n);
        assert!(
            last.normal_force_n <= 105.0,
            "resting force {} N, accepted: half the limit and what the coast adds",
            last.normal_force_n
        );
        let speed = last.tcp_twist.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!(speed < 1e-3, "the arm still moves at {speed} m/s");
    });
}

#[test]
fn sigint_in_free_motion_ends_at_once_and_the_controller_stops_by_itself() {
    undisturbed(|| {
        // Any stop in the log before the end fails the test.
        let (truths, log) = stopped_at(0.3, libc::SIGINT, "no stop");
        assert!(log.contains("SIGINT") && !log.contains("Stopped"), "{log}");
        assert_eq!(
            until(&truths, MOTION_S).last().expect("a run").motion,
            Motion::Hold.code(),
            "no valid command: the plant holds"
        );
        assert!(truths.iter().all(|truth| truth.in_contact == 0), "it stopped before it reached the surface");
    });
}

#[test]
fn samples_that_may_not_reach_the_law_stop_the_arm_with_their_reason() {
    undisturbed(|| {
        for (kind, reason) in [
            ("nan_wrench", "wrench[1] is not finite"),
            ("wrench_invalid", "wrench_valid = 0"),
            ("joint_count", "joint_count = 3"),
            ("freeze", "SampleStale"),
            ("drop", "SampleStale"),
            ("drives_disabled", "DrivesDisabled"),
        ] {
            let fault = format!("[{{ at_s = 1.2, duration_s = 2.0, kind = \"{kind}\" }}]");
            let scenario = scenario(&[("fault", &fault)]);
            // What counts as stale is part of this test: as shipped.
            let (truths, mut daemon, _ipc) = run_until_stopped(MPC_PAPER, &scenario, reason);
            wait_for_log(&mut daemon, reason);
            let last = until(&truths, MOTION_S).last().expect("a run");
            assert_eq!(last.motion, Motion::Hold.code(), "{kind}: {}", daemon.report());
            daemon.terminate();
            assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{kind}: {}", daemon.report());
        }
    });
}

#[test]
fn an_infeasible_contact_is_a_latched_stop_that_says_what_is_missing() {
    undisturbed(|| {
        let expected = "Stopped: Infeasible, the ";
        let config = patient(&[CONTRADICTION]);
        let (truths, mut daemon, _ipc) = run_until_stopped(&config, &scenario(&[]), expected);
        wait_for_log(&mut daemon, expected);
        assert!(daemon.stderr().contains("is missed by at least"), "{}", daemon.report());
        assert_eq!(until(&truths, MOTION_S).last().expect("a run").motion, Motion::Hold.code());
    });
}

#[test]
fn a_singular_pose_is_said_and_stops() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &patient(&[])));
        // Nearly stretched: the plant can still move there, the daemon's bound is stricter.
        let mut table: toml::Table = scenario(&[("start.joint_position_rad", "[1.0, -0.02]")]).parse().expect("TOML");
        table.remove("surface");
        table["start"].as_table_mut().expect("a section").remove("contact_time_s");
        table["motion"] = toml::Value::try_from([toml::Table::from_iter([
            ("duration_s".to_owned(), toml::Value::Float(0.2)),
            ("twist".to_owned(), toml::Value::try_from([0.0, 0.0]).expect("an array")),
        ])])
        .expect("an array of tables");
        run_plant(&ipc, &write(&ipc, "scenario.toml", &table.to_string()), |_| {});
        wait_for_log(&mut daemon, "Stopped: Singular, the Jacobian is not invertible at the measured pose");
    });
}

#[test]
fn the_daemon_starts_answers_and_stays_small() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let started = std::time::Instant::now();
        let mut daemon = Child::spawn(&mut daemon_command(&ipc, &write(&ipc, "daemon.toml", MPC_PAPER)));
        let mut first_answer = None;
        let quick = scenario(&[("motion", "[{ duration_s = 0.3, twist = [0.0, -0.25] }]"), ("timing.settle_s", "0.1")]);
        let truths = run_plant(&ipc, &write(&ipc, "scenario.toml", &quick), |truth| {
            if truth.answer_time_ns > 0 {
                first_answer.get_or_insert_with(|| started.elapsed());
            }
        });
        assert!(!truths.is_empty());
        let status = std::fs::read_to_string(format!("/proc/{}/status", daemon.id())).expect("the daemon runs");
        let line = status.lines().find(|line| line.starts_with("VmHWM")).expect("the kernel says it");
        let kib: u64 = line.split_whitespace().nth(1).and_then(|value| value.parse().ok()).expect("a number");
        println!("first answer seen after {first_answer:?} (plant's start included), peak memory {kib} KiB");
        assert!(first_answer.is_some());
        assert!(kib < 64 * 1024, "peak memory {kib} KiB");
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0));
    });
}
