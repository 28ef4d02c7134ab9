//! The default profile on the paper's arm in virtual time: safe at speed at every instant of
//! contact, at the minimum force while sliding, with and without command delay, and with a force
//! set point. Joint speeds are limited to 3 rad/s, f_max is 200 N per axis. Expected figures:
//! docs/design.md, "A verdict that can be trusted" and "A faster cycle buys speed".

use end_to_end::closed_loop::{Experiment, NORMAL, Run};

/// Instants of contact within a sample.
const INSTANTS: u32 = 16;
/// f_max in N, and what the linear model may miss of it.
const MOST: f64 = 200.0 + 0.5;
/// On the plane 6 N on x correspond to this force along the normal: the lower bound.
const LEAST: f64 = 6.0 / NORMAL[0];

fn assert_within(what: &str, value: f64, expected: f64, by: f64) {
    assert!((value - expected).abs() <= by, "{what} = {value}, expected {expected} ± {by}");
}

/// Smallest and largest of the values seen.
#[derive(Debug, Clone, Copy)]
struct Range(f64, f64);

impl Range {
    fn none() -> Self {
        Self(f64::INFINITY, f64::NEG_INFINITY)
    }

    fn add(&mut self, value: f64) {
        *self = Self(self.0.min(value), self.1.max(value));
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.2} to {:.2}", self.0, self.1)
    }
}

fn peak(run: &Run) -> f64 {
    run.peak(0).max(run.peak(1))
}

fn is_safe_at(sampling_time: f64, speed: f64) {
    let (mut peaks, mut settled, mut tangential, mut iterations) = (Range::none(), Range::none(), Range::none(), 0);
    Experiment::paper(sampling_time, speed).at_instants(INSTANTS, |share, run| {
        let at = format!("contact at {share} of a sample");
        peaks.add(peak(run));
        settled.add(run.settled_normal());
        tangential.add(run.tangential_share());
        iterations = iterations.max(run.iterations());
        assert!(run.touched(), "{at}");
        assert!(peak(run) <= MOST, "{at}: peak {} N", peak(run));
        assert_eq!((run.infeasible(), run.losses(), run.stop_reason(), run.limited()), (0, 0, None, 0), "{at}");
        assert!(run.steps() <= 16, "{at}: {} steps", run.steps());
    });
    println!(
        "{speed} m/s at {sampling_time} s: peak {peaks} N, settled {settled} N (bound {LEAST:.2}), tangential {tangential} of \
         commanded, at most {iterations} iterations"
    );
}

fn settles_at_the_lower_bound_at(sampling_time: f64, speed: f64) {
    Experiment::paper(sampling_time, speed).at_instants(4, |share, run| {
        let at = format!("{speed} m/s at {sampling_time} s, contact at {share}");
        let (force, swing) = (run.settled_normal(), run.settled_swing());
        println!("{at}: settled {:.2} mN above the bound, swings by {:.2} mN", (force - LEAST) * 1e3, swing * 1e3);
        assert_within(&format!("{at}: settled normal force"), force, LEAST, 0.05);
        assert!(force > LEAST && swing < 0.005, "{at}: does not come to rest above its bound");
        assert_within(&format!("{at}: tangential speed / commanded"), run.tangential_share(), 1.0, 0.01);
    });
}

#[test]
fn settles_at_the_lower_bound_and_slides_at_4_and_1_ms() {
    for (sampling_time, speed) in [(0.004, 0.05), (0.004, 0.3), (0.001, 0.05), (0.001, 0.6)] {
        settles_at_the_lower_bound_at(sampling_time, speed);
    }
}

#[test]
fn settles_at_the_lower_bound_and_slides_at_a_quarter_ms() {
    for speed in [0.05, 0.25, 0.8] {
        settles_at_the_lower_bound_at(0.000_25, speed);
    }
}

/// A weight on the force must not pull it below what is asked for, nor off the surface.
#[test]
fn settles_at_the_lower_bound_whatever_the_force_weighs() {
    for (sampling_time, speed) in [(0.004, 0.2), (0.001, 0.3)] {
        for weight in [1e-4, 1e-3, 1e-2, 3e-2] {
            let mut experiment = Experiment::paper(sampling_time, speed);
            experiment.config.mpc.wrench_weight.fill(weight);
            experiment.at_instants(4, |share, run| {
                let at = format!("weight {weight}, {speed} m/s at {sampling_time} s, contact at {share}");
                assert_within(&format!("{at}: settled normal force"), run.settled_normal(), LEAST, 1.0);
                assert_eq!((run.losses(), run.stop_reason()), (0, None), "{at}");
            });
        }
    }
}

#[test]
fn is_safe_at_0_3_m_s_with_4_ms() {
    is_safe_at(0.004, 0.3);
}

#[test]
fn is_safe_at_0_6_m_s_with_1_ms() {
    is_safe_at(0.001, 0.6);
}

#[test]
fn is_safe_at_0_8_m_s_with_a_quarter_ms() {
    is_safe_at(0.000_25, 0.8);
}

/// Largest peak over the instants of contact, and in how many the arm stopped.
fn with_delay(sampling_time: f64, speed: f64, cycles: f64, is_modelled: bool) -> (f64, u32) {
    let mut experiment = Experiment::paper(sampling_time, speed).with_delay(cycles * sampling_time);
    experiment.config.mpc.model_delay = is_modelled;
    let (mut most, mut stops) = (0.0_f64, 0);
    experiment.at_instants(INSTANTS, |share, run| {
        assert!(run.touched());
        if is_modelled {
            let at = format!("{cycles} cycles of {sampling_time} s, contact at {share} of a sample");
            assert!(peak(run) <= MOST, "{at}: peak {} N", peak(run));
            assert_eq!((run.infeasible(), run.losses(), run.stop_reason()), (0, 0, None), "{at}");
        }
        most = most.max(peak(run));
        stops += u32::from(run.stop_reason().is_some());
    });
    println!(
        "{speed} m/s at {sampling_time} s, {cycles} cycles of delay, modelled {is_modelled}: peak at most {most:.1} N, \
         {stops} stops"
    );
    (most, stops)
}

#[test]
fn a_delay_that_is_modelled_keeps_the_limit() {
    for (sampling_time, speed) in [(0.004, [0.25, 0.2, 0.2, 0.12]), (0.001, [0.5, 0.5, 0.5, 0.35])] {
        for (cycles, speed) in [0.0, 0.5, 1.0, 2.0].into_iter().zip(speed) {
            with_delay(sampling_time, speed, cycles, true);
        }
    }
}

#[test]
fn a_cycle_of_delay_that_is_not_modelled_exceeds_the_limit_or_stops() {
    for (sampling_time, speed) in [(0.004, 0.2), (0.001, 0.5)] {
        let (most, stops) = with_delay(sampling_time, speed, 1.0, false);
        assert!(most > MOST || stops > 0, "{sampling_time} s: the option makes no difference");
    }
}

#[test]
fn presses_with_the_force_of_the_set_point_and_slides() {
    for (sampling_time, speed) in [(0.004, 0.25), (0.001, 0.25)] {
        let mut experiment = Experiment::paper(sampling_time, speed);
        experiment.config.contact.normal_force_reference_n = 50.0;
        let (mut settled, mut tangential) = (Range::none(), Range::none());
        experiment.at_instants(INSTANTS, |share, run| {
            let at = format!("{sampling_time} s, contact at {share} of a sample");
            settled.add(run.settled_normal());
            tangential.add(run.tangential_share());
            assert!(peak(run) <= MOST, "{at}: peak {} N", peak(run));
            assert_eq!((run.infeasible(), run.losses(), run.stop_reason()), (0, 0, None), "{at}");
        });
        println!("set point 50 N at {sampling_time} s: settled {settled} N, tangential {tangential} of commanded");
        assert!(settled.0 >= 49.0 && settled.1 <= 51.0, "{sampling_time} s: settled at {settled} N");
        assert!(tangential.0 >= 0.99 && tangential.1 <= 1.01, "{sampling_time} s: {tangential}");
    }
}
