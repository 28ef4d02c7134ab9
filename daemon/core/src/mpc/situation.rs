//! What a prediction starts from.

use nalgebra::SVector;

use super::Settings;
use super::constraints::ForceBounds;
use super::model::{Model, State};
use admittance_vocabulary::Side;

use super::verdict::Verdict;
use crate::belief::{Belief, JointMotion, SurfaceSet};
use crate::intake::Accepted;
use crate::output::Output;
use crate::quantities::Span;
use crate::robot::Singular;

/// Instants at which the force is looked at while an earlier command acts.
const PIECES: u32 = 8;

/// Largest lead in m/s: near a singular pose it grows without bound, and what is linear in the
/// lag does not hold.
const MOST_LEAD: f64 = 0.02;

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
    /// (17) at this sample.
    pub model: Model<N, D>,
}

/// Where a prediction starts.
pub(super) struct Start<const N: usize, const D: usize> {
    /// x when the inputs begin to act.
    pub(super) state: State<N, D>,
    /// How long after the sample the inputs begin to act, in s.
    pub(super) delay: f64,
    /// The largest force above a bound until then, which cannot be avoided any more.
    pub(super) verdict: Option<Verdict>,
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
    ) -> Result<Self, Singular> {
        let model = Model::new(belief.surface(), &sample.posture, &sample.joint_position)?;
        Ok(Self { sample, belief, output, joints, model })
    }

    /// s·f_lin at the measured q on an axis whose contact has the sign s, in N.
    pub(crate) fn spring_force(&self, axis: usize, sign: f64) -> f64 {
        sign * self.model.linear_wrench_on(axis, &self.sample.joint_position)
    }

    /// J⁻¹ of a twist, rad/s.
    pub(super) fn joint_velocity(&self, twist: &SVector<f64, D>) -> SVector<f64, N> {
        self.model.jacobian_inverse * twist
    }

    /// The offset along the normal without which an arm that slides with this twist would leave
    /// its path. At most [`MOST_LEAD`].
    pub(super) fn lead(&self, settings: &Settings<N, D>, sliding: &SVector<f64, D>) -> SVector<f64, D> {
        let lead = self.normal_lead(settings, &self.joint_velocity(sliding));
        self.belief.surface().normal * lead.clamp(-MOST_LEAD, MOST_LEAD)
    }

    /// The speed along the normal, in m/s, that an arm needs beside its twist to keep to it while
    /// its joints turn with q̇ (rad/s): a joint lags behind its reference by T, and J turns
    /// meanwhile. J q̇ is not J r but J r + J T J⁻¹ J̇ q̇. A surface that bends turns the path as well.
    pub(super) fn normal_lead(&self, settings: &Settings<N, D>, joint_velocity: &SVector<f64, N>) -> f64 {
        let (posture, surface) = (&self.sample.posture, self.belief.surface());
        let normal = &surface.normal;
        let mut turning = posture.acceleration_at_constant_joint_velocity(joint_velocity);
        if let Some(bend) = self.belief.set().map(SurfaceSet::bend).filter(|bend| *bend != 0.0) {
            let (_, along) = surface.parts(&(posture.jacobian() * joint_velocity));
            turning += normal * (bend * along.norm_squared());
        }
        let held = settings.timing.command_delay.seconds() + 0.5 * settings.timing.sampling_time.seconds();
        let lag = (settings.loops.until_rest()[0] + settings.loops.dead_time).add_scalar(held);
        -normal.dot(&(posture.jacobian() * self.joint_velocity(&turning).component_mul(&lag)))
    }

    /// The state when the command for this sample reaches the joints, and the forces until then,
    /// under the commands that are under way.
    pub(super) fn at_action(&self, settings: &Settings<N, D>, bounds: &ForceBounds<D>) -> Start<N, D> {
        let (sample, loops) = (self.sample, &settings.loops);
        let wrench = self.belief.wrench_ahead(&sample.wrench, sample.stamp);
        let mut state = State::moving(sample.joint_position, self.joints.velocity, wrench);
        state.joint_acceleration = self.joints.acceleration;
        let mut start = Start { state, delay: 0.0, verdict: None };
        let delay = settings.timing.command_delay + Span::from_seconds(loops.common_dead_time());
        if !settings.options.models_delay {
            return start;
        }
        let under_way = self.output.under_way();
        let twist = |offset: Option<SVector<f64, D>>| offset.map(|offset| sample.twist_reference + offset);
        let reference =
            |twist: Option<SVector<f64, D>>| twist.map_or_else(SVector::zeros, |twist| self.joint_velocity(&twist));
        let mut worst = 0.0;
        for stretch in under_way.between(sample.stamp, sample.stamp + delay, loops.dead_times()) {
            let references = stretch.references(|offset| reference(twist(offset)));
            let step = settings.options.discretization.without_dead_time(
                stretch.duration / f64::from(PIECES),
                loops,
                &settings.wrench_time_constant,
            );
            for _ in 0..PIECES {
                start.state = self.model.advance(&step, &start.state, &references);
                start.delay += step.duration;
                for bound in bounds.as_slice() {
                    let force = bound.sign * self.model.linear_wrench_on(bound.axis, &start.state.joint_position);
                    let (axis, time) = (bound.axis, start.delay);
                    if force - bound.maximum > worst {
                        worst = force - bound.maximum;
                        start.verdict = Some(Verdict::Infeasible { axis, side: Side::Upper, time, shortfall: worst });
                    }
                }
            }
        }
        start.state.earlier_reference = reference(twist(under_way.latest()));
        start
    }
}
