//! From a prediction to its solution: condense, solve, check.

use nalgebra::SVector;

use super::condensation::{MpcRows, Prediction, condense};
use super::constraints::{Constraints, ForceBounds};
use super::drive_way::DriveWay;
use super::model::{CARRIED, State};
use super::qp::{QpOutcome, QpSolver, kkt_residual};
use super::verdict::{Contradiction, checked_contradiction, margin_of};
use super::{Mpc, Settings, Situation, Solution};
use crate::quantities::Span;
use crate::robot::Interval;

/// The limits of joints and inputs contradict one another, whatever the force.
struct LimitsContradict {
    /// Iterations of the solver.
    iterations: u32,
}

/// Part of the straight way to standstill that a plan may be longer, for rounding.
const ROOM: f64 = 1e-3;

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Mpc<N, D, S, B> {
    /// Solves a prediction whose inputs act on top of `known_twist` in each step, and leaves them
    /// in the plan; once more where ṗ0 is [too fast](super::too_fast) for the joints.
    pub(super) fn solve(
        &mut self,
        situation: &Situation<'_, N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Solution<()> {
        let before = match self.solve_as_limited(situation, prediction, known_twist, expired) {
            Ok(solution) => return solution,
            Err(LimitsContradict { iterations }) => iterations,
        };
        let mut relieved = *prediction;
        if !relieved.let_joints_follow(&situation.model.jacobian_inverse) {
            return Solution::Failed { iterations: before };
        }
        match self.solve_as_limited(situation, &relieved, known_twist, expired) {
            Ok(solution) => solution.after(before),
            Err(LimitsContradict { iterations }) => Solution::Failed { iterations: before + iterations },
        }
    }

    fn solve_as_limited(
        &mut self,
        situation: &Situation<'_, N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Result<Solution<()>, LimitsContradict> {
        if self.horizon.carried() == 1 {
            self.solve_for::<1>(situation, prediction, known_twist, expired)
        } else {
            self.solve_for::<CARRIED>(situation, prediction, known_twist, expired)
        }
    }

    fn solve_for<const C: usize>(
        &mut self,
        situation: &Situation<'_, N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Result<Solution<()>, LimitsContradict> {
        // From here on the number of inputs is a constant: loops over them are unrolled. Numbers
        // above D or N are left out: no arm has more inputs than joints (`Parameters::check`).
        match prediction.inputs.as_slice().len() {
            1 => self.solve_with::<1, C>(situation, prediction, known_twist, expired),
            2 if const { D >= 2 && N >= 2 } => self.solve_with::<2, C>(situation, prediction, known_twist, expired),
            3 if const { D >= 3 && N >= 3 } => self.solve_with::<3, C>(situation, prediction, known_twist, expired),
            4 if const { D >= 4 && N >= 4 } => self.solve_with::<4, C>(situation, prediction, known_twist, expired),
            5 if const { D >= 5 && N >= 5 } => self.solve_with::<5, C>(situation, prediction, known_twist, expired),
            6 if const { D >= 6 && N >= 6 } => self.solve_with::<6, C>(situation, prediction, known_twist, expired),
            _ => Ok(Solution::Failed { iterations: 0 }),
        }
    }

    fn solve_with<const M: usize, const C: usize>(
        &mut self,
        situation: &Situation<'_, N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Result<Solution<()>, LimitsContradict> {
        if expired() {
            return Ok(Solution::Expired { iterations: 0 });
        }
        let stamp = situation.sample.stamp;
        let rows = MpcRows::<N, D, M, C>::new(&situation.model, &self.horizon, prediction);
        let Some(rows) = rows else { return Ok(Solution::Failed { iterations: 0 }) };
        let Some(mut pieces) = self.workspace.pieces(&rows) else { return Ok(Solution::Failed { iterations: 0 }) };
        condense(&rows, &mut pieces);
        self.warm_start.guess(&rows.layout, &self.horizon, stamp, pieces.answer.working);
        let (qp, mut answer, scratch) = pieces.split(&rows);
        let outcome = self.solver.solve(&qp, &mut answer, expired);
        let iterations = outcome.iterations();
        let verdict = match outcome {
            QpOutcome::Solved { .. } => {
                let residual = kkt_residual(&qp, answer.z, answer.multipliers, scratch);
                if !residual.is_within(self.settings.options.solution_tolerance) {
                    return Ok(Solution::Failed { iterations });
                }
                margin_of(&rows, &qp, answer.z, &scratch[2 * qp.stride..])
            }
            QpOutcome::Infeasible { .. } => {
                let reach = self.settings.limits.offset.max();
                return match checked_contradiction(&rows, &qp, answer.multipliers, reach, scratch) {
                    Some(Contradiction::OfForces(verdict)) => Ok(Solution::Infeasible { verdict, iterations }),
                    Some(Contradiction::OfLimits) => Err(LimitsContradict { iterations }),
                    None => Ok(Solution::Failed { iterations }),
                };
            }
            QpOutcome::Expired { .. } => {
                // The next cycle continues from here: from nothing it would take just as long
                // again.
                self.warm_start.learn(&rows.layout, &self.horizon, stamp, answer.working);
                return Ok(Solution::Expired { iterations });
            }
            QpOutcome::Failed { .. } => return Ok(Solution::Failed { iterations }),
        };
        self.warm_start.learn(&rows.layout, &self.horizon, stamp, answer.working);
        // Every step's twist, as an offset to the ṗ0 of this sample.
        self.plan.become_prediction(stamp);
        for (step, known) in known_twist.iter().enumerate() {
            let mut twist = *known;
            for (&axis, value) in prediction.inputs.as_slice().iter().zip(&answer.z[rows.inputs_of(step)]) {
                twist[axis] += value;
            }
            let duration = Span::from_seconds(self.horizon.steps()[step].duration);
            self.plan.push(twist - situation.sample.twist_reference, duration);
        }
        Ok(Solution::Planned { plan: (), verdict, iterations })
    }
}

impl<const N: usize, const D: usize> Settings<N, D> {
    /// [`super::Options::tick`] in s.
    pub(super) fn tick(&self) -> f64 {
        self.options.tick(self.timing.sampling_time).seconds()
    }

    /// Bounds of the force, and the limits of joints and of the inputs, which are offsets to ṗ0
    /// minus `twist_reference`, from the state in which the inputs begin to act.
    pub(super) fn constraints(
        &self,
        force: ForceBounds<D>,
        twist_reference: &SVector<f64, D>,
        situation: &Situation<'_, N, D>,
        start: &State<N, D>,
    ) -> Constraints<'static, N, D> {
        let limits = &self.limits;
        let signs = situation.belief.normal_signs();
        let rate = (limits.inward_rate.is_some() || limits.outward_rate.is_some()).then(|| {
            let along = |axis: usize, direction: f64| {
                // Without a sign no direction points outward.
                let sign = signs.sign(axis);
                let is_outward = sign.is_some_and(|sign| sign * direction < 0.0);
                let rate = if is_outward { &limits.outward_rate } else { &limits.inward_rate };
                rate.as_ref().map_or(f64::INFINITY, |rate| rate[axis])
            };
            Interval {
                lower: SVector::from_fn(|axis, _| -along(axis, -1.0)),
                upper: SVector::from_fn(|axis, _| along(axis, 1.0)),
            }
        });
        Constraints {
            force,
            joint_speed: limits.joint_speed.map(|speed| Interval { lower: -speed, upper: speed }),
            drives: None,
            rest_position: limits.joint_position.as_ref().map(|limits| self.reachable(limits, situation, start)),
            offset: Some(Interval { lower: twist_reference - limits.offset, upper: twist_reference + limits.offset }),
            rate,
            normal_speed: None,
        }
    }

    /// Position limits; where a joint cannot help coming to rest beyond one, the place where it
    /// does: zero reference keeps it there, and where the rate of the offset is limited the
    /// straight way to zero.
    fn reachable(&self, limits: &Interval<N>, situation: &Situation<'_, N, D>, start: &State<N, D>) -> Interval<N> {
        let carried = start.carried();
        let until_rest = self.loops.until_rest();
        let rest =
            until_rest.iter().zip(&carried).fold(start.joint_position, |rest, (by, c)| rest + by.component_mul(c));
        let before = situation.sample.twist_reference + situation.output.offset();
        let rates = [&self.limits.inward_rate, &self.limits.outward_rate];
        let longest = |axis: usize| {
            let slowest = rates.iter().filter_map(|rate| Some(rate.as_ref()?[axis])).fold(f64::INFINITY, f64::min);
            before[axis].abs() / slowest
        };
        let braking = (0..D).map(longest).fold(0.0, f64::max);
        // Only as far as the horizon sees: a bound at the end of the way would let the arm brake
        // later, again and again.
        let steps = self.options.steps();
        let (mut left, mut way) = (1.0, 0.0);
        for (step, length) in steps.iter().enumerate() {
            left = f64::max(0.0, left - steps[step.saturating_sub(1)] / braking);
            way += left * length;
        }
        let moved = situation.joint_velocity(&before) * (way * (1.0 + ROOM));
        // No input stops what the joints do beside the task.
        let beside = situation.beside.told().map(|beside| beside * (steps.iter().sum::<f64>() * (1.0 + ROOM)));
        let with_beside = |ends: [SVector<f64, N>; 2]| beside.map_or(ends, |beside| ends.map(|end| end + beside));
        let Some(driven) = situation.driven(false) else {
            let reachable = Interval {
                lower: limits.lower.inf(&rest).inf(&(rest + moved)),
                upper: limits.upper.sup(&rest).sup(&(rest + moved)),
            };
            if beside.is_none() {
                return reachable;
            }
            let [first, last] = with_beside([rest.inf(&(rest + moved)), rest.sup(&(rest + moved))]);
            return Interval { lower: reachable.lower.inf(&first), upper: reachable.upper.sup(&last) };
        };
        // It goes on braking beyond the horizon: so much is left free before the limit.
        let free = driven.braking_way();
        let mut braking = DriveWay::new(driven);
        braking.lead(situation, steps, |_| SVector::zeros());
        let moved = braking.length(steps) * (1.0 + ROOM);
        let [first, last] = with_beside([rest.inf(&(rest + moved)), rest.sup(&(rest + moved))]);
        Interval {
            lower: (limits.lower + free).inf(&rest).inf(&first),
            upper: (limits.upper - free).sup(&rest).sup(&last),
        }
    }
}
