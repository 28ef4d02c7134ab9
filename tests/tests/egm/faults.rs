//! Everything that goes wrong, in free motion and in contact: the arm stands before CommTimeout, as its joints say, and the true
//! force stays below what the last plan and the standstill after it can reach.

use std::process::Command;
use std::thread;
use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use egm_messages::EgmRobot;
use end_to_end::{Child, PATIENCE, binaries, undisturbed};
use ipc_types::TruthSample;
use plant_sim::faults::FaultKind;

use crate::cell::{Cell, Files, MOST, fastest, peak};
use crate::network::{Network, ToEdge, ToRobot};

/// As docs/egm.md recommends it, s.
const COMM_TIMEOUT_S: f64 = 0.1;
/// Speed of the fastest joint in rad/s below which the arm stands: a millimetre per second at an arm's length, which is what
/// its lag leaves of a twentieth of a radian per second for some time.
const STANDS: f64 = 1e-3;
/// What is left of that 50 ms later, rad/s.
const RESTS: f64 = 1e-4;
const SETTLING_S: f64 = 0.05;

/// Of the scenario: speed of the approach and of the pressing in m/s, stiffness in N/m.
const INWARD: f64 = 0.02;
const STIFFNESS: f64 = 2e4;
/// How long an arm that is no longer answered moves at most, s: its message is under way for a cycle, the last plan lasts for
/// four, the robot acts in the next one, and its joints coast for their time constant.
const PLAN_S: f64 = 0.004 + 0.016 + 0.004 + 0.015;
/// For what straight lines leave out, as in the fault matrix; the second one in N.
const MARGIN: f64 = 1.1;
const MARGIN_N: f64 = 2.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Situation {
    Free,
    Contact,
}

impl Situation {
    /// When the fault comes, s of the scenario.
    fn begins_s(self) -> f64 {
        match self {
            Self::Free => 0.15,
            Self::Contact => 0.8,
        }
    }

    fn changes(self, fault: &str) -> Vec<(&'static str, String)> {
        let (contact_s, motion_s) = match self {
            // The surface is further than the motion goes.
            Self::Free => ("1.5", 0.7),
            Self::Contact => ("0.4", 1.3),
        };
        let motion = format!("[{{ duration_s = {motion_s}, twist = [0.02, 0.015, -{INWARD}, 0.0, 0.0, 0.0] }}]");
        vec![
            ("start.contact_time_s", contact_s.to_owned()),
            ("motion", motion),
            ("timing.settle_s", "0.5".to_owned()),
            ("egm.comm_timeout_s", COMM_TIMEOUT_S.to_string()),
            ("fault", fault.to_owned()),
        ]
    }
}

/// How a fault ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    /// The arm goes on under control.
    GoesOn,
    /// It stands before CommTimeout, which does not come.
    Stands,
    /// The same, until another session of the robot has begun: in free motion that goes on, in contact it is held.
    StandsUntilAnew,
    /// The robot is no longer told anything: it keeps its last speed until CommTimeout, and stands then.
    CommTimeout,
}

/// What is done to a process, with its name.
type ToProcess = (&'static str, fn(&mut Cell));

/// How a fault comes.
#[derive(Clone, Copy)]
enum Injection {
    /// By the scenario.
    Scripted(FaultKind),
    /// By the network.
    Network(ToEdge, ToRobot),
    /// By this.
    Process(fn(&mut Cell)),
}

/// How long a scripted fault lasts, s.
const SCRIPTED_S: f64 = 0.3;
/// How long after the last message that counted another session leads the arm at the earliest, s: 0.1 until it begins, and then it
/// listens to the robot's clock for 50 messages.
const ANEW_S: f64 = 0.28;

struct Run {
    truths: Vec<TruthSample>,
    said: String,
    began_ns: u64,
    cell: Cell,
}

fn run(injection: Injection, situation: Situation, edge: &mut Command) -> Run {
    let begins_s = situation.begins_s();
    let fault = match injection {
        Injection::Scripted(kind) => {
            format!("[{{ at_s = {begins_s}, duration_s = {SCRIPTED_S}, kind = \"{kind}\" }}]")
        }
        Injection::Network(..) | Injection::Process(_) => "[]".to_owned(),
    };
    let changes = situation.changes(&fault);
    let changes: Vec<(&str, &str)> = changes.iter().map(|(key, value)| (*key, value.as_str())).collect();
    let mut cell = Cell::with_edge(&Files::shipped().real_time(), edge);
    let network = Network::before(cell.address());
    let (mut began_ns, mut due_ns) = (0, 0);
    let (truths, said) = cell.run_by(&changes, network.address, |cell, _, truth| {
        if began_ns > 0 || truth.scenario_time_s < begins_s {
            return;
        }
        (began_ns, due_ns) = (truth.stamp_ns, truth.stamp_ns);
        match injection {
            Injection::Scripted(_) => {}
            Injection::Network(to_edge, to_robot) => {
                network.become_like(to_edge, to_robot);
                began_ns = monotonic_ns();
            }
            Injection::Process(act) => {
                act(cell);
                began_ns = monotonic_ns();
            }
        }
    });
    assert!(began_ns > 0, "the scenario ended before the fault");
    let touched = truths.iter().any(|truth| truth.in_contact == 1);
    assert_eq!(touched, situation == Situation::Contact, "it touches in contact, and only there");
    let before = truths.iter().rev().find(|truth| truth.stamp_ns <= due_ns).expect("it ran before the fault");
    let speed = fastest(before);
    assert!(speed > 10.0 * STANDS, "it did not move before the fault: {speed} rad/s");
    Run { truths, said, began_ns, cell }
}

impl Run {
    /// Seconds from the fault to a sample.
    fn since(&self, truth: &TruthSample) -> f64 {
        (truth.stamp_ns as f64 - self.began_ns as f64) * 1e-9
    }

    /// The fastest joint of the samples in this time after the fault, rad/s.
    fn fastest(&self, from_s: f64, to_s: f64) -> f64 {
        let within = self.truths.iter().filter(|truth| (from_s..to_s).contains(&self.since(truth)));
        let speeds: Vec<f64> = within.map(fastest).collect();
        assert!(!speeds.is_empty(), "the run ended before {from_s} s after the fault");
        speeds.into_iter().fold(0.0, f64::max)
    }

    /// The largest true normal force from the fault on, N, and the one just before it.
    fn force(&self) -> (f64, f64) {
        let (before, after): (Vec<&TruthSample>, Vec<&TruthSample>) =
            self.truths.iter().partition(|truth| truth.stamp_ns <= self.began_ns);
        let most = after.iter().map(|truth| truth.normal_force_n).fold(0.0, f64::max);
        (most, before.last().map_or(0.0, |truth| truth.normal_force_n))
    }

    /// Whether it ended so: what is wrong otherwise.
    fn verify(&self, end: End, stands_s: f64, lasts_s: f64) {
        let (most, before) = self.force();
        let bound = |moving_s: f64| MARGIN * (before + STIFFNESS * INWARD * moving_s) + MARGIN_N;
        let stands_from = |from_s: f64| {
            let speed = self.fastest(from_s, lasts_s);
            assert!(speed < STANDS, "a joint moves at {speed} rad/s {from_s} s after the fault");
            let speed = self.fastest(from_s + SETTLING_S, lasts_s);
            assert!(speed < RESTS, "a joint still moves at {speed} rad/s {} s after the fault", from_s + SETTLING_S);
        };
        let has_timed_out = self.said.contains("CommTimeout");
        match end {
            End::GoesOn => {
                assert!(self.fastest(lasts_s, f64::INFINITY) > 10.0 * STANDS, "it does not go on");
                assert!(!has_timed_out && peak(&self.truths) <= MOST, "{most} N: {}", self.said);
            }
            End::Stands | End::StandsUntilAnew => {
                stands_from(stands_s);
                assert!(!has_timed_out, "{}", self.said);
                assert!(most <= bound(PLAN_S), "{most} N; {before} N before, {} N accepted", bound(PLAN_S));
            }
            End::CommTimeout => {
                assert!(has_timed_out, "{}", self.said);
                // Until then it goes on: the emulated robot does what the edge is there for.
                stands_from(COMM_TIMEOUT_S + 0.1);
                let moving_s = COMM_TIMEOUT_S + PLAN_S;
                assert!(most <= bound(moving_s), "{most} N; {before} N before, {} N accepted", bound(moving_s));
            }
        }
    }
}

/// A scripted fault lasts for a while, others until the end.
fn verify(name: &str, injection: Injection, situation: Situation, end: End) {
    verify_by(name, injection, situation, end, |_| {}, || Command::new(&binaries().admittance_egm));
}

fn verify_by(
    name: &str,
    injection: Injection,
    situation: Situation,
    end: End,
    also: impl Fn(&mut Cell),
    edge: impl Fn() -> Command,
) {
    undisturbed(|| {
        let mut run = run(injection, situation, &mut edge());
        let lasts_s = match (injection, end, situation) {
            (Injection::Scripted(_), ..) => SCRIPTED_S,
            (_, End::StandsUntilAnew, Situation::Free) => ANEW_S,
            _ => f64::INFINITY,
        };
        let (most, before) = run.force();
        let speeds = [0.0, 0.05, COMM_TIMEOUT_S].map(|from_s| run.fastest(from_s, from_s + 0.05));
        println!("{name}, {situation:?}: {before:.1} N, then {most:.1} N at most; fastest joint {speeds:.5?} rad/s");
        run.verify(end, COMM_TIMEOUT_S, lasts_s);
        also(&mut run.cell);
    });
}

fn goes_on_without_a_panic(child: &mut Child) {
    assert!(child.exit_status().is_none() && !child.stderr().contains("panicked"), "{}", child.report());
}

/// What the scenario's faults do to a robot's message; the others show in none.
fn scripted(kind: FaultKind) -> Option<End> {
    use FaultKind as Kind;
    match kind {
        // Of another program's ports, and of what an EGM message does not have.
        Kind::Unnotified
        | Kind::NotFollowing
        | Kind::NanJointVelocity
        | Kind::InfJointVelocity
        | Kind::NanTwistReference
        | Kind::InfTwistReference => None,
        Kind::Overrun | Kind::LateStamp | Kind::SequenceJump => Some(End::GoesOn),
        Kind::CommandLoss => Some(End::CommTimeout),
        _ => Some(End::Stands),
    }
}

fn every_scripted_fault(situation: Situation) {
    let mut count = 0;
    for kind in FaultKind::ALL.iter().copied() {
        let Some(end) = scripted(kind) else { continue };
        count += 1;
        let also = |cell: &mut Cell| goes_on_without_a_panic(&mut cell.edge);
        let edge = || Command::new(&binaries().admittance_egm);
        verify_by(&kind.to_string(), Injection::Scripted(kind), situation, end, also, edge);
    }
    assert_eq!(count, 22);
}

#[test]
fn every_fault_of_the_robot_in_free_motion_ends_in_a_standstill_before_comm_timeout() {
    every_scripted_fault(Situation::Free);
}

#[test]
fn every_fault_of_the_robot_in_contact_ends_in_a_standstill_before_comm_timeout() {
    every_scripted_fault(Situation::Contact);
}

fn joints(message: &mut EgmRobot) -> &mut Vec<f64> {
    &mut message.feed_back.as_mut().expect("there").joints.as_mut().expect("there").joints
}

fn clock(message: &mut EgmRobot) -> &mut egm_messages::EgmClock {
    message.feed_back.as_mut().expect("there").time.as_mut().expect("there")
}

/// What may come of a message on the way, or from a robot that is told otherwise. Cut links come last.
const OF_THE_NETWORK: [(&str, ToEdge, ToRobot, End); 20] = {
    use End::{CommTimeout, Stands, StandsUntilAnew};
    use ToEdge::{Change, Lose, Mangle};
    const THERE: ToRobot = ToRobot::Pass;
    [
        ("no header", Change(|message| message.header = None), THERE, Stands),
        ("no number", Change(|message| message.header.as_mut().expect("there").seqno = None), THERE, Stands),
        ("another type", Change(|message| message.header.as_mut().expect("there").mtype = Some(1)), THERE, Stands),
        ("no feedback", Change(|message| message.feed_back = None), THERE, Stands),
        ("no planned path", Change(|message| message.planned = None), THERE, Stands),
        ("five joints", Change(|message| joints(message).truncate(5)), THERE, Stands),
        ("a joint out of reach", Change(|message| joints(message)[2] = 1e300), THERE, Stands),
        ("motors off", Change(|message| message.motor_state.as_mut().expect("there").state = 2), THERE, Stands),
        ("motors not told", Change(|message| message.motor_state = None), THERE, Stands),
        ("EGM stopped", Change(|message| message.mci_state.as_mut().expect("there").state = 2), THERE, Stands),
        ("EGM failed", Change(|message| message.mci_state.as_mut().expect("there").state = 1), THERE, Stands),
        (
            "program stopped",
            Change(|message| message.rapid_exec_state.as_mut().expect("there").state = 1),
            THERE,
            Stands,
        ),
        ("no force", Change(|message| message.measured_force = None), THERE, Stands),
        ("clock back", Change(|message| clock(message).sec -= 10), THERE, StandsUntilAnew),
        ("random bytes", Mangle(|bytes| bytes.iter_mut().for_each(|byte| *byte ^= 0xA5)), THERE, Stands),
        ("half a message", Mangle(|bytes| bytes.truncate(bytes.len() / 2)), THERE, Stands),
        ("too long", Mangle(|bytes| bytes.resize(5000, 0)), THERE, Stands),
        ("robot not heard", Lose, THERE, Stands),
        ("edge not heard", ToEdge::Pass, ToRobot::Lose, CommTimeout),
        ("link cut", Lose, ToRobot::Lose, CommTimeout),
    ]
};

fn every_fault_of_the_network(situation: Situation) {
    for (name, to_edge, to_robot, end) in OF_THE_NETWORK {
        let also = |cell: &mut Cell| goes_on_without_a_panic(&mut cell.edge);
        let edge = || Command::new(&binaries().admittance_egm);
        verify_by(name, Injection::Network(to_edge, to_robot), situation, end, also, edge);
    }
}

#[test]
fn every_fault_of_the_network_in_free_motion_ends_in_a_standstill_before_comm_timeout() {
    every_fault_of_the_network(Situation::Free);
}

#[test]
fn every_fault_of_the_network_in_contact_ends_in_a_standstill_before_comm_timeout() {
    every_fault_of_the_network(Situation::Contact);
}

#[test]
fn a_daemon_that_is_killed_stopped_or_asked_to_end_leaves_an_arm_that_stands() {
    let faults: [ToProcess; 3] = [
        ("daemon killed", |cell| cell.daemon.signal(libc::SIGKILL)),
        ("daemon stopped", |cell| cell.daemon.signal(libc::SIGSTOP)),
        ("daemon asked to end", |cell| cell.daemon.terminate()),
    ];
    for situation in [Situation::Free, Situation::Contact] {
        for (name, act) in faults {
            verify(name, Injection::Process(act), situation, End::Stands);
        }
    }
}

/// In free motion another daemon goes on; in contact it finds an arm that presses, and holds it.
#[test]
fn a_daemon_that_is_started_again_goes_on_in_free_motion_and_holds_in_contact() {
    let restart: fn(&mut Cell) = |cell| {
        cell.daemon.terminate();
        assert_eq!(cell.daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", cell.daemon.report());
        // Until nothing is left of the plan, and the arm stands.
        thread::sleep(Duration::from_millis(200));
        cell.start_another_daemon();
    };
    let edge = || Command::new(&binaries().admittance_egm);
    undisturbed(|| {
        let run = run(Injection::Process(restart), Situation::Free, &mut edge());
        let stood = run.truths.iter().position(|truth| fastest(truth) < RESTS && truth.scenario_time_s > 0.15);
        let stood = stood.expect("the arm stood while there was no daemon");
        // At the end of the run it stands in any case.
        assert!(run.truths[stood..].iter().any(|truth| fastest(truth) > RESTS), "it stood only at the end");
        run.verify(End::GoesOn, COMM_TIMEOUT_S, 0.0);
    });
    let started_in_contact = |cell: &mut Cell| {
        assert!(cell.daemon.stderr().contains("StartedInContact"), "{}", cell.daemon.report());
    };
    verify_by(
        "daemon restarted",
        Injection::Process(restart),
        Situation::Contact,
        End::Stands,
        started_in_contact,
        edge,
    );
}

#[test]
fn an_edge_that_is_asked_to_end_leaves_an_arm_that_stands() {
    let edge = || Command::new(&binaries().admittance_egm);
    for situation in [Situation::Free, Situation::Contact] {
        for (name, act) in [
            ("SIGTERM", (|cell| cell.edge.signal(libc::SIGTERM)) as fn(&mut Cell)),
            ("SIGINT", |cell| cell.edge.signal(libc::SIGINT)),
        ] {
            let ended = |cell: &mut Cell| {
                assert_eq!(cell.edge.wait_for_exit(PATIENCE).code(), Some(0), "{}", cell.edge.report());
            };
            ends_in_zeros(name, act, situation, ended, edge);
        }
    }
}

/// A program of the same library whose loop fails when a signal says so.
#[test]
fn an_edge_whose_loop_fails_leaves_an_arm_that_stands() {
    // What would find names for a backtrace first would leave the robot to CommTimeout.
    let edge = || {
        let mut edge = Command::new(&binaries().failing_edge);
        edge.env("RUST_BACKTRACE", "1");
        edge
    };
    for situation in [Situation::Free, Situation::Contact] {
        for (name, act) in [
            ("fails once", (|cell| cell.edge.signal(libc::SIGUSR1)) as fn(&mut Cell)),
            ("fails always", |cell| cell.edge.signal(libc::SIGUSR2)),
        ] {
            let failed = |cell: &mut Cell| {
                assert_eq!(cell.edge.wait_for_exit(PATIENCE).code(), Some(70), "{}", cell.edge.report());
                let log = cell.edge.stderr();
                assert!(log.contains("panicked") && log.contains("the robot was sent zeros"), "{log}");
            };
            ends_in_zeros(name, act, situation, failed, edge);
        }
    }
}

/// The edge is gone after its zeros: CommTimeout comes, and finds an arm that stands.
fn ends_in_zeros(
    name: &str,
    act: fn(&mut Cell),
    situation: Situation,
    also: impl Fn(&mut Cell),
    edge: impl Fn() -> Command,
) {
    undisturbed(|| {
        let mut run = run(Injection::Process(act), situation, &mut edge());
        let (most, before) = run.force();
        println!("{name}, {situation:?}: {before:.1} N, then {most:.1} N at most");
        assert!(run.said.contains("CommTimeout"), "{}", run.said);
        run.said.clear();
        run.verify(End::Stands, COMM_TIMEOUT_S, f64::INFINITY);
        also(&mut run.cell);
    });
}

/// What nobody can help: the emulated robot does go on by itself until CommTimeout, which is what the page says.
#[test]
fn an_edge_that_is_killed_or_stopped_leaves_the_robot_to_comm_timeout() {
    let faults: [ToProcess; 2] = [
        ("edge killed", |cell| cell.edge.signal(libc::SIGKILL)),
        ("edge stopped", |cell| cell.edge.signal(libc::SIGSTOP)),
    ];
    for situation in [Situation::Free, Situation::Contact] {
        for (name, act) in faults {
            verify(name, Injection::Process(act), situation, End::CommTimeout);
        }
    }
    undisturbed(|| {
        let run = run(Injection::Process(faults[0].1), Situation::Free, &mut Command::new(&binaries().admittance_egm));
        let (early, late) = (run.fastest(0.02, 0.04), run.fastest(0.06, 0.08));
        assert!(late > 0.01 && (late - early).abs() < 1e-3, "{early}, then {late} rad/s");
    });
}
