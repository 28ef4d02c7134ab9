//! An arm that may follow later than told (`control.lag_tolerance_s`): its impacts are softer, and what
//! was attainable before still is.

use admittance_runner::config::ContactPointName;
use end_to_end::closed_loop::{Experiment, NORMAL};
use ipc_types::Verdict;

/// Instants of contact within a sample.
const INSTANTS: u32 = 8;

fn tolerant(sampling_time: f64, speed: f64, lag_tolerance_s: f64) -> Experiment {
    let mut experiment = Experiment::paper(sampling_time, speed);
    experiment.config.control.lag_tolerance_s = lag_tolerance_s;
    experiment
}

/// The same of which only a range of the stiffness is told.
fn of_a_range(mut experiment: Experiment) -> Experiment {
    let environment = &mut experiment.config.environment;
    environment.stiffness_range_n_m = Some([5e4, 2e5]);
    (environment.contact, environment.contact_point_m) = (ContactPointName::Detected, None);
    environment.wrench_noise_n = 0.5;
    experiment.scenario.noise.wrench = 0.5;
    experiment
}

/// The highest peak of all instants of contact along the normal, N, and the settled forces.
fn peaks(experiment: &Experiment) -> (f64, Vec<f64>) {
    let (mut peak, mut settled) = (0.0_f64, Vec::new());
    experiment.at_instants(INSTANTS, |share, run| {
        assert_eq!(run.stop_reason(), None, "contact at {share}");
        peak = peak.max(run.peak_normal());
        settled.push(run.settled_normal());
    });
    (peak, settled)
}

#[test]
fn an_impact_is_softer_and_the_force_settles_as_ever() {
    for (sampling_time, speed) in [(0.004, 0.22), (0.001, 0.4)] {
        let (told, _) = peaks(&tolerant(sampling_time, speed, 0.0));
        let (late, settled) = peaks(&tolerant(sampling_time, speed, 0.005));
        println!(
            "{sampling_time} s, {speed} m/s: {told:.1} N, and {late:.1} N with a tolerance; settled {settled:.1?}"
        );
        assert!(late < 0.95 * told, "{sampling_time} s: {late} of {told} N");
        assert!(settled.iter().all(|force| (force - 14.2).abs() < 1.0), "{sampling_time} s: {settled:?}");
    }
}

#[test]
fn what_can_just_be_kept_is_not_refused() {
    for (sampling_time, speed) in [(0.004, 0.31), (0.001, 0.62)] {
        let (peak, _) = peaks(&tolerant(sampling_time, speed, 0.01));
        println!("{sampling_time} s, {speed} m/s: {peak:.1} N");
        assert!(peak <= 1.005 * 200.0 / NORMAL[1], "{sampling_time} s: {peak} N");
    }
}

#[test]
fn a_range_leaves_free_as_much_and_refuses_nothing() {
    for (sampling_time, speed) in [(0.004, 0.2), (0.001, 0.3)] {
        for delay in [0.0, 0.001] {
            let of = |lag: f64| peaks(&of_a_range(tolerant(sampling_time, speed, lag)).with_delay(delay)).0;
            let (told, late) = (of(0.0), of(0.005));
            println!("{sampling_time} s, {speed} m/s, delay {delay} s: {told:.1} N, and {late:.1} N with a tolerance");
            assert!(late < told, "{sampling_time} s: {late} of {told} N");
        }
    }
}

/// What is left free below the limit belongs to the margin: it is newtons that the force may grow by.
#[test]
fn a_margin_counts_from_the_limit() {
    // Of a range the margin is that of the hardest surface that may be there.
    let cases = [(tolerant(0.004, 0.22, 0.005), 0.7), (of_a_range(tolerant(0.004, 0.15, 0.005)), 0.1)];
    for (experiment, part) in cases {
        let run = experiment.run();
        let feasible = run.instants.iter().filter(|at| at.command.verdict == Verdict::Feasible.code());
        let least = feasible.map(|at| at.command.verdict_margin).fold(f64::INFINITY, f64::min);
        println!("least margin {least:.1} N, peak {:.1} N along the normal", run.peak_normal());
        let free = 200.0 - run.peak_normal() * NORMAL[1];
        assert!((part * free..=1.2 * free).contains(&least), "{least} N, {free} N are free");
    }
}

/// What a longer lag of the wrench would hide (`contact.wrench_lag_tolerance`) is off the margin, and with a surface that is told no
/// command changes.
/// A wrench without lag hides nothing, and neither does one that has settled.
#[test]
fn what_a_longer_lag_hides_is_off_the_margin() {
    for lag_s in [0.0, 0.02] {
        let run = |share: f64| {
            let mut experiment = Experiment::paper(0.004, 0.2);
            experiment.config.contact.wrench_time_constant_s.fill(lag_s);
            experiment.scenario.wrench.time_constant_s.fill(lag_s);
            experiment.config.contact.wrench_lag_tolerance = share;
            experiment.run()
        };
        let (told, tolerant) = (run(0.0), run(0.25));
        let mut hidden = Vec::new();
        for (told, tolerant) in told.instants.iter().zip(&tolerant.instants) {
            assert_eq!(told.command.velocity_offset, tolerant.command.velocity_offset);
            if told.command.verdict != Verdict::None.code() {
                hidden.push(told.command.verdict_margin - tolerant.command.verdict_margin);
            }
        }
        let most = hidden.iter().copied().fold(0.0, f64::max);
        let last = hidden.last().copied().expect("a touch");
        println!("lag {lag_s} s: {most:.2} N hidden at most, {last:.3} N in the end");
        assert!(last < 0.5, "lag {lag_s} s: {last} N hidden in the end");
        assert!(if lag_s > 0.0 { most > 5.0 } else { most < 0.5 }, "lag {lag_s} s: {most} N hidden");
    }
}
