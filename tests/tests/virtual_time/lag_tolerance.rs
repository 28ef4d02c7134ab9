//! An arm that may follow later than told (`control.lag_tolerance_s`): its impacts are softer, and what
//! was attainable before still is.

use end_to_end::closed_loop::Experiment;

/// Instants of contact within a sample.
const INSTANTS: u32 = 8;

fn tolerant(sampling_time: f64, speed: f64, lag_tolerance_s: f64) -> Experiment {
    let mut experiment = Experiment::paper(sampling_time, speed);
    experiment.config.control.lag_tolerance_s = lag_tolerance_s;
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
        assert!(peak <= 1.005 * 200.0 / end_to_end::closed_loop::NORMAL[1], "{sampling_time} s: {peak} N");
    }
}
