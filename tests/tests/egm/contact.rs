//! Touch, slide, stop and lift-off.

use std::time::Duration;

use end_to_end::session::{ctl_command, output, with_keys};
use end_to_end::{Need, PATIENCE, Strace, needs, undisturbed, was_away_within};
use ipc_types::TruthSample;

use crate::cell::{Cell, Files, MOST, fastest, peak};

/// Of the scenario, s: when it touches, and the phases of its motion.
const TOUCHES_S: f64 = 0.4;
const SLIDES_UNTIL_S: f64 = 1.5;
const STANDS_UNTIL_S: f64 = 2.0;
/// What the lag of the joints leaves at the end of half a second, rad/s.
const STANDS: f64 = 1e-4;
const CYCLE_NS: u64 = 4_000_000;
/// A processor that is away for this long may make an answer late.
const HALF_A_CYCLE: Duration = Duration::from_nanos(CYCLE_NS / 2);
/// The commanded speed along the surface, m/s.
const ALONG: f64 = 0.025;

/// The samples of a time of the scenario, s.
fn within(truths: &[TruthSample], from_s: f64, to_s: f64) -> impl Iterator<Item = &TruthSample> {
    truths.iter().filter(move |truth| (from_s..to_s).contains(&truth.scenario_time_s))
}

#[test]
fn it_touches_slides_stops_and_lifts_off_over_a_network_that_is_not_perfect() {
    for network in [
        &[][..],
        &[("egm.lost", "0.01"), ("egm.duplicated", "0.02"), ("egm.reordered", "0.02"), ("egm.jitter_s", "0.001")][..],
    ] {
        undisturbed(|| {
            let mut cell = Cell::start();
            let (truths, said) = cell.run(network, |_, _, _| {});
            let touched = truths.iter().filter(|truth| truth.in_contact == 1).count();
            let losses = truths.last().map_or(0, |truth| truth.contact_losses);
            println!("peak {:.1} N, {touched} cycles of contact, {losses} losses: {said}", peak(&truths));
            assert!(peak(&truths) <= MOST, "peak {} N", peak(&truths));
            assert!(touched > 300 && losses == 1, "{touched} cycles of contact, {losses} losses: one is the lift-off");
            assert!(!said.contains("CommTimeout"), "{said}");
            // Once the bump of the touch is over it slides as fast as it is led.
            let sliding: Vec<f64> = within(&truths, SLIDES_UNTIL_S - 0.3, SLIDES_UNTIL_S - 0.05)
                .map(|truth| truth.tcp_twist[0].hypot(truth.tcp_twist[1]))
                .collect();
            let mean = sliding.iter().sum::<f64>() / sliding.len() as f64;
            assert!((mean / ALONG - 1.0).abs() < 0.05, "it slides at {mean} m/s");
            let stopped: Vec<&TruthSample> = within(&truths, STANDS_UNTIL_S - 0.1, STANDS_UNTIL_S - 0.01).collect();
            assert!(stopped.len() > 15 && stopped.iter().all(|truth| truth.in_contact == 1), "it stops in contact");
            let moves = stopped.iter().map(|truth| fastest(truth)).fold(0.0, f64::max);
            assert!(moves < 0.01, "it stops: {moves} rad/s");
            cell.edge.terminate();
            assert_eq!(cell.edge.wait_for_exit(PATIENCE).code(), Some(0), "{}", cell.edge.report());
        });
    }
}

/// With the priorities that are shipped, on a network that loses nothing. Of five hundred cycles hardly a run on a shared machine has
/// none in which a processor was away: those are not counted, all others are.
#[test]
fn the_answer_to_each_message_goes_out_before_the_next_one() {
    if !needs(Need::Root) {
        return;
    }
    undisturbed(|| {
        let mut cell = Cell::of(&Files::patient().real_time());
        let (truths, said) = cell.run(&[("egm.jitter_s", "0.0")], |_, _, _| {});
        let late: Vec<u64> = within(&truths, 0.0, STANDS_UNTIL_S)
            .filter(|truth| truth.missed == 1)
            .map(|truth| truth.stamp_ns)
            .collect();
        cell.edge.terminate();
        assert_eq!(cell.edge.wait_for_exit(PATIENCE).code(), Some(0), "{}", cell.edge.report());
        let log = cell.edge.stderr();
        let summary = log.lines().find(|line| line.contains("without an answer in time")).unwrap_or_default();
        // The message before, and what that one left to be done.
        let is_excused = |stamp_ns: u64| was_away_within(stamp_ns - 2 * CYCLE_NS, stamp_ns, HALF_A_CYCLE);
        let excused = late.iter().filter(|stamp_ns| is_excused(**stamp_ns)).count();
        println!("{} cycles without an answer, {excused} while a processor was away: {said}{summary}", late.len());
        assert_eq!(late.len() - excused, 0, "cycles without an answer, beside {excused}: {said}");
        assert!(excused < 25, "of a run of which so much is missing nothing is known: {said}");
        let counted = |words: &str| -> usize {
            let before = summary.split_once(words).expect("it says so").0.rsplit([' ', ';']).next();
            before.and_then(|number| number.parse().ok()).expect("a number")
        };
        let most = truths.iter().filter(|truth| is_excused(truth.stamp_ns)).count();
        let [unanswered, unused] = [" without an answer in time", " answers not used"].map(counted);
        assert!(unanswered <= most && unused <= most, "a processor was away in {most} cycles: {log}");
    });
}

/// Looking for it again and again would take the processor from a daemon that shares it.
#[test]
fn an_answer_is_waited_for_and_not_looked_for() {
    waits("hybrid");
}

/// Nor is the robot's message, where the files say so.
#[test]
fn with_event_the_robot_is_waited_for_as_well() {
    waits("event");
}

fn waits(wait: &str) {
    if !needs(Need::Strace) || !needs(Need::Root) {
        return;
    }
    undisturbed(|| {
        let mut files = Files::patient().real_time();
        files.daemon = with_keys(&files.daemon, &[("control.wait", &format!("\"{wait}\""))]);
        let mut cell = Cell::of(&files);
        let trace = cell.ipc.directory().join("trace");
        let (edge, mut strace, mut cycles) = (cell.edge.id().to_string(), None, 0);
        cell.run(&[("egm.jitter_s", "0.0")], |_, _, truth| {
            let is_watched = (TOUCHES_S + 0.1..SLIDES_UNTIL_S).contains(&truth.scenario_time_s);
            if is_watched && strace.is_none() {
                strace = Some(Strace::attach(&edge, &trace));
            } else if is_watched {
                cycles += 1;
            } else if let Some(strace) = strace.take_if(|_| truth.scenario_time_s >= SLIDES_UNTIL_S) {
                strace.detach();
            }
        });
        let text = std::fs::read_to_string(&trace).expect("strace wrote it");
        let lines = |what: &'static str| text.lines().filter(move |line| line.contains(what));
        let robot = lines("sendto(").find(|line| line.contains("AF_INET")).expect("the robot is answered");
        let robot = robot.split_once("sendto(").and_then(|(_, rest)| rest.split_once(',')).expect("a descriptor").0;
        let robot = format!("fd={robot},");
        let (sent, slept) = (lines("sendto(").count(), lines("clock_nanosleep(").count());
        let (early, in_vain): (Vec<_>, Vec<_>) = lines("(Timeout)").partition(|line| line.contains(&robot));
        let (early, in_vain) = (early.len(), in_vain.len());
        println!("{cycles} cycles: {sent} sent, {slept} sleeps, {early} waits until it is due, {in_vain} in vain");
        // A daemon that looks for the sample already is not notified.
        assert!(cycles > 150 && sent > 9 * cycles / 10, "{sent} sent in {cycles} cycles");
        assert!(slept < cycles / 10 && in_vain < cycles / 10, "{slept} sleeps, {in_vain} waits in vain");
        // With "hybrid" the robot's next message is waited for until it is nearly due, and then looked for.
        let expected = if wait == "hybrid" { cycles / 2..11 * cycles / 10 } else { 0..cycles / 10 };
        assert!(expected.contains(&early), "{early} waits in {cycles} cycles");
    });
}

/// A stop that a person asks for while it slides.
#[test]
fn a_stop_by_request_in_contact_ends_at_rest_and_at_a_low_force() {
    undisturbed(|| {
        let mut cell = Cell::start();
        let config = cell.ipc.directory().join("daemon.toml");
        let mut asked_s = None;
        let (truths, said) = cell.run(&[], |cell, _, truth| {
            if asked_s.is_none() && truth.scenario_time_s > TOUCHES_S + 0.3 {
                asked_s = Some(truth.scenario_time_s);
                let (code, text) = output(&mut ctl_command(&cell.ipc, "disable", &config));
                assert_eq!(code, Some(0), "{text}");
            }
        });
        let asked_s = asked_s.expect("it was asked");
        // The robot's own program leads on; the daemon holds the arm all the same.
        let resting: Vec<&TruthSample> = within(&truths, asked_s + 0.4, SLIDES_UNTIL_S).collect();
        let moves = resting.iter().map(|truth| fastest(truth)).fold(0.0, f64::max);
        let force = resting.iter().map(|truth| truth.normal_force_n).fold(0.0, f64::max);
        println!("at rest: {moves} rad/s, {force:.1} N, peak {:.1} N", peak(&truths));
        assert!(resting.len() > 50 && moves < STANDS, "{} cycles, {moves} rad/s", resting.len());
        assert!(force < 75.0 && peak(&truths) <= MOST, "{force} N at rest, peak {} N", peak(&truths));
        assert!(!said.contains("CommTimeout"), "{said}");
    });
}
