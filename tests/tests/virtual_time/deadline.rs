//! The deadline in virtual time: a solver that is cut short where the test says, and the exact
//! sequence of answers that has to come instead. No clock is involved.

use admittance_core::supervisor::Ending;
use admittance_runner::cycle::Cycle;
use end_to_end::closed_loop::{Experiment, Instant, NORMAL, Run};
use end_to_end::{fresh, share};
use ipc_types::{CommandSample, Mode, Motion, Source, StateSample, StopReason};
use plant_sim::faults::FaultKind;
use plant_sim::scenario::FaultSection;

const SAMPLING_TIME_S: f64 = 0.001;
const MAX_FALLBACKS: u32 = 3;

/// The default profile at 1 kHz, from the air into contact at this share of a cycle, and on.
fn experiment(share: f64) -> Experiment {
    let experiment = Experiment::paper(SAMPLING_TIME_S, 0.25).with_motion(&[(0.4, &[0.0, -0.25])]);
    let mut experiment = experiment.at_instant(share);
    experiment.config.control.max_consecutive_fallbacks = MAX_FALLBACKS;
    // Tight enough for other rows to become active from cycle to cycle.
    experiment.config.limits.inward_rate_m_s2 = Some(vec![5.0, 8.0]);
    experiment.config.limits.outward_rate_m_s2 = Some(vec![50.0, 80.0]);
    experiment
}

/// Checks at some instants of contact within a cycle, and at one that nobody has chosen.
fn at_instants(check: fn(f64)) {
    [0.0, 0.5].into_iter().for_each(check);
    fresh(|seed| check(share(seed, 0)));
}

/// A run in which the law finds time left `asked` times, and none from then on, for each of `count`
/// samples from `first` on.
fn cut_short(experiment: &Experiment, first: usize, count: usize, asked: u32) -> Run {
    let mut index = 0;
    let mut last = 0;
    let expired = |state: &StateSample, times: u64| {
        if state.sequence != last {
            (index, last) = (state.sequence as usize - 1, state.sequence);
        }
        (first..first + count).contains(&index) && times > u64::from(asked)
    };
    experiment.run_in_time(|_, _| {}, expired)
}

fn source(at: &Instant) -> u32 {
    at.command.source
}

/// Index of the first cycle that the MPC answers.
fn first_contact(run: &Run) -> usize {
    run.instants.iter().position(|at| source(at) == Source::Mpc.code()).expect("a run into contact")
}

/// Commanded speed of a cycle out of the surface, m/s.
fn commanded(at: &Instant) -> f64 {
    (0..2).map(|axis| NORMAL[axis] * (at.state.twist_reference[axis] + at.command.velocity_offset[axis])).sum()
}

/// What `plan` planned for the sample `cycles` after its own.
fn planned(plan: &CommandSample, cycles: usize) -> [f64; 6] {
    let elapsed = cycles as u64 * (SAMPLING_TIME_S * 1e9) as u64;
    let steps = plan.plan_length as usize;
    let step = plan.plan_end_ns[..steps].iter().position(|end| elapsed < *end).unwrap_or(steps - 1);
    plan.planned_offset[step]
}

#[test]
fn the_answer_is_the_plan_until_the_mpc_ends_in_time() {
    at_instants(|share| {
        let experiment = experiment(share);
        let quiet = experiment.run();
        assert_eq!(quiet.counters.fallback, 0);
        let first = first_contact(&quiet);
        let busiest = (first + 1..quiet.instants.len() - 1).max_by_key(|&at| quiet.instants[at].report.iterations);
        let busiest = busiest.expect("cycles in contact");
        println!("busiest cycle: {} iterations", quiet.instants[busiest].report.iterations);
        assert!(quiet.instants[busiest].report.iterations >= 2, "there must be iterations to end between");
        for cycle in (first + 1..first + 6).chain([busiest]) {
            let answered = &quiet.instants[cycle];
            let (mut expired, mut ended) = (0, 0);
            for asked in 0..=answered.report.iterations + 2 {
                let run = cut_short(&experiment, cycle, 1, asked);
                let at = &run.instants[cycle];
                match at.report.expired_iteration {
                    Some(iteration) => {
                        // The solver asks once before it begins, then before every iteration.
                        assert_eq!(iteration, asked.saturating_sub(1), "cycle {cycle}");
                        assert_eq!(source(at), Source::Plan.code(), "cycle {cycle}, cut at {asked}");
                        let expected = planned(&quiet.instants[cycle - 1].command, 1);
                        assert_eq!(at.command.velocity_offset, expected, "cycle {cycle}, cut at {asked}");
                        assert_eq!(at.command.fallback_count, 1);
                        let next = &run.instants[cycle + 1];
                        assert_eq!((source(next), next.command.fallback_count), (Source::Mpc.code(), 1));
                        expired += 1;
                    }
                    // An unfinished iterate must not affect an answer: this one is as if the solver had
                    // not begun.
                    None => {
                        assert_eq!(at.command, answered.command, "cycle {cycle}, cut at {asked}");
                        ended += 1;
                    }
                }
                assert_eq!(
                    run.instants[cycle - 1].command,
                    quiet.instants[cycle - 1].command,
                    "nothing before it changes"
                );
            }
            assert!(expired >= 1 && ended >= 1, "cycle {cycle}: {expired} cut short, {ended} in time");
        }
    });
}

#[test]
fn the_last_plan_goes_on_by_elapsed_time_and_then_the_arm_stops() {
    at_instants(|share| {
        for max in [0, 1, MAX_FALLBACKS] {
            let mut experiment = experiment(share);
            experiment.config.control.max_consecutive_fallbacks = max;
            let first = first_contact(&experiment.run()) + 4;
            for count in 1..=max as usize + 1 {
                let run = cut_short(&experiment, first, count, 0);
                let plan = &run.instants[first - 1].command;
                for late in 0..count {
                    let at = &run.instants[first + late];
                    let what = format!("{max} allowed, number {} of {count}", late + 1);
                    assert_eq!(source(at), Source::Plan.code(), "{what}");
                    assert_eq!(at.command.velocity_offset, planned(plan, late + 1), "{what}");
                    assert_eq!(at.command.fallback_count, late as u64 + 1, "{what}");
                    let stops = late == max as usize;
                    let (mode, reason) = if stops {
                        (Mode::Stopping, StopReason::FallbackExhausted.code())
                    } else {
                        (Mode::Contact, StopReason::NONE)
                    };
                    assert!(at.is_in(mode), "{what}: mode {}", at.command.mode);
                    assert_eq!(at.command.stop_reason, reason, "{what}");
                }
                let next = &run.instants[first + count];
                if count <= max as usize {
                    assert_eq!(
                        (source(next), run.stop_reason()),
                        (Source::Mpc.code(), None),
                        "{max} allowed, {count} late"
                    );
                } else {
                    // The arm may be at rest at a low force already.
                    let is_stop = source(next) == Source::MinimumForce.code() || next.is_in(Mode::Stopped);
                    assert!(is_stop, "{max} allowed, {count} late: source {}", source(next));
                    let last = run.last();
                    assert!(last.is_in(Mode::Stopped));
                    assert_eq!(last.command.stop_reason, StopReason::FallbackExhausted.code());
                    assert_eq!(last.command.motion, Motion::Hold.code());
                }
            }
        }
    });
}

#[test]
fn fallbacks_that_answers_interrupt_do_not_add_up() {
    at_instants(|share| {
        let experiment = experiment(share);
        let first = first_contact(&experiment.run()) + 1;
        // Three of four cycles late, again and again.
        let late = |index: usize| index >= first && !(index - first).is_multiple_of(MAX_FALLBACKS as usize + 1);
        let run = experiment.run_in_time(|_, _| {}, |state, _| late(state.sequence as usize - 1));
        for (index, at) in run.instants.iter().enumerate().skip(first).filter(|(_, at)| at.is_in(Mode::Contact)) {
            let expected = if late(index) { Source::Plan } else { Source::Mpc };
            assert_eq!(source(at), expected.code(), "cycle {index}");
        }
        assert_eq!(run.stop_reason(), None);
        println!("peak {:.1} N with three of four answers late", run.peak_normal());
    });
}

#[test]
fn without_a_plan_what_leads_into_the_surface_is_taken_out() {
    at_instants(|share| {
        let experiment = experiment(share);
        let first = first_contact(&experiment.run());
        let run = cut_short(&experiment, first, 1, 0);
        let at = &run.instants[first];
        assert_eq!((source(at), at.command.fallback_count), (Source::Retreat.code(), 1));
        let outward = NORMAL[0] * at.command.twist_command[0] + NORMAL[1] * at.command.twist_command[1];
        assert!(outward.abs() < 1e-12, "{outward} m/s out of the surface");
        assert_eq!(source(&run.instants[first + 1]), Source::Mpc.code());
    });
}

#[test]
fn a_stop_without_any_answer_is_over_after_its_timeout() {
    at_instants(|share| {
        let mut experiment = experiment(share);
        let timeout = 0.02;
        experiment.config.stopping.stop_timeout_s = timeout;
        let first = first_contact(&experiment.run()) + 4;
        let run = cut_short(&experiment, first, usize::MAX - first, 0);
        let begun = first + MAX_FALLBACKS as usize;
        let cycles = (timeout / SAMPLING_TIME_S).round() as usize;
        assert!(run.instants[begun].is_in(Mode::Stopping));
        for at in &run.instants[begun..=begun + cycles] {
            assert!(at.is_in(Mode::Stopping) || at.is_in(Mode::Stopped), "mode {}", at.command.mode);
        }
        let after = &run.instants[begun + cycles + 1];
        assert!(after.is_in(Mode::Stopped));
        assert_eq!(
            (after.command.motion, after.command.stop_reason),
            (Motion::Hold.code(), StopReason::FallbackExhausted.code())
        );
    });
}

/// The arm presses on towards its set point when a person disables control, and there is no time
/// to solve the stop, or no sample to solve it for: what goes on is the plan of the contact.
#[test]
fn a_stop_that_has_only_the_plan_of_the_contact_before_it_does_not_press_on() {
    at_instants(does_not_press_on);
}

// With several inputs in a slow cycle the arm does not press on here: its impact is over, and it moves outwards.
fn does_not_press_on(share: f64) {
    for (sampling_time, speed, inputs) in [(0.004, 0.05, Some(1)), (0.001, 0.05, None), (0.001, 0.1, None)] {
        let mut pressing = Experiment::paper(sampling_time, speed).at_instant(share);
        pressing.config.contact.normal_force_reference_n = 120.0;
        pressing.config.mpc.inputs_per_cycle = inputs;
        let quiet = pressing.run();
        let first = first_contact(&quiet);
        let presses_on = |cycle: &usize| commanded(&quiet.instants[*cycle]) < -0.001;
        let begins: Vec<usize> = (first + 3..=first + 20).filter(presses_on).step_by(3).collect();
        let what = format!("{speed} m/s at {sampling_time} s, contact at {share}, inputs {inputs:?}");
        println!("{what}: presses on in {begins:?}, first contact {first}");
        assert!(begins.len() >= 3, "{what}: {begins:?}");
        for begun in begins {
            let index = |state: &StateSample| state.sequence as usize - 1;
            let mut nothing_usable = pressing.clone();
            let at_s = quiet.instants[begun].time() + 0.9 * sampling_time;
            nothing_usable.scenario.fault =
                vec![FaultSection { at_s, duration_s: 3.0 * sampling_time, kind: FaultKind::NanWrench }];
            for (missing, experiment, late) in [("no time", &pressing, 4), ("no sample", &nothing_usable, 1)] {
                let disable = |cycle: &mut dyn Cycle, state: &StateSample| {
                    if index(state) == begun {
                        cycle.end(Ending::Disabled);
                    }
                };
                let is_late = |state: &StateSample, _| (begun..begun + late).contains(&index(state));
                let run = experiment.run_in_time(disable, is_late);
                let what = format!("{missing}, {what}, cycle {begun}");
                let stop: Vec<_> = run.instants.iter().filter(|at| at.is_in(Mode::Stopping)).collect();
                let played = stop.iter().filter(|at| source(at) == Source::Plan.code()).count();
                assert!(played >= 2, "{what}: {played} cycles of the plan");
                for at in stop {
                    let outward = commanded(at);
                    assert!(outward >= -1e-6, "{what}: {outward} m/s");
                }
                assert!(run.last().is_in(Mode::Stopped), "{what}");
            }
        }
    }
}

/// A solver for which every iteration takes a share of the budget: which cycles end in time follows
/// from how much they have to do.
#[test]
fn a_slow_solver_answers_what_it_can() {
    at_instants(|share| {
        let experiment = experiment(share);
        let mut answered = Vec::new();
        // Without an answer there is no warm start: the first cycle in contact decides.
        let quiet = experiment.run();
        let first = quiet.instants[first_contact(&quiet)].report.iterations;
        for iterations in [0, first / 2, first - 1, first, 1000] {
            // The law asks once before the solver begins, then before every iteration.
            let run = experiment.run_in_time(|_, _| {}, |_, asked| asked > u64::from(iterations) + 1);
            let mut row = 0;
            let mut by_mpc = 0;
            let mut fallbacks = 0;
            for at in run.instants.iter().filter(|at| at.is_in(Mode::Contact)) {
                match at.report.expired_iteration {
                    Some(iteration) => {
                        assert_eq!(iteration, iterations, "cut where its time is up");
                        assert_ne!(source(at), Source::Mpc.code(), "no answer that did not end in time");
                        row += 1;
                        fallbacks += 1;
                    }
                    None => {
                        assert_eq!(source(at), Source::Mpc.code());
                        assert!(at.report.iterations <= iterations);
                        row = 0;
                        by_mpc += 1;
                    }
                }
                assert!(row <= MAX_FALLBACKS, "{row} fallbacks in a row and no stop");
                assert_eq!(at.command.fallback_count, fallbacks);
            }
            println!(
                "{iterations} iterations in time: {by_mpc} answers, {fallbacks} fallbacks, {:?}",
                run.stop_reason()
            );
            answered.push(by_mpc);
        }
        assert!(answered.is_sorted() && answered[0] < answered[3], "more time, more answers: {answered:?}");
    });
}
