//! Deadlines missed for real: processes that are stopped, a hog on the daemon's processor, samples
//! that come late, and a clock that is set. What has to follow is counted, visible in the command,
//! and over when its cause is.

use std::cell::Cell;
use std::sync::{PoisonError, RwLock};
use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use admittance_host::realtime::{RealtimeSection, StepOutcome, apply_to_thread};
use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{PAPER_SCENARIO, PATIENT, drive_plant, start_daemon, until, with_keys, write};
use end_to_end::{Answers, Child, Need, PATIENCE, PrivateIpc, SteppedClock, needs, undisturbed};
use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, Mode, Motion, Source, StopReason, TruthSample};

/// How long the arm is moved toward the surface: its retreat is no part of a run.
const MOTION_S: f64 = 2.4;

/// The paper's scenario with first contact at 0.8 s, slow enough to bear a late answer.
fn scenario(changes: &[(&str, &str)]) -> String {
    let slow = [
        ("timing.command_delay_s", "0.001"),
        ("motion", &format!("[{{ duration_s = {MOTION_S}, twist = [0.0, -0.05] }}]")),
        ("start.contact_time_s", "0.8"),
    ];
    with_keys(PAPER_SCENARIO, &[&slow, changes].concat())
}

/// The default profile; `more` than that is borne, or nothing is.
fn config(more: &[(&str, &str)]) -> String {
    with_keys(MPC_DEFAULT, &[&[("control.command_delay_s", "0.001")], more].concat())
}

/// Of [`PATIENT`], what leaves `max_sample_age_s` as shipped: what counts as stale is part of a test,
/// and until then a busy machine is borne.
const STALE_AS_SHIPPED: [(&str, &str); 2] = [PATIENT[1], PATIENT[2]];

/// What a processor must have been away for to excuse an answer that had no time: of a cycle of 4 ms, and beside the
/// half of it that the answers of two daemons need in the tests' builds.
const AWAY: Duration = Duration::from_millis(1);

/// A run of daemon and plant.
struct Run {
    truths: Vec<TruthSample>,
    /// The daemon's state at each of `truths` of the plant.
    commands: Vec<CommandSample>,
    answers: Answers,
    log: String,
}

impl Run {
    /// The last command that was seen before this time of the scenario.
    fn at(&self, time_s: f64) -> &CommandSample {
        let index = self.truths.partition_point(|truth| truth.scenario_time_s < time_s);
        &self.commands[index.saturating_sub(1)]
    }

    fn last(&self) -> &CommandSample {
        self.commands.last().expect("a run has cycles")
    }
}

/// Daemons of one priority share a processor. Held for writing by a run with a hog, and by those
/// that bear nothing: as shipped, a millisecond is all that there is for an answer.
static PROCESSOR: RwLock<()> = RwLock::new(());

/// Runs the scenario to its end; `each` sees the truth and may do something to the daemon and the
/// plant.
fn run(config: &str, scenario: &str, each: impl FnMut(&mut Child, &mut Child, &TruthSample)) -> Run {
    let _shared = PROCESSOR.read().unwrap_or_else(PoisonError::into_inner);
    run_beside(config, scenario, each)
}

/// As [`run`], with the processor to itself.
fn run_alone(config: &str, scenario: &str, each: impl FnMut(&mut Child, &mut Child, &TruthSample)) -> Run {
    let _alone = PROCESSOR.write().unwrap_or_else(PoisonError::into_inner);
    run_beside(config, scenario, each)
}

fn run_beside(config: &str, scenario: &str, mut each: impl FnMut(&mut Child, &mut Child, &TruthSample)) -> Run {
    let ipc = PrivateIpc::new("planar");
    let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", config));
    let node = ipc.settings().node("watcher").expect("a node");
    let service = services::command(&node, &ipc.settings().instance, Access::Open).expect("the daemon made it");
    let subscriber = service.subscriber().expect("a subscriber");
    let mut answers = Answers::of(ipc.settings());
    let (mut newest, mut commands) = (CommandSample::zeroed(), Vec::new());
    let mut truths = drive_plant(&ipc, &write(&ipc, "scenario.toml", scenario), |plant, truth| {
        each(&mut daemon, plant, truth);
        if let Ok(Some(command)) = subscriber.receive() {
            newest = *command;
        }
        commands.push(newest);
        answers.collect();
    });
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    truths.truncate(until(&truths, MOTION_S).len());
    commands.truncate(truths.len());
    Run { truths, commands, answers, log: daemon.stderr() }
}

/// Fails when a busy machine stopped a run before the test did something, and when an answer had no time then for another
/// reason than a processor that was away in that very cycle.
fn assert_quiet_until(run: &Run, time_s: f64) {
    let before = run.at(time_s);
    assert_eq!(before.stop_reason, StopReason::NONE, "{}", run.log);
    let no_time = |command: &CommandSample| command.fallback_count;
    run.answers.assert_excused("no time for an answer", no_time, before.stamp_ns, AWAY, &run.log);
}

/// Fails when the daemon had stopped the arm when the motion ended.
fn assert_went_on(run: &Run) {
    assert_eq!(run.last().stop_reason, StopReason::NONE, "{}", run.log);
}

/// Does something once, at this time of the scenario.
fn once(time_s: f64) -> impl FnMut(&TruthSample) -> bool {
    let mut done = false;
    move |truth| {
        let is_due = !done && truth.scenario_time_s >= time_s;
        done |= is_due;
        is_due
    }
}

fn stop_for(child: &mut Child, duration: Duration) {
    child.signal(libc::SIGSTOP);
    std::thread::sleep(duration);
    child.signal(libc::SIGCONT);
}

#[test]
fn a_controller_that_is_stopped_in_the_air_is_taken_up_again() {
    undisturbed(|| {
        let mut now = once(0.3);
        let run = run(&config(&PATIENT), &scenario(&[]), |_, plant, truth| {
            if now(truth) {
                stop_for(plant, Duration::from_millis(400));
            }
        });
        assert_quiet_until(&run, 0.29);
        assert_went_on(&run);
        let messages = ["INFO Free", "Idle", "INFO Free", "INFO Contact"];
        let mut rest = run.log.as_str();
        for message in messages {
            let found = rest
                .find(message)
                .unwrap_or_else(|| panic!("{message} is missing in order {messages:?}:\n{}", run.log));
            rest = &rest[found + message.len()..];
        }
        let last = run.last();
        assert!(last.rejected_count > 0, "a silence, and the samples that had become stale by its end");
        assert_eq!((last.mode, last.motion), (Mode::Contact.code(), Motion::Offset.code()));
    });
}

#[test]
fn a_controller_that_is_stopped_in_contact_is_a_latched_stop() {
    undisturbed(|| {
        let mut now = once(1.4);
        let run = run_alone(&config(&STALE_AS_SHIPPED), &scenario(&[]), |_, plant, truth| {
            if now(truth) {
                stop_for(plant, Duration::from_millis(400));
            }
        });
        assert_quiet_until(&run, 1.39);
        assert!(run.log.contains("Stopped: SampleStale"), "{}", run.log);
        let last = run.last();
        assert_eq!((last.mode, last.motion), (Mode::Stopped.code(), Motion::Hold.code()), "{}", run.log);
        assert!(last.rejected_count > 0 && last.fallback_count > 0, "counted, and visible in the command");
        assert_eq!(run.truths.last().expect("a run").motion, Motion::Hold.code());
    });
}

#[test]
fn a_daemon_that_was_stopped_goes_on_where_its_plan_lasted() {
    undisturbed(|| {
        // Commands are valid for 84 ms here: the plan bridges the first time. The second time the
        // plant holds the arm, and what the daemon acts on has become too old.
        for (stopped, holds) in [(40, false), (400, true)] {
            let mut now = once(1.4);
            let run = run(&config(&PATIENT), &scenario(&[]), |daemon, _, truth| {
                if now(truth) {
                    stop_for(daemon, Duration::from_millis(stopped));
                }
            });
            assert_quiet_until(&run, 1.39);
            let (before, last) = (run.at(1.39), run.last());
            let held =
                run.truths.iter().filter(|truth| truth.scenario_time_s > 0.0 && truth.motion == Motion::Hold.code());
            println!("{stopped} ms: {} samples missed, held in {} cycles", last.missed_count, held.clone().count());
            assert!(last.missed_count > before.missed_count, "samples that the daemon never saw are counted");
            assert!(run.truths.last().expect("a run").missed_commands > 0, "and so are commands, by the plant");
            assert_eq!(held.count() > 0, holds, "{stopped} ms");
            if holds {
                let said = (last.mode, last.motion, last.stop_reason);
                let expected = (Mode::Stopped.code(), Motion::Hold.code(), StopReason::SamplesMissed.code());
                assert_eq!(said, expected, "{}", run.log);
            } else {
                assert_went_on(&run);
                assert_eq!((last.mode, last.source), (Mode::Contact.code(), Source::Mpc.code()), "{}", run.log);
            }
        }
    });
}

#[test]
fn a_hog_at_the_same_priority_is_borne_and_counted() {
    undisturbed(|| {
        if !needs(Need::Root) {
            return;
        }
        let section = RealtimeSection {
            lock_memory: false,
            priority: 85,
            cpu: Some(1),
            cpu_dma_latency_us: None,
            require_realtime: true,
        };
        let mut now = once(1.4);
        let run = run_alone(&config(&PATIENT), &scenario(&[]), |_, _, truth| {
            if now(truth) {
                let section = section.clone();
                let hog = std::thread::spawn(move || {
                    let reports = apply_to_thread(&section);
                    assert!(
                        reports.iter().all(|report| !matches!(report.outcome, StepOutcome::Refused(_))),
                        "{reports:?}"
                    );
                    // Of the same priority: the daemon waits until it sleeps.
                    for _ in 0..4 {
                        let end = monotonic_ns() + 30_000_000;
                        while monotonic_ns() < end {
                            std::hint::spin_loop();
                        }
                        std::thread::sleep(Duration::from_millis(30));
                    }
                });
                hog.join().expect("the hog has its priority");
            }
        });
        assert_quiet_until(&run, 1.39);
        assert_went_on(&run);
        let (before, last) = (run.at(1.39), run.last());
        println!(
            "under the hog: {} late, {} missed, {} fallbacks",
            last.late_count - before.late_count,
            last.missed_count - before.missed_count,
            last.fallback_count - before.fallback_count
        );
        assert!(last.missed_count + last.late_count > before.missed_count + before.late_count, "it is counted");
        assert_eq!(
            (last.mode, last.source),
            (Mode::Contact.code(), Source::Mpc.code()),
            "and over with its cause: {}",
            run.log
        );
    });
}

#[test]
fn samples_late_by_one_to_five_periods_are_answered_by_the_plan() {
    undisturbed(|| {
        let late = |periods: u32| {
            let (at_s, duration_s) = (1.2 + 0.2 * f64::from(periods - 1), 0.004 * f64::from(periods + 1));
            format!("{{ at_s = {at_s}, duration_s = {duration_s}, kind = \"late\" }}")
        };
        let faults = format!("[{}]", (1..=5).map(late).collect::<Vec<_>>().join(", "));
        let run = run(&config(&PATIENT), &scenario(&[("fault", &faults)]), |_, _, _| {});
        assert_quiet_until(&run, 1.19);
        assert_went_on(&run);
        for periods in 1..=5_u32 {
            let at_s = 1.2 + 0.2 * f64::from(periods - 1);
            let (before, after) = (run.at(at_s - 0.01), run.at(at_s + 0.1));
            assert!(after.missed_count >= before.missed_count + u64::from(periods), "{periods} late: those in between");
            assert!(after.late_count > before.late_count, "{periods} late: after its deadline");
            assert!(after.fallback_count > before.fallback_count, "{periods} late: there was no time to solve");
            assert_eq!((after.mode, after.source), (Mode::Contact.code(), Source::Mpc.code()), "{periods} late: over");
        }
    });
}

#[test]
fn a_sample_later_than_allowed_stops_with_its_reason() {
    undisturbed(|| {
        let fault = "[{ at_s = 1.4, duration_s = 0.24, kind = \"late\" }]";
        let run = run_alone(&config(&STALE_AS_SHIPPED), &scenario(&[("fault", fault)]), |_, _, _| {});
        assert_quiet_until(&run, 1.39);
        assert!(run.log.contains("Stopped: SampleStale"), "{}", run.log);
        assert_eq!(run.last().motion, Motion::Hold.code());
    });
}

#[test]
fn steps_of_the_wall_clock_do_not_matter() {
    undisturbed(|| {
        if !needs(Need::Root) {
            return;
        }
        for wait in ["event", "hybrid"] {
            let is_set = Cell::new(true);
            let quoted = format!("\"{wait}\"");
            let (mut forward, mut back) = (once(1.2), once(1.6));
            let keys = [&PATIENT[..], &[("control.wait", &quoted)]].concat();
            let run = run(&config(&keys), &scenario(&[]), |_, _, truth| {
                let step = if forward(truth) {
                    10
                } else if back(truth) {
                    -10
                } else {
                    return;
                };
                match SteppedClock::by_seconds(step) {
                    // Long enough for many cycles, short enough for other programs on this machine.
                    Some(_stepped) => std::thread::sleep(Duration::from_millis(60)),
                    None => is_set.set(false),
                }
            });
            assert_quiet_until(&run, MOTION_S);
            assert_went_on(&run);
            if !is_set.get() {
                println!("SKIPPED: the clock of this machine cannot be set");
                return;
            }
            let last = run.last();
            assert_eq!((last.mode, last.source), (Mode::Contact.code(), Source::Mpc.code()), "{wait}: {}", run.log);
            assert_eq!(last.rejected_count, run.at(1.19).rejected_count, "{wait}: {}", run.log);
            let answers = run.answers.until(last.stamp_ns);
            let answered = answers.windows(2).filter(|pair| pair[1].state_sequence > pair[0].state_sequence).count();
            assert!(answered > 100, "{wait}: {answered} answers seen");
        }
    });
}

#[test]
fn spinning_answers_as_well() {
    undisturbed(|| {
        // At normal priority: one that never sleeps would take the processor from the other tests.
        let keys = [&PATIENT[..], &[("control.wait", "\"spin\""), ("realtime.priority", "0")]].concat();
        let run = run(&config(&keys), &scenario(&[]), |_, _, _| {});
        assert_went_on(&run);
        let last = run.last();
        assert_eq!((last.mode, last.source), (Mode::Contact.code(), Source::Mpc.code()), "{}", run.log);
    });
}
