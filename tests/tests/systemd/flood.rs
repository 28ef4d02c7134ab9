//! More requests than the daemon can answer, under a watchdog that sees any delay.

use end_to_end::{Need, binaries, certain, needs, undisturbed, wait_until};
use end_to_end::{PATIENCE, Systemd};

use crate::units::*;
use admittance_host::clock::monotonic_ns;

/// What a flood may cost a feed, a signal or another client's request, in ms.
const BOUND_MS: f64 = 200.0;
/// Between two feeds there are 100 ms: a delay by the bound is an abort.
const WATCHDOG: &str = "[Service]\nWatchdogSec=300ms\n";

/// Requests a second that have to be sent, and are asked for: on a busy machine some turns are missed.
const FLOOD_HZ: f64 = 10_000.0;
const RATE_HZ: u32 = 15_000;

/// The words of a flood for this long.
fn flood(seconds: u32) -> String {
    format!(
        "runuser -u admittanced -- admittance-lab flood --instance robot --clients 8 --rate-hz {RATE_HZ} --seconds {seconds} --json"
    )
}

/// Time in ms from `begun` (ns) to a log entry.
fn milliseconds_to(systemd: &Systemd, begun: u64, matches: &str) -> f64 {
    let entry = systemd.wait_for_entry(matches);
    let stamp = entry["__MONOTONIC_TIMESTAMP"].as_str().and_then(|text| text.parse::<u64>().ok());
    (stamp.expect("every entry has one") * 1000).saturating_sub(begun) as f64 * 1e-6
}

#[test]
fn a_flood_of_requests_starves_neither_watchdog_nor_signals_nor_others() {
    undisturbed(|| {
        if !needs(Need::Systemd) {
            return;
        }
        let systemd = installed(&config(&[]), &in_the_air());
        // From outside: a checkout below /tmp is hidden inside.
        let lab = systemd.path("/usr/local/bin/admittance-lab");
        std::fs::copy(&binaries().admittance_lab, lab).expect("copied");
        systemd.run(&format!("systemctl start {PLANT}"));
        entry_of_this_process(&systemd, "MODE=Free");
        // As it is shipped: for the watchdog of seconds no machine is too busy.
        let (code, text) = systemd.try_run(&flood(5));
        certain(|| assert_eq!((code, systemd.number(DAEMON, "NRestarts")), (Some(0), 0), "{text}"));

        systemd.write("/run/systemd/system/admittanced@robot.service.d/watchdog.conf", WATCHDOG);
        systemd.run(&format!("systemctl daemon-reload; systemctl restart {DAEMON}"));
        entry_of_this_process(&systemd, "MODE=Free");
        let text = systemd.run(&flood(12));
        let flooded: serde_json::Value = serde_json::from_str(&text).expect("one JSON object");
        println!("{text}");
        let number = |name: &str| flooded[name].as_f64().expect("a number");
        assert!(number("requests_per_second") >= FLOOD_HZ, "too few to be a flood: {text}");
        assert!(number("longest_wait_ms") - number("longest_wait_before_ms") <= BOUND_MS, "{text}");
        assert_eq!(systemd.number(DAEMON, "NRestarts"), 0, "the watchdog has aborted it");

        // Of the thousands that were refused the log has some, and their number.
        let process = systemd.property(DAEMON, "MainPID");
        entry_of_this_process(&systemd, "--grep='more like this: request: reset refused'");
        let lines = systemd.journal(&format!("-u {DAEMON} _PID={process} REQUEST=Reset")).len();
        certain(|| assert!((1..100).contains(&lines), "{lines} lines"));

        // Both signals in the middle of another one.
        systemd.run(&format!("systemd-run --quiet --unit=flood {}", flood(600)));
        let asked = || systemd.journal(&format!("-u {DAEMON} _PID={process} --grep='more like this'")).len();
        let before = asked();
        wait_until("the flood", PATIENCE, || asked() > before);
        for (signal, answer) in
            [(libc::SIGHUP, "reload: nothing has changed"), (libc::SIGTERM, "SIGTERM: ending control")]
        {
            let begun = monotonic_ns();
            systemd.signal(DAEMON, signal);
            let delay = milliseconds_to(&systemd, begun, &format!("-u {DAEMON} _PID={process} --grep='{answer}'"));
            println!("{answer}: after {delay:.1} ms");
            assert!(delay <= BOUND_MS, "{answer}: after {delay} ms");
        }
        wait_for_state(&systemd, DAEMON, "inactive");
        assert_ended_well(&systemd, DAEMON);
        systemd.run("systemctl stop flood");
    });
}
