//! Which real-time rights the daemon gets: reported at its start, and looked at beforehand by
//! `admittancectl doctor`.

use std::process::{Command, Output};

use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{daemon_command, start_daemon, with_keys, write};
use end_to_end::{PATIENCE, PrivateIpc, binaries};

/// A processor that no machine of this kind has.
const NO_SUCH_CPU: (&str, &str) = ("realtime.cpu", "1023");

fn output(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (status.code(), text(&stdout), text(&stderr))
}

#[test]
fn every_step_is_reported_at_start() {
    let nothing = [("realtime.lock_memory", "false"), ("realtime.priority", "0")];
    let steps = ["lock memory", "limit wake-up latency", "prefault", "timer slack", "run on processor", "SCHED_FIFO"];
    for (keys, words) in [
        (&[("realtime.cpu_dma_latency_us", "500"), NO_SUCH_CPU][..], &["done", "refused: "][..]),
        (&nothing[..], &["done", "not asked for"][..]),
    ] {
        let ipc = PrivateIpc::new("planar");
        let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &with_keys(MPC_DEFAULT, keys)));
        let log = daemon.stderr();
        for step in steps {
            let line = log.lines().find(|line| line.contains(&format!("real time: {step}")));
            let line = line.unwrap_or_else(|| panic!("nothing on {step}: {log}"));
            assert!(words.iter().any(|word| line.contains(word)), "{line}");
        }
        let refused = log.lines().find(|line| line.contains("run on processor 1023"));
        assert_eq!(
            refused.is_some_and(|line| line.contains("realtime.cpu must be")),
            keys.contains(&NO_SUCH_CPU),
            "{log}"
        );
        // The request for idle states lasts as long as the process.
        if log.contains("real time: limit wake-up latency to 500 us: done") {
            let open = std::fs::read_dir(format!("/proc/{}/fd", daemon.id())).expect("it runs").flatten();
            let mut targets = open.filter_map(|entry| std::fs::read_link(entry.path()).ok());
            assert!(targets.any(|target| target.ends_with("cpu_dma_latency")));
        }
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    }
}

#[test]
fn spinning_under_the_throttle_is_warned_of() {
    let runtime = std::fs::read_to_string("/proc/sys/kernel/sched_rt_runtime_us").unwrap_or_else(|_| "-1".to_owned());
    let ipc = PrivateIpc::new("planar");
    let text = with_keys(MPC_DEFAULT, &[("control.wait", "\"spin\"")]);
    let daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &text));
    let is_warned = daemon.stderr().contains("sysctl kernel.sched_rt_runtime_us=-1");
    assert_eq!(is_warned, !runtime.starts_with('-'), "{}", daemon.stderr());
}

#[test]
fn what_is_required_and_refused_ends_the_daemon() {
    let ipc = PrivateIpc::new("planar");
    let text = with_keys(MPC_DEFAULT, &[NO_SUCH_CPU, ("realtime.require_realtime", "true")]);
    let (code, _, error) = output(&mut daemon_command(&ipc, &write(&ipc, "daemon.toml", &text)));
    assert_eq!(code, Some(77), "{error}");
    assert!(error.contains("realtime.require_realtime") && error.contains("realtime.cpu must be"), "{error}");
}

#[test]
fn the_doctor_says_what_is_found_and_what_to_change() {
    let ctl = &binaries().admittancectl;
    let (code, text, error) = output(Command::new(ctl).args(["doctor", "--json"]));
    assert_eq!(code, Some(0), "warnings alone are no failure: {text}{error}");
    let json: serde_json::Value = serde_json::from_str(&text).expect("one JSON object");
    let checks = json["checks"].as_array().expect("a list");
    assert!(checks.len() >= 10, "{text}");
    for check in checks {
        assert!(check["found"].as_str().is_some_and(|found| !found.is_empty()), "{check}");
        let is_well = check["status"] == "ok";
        assert!(is_well || check["change"].as_str().is_some_and(|change| !change.is_empty()), "{check}");
    }

    let ipc = PrivateIpc::new("planar");
    let text = with_keys(MPC_DEFAULT, &[NO_SUCH_CPU, ("realtime.require_realtime", "true")]);
    let config = write(&ipc, "daemon.toml", &text);
    let (code, text, error) = output(Command::new(ctl).args(["doctor", "--config"]).arg(&config));
    assert_eq!(code, Some(1), "{text}{error}");
    let line = text.lines().find(|line| line.contains("REFUSED") && line.contains("processors"));
    assert!(line.is_some(), "{text}");
    let (code, _, error) = output(Command::new(ctl).args(["doctor", "--config", "/no/such/file"]));
    assert_eq!((code, error.contains("/no/such/file")), (Some(66), true), "{error}");
}

#[test]
fn the_jitter_benchmark_ends_with_figures_or_says_why_not() {
    let lab = &binaries().admittance_lab;
    let arguments = ["bench", "jitter", "--rate-hz", "250", "--seconds", "1", "--json"];
    let (code, text, error) = output(Command::new(lab).args(arguments));
    if code == Some(75) {
        println!("SKIPPED: {error}");
        return;
    }
    assert!(matches!(code, Some(0 | 77)), "{code:?}: {error}");
    let json: serde_json::Value = serde_json::from_str(&text).expect("one JSON object");
    assert_eq!(json["rate_hz"], 250);
    assert!(json["cycles"].as_u64().is_some_and(|cycles| cycles > 0), "{text}");
    for key in ["missed", "reference_missed"] {
        assert!(json[key].is_u64(), "{key}: {text}");
    }
    for key in ["reference_us", "cycle_us", "ratio"] {
        for percentile in ["p50", "p99", "p999", "max"] {
            assert!(json[key][percentile].is_number(), "{key}.{percentile}: {text}");
        }
    }
}
