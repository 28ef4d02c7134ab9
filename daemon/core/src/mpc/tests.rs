//! The prediction, tests of this stage alone: a problem in, a solution out.

use nalgebra::Vector2;

use super::condensation::Capacity;
use super::contact::excess;
use super::qp::ActiveSet;
use super::{Demand, Mpc, Situation, Solution, Verdict};
use crate::belief::{Belief, JointMotion};
use crate::common::{active_set, normal, parameters, pressing, pushing};
use crate::intake::{Accepted, Event, Intake, Sample};
use crate::output::{Output, Plan};
use crate::parameters::Parameters;
use crate::quantities::Span;
use crate::redundancy::NullMotion;

type Planar = Mpc<2, 2, ActiveSet<Vec<f64>>, Vec<f64>>;

fn mpc() -> Planar {
    mpc_of(&parameters())
}

fn mpc_of(parameters: &Parameters<2, 2>) -> Planar {
    let storage = vec![0.0; Capacity::new::<2, 2>(parameters.mpc.horizon, 1).storage_len()];
    Mpc::new(parameters.mpc(), active_set(), storage).expect("storage of that length")
}

fn accepted(sample: &Sample<2, 2>) -> Accepted<2, 2> {
    let mut intake = Intake::new(parameters().intake());
    *intake.take(Event::Sample(sample), sample.stamp).expect("a good sample")
}

/// Both axes in contact, f_min from the start.
fn demand() -> Demand<2> {
    Demand {
        active: [true; 2],
        signs: [-1.0; 2],
        minimum: [0.1; 2],
        kept: [0.1; 2],
        inward_speed: f64::INFINITY,
        settles: false,
    }
}

/// What `solve` says of a contact that presses with `force` N while ṗ0 moves inward at `speed` m/s.
fn solved<R>(mpc: &mut Planar, force: f64, speed: f64, solve: impl Fn(&mut Planar, &Situation<'_, 2, 2>) -> R) -> R {
    solved_at(mpc, &pushing(force, speed, 1), solve)
}

fn solved_at<R>(mpc: &mut Planar, sample: &Sample<2, 2>, solve: impl Fn(&mut Planar, &Situation<'_, 2, 2>) -> R) -> R {
    let sample = accepted(sample);
    let mut belief = Belief::new(parameters().belief());
    belief.follow(&sample, &sample.joint_velocity, None, &belief.felt(&sample), false);
    let output = Output::new(parameters().output());
    let joints = JointMotion { velocity: sample.joint_velocity, acceleration: Vector2::zeros() };
    let beside = NullMotion::new(parameters().null_motion());
    let situation = Situation::new(&sample, &belief, &output, joints, &beside).expect("far from singular");
    solve(mpc, &situation)
}

fn press(mpc: &mut Planar, force: f64, speed: f64) -> Solution<Plan<2>> {
    solved(mpc, force, speed, |mpc, situation| match mpc.press(situation, &demand(), &mut || false) {
        Solution::Planned { plan, verdict, iterations } => Solution::Planned { plan: *plan, verdict, iterations },
        Solution::Infeasible { verdict, iterations } => Solution::Infeasible { verdict, iterations },
        Solution::Expired { iterations } => Solution::Expired { iterations },
        Solution::Failed { iterations } => Solution::Failed { iterations },
    })
}

#[test]
fn a_contact_has_a_plan_of_the_horizon_s_length_that_slows_the_approach() {
    let Solution::Planned { plan, .. } = press(&mut mpc(), 60.0, 0.05) else { panic!("feasible") };
    assert_eq!(plan.steps().len(), parameters().mpc.horizon);
    assert!(plan.is_prediction());
    let first: Vector2<f64> = *plan.steps().next().expect("a step").0;
    assert!(normal().dot(&first) > 0.0, "out of the surface, against the reference: {first}");
}

/// 1.4 times what the slowest joint, the longest dead time, the delay of commands, a cycle and the lag that is allowed for
/// add up to.
#[test]
fn the_force_settles_with_all_that_lags() {
    let mut settings = parameters().mpc();
    (settings.loops.time_constant, settings.loops.dead_time) = (Vector2::new(0.03, 0.02), Vector2::new(0.001, 0.003));
    settings.timing.command_delay = Span::from_seconds(0.002);
    settings.timing.sampling_time = Span::from_seconds(0.004);
    settings.options.lag_tolerance = 0.005;
    let expected = 1.4 * (0.03 + 0.003 + 0.002 + 0.004 + 0.005);
    assert!((settings.settling_time() - expected).abs() < 1e-12, "{} s", settings.settling_time());
}

/// On the way out by what the joints cover yet, on the way in by a tenth of it; by nothing for a slide, whichever way that goes.
#[test]
fn what_joints_cover_by_themselves_is_no_excess() {
    for damping in [0.0, 1.0] {
        let mut parameters = parameters();
        parameters.loops.damping.fill(damping);
        let [by_velocity, ..] = parameters.loops.until_rest();
        let slide = Vector2::new(0.3, -0.2);
        for (outward, part) in [(0.0, 0.0), (0.02, 1.0), (-0.02, 0.1)] {
            let mut sample = pressing(60.0, 1);
            let inverse = parameters.chain.kinematics(&sample.joint_position).inverse::<2>(0.0).expect("regular");
            sample.joint_velocity = slide + inverse.matrix * (normal() * outward);
            let (is, expected) = solved_at(&mut mpc_of(&parameters), &sample, |mpc, situation| {
                let surface = situation.belief.surface();
                let covered = surface.normal_stiffness() * outward * by_velocity.max() * part;
                let expected = surface.spring_force(situation.sample.posture.pose()) - covered - 20.0;
                (excess(&mpc.settings, situation, 20.0, situation.outward_speed(&slide)), expected)
            });
            assert!((is - expected).abs() < 1e-6, "{outward} m/s, damping {damping}: {is} N, not {expected}");
        }
    }
}

/// A tool that leaves fast is deepest before any input acts: a margin counts that as well.
#[test]
fn what_presses_before_the_inputs_act_is_in_the_margin() {
    let mut parameters = parameters();
    (parameters.timing.command_delay, parameters.mpc.models_delay) = (Span::from_seconds(0.004), true);
    let speed = 0.1;
    let mut sample = pressing(150.0, 1);
    sample.joint_velocity = parameters
        .chain
        .kinematics(&sample.joint_position)
        .inverse::<2>(1e-4)
        .expect("far from singular")
        .joint_velocity(&(normal() * speed));
    solved_at(&mut mpc_of(&parameters), &sample, |mpc, situation| {
        let verdict = mpc.press(situation, &demand(), &mut || false).verdict();
        let Verdict::Feasible { margin, axis, time } = verdict else { panic!("{verdict:?}") };
        let now = parameters.mpc.force_limit[axis] - situation.spring_force(axis, -1.0);
        // The force is looked at eight times until then.
        let (delay, stiffness) = (parameters.timing.command_delay.seconds(), parameters.surface.normal_stiffness());
        let most = stiffness * speed * delay / 8.0 * normal()[axis];
        assert!(0.0 < time && time < delay, "{time} s");
        assert!(now < margin && margin < now + most, "{margin} N, with {now} N left at the sample");
    });
}

#[test]
fn the_same_problem_has_the_same_solution_warm_or_cold() {
    let mut warm = mpc();
    let cold = press(&mut mpc(), 60.0, 0.05);
    let _ = press(&mut warm, 60.0, 0.05);
    let again = press(&mut warm, 60.0, 0.05);
    let (Solution::Planned { plan: a, .. }, Solution::Planned { plan: b, .. }) = (cold, again) else {
        panic!("feasible: {cold:?}, {again:?}")
    };
    for (cold, warm) in a.steps().zip(b.steps()) {
        assert!((cold.0 - warm.0).amax() < 1e-9 && cold.1 == warm.1, "{cold:?}, {warm:?}");
    }
    assert!(again.iterations() <= cold.iterations());
}

#[test]
fn without_time_there_is_no_answer_and_the_next_one_is_not_worse_for_it() {
    let mut mpc = mpc();
    let expired = solved(&mut mpc, 60.0, 0.05, |mpc, situation| {
        mpc.press(situation, &demand(), &mut || true).expired_iteration()
    });
    assert_eq!(expired, Some(0));
    assert!(matches!(press(&mut mpc, 60.0, 0.05), Solution::Planned { .. }));
}

#[test]
fn a_stop_leads_out_of_the_surface_and_rests_where_the_force_is_low() {
    let mut mpc = mpc();
    let outward = solved(&mut mpc, 190.0, 0.05, |mpc, situation| {
        assert!(!mpc.may_rest(situation), "190 N");
        match mpc.stop(situation, &mut || false) {
            Solution::Planned { plan, .. } => {
                plan.steps().next().map(|(offset, _)| normal().dot(&(offset + situation.sample.twist_reference)))
            }
            solution => panic!("{solution:?}"),
        }
    });
    assert!(outward.is_some_and(|speed| speed > 0.0), "{outward:?} m/s");
    assert!(solved(&mut mpc, 50.0, 0.05, |mpc, situation| mpc.may_rest(situation)), "50 N, at rest");
}

/// ṗ0 along the surface asks for more than the joints may turn, and the offset cannot help it.
#[test]
fn a_reference_that_is_too_fast_for_the_joints_is_answered_with_what_it_asks_itself() {
    let (speed, limit) = (0.5, 0.1);
    let mut parameters = parameters();
    parameters.limits.offset.fill(0.02);
    parameters.limits.joint_speed = Some(Vector2::repeat(limit));
    let along = Vector2::new(normal().y, -normal().x) * speed;
    let sample = Sample { twist_reference: along, ..pressing(60.0, 1) };
    for rate in [None, Some(Vector2::repeat(1.0))] {
        (parameters.limits.inward_rate, parameters.limits.outward_rate) = (rate, rate);
        let check = |plan: &Plan<2>, situation: &Situation<'_, 2, 2>| {
            let alone = situation.joint_velocity(&along).amax();
            assert!(alone > 2.0 * limit, "{alone} rad/s");
            for (offset, _) in plan.steps() {
                let fastest = situation.joint_velocity(&(along + offset)).amax();
                assert!(offset.amax() <= 0.02 + 1e-9 && fastest <= alone * 1.01, "{offset}: {fastest} rad/s");
            }
        };
        let mut mpc = mpc_of(&parameters);
        // Unequal lags lift the arm off at once: no lower bound.
        let demand = Demand { minimum: [f64::NEG_INFINITY; 2], kept: [f64::NEG_INFINITY; 2], ..demand() };
        solved_at(&mut mpc, &sample, |mpc, situation| match mpc.press(situation, &demand, &mut || false) {
            Solution::Planned { plan, verdict: Verdict::Feasible { .. }, .. } => check(plan, situation),
            solution => panic!("{solution:?}"),
        });
        solved_at(&mut mpc, &sample, |mpc, situation| match mpc.stop(situation, &mut || false) {
            Solution::Planned { plan, .. } => check(plan, situation),
            solution => panic!("{solution:?}"),
        });
    }
}

/// ṗ along the surface, m/s.
const SLIDE: f64 = 0.6;

/// The references of a slide lead the joints by T q̈. Here q̈ is that of joints on the straight line, by differences.
#[test]
fn joints_that_slide_stay_behind_by_their_lag_times_their_acceleration() {
    let mut parameters = parameters();
    parameters.timing.command_delay = Span::from_seconds(0.000_5);
    let (chain, timing, lag) = (parameters.chain, parameters.timing, parameters.loops.until_rest()[0]);
    let mut mpc = mpc_of(&parameters);
    let (settings, along) = (mpc.settings, Vector2::new(normal().y, -normal().x) * SLIDE);
    solved(&mut mpc, 60.0, 0.0, |_, situation| {
        let q = situation.sample.joint_position;
        let velocity = |q: &Vector2<f64>| {
            chain.kinematics(q).inverse::<2>(1e-4).expect("far from singular").joint_velocity(&along)
        };
        let (h, q_dot) = (1e-5, velocity(&q));
        let acceleration = (velocity(&(q + q_dot * h)) - velocity(&(q - q_dot * h))) / (2.0 * h);
        let held = timing.command_delay.seconds() + 0.5 * settings.options.steps()[0];
        let expected = acceleration.component_mul(&lag.add_scalar(held));
        let behind = situation.behind(&settings, &situation.joint_velocity(&along));
        assert!(behind.amax() > 1e-3 && (behind - expected).amax() < 1e-7, "{behind} in place of {expected} rad/s");
    });
}

/// Joints that coast far turn J on the way: to second order the force is that of the tool's true place, within what
/// the third leaves.
#[test]
fn what_presses_after_a_long_way_is_what_the_tool_s_place_says() {
    let parameters = parameters();
    let (chain, surface) = (parameters.chain, parameters.surface);
    solved(&mut mpc(), 60.0, 0.0, |_, situation| {
        let force = |q: &Vector2<f64>| surface.spring_force(&chain.kinematics(q).pose);
        let q = situation.sample.joint_position;
        let depth = |force: f64| force / surface.normal_stiffness();
        for way in [Vector2::new(0.1, -0.2), Vector2::new(-0.2, 0.1), Vector2::new(0.05, 0.15)] {
            let by_model = super::stop::pressing_at(situation, &(q + way));
            let [missed, first_order] = [by_model, -normal().dot(&situation.model.linear_wrench(&(q + way)))]
                .map(|said| depth(said - force(&(q + way))).abs());
            assert!(
                missed < 2.0 * way.norm().powi(3) && missed < 0.3 * first_order,
                "{way}: {missed}, {first_order} m"
            );
        }
    });
}
