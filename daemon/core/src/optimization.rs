//! The optimisations of a cycle: the MPC (18) in contact, and the minimum-force stop. Both predict with one model, are
//! condensed and checked by the same code, and leave their result in the plan.

use nalgebra::SVector;

use crate::condensation::{InputAxes, Prediction, condense};
use crate::constraints::{AxisBound, ForceBounds};
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

/// Whether upper bounds may be softened.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Bounds {
    Hard,
    LeastViolating,
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
        let prediction = Prediction {
            initial: state_of(sample),
            steps: mpc.steps(),
            known_twist: &known_twist[..mpc.steps().len()],
            inputs: InputAxes::from_mask(&inputs),
            wrench_axes: InputAxes::from_mask(&active),
            bounds,
            set_point: SetPoint {
                joint_position: sample.joint_position_reference,
                joint_velocity: pose.inverse.joint_velocity(&sample.twist_reference),
                wrench: SVector::zeros(),
            },
            weights: mpc.weights.at(&pose.kinematics.task_jacobian()),
            input_weight: mpc.input_weight,
        };
        self.run(sample, pose, &prediction, Bounds::Hard, expired)
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
            steps: mpc.steps(),
            known_twist: &[SVector::zeros(); MAX_STEPS][..mpc.steps().len()],
            inputs: InputAxes::from_mask(&admittance),
            wrench_axes: InputAxes::from_mask(&admittance),
            bounds: stopping::bounds(&self.parameters),
            set_point: stopping::set_point(&initial),
            weights: weights.at(&pose.kinematics.task_jacobian()),
            input_weight,
        };
        self.run(sample, pose, &prediction, Bounds::LeastViolating, expired)
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
        Model::new(
            self.parameters.mpc.discretization,
            &self.parameters.environment,
            &pose.kinematics,
            &pose.inverse,
            &sample.joint_position,
            self.parameters.velocity_time_constant,
            self.parameters.wrench_time_constant,
        )
    }

    fn run(
        &mut self,
        sample: &Sample<N, D>,
        pose: &Pose<N, D>,
        prediction: &Prediction<'_, N, D>,
        bounds: Bounds,
        expired: &mut dyn FnMut() -> bool,
    ) -> Optimized {
        if expired() {
            return Optimized::Expired { iterations: 0 };
        }
        let model = self.model(sample, pose);
        let (n, rows) = prediction.size();
        let Some(mut pieces) = self.workspace.pieces(n, rows) else { return Optimized::Failed { iterations: 0 } };
        condense(&model, prediction, &mut pieces);
        let (qp, mut answer) = pieces.split();
        let outcome = match bounds {
            Bounds::Hard => self.solver.solve(&qp, &mut answer, expired),
            Bounds::LeastViolating => self.solver.solve_least_violating(&qp, stopping::PENALTY, &mut answer, expired),
        };
        let iterations = outcome.iterations();
        let mpc = &self.parameters.mpc;
        let verdict = match outcome {
            QpOutcome::Solved { .. } => {
                let residual = kkt_residual(&qp, answer.z, answer.multipliers);
                let violation = if bounds == Bounds::Hard { mpc.force_tolerance } else { f64::INFINITY };
                // The multipliers of a softened problem belong to shifted bounds: only its stationarity can be checked.
                let usable = match bounds {
                    Bounds::Hard => residual.is_within(mpc.solution_tolerance, violation),
                    Bounds::LeastViolating => residual.stationarity <= mpc.solution_tolerance,
                };
                if !usable || !answer.z.iter().all(|z| z.is_finite()) {
                    return Optimized::Failed { iterations };
                }
                margin_of(prediction, &qp, answer.z)
            }
            QpOutcome::Infeasible { .. } => {
                let reach = self.parameters.limits.offset.max();
                return match checked_infeasible(prediction, &qp, answer.multipliers, reach) {
                    Some(verdict) => Optimized::Infeasible { verdict, iterations },
                    None => Optimized::Failed { iterations },
                };
            }
            QpOutcome::Expired { .. } => return Optimized::Expired { iterations },
            QpOutcome::Failed { .. } => return Optimized::Failed { iterations },
        };
        // Every step's twist, as an offset to the ṗ0 of this sample.
        let inputs = prediction.inputs.as_slice();
        self.plan.restart(sample.stamp);
        self.planned = true;
        for (step, z) in answer.z.chunks_exact(inputs.len()).enumerate() {
            let mut twist = prediction.known_twist[step];
            for (&axis, value) in inputs.iter().zip(z) {
                twist[axis] += value;
            }
            self.plan.push(twist - sample.twist_reference, prediction.steps[step]);
        }
        Optimized::Planned { verdict, iterations }
    }
}

fn state_of<const N: usize, const D: usize>(sample: &Sample<N, D>) -> State<N, D> {
    State { joint_position: sample.joint_position, joint_velocity: sample.joint_velocity, wrench: sample.wrench }
}
