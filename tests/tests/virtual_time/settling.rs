//! After the impact: in a world that is a little slower than told the force settles, the arm does
//! not bounce for as long as it presses, and comes back slowly to what it has bounced off.

use admittance_host::robot_description::VelocityLoopDescription;
use end_to_end::closed_loop::{Experiment, Run};

/// Instants of contact within a sample.
const INSTANTS: u32 = 8;
/// The first impact is over, s after the first touch.
const IMPACT: f64 = 0.05;

/// The paper's arm; nobody told the controller that its speed loops are of second order, and its
/// commands late by a millisecond.
fn experiment(sampling_time: f64, speed: f64) -> Experiment {
    let mut experiment = Experiment::paper(sampling_time, speed);
    let damping = Some(vec![0.6, 0.7]);
    let loops = VelocityLoopDescription { damping, dead_time_s: None, report_lag_s: 0.0 };
    experiment.scenario.robot.velocity_loop = Some(loops);
    experiment.scenario.timing.command_delay_s += 0.001;
    experiment
}

/// When the tool first touched, s.
fn touched_at(run: &Run) -> f64 {
    run.instants.iter().find(|at| at.truth.in_contact == 1).expect("it touches").time()
}

/// Contacts lost after the impact.
fn late_losses(run: &Run) -> u32 {
    let over = touched_at(run) + IMPACT;
    let before = run.instants.iter().take_while(|at| at.time() <= over).last().expect("it touches");
    run.last().truth.contact_losses - before.truth.contact_losses
}

#[test]
fn a_loop_that_is_slower_than_told_does_not_bounce_for_ever() {
    for (sampling_time, speed) in [(0.004, 0.08), (0.004, 0.16), (0.001, 0.16), (0.001, 0.25)] {
        experiment(sampling_time, speed).at_instants(INSTANTS, |share, run| {
            let at = format!("{speed} m/s at {sampling_time} s, contact at {share}");
            println!(
                "{at}: {} losses, {} late, settled at {:.1} N, peak {:.1} N",
                run.losses(),
                late_losses(run),
                run.settled_normal(),
                run.peak_normal()
            );
            assert_eq!((late_losses(run), run.stop_reason()), (0, None), "{at}");
            assert!((run.settled_normal() - 14.2).abs() < 1.0, "{at}: settled at {} N", run.settled_normal());
        });
    }
}

/// Largest speed into the surface that the arm is told, m/s, from one instant on.
fn inward_speed(run: &Run, experiment: &Experiment, from: f64) -> f64 {
    let normal = experiment.config.environment.surface_normal;
    let commanded = run.instants.iter().filter(|at| at.time() > from).map(|at| {
        let along = |axis: usize| at.state.twist_reference[axis] + at.command.velocity_offset[axis];
        -(0..2).map(|axis| normal[axis] * along(axis)).sum::<f64>()
    });
    commanded.fold(0.0, f64::max)
}

#[test]
fn an_arm_that_has_bounced_off_comes_back_at_a_quarter_of_its_approach() {
    let mut bounced = 0;
    for (sampling_time, speed) in [(0.004, 0.16), (0.001, 0.25)] {
        let experiment = experiment(sampling_time, speed);
        experiment.at_instants(INSTANTS, |share, run| {
            let lost = run.instants.iter().find(|at| at.truth.contact_losses > 0);
            let Some(lost) = lost.filter(|lost| lost.time() < touched_at(run) + IMPACT) else { return };
            bounced += 1;
            // What the command of that instant still says is carried out in the next cycles.
            let inward = inward_speed(run, &experiment, lost.time() + 3.0 * sampling_time);
            let approach = inward_speed(run, &experiment, 0.0);
            println!("{speed} m/s at {sampling_time} s, contact at {share}: {inward:.3} of {approach:.3} m/s inward");
            assert!(inward <= 0.3 * approach, "{inward} of {approach} m/s at {sampling_time} s, contact at {share}");
        });
    }
    assert!(bounced > 0, "nothing bounces: the test tests nothing");
}
