//! Requests to a running daemon: an accepted request says what it changed, a refused one why and
//! what would be accepted, and a replay reproduces all of it.

mod cell;

use std::path::{Path, PathBuf};

use admittance_host::clock::monotonic_ns;
use cell::{Cell, configuration};
use end_to_end::session::{PAPER_SCENARIO, ctl_command, output, run_plant, until, wait_for_log, with_keys, write};
use end_to_end::{Child, PATIENCE, PrivateIpc, binaries, certain, undisturbed};
use ipc_types::services::{self, Access};
use ipc_types::{RequestKind, RequestSample, ResponseSample, ResponseStatus};
use serde_json::Value;

/// Everything that may be allowed.
const ALLOWED: (&str, &str) = (
    "requests",
    "{ force_limit_min = [10.0, 10.0], force_limit_max = [300.0, 300.0], normal_stiffness_min_n_m = 1e4, \
     normal_stiffness_max_n_m = 2e5, surface_normal_angle_rad = 0.2, contact_point_distance_m = 0.05, law = true, \
     tare_bias_max = [4.0, 4.0, 4.0, 1.0, 1.0, 1.0] }",
);
const DAMPING: (&str, &str) = ("damping", "{ damping_n_s_m = [500.0, 500.0] }");
/// Ends the recording and replays it: every answer is bit-identical.
fn replayed(mut recorder: Child, file: &Path) -> String {
    recorder.signal(libc::SIGINT);
    assert_eq!(recorder.wait_for_exit(PATIENCE).code(), Some(0), "{}", recorder.report());
    let (code, text) = output(std::process::Command::new(&binaries().admittancectl).arg("replay").arg(file));
    certain(|| assert_eq!(code, Some(0), "{text}"));
    println!("{text}");
    text
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|number| number.as_f64().expect("a number")).collect()
}

#[test]
fn in_free_motion_all_of_it_is_done_within_its_bounds() {
    undisturbed(|| {
        let mut cell = Cell::new(&[ALLOWED, DAMPING]);
        let (recorder, file) = cell.record();
        let plant = cell.at_rest();
        cell.wait_for_mode("Free");

        cell.done(
            &["set-force-limit", "x=150", "y=120"],
            "force limit x 200.0 -> 150.0 N, force limit y 200.0 -> 120.0 N",
        );
        cell.refused(&["set-force-limit", "x=500"], &["force limit x = 500 N", "accepted: 10 to 300 N"]);
        cell.refused(&["set-force-limit", "x=NaN"], &["force limit x = NaN", "accepted: 10 to 300 N"]);
        cell.refused(&["set-force-limit", "z=100"], &["this arm has no axis z; accepted: x y"]);
        cell.done(&["set-force-limit", "x=150"], "nothing changed");
        assert_eq!(numbers(&cell.status()["force_limit"])[..2], [150.0, 120.0]);

        cell.done(&["set-environment", "--stiffness", "5e4"], "stiffness 20000 -> 50000 N/m");
        cell.refused(&["set-environment", "--stiffness", "1e6"], &["1000000 N/m", "accepted: 10000 to 200000 N/m"]);
        cell.done(
            &["set-environment", "--contact-point", "1.33", "0.68", "0"],
            "(1.3200, 0.6800, 0.0000) -> (1.3300, 0.6800",
        );
        cell.refused(
            &["set-environment", "--contact-point", "1.32", "-0.68", "0"],
            &["1.3600 m from the file's", "at most 0.05 m"],
        );
        // What does not fit into an answer is cut off: 309 digits left no room for what is accepted.
        let far = ["set-environment", "--contact-point", "1e300", "1.7976931348623157e308", "1e300"];
        cell.refused(&far, &["(1e300, 1.79769e308, 1e300) m", "at most 0.05 m (requests.contact_point_distance_m)"]);
        cell.refused(&["set-environment", "--stiffness", "1e300"], &["1e300 N/m", "accepted: 10000 to 200000 N/m"]);
        cell.done(
            &["set-environment", "--normal", "0.5", "0.9", "0"],
            "surface normal (0.4226, 0.9063, 0.0000) -> (0.4856, 0.8742",
        );
        cell.refused(&["set-environment", "--normal", "0", "-1", "0"], &["rad from the file's", "at most 0.2 rad"]);
        cell.refused(&["set-environment", "--normal", "0", "0", "0"], &["a vector that is not zero"]);

        cell.done(&["set-law", "damping"], "law mpc -> damping");
        assert_eq!(cell.status()["law"], "Damping");
        cell.done(&["set-law", "mpc"], "law damping -> mpc");

        cell.done(&["disable"], "enabled -> disabled: from Free to Idle");
        cell.wait_for_mode("Idle");
        assert_eq!(
            (&cell.status()["enabled"], &cell.status()["stop_reason"]),
            (&Value::Bool(false), &"Disabled".into())
        );
        cell.done(&["disable"], "disabled already: nothing changed");
        cell.refused(&["tare"], &["accepted in mode Free"]);
        cell.refused(&["reset"], &["the mode is Idle, not Stopped"]);
        cell.done(&["enable"], "disabled -> enabled: from Idle to Free");
        cell.wait_for_mode("Free");
        cell.done(&["enable"], "enabled already: nothing changed");

        // The file holds again.
        let (code, text) = cell.ask(&["reload"]);
        assert_eq!(code, Some(0), "{text}");
        for expected in
            ["in force: ", "force limit x 150.0 -> 200.0 N", "stiffness 50000 -> 20000 N/m", "contact point (1.3300"]
        {
            assert!(text.contains(expected), "{text} lacks {expected:?}");
        }
        cell.done(&["reload"], "nothing has changed");
        assert_eq!(numbers(&cell.status()["force_limit"])[..2], [200.0, 200.0]);
        wait_for_log(&mut cell.daemon, "request: law mpc -> damping");
        wait_for_log(&mut cell.daemon, "request: set-force-limit refused: force limit x = 500 N");

        drop(plant);
        let text = replayed(recorder, &file);
        assert!(!text.contains("nothing after it is compared"), "{text}");
    });
}

#[test]
fn a_recording_that_begins_after_a_request_knows_what_was_in_force() {
    undisturbed(|| {
        let mut cell = Cell::new(&[ALLOWED, DAMPING]);
        let plant = cell.at_rest();
        cell.wait_for_mode("Free");
        cell.done(&["set-law", "damping"], "law mpc -> damping");
        cell.done(&["set-force-limit", "x=100"], "-> 100.0 N");
        // The file says nothing of it.
        let (recorder, file) = cell.record();
        cell.daemon.wait_until("some seconds of records", PATIENCE, |_| {
            std::fs::metadata(&file).is_ok_and(|file| file.len() > 300_000)
        });
        let text = replayed(recorder, &file);
        assert!(text.contains("after 128 cycles in free motion"), "{text}");
        drop(plant);
    });
}

#[test]
fn what_the_configuration_does_not_allow_is_refused_with_the_key_that_would() {
    undisturbed(|| {
        let mut cell = Cell::new(&[]);
        let _plant = cell.at_rest();
        cell.wait_for_mode("Free");
        let requests: [(&[&str], &str); 6] = [
            (&["set-force-limit", "x=150"], "requests.force_limit_min and requests.force_limit_max"),
            (&["set-environment", "--stiffness", "1e5"], "requests.normal_stiffness_min_n_m and"),
            (&["set-environment", "--normal", "0", "1", "0"], "requests.surface_normal_angle_rad"),
            (&["set-environment", "--contact-point", "1", "1", "0"], "requests.contact_point_distance_m"),
            (&["set-law", "damping"], "requests.law = true"),
            (&["tare"], "requests.tare_bias_max"),
        ];
        for (words, key) in requests {
            cell.refused(words, &["the configuration does not allow it; accepted with", key]);
        }
        // A law without its section, and a limit below what the rest of the configuration needs.
        let text = configuration(&[ALLOWED, ("contact.minimum_force", "[20.0, 20.0]")]);
        write(&cell.ipc, "daemon.toml", &text);
        cell.done(&["reload"], "the new configuration is in force");
        cell.refused(&["set-law", "damping"], &["[damping] section"]);
        cell.refused(
            &["set-force-limit", "y=15"],
            &["contact.minimum_force[1] = 20", "below contact.force_limit[1] = 15"],
        );
        // A file that is not TOML.
        write(&cell.ipc, "broken.toml", "this is not TOML");
        let (code, text) = output(&mut ctl_command(&cell.ipc, "reload", &cell.ipc.directory().join("broken.toml")));
        assert_eq!(code, Some(78), "{text}");
        for words in [&["set-force-limit"][..], &["set-force-limit", "w=3"], &["set-environment"], &["set-law", "none"]]
        {
            let (code, text) = cell.ask(words);
            assert_eq!(code, Some(64), "{words:?}: {text}");
        }
        cell.daemon.signal(libc::SIGKILL);
        cell.daemon.wait_for_exit(PATIENCE);
        let (code, text) = cell.ask(&["enable"]);
        assert_eq!(code, Some(69), "{text}");
    });
}

/// Sends a request as it is and waits for its answer.
fn send(ipc: &PrivateIpc, request: RequestSample) -> ResponseSample {
    let node = ipc.settings().node("test").expect("a node");
    let service = services::request(&node, &ipc.settings().instance, Access::Open).expect("the daemon made it");
    let client = service.client().expect("a client");
    let pending = client.send_copy(request).expect("sent");
    let mut response = None;
    end_to_end::wait_until("an answer", PATIENCE, || {
        response = pending.receive().expect("received").map(|response| *response);
        response.is_some()
    });
    response.expect("just received")
}

#[test]
fn a_request_after_its_deadline_changes_nothing() {
    undisturbed(|| {
        let mut cell = Cell::new(&[ALLOWED]);
        let _plant = cell.at_rest();
        cell.wait_for_mode("Free");
        for kind in RequestKind::ALL {
            let values = [100.0; 8];
            let late = RequestSample {
                id: 7,
                deadline_ns: monotonic_ns() - 1,
                kind: kind.code(),
                force: 0,
                law: 2,
                given: 3,
                values,
            };
            let response = send(&cell.ipc, late);
            let what = format!("{kind}: {}", response.text());
            assert_eq!((response.id, response.status), (7, ResponseStatus::Expired.code()), "{what}");
            assert!(response.text().contains("after its deadline"), "{what}");
            assert_eq!((response.law, response.enabled, response.force_limit[0]), (1, 1, 200.0), "{what}");
        }
        let unknown = RequestSample { deadline_ns: u64::MAX, kind: 99, ..RequestSample::zeroed() };
        let response = send(&cell.ipc, unknown);
        assert_eq!(response.status, ResponseStatus::Unknown.code());
        assert!(response.text().contains("accepted: 1 (Status), 2 (Reset), 3 (Enable)"), "{}", response.text());
        // An incomplete vector is refused.
        let part = RequestSample { kind: RequestKind::SetEnvironment.code(), given: 0b0110, ..unknown };
        let response = send(&cell.ipc, part);
        assert_eq!(response.status, ResponseStatus::Refused.code());
        assert!(response.text().contains("2 of the coordinates x y z"), "{}", response.text());
    });
}

/// How long that lasts.
const LONG_CONTACT_S: f64 = 5.8;

/// A contact of some seconds: approached at 0.03 m/s, then pushed at hardly any speed.
fn long_contact(ipc: &PrivateIpc) -> PathBuf {
    let changes = [
        ("motion", "[{ duration_s = 0.8, twist = [0.0, -0.03] }, { duration_s = 5.0, twist = [0.0, -0.01] }]"),
        ("start.contact_time_s", "0.4"),
        ("timing.command_delay_s", "0.003"),
        ("surface.stiffness_n_m", "2e4"),
    ];
    write(ipc, "contact.toml", &with_keys(PAPER_SCENARIO, &changes))
}

#[test]
fn in_contact_only_the_force_limit_may_change_and_disable_stops_at_a_low_force() {
    undisturbed(|| {
        let cell = Cell::new(&[ALLOWED, DAMPING]);
        let (recorder, file) = cell.record();
        let scenario = long_contact(&cell.ipc);
        let (mut asked, mut stopped_at) = (0, None);
        let truths = run_plant(&cell.ipc, &scenario, |truth| {
            if truth.scenario_time_s > 1.0 && asked == 0 {
                asked = 1;
                assert_eq!(cell.status()["mode"], "Contact");
                let in_contact = ["the arm is in contact: accepted in the modes Idle, Free and Stopped"];
                cell.refused(&["set-environment", "--stiffness", "5e4"], &in_contact);
                cell.refused(&["set-law", "damping"], &in_contact);
                cell.refused(&["tare"], &["in free motion only"]);
                cell.refused(&["reset"], &["the mode is Contact, not Stopped"]);
                cell.done(&["enable"], "enabled already");
                cell.done(&["reload"], "nothing has changed");
                cell.done(&["set-force-limit", "x=150", "y=150"], "force limit x 200.0 -> 150.0 N");
                cell.refused(&["reload"], &in_contact);
                assert_eq!(cell.status()["mode"], "Contact");
            }
            if truth.scenario_time_s > 3.0 && asked == 1 {
                asked = 2;
                cell.done(&["disable"], "from Contact over a stop at a low force to Stopped");
                stopped_at = Some(truth.scenario_time_s);
            }
            if truth.scenario_time_s > 4.5 && asked == 2 {
                asked = 3;
                let status = cell.status();
                assert_eq!(
                    (&status["mode"], &status["stop_reason"]),
                    (&"Stopped".into(), &"Disabled".into()),
                    "{status}"
                );
                cell.refused(&["reset", "--force"], &["control is disabled"]);
                cell.done(&["enable"], "disabled -> enabled: Stopped until a reset");
            }
        });
        assert_eq!(asked, 3, "the contact is long enough");
        let peak = truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max);
        let rest = until(&truths, LONG_CONTACT_S).last().expect("a run").normal_force_n;
        println!("peak {peak:.1} N, at rest {rest:.1} N");
        assert!(peak < 230.0 && rest <= 100.0, "peak {peak} N, at rest {rest} N");
        replayed(recorder, &file);
    });
}

#[test]
fn a_limit_below_the_present_force_leads_below_it_or_to_a_stop() {
    undisturbed(|| {
        // The law aims at a force far above the new limit.
        let aim = [("contact.normal_force_reference_n", "120.0"), ("mpc.wrench_weight", "[1.0, 1.0]")];
        let cell = Cell::new(&[&[ALLOWED][..], &aim].concat());
        let scenario = long_contact(&cell.ipc);
        let mut lowered = None;
        let truths = run_plant(&cell.ipc, &scenario, |truth| {
            if truth.scenario_time_s > 2.0 && lowered.is_none() {
                let mode = cell.status()["mode"].clone();
                lowered = Some((truth.normal_force_n, mode));
                cell.done(&["set-force-limit", "x=40", "y=40"], "force limit y 200.0 -> 40.0 N");
            }
        });
        let (before, mode) = lowered.expect("asked");
        assert_eq!(mode, "Contact", "before the request");
        assert!(before > 60.0, "{before} N are not above the new limit");
        let after: Vec<_> = truths.iter().filter(|truth| truth.scenario_time_s > 2.0).collect();
        let peak = after.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max);
        let rest = until(&truths, LONG_CONTACT_S).last().expect("a run").normal_force_n;
        let status = cell.status();
        println!("{before:.1} N before, {peak:.1} N at most, {rest:.1} N at the end: {}", status["text"]);
        assert!(peak < before + 10.0, "no jump: {peak} N after {before} N");
        assert!(rest < 45.0, "{rest} N are left");
    });
}
