//! The problem of a minimum-force stop: minimise the largest violation of the upper force bound,
//! then come to rest at a low force.
//!
//! Its inputs are the absolute twist, not the offset, so that pushing on with ṗ0 is not free; there
//! is no lower bound, and every admittance axis has an input.

use nalgebra::SVector;

use super::condensation::{InputAxes, Prediction, Slack};
use super::constraints::{AxisBound, ForceBounds, Softened};
use super::cost::{SetPoint, Weights};
use super::drive_way::DriveWay;
use super::every_surface::most_more;
use super::model::{Discretization, State};
use super::qp::QpSolver;
use super::step::position_by;
use super::{Mpc, Settings, Situation, Solution};
use crate::output::{MAX_STEPS, Plan};
use crate::robot::VelocityLoops;
use crate::surface::{STANDSTILL, Surface};

/// The violation is minimised before all else: its price is far above the sum of multipliers, which
/// the cost of a twist of 1 m/s bounds. The curvature only makes the QP strictly convex.
const LEAST: Slack = Slack { softened: Softened::Maximum, price: 1e3, curvature: 0.1 };
/// R of the stop, relative to its velocity weight: only enough to make the QP strictly convex.
const INPUT_WEIGHT: f64 = 1e-2;
/// Part of the speed at which the excess would be gone within the horizon, below which a stop is stuck.
const STUCK: f64 = 0.5;
/// Part of the force of a stop that was stuck, by which it may rise on the way out.
const ROOM_TO_LEAVE: f64 = 0.05;
/// Weight of its speed on the way out, relative to that of a stop that moves: the room is what slows it down.
const SPEED_WEIGHT_TO_LEAVE: f64 = 1e-2;
/// Ticks for which a ramp to standstill is followed.
const RAMP_TICKS: usize = 256;

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Mpc<N, D, S, B> {
    /// Solves the stop. Its plan holds offsets to ṗ0, as every plan does. `expired` is called
    /// before and between solver iterations.
    pub(crate) fn stop(
        &mut self,
        situation: &Situation<'_, N, D>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Solution<&Plan<D>> {
        let settings = self.settings;
        let steps = settings.options.steps();
        let surface = situation.belief.surface();
        let start = situation.at_action(&settings, &ForceBounds::none(), &SVector::zeros());
        let twist_reference = &situation.sample.twist_reference;
        let excess = Excess::of(&settings, situation, &start.state);
        if excess.largest() <= 0.0 {
            self.stuck_at = None;
        }
        let weights_to_leave = weights(surface, steps, SPEED_WEIGHT_TO_LEAVE);
        let weights = if self.stuck_at.is_some() { weights_to_leave } else { weights(surface, steps, 1.0) };
        let force_bounds = excess.bounds(self.stuck_at.as_ref());
        let mut constraints = settings.constraints(force_bounds, twist_reference, situation, &start.state);
        // Standstill, or as close to it as the limits of the offset allow.
        let reach = &settings.limits.offset;
        let target = twist_reference + twist_reference.zip_map(reach, |twist, reach| (-twist).clamp(-reach, reach));
        let before = twist_reference + situation.output.offset();
        let on_inputs = |twist: &SVector<f64, D>| {
            SVector::from_fn(|axis, _| if settings.admittance[axis] { twist[axis] } else { 0.0 })
        };
        let way = (&on_inputs(&before), &on_inputs(&target));
        // Axes without an input stand still, as soon as the drives allow.
        let (mut known_twist, mut known_reference) = ([SVector::zeros(); MAX_STEPS], [SVector::zeros(); MAX_STEPS]);
        let mut drive_way = None;
        if let Some(driven) = situation.driven(true) {
            let led = drive_way.insert(DriveWay::new(driven));
            led.lead(situation, steps, |_| on_inputs(&target));
            for ((twist, reference), led) in known_twist.iter_mut().zip(&mut known_reference).zip(&led.twists) {
                *twist = led - on_inputs(led);
                *reference = situation.joint_velocity(twist);
            }
        }
        situation.add_beside(steps, &mut known_reference[..steps.len()]);
        let (known_twist, known_reference) = (&known_twist[..steps.len()], &known_reference[..steps.len()]);
        constraints.bound_inward_speed(0.0, &surface.normal, known_twist, way, steps);
        let drives = drive_way.map(|way| {
            constraints.keep_drives(&way, situation, steps, (known_twist, known_reference), &SVector::zeros())
        });
        constraints.drives = drives.as_ref();
        let prediction = Prediction {
            initial: start.state,
            known_reference,
            drift: SVector::zeros(),
            inputs: InputAxes::from_mask(&settings.admittance),
            previous_input: before,
            wrench_axes: InputAxes::from_mask(&settings.admittance),
            constraints,
            // Standstill without force.
            set_point: SetPoint {
                joint_position: start.state.joint_position,
                joint_velocity: SVector::zeros(),
                wrench: SVector::zeros(),
                input: SVector::zeros(),
                fading_velocity: SVector::zeros(),
                fading_input: SVector::zeros(),
            },
            weights: &weights,
            jacobian: *situation.sample.posture.jacobian(),
            input_weight: SVector::repeat(INPUT_WEIGHT),
            slack: Some(LEAST),
        };
        let mut solution = self.solve(situation, &prediction, known_twist, expired);
        let is_solved = matches!(solution, Solution::Planned { .. });
        if is_solved && self.stuck_at.is_none() && self.is_stuck(situation, &start.state, &excess) {
            self.stuck_at = Some(excess.force);
            let mut leaving = prediction;
            leaving.constraints.force = excess.bounds(self.stuck_at.as_ref());
            leaving.weights = &weights_to_leave;
            let before = solution.iterations();
            // Without an answer the plan that stands is still one.
            solution = match self.solve(situation, &leaving, known_twist, expired) {
                Solution::Failed { iterations } | Solution::Infeasible { iterations, .. } => solution.after(iterations),
                second => second.after(before),
            };
        }
        solution.shifted(start.delay).with(&self.plan)
    }

    /// Whether the arm stands above the limit, and would go on to by this plan. Joints with unequal lags that start to
    /// move out first press a little harder: that would be a larger violation than the present one, which nothing
    /// outweighs, and so the arm would stand there for ever.
    fn is_stuck(&self, situation: &Situation<'_, N, D>, state: &State<N, D>, excess: &Excess<D>) -> bool {
        let surface = situation.belief.surface();
        let enough = STUCK * excess.speed(surface, self.settings.options.steps().iter().sum());
        let moves = situation.outward_speed(&state.joint_velocity);
        let planned = self.plan.steps().next();
        let planned = planned.map(|(offset, _)| surface.outward_speed(&(situation.sample.twist_reference + offset)));
        enough > 0.0 && (-STANDSTILL..enough).contains(&moves) && planned.is_some_and(|speed| speed < enough)
    }

    /// Whether the arm may be held: it moves outward or not at all, the measured force is at most
    /// `stop_force`, and the spring's would not exceed that while the arm coasts to standstill, whatever
    /// surface may be there.
    /// (Held at zero normal velocity alone, unequal joint lags would drive it back in.)
    pub(crate) fn may_rest(&self, situation: &Situation<'_, N, D>) -> bool {
        let (sample, surface) = (situation.sample, situation.belief.surface());
        let state = situation.at_action(&self.settings, &ForceBounds::none(), &SVector::zeros()).state;
        let outward_speed = situation.outward_speed(&state.joint_velocity);
        // f̂ lags behind: by it alone a stop would rest while the force still rises.
        let measured = surface.pressing_force(&sample.wrench).max(situation.belief.pressing_without_lag());
        let limit = self.settings.stop_force;
        if outward_speed < -STANDSTILL || measured > limit {
            return false;
        }
        let (ramping, state) = self.while_ramping(situation, state);
        let (coasting, rest) = peak_while_coasting(situation, &self.settings.loops, &state);
        let coasting = ramping.max(coasting);
        // Where the surface is not known: what presses now is measured, and what comes to it the hardest one says.
        let more = situation.belief.set().map_or(0.0, |set| {
            let (_, along) = surface.parts(&(sample.posture.jacobian() * (rest - sample.joint_position)));
            most_more(set, situation, coasting, along.norm())
        });
        measured + more <= limit && coasting <= limit
    }
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Mpc<N, D, S, B> {
    /// The largest pressing force in N while the references go to zero as fast as the drives allow, and the
    /// state when they are there.
    fn while_ramping(&self, situation: &Situation<'_, N, D>, mut state: State<N, D>) -> (f64, State<N, D>) {
        let (settings, mut peak) = (&self.settings, f64::NEG_INFINITY);
        let Some(mut driven) = situation.driven(true) else { return (peak, state) };
        let tick = settings.tick();
        let step = Discretization::Zoh.step(tick, &settings.loops, &SVector::zeros());
        for ticks in 0..RAMP_TICKS {
            let mut reference = driven.advance(tick, &SVector::zeros());
            if let Some(beside) = situation.beside.fading(tick * ticks as f64) {
                reference += beside;
            }
            if reference.iter().all(|speed| *speed == 0.0) {
                break;
            }
            state = situation.model.advance(&step, &state, &reference);
            peak = peak.max(pressing_at(situation, &state.joint_position));
        }
        (peak, state)
    }
}

/// What a stop has to bring down.
struct Excess<const D: usize> {
    /// s of each bounded axis, from the surface normal as it is believed to be; 0 of the others.
    signs: [f64; D],
    /// f_max in N.
    limit: SVector<f64, D>,
    /// s·f_lin at the instant of action in N.
    force: SVector<f64, D>,
}

impl<const D: usize> Excess<D> {
    fn of<const N: usize>(settings: &Settings<N, D>, situation: &Situation<'_, N, D>, state: &State<N, D>) -> Self {
        let (signs, wrench) = (situation.belief.normal_signs(), situation.model.linear_wrench(&state.joint_position));
        let mut of_axis = [0.0; D];
        for axis in signs.axes(&settings.admittance) {
            of_axis[axis] = signs.sign(axis).unwrap_or(0.0);
        }
        let force = SVector::from_fn(|axis, _| of_axis[axis] * wrench[axis]);
        Self { signs: of_axis, limit: settings.options.force_limit, force }
    }

    /// Bounded axes.
    fn axes(&self) -> impl Iterator<Item = usize> + '_ {
        (0..D).filter(|axis| self.signs[*axis] != 0.0)
    }

    /// s·f_lin − f_max of an axis, N.
    fn on(&self, axis: usize) -> f64 {
        self.force[axis] - self.limit[axis]
    }

    /// The largest of them, N.
    fn largest(&self) -> f64 {
        self.axes().map(|axis| self.on(axis)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// f_max only; where a stop was stuck at a force, a little more than that.
    fn bounds(&self, stuck_at: Option<&SVector<f64, D>>) -> ForceBounds<D> {
        let mut bounds = ForceBounds::none();
        for axis in self.axes() {
            let leaves = stuck_at.map_or(0.0, |force| (1.0 + ROOM_TO_LEAVE) * force[axis]);
            let (minimum, maximum) = (f64::NEG_INFINITY, self.limit[axis].max(leaves));
            bounds.push(AxisBound { axis, sign: self.signs[axis], minimum, maximum });
        }
        bounds
    }

    /// Speed out of the surface in m/s at which all of it would be gone after `duration` s; 0 where there is none.
    fn speed(&self, surface: &Surface<D>, duration: f64) -> f64 {
        let by_depth = surface.stiffness * surface.normal;
        let speeds = self.axes().map(|axis| self.on(axis) / (by_depth[axis].abs() * duration));
        speeds.filter(|speed| speed.is_finite()).fold(0.0, f64::max)
    }
}

/// Q of a stop: velocity against force so that the force fades within the horizon, v = f / (k ·
/// horizon).
fn weights<const N: usize, const D: usize>(surface: &Surface<D>, steps: &[f64], velocity: f64) -> Weights<N, D> {
    let stiffness = surface.stiffness.norm();
    let duration: f64 = steps.iter().sum();
    let wrench = 1.0 / (stiffness * duration * stiffness * duration);
    Weights::Task {
        position: SVector::zeros(),
        velocity: SVector::repeat(velocity),
        wrench: SVector::repeat(if wrench.is_finite() { wrench } else { 0.0 }),
    }
}

/// The force in N along the normal that the surface presses with at q: joints that turn fast go on far, and J turns with
/// them, so that their way counts to second order: Ψ(q₀ + δ) = Ψ(q₀) + J δ + ½ J̇(δ) δ.
pub(super) fn pressing_at<const N: usize, const D: usize>(situation: &Situation<'_, N, D>, q: &SVector<f64, N>) -> f64 {
    let (surface, sample) = (situation.belief.surface(), situation.sample);
    let inward = -surface.normal;
    let way = q - sample.joint_position;
    let turned = 0.5 * inward.dot(&sample.posture.acceleration_at_constant_joint_velocity(&way));
    inward.dot(&situation.model.linear_wrench(q)) + surface.normal_stiffness() * turned
}

/// Largest pressing force in N while the arm coasts from `x` under zero joint velocity reference, seen at 32
/// instants until its slowest joint has done 99 %, and q at the last of them.
fn peak_while_coasting<const N: usize, const D: usize>(
    situation: &Situation<'_, N, D>,
    loops: &VelocityLoops<N>,
    x: &State<N, D>,
) -> (f64, SVector<f64, N>) {
    const INSTANTS: u32 = 32;
    let end = 5.0 * loops.slowest() + loops.further_dead_time().max();
    let carried = x.carried();
    let (mut peak, mut q) = (f64::NEG_INFINITY, x.joint_position);
    for instant in 0..=INSTANTS {
        let by = position_by(end * f64::from(instant) / f64::from(INSTANTS), loops);
        q = by.iter().zip(&carried).fold(x.joint_position, |q, (by, carried)| q + by.component_mul(carried));
        peak = peak.max(pressing_at(situation, &q));
    }
    (peak, q)
}
