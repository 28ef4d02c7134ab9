//! What may reach the law: a state sample is checked against the clock and the samples before it,
//! its wrench becomes f̂, and the kinematics at its joint position are computed. The result is an
//! accepted sample or a [`SampleFault`]; no later stage sees a raw sample.
//!
//! ```
//! use admittance_core::intake::SampleFault;
//! use admittance_core::vocabulary::FaultName;
//!
//! let fault = SampleFault::JointCount { found: 7, expected: 6 };
//! assert_eq!(fault.name(), FaultName::JointCount);
//! assert_eq!(fault.to_string(), "joint_count = 7: this daemon is configured for 6 joints");
//! ```

mod momentum_observer;
mod order;
mod position_track;
mod rate;
mod sample;
#[cfg(test)]
mod tests;
mod tool_motion;
mod torque_learning;
mod wrench;

use nalgebra::{SMatrix, SVector, Vector6};

pub use momentum_observer::TorqueModel;
pub(crate) use momentum_observer::{band, band_along};
pub use order::{Arrival, Timing};
pub use rate::WrongRate;
pub(crate) use sample::Accepted;
pub use sample::{Field, Sample, SampleFault};
pub use wrench::{Conditioning, GivenIn, GivenSign};

use crate::quantities::{GivenWrench, Instant, Span};
use crate::robot::{Chain, Posture};
use crate::surface::Surface;
use crate::turn::Turn;
use momentum_observer::{Estimate, MomentumObserver, unseen};
use order::SampleOrder;
use position_track::PositionTrack;
use tool_motion::ToolMotion;

/// What a cycle starts from.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a, const N: usize, const D: usize> {
    /// A state sample arrived.
    Sample(&'a Sample<N, D>),
    /// None did for longer than allowed.
    Silence,
}

/// Where the wrench comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WrenchSource<const N: usize> {
    /// The sample gives it.
    Sample,
    /// It is what the torques of the motors leave to be explained.
    MotorTorque(TorqueModel<N>),
}

/// Settings of this stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings<const N: usize, const D: usize> {
    /// The arm.
    pub chain: Chain<N>,
    /// When samples are good enough.
    pub timing: Timing,
    /// How f̂ follows from what is given.
    pub conditioning: Conditioning<D>,
    /// T_est per axis in s; 0 for ideal force measurement.
    pub wrench_time_constant: SVector<f64, D>,
    /// By what share of it the lag of the wrench may be another.
    pub wrench_lag_tolerance: f64,
    /// Whether the law resolves twists itself: then the joints have to follow what it says.
    pub resolves: bool,
    /// Limits of the joint speeds in rad/s: a joint that moved much faster has jumped.
    pub joint_speed: Option<SVector<f64, N>>,
    /// Where the wrench comes from.
    pub source: WrenchSource<N>,
    /// Standard deviation of f̂ per axis in N and N·m above which torques show too little of it.
    pub largest_deviation: SVector<f64, D>,
    /// The surface: well above it nothing presses, and torques tell of friction and masses.
    pub surface: Surface<D>,
}

/// The wrench of a sample, however it came by it.
struct Shown<const D: usize> {
    wrench: SVector<f64, D>,
    /// With the tool's inertia as the joint positions show it.
    by_position: SVector<f64, D>,
    /// What the tool's inertia may feign.
    feigned: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
}

/// The stage.
#[derive(Debug)]
pub(crate) struct Intake<const N: usize, const D: usize> {
    settings: Settings<N, D>,
    order: SampleOrder,
    track: PositionTrack<N>,
    tool: ToolMotion<N, D>,
    observer: Option<MomentumObserver<N, D>>,
    last: Option<Accepted<N, D>>,
    rejected: u64,
}

impl<const N: usize, const D: usize> Intake<N, D> {
    /// A stage that has seen nothing.
    pub(crate) fn new(settings: Settings<N, D>) -> Self {
        let (order, track, tool) = (SampleOrder::new(), PositionTrack::new(), ToolMotion::steady());
        Self { settings, order, track, tool, observer: None, last: None, rejected: 0 }
    }

    /// Goes on from what the wrench showed of the tool's acceleration after a recorded cycle: for a
    /// replay that begins there.
    #[must_use]
    pub(crate) fn with_tool_acceleration(self, acceleration: &Vector6<f64>) -> Self {
        Self { tool: ToolMotion::feeling(acceleration), ..self }
    }

    /// Takes over the state of `old`, with these settings.
    pub(crate) fn take_over(&mut self, old: &Self) {
        let Self { settings, order, track, tool, observer, last, rejected } = old;
        self.order = order.under(&self.settings.timing);
        (self.track, self.last, self.rejected) = (*track, *last, *rejected);
        // Of another tool, or through another filter, it would be another acceleration.
        let of =
            |settings: &Settings<N, D>| (settings.conditioning.tool_center_of_gravity, settings.wrench_time_constant);
        if of(settings) == of(&self.settings) {
            self.tool = *tool;
        }
        // A changed model sees in the same torques another force.
        if settings.source == self.settings.source {
            self.observer = *observer;
        }
    }

    /// Goes over to the frame that a turn leads to, and to its settings.
    pub(crate) fn turn(&mut self, settings: Settings<N, D>, turn: &Turn) {
        self.tool.turn(turn);
        // It is of the old frame's directions, and begins anew.
        self.observer = None;
        if let Some(last) = &mut self.last {
            last.turn(&settings.chain, turn);
        }
        self.settings = settings;
    }

    /// Takes an event at the time `now`.
    ///
    /// # Errors
    /// Why there is no sample that the law may use.
    pub(crate) fn take(&mut self, event: Event<'_, N, D>, now: Instant) -> Result<&Accepted<N, D>, SampleFault> {
        let checked = match event {
            Event::Sample(sample) => {
                let checked = self.check(sample, now);
                if checked.is_err() {
                    self.rejected += 1;
                    self.order.refuse();
                }
                checked
            }
            Event::Silence => Err(SampleFault::Silence),
        };
        checked.map(|accepted| &*self.last.insert(accepted))
    }

    /// Whether the joint positions of a sample are those of the arm, whatever its wrench is.
    pub(crate) fn believes_position(&self, sample: &Sample<N, D>, now: Instant) -> bool {
        let Settings { chain, timing, joint_speed, .. } = &self.settings;
        let mut track = self.track;
        sample.check_joint_count().is_ok()
            && self.order.check(sample, now, timing).is_ok()
            && sample.check_motion().is_ok()
            && track.follow(sample, joint_speed.as_ref(), chain).is_ok()
    }

    fn check(&mut self, sample: &Sample<N, D>, now: Instant) -> Result<Accepted<N, D>, SampleFault> {
        let Settings { chain, timing, joint_speed, .. } = &self.settings;
        sample.check_joint_count()?;
        self.order.check(sample, now, timing)?;
        sample.check_motion()?;
        if self.settings.resolves {
            sample.check_following()?;
        }
        let posture = Posture::new(chain, &sample.joint_position);
        let tool = self.tool.followed(&self.settings, sample, &posture);
        let (shown, observer) = match &self.settings.source {
            WrenchSource::Sample => (self.given(sample, &posture, &tool)?, None),
            WrenchSource::MotorTorque(model) => {
                let observer = self.observed(model, sample, &posture)?;
                let shown = self.shown(&observer, &posture);
                if shown.is_err() {
                    // The torques were good: who forgets them forgets why too little is known.
                    self.observer = Some(observer);
                }
                (shown?, Some(observer))
            }
        };
        self.track.follow(sample, joint_speed.as_ref(), chain)?;
        (self.tool, self.observer) = (tool, observer);
        let arrival = self.order.accept(sample, timing);
        Ok(Accepted {
            stamp: sample.stamp,
            arrival,
            is_rate_wrong: self.order.is_rate_wrong(),
            drives_enabled: sample.drives_enabled,
            joint_position: sample.joint_position,
            joint_velocity: sample.joint_velocity,
            joint_position_reference: sample.joint_position_reference,
            joint_velocity_reference: sample.joint_velocity_reference,
            twist_reference: chain.axes().kept(&sample.twist_reference),
            wrench: shown.wrench,
            wrench_by_position: shown.by_position,
            feigned_wrench: shown.feigned,
            wrench_covariance: shown.covariance,
            posture,
        })
    }

    /// f̂ as the sample gives it.
    fn given(
        &self,
        sample: &Sample<N, D>,
        posture: &Posture<N, D>,
        tool: &ToolMotion<N, D>,
    ) -> Result<Shown<D>, SampleFault> {
        let (conditioning, rotation) = (&self.settings.conditioning, &posture.pose().rotation);
        let f_hat = |tool: &SVector<f64, D>| {
            self.settings.chain.axes().kept(&conditioning.wrench(&sample.wrench, rotation, tool))
        };
        let wrench = f_hat(tool.felt());
        sample.check_wrench(&wrench, conditioning.saturated(&sample.wrench))?;
        let by_position = match conditioning.tool_mass {
            0.0 => wrench,
            _ => f_hat(tool.felt_by_position()),
        };
        // While a tool is accelerated a filter of another lag shows by its share more or less of that.
        let of_tool = tool.felt() * (conditioning.tool_mass * self.settings.wrench_lag_tolerance);
        let feigned = self.settings.chain.axes().kept(&of_tool);
        Ok(Shown { wrench, by_position, feigned, covariance: SMatrix::zeros() })
    }

    /// The filter of the torques after the sample.
    fn observed(
        &self,
        model: &TorqueModel<N>,
        sample: &Sample<N, D>,
        posture: &Posture<N, D>,
    ) -> Result<MomentumObserver<N, D>, SampleFault> {
        sample.check_torque()?;
        MomentumObserver::followed(self.observer.as_ref(), model, &self.settings, sample, posture).ok_or_else(|| {
            SampleFault::WrenchUnseen { axis: unseen(self.settings.chain.axes(), posture), deviation: f64::INFINITY }
        })
    }

    /// f̂ as the torques show it.
    fn shown(&self, observer: &MomentumObserver<N, D>, posture: &Posture<N, D>) -> Result<Shown<D>, SampleFault> {
        let Estimate { wrench, covariance } = observer.estimate();
        for axis in (0..D).filter(|axis| self.settings.chain.axes().has(*axis)) {
            let (deviation, most) = (libm::sqrt(covariance[(axis, axis)]), self.settings.largest_deviation[axis]);
            // NaN is seen no better.
            if deviation.is_nan() || deviation > most {
                return Err(SampleFault::WrenchUnseen { axis, deviation });
            }
        }
        Field::Wrench.check(wrench.as_slice())?;
        let given = GivenWrench(Vector6::from_fn(|axis, _| wrench.get(axis).copied().unwrap_or(0.0)));
        let wrench = self.settings.conditioning.wrench(&given, &posture.pose().rotation, &SVector::zeros());
        Ok(Shown { wrench, by_position: wrench, feigned: SVector::zeros(), covariance: *covariance })
    }

    /// The last sample that was accepted.
    pub(crate) fn last(&self) -> Option<&Accepted<N, D>> {
        self.last.as_ref()
    }

    /// What the wrench shows of the tool's acceleration on the task axes: m/s², then m²/s².
    pub(crate) fn tool_acceleration(&self) -> &SVector<f64, D> {
        self.tool.felt()
    }

    /// The time since the last accepted sample was measured; `None` before the first.
    pub(crate) fn silence(&self, now: Instant) -> Option<Span> {
        self.last.as_ref().map(|last| now.since(last.stamp))
    }

    /// Accepts the position of the next sample, wherever it is: for an arm that is not under
    /// control, or that a person resets.
    pub(crate) fn forget_position(&mut self) {
        self.track = PositionTrack::new();
    }

    /// Samples that did not reach the law.
    pub(crate) fn rejected(&self) -> u64 {
        self.rejected
    }

    /// Samples that were never seen, by gaps in their sequence for which there was time.
    pub(crate) fn missed(&self) -> u64 {
        self.order.missed()
    }

    /// Samples whose spacing differed from T_s by more than 10 %.
    pub(crate) fn irregular(&self) -> u64 {
        self.order.irregular()
    }

    /// The rate of the samples, while it is another than the configured one.
    pub(crate) fn wrong_rate(&self) -> Option<WrongRate> {
        self.order.wrong_rate()
    }
}
