//! What is more than the paper's lags (4) and (6), told and not told: speed loops of second order,
//! dead times, joint velocities that are reported late, a wrench that comes late.

use admittance_host::config::parse;
use admittance_host::robot_description::VelocityLoopDescription;
use admittance_runner::config::Config;
use end_to_end::closed_loop::{Experiment, MPC_DEFAULT, Run};

/// Instants of contact within a sample.
const INSTANTS: u32 = 8;
/// f_max in N, and what the linear model may miss of it.
const MOST: f64 = 200.0 + 0.5;

fn plain() -> VelocityLoopDescription {
    VelocityLoopDescription { damping: None, dead_time_s: None, report_lag_s: 0.0 }
}

/// The paper's arm with these loops, which the controller is told if `is_told`.
fn experiment(sampling_time: f64, speed: f64, loops: &VelocityLoopDescription, is_told: bool) -> Experiment {
    let mut experiment = Experiment::paper(sampling_time, speed);
    experiment.scenario.robot.velocity_loop = Some(loops.clone());
    if is_told {
        experiment.config.robot.velocity_loop = Some(loops.clone());
    }
    experiment
}

/// The largest force in N, the contacts lost and the refusals of all instants of contact.
fn worst(experiment: &Experiment) -> (f64, u32, usize) {
    let (mut peak, mut losses, mut infeasible) = (0.0f64, 0, 0);
    experiment.at_instants(INSTANTS, |_, run: &Run| {
        peak = peak.max(run.peak(0)).max(run.peak(1));
        losses += run.losses();
        infeasible += run.infeasible();
    });
    (peak, losses, infeasible)
}

/// Told, the contact is kept within the limit; not told, it is not kept or the limit not.
fn matters(name: &str, sampling_time: f64, speed: f64, loops: &VelocityLoopDescription) {
    let told = worst(&experiment(sampling_time, speed, loops, true));
    let untold = worst(&experiment(sampling_time, speed, loops, false));
    println!("{name}, {sampling_time} s, {speed} m/s: (peak N, losses, refusals) told {told:?}, not told {untold:?}");
    assert!(told.0 <= MOST && told.1 == 0 && told.2 == 0, "{name} at {speed} m/s, told: {told:?}");
    assert!(untold.0 > MOST || untold.1 > 0, "{name} at {speed} m/s, not told: {untold:?} is as good");
}

#[test]
fn loops_of_second_order_are_safe_once_told() {
    let loops = VelocityLoopDescription { damping: Some(vec![0.5, 0.7]), ..plain() };
    matters("second order", 0.004, 0.2, &loops);
    matters("second order", 0.001, 0.3, &loops);
}

#[test]
fn unequal_dead_times_are_safe_once_told() {
    let loops = VelocityLoopDescription { dead_time_s: Some(vec![0.002, 0.0028]), ..plain() };
    matters("dead times", 0.001, 0.3, &loops);
}

#[test]
fn joint_velocities_reported_late_are_safe_once_told() {
    let loops = VelocityLoopDescription { report_lag_s: 0.004, ..plain() };
    matters("late joint velocities", 0.001, 0.3, &loops);
}

#[test]
fn all_of_it_is_safe_once_told() {
    let loops = VelocityLoopDescription {
        damping: Some(vec![0.5, 0.0]),
        dead_time_s: Some(vec![0.001, 0.0018]),
        report_lag_s: 0.002,
    };
    matters("all", 0.001, 0.1, &loops);
    matters("all", 0.001, 0.3, &loops);
}

/// Told, f̂ is expected when it comes; not told, it seems to contradict the surface.
#[test]
fn a_dead_time_of_the_wrench_is_expected_once_told() {
    let [told, untold] = [true, false].map(|is_told| {
        let mut experiment = Experiment::paper(0.001, 0.15);
        experiment.scenario.wrench.delay_s = 0.005;
        if is_told {
            experiment.config.contact.wrench_dead_time_s = 0.005;
        }
        // What the expected force may be off: less than the dead time makes of the impact.
        experiment.config.stopping.mismatch_n = Some(10.0);
        experiment.config.stopping.mismatch_cycles = 2;
        let (mut peak, mut stops, mut losses) = (0.0f64, 0, 0);
        experiment.at_instants(INSTANTS, |_, run: &Run| {
            peak = peak.max(run.peak(0)).max(run.peak(1));
            stops += usize::from(run.stop_reason().is_some());
            losses += run.losses();
        });
        (peak, stops, losses)
    });
    println!("(peak N, stops, losses) told {told:?}, not told {untold:?}");
    assert!(told.0 <= MOST && told.1 == 0 && told.2 == 0, "told: {told:?}");
    assert!(untold.1 > 0, "not told: {untold:?}");
}

#[test]
fn what_the_model_cannot_have_is_refused_by_name() {
    let paper = include_str!("../../../deploy/demo/mpc-paper.toml");
    let refused = |file: &str, section: &str| {
        let text =
            file.replacen("\n[[robot.joint]]", &format!("\n[robot.velocity_loop]\n{section}\n\n[[robot.joint]]"), 1);
        parse::<Config>(&text, "cell.toml").expect_err(section).to_string()
    };
    for (file, section, what) in [
        (
            paper,
            "damping = [0.7, 0.7]",
            "robot.velocity_loop.damping = above 0: accepted: 0 throughout, or mpc.discretization = \"zoh\"",
        ),
        (MPC_DEFAULT, "damping = [0.7, 0.05]", "robot.velocity_loop.damping[1] = 0.05"),
        (MPC_DEFAULT, "damping = [0.7, 0.7, 0.7]", "robot.velocity_loop.damping = 3 values"),
        (MPC_DEFAULT, "dead_time_s = [0.0, 0.006]", "robot.velocity_loop.dead_time_s = 0 to 0.006"),
        (MPC_DEFAULT, "dead_time_s = [0.04, 0.04]", "robot.velocity_loop.dead_time_s = 0.04"),
        (MPC_DEFAULT, "report_lag_s = -1.0", "robot.velocity_loop.report_lag_s = -1"),
    ] {
        let said = refused(file, section);
        assert!(said.contains(what), "{section}: {said}");
    }
}

/// Lags that nobody told, at half the speed that the verdict accepts with the model as told: no force
/// beyond its limit, no limit cycle, and no loss. Loops of second order bounce once at the impact. Slow
/// ones are over the limit at 1 ms besides, unless the arm is said to follow late.
#[test]
fn at_half_speed_a_lag_that_is_not_told_keeps_the_limit() {
    let late = |by: f64| move |experiment: &mut Experiment| experiment.scenario.timing.command_delay_s += by;
    let fast = |experiment: &mut Experiment| {
        experiment.scenario.robot.velocity_time_constant_s.iter_mut().for_each(|constant| *constant *= 0.5);
    };
    let second_order = |experiment: &mut Experiment| {
        let loops = VelocityLoopDescription { damping: Some(vec![0.5, 0.5]), ..plain() };
        experiment.scenario.robot.velocity_loop = Some(loops);
    };
    let both = |experiment: &mut Experiment| {
        fast(experiment);
        second_order(experiment);
    };
    // Tolerance in s, largest force in N, bounces of a contact, and whether it may be stopped.
    for (name, sampling_time, change, (tolerance, most, bounces, may_stop)) in [
        ("4 ms more delay", 0.004, &late(0.004) as &dyn Fn(&mut Experiment), (0.0, 200.0, 0, false)),
        ("2 ms more delay", 0.001, &late(0.002), (0.0, 200.0, 0, false)),
        ("loops x 0.5", 0.004, &fast, (0.0, 200.0, 0, false)),
        ("loops x 0.5", 0.001, &fast, (0.0, 200.0, 0, false)),
        ("second order, damping 0.5", 0.004, &second_order, (0.0, 200.0, 2, false)),
        ("second order, damping 0.5", 0.001, &second_order, (0.0, 225.0, 1, true)),
        ("second order, damping 0.5", 0.004, &second_order, (0.005, 200.0, 2, false)),
        ("second order, damping 0.5", 0.001, &second_order, (0.005, 200.0, 1, false)),
        ("second order, damping 0.5, and x 0.5", 0.004, &both, (0.0, 200.0, 1, false)),
        ("second order, damping 0.5, and x 0.5", 0.001, &both, (0.0, 200.0, 1, false)),
    ] {
        let mut experiment = Experiment::paper(sampling_time, if sampling_time > 0.002 { 0.16 } else { 0.32 });
        experiment.config.control.lag_tolerance_s = tolerance;
        change(&mut experiment);
        let (mut peak, mut losses, mut stops, mut swing) = (0.0f64, 0, 0, 0.0f64);
        experiment.at_instants(16, |share, run: &Run| {
            let real = run.peak(0).max(run.peak(1));
            let is_said = run.stop_reason().is_some() || run.infeasible() > 0 || run.counters.exceeded > 0;
            assert!(real <= MOST || is_said, "{name} at {sampling_time} s, contact at {share}: {real} N in silence");
            peak = peak.max(real);
            losses = losses.max(run.losses());
            stops += usize::from(run.stop_reason().is_some());
            swing = swing.max(run.settled_swing());
        });
        println!(
            "{name}, {sampling_time} s, tolerance {tolerance} s: at most {peak:.1} N and {losses} bounces, {stops} stops \
             of 16; {swing:.2} N from crest to trough at the end"
        );
        assert!(peak <= most && losses <= bounces && (may_stop || stops == 0), "{name}, {sampling_time} s");
        assert!(swing < 1.0, "{name}, {sampling_time} s: {swing} N");
    }
}
