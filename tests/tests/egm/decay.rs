//! What the robot is sent, cycle by cycle, once nobody renews the plan: ever less, without a jump, and then zeros.

use std::process::Command;

use admittance_host::clock::monotonic_ns;
use end_to_end::{binaries, undisturbed};

use crate::cell::{Cell, Files};
use crate::network::{Network, ToEdge, ToRobot};

/// The plan of the shipped file lasts for this many cycles beyond its own.
const FALLBACKS: usize = 3;
/// The largest part of the speed by which one message may differ from the one before: the last step is from 7/16 to nothing.
const LARGEST_STEP: f64 = 0.5;

/// Speeds of one message as one number, degrees/s.
fn norm(speeds: &[f64]) -> f64 {
    speeds.iter().map(|speed| speed * speed).sum::<f64>().sqrt()
}

/// What is sent from some cycles before `end` on, which comes at this time of the scenario.
fn sent_around(end: impl Fn(&mut Cell, &Network), at_s: f64) -> (Vec<f64>, Vec<f64>) {
    let mut cell = Cell::with_edge(&Files::shipped().real_time(), &mut Command::new(&binaries().admittance_egm));
    let network = Network::before(cell.address());
    let mut ended_ns = 0;
    cell.run_by(&[("egm.jitter_s", "0.0")], network.address, |cell, _, truth| {
        if ended_ns == 0 && truth.scenario_time_s > at_s {
            end(cell, &network);
            ended_ns = monotonic_ns();
        }
    });
    let (before, after): (Vec<_>, Vec<_>) = network.sent().into_iter().partition(|(at_ns, _)| *at_ns <= ended_ns);
    let norms = |sent: Vec<(u64, Vec<f64>)>| sent.iter().map(|(_, speeds)| norm(speeds)).collect::<Vec<f64>>();
    (norms(before), norms(after))
}

/// From where it no longer is what it was the speed falls to nothing, and stays there.
fn decays(name: &str, end: impl Fn(&mut Cell, &Network), is_steady: bool, at_s: f64) {
    undisturbed(|| {
        let (before, after) = sent_around(&end, at_s);
        let was = *before.last().expect("it was under way");
        let ends = after.iter().position(|norm| *norm == 0.0).expect("it ends in zeros");
        let fall: Vec<f64> = before[before.len() - 2..].iter().chain(&after[..=ends]).copied().collect();
        println!("{name}: {fall:.4?} degrees/s");
        assert!(was > 0.3, "{was} degrees/s before");
        assert!(after[ends..].iter().all(|norm| *norm == 0.0), "it moves once more: {:?}", &after[ends..]);
        // One cycle may be answered yet, and each message that is bridged counts as one.
        assert!(ends <= FALLBACKS + 4, "{ends} messages until zero");
        let most = fall.iter().copied().fold(0.0, f64::max);
        for pair in fall.windows(2) {
            assert!((pair[1] - pair[0]).abs() <= LARGEST_STEP * most, "a step from {} to {}", pair[0], pair[1]);
        }
        if is_steady {
            let falling = &fall[fall.len() - FALLBACKS - 2..];
            assert!(falling.windows(2).all(|pair| pair[1] < pair[0]), "it does not fall in each cycle: {falling:?}");
        }
    });
}

const FREE_S: f64 = 0.15;
const CONTACT_S: f64 = 1.0;

#[test]
fn a_daemon_that_is_killed_leaves_a_speed_that_decays() {
    decays("daemon killed, free", |cell, _| cell.daemon.signal(libc::SIGKILL), true, FREE_S);
    decays("daemon killed, in contact", |cell, _| cell.daemon.signal(libc::SIGKILL), false, CONTACT_S);
}

#[test]
fn an_edge_that_is_asked_to_end_lets_the_speed_decay() {
    decays("SIGTERM, free", |cell, _| cell.edge.terminate(), true, FREE_S);
    decays("SIGTERM, in contact", |cell, _| cell.edge.terminate(), false, CONTACT_S);
}

#[test]
fn a_robot_that_is_not_heard_is_sent_a_speed_that_decays() {
    let cut = |_: &mut Cell, network: &Network| network.become_like(ToEdge::Lose, ToRobot::Pass);
    decays("not heard, free", cut, true, FREE_S);
    decays("not heard, in contact", cut, false, CONTACT_S);
}

#[test]
fn a_loop_that_fails_lets_the_speed_decay() {
    undisturbed(|| {
        let mut cell = Cell::with_edge(&Files::shipped().real_time(), &mut Command::new(&binaries().failing_edge));
        let network = Network::before(cell.address());
        let mut failed_ns = 0;
        cell.run_by(&[], network.address, |cell, _, truth| {
            if failed_ns == 0 && truth.scenario_time_s > FREE_S {
                cell.edge.signal(libc::SIGUSR1);
                failed_ns = monotonic_ns();
            }
        });
        let sent = network.sent();
        let fall: Vec<f64> = sent.iter().filter(|(at_ns, _)| *at_ns > failed_ns).map(|(_, sent)| norm(sent)).collect();
        println!("loop failed: {fall:.4?} degrees/s");
        assert!(fall.len() > 10 && fall[fall.len() - 10..].iter().all(|norm| *norm == 0.0), "ten zeros: {fall:?}");
        assert!(fall.windows(2).all(|pair| pair[1] <= pair[0] * 1.01), "it falls: {fall:?}");
        let between = fall.iter().filter(|norm| **norm > 0.0).count();
        assert!(between >= 2, "from {:?} to nothing at once: {fall:?}", fall.first());
    });
}
