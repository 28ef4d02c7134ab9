//! The wrench from motor torques, on an arm with masses, friction and encoders: what the observer makes
//! of its torques is held to what is true in the plant.

use admittance_host::config::parse;
use end_to_end::closed_loop::Experiment;
use end_to_end::motor_torque::{self, Judged, LIMIT, Seen};
use end_to_end::session::with_keys;

const CONFIG: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint-masses.toml");

/// Down onto the floor and along it.
const SLIDE: &str = "{ duration_s = 2.0, twist = [0.08, 0.06, -0.1, 0.0, 0.0, 0.0] }";
const APPROACH_S: f64 = 0.4;
/// Of motion in the air, and speeds, m/s and rad/s.
const LIVELY_S: f64 = 0.4;
const LIVELY: [f64; 6] = [0.15, 0.15, 0.15, 0.5, 0.5, 0.5];

/// Touches, presses with 100 N and slides, by a wrench from torques of which this much is told wrong.
fn judged(scenario: &str, masses: f64, friction: f64, seed: u64) -> Judged {
    judged_after("", 0.0, scenario, masses, friction, seed)
}

/// The same after a motion in the air of so many seconds.
fn judged_after(air: &str, air_s: f64, scenario: &str, masses: f64, friction: f64, seed: u64) -> Judged {
    let contact_s = format!("{:?}", air_s + APPROACH_S);
    let motion = format!("[{air}{SLIDE}]");
    let scenario = with_keys(scenario, &[("motion", motion.as_str()), ("start.contact_time_s", contact_s.as_str())]);
    let config = motor_torque::config(CONFIG, &motor_torque::dynamics(&scenario, masses, friction, seed));
    let experiment = Experiment {
        config: parse(&config, "daemon.toml").expect("the config is valid"),
        scenario: parse(&scenario, "scenario.toml").expect("the scenario is valid"),
    };
    let run = experiment.run();
    let seen = run.instants.iter().map(|at| Seen {
        time_s: at.time(),
        wrench: at.report.wrench,
        deviation: at.report.wrench_deviation,
        force: [at.truth.wrench[0], at.truth.wrench[1], at.truth.wrench[2]],
    });
    let lag = experiment.config.contact.wrench_time_constant_s[0];
    let judged = motor_torque::judge(lag, 0.001, &seen.collect::<Vec<_>>());
    println!(
        "masses {masses}, friction {friction}, seed {seed}: {judged:.4?}, peak {:.1} N, stop {:?}",
        run.peak(2),
        run.stop_reason()
    );
    assert!(run.touched() && run.stop_reason().is_none(), "{:?}", run.stop_reason());
    assert!(run.peak(2) <= LIMIT + 0.5, "peak {} N", run.peak(2));
    judged
}

#[test]
fn by_exact_masses_and_friction_it_is_the_force_to_two_newtons() {
    let found = judged(&motor_torque::with_stiff_gears(SCENARIO), 0.0, 0.0, 1);
    assert!(found.force > 90.0 && found.rms <= 2.0 && found.within >= 0.99, "{found:?}");
}

#[test]
fn by_masses_and_friction_that_are_wrong_it_says_how_wrong_it_may_be() {
    let scenario = motor_torque::with_stiff_gears(SCENARIO);
    for seed in 1..=8 {
        let found = judged(&scenario, 0.05, 0.3, seed);
        assert!(found.force > 90.0 && found.within >= 0.99, "{found:?}");
        // The band would mean nothing if it were as wide as the force.
        assert!(found.deviation < 100.0 / 3.0 && found.rms < 3.0 * found.deviation, "{found:?}");
    }
}

/// Phases that move the tool up and down, and along and about every other axis, and how long they take.
fn lively() -> (String, f64) {
    let mut phases = String::new();
    for axis in [2, 0, 1, 3, 4, 5] {
        for sign in [1.0, -1.0] {
            let mut twist = [0.0; 6];
            twist[axis] = sign * LIVELY[axis];
            phases += &format!("{{ duration_s = {LIVELY_S:?}, twist = {twist:?} }}, ");
        }
    }
    (phases, 12.0 * LIVELY_S)
}

#[test]
fn what_friction_and_masses_are_off_by_is_learned_in_the_air() {
    let scenario = motor_torque::with_stiff_gears(SCENARIO);
    let (air, air_s) = lively();
    for seed in 1..=8 {
        let found = judged_after(&air, air_s, &scenario, 0.05, 0.3, seed);
        assert!(found.force > 90.0 && found.within >= 0.99, "{found:?}");
        assert!(found.rms <= 8.0 && found.rms < 3.0 * found.deviation, "{found:?}");
    }
}
