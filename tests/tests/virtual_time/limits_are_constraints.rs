//! Limits of joints and offset as constraints of the optimisation, in virtual time: each is reached
//! in some cycle and kept by every plan, so that nothing is left for a clamp after the law.

use end_to_end::closed_loop::{Experiment, Instant, NORMAL, Run};
use ipc_types::{Mode, Source};
use nalgebra::{SVector, Vector2};

/// How far from its limit a value counts as at it.
const AT_LIMIT: f64 = 1e-6;

/// The cycles that the MPC answered, each with the offset in force before it.
fn planned(run: &Run) -> impl Iterator<Item = (&Instant, [f64; 6])> {
    run.instants
        .windows(2)
        .map(|pair| (&pair[1], pair[0].command.velocity_offset))
        .filter(|(at, _)| at.is_in(Mode::Contact) && at.command.source == Source::Mpc.code())
}

/// Holds every plan's distances (limit minus value) against zero: none below, some at it; and
/// nothing was cut afterwards.
fn hit_and_held(what: &str, run: &Run, distance: impl Fn(&Instant, [f64; 6]) -> f64) {
    let distances: Vec<f64> = planned(run).map(|(at, before)| distance(at, before)).collect();
    let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let active = distances.iter().filter(|distance| distance.abs() <= AT_LIMIT).count();
    println!(
        "{what}: active in {active} of {} cycles, exceeded by at most {:.1e}; peak {:.1} N, reason {:?}",
        distances.len(),
        (-least).max(0.0),
        run.peak(1),
        run.stop_reason()
    );
    assert!(active > 0, "{what}: never reached, closest {least}");
    assert!(least >= -1e-7, "{what}: exceeded by {}", -least);
    assert_eq!(run.limited(), 0, "{what}: cut after the law");
    assert_eq!((run.stop_reason(), run.infeasible()), (None, 0), "{what}");
}

/// The joint velocity references of a plan, rad/s, with the length of each step in s.
fn references(experiment: &Experiment, at: &Instant) -> Vec<(Vector2<f64>, f64)> {
    let chain = experiment.config.robot.chain::<2>().expect("the planar arm");
    let kinematics = chain.kinematics(&Vector2::from_column_slice(&at.state.joint_position[..2]));
    let inverse = kinematics.inverse::<2>(0.0).expect("not singular");
    let twist = |offset: [f64; 6]| SVector::<f64, 2>::from_fn(|axis, _| at.state.twist_reference[axis] + offset[axis]);
    at.plan().map(|(offset, length)| (inverse.joint_velocity(&twist(offset)), length)).collect()
}

/// Where the joints would come to rest, q + T_V q̇, at the end of every step of a plan: the joint
/// loops (4) are linear, so this is exact.
fn rest_positions(experiment: &Experiment, at: &Instant) -> Vec<Vector2<f64>> {
    let lags = &experiment.config.robot.velocity_time_constant_s;
    let mut q = Vector2::from_column_slice(&at.state.joint_position[..2]);
    let mut speed = Vector2::from_column_slice(&at.state.joint_velocity[..2]);
    let advance = |(reference, length): (Vector2<f64>, f64)| {
        for joint in 0..2 {
            let left = (-length / lags[joint]).exp();
            let error = speed[joint] - reference[joint];
            q[joint] += reference[joint] * length + error * lags[joint] * (1.0 - left);
            speed[joint] = reference[joint] + error * left;
        }
        Vector2::from_fn(|joint, _| q[joint] + lags[joint] * speed[joint])
    };
    references(experiment, at).into_iter().map(advance).collect()
}

fn least(distances: impl IntoIterator<Item = f64>) -> f64 {
    distances.into_iter().fold(f64::INFINITY, f64::min)
}

#[test]
fn joint_speed() {
    let mut experiment = Experiment::paper(0.004, 0.2);
    experiment.config.limits.joint_speed_rad_s = Some(vec![0.28, 0.5]);
    let run = experiment.run();
    hit_and_held("joint speed", &run, |at, _| {
        let speeds = references(&experiment, at);
        least(speeds.iter().flat_map(|(speed, _)| [0.28 - speed[0].abs(), 0.5 - speed[1].abs()]))
    });
}

#[test]
fn joint_position() {
    // Sliding downhill turns joint 1 down and stretches the arm: either joint meets its limit after
    // about half a second.
    for (name, joint, limit, sign) in [("least q1", 0, 1.15, -1.0), ("largest q2", 1, -1.425, 1.0)] {
        let mut experiment = Experiment::paper(0.004, 0.2);
        let (mut min, mut max) = (vec![-3.0, -3.0], vec![3.0, 3.0]);
        (if sign < 0.0 { &mut min } else { &mut max })[joint] = limit;
        experiment.config.limits.joint_position_min_rad = Some(min);
        experiment.config.limits.joint_position_max_rad = Some(max);
        let run = experiment.run();
        hit_and_held(name, &run, |at, _| {
            least(rest_positions(&experiment, at).iter().map(|q| sign * (limit - q[joint])))
        });
        let beyond = run.instants.iter().filter(|at| at.is_in(Mode::Contact));
        let beyond = beyond.map(|at| sign * (at.truth.joint_position[joint] - limit)).fold(f64::NEG_INFINITY, f64::max);
        assert!(beyond <= 1e-6, "{name}: the joint passes its limit by {beyond} rad");
        assert_eq!(run.losses(), 0, "{name}");
    }
}

#[test]
fn joint_position_with_a_rate_too_slow_to_keep_it() {
    // ṗ0 begins to slide at once; to end that takes the offset longer than the horizon sees ahead.
    // So the joint has to pass its limit, as far as it cannot help, and every cycle has an answer.
    for (rate, speed) in [(0.5, 0.06), (0.3, 0.06), (0.5, 0.1)] {
        let slide = [speed * NORMAL[1], -speed * NORMAL[0]];
        let phases: [(f64, &[f64]); 3] = [(0.6, &[0.0, -0.01]), (0.3, &slide), (0.2, &[0.0, 0.0])];
        let mut experiment = Experiment::paper(0.004, 0.01).with_motion(&phases);
        // So much that unequal lags of the joints do not take it off the surface.
        experiment.config.contact.normal_force_reference_n = 100.0;
        experiment.config.limits.inward_rate_m_s2 = Some(vec![rate, rate]);
        experiment.config.limits.outward_rate_m_s2 = Some(vec![rate, rate]);
        let free = experiment.run();
        let start = free.instants.iter().find(|at| at.time() >= 0.6).expect("the slide").truth.joint_position[0];
        let limit = start - 0.001;
        experiment.config.limits.joint_position_min_rad = Some(vec![limit, -3.0]);
        experiment.config.limits.joint_position_max_rad = Some(vec![3.0, 3.0]);
        let run = experiment.run();
        let what = format!("{rate} m/s^2, {speed} m/s");
        let beyond = run.instants.iter().map(|at| limit - at.truth.joint_position[0]).fold(f64::NEG_INFINITY, f64::max);
        println!("{what}: passes the limit by {beyond} rad");
        assert_eq!((run.counters.fallback, run.stop_reason(), run.infeasible()), (0, None, 0), "{what}");
        assert!(beyond > 1e-3, "{what}: the rate is fast enough, {beyond} rad");
        // The way to standstill at that rate; here the joint turns by about 1 rad a metre.
        assert!(beyond < speed * speed / (2.0 * rate), "{what}: passes the limit by {beyond} rad");
    }
}

#[test]
fn offset() {
    let mut experiment = Experiment::paper(0.004, 0.1);
    experiment.config.limits.joint_speed_rad_s = None;
    experiment.config.limits.velocity_offset = vec![0.08, 0.2];
    let run = experiment.run();
    hit_and_held("offset", &run, |at, _| {
        least(at.plan().flat_map(|(offset, _)| [0.08 - offset[0].abs(), 0.2 - offset[1].abs()]))
    });
}

/// Change of the offset per time at the start of every step of a plan, per axis, m/s².
fn rates(at: &Instant, before: [f64; 6], sampling_time: f64) -> Vec<Vector2<f64>> {
    let (mut last, mut length) = (before, sampling_time);
    at.plan()
        .map(|(offset, next)| {
            let rate = Vector2::from_fn(|axis, _| (offset[axis] - last[axis]) / length);
            (last, length) = (offset, next);
            rate
        })
        .collect()
}

#[test]
fn inward_and_outward_rate() {
    // Both components of the normal are positive: outward is up and to the right.
    for (name, inward, outward) in [("inward rate", [5.0, 8.0], None), ("outward rate", [1e4, 1e4], Some([25.0, 40.0]))]
    {
        for sampling_time in [0.004, 0.001] {
            let mut experiment = Experiment::paper(sampling_time, 0.1);
            experiment.config.limits.inward_rate_m_s2 = Some(inward.to_vec());
            experiment.config.limits.outward_rate_m_s2 = outward.map(|rate| rate.to_vec());
            let run = experiment.run();
            hit_and_held(&format!("{name} at {sampling_time} s"), &run, |at, before| {
                let rates = rates(at, before, sampling_time);
                let scaled = rates.iter().flat_map(|rate| {
                    [0, 1].map(|axis| {
                        let most =
                            if rate[axis] > 0.0 { outward.map_or(f64::INFINITY, |o| o[axis]) } else { inward[axis] };
                        // In m/s: the rate is what the QP bounds times the step's length.
                        (most - rate[axis].abs()) * sampling_time
                    })
                });
                least(scaled)
            });
            assert_eq!(run.losses(), 0, "{name}");
        }
    }
}
