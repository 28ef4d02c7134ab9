//! Inputs within the cycle: a slow cycle then loses no contact at a speed at which one input per
//! cycle does; and a motion controller that cannot play them gets one.

use admittance_core::quantities::Instant;
use admittance_runner::cycle;
use end_to_end::closed_loop::{Experiment, NORMAL, Run};
use ipc_types::{CommandSample, Mode};

const INSTANTS: u32 = 16;

fn experiment(speed: f64, inputs_per_cycle: u32) -> Experiment {
    let mut experiment = Experiment::paper(0.004, speed);
    experiment.config.mpc.inputs_per_cycle = Some(inputs_per_cycle);
    experiment
}

/// Contacts that were lost or stopped, of all instants, and the largest force along the normal in N.
fn failed(experiment: &Experiment) -> (u32, f64) {
    let (mut failed, mut peak) = (0, 0.0);
    experiment.at_instants(INSTANTS, |_, run| {
        failed += u32::from(run.losses() > 0 || run.stop_reason().is_some());
        peak = f64::max(peak, run.peak_normal());
    });
    (failed, peak)
}

#[test]
fn with_four_inputs_a_slow_cycle_approaches_faster() {
    for (speed, delay) in [(0.335, 0.0), (0.33, 0.00025)] {
        let [one, four] = [1, 4].map(|inputs| failed(&experiment(speed, inputs).with_delay(delay)));
        println!("{speed} m/s, {delay} s late: one input {one:?}, four {four:?}");
        assert!(one.0 > 0, "{speed} m/s, one input: {one:?}");
        assert!(four.0 == 0 && four.1 < 200.6 / NORMAL[1], "{speed} m/s, four inputs: {four:?}");
    }
}

/// Commands under way have inputs within their cycle too: a prediction that did not know would be
/// off where it matters, at the highest speeds.
#[test]
fn the_model_knows_the_inputs_under_way() {
    for speed in [0.12, 0.16, 0.18, 0.2] {
        let [one, four] = [1, 4].map(|inputs| failed(&experiment(speed, inputs).with_delay(0.006)));
        println!("{speed} m/s, 6 ms late: one input {one:?}, four {four:?}");
        assert!(four.0 <= one.0 && four.1 <= one.1 + 0.1, "{speed} m/s: one input {one:?}, four {four:?}");
    }
}

/// The commands of a run in contact, had its motion controller said `plays_plan`.
fn answered(run: &Run, experiment: &Experiment, plays_plan: impl Fn(usize) -> bool) -> Vec<CommandSample> {
    let mut cycle = cycle::build(&experiment.config).expect("a controller");
    let mut commands = Vec::new();
    for (number, at) in run.instants.iter().enumerate() {
        let mut state = at.state;
        state.plays_plan = u32::from(plays_plan(number));
        let mut command = CommandSample::zeroed();
        cycle.answer(&state, Instant::from_nanoseconds(state.stamp_ns), &mut || false, &mut command);
        commands.push(command);
    }
    commands
}

#[test]
fn who_does_not_play_the_plan_gets_one_input_per_cycle() {
    let experiment = experiment(0.2, 4);
    let run = experiment.run();
    let never = answered(&run, &experiment, |_| false);
    // Such a controller may come in the middle of a contact.
    let changes = run.instants.len() / 2;
    let later = answered(&run, &experiment, |number| number >= changes);
    let in_contact = |command: &&CommandSample| command.mode == Mode::Contact.code();
    assert!(never.iter().filter(in_contact).all(|command| command.plan_end_ns[0] == 4_000_000));
    for (number, command) in later.iter().enumerate().filter(|(_, command)| in_contact(command)) {
        let ends: Vec<u64> = command.plan_end_ns[..5].to_vec();
        let expected = if number < changes { 4_000_000 } else { 1_000_000 };
        assert_eq!(ends[0], expected, "sample {number}: {ends:?}");
    }
    assert_eq!(later[changes].mode, Mode::Contact.code(), "the contact goes on");
    assert_eq!(later.last().map(|command| command.mode), Some(Mode::Contact.code()));
    // With one input the answer is that of a file that asks for one.
    let mut alone = experiment.clone();
    alone.config.mpc.inputs_per_cycle = Some(1);
    assert_eq!(never, answered(&run, &alone, |_| false));
}

/// The set of plans with four inputs holds that with one.
#[test]
fn four_inputs_refuse_no_touch_that_one_keeps() {
    let mut refused = 0;
    for speed in [0.09, 0.1, 0.11, 0.12] {
        let [one, four] = [1, 4].map(|inputs| {
            let mut experiment = experiment(speed, inputs).with_delay(0.001).with_motion(&[(1.0, &[0.0, -speed])]);
            experiment.config.contact.force_limit = vec![100.0, 80.0];
            experiment.config.contact.minimum_force = vec![6.0, 6.0];
            failed(&experiment)
        });
        println!("{speed} m/s: one input {one:?}, four {four:?}");
        assert!(four.0 <= one.0 && four.1 <= one.1 + 0.1, "{speed} m/s: one input {one:?}, four {four:?}");
        refused += one.0;
    }
    assert!(refused > 4, "{refused}: slow enough for all");
}
