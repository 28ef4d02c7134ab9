//! Verdicts on an arm with masses: what an impact presses with, its links going on while its gears let the
//! motors brake. In no cycle that is said to be feasible does the true force exceed the limit.

use end_to_end::closed_loop::{Experiment, Instant, Run};
use end_to_end::motor_torque;
use end_to_end::session::with_keys;
use ipc_types::Verdict;

const CONFIG: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint-masses.toml");
const SAMPLING_TIME_S: f64 = 0.001;
const LIMIT_N: f64 = 150.0;
const INSTANTS: u32 = 4;
const STIFFNESSES_N_M: [f64; 4] = [1e5, 3e5, 1e6, 3e6];
/// The shipped approach, faster and slower.
const SPEEDS_M_S: [f64; 6] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5];

/// An approach straight down at a speed in m/s onto a floor of this stiffness in N/m, of which stiffness and
/// height are told as they are.
fn approach(config: &str, scenario: &str, speed: f64, stiffness: f64) -> Experiment {
    let down = [0.0, 0.0, -speed, 0.0, 0.0, 0.0];
    let mut of = Experiment::new(config, scenario, SAMPLING_TIME_S).with_delay(0.0005).with_motion(&[(0.5, &down)]);
    of.config.environment.normal_stiffness_n_m = stiffness;
    let surface = of.scenario.surface.as_mut().expect("a surface");
    surface.stiffness_n_m = stiffness;
    // What the drives' ticks resolve up to 3e5 N/m.
    if stiffness > 3e5 {
        of.scenario.timing.substep_s = 0.000_062_5;
    }
    of
}

/// The same where the surface's stiffness as a link meets it is told, too.
fn told(mut of: Experiment) -> Experiment {
    of.config.environment.impact_stiffness_n_m = Some(of.config.environment.normal_stiffness_n_m);
    of
}

/// The largest force in N of cycles that were said to be feasible, each until the next.
fn most_while_feasible(run: &Run) -> f64 {
    let is_feasible = |pair: &&[Instant]| pair[0].command.verdict == Verdict::Feasible.code();
    run.instants.windows(2).filter(is_feasible).map(|pair| pair[1].truth.peak_normal_force_n).fold(0.0, f64::max)
}

/// What runs at several instants of contact showed.
struct Seen {
    unsound: u32,
    most_while_feasible_n: f64,
    peak_n: f64,
    infeasible: u32,
}

fn seen(of: &Experiment) -> Seen {
    let mut all = Seen { unsound: 0, most_while_feasible_n: 0.0, peak_n: 0.0, infeasible: 0 };
    of.at_instants(INSTANTS, |_, run| {
        assert!(run.peak_normal() > 0.0);
        let most = most_while_feasible(run);
        all.unsound += u32::from(most > LIMIT_N * (1.0 + of.config.contact.limit_tolerance));
        all.most_while_feasible_n = all.most_while_feasible_n.max(most);
        all.peak_n = all.peak_n.max(run.peak_normal());
        all.infeasible += u32::from(run.infeasible() > 0);
    });
    all
}

/// With `[dynamics]` of the scenario's masses and gears.
fn with_masses(scenario: &str) -> String {
    with_keys(CONFIG, &[("dynamics", &motor_torque::dynamics(scenario, 0.0, 0.0, 1))])
}

#[test]
fn no_verdict_is_feasible_above_what_an_impact_allows() {
    let masses = with_masses(SCENARIO);
    for stiffness in STIFFNESSES_N_M {
        for speed in SPEEDS_M_S {
            let of = told(approach(&masses, SCENARIO, speed, stiffness));
            let Seen { unsound, most_while_feasible_n: most, peak_n: peak, infeasible } = seen(&of);
            println!(
                "{stiffness:e} N/m at {speed} m/s: {unsound} of {INSTANTS} unsound, {most:.0} N while feasible, peak {peak:.0} N, \
                 {infeasible} infeasible"
            );
            assert_eq!(unsound, 0, "{most} N while feasible");
            // Half of the limit is not refused.
            assert!(peak > 0.6 * LIMIT_N || infeasible == 0, "{stiffness:e} N/m at {speed} m/s is refused");
        }
    }
}

/// The motors move out some milliseconds before the link does.
#[test]
fn no_verdict_is_feasible_while_a_link_still_swings_into_a_surface_twice_as_hard_as_told() {
    let masses = with_masses(SCENARIO);
    let mut at_risk = 0;
    for (stiffness, speed) in [(1e5, 0.16), (1e5, 0.2), (1e5, 0.22), (1e5, 0.24), (2e5, 0.14), (3e5, 0.1)] {
        let mut of = approach(&masses, SCENARIO, speed, stiffness);
        of.config.environment.impact_stiffness_n_m = Some(0.5 * stiffness);
        of.at_instants(INSTANTS, |_, run| {
            let most = most_while_feasible(run);
            let is_at_risk = |instant: &Instant| instant.command.verdict == Verdict::AtRisk.code();
            at_risk += u32::from(run.instants.iter().any(is_at_risk));
            println!("{stiffness:e} N/m at {speed} m/s: {most:.0} N while feasible, peak {:.0} N", run.peak_normal());
            assert!(most <= LIMIT_N * (1.0 + of.config.contact.limit_tolerance), "{most} N while feasible");
        });
    }
    assert!(at_risk > 0, "nothing was at risk");
}

#[test]
fn a_verdict_without_masses_does_not_know_of_an_impact() {
    let of = approach(CONFIG, SCENARIO, 0.2, 1e5);
    let without = seen(&of);
    println!("without masses: {:.0} N while feasible", without.most_while_feasible_n);
    assert!(without.unsound > 0 && without.most_while_feasible_n > LIMIT_N, "nothing is left to show");
}

/// Motors and links are one then, and the verdict is that of (17).
#[test]
fn where_no_gear_gives_masses_change_nothing() {
    let scenario = motor_torque::with_stiff_gears(SCENARIO);
    let run = |config: &str| approach(config, &scenario, 0.2, 1e5).run();
    let (with, without) = (run(&with_masses(&scenario)), run(CONFIG));
    assert_eq!(with.instants.len(), without.instants.len());
    for (with, without) in with.instants.iter().zip(&without.instants) {
        assert_eq!(with.command, without.command, "at {} s", with.time());
    }
}
