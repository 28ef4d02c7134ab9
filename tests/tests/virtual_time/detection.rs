//! The detected contact point in virtual time, beside the pose at which f̂ passes β: over instants
//! of contact, sampling times, lags of the estimate and speeds, without noise and with.

use admittance_runner::config::ContactPointName;
use end_to_end::closed_loop::{Experiment, Instant, NORMAL, Run};
use ipc_types::Verdict;

/// Where the plant's surface is.
const SURFACE: [f64; 2] = [1.32, 0.68];
/// Cycles after activation at which the detected point counts.
const CYCLES_AFTER: usize = 3;

fn detecting(sampling_time: f64, wrench_lag: f64, speed: f64) -> Experiment {
    let mut experiment = Experiment::paper(sampling_time, speed).with_wrench_lag(wrench_lag);
    experiment = experiment.with_motion(&[(0.26, &[0.0, -speed])]);
    experiment.config.environment.contact = ContactPointName::Detected;
    experiment.config.environment.contact_point_m = None;
    experiment
}

/// How far above the surface the controller believes it, m.
fn error(at: &Instant) -> f64 {
    (0..2).map(|axis| NORMAL[axis] * (at.contact_point[axis] - SURFACE[axis])).sum()
}

/// What activation showed: the error of the pose at the crossing of β, and of the detected point
/// then and some cycles later, m; the force then, N. `None` when the contact was not noticed.
fn found(run: &Run) -> Option<(f64, f64, f64, f64)> {
    let noticed = run.instants.iter().position(|at| at.command.active_axes != 0)?;
    let (first, later) = (&run.instants[noticed], &run.instants[noticed + CYCLES_AFTER]);
    Some((-first.truth.penetration_m, error(first), error(later), first.truth.normal_force_n))
}

#[test]
fn the_pose_at_which_the_force_is_noticed_is_no_contact_point() {
    let (mut naive, mut force, mut detected) = ((f64::INFINITY, 0.0_f64), (f64::INFINITY, 0.0_f64), 0.0_f64);
    detecting(0.004, 0.02, 0.25).at_instants(16, |_, run| {
        let (at_threshold, _, later, normal) = found(run).expect("noticed");
        naive = (naive.0.min(at_threshold.abs()), naive.1.max(at_threshold.abs()));
        force = (force.0.min(normal), force.1.max(normal));
        detected = detected.max(later.abs());
    });
    println!(
        "0.25 m/s, 4 ms: at the crossing of the threshold {:.2} to {:.2} mm and {:.0} to {:.0} N deep; detected within {:.4} mm",
        naive.0 * 1e3,
        naive.1 * 1e3,
        force.0,
        force.1,
        detected * 1e3
    );
    assert!(naive.0 > 0.0005, "then there would be no need of a detection");
    assert!(detected <= 0.000_02);
}

#[test]
fn without_noise_the_point_is_found_within_20_micrometres() {
    let (mut worst, mut failed) = (0.0_f64, Vec::new());
    for sampling_time in [0.004, 0.001, 0.000_25] {
        for wrench_lag in [0.0, 0.005, 0.02, 0.03] {
            for speed in [0.05, 0.15, 0.25, 0.5, 0.8] {
                let (mut at_once, mut later) = (0.0_f64, 0.0_f64);
                detecting(sampling_time, wrench_lag, speed).at_instants(8, |share, run| {
                    let at = format!("{sampling_time} s, T_est {wrench_lag} s, {speed} m/s, contact at {share}");
                    let (_, first, last, _) = found(run).unwrap_or_else(|| panic!("{at}: not noticed"));
                    at_once = at_once.max(first.abs());
                    later = later.max(last.abs());
                    if last.abs() > 0.000_02 {
                        failed.push(format!("{at}: {:.1} µm", last * 1e6));
                    }
                });
                println!(
                    "{sampling_time} s, T_est {wrench_lag} s, {speed} m/s: {:.2} µm at activation, {:.2} µm {CYCLES_AFTER} \
                     cycles later",
                    at_once * 1e6,
                    later * 1e6
                );
                worst = worst.max(later);
            }
        }
    }
    println!("worst: {:.2} µm", worst * 1e6);
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn a_detected_point_keeps_the_limit_and_the_contact() {
    for (sampling_time, speed) in [(0.004, 0.3), (0.001, 0.6)] {
        let mut experiment = detecting(sampling_time, 0.02, speed).with_motion(&[(0.8, &[0.0, -speed])]);
        // If the mismatch guard were wrong for one cycle it would stop the arm.
        experiment.config.stopping.mismatch_n = Some(20.0);
        let mut peak = 0.0_f64;
        experiment.at_instants(16, |share, run| {
            let at = format!("{sampling_time} s, {speed} m/s, contact at {share}");
            peak = peak.max(run.peak(1));
            assert!(run.peak(1) <= 200.5, "{at}: peak {} N", run.peak(1));
            assert_eq!((run.stop_reason(), run.infeasible(), run.losses()), (None, 0, 0), "{at}");
        });
        println!("detected, {speed} m/s at {sampling_time} s: peak at most {peak:.1} N");
    }
}

#[test]
fn with_noise_the_error_is_a_small_part_of_the_naive_one() {
    const RUNS: u32 = 100;
    for (sampling_time, speed) in [(0.004, 0.25), (0.001, 0.25), (0.001, 0.05)] {
        let (mut sum, mut squares, mut most, mut naive) = (0.0, 0.0, 0.0_f64, 0.0);
        for seed in 0..RUNS {
            let share = f64::from(seed) / f64::from(RUNS);
            let mut experiment = detecting(sampling_time, 0.02, speed).at_instant(share);
            experiment.config.environment.wrench_noise_n = 1.0;
            experiment.scenario.noise.wrench = 1.0;
            experiment.scenario.noise.seed = u64::from(seed) + 1;
            let run = experiment.run();
            let (at_threshold, _, later, _) = found(&run).expect("noticed");
            sum += later;
            squares += later * later;
            most = most.max(later.abs());
            naive += at_threshold;
        }
        let count = f64::from(RUNS);
        let (mean, rms, naive) = (sum / count, (squares / count).sqrt(), (naive / count).abs());
        let deviation = (rms * rms - mean * mean).sqrt();
        println!(
            "noise 1 N rms, {sampling_time} s, {speed} m/s, {RUNS} runs: mean {:.1} µm, sd {:.1} µm, largest {:.1} µm; at the \
             threshold {:.0} µm",
            mean * 1e6,
            deviation * 1e6,
            most * 1e6,
            naive * 1e6
        );
        assert!(rms < 0.25 * naive, "no better than the threshold: {rms} of {naive} m");
    }
}

#[test]
fn safe_is_only_what_the_noise_of_the_detected_point_leaves_below_the_limit() {
    let (mut at_risk, mut over) = (0, 0);
    for seed in 1..=24_u32 {
        let speed = 0.6 + 0.02 * f64::from(seed % 8);
        let mut experiment = detecting(0.001, 0.02, speed).at_instant(f64::from(seed) / 24.0);
        experiment.config.environment.wrench_noise_n = 1.0;
        experiment.scenario.noise.wrench = 1.0;
        experiment.scenario.noise.seed = seed.into();
        let run = experiment.run();
        let said = |verdict: Verdict| run.instants.iter().filter(move |at| at.command.verdict == verdict.code());
        for at in said(Verdict::Feasible) {
            assert!(at.command.verdict_margin > -1e-9, "seed {seed}: safe by {} N", at.command.verdict_margin);
        }
        for at in said(Verdict::AtRisk) {
            let (share, margin) = (at.command.verdict_share, at.command.verdict_margin);
            // Half, where the force rides on its limit, to the bits of a computation.
            assert!(0.0 < share && share <= 0.5 + 1e-9 && margin < 0.0, "seed {seed}: {share} by {margin} N");
            at_risk += 1;
        }
        if run.peak(1) > 200.5 {
            over += 1;
            let is_told = said(Verdict::AtRisk).chain(said(Verdict::Infeasible)).next().is_some();
            assert!(is_told, "seed {seed}: {} N after verdicts that were safe throughout", run.peak(1));
        }
    }
    println!("{at_risk} cycles at risk; {over} of 24 contacts above the limit, each told");
    assert!(at_risk > 0, "no contact was near enough to its limit");
}
