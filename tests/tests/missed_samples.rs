//! How state samples come, through the real programs: a controller that forgets to notify, one of
//! which most samples are missed, one that pauses, one whose sequence jumps or is left at 0, and
//! one whose position jumps while the arm is stopped.

use std::path::PathBuf;
use std::time::Duration;

use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{
    PAPER_SCENARIO, PATIENT, ctl_command, output, plant_command, run_plant, start_daemon, until, wait_for_log,
    with_keys, write,
};
use end_to_end::{Answers, Child, PrivateIpc, undisturbed};
use ipc_types::{CommandSample, Motion, TruthSample};
use serde_json::Value;

/// First contact of the paper's scenario, s.
const CONTACT_S: f64 = 0.816;
/// What the scenario commands; after it the plant leaves the surface.
const MOTION_S: f64 = 2.0;
/// The force limit of y over its part of the normal: what the normal force may reach, N.
const LIMIT_N: f64 = 200.0 / 0.906_307_787;

/// Of a cycle of 4 ms.
const HALF_A_CYCLE: Duration = Duration::from_millis(2);

/// A daemon, and what it says.
struct Cell {
    ipc: PrivateIpc,
    config: PathBuf,
    daemon: Child,
}

impl Cell {
    /// The default profile, for a busy machine, with these keys besides.
    fn new(changes: &[(&str, &str)]) -> Self {
        let ipc = PrivateIpc::new("planar");
        let delay = ("control.command_delay_s", "0.001");
        let config = write(&ipc, "daemon.toml", &with_keys(MPC_DEFAULT, &[&PATIENT[..], &[delay], changes].concat()));
        let daemon = start_daemon(&ipc, &config);
        Self { ipc, config, daemon }
    }

    /// The paper's experiment with faults as (kind, first s, duration s).
    fn scenario(&self, faults: &[(&str, f64, f64)], changes: &[(&str, &str)]) -> PathBuf {
        let fault = |(kind, at_s, duration_s): &(&str, f64, f64)| {
            format!("{{ at_s = {at_s:?}, duration_s = {duration_s:?}, kind = \"{kind}\" }}")
        };
        let faults = format!("[{}]", faults.iter().map(fault).collect::<Vec<_>>().join(", "));
        let keys = [("timing.command_delay_s", "0.001"), ("fault", &faults)];
        write(&self.ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[&keys[..], changes].concat()))
    }

    /// Runs it.
    fn run(&self, faults: &[(&str, f64, f64)]) -> Run {
        let mut answers = Answers::of(self.ipc.settings());
        let mut said = None;
        let truths = run_plant(&self.ipc, &self.scenario(faults, &[]), |truth| {
            answers.collect();
            if said.is_none() && truth.scenario_time_s > 1.6 {
                said = Some((truth.stamp_ns, self.status(), self.ask(&["status"])));
            }
        });
        let (asked_ns, status, text) = said.expect("it was asked");
        Run { truths, answers, asked_ns, status, text }
    }

    fn ask(&self, words: &[&str]) -> String {
        output(ctl_command(&self.ipc, words[0], &self.config).args(&words[1..])).1
    }

    fn status(&self) -> Value {
        let text = self.ask(&["status", "--json"]);
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }

    fn log(&self) -> String {
        self.daemon.stderr()
    }
}

/// No sample was missed before `status` was asked, but those that came while a processor was away for half a cycle and more.
fn assert_none_missed(run: &Run, log: &str) {
    let missed = |command: &CommandSample| command.missed_count;
    run.answers.assert_excused("samples missed", missed, run.asked_ns, HALF_A_CYCLE, log);
}

/// A run of the experiment.
struct Run {
    truths: Vec<TruthSample>,
    answers: Answers,
    /// When `status` was asked, long before the end, ns.
    asked_ns: u64,
    /// What it said, as JSON and as text.
    status: Value,
    text: String,
}

fn peak(truths: &[TruthSample]) -> f64 {
    truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max)
}

#[test]
fn a_controller_that_forgets_to_notify_has_no_sample_missed_and_is_told() {
    for wait in ["\"event\"", "\"hybrid\""] {
        undisturbed(|| {
            let cell = Cell::new(&[("control.wait", wait), ("control.spin_s", "0.00001")]);
            let run = cell.run(&[("unnotified", -10.0, 20.0)]);
            let Run { truths, status, .. } = &run;
            let log = cell.log();
            println!("{wait}: {} missed of {}, peak {:.1} N", status["missed_count"], status["cycles"], peak(truths));
            assert_none_missed(&run, &log);
            assert!(peak(truths) <= LIMIT_N, "{} N", peak(truths));
            let last = until(truths, MOTION_S).last().expect("a run");
            assert_eq!((last.in_contact, last.motion), (1, Motion::Offset.code()), "{log}");
            assert!(wait != "\"event\"" || log.contains("the motion controller must notify state-arrival"), "{log}");
        });
    }
}

#[test]
fn a_daemon_that_spins_briefly_does_not_sleep_ever_longer() {
    undisturbed(|| {
        // It wakes up from its sleep later than it would have spun.
        let cell = Cell::new(&[("control.wait", "\"hybrid\""), ("control.spin_s", "0.00001")]);
        let Run { truths, status, .. } = cell.run(&[]);
        println!("wake-up {}, peak {:.1} N", status["wake_up_time"], peak(&truths));
        assert_eq!(status["mode"], "Contact", "answers came in time: {}", cell.log());
        assert!(peak(&truths) <= LIMIT_N, "{} N: {}", peak(&truths), cell.log());
    });
}

#[test]
fn an_arm_of_which_one_sample_in_thirteen_is_seen_does_not_touch() {
    undisturbed(|| {
        let cell = Cell::new(&[]);
        let Run { truths, status, text, .. } = cell.run(&[("sparse", -0.4, 10.0)]);
        let log = cell.log();
        println!("peak {:.1} N, {} missed; {text}", peak(&truths), status["missed_count"]);
        assert_eq!(peak(&truths), 0.0, "it is held before: {log}");
        assert!(log.contains("state samples missed: what the law acted on became up to 52.0 ms old"), "{log}");
        assert!(log.contains("Idle: SamplesMissed, 12 state samples before this one were missed"), "{log}");
        assert_eq!((&status["mode"], &status["stop_reason"]), (&"Idle".into(), &"SamplesMissed".into()), "{text}");
        assert!(status["missed_count"].as_u64().is_some_and(|missed| missed > 250), "{status}");
        assert!(status["missed_lately"].as_u64().is_some_and(|missed| (90..=100).contains(&missed)), "{status}");
        assert!(text.contains(" ms old, 9"), "{text}");
        assert!(text.contains("Idle (SamplesMissed), holding, 12 state samples"), "{text}");
    });
}

#[test]
fn samples_missed_in_contact_are_a_stop_with_its_own_reason() {
    // Once, for longer than the last plan lasts; and shorter, again and again.
    for (bridged, expected) in [("3", "12 of the last 100"), ("20", "36 of the last 100")] {
        undisturbed(|| {
            let cell = Cell::new(&[("control.max_consecutive_fallbacks", bridged)]);
            let Run { truths, status, .. } = cell.run(&[("sparse", CONTACT_S + 0.3, 10.0)]);
            let log = cell.log();
            println!(
                "{bridged}: peak {:.1} N, rests at {:.1} N",
                peak(&truths),
                truths[truths.len() - 1].normal_force_n
            );
            assert!(log.contains(": SamplesMissed, 12 state samples before this one were missed, "), "{log}");
            assert!(log.contains(expected), "{log}");
            let said = (&status["mode"], &status["stop_reason"], &status["motion"]);
            assert_eq!(said, (&"Stopped".into(), &"SamplesMissed".into(), &"Hold".into()), "{log}");
            assert!(peak(&truths) <= LIMIT_N, "{} N", peak(&truths));
        });
    }
}

#[test]
fn a_pause_in_contact_is_no_wrong_rate() {
    undisturbed(|| {
        let cell = Cell::new(&[]);
        // Each of 5 ms, two of them in a row.
        let at = [0.2, 0.3, 0.4, 0.404, 0.7, 0.8].map(|after| ("overrun", CONTACT_S + after, 0.004));
        let run = cell.run(&at);
        let Run { truths, status, .. } = &run;
        let log = cell.log();
        assert!(!log.contains("RateMismatch"), "{log}");
        assert_eq!(status["mode"], "Contact", "{log}");
        assert_none_missed(&run, &log);
        let longer = truths.windows(2).filter(|pair| pair[1].stamp_ns - pair[0].stamp_ns == 9_000_000).count();
        assert_eq!(longer, at.len(), "pauses");
    });
}

/// A controller whose cycle agrees with nothing: it is told so, and no `sampling_time_s` to set.
#[test]
fn samples_that_come_unevenly_are_a_wrong_rate_without_advice() {
    undisturbed(|| {
        let cell = Cell::new(&[]);
        // Four pauses of 5 ms and four cycles without one, in turn, until before the contact.
        let at: Vec<_> = (0..22).map(|turn| ("overrun", 0.032 * f64::from(turn), 0.016)).collect();
        cell.run(&at);
        let log = cell.log();
        assert!(log.contains("Idle: RateMismatch, samples come unevenly, every "), "{log}");
        assert!(!log.contains("set control.sampling_time_s"), "{log}");
    });
}

#[test]
fn a_stamp_that_is_a_cycle_late_in_contact_is_no_wrong_rate() {
    undisturbed(|| {
        let cell = Cell::new(&[]);
        // Some, one of which comes soon after another.
        let at = [0.2, 0.24, 0.28, 0.32, 0.4, 0.408].map(|after| ("late_stamp", CONTACT_S + after, 0.004));
        let run = cell.run(&at);
        let Run { truths, status, .. } = &run;
        let log = cell.log();
        assert!(!["RateMismatch", "sampling_time_s", "Stop"].iter().any(|word| log.contains(word)), "{log}");
        // The sample after it has the same stamp, and is refused: the last plan bridges it.
        assert_none_missed(&run, &log);
        assert_eq!((&status["mode"], &status["rejected_count"]), (&"Contact".into(), &at.len().into()), "{log}");
        assert!(peak(truths) <= LIMIT_N, "{} N", peak(truths));
        let last = until(truths, MOTION_S).last().expect("a run");
        assert_eq!((last.in_contact, last.motion), (1, Motion::Offset.code()), "{log}");
    });
}

#[test]
fn a_sequence_that_jumps_is_said_and_nothing_else() {
    undisturbed(|| {
        let cell = Cell::new(&[]);
        let run = cell.run(&[("sequence_jump", CONTACT_S + 0.3, 1.0)]);
        let Run { truths, status, .. } = &run;
        let log = cell.log();
        assert!(log.contains("sequence jumped by 1000000 to 1000"), "{log}");
        assert!(!log.contains("0.0000 ms") && !log.contains("RateMismatch"), "{log}");
        assert_eq!(status["mode"], "Contact", "{log}");
        assert_none_missed(&run, &log);
        assert!(peak(truths) <= LIMIT_N, "{} N", peak(truths));
    });
}

#[test]
fn a_sequence_left_at_zero_is_in_log_and_status() {
    let mut cell = Cell::new(&[]);
    let scenario = cell.scenario(&[("unnumbered", -60.0, 100.0)], &[]);
    let _plant = Child::spawn(&mut plant_command(&cell.ipc, &scenario));
    wait_for_log(&mut cell.daemon, "sample not used: sequence = 0: the motion controller must number its samples");
    let (text, status) = (cell.ask(&["status"]), cell.status());
    assert!(status.get("sample_age_ns").is_none() && text.contains("last sample       none yet"), "{status}");
    assert!(text.starts_with("Idle, sequence = 0: the motion controller must number its samples, from 1"), "{text}");
    assert!(status["rejected_count"].as_u64().is_some_and(|rejected| rejected > 0), "{status}");
    assert_eq!((&status["mode"], &status["cycles"]), (&"Idle".into(), &0.into()), "{status}");
}

#[test]
fn a_stopped_arm_whose_position_jumps_is_held_until_a_reset() {
    undisturbed(|| {
        let cell = Cell::new(&[("control.max_consecutive_fallbacks", "3")]);
        // Long before the jump ends the motion leads out of the surface.
        let phases = "[{ duration_s = 1.3, twist = [0.0, -0.25] }, { duration_s = 4.0, twist = [0.005, 0.02] }]";
        let scenario = cell.scenario(&[("position_jump", 1.1, 10.0)], &[("motion", phases)]);
        let mut asked = None;
        let truths = run_plant(&cell.ipc, &scenario, |truth| {
            if asked.is_none() && truth.scenario_time_s > 2.5 {
                let text = cell.ask(&["status"]);
                assert!(text.contains("a reset accepts where it is now"), "{text}");
                asked = Some((truth.scenario_time_s, cell.ask(&["reset"])));
            }
        });
        let (at, answer) = asked.expect("it was asked");
        let log = cell.log();
        assert!(log.contains("Stopped: SampleInvalid, joint_position[1] jumped by"), "{log}");
        let held = truths.iter().filter(|truth| (1.5..at).contains(&truth.scenario_time_s));
        assert!(held.clone().count() > 200 && held.clone().all(|truth| truth.motion == Motion::Hold.code()), "{log}");
        // What it knows of force and motion is from before the jump, when the arm pressed: the reset
        // is refused, and the arm believed. It may retreat.
        assert!(answer.contains("reset refused") && answer.contains("retreat"), "{answer}");
        assert!(
            truths.iter().any(|truth| truth.scenario_time_s > at && truth.motion == Motion::Offset.code()),
            "{log}"
        );
        assert!(truths.last().is_some_and(|truth| truth.in_contact == 0), "{log}");
    });
}
