//! The optimisations of a cycle: the MPC (18) in contact, and the minimum-force stop. Both predict with one model, are
//! condensed and checked by the same code, and leave their result in the plan.

use nalgebra::SVector;

use crate::condensation::{InputAxes, MpcRows, Prediction, Slack, condense};
use crate::constraints::{AxisBound, Constraints, ForceBounds, Interval, Softened};
use crate::controller::{Controller, Pose};
use crate::cost::SetPoint;
use crate::feasibility::{Side, Verdict, checked_infeasible, margin_of};
use crate::model::{Model, State};
use crate::parameters::{ContactPoint, ContactSign, InputSelection, LowerBound};
use crate::plan::{MAX_STEPS, nanoseconds};
use crate::qp::{QpOutcome, QpSolver, kkt_residual};
use crate::sample::Sample;
use crate::stopping;

/// What a force below f_min costs: at rest far more than the cost of the force is worth, so that f_min is kept to the letter;
/// after an impact not so much that a dip between samples, which may be unavoidable, is answered by the next impact.
const KEPT: Slack = Slack { softened: Softened::Minimum, price: 30.0, curvature: 3.0 };

/// Instants at which the force is looked at while an earlier command acts.
const PIECES: u32 = 8;

/// What became of an optimisation.
pub(crate) enum Optimized {
    /// The plan holds its inputs.
    Planned { verdict: Verdict, iterations: u32 },
    /// Proven infeasible.
    Infeasible { verdict: Verdict, iterations: u32 },
    /// Out of time.
    Expired { iterations: u32 },
    /// No answer, or one that does not pass the checks.
    Failed { iterations: u32 },
}

impl Optimized {
    pub(crate) fn iterations(&self) -> u32 {
        match *self {
            Self::Planned { iterations, .. }
            | Self::Infeasible { iterations, .. }
            | Self::Expired { iterations }
            | Self::Failed { iterations } => iterations,
        }
    }

    /// The same with the iterations of an optimisation before it.
    fn after(mut self, before: u32) -> Self {
        let (Self::Planned { iterations, .. }
        | Self::Infeasible { iterations, .. }
        | Self::Expired { iterations }
        | Self::Failed { iterations }) = &mut self;
        *iterations += before;
        self
    }

    /// The same with its verdict counted from the sample, which is `delay` s before its inputs act, and its margin reduced by
    /// `uncertainty` N.
    fn shifted(mut self, delay: f64, uncertainty: f64) -> Self {
        if let Self::Planned { verdict, .. } | Self::Infeasible { verdict, .. } = &mut self {
            match verdict {
                Verdict::Feasible { margin, time, .. } => {
                    *margin -= uncertainty;
                    *time += delay;
                }
                Verdict::Infeasible { time, .. } => *time += delay,
                Verdict::None => {}
            }
        }
        self
    }
}

/// Where a prediction starts.
struct Start<const N: usize, const D: usize> {
    /// x when the inputs begin to act.
    state: State<N, D>,
    /// When that is, in s from the sample.
    delay: f64,
    /// The largest force above a bound until then: nothing can help it.
    verdict: Option<Verdict>,
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// (18) for the axes in contact.
    pub(crate) fn optimize(
        &mut self,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        let tolerance = self.parameters.mpc.limit_tolerance;
        let first = self.optimize_within(0.0, sample, pose, expired);
        match &first {
            Optimized::Infeasible { verdict: Verdict::Infeasible { axis, shortfall, .. }, iterations }
                if *shortfall <= tolerance * self.parameters.mpc.force_limit[*axis] =>
            {
                let second = self.optimize_within(tolerance, sample, pose, expired);
                // Without an answer in the second place the first one stands.
                let is_answer = matches!(second, Optimized::Planned { .. } | Optimized::Infeasible { .. });
                if is_answer { second.after(*iterations) } else { first }
            }
            _ => first,
        }
    }

    /// (18) with every f_max larger by this part.
    fn optimize_within(
        &mut self,
        tolerance: f64,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        let mpc = self.parameters.mpc;
        let active = self.contact.active();
        let inputs = match mpc.inputs {
            InputSelection::Active => active,
            InputSelection::All => self.parameters.thresholds.admittance,
        };
        let model = self.model(sample, pose);
        let leaves = stopping::is_outward(&self.parameters, &sample.twist_reference);
        let mut bounds = ForceBounds::none();
        let mut holds = false;
        for axis in 0..D {
            let sign = match mpc.sign {
                ContactSign::Wrench => self.contact.sign(axis),
                ContactSign::Normal => {
                    self.surface_signs.sign(axis).filter(|_| self.parameters.thresholds.admittance[axis])
                }
            };
            let Some(sign) = sign else { continue };
            let minimum = match mpc.lower_bound {
                LowerBound::Always => mpc.minimum_force[axis],
                LowerBound::OnceReached if !leaves => {
                    // f̂ lags behind; what the spring has been pressed to is kept on the way to f_min already. What has been lost
                    // comes back as the cost has it: held by force it would come back with all speed, and bounce.
                    let force = sign * model.linear_wrench_on(axis, &sample.joint_position);
                    self.deepest[axis] = if force > 0.0 { self.deepest[axis].max(force) } else { 0.0 };
                    let is_held = self.deepest[axis] > 0.0;
                    holds |= is_held;
                    if is_held { mpc.minimum_force[axis].min(self.deepest[axis]) } else { f64::NEG_INFINITY }
                }
                LowerBound::OnceReached => f64::NEG_INFINITY,
            };
            bounds.push(AxisBound { axis, sign, minimum, maximum: mpc.force_limit[axis] * (1.0 + tolerance) });
        }
        // The offset of released axes is on its way to zero: a known input, beside ṗ0.
        let mut known_twist = [SVector::zeros(); MAX_STEPS];
        let mut since = self.parameters.timing.sampling_time;
        for (twist, step) in known_twist.iter_mut().zip(mpc.steps()) {
            let ramp = self.released_offset(since);
            *twist =
                SVector::from_fn(|axis, _| sample.twist_reference[axis] + if inputs[axis] { 0.0 } else { ramp[axis] });
            since += step;
        }
        let known_twist = &known_twist[..mpc.steps().len()];
        let mut references = [SVector::zeros(); MAX_STEPS];
        let known_reference = &mut references[..known_twist.len()];
        write_references(pose, known_twist, known_reference);
        let start = self.at_action(&model, sample, pose, &bounds);
        if let Some(verdict) = start.verdict {
            return Optimized::Infeasible { verdict, iterations: 0 };
        }
        // A spring that pulls would hold back a TCP that is to leave, and an estimate that fades one that is to come back: where
        // nothing presses that should, the force costs nothing.
        let is_soft = mpc.lower_bound == LowerBound::OnceReached;
        // What holds the contact, holds it at its force: the part of ṗ0 into the surface would only bias that.
        let inward = self.parameters.environment.outward_speed(&sample.twist_reference).min(0.0);
        let taken_out = if is_soft && holds { inward } else { 0.0 };
        let wanted = sample.twist_reference - self.parameters.environment.normal * taken_out;
        let wrench_axes = if is_soft && !holds { InputAxes::none() } else { InputAxes::from_mask(&active) };
        let prediction = Prediction {
            initial: start.state,
            known_reference,
            inputs: InputAxes::from_mask(&inputs),
            previous_input: self.offset,
            wrench_axes,
            constraints: self.constraints(bounds, &SVector::zeros(), sample),
            set_point: SetPoint {
                joint_position: sample.joint_position_reference,
                joint_velocity: pose.inverse.joint_velocity(&wanted),
                wrench: self.parameters.environment.normal * -mpc.normal_force_reference,
            },
            weights: &mpc.weights,
            jacobian: pose.kinematics.task_jacobian(),
            input_weight: mpc.input_weight,
            slack: (is_soft && holds).then_some(KEPT),
        };
        let optimized = self.run(&model, sample, &prediction, known_twist, expired);
        optimized.shifted(start.delay, self.uncertainty())
    }

    /// The minimum-force stop. Its inputs are the absolute twist; the plan holds them as offsets to ṗ0.
    pub(crate) fn optimize_stop(
        &mut self,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        let mpc = self.parameters.mpc;
        let (weights, input_weight) = stopping::weights(&self.parameters);
        let model = self.model(sample, pose);
        let start = self.at_action(&model, sample, pose, &ForceBounds::none());
        let admittance = self.parameters.thresholds.admittance;
        let prediction = Prediction {
            initial: start.state,
            known_reference: &[SVector::zeros(); MAX_STEPS][..mpc.steps().len()],
            inputs: InputAxes::from_mask(&admittance),
            previous_input: sample.twist_reference + self.offset,
            wrench_axes: InputAxes::from_mask(&admittance),
            constraints: self.constraints(stopping::bounds(&self.parameters), &sample.twist_reference, sample),
            set_point: stopping::set_point(&start.state),
            weights: &weights,
            jacobian: pose.kinematics.task_jacobian(),
            input_weight,
            slack: Some(stopping::SLACK),
        };
        let known_twist = [SVector::zeros(); MAX_STEPS];
        let optimized = self.run(&model, sample, &prediction, &known_twist[..mpc.steps().len()], expired);
        optimized.shifted(start.delay, 0.0)
    }

    /// Whether a stop may come to rest at this sample.
    pub(crate) fn may_rest(&self, sample: &Sample<N, D>, pose: &Pose<N, D>) -> bool {
        let model = self.model(sample, pose);
        let start = self.at_action(&model, sample, pose, &ForceBounds::none());
        let twist = pose.kinematics.task_jacobian::<D>() * start.state.joint_velocity;
        let outward = self.parameters.environment.outward_speed(&twist);
        let measured = self.parameters.environment.pressing_force(&sample.wrench);
        stopping::may_rest(&self.parameters, &model, &start.state, measured, outward)
    }

    /// Offset of the last command after `since` s of ramping to zero on every axis.
    pub(crate) fn released_offset(&self, since: f64) -> SVector<f64, D> {
        let step = self.parameters.limits.release_rate * since;
        self.offset.map(|offset| if offset.abs() > step { offset - step.copysign(offset) } else { 0.0 })
    }

    /// What the margin is reduced by, for not knowing the contact point better; N.
    fn uncertainty(&self) -> f64 {
        match self.parameters.contact_point {
            ContactPoint::Configured => 0.0,
            ContactPoint::Detected { .. } => self.detection.uncertainty(),
        }
    }

    /// Bounds of the force, and the limits of joints and of the inputs, which are offsets to ṗ0 minus `twist_reference`.
    fn constraints(
        &self,
        force: ForceBounds<D>,
        twist_reference: &SVector<f64, D>,
        sample: &Sample<N, D>,
    ) -> Constraints<N, D> {
        let limits = &self.parameters.limits;
        let rate = (limits.inward_rate.is_some() || limits.outward_rate.is_some()).then(|| {
            let along = |axis: usize, direction: f64| {
                // Without a sign, neither way is out.
                let is_outward = self.surface_signs.sign(axis).is_some_and(|sign| sign * direction < 0.0);
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
            joint_position: limits.joint_position.as_ref().map(|limits| self.reachable(limits, sample)),
            offset: Some(Interval { lower: twist_reference - limits.offset, upper: twist_reference + limits.offset }),
            rate,
        }
    }

    /// Position limits; where a joint is beyond one or cannot help passing it, what it reaches when it coasts to standstill.
    fn reachable(&self, limits: &Interval<N>, sample: &Sample<N, D>) -> Interval<N> {
        let coasted = |joint: usize| {
            let lag = self.parameters.velocity_time_constant[joint] + self.parameters.timing.command_delay;
            sample.joint_position[joint] + lag * sample.joint_velocity[joint]
        };
        let (low, high) = (
            |joint: usize| coasted(joint).min(sample.joint_position[joint]),
            |joint: usize| coasted(joint).max(sample.joint_position[joint]),
        );
        Interval {
            lower: SVector::from_fn(|joint, _| limits.lower[joint].min(low(joint))),
            upper: SVector::from_fn(|joint, _| limits.upper[joint].max(high(joint))),
        }
    }

    pub(crate) fn model(&self, sample: &Sample<N, D>, pose: &Pose<N, D>) -> Model<N, D> {
        Model::new(&self.parameters.environment, &pose.kinematics, &pose.inverse, &sample.joint_position)
    }

    /// The state when the command for this sample acts, and the forces until then, under the commands that are under way.
    fn at_action(
        &self,
        model: &Model<N, D>,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        bounds: &ForceBounds<D>,
    ) -> Start<N, D> {
        let mut start = Start { state: state_of(sample), delay: 0.0, verdict: None };
        let delay = self.parameters.timing.command_delay;
        if !self.parameters.mpc.models_delay || delay <= 0.0 {
            return start;
        }
        let mut worst = 0.0;
        let end = sample.stamp.saturating_add(nanoseconds(delay));
        for stretch in self.under_way.between(sample.stamp, end) {
            let twist = stretch.offset.map(|offset| sample.twist_reference + offset);
            let reference = twist.map_or_else(SVector::zeros, |twist| pose.inverse.joint_velocity(&twist));
            let step = self.parameters.mpc.discretization.step(
                stretch.duration / f64::from(PIECES),
                &self.parameters.velocity_time_constant,
                &self.parameters.wrench_time_constant,
            );
            for _ in 0..PIECES {
                start.state = model.advance(&step, &start.state, &reference);
                start.delay += step.duration;
                for bound in bounds.as_slice() {
                    let force = bound.sign * model.linear_wrench_on(bound.axis, &start.state.joint_position);
                    let (axis, time) = (bound.axis, start.delay);
                    if force - bound.maximum > worst {
                        worst = force - bound.maximum;
                        start.verdict = Some(Verdict::Infeasible { axis, side: Side::Upper, time, shortfall: worst });
                    }
                }
            }
        }
        start
    }

    /// Solves a prediction whose inputs act on top of `known_twist` in each step, and leaves the result in the plan.
    fn run(
        &mut self,
        model: &Model<N, D>,
        sample: &Sample<N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        // The number of inputs is known to the compiler from here on: loops over them become straight code.
        match prediction.inputs.as_slice().len() {
            1 => self.run_with::<1>(model, sample, prediction, known_twist, expired),
            2 => self.run_with::<2>(model, sample, prediction, known_twist, expired),
            3 => self.run_with::<3>(model, sample, prediction, known_twist, expired),
            4 => self.run_with::<4>(model, sample, prediction, known_twist, expired),
            5 => self.run_with::<5>(model, sample, prediction, known_twist, expired),
            6 => self.run_with::<6>(model, sample, prediction, known_twist, expired),
            _ => Optimized::Failed { iterations: 0 },
        }
    }

    fn run_with<const M: usize>(
        &mut self,
        model: &Model<N, D>,
        sample: &Sample<N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        if expired() {
            return Optimized::Expired { iterations: 0 };
        }
        let Some(rows) = MpcRows::<N, D, M>::new(model, &self.horizon, prediction) else {
            return Optimized::Failed { iterations: 0 };
        };
        let Some(mut pieces) = self.workspace.pieces(&rows) else { return Optimized::Failed { iterations: 0 } };
        condense(&rows, &mut pieces);
        self.warm_start.guess(&rows.layout, &self.horizon, sample.stamp, pieces.answer.working);
        let (qp, mut answer, scratch) = pieces.split(&rows);
        let outcome = self.solver.solve(&qp, &mut answer, expired);
        let iterations = outcome.iterations();
        let verdict = match outcome {
            QpOutcome::Solved { .. } => {
                let residual = kkt_residual(&qp, answer.z, answer.multipliers, scratch);
                if !residual.is_within(self.parameters.mpc.solution_tolerance) {
                    return Optimized::Failed { iterations };
                }
                margin_of(&rows, &qp, answer.z, &scratch[2 * qp.stride..])
            }
            QpOutcome::Infeasible { .. } => {
                let reach = self.parameters.limits.offset.max();
                return match checked_infeasible(&rows, &qp, answer.multipliers, reach, scratch) {
                    Some(verdict) => Optimized::Infeasible { verdict, iterations },
                    None => Optimized::Failed { iterations },
                };
            }
            QpOutcome::Expired { .. } => {
                // The next cycle goes on from here: from nothing it would take as long again.
                self.warm_start.learn(&rows.layout, &self.horizon, sample.stamp, answer.working);
                return Optimized::Expired { iterations };
            }
            QpOutcome::Failed { .. } => return Optimized::Failed { iterations },
        };
        self.warm_start.learn(&rows.layout, &self.horizon, sample.stamp, answer.working);
        // Every step's twist, as an offset to the ṗ0 of this sample.
        self.plan.restart(sample.stamp);
        self.planned = true;
        for (step, known) in known_twist.iter().enumerate() {
            let mut twist = *known;
            for (&axis, value) in prediction.inputs.as_slice().iter().zip(&answer.z[rows.inputs_of(step)]) {
                twist[axis] += value;
            }
            self.plan.push(twist - sample.twist_reference, self.horizon.steps()[step].duration);
        }
        Optimized::Planned { verdict, iterations }
    }
}

fn state_of<const N: usize, const D: usize>(sample: &Sample<N, D>) -> State<N, D> {
    State { joint_position: sample.joint_position, joint_velocity: sample.joint_velocity, wrench: sample.wrench }
}

/// J⁻¹ of the twist in each step.
fn write_references<const N: usize, const D: usize>(
    pose: &Pose<N, D>,
    twists: &[SVector<f64, D>],
    references: &mut [SVector<f64, N>],
) {
    for (step, twist) in twists.iter().enumerate() {
        let is_repeated = step > 0 && twists[step - 1] == *twist;
        references[step] = if is_repeated { references[step - 1] } else { pose.inverse.joint_velocity(twist) };
    }
}
