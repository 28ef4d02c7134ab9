//! Quantities whose unit or frame must not be mixed up: instants and spans of time, the task axes,
//! and a raw wrench.

use core::cmp::Ordering;
use core::ops::{Add, Mul, Sub};

use admittance_vocabulary::TaskAxis;
use nalgebra::{SVector, Vector3, Vector6};

const NS_PER_S: f64 = 1e9;
/// Not 1 / [`NS_PER_S`] by division: a product rounds differently, and recordings are replayed to
/// the bit.
const S_PER_NS: f64 = 1e-9;

/// An instant of CLOCK_MONOTONIC, to the nanosecond.
///
/// ```
/// use admittance_core::quantities::{Instant, Span};
///
/// let stamp = Instant::from_nanoseconds(5_000_000);
/// assert_eq!(stamp + Span::from_seconds(0.004), Instant::from_nanoseconds(9_000_000));
/// assert_eq!((stamp + Span::from_seconds(0.004)).since(stamp).seconds(), 0.004);
/// // Time does not run backward: what is later is no time ago.
/// assert_eq!(stamp.since(stamp + Span::from_seconds(0.004)), Span::ZERO);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Instant(u64);

impl Instant {
    /// The instant at this reading of the clock in ns.
    pub const fn from_nanoseconds(nanoseconds: u64) -> Self {
        Self(nanoseconds)
    }

    /// The reading of the clock in ns.
    pub const fn nanoseconds(self) -> u64 {
        self.0
    }

    /// The time since an `earlier` instant; zero when that is later.
    pub fn since(self, earlier: Self) -> Span {
        Span::from_nanoseconds(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Span> for Instant {
    type Output = Self;

    /// Ends at the last instant that there is.
    fn add(self, span: Span) -> Self {
        Self(self.0.saturating_add(span.nanoseconds))
    }
}

impl Sub<Span> for Instant {
    type Output = Self;

    /// Ends at the first instant that there is.
    fn sub(self, span: Span) -> Self {
        Self(self.0.saturating_sub(span.nanoseconds))
    }
}

/// A length of time, not negative. Comparisons use whole nanoseconds, formulas the seconds that it
/// was made from.
#[derive(Debug, Clone, Copy, Default)]
pub struct Span {
    seconds: f64,
    nanoseconds: u64,
}

impl Span {
    /// No time.
    pub const ZERO: Self = Self { seconds: 0.0, nanoseconds: 0 };

    /// A span of `seconds`; negative values and NaN compare as zero.
    pub fn from_seconds(seconds: f64) -> Self {
        Self { seconds, nanoseconds: libm::round(seconds * NS_PER_S) as u64 }
    }

    /// So many nanoseconds.
    pub const fn from_nanoseconds(nanoseconds: u64) -> Self {
        Self { seconds: nanoseconds as f64 * S_PER_NS, nanoseconds }
    }

    /// In s.
    pub const fn seconds(self) -> f64 {
        self.seconds
    }

    /// In whole ns.
    pub const fn nanoseconds(self) -> u64 {
        self.nanoseconds
    }
}

impl Add for Span {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::from_nanoseconds(self.nanoseconds.saturating_add(other.nanoseconds))
    }
}

impl Sub for Span {
    type Output = Self;

    /// Zero when `other` is longer.
    fn sub(self, other: Self) -> Self {
        Self::from_nanoseconds(self.nanoseconds.saturating_sub(other.nanoseconds))
    }
}

impl Mul<f64> for Span {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self::from_seconds(self.seconds * factor)
    }
}

impl PartialEq for Span {
    fn eq(&self, other: &Self) -> bool {
        self.nanoseconds == other.nanoseconds
    }
}

impl Eq for Span {}

impl PartialOrd for Span {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Span {
    fn cmp(&self, other: &Self) -> Ordering {
        self.nanoseconds.cmp(&other.nanoseconds)
    }
}

/// Names of all task axes. The law's vectors have the first D of them: of x and y with D = 2, of all
/// with D = 6.
pub const AXIS_NAMES: [&str; TaskAxis::ALL.len()] = {
    let (mut names, mut axis) = ([""; TaskAxis::ALL.len()], 0);
    while axis < names.len() {
        names[axis] = TaskAxis::ALL[axis].name();
        axis += 1;
    }
    names
};

/// How many of them are linear (metres, newtons); the others are angular (radians, newton metres).
const LINEAR_AXES: usize = 3;

/// Whether a task axis is linear.
pub const fn is_linear(axis: usize) -> bool {
    axis < LINEAR_AXES
}

/// Unit of a wrench on a task axis.
pub const fn wrench_unit(axis: usize) -> &'static str {
    if is_linear(axis) { "N" } else { "N m" }
}

/// The component on a task axis of a quantity with a linear and an angular part.
pub(crate) fn component(linear: &Vector3<f64>, angular: &Vector3<f64>, axis: usize) -> f64 {
    if is_linear(axis) { linear[axis] } else { angular[axis - LINEAR_AXES] }
}

/// The linear and the angular part on the first D task axes.
pub fn on_task_axes<const D: usize>(linear: &Vector3<f64>, angular: &Vector3<f64>) -> SVector<f64, D> {
    SVector::from_fn(|axis, _| component(linear, angular, axis))
}

/// The task axes among the linear ones.
pub(crate) fn linear_axes<const D: usize>() -> core::ops::Range<usize> {
    0..D.min(LINEAR_AXES)
}

/// A wrench as the motion controller gives it: forces x y z in N, then torques in N·m, in a frame,
/// with a sign and with a bias that only [`Conditioning`](crate::intake::Conditioning) knows. The
/// law does not accept one: it takes f̂.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenWrench(pub Vector6<f64>);

/// The wrench that the robot exerts on the environment at the TCP, base frame: forces x y z in N,
/// then torques in N·m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseWrench(pub Vector6<f64>);

impl BaseWrench {
    /// Its components on the first D task axes.
    pub fn on_task_axes<const D: usize>(&self) -> SVector<f64, D> {
        SVector::from_fn(|axis, _| self.0[axis])
    }
}
