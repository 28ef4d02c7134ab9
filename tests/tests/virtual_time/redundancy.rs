//! Redundancy (remark 1): a seven-joint arm that slides 2 m on a floor, and what its joints do beside it.

use admittance_runner::config::ResolutionName;
use end_to_end::closed_loop::{Experiment, Run};
use end_to_end::drive_judge::{Published, judge};
use ipc_types::{Fault, Mode};
use nalgebra::{SMatrix, SVector};
use plant_sim::scenario::FollowsName;

const CONFIG: &str = include_str!("../../../deploy/robots/seven-joint.toml");
const SCENARIO: &str = include_str!("../../../plant-sim/scenarios/seven-joint.toml");
/// The shipped arm reaches 0.8 m: this one's links are so much longer.
const LONGER: f64 = 2.5;
/// Where it touches the floor, at one end of the slide, elbow out.
const START: [f64; 7] = [-1.3054, 1.0765, 0.6559, -1.6811, -0.9369, 0.7293, -3.3044];
const POINT: [f64; 3] = [0.9, -1.0, 0.3];
const DOWN: [f64; 6] = [0.0, 0.0, -0.05, 0.0, 0.0, 0.0];
/// 2 m in 5 s.
const SLIDE: [f64; 6] = [0.0, 0.4, -0.02, 0.0, 0.0, 0.0];
const SLIDE_S: f64 = 5.0;
/// f_max on every linear direction in N, and what the linear model may miss of it.
const MOST: f64 = 150.0 + 0.5;
/// The last joint: the slide takes it from -3.30 to -1.62 rad by the least norm.
const LAST: usize = 6;
/// The joint that swings the elbow about the line from shoulder to wrist: 0.46 to 0.67 rad by the least
/// norm. (The angle of the elbow itself is the task's, of an arm of this build.)
const SWING: usize = 2;

/// The long arm on its floor, its motion controller resolving twists by the least norm.
fn least_norm(sampling_time: f64) -> Experiment {
    let mut experiment =
        Experiment::new(CONFIG, SCENARIO, sampling_time).with_motion(&[(0.4, &DOWN), (SLIDE_S, &SLIDE)]);
    let Experiment { config, scenario } = &mut experiment;
    for robot in [&mut config.robot, &mut scenario.robot] {
        robot.joint.iter_mut().for_each(|joint| joint.origin_m = joint.origin_m.map(|x| x * LONGER));
    }
    scenario.start.joint_position_rad = START.to_vec();
    scenario.surface.as_mut().expect("a floor").point_m = POINT;
    config.environment.contact_point_m = Some(POINT);
    experiment
}

/// The same, its daemon resolving them.
fn resolved(sampling_time: f64, resolution: ResolutionName) -> Experiment {
    let mut experiment = least_norm(sampling_time);
    experiment.config.redundancy.resolution = resolution;
    experiment.scenario.controller.follows = FollowsName::JointVelocity;
    experiment
}

/// The same with limits of a joint, of which the least norm would pass one, and none that matters of the
/// others.
fn with_limits(mut experiment: Experiment, joint: usize, (lower, upper): (f64, f64)) -> Experiment {
    let (mut min, mut max) = (vec![-6.0; 7], vec![6.0; 7]);
    (min[joint], max[joint]) = (lower, upper);
    let limits = &mut experiment.config.limits;
    (limits.joint_position_min_rad, limits.joint_position_max_rad) = (Some(min), Some(max));
    experiment
}

fn joints(values: &[f64; 8]) -> SVector<f64, 7> {
    SVector::from_fn(|joint, _| values[joint])
}

/// Largest and smallest true position of a joint, rad.
fn range(run: &Run, joint: usize) -> (f64, f64) {
    let positions = run.instants.iter().map(|at| at.truth.joint_position[joint]);
    positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), q| (least.min(q), most.max(q)))
}

/// How far the tool slid, m.
fn slid(run: &Run) -> f64 {
    run.instants.last().map_or(0.0, |at| at.truth.tcp_position[1]) - POINT[1]
}

/// A contact that went as it should, and slid all the way.
fn assert_slides(run: &Run, what: &str) {
    assert!(run.touched(), "{what}");
    assert_eq!((run.stop_reason(), run.infeasible(), run.losses(), run.limited()), (None, 0, 0, 0), "{what}");
    assert!(run.peak_normal() <= MOST, "{what}: peak {} N", run.peak_normal());
    assert!((slid(run) - 2.0).abs() < 0.03, "{what}: slid {} m", slid(run));
}

fn tell(run: &Run, what: &str) {
    let (least, most) = range(run, LAST);
    println!(
        "{what}: peak {:.2} N, settled {:.3} N, slid {:.4} m, last joint {least:.3} to {most:.3} rad",
        run.peak_normal(),
        run.settled_normal(),
        slid(run)
    );
}

/// q as the daemon's own chain has it, for its null space.
fn null_space_of(experiment: &Experiment, q: &SVector<f64, 7>) -> SMatrix<f64, 7, 7> {
    let chain = experiment.scenario.robot.chain::<7>().expect("seven joints");
    let jacobian = chain.kinematics(q).task_jacobian::<6>();
    let inverse = jacobian.pseudo_inverse(1e-9).expect("regular");
    SMatrix::<f64, 7, 7>::identity() - inverse * jacobian
}

#[test]
fn joints_turn_away_from_their_limits_over_two_metres_with_the_force_as_good() {
    let least = least_norm(0.001).run();
    tell(&least, "least norm");
    assert_slides(&least, "least norm");
    for (joint, limits) in [(LAST, (-6.0, -2.3)), (SWING, (0.5, 6.0))] {
        let (low, high) = range(&least, joint);
        assert!(low < limits.0 - 0.03 || high > limits.1 + 0.5, "joint {joint}: the limit is in the way");
        for resolution in [ResolutionName::Weighted, ResolutionName::Posture, ResolutionName::Keep] {
            let mut experiment = with_limits(resolved(0.001, resolution), joint, limits);
            let redundancy = &mut experiment.config.redundancy;
            match resolution {
                ResolutionName::Weighted => redundancy.joint_weights = Some(vec![1.0; 7]),
                ResolutionName::Posture => redundancy.posture_rad = Some(START.to_vec()),
                ResolutionName::Keep | ResolutionName::LeastNorm => {}
            }
            let margin = experiment.config.redundancy.margin(&experiment.config).expect("limits")[joint];
            assert!((margin - 0.1).abs() < 1e-12);
            let run = experiment.run();
            let what = format!("{resolution} with joint {joint} within {limits:?} rad");
            tell(&run, &what);
            assert_slides(&run, &what);
            // It stays at the margin, but for what the arm's acceleration allows.
            let (low, high) = range(&run, joint);
            println!("  joint {joint}: {low:.3} to {high:.3} rad");
            let allowed = limits.0 + 0.9 * margin..limits.1 - 0.9 * margin;
            assert!(allowed.contains(&low) && allowed.contains(&high), "{what}: {low} to {high} rad");
            assert!(run.peak_normal() <= least.peak_normal() * 1.01, "{what}: {} N", run.peak_normal());
            let off = run.settled_normal() - least.settled_normal();
            assert!(off.abs() < 0.5, "{what}: {off} N more");
        }
    }
    // And without a resolution the limit ends the slide.
    let bound = with_limits(least_norm(0.001), LAST, (-6.0, -2.3)).run();
    tell(&bound, "least norm with the limit");
    assert!(bound.stop_reason().is_some() || slid(&bound) < 1.9, "slid {} m", slid(&bound));
}

/// The same with the drives of a Franka Research 3: the elbow turns away in time with what the twist leaves of them, and
/// the force is that without a resolution.
#[test]
fn joints_turn_away_from_their_limits_within_the_limits_of_their_drives() {
    for (sampling_time, inputs) in [(0.001, 1), (0.004, 1), (0.004, 4)] {
        let driven = |mut experiment: Experiment| {
            experiment.config.mpc.inputs_per_cycle = Some(inputs);
            experiment.with_drives(Published::fr3(), sampling_time / f64::from(inputs))
        };
        let least = driven(least_norm(sampling_time)).run();
        tell(&least, &format!("least norm, {sampling_time} s, {inputs} inputs, driven"));
        assert_slides(&least, "least norm");
        for (joint, limits) in [(LAST, (-6.0, -2.3)), (SWING, (0.5, 6.0))] {
            for resolution in [ResolutionName::Weighted, ResolutionName::Posture, ResolutionName::Keep] {
                let mut experiment = driven(with_limits(resolved(sampling_time, resolution), joint, limits));
                let redundancy = &mut experiment.config.redundancy;
                match resolution {
                    ResolutionName::Weighted => redundancy.joint_weights = Some(vec![1.0; 7]),
                    ResolutionName::Posture => redundancy.posture_rad = Some(START.to_vec()),
                    ResolutionName::Keep | ResolutionName::LeastNorm => {}
                }
                let run = experiment.run();
                let what = format!(
                    "{resolution} with joint {joint} within {limits:?} rad, {sampling_time} s, {inputs} inputs, driven"
                );
                tell(&run, &what);
                let given = run.instants.iter().flat_map(|at| at.streamed.iter().map(|[_, given]| given.as_slice()));
                let worst = judge(given, sampling_time / f64::from(inputs), &Published::fr3());
                let asked = run.instants.iter().flat_map(|at| at.streamed.iter().map(|[asked, _]| asked.as_slice()));
                let asked = judge(asked, sampling_time / f64::from(inputs), &Published::fr3());
                let (low, high) = range(&run, joint);
                println!("  joint {joint}: {low:.3} to {high:.3} rad; given {:.7}, asked {asked:?}", worst.most());
                assert!(worst.most() <= 1.0 + 1e-6, "{what}: {worst:?}");
                assert_slides(&run, &what);
                let allowed = limits.0 + 0.08..limits.1 - 0.08;
                assert!(allowed.contains(&low) && allowed.contains(&high), "{what}: {low} to {high} rad");
                assert!(run.peak_normal() <= least.peak_normal() * 1.01, "{what}: {} N", run.peak_normal());
                let off = run.settled_normal() - least.settled_normal();
                assert!(off.abs() < 0.5, "{what}: {off} N more");
            }
        }
    }
}

/// A wrench with noise has the twist correct itself all the time: what that leaves of the drives is enough to keep the joint from
/// its limit.
#[test]
fn joints_turn_away_from_their_limits_beside_a_twist_that_is_never_quiet() {
    for (sampling_time, inputs) in [(0.001, 1), (0.004, 1), (0.004, 4)] {
        for noise in [0.5, 1.0] {
            let limits = (-6.0, -2.3);
            let mut experiment = with_limits(resolved(sampling_time, ResolutionName::Keep), LAST, limits)
                .with_drives(Published::fr3(), sampling_time / f64::from(inputs));
            experiment.config.mpc.inputs_per_cycle = Some(inputs);
            (experiment.scenario.noise.wrench, experiment.scenario.noise.seed) = (noise, 7);
            experiment.config.environment.wrench_noise_n = noise;
            let run = experiment.run();
            let what = format!("{noise} N of noise, {sampling_time} s, {inputs} inputs, driven");
            tell(&run, &what);
            let (_, high) = range(&run, LAST);
            assert_eq!(run.stop_reason(), None, "{what}");
            assert!((slid(&run) - 2.0).abs() < 0.03, "{what}: slid {} m", slid(&run));
            assert!(high < limits.1 - 0.08, "{what}: {high} rad");
        }
    }
}

/// In free motion nobody but the resolution looks at the joints' limits: a fast twist drives one towards its end, and
/// the others go as fast in its place.
#[test]
fn limits_of_position_are_kept_in_free_motion_as_fast_as_the_twist_goes() {
    const FAST: [f64; 6] = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    let in_the_air = |mut experiment: Experiment| {
        experiment.scenario.surface = None;
        experiment.scenario.start.contact_time_s = None;
        experiment.config.redundancy.acceleration_rad_s2 = 10.0;
        experiment.with_motion(&[(0.2, &[0.0; 6]), (2.0, &FAST)])
    };
    let mut least = in_the_air(least_norm(0.001));
    least.scenario.controller.follows = FollowsName::JointVelocity;
    let (low, high) = range(&least.run(), LAST);
    println!("in the air by the least norm: {low:.3} to {high:.3} rad");
    assert!(high > -2.0, "the limit is in the way: {high} rad");
    let mut experiment = in_the_air(with_limits(resolved(0.001, ResolutionName::Keep), LAST, (-6.0, -2.3)));
    // So slow that a share of it would not do.
    experiment.config.redundancy.speed_share = 0.01;
    let run = experiment.run();
    let (low, high) = range(&run, LAST);
    println!("in the air, resolved: {low:.3} to {high:.3} rad, slid {:.3} m", slid(&run));
    assert!(!run.touched() && run.stop_reason().is_none());
    assert!(high < -2.3, "{high} rad");
    assert!((slid(&run) - 2.0).abs() < 0.03, "slid {} m", slid(&run));
}

#[test]
fn a_posture_is_reached_beside_the_task() {
    // The elbow swung by half a radian's worth of null-space motion, reached while the tool presses.
    let mut experiment = resolved(0.001, ResolutionName::Posture)
        .with_motion(&[(0.4, &DOWN), (6.0, &[0.0, 0.02, -0.02, 0.0, 0.0, 0.0])]);
    let away = null_space_of(&experiment, &START.into()) * SVector::<f64, 7>::from_element(1.0);
    let posture = SVector::from(START) + away * (0.5 / away.norm());
    experiment.config.redundancy.posture_rad = Some(posture.as_slice().to_vec());
    let run = experiment.run();
    tell(&run, "posture");
    assert!(run.touched());
    assert_eq!((run.stop_reason(), run.infeasible(), run.losses(), run.limited()), (None, 0, 0, 0));
    assert!(run.peak_normal() <= MOST, "peak {} N", run.peak_normal());
    let left = |at: usize| {
        let q = joints(&run.instants[at].truth.joint_position);
        (null_space_of(&experiment, &q) * (posture - q)).norm()
    };
    let (first, last) = (left(0), left(run.instants.len() - 1));
    println!("posture: {first:.3} rad beside the task at first, {last:.4} at last");
    assert!(first > 0.3 && last < 0.01, "{first} to {last} rad");
}

#[test]
fn keep_leaves_the_commanded_null_space_motion_alone() {
    // Along the floor, so that the commanded pose does not sink away from where the tool can be.
    const ALONG: [f64; 6] = [0.0, 0.4, 0.0, 0.0, 0.0, 0.0];
    let still = resolved(0.001, ResolutionName::Keep).with_motion(&[(0.3, &DOWN), (2.0, &ALONG), (1.0, &[0.0; 6])]);
    let mut experiment = still.clone();
    let beside = null_space_of(&experiment, &START.into()) * SVector::<f64, 7>::from_element(1.0);
    let beside = beside * (0.15 / beside.norm());
    experiment.scenario.motion[1].beside_rad_s = Some(beside.as_slice().to_vec());
    let run = experiment.run();
    tell(&run, "keep");
    assert!(run.touched());
    assert_eq!((run.stop_reason(), run.infeasible(), run.losses(), run.limited()), (None, 0, 0, 0));
    assert!(run.peak_normal() <= MOST, "peak {} N", run.peak_normal());
    let (mut off, mut changed) = (0.0_f64, 0.0_f64);
    for at in &run.instants {
        let q = joints(&at.state.joint_position);
        let beside_the_task = null_space_of(&experiment, &q);
        // Nothing is added to what is commanded beside the task.
        changed = changed.max((beside_the_task * joints(&at.command.joint_velocity_offset)).norm());
        // So the joints are where they are commanded to be, but for their lag and for the tool's way into the floor.
        off = off.max((beside_the_task * (q - joints(&at.state.joint_position_reference))).norm());
    }
    let end = |run: &Run| joints(&run.instants.last().expect("instants").truth.joint_position);
    let moved = (end(&run) - end(&still.run())).norm();
    println!("keep: moved {moved:.3} rad, off by {off:.4} rad at most, changed by {changed:.1e} rad/s");
    assert!(changed < 1e-9, "{changed} rad/s");
    assert!(moved > 0.2, "{moved} rad");
    assert!(off < 0.003, "{off} rad");
}

#[test]
fn a_joint_of_large_weight_holds_still() {
    let mut experiment = resolved(0.001, ResolutionName::Weighted);
    let mut weights = vec![1.0; 7];
    weights[LAST - 2] = 1e6;
    experiment.config.redundancy.joint_weights = Some(weights);
    let run = experiment.run();
    tell(&run, "weighted");
    assert_slides(&run, "weighted");
    let (least, most) = range(&run, LAST - 2);
    println!("weighted: fifth joint moves {:.2e} rad", most - least);
    assert!(most - least < 1e-3, "{} rad", most - least);
    let (least, most) = range(&least_norm(0.001).run(), LAST - 2);
    assert!(most - least > 0.1, "by the least norm it moves");
}

#[test]
fn several_inputs_within_a_cycle_reach_the_joints_as_they_were_planned() {
    for resolution in [ResolutionName::LeastNorm, ResolutionName::Weighted] {
        let mut experiment = resolved(0.004, resolution).with_motion(&[(0.4, &DOWN), (1.0, &SLIDE)]);
        if resolution == ResolutionName::Weighted {
            experiment.config.redundancy.joint_weights = Some(vec![1.0, 3.0, 0.5, 2.0, 1.0, 1.0, 10.0]);
        }
        let run = experiment.run();
        tell(&run, &format!("{resolution} at 4 ms"));
        assert!(run.touched());
        assert_eq!((run.stop_reason(), run.infeasible(), run.losses()), (None, 0, 0), "{resolution}");
        assert!(run.peak_normal() <= MOST, "{resolution}: peak {} N", run.peak_normal());
        let several = run.instants.iter().any(|at| at.command.plan_length > 1 && at.command.plan_end_ns[0] < 4_000_000);
        assert!(several, "inputs within the cycle");
        // Every reference of the plan, as the joints follow it, moves the tool by what was planned.
        for at in run.instants.iter().filter(|at| at.command.plan_length > 1) {
            let jacobian = experiment
                .scenario
                .robot
                .chain::<7>()
                .expect("seven")
                .kinematics(&joints(&at.state.joint_position))
                .jacobian;
            for offset in &at.command.planned_offset[..2] {
                let change = SVector::<f64, 6>::from_fn(|axis, _| offset[axis] - at.command.velocity_offset[axis]);
                let map = SMatrix::<f64, 7, 6>::from_fn(|joint, axis| at.command.joint_per_twist[joint][axis]);
                assert!((jacobian * map * change - change).norm() < 1e-9);
            }
            let told = joints(&at.state.joint_velocity_reference) + joints(&at.command.joint_velocity_offset);
            let wanted =
                SVector::<f64, 6>::from(at.state.twist_reference) + SVector::<f64, 6>::from(at.command.velocity_offset);
            assert!((jacobian * told - wanted).norm() < 1e-9, "{}", (jacobian * told - wanted).norm());
        }
    }
}

#[test]
fn a_stop_brings_what_the_joints_do_beside_the_task_to_rest() {
    let mut experiment =
        resolved(0.001, ResolutionName::Posture).with_motion(&[(0.4, &[0.0, 0.0, -1.2, 0.0, 0.0, 0.0]), (0.4, &DOWN)]);
    let away = null_space_of(&experiment, &START.into()) * SVector::<f64, 7>::from_element(1.0);
    let posture = SVector::from(START) + away * (1.0 / away.norm());
    experiment.config.redundancy.posture_rad = Some(posture.as_slice().to_vec());
    let run = experiment.run();
    tell(&run, "stop");
    assert!(run.stop_reason().is_some(), "1.2 m/s is too fast");
    let last = run.instants.last().expect("instants");
    assert_eq!(last.command.motion, 1, "held");
    assert!(joints(&last.truth.joint_velocity).norm() < 1e-3);
    assert!(last.truth.normal_force_n <= 75.0 + 0.5, "{} N", last.truth.normal_force_n);
}

#[test]
fn a_damped_inverse_costs_margin_near_a_singular_pose() {
    let margin = |factor: Option<f64>| {
        let mut experiment = resolved(0.001, ResolutionName::LeastNorm).with_motion(&[(0.4, &DOWN), (1.0, &SLIDE)]);
        let redundancy = &mut experiment.config.redundancy;
        (redundancy.damping_factor, redundancy.damping_below) = (factor, factor.map(|_| 0.2));
        let run = experiment.run();
        assert_eq!((run.stop_reason(), run.infeasible()), (None, 0), "{factor:?}");
        assert!(run.peak_normal() <= MOST, "{factor:?}: {} N", run.peak_normal());
        tell(&run, &format!("damping {factor:?}"));
        let at_end = run.instants.last().expect("instants");
        (at_end.command.verdict_margin, at_end.truth.tcp_position[1])
    };
    let (exact, all) = margin(None);
    let (damped, less) = margin(Some(0.2));
    println!("margin {exact:.1} N exactly, {damped:.1} N damped; the tool is {:.4} m behind", all - less);
    assert!(damped < exact - 1.0, "{damped} N, {exact} N");
    assert!(less < all, "a damped arm slides more slowly");
}

#[test]
fn a_motion_controller_that_does_not_follow_is_refused_and_told() {
    let mut experiment = resolved(0.001, ResolutionName::Keep).with_motion(&[(0.1, &DOWN)]);
    experiment.scenario.controller.follows = FollowsName::Twist;
    let run = experiment.run();
    let last = run.instants.last().expect("instants");
    let fault = last.report.fault.expect("no sample reaches the law");
    assert_eq!(Fault::code_of(Some(fault.name())), Fault::NotFollowing.code());
    assert!(fault.to_string().contains("follows_joint_velocity = 0"), "{fault}");
    // The daemon never takes the arm: it stays idle, and nothing is added.
    assert_eq!((last.command.mode, last.command.velocity_offset), (Mode::Idle.code(), [0.0; 6]));
}

/// What J⁻¹ turns by within the null space moves the tool of a lifting column with an arm on it, whose joints lag by 10 to 30 ms: at
/// 0.1 m/s the force was 0.3 N below what was asked for, and grew on.
#[test]
fn an_arm_whose_joints_lag_differently_presses_with_what_is_asked_for() {
    let mut experiment = Experiment::new(
        include_str!("../../../deploy/robots/eight-joint.toml"),
        include_str!("../../../plant-sim/scenarios/eight-joint.toml"),
        0.001,
    )
    .with_motion(&[(0.4, &DOWN), (2.0, &[0.1, 0.0, -0.05, 0.0, 0.0, 0.0])]);
    experiment.config.contact.normal_force_reference_n = 20.0;
    let run = experiment.run();
    println!("settled {:.3} N", run.settled_normal());
    assert_eq!((run.stop_reason(), run.losses()), (None, 0));
    assert!((run.settled_normal() - 20.0).abs() < 0.1, "{} N", run.settled_normal());
}
