//! Stops of the default profile in virtual time: an infeasible contact, from the verdict to the
//! next touch; and the guards that do not trust the model.

use admittance_core::supervisor::Ending;
use admittance_host::config::parse;
use admittance_runner::config::OnInfeasibleName;
use admittancectl::plausible;
use end_to_end::closed_loop::{Experiment, Instant, NORMAL, Run};
use ipc_types::{Mode, Motion, StopReason};

/// Half of f_max: where a stop may come to rest.
const STOP_FORCE: f64 = 100.0;

fn outward(speed: f64) -> [f64; 2] {
    NORMAL.map(|n| n * speed)
}

fn first_in(run: &Run, mode: Mode) -> Option<&Instant> {
    run.instants.iter().find(|at| at.is_in(mode))
}

/// Peak of the force in N with every joint at its speed limit, outward, from the first sample on
/// that passes β: what no law can be below by much.
fn attainable(experiment: &Experiment) -> f64 {
    let Experiment { config, scenario } = experiment;
    200.0 * plausible::outward(config, scenario).expect("the joint speeds are limited").ratio
}

/// Slides along the surface until the arm is stretched out.
#[test]
fn a_singular_pose_in_contact_is_a_stop_at_a_low_force() {
    // Down, then along the surface: 0.7 m until the links are in line.
    let slide = [NORMAL[1], -NORMAL[0]];
    let mut experiment = Experiment::paper(0.001, 0.25).with_motion(&[(0.3, &[0.0, -0.25]), (1.2, &slide)]);
    let gentle = experiment.run();
    experiment.config.mpc.on_infeasible = OnInfeasibleName::Halt;
    let halted = experiment.run();
    let rest = |run: &Run| run.last().truth.normal_force_n;
    println!("normal force: stop {:.1} N, rests at {:.1} N", gentle.peak_normal(), rest(&gentle));
    println!("normal force: halt {:.1} N, rests at {:.1} N", halted.peak_normal(), rest(&halted));
    for run in [&gentle, &halted] {
        assert_eq!(run.stop_reason(), Some(StopReason::Singular.code()));
        assert!(run.last().is_in(Mode::Stopped) && run.last().command.motion == Motion::Hold.code());
    }
    // The slide asks for more than the joints can do: it is slower then, instead of pressing with up
    // to the limit.
    assert!(gentle.peak_normal() <= 0.75 * 200.0, "{} N", gentle.peak_normal());
    assert!(rest(&gentle) <= STOP_FORCE, "rests at {} N", rest(&gentle));
    assert!(rest(&halted) > rest(&gentle), "a halt must not be the better answer");
}

#[test]
fn an_infeasible_contact_peaks_near_the_attainable_force_and_far_below_that_of_a_halt() {
    const INSTANTS: u32 = 16;
    let mut stops = 0;
    for instant in 0..INSTANTS {
        let experiment = Experiment::paper(0.004, 0.6).at_instant(f64::from(instant) / f64::from(INSTANTS));
        // An offset that the joint speeds alone limit, as in what is attainable.
        let mut experiment = experiment;
        experiment.config.limits.velocity_offset = vec![20.0, 20.0];
        let mut halting = experiment.clone();
        halting.config.mpc.on_infeasible = OnInfeasibleName::Halt;
        let (gentle, halted, least) = (experiment.run(), halting.run(), attainable(&experiment));
        println!(
            "0.6 m/s at 4 ms, contact at {instant}/{INSTANTS}: minimum-force stop {:.1} N, attainable {least:.1} N, halt {:.1} N",
            gentle.peak(1),
            halted.peak(1)
        );
        assert!(gentle.peak(1) <= least.max(200.0) * 1.02, "{} N, attainable {least} N", gentle.peak(1));
        // Sound, and not overcautious.
        assert_eq!(gentle.infeasible() > 0, least > 200.5, "verdict, with {least} N attainable");
        if gentle.infeasible() > 0 {
            stops += 1;
            assert!(halted.peak(1) > 1.8 * gentle.peak(1), "{} N halted, {} N", halted.peak(1), gentle.peak(1));
        }
    }
    assert!(stops >= 10, "{stops} stops");
}

/// Commanded speed of a cycle out of the surface, m/s.
fn commanded(at: &Instant) -> f64 {
    (0..2).map(|axis| NORMAL[axis] * (at.state.twist_reference[axis] + at.command.velocity_offset[axis])).sum()
}

#[test]
fn a_stop_never_commands_inward_and_a_contact_no_faster_than_the_approach() {
    let (mut stops, mut contacts) = (0, 0);
    for (sampling_time, speeds) in [(0.004, [0.3, 0.4, 0.6]), (0.001, [0.6, 0.8, 1.0])] {
        for (speed, unknown_delay) in speeds.into_iter().flat_map(|speed| [(speed, 0.0), (speed, 0.001)]) {
            let mut experiment = Experiment::paper(sampling_time, speed);
            experiment.scenario.timing.command_delay_s += unknown_delay;
            experiment.config.limits.velocity_offset = vec![20.0, 20.0];
            experiment.at_instants(8, |share, run| {
                let what = format!("{speed} m/s at {sampling_time} s, {unknown_delay} s late, contact at {share}");
                for at in &run.instants {
                    let inward = -commanded(at);
                    if at.is_in(Mode::Stopping) {
                        stops += 1;
                        assert!(inward <= 1e-6, "{what}: {inward} m/s in a stop");
                    } else if at.is_in(Mode::Contact) {
                        contacts += 1;
                        assert!(inward <= speed * NORMAL[1] + 1e-6, "{what}: {inward} m/s in contact");
                    }
                }
            });
        }
    }
    assert!(stops > 100 && contacts > 3000, "{stops} cycles of stops, {contacts} of contacts");
}

#[test]
fn a_minimum_force_stop_comes_to_rest_below_the_stop_force_and_stays() {
    let mut stops = 0;
    Experiment::paper(0.004, 0.6).at_instants(16, |share, run| {
        let at = format!("contact at {share} of a sample");
        // Of a few instants f̂ says so early enough.
        if run.infeasible() == 0 {
            assert_eq!(run.stop_reason(), None, "{at}");
            return;
        }
        stops += 1;
        assert_eq!(run.stop_reason(), Some(StopReason::Infeasible.code()), "{at}");
        let stopped = run.instants.iter().position(|at| at.is_in(Mode::Stopped)).expect("it comes to rest");
        for instant in &run.instants[stopped..] {
            assert!(instant.is_in(Mode::Stopped) && instant.command.motion == Motion::Hold.code(), "{at}: latched");
            assert_eq!(instant.command.stop_reason, StopReason::Infeasible.code(), "{at}");
        }
        // Until the joints stand the pressing force may not pass the stop force again.
        let after = run.instants[stopped + 1..].iter().map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max);
        let (resting, speed) = (run.last().truth.normal_force_n, run.last().truth.joint_velocity);
        assert!(after <= STOP_FORCE + 0.5, "{at}: {after} N after the hold");
        assert!(resting <= STOP_FORCE && speed.iter().all(|v| v.abs() < 1e-6), "{at}: rests at {resting} N");
    });
    assert!(stops >= 10, "{stops} stops");
}

#[test]
fn no_stop_at_1_ms_rests_above_the_limit() {
    let (mut runs, mut stops, mut worst) = (0, 0, 0.0_f64);
    for speed in [0.48, 0.56, 0.64, 0.72, 0.8] {
        for (unknown_delay, noise) in [(0.0, 0.0), (0.0, 0.5), (0.001, 0.5), (0.002, 0.5)] {
            let mut experiment = Experiment::paper(0.001, speed).with_motion(&[(0.5, &[0.0, -speed])]);
            experiment.scenario.timing.command_delay_s += unknown_delay;
            (experiment.scenario.noise.wrench, experiment.scenario.noise.seed) = (noise, (1000.0 * speed) as u64);
            experiment.at_instants(20, |share, run| {
                runs += 1;
                if run.stop_reason().is_some() {
                    stops += 1;
                    let resting = run.last().truth.normal_force_n * NORMAL[1];
                    worst = worst.max(resting);
                    let what = format!("{speed} m/s, {unknown_delay} s late, noise {noise} N, contact at {share}");
                    assert!(resting <= 200.0, "{what}: rests at {resting} N");
                }
            });
        }
    }
    println!("{stops} stops of {runs} contacts; rest at {worst:.1} N at most");
    assert!(stops >= 150, "{stops} stops of {runs} contacts");
}

/// `study case --arms --seed 3 --index 4446` and 28, as `--save` writes them: pressed by 672 N and 207 N at most, the arms stood at 1252 N
/// and 335 N, because joints with unequal lags would have pressed a little harder at first on their way out.
#[test]
fn a_stop_does_not_stand_above_the_limit_because_the_way_out_begins_inward() {
    let cases = [
        (
            "planar-2r",
            671.694,
            include_str!("../../cases/stop-that-stood-planar-2r.toml"),
            include_str!("../../cases/stop-that-stood-planar-2r.scenario.toml"),
        ),
        (
            "planar-3r",
            207.048,
            include_str!("../../cases/stop-that-stood-planar-3r.toml"),
            include_str!("../../cases/stop-that-stood-planar-3r.scenario.toml"),
        ),
    ];
    for (arm, limit, config, scenario) in cases {
        let config = parse(config, "controller.toml").expect("as the study wrote it");
        let scenario = parse(scenario, "scenario.toml").expect("as the study wrote it");
        let run = Experiment { config, scenario }.run();
        let (peak, resting) = (run.peak_normal(), run.last().truth.normal_force_n);
        println!("{arm}: peak {peak:.1} N, at the end {resting:.1} N, limit {limit} N");
        assert_eq!(run.stop_reason(), Some(StopReason::Infeasible.code()), "{arm}");
        // On its way out it presses harder by a twentieth at most.
        let forces = run.instants.iter().map(|at| at.truth.normal_force_n).skip_while(|force| *force < 0.95 * peak);
        let mut lowest = f64::INFINITY;
        for force in forces.skip_while(|force| *force > 0.95 * peak) {
            lowest = lowest.min(force);
            assert!(force <= 1.05 * lowest + 1.0, "{arm}: {force} N after {lowest} N");
        }
        assert!(resting <= limit, "{arm}: rests at {resting} N, limit {limit} N");
    }
}

#[test]
fn after_a_stop_the_arm_retreats_is_reset_and_touches_again() {
    let out = outward(0.04);
    let mut experiment = Experiment::paper(0.004, 0.6);
    // Too fast, out of the surface below retreat_speed_m_s, then at a speed that can be kept.
    experiment = experiment.with_motion(&[(0.4, &[0.0, -0.6]), (0.5, &out), (0.1, &[0.0, 0.0]), (1.0, &[0.0, -0.1])]);
    let (mut refused, mut was_reset) = (0, false);
    let run = experiment.run_with(|cycle, _| {
        if cycle.mode() != Mode::Stopped || was_reset {
            return;
        }
        // A person keeps asking; while pushing on or pressing it is refused.
        match cycle.reset(false) {
            Ok(()) => was_reset = true,
            Err(_) => refused += 1,
        }
    });
    assert!(was_reset && refused > 10, "refused {refused} times");
    let stopped = run.instants.iter().position(|at| at.is_in(Mode::Stopped)).expect("stopped");
    let again = &run.instants[stopped..];
    let free = again.iter().position(|at| at.is_in(Mode::Free)).expect("control goes on in free motion");
    assert!(again[..free].iter().all(|at| at.is_in(Mode::Stopped)), "nothing between");
    assert!(again[free].truth.in_contact == 0, "it has left the surface");
    assert!(again[free..].iter().any(|at| at.is_in(Mode::Contact)), "it touches again");
    let second = again[free..].iter().map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max);
    assert!(run.last().is_in(Mode::Contact) && second <= 200.0, "second peak {second} N");
    assert_eq!(run.last().command.stop_reason, StopReason::NONE);
    assert!((run.settled_normal() - 6.0 / NORMAL[0]).abs() < 0.5, "settled at {} N", run.settled_normal());
}

/// The tool presses 0.5 mm deeper than is believed, which is 50 N and no disagreement. When a person
/// then disables control there is nothing to do, by the model: it has the tool off the surface long
/// before the force is low.
#[test]
fn a_stop_whose_model_has_the_tool_off_the_surface_ends_at_a_low_force() {
    for sampling_time in [0.004, 0.001] {
        let mut experiment = Experiment::paper(sampling_time, 0.05).with_motion(&[(1.5, &[0.0, -0.05])]);
        experiment.config.stopping.stop_force_n = Some(20.0);
        let point = experiment.config.environment.contact_point_m.as_mut().expect("configured");
        for axis in 0..2 {
            point[axis] -= 0.0005 * NORMAL[axis];
        }
        let mut is_asked = false;
        let run = experiment.run_with(|cycle, state| {
            if cycle.mode() == Mode::Contact && state.sequence as f64 * sampling_time > 0.6 && !is_asked {
                is_asked = true;
                cycle.end(Ending::Disabled);
            }
        });
        let begun = first_in(&run, Mode::Stopping).expect("it was asked to stop").truth.normal_force_n;
        let last = run.last();
        println!("{sampling_time} s: {begun:.1} N, and {:.1} N at rest", last.truth.normal_force_n);
        assert!(begun > 40.0, "{begun} N: more than the model knows of");
        assert!(last.is_in(Mode::Stopped) && last.command.stop_reason == StopReason::Disabled.code());
        assert!(last.truth.normal_force_n <= 20.5, "{sampling_time} s: rests at {} N", last.truth.normal_force_n);
    }
}

#[test]
fn a_contact_point_that_is_a_millimetre_off_is_a_disagreement() {
    for sign in [1.0, -1.0] {
        // Faster, a point believed too high is infeasible before it is a disagreement for three
        // cycles.
        let mut experiment = Experiment::paper(0.004, 0.1);
        let point = experiment.config.environment.contact_point_m.as_mut().expect("configured");
        for axis in 0..2 {
            point[axis] += sign * 0.001 * NORMAL[axis];
        }
        // 1 mm is 100 N: half of it is told apart.
        experiment.config.stopping.mismatch_n = Some(50.0);
        experiment.at_instants(8, |share, run| {
            assert_eq!(run.stop_reason(), Some(StopReason::ModelDisagrees.code()), "{sign}, contact at {share}");
        });
        experiment.config.environment.contact_point_m = Some([1.32, 0.68, 0.0]);
        experiment
            .at_instants(8, |share, run| assert_eq!(run.stop_reason(), None, "the right point, contact at {share}"));
    }
}

/// A surface believed 4 mm deeper than it is, without the guard on the mismatch: the model sees no
/// force.
fn believed_4_mm_deeper() -> Experiment {
    let mut experiment = Experiment::paper(0.004, 0.25);
    let point = experiment.config.environment.contact_point_m.as_mut().expect("configured");
    for axis in 0..2 {
        point[axis] -= 0.004 * NORMAL[axis];
    }
    experiment.config.stopping.mismatch_n = None;
    experiment.config.stopping.force_guard_n = Some(10.0);
    experiment
}

#[test]
fn a_stop_for_the_measured_force_comes_to_rest_at_a_low_one() {
    // The model that did not see the force must not lead the stop either.
    believed_4_mm_deeper().with_motion(&[(2.0, &[0.0, -0.25])]).at_instants(4, |share, run| {
        let (last, stopped) = (run.last(), first_in(run, Mode::Stopped).map(Instant::time));
        let rest = last.truth.normal_force_n;
        println!("contact at {share}: peak {:.1} N, held at {stopped:?} s, rests at {rest:.1} N", run.peak_normal());
        assert!(last.is_in(Mode::Stopped) && rest <= STOP_FORCE + 1.0, "contact at {share}: rests at {rest} N");
    });
}

#[test]
fn a_measured_force_above_its_limit_stops_whatever_the_model_says() {
    // Without lag: f̂ itself is the first to say so.
    let mut experiment = believed_4_mm_deeper().with_wrench_lag(0.0);
    experiment.at_instants(8, |share, run| {
        let at = format!("contact at {share}");
        assert_eq!(run.stop_reason(), Some(StopReason::MeasuredForce.code()), "{at}");
        let first = first_in(run, Mode::Stopping).or_else(|| first_in(run, Mode::Stopped)).expect("it stops");
        let felt = first.state.wrench[0].abs().max(first.state.wrench[1].abs());
        assert!(felt > 210.0, "{at}: at {felt} N");
        let before = run.instants.iter().take_while(|at| at.time() < first.time());
        assert!(before.into_iter().all(|at| at.state.wrench[1].abs() <= 210.0), "{at}: too late");
    });
    experiment.config.stopping.force_guard_n = None;
    let run = experiment.run();
    assert!(run.peak(1) > 250.0 && run.stop_reason() != Some(StopReason::MeasuredForce.code()), "{} N", run.peak(1));
}

#[test]
fn a_force_that_pulls_is_a_disagreement() {
    // The believed surface faces the other way.
    let mut experiment = Experiment::paper(0.004, 0.05);
    experiment.config.environment.surface_normal = [-NORMAL[0], -NORMAL[1], 0.0];
    experiment.config.stopping.mismatch_n = None;
    experiment.config.stopping.force_guard_n = None;
    experiment.at_instants(8, |share, run| {
        assert_eq!(run.stop_reason(), Some(StopReason::ModelDisagrees.code()), "contact at {share}");
        let stopped = first_in(run, Mode::Stopped).expect("it stops");
        let felt = stopped.state.wrench[1].abs();
        assert!(felt > 5.0 && felt < 30.0, "contact at {share}: at {felt} N");
        assert!(!run.touched());
    });
}
