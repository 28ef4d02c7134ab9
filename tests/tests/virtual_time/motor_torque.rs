//! The wrench from motor torques, on an arm with masses, friction and encoders: what the observer makes
//! of its torques is held to what is true in the plant.

use admittance_host::config::parse;
use end_to_end::closed_loop::Experiment;
use end_to_end::motor_torque::{self, Judged, LIMIT, Seen};
use end_to_end::session::with_keys;

const CONFIG: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/six-joint-masses.toml");

/// Touches, presses with 100 N and slides, by a wrench from torques of which this much is told wrong.
fn judged(scenario: &str, masses: f64, friction: f64, seed: u64) -> Judged {
    let motion = "[{ duration_s = 2.0, twist = [0.08, 0.06, -0.1, 0.0, 0.0, 0.0] }]";
    let scenario = with_keys(scenario, &[("motion", motion)]);
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
