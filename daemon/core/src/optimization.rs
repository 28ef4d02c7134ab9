//! The optimisations of a cycle: the MPC (18) in contact, and the minimum-force stop. Both predict with one model, are
//! condensed and checked by the same code, and leave their result in the plan.

use nalgebra::SVector;

use crate::condensation::{InputAxes, MpcRows, Prediction, condense};
use crate::constraints::{AxisBound, Constraints, ForceBounds};
use crate::controller::{Controller, Pose};
use crate::cost::SetPoint;
use crate::feasibility::{Verdict, checked_infeasible, margin_of};
use crate::model::{Model, State};
use crate::parameters::InputSelection;
use crate::plan::MAX_STEPS;
use crate::qp::{QpOutcome, QpSolver, kkt_residual};
use crate::sample::Sample;
use crate::stopping;

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
}

impl<const N: usize, const D: usize, S: QpSolver, B: AsMut<[f64]>> Controller<N, D, S, B> {
    /// (18) for the axes in contact.
    pub(crate) fn optimize(
        &mut self,
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
        let mut bounds = ForceBounds::none();
        for axis in 0..D {
            if let Some(sign) = self.contact.sign(axis) {
                let (minimum, maximum) = (mpc.minimum_force[axis], mpc.force_limit[axis]);
                bounds.push(AxisBound { axis, sign, minimum, maximum });
            }
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
        let prediction = Prediction {
            initial: state_of(sample),
            known_reference,
            inputs: InputAxes::from_mask(&inputs),
            previous_input: self.offset,
            wrench_axes: InputAxes::from_mask(&active),
            constraints: Constraints::of_force(bounds),
            set_point: SetPoint {
                joint_position: sample.joint_position_reference,
                joint_velocity: pose.inverse.joint_velocity(&sample.twist_reference),
                wrench: SVector::zeros(),
            },
            weights: &mpc.weights,
            jacobian: pose.kinematics.task_jacobian(),
            input_weight: mpc.input_weight,
            slack_price: None,
        };
        self.run(sample, pose, &prediction, known_twist, expired)
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
        let initial = state_of(sample);
        let admittance = self.parameters.thresholds.admittance;
        let prediction = Prediction {
            initial,
            known_reference: &[SVector::zeros(); MAX_STEPS][..mpc.steps().len()],
            inputs: InputAxes::from_mask(&admittance),
            previous_input: sample.twist_reference + self.offset,
            wrench_axes: InputAxes::from_mask(&admittance),
            constraints: Constraints::of_force(stopping::bounds(&self.parameters)),
            set_point: stopping::set_point(&initial),
            weights: &weights,
            jacobian: pose.kinematics.task_jacobian(),
            input_weight,
            slack_price: Some(stopping::SLACK_PRICE),
        };
        self.run(sample, pose, &prediction, &[SVector::zeros(); MAX_STEPS][..mpc.steps().len()], expired)
    }

    /// Whether a stop may come to rest at this sample.
    pub(crate) fn may_rest(&self, sample: &Sample<N, D>, pose: &Pose<N, D>) -> bool {
        let twist = pose.kinematics.task_jacobian::<D>() * sample.joint_velocity;
        let outward = self.parameters.environment.outward_speed(&twist);
        stopping::may_rest(&self.parameters, &self.model(sample, pose), &state_of(sample), outward)
    }

    /// Offset of the last command after `since` s of ramping to zero on every axis.
    pub(crate) fn released_offset(&self, since: f64) -> SVector<f64, D> {
        let step = self.parameters.limits.release_rate * since;
        self.offset.map(|offset| if offset.abs() > step { offset - step.copysign(offset) } else { 0.0 })
    }

    fn model(&self, sample: &Sample<N, D>, pose: &Pose<N, D>) -> Model<N, D> {
        Model::new(&self.parameters.environment, &pose.kinematics, &pose.inverse, &sample.joint_position)
    }

    /// Solves a prediction whose inputs act on top of `known_twist` in each step, and leaves the result in the plan.
    fn run(
        &mut self,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        // The number of inputs is known to the compiler from here on: loops over them become straight code.
        match prediction.inputs.as_slice().len() {
            1 => self.run_with::<1>(sample, pose, prediction, known_twist, expired),
            2 => self.run_with::<2>(sample, pose, prediction, known_twist, expired),
            3 => self.run_with::<3>(sample, pose, prediction, known_twist, expired),
            4 => self.run_with::<4>(sample, pose, prediction, known_twist, expired),
            5 => self.run_with::<5>(sample, pose, prediction, known_twist, expired),
            6 => self.run_with::<6>(sample, pose, prediction, known_twist, expired),
            _ => Optimized::Failed { iterations: 0 },
        }
    }

    fn run_with<const M: usize>(
        &mut self,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        prediction: &Prediction<'_, N, D>,
        known_twist: &[SVector<f64, D>],
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        if expired() {
            return Optimized::Expired { iterations: 0 };
        }
        let model = self.model(sample, pose);
        let Some(rows) = MpcRows::<N, D, M>::new(&model, &self.horizon, prediction) else {
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
                margin_of(&rows, &qp, answer.z, scratch)
            }
            QpOutcome::Infeasible { .. } => {
                let reach = self.parameters.limits.offset.max();
                return match checked_infeasible(&rows, &qp, answer.multipliers, reach, scratch) {
                    Some(verdict) => Optimized::Infeasible { verdict, iterations },
                    None => Optimized::Failed { iterations },
                };
            }
            QpOutcome::Expired { .. } => return Optimized::Expired { iterations },
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
