//! What a prediction starts from.

use nalgebra::SVector;

use super::Settings;
use super::constraints::ForceBounds;
use super::model::{Model, State, Step};
use admittance_vocabulary::Side;

use super::verdict::Verdict;
use crate::belief::{Belief, JointMotion, SurfaceSet};
use crate::intake::Accepted;
use crate::output::{Output, Plan};
use crate::quantities::Span;
use crate::redundancy::NullMotion;
use crate::robot::Singular;

/// Instants at which the force is looked at while an earlier command acts.
const PIECES: u32 = 8;

/// Everything that a cycle knows, and the model that follows from it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Situation<'a, const N: usize, const D: usize> {
    /// The sample of this cycle.
    pub sample: &'a Accepted<N, D>,
    /// The belief about the surface.
    pub belief: &'a Belief<D>,
    /// What has been told to the arm.
    pub output: &'a Output<N, D>,
    /// How its joints really move.
    pub joints: JointMotion<N>,
    /// What they are told beside the task.
    pub beside: &'a NullMotion<N>,
    /// (17) at this sample.
    pub model: Model<N, D>,
}

/// Where a prediction starts.
pub(super) struct Start<const N: usize, const D: usize> {
    /// x when the inputs begin to act.
    pub(super) state: State<N, D>,
    /// How long after the sample the inputs begin to act, in s.
    pub(super) delay: f64,
    /// What is left until then below the bounds, or the largest force above one: no input changes it any more.
    pub(super) verdict: Verdict,
}

impl<'a, const N: usize, const D: usize> Situation<'a, N, D> {
    /// The situation at an accepted sample.
    ///
    /// # Errors
    /// [`Singular`] when J has no inverse there.
    pub(crate) fn new(
        sample: &'a Accepted<N, D>,
        belief: &'a Belief<D>,
        output: &'a Output<N, D>,
        joints: JointMotion<N>,
        beside: &'a NullMotion<N>,
    ) -> Result<Self, Singular> {
        let model = Model::new(belief.surface(), &sample.posture, &sample.joint_position)?;
        Ok(Self { sample, belief, output, joints, beside, model })
    }

    /// s·f_lin at the measured q on an axis whose contact has the sign s, in N.
    pub(crate) fn spring_force(&self, axis: usize, sign: f64) -> f64 {
        sign * self.model.linear_wrench_on(axis, &self.sample.joint_position)
    }

    /// J⁻¹ of a twist, rad/s.
    pub(super) fn joint_velocity(&self, twist: &SVector<f64, D>) -> SVector<f64, N> {
        self.model.jacobian_inverse * twist
    }

    /// What the joints are told that move the TCP with a twist, rad/s: [`Self::joint_velocity`] and what
    /// they do beside the task.
    pub(super) fn told_with(&self, twist: &SVector<f64, D>) -> SVector<f64, N> {
        let velocity = self.joint_velocity(twist);
        self.beside.told().map_or(velocity, |beside| velocity + beside)
    }

    /// The part of [`Self::told_with`] that is the twist's.
    pub(super) fn of_twist(&self, told: &SVector<f64, N>) -> SVector<f64, N> {
        self.beside.told().map_or(*told, |beside| told - beside)
    }

    /// Adds to the joint velocity references of each step what the joints do beside the task.
    pub(super) fn add_beside(&self, steps: &[f64], references: &mut [SVector<f64, N>]) {
        let mut since = 0.0;
        for (reference, step) in references.iter_mut().zip(steps) {
            let Some(beside) = self.beside.ahead(since) else { return };
            *reference += beside;
            since += step;
        }
    }

    /// What a damped inverse leaves undone of a plan, in N: by so much the tool is not where twists say
    /// that it is at the end, along the normal. 0 where J is inverted exactly.
    pub(super) fn missed_by_damping(&self, plan: &Plan<D>) -> f64 {
        if !self.sample.posture.inverse(0.0).is_ok_and(|inverse| inverse.is_damped) {
            return 0.0;
        }
        let (surface, mut begun, mut way) = (self.belief.surface(), 0.0, 0.0);
        for (offset, end) in plan.steps() {
            let twist = self.sample.twist_reference + offset;
            let undone = twist - self.sample.posture.jacobian() * self.joint_velocity(&twist);
            way += surface.outward_speed(&undone).abs() * (end.seconds() - begun);
            begun = end.seconds();
        }
        surface.normal_stiffness() * way
    }

    /// The speed along the normal, in m/s, without which a surface that is not quite as its normal says would leave an
    /// arm that slides with these joint velocities (rad/s). 0 where the surface is known.
    pub(super) fn falling_away(&self, joint_velocity: &SVector<f64, N>) -> f64 {
        self.belief.set().map_or(0.0, |set| {
            let (_, along) = self.belief.surface().parts(&(self.sample.posture.jacobian() * joint_velocity));
            set.falling_away(&along)
        })
    }

    /// nᵀJ of joint velocities in rad/s, m/s.
    pub(super) fn outward_speed(&self, joint_velocity: &SVector<f64, N>) -> f64 {
        self.belief.surface().outward_speed(&(self.sample.posture.jacobian() * joint_velocity))
    }

    /// T q̈, rad/s: by how much joints that turn with q̇ (rad/s) stay behind the references with which the tool
    /// keeps its way. A joint lags behind its reference by T, and J turns meanwhile: with J q̇ constant, q̈ is
    /// −J⁻¹ J̇ q̇, and J r has to be J q̇ + J T q̈. The q̈ of a redundant arm has a part within the null space besides, which
    /// moves the TCP where the joints lag differently. A surface that bends turns the way as well.
    pub(super) fn behind(&self, settings: &Settings<N, D>, joint_velocity: &SVector<f64, N>) -> SVector<f64, N> {
        let (posture, surface) = (&self.sample.posture, self.belief.surface());
        let mut turning = posture.acceleration_at_constant_joint_velocity(joint_velocity);
        if let Some(bend) = self.belief.set().map(SurfaceSet::bend).filter(|bend| *bend != 0.0) {
            let (_, along) = surface.parts(&(posture.jacobian() * joint_velocity));
            turning += surface.normal * (bend * along.norm_squared());
        }
        let held = settings.timing.command_delay.seconds() + 0.5 * settings.tick();
        let lag = (settings.loops.until_rest()[0] + settings.loops.dead_time).add_scalar(held);
        let within = posture.null_acceleration_at_constant_twist(joint_velocity);
        (within - self.joint_velocity(&turning)).component_mul(&lag)
    }

    /// The state when the command for this sample reaches the joints, and the forces until then,
    /// under the commands that are under way, by joints that stay `behind` them (rad/s).
    pub(super) fn at_action(
        &self,
        settings: &Settings<N, D>,
        bounds: &ForceBounds<D>,
        behind: &SVector<f64, N>,
    ) -> Start<N, D> {
        let wrench = self.belief.wrench_ahead(&self.sample.wrench, self.sample.stamp);
        let advance = |step: &_, x: &_, r: &_| self.model.advance(step, x, r);
        self.until_action(settings, bounds, (wrench, &settings.wrench_time_constant), behind, advance)
    }

    /// The same of the joints alone, without f̂.
    pub(super) fn joints_at_action(&self, settings: &Settings<N, D>, bounds: &ForceBounds<D>) -> Start<N, D> {
        let no_estimates = SVector::<f64, 0>::zeros();
        let follows = |step: &_, x: &State<N, D>, r: &_| x.moved(step, r);
        self.until_action(settings, bounds, (SVector::zeros(), &no_estimates), &SVector::zeros(), follows)
    }

    fn until_action<const W: usize>(
        &self,
        settings: &Settings<N, D>,
        bounds: &ForceBounds<D>,
        (wrench, wrench_time_constant): (SVector<f64, D>, &SVector<f64, W>),
        behind: &SVector<f64, N>,
        advance: impl Fn(&Step<N, W>, &State<N, D>, &SVector<f64, N>) -> State<N, D>,
    ) -> Start<N, D> {
        let (sample, loops) = (self.sample, &settings.loops);
        let mut state = State::moving(sample.joint_position, self.joints.velocity, wrench);
        state.joint_acceleration = self.joints.acceleration;
        let mut start = Start { state, delay: 0.0, verdict: Verdict::None };
        let delay = settings.timing.command_delay + Span::from_seconds(loops.common_dead_time());
        if !settings.options.models_delay {
            return start;
        }
        let under_way = self.output.under_way();
        let twist = |offset: Option<SVector<f64, D>>| offset.map(|offset| sample.twist_reference + offset);
        let reference =
            |twist: Option<SVector<f64, D>>| twist.map_or_else(SVector::zeros, |twist| self.joint_velocity(&twist));
        let (mut least, dead_times) = (f64::INFINITY, loops.dead_times());
        for stretch in under_way.between(sample.stamp, sample.stamp + delay, dead_times) {
            let references = stretch.references(self.beside, dead_times, |offset| reference(twist(offset))) - behind;
            let duration = stretch.duration / f64::from(PIECES);
            let step = settings.options.discretization.without_dead_time(duration, loops, wrench_time_constant);
            for _ in 0..PIECES {
                start.state = advance(&step, &start.state, &references);
                start.delay += step.duration;
                for bound in bounds.as_slice() {
                    let force = bound.sign * self.model.linear_wrench_on(bound.axis, &start.state.joint_position);
                    let (axis, time) = (bound.axis, start.delay);
                    let margin = bound.maximum - force;
                    if margin < least {
                        least = margin;
                        start.verdict = if margin < 0.0 {
                            Verdict::Infeasible { axis, side: Side::Upper, time, shortfall: -margin }
                        } else {
                            Verdict::Feasible { margin, axis, time }
                        };
                    }
                }
            }
        }
        start.state.earlier_reference = reference(twist(under_way.latest())) - behind;
        if let (Some(_), Some(beside)) = (under_way.latest(), self.beside.latest()) {
            start.state.earlier_reference += beside;
        }
        start
    }
}
