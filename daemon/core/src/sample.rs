//! What may reach the law: one state sample, checked before anything looks at its values.

use nalgebra::SVector;

use crate::parameters::Timing;
use crate::plan::nanoseconds;

/// One state sample of the motion controller, SI units, base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<const N: usize, const D: usize> {
    /// Counts up by one per sample.
    pub sequence: u64,
    /// Instant of measurement, ns of CLOCK_MONOTONIC.
    pub stamp: u64,
    /// Run of the motion controller; another value means that it restarted.
    pub boot_id: u64,
    /// Number of joints the sender speaks of; must be N.
    pub joint_count: u32,
    /// Whether the sender vouches for `wrench`.
    pub wrench_valid: bool,
    /// The component of the given wrench that is at the end of the sensor's range, if one is.
    pub wrench_saturated: Option<usize>,
    /// Whether the drives follow the reference.
    pub drives_enabled: bool,
    /// q in rad.
    pub joint_position: SVector<f64, N>,
    /// q̇ in rad/s.
    pub joint_velocity: SVector<f64, N>,
    /// q0 in rad: commanded joint position, advancing with the command whatever the offset does.
    pub joint_position_reference: SVector<f64, N>,
    /// ṗ0 in m/s and rad/s.
    pub twist_reference: SVector<f64, D>,
    /// f̂ in N and N·m, robot on environment.
    pub wrench: SVector<f64, D>,
}

/// A vector of the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// q.
    JointPosition,
    /// q̇.
    JointVelocity,
    /// q0.
    JointPositionReference,
    /// ṗ0.
    TwistReference,
    /// f̂.
    Wrench,
}

impl Field {
    /// The field's name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::JointPosition => "joint_position",
            Self::JointVelocity => "joint_velocity",
            Self::JointPositionReference => "joint_position_reference",
            Self::TwistReference => "twist_reference",
            Self::Wrench => "wrench",
        }
    }
}

/// Why a sample never reaches the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SampleFault {
    /// Another number of joints than N.
    JointCount {
        /// The number in the sample.
        found: u32,
        /// N.
        expected: u32,
    },
    /// A value is NaN or infinite.
    NotFinite {
        /// The field.
        field: Field,
        /// Index in the field, from 0.
        index: usize,
    },
    /// A value is larger than any arm's: 1e6 rad, m, N and so on. What is computed from it would overflow or lose its digits.
    Implausible {
        /// The field.
        field: Field,
        /// Index in the field, from 0.
        index: usize,
    },
    /// The sender does not vouch for the wrench.
    WrenchInvalid,
    /// The wrench is at the end of the sensor's range: the real one may be any larger one.
    WrenchSaturated {
        /// Component of the given wrench, from 0.
        index: usize,
    },
    /// Older than allowed.
    Stale {
        /// Its age in ns.
        age: u64,
    },
    /// Stamped more than one T_s ahead.
    FromFuture {
        /// How far ahead in ns.
        ahead: u64,
    },
    /// Its sequence or stamp does not follow the last one's.
    OutOfOrder {
        /// Its sequence.
        sequence: u64,
        /// The last accepted one.
        last: u64,
    },
    /// A joint is not where it can have moved since the sample before.
    Jump {
        /// The joint, from 0.
        joint: usize,
        /// By how much it is off, in rad.
        off: f64,
        /// The most that it can have moved, in rad.
        most: f64,
    },
    /// There was no sample at all for longer than allowed.
    Silence,
}

impl core::fmt::Display for SampleFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::JointCount { found, expected } => {
                write!(f, "joint_count = {found}: this daemon is configured for {expected} joints")
            }
            Self::NotFinite { field, index } => write!(f, "{}[{index}] is not finite", field.name()),
            Self::Implausible { field, index } => {
                write!(f, "{}[{index}] is beyond ±{LARGEST_VALUE:e}, larger than any arm's", field.name())
            }
            Self::WrenchInvalid => f.write_str("wrench_valid = 0: the motion controller marks its wrench as invalid"),
            Self::WrenchSaturated { index } => {
                write!(f, "wrench[{index}] is at the end of the sensor's range, wrench.saturation")
            }
            Self::Stale { age } => write!(f, "stamp_ns is {age} ns old, older than max_sample_age_s"),
            Self::FromFuture { ahead } => {
                write!(f, "stamp_ns is {ahead} ns ahead of CLOCK_MONOTONIC, more than one sampling time")
            }
            Self::OutOfOrder { sequence, last } => {
                write!(f, "sequence {sequence} or its stamp does not follow the last accepted sample {last}")
            }
            Self::Jump { joint, off, most } => write!(
                f,
                "joint_position[{joint}] jumped by {off:.4} rad, accepted: at most {most:.4} rad since the sample before (twice \
                 limits.joint_speed_rad_s, 20 rad/s without it)"
            ),
            Self::Silence => f.write_str("no sample for longer than max_sample_age_s"),
        }
    }
}

/// What the samples so far say about order and rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleHistory {
    last: Option<Accepted>,
    /// First sample of the block of [`RATE_BLOCK`] over which the mean spacing is taken.
    block: Option<Accepted>,
    /// Mean spacing of the last complete block in s.
    mean_spacing: Option<f64>,
    /// Samples that never arrived, by gaps in the sequence.
    pub missed: u64,
    /// Samples whose spacing was outside T_s ± 10 %.
    pub irregular: u64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Accepted {
    boot_id: u64,
    sequence: u64,
    stamp: u64,
}

/// Largest magnitude of a value in its SI unit.
const LARGEST_VALUE: f64 = 1e6;
/// Samples over which the mean spacing is taken.
const RATE_BLOCK: u64 = 100;
/// Relative deviation of the mean spacing from T_s that refuses control.
const RATE_TOLERANCE: f64 = 0.01;
/// Relative deviation of one spacing from T_s that is counted.
const SPACING_TOLERANCE: f64 = 0.1;

impl SampleHistory {
    /// Nothing seen.
    pub fn new() -> Self {
        Self { last: None, block: None, mean_spacing: None, missed: 0, irregular: 0 }
    }

    /// Stamp of the last accepted sample in ns.
    pub fn last_stamp(&self) -> Option<u64> {
        self.last.map(|last| last.stamp)
    }

    /// Whether `sample` comes from another run of the motion controller than the last accepted one.
    pub fn is_new_run<const N: usize, const D: usize>(&self, sample: &Sample<N, D>) -> bool {
        self.last.is_none_or(|last| last.boot_id != sample.boot_id)
    }

    /// Mean spacing of the last 100 samples in s when it is off T_s by more than 1 %.
    pub fn wrong_rate(&self, timing: &Timing) -> Option<f64> {
        self.mean_spacing.filter(|mean| (mean / timing.sampling_time - 1.0).abs() > RATE_TOLERANCE)
    }

    /// Checks a sample against the clock `now` (ns) and the samples before it.
    ///
    /// # Errors
    /// The first fault found.
    pub fn check<const N: usize, const D: usize>(
        &self,
        sample: &Sample<N, D>,
        now: u64,
        timing: &Timing,
    ) -> Result<(), SampleFault> {
        if sample.joint_count as usize != N {
            return Err(SampleFault::JointCount { found: sample.joint_count, expected: N as u32 });
        }
        let age = now.saturating_sub(sample.stamp);
        if age > nanoseconds(timing.max_sample_age) {
            return Err(SampleFault::Stale { age });
        }
        let ahead = sample.stamp.saturating_sub(now);
        if ahead > nanoseconds(timing.sampling_time) {
            return Err(SampleFault::FromFuture { ahead });
        }
        if let Some(last) = self.last.filter(|last| last.boot_id == sample.boot_id)
            && (sample.sequence <= last.sequence || sample.stamp <= last.stamp)
        {
            return Err(SampleFault::OutOfOrder { sequence: sample.sequence, last: last.sequence });
        }
        let fields: [(Field, &[f64]); 5] = [
            (Field::JointPosition, sample.joint_position.as_slice()),
            (Field::JointVelocity, sample.joint_velocity.as_slice()),
            (Field::JointPositionReference, sample.joint_position_reference.as_slice()),
            (Field::TwistReference, sample.twist_reference.as_slice()),
            (Field::Wrench, sample.wrench.as_slice()),
        ];
        for (field, values) in fields {
            if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                return Err(SampleFault::NotFinite { field, index });
            }
            if let Some(index) = values.iter().position(|value| value.abs() > LARGEST_VALUE) {
                return Err(SampleFault::Implausible { field, index });
            }
        }
        if !sample.wrench_valid {
            return Err(SampleFault::WrenchInvalid);
        }
        sample.wrench_saturated.map_or(Ok(()), |index| Err(SampleFault::WrenchSaturated { index }))
    }

    /// Takes note of a sample that passed [`Self::check`].
    pub fn accept<const N: usize, const D: usize>(&mut self, sample: &Sample<N, D>, timing: &Timing) {
        let now = Accepted { boot_id: sample.boot_id, sequence: sample.sequence, stamp: sample.stamp };
        let longest = nanoseconds(timing.max_sample_age + timing.sampling_time);
        match self.last.filter(|last| last.boot_id == now.boot_id) {
            Some(last) => {
                let steps = now.sequence - last.sequence;
                // Two runs of the motion controller may both jump by nearly 2⁶⁴.
                self.missed = self.missed.saturating_add(steps - 1);
                let spacing = spacing(&last, &now);
                if (spacing / timing.sampling_time - 1.0).abs() > SPACING_TOLERANCE {
                    self.irregular += 1;
                }
                // A pause is not a rate.
                if now.stamp - last.stamp > longest {
                    self.block = None;
                }
            }
            None => (self.block, self.mean_spacing) = (None, None),
        }
        let start = *self.block.get_or_insert(now);
        if now.sequence - start.sequence >= RATE_BLOCK {
            self.mean_spacing = Some(spacing(&start, &now));
            self.block = Some(now);
        }
        self.last = Some(now);
    }
}

impl Default for SampleHistory {
    fn default() -> Self {
        Self::new()
    }
}

/// Mean time in s per sequence number between two accepted samples.
fn spacing(from: &Accepted, to: &Accepted) -> f64 {
    (to.stamp - from.stamp) as f64 * 1e-9 / (to.sequence - from.sequence) as f64
}
