//! The joint speed loops: how q̇ follows its reference r.

use nalgebra::SVector;

use crate::quantities::Span;

/// Speed loops of N joints. Of first order they are (4), T_V q̈ + q̇ = r; of second order
/// q⃛ / ω² + 2 ζ q̈ / ω + q̇ = r.
///
/// ```
/// use admittance_core::robot::VelocityLoops;
/// use nalgebra::Vector2;
///
/// let mut loops = VelocityLoops::first_order(Vector2::new(0.015, 0.010));
/// loops.damping[1] = 0.5f64.sqrt();
/// // A Butterworth filter: −3 dB at ω.
/// assert!((loops.frequency(1).expect("of second order") - 100.0).abs() < 1e-9);
/// assert_eq!(loops.frequency(0), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityLoops<const N: usize> {
    /// T_V in s, above zero. Of a loop of second order 1/T_V is the bandwidth at −3 dB.
    pub time_constant: SVector<f64, N>,
    /// ζ of a loop of second order; 0 of one of first order.
    pub damping: SVector<f64, N>,
    /// Time in s that a reference takes to reach the loop.
    pub dead_time: SVector<f64, N>,
    /// Time constant in s with which the reported q̇ lags behind the true one.
    pub report_lag: f64,
}

impl<const N: usize> VelocityLoops<N> {
    /// Loops of first order with the time constants T_V in s, without dead time.
    pub fn first_order(time_constant: SVector<f64, N>) -> Self {
        Self { time_constant, damping: SVector::zeros(), dead_time: SVector::zeros(), report_lag: 0.0 }
    }

    /// ω of a joint's loop in rad/s; `None` of a loop of first order.
    pub fn frequency(&self, joint: usize) -> Option<f64> {
        let (bandwidth, damping) = (1.0 / self.time_constant[joint], self.damping[joint]);
        // |1/(1 − x² + 2ζx i)|² = 1/2 at x = bandwidth/ω: x² = 1 − 2ζ² + √((1 − 2ζ²)² + 1).
        let a = 1.0 - 2.0 * damping * damping;
        (damping > 0.0).then(|| bandwidth / libm::sqrt(a + libm::hypot(a, 1.0)))
    }

    /// The dead time in s that all joints have at least.
    pub fn common_dead_time(&self) -> f64 {
        self.dead_time.min()
    }

    /// Dead time in s beyond the common one.
    pub fn further_dead_time(&self) -> SVector<f64, N> {
        self.dead_time.map(|dead_time| dead_time - self.common_dead_time())
    }

    /// The dead time of each joint.
    pub(crate) fn dead_times(&self) -> [Span; N] {
        core::array::from_fn(|joint| Span::from_seconds(self.dead_time[joint]))
    }

    /// Whether every loop is (4), but for a dead time that all joints have.
    pub fn is_plain(&self) -> bool {
        self.damping.iter().all(|damping| *damping == 0.0) && self.further_dead_time().max() == 0.0
    }

    /// Whether q̇ and q̈ have to be estimated: q̈ is not reported, and q̇ may lag behind.
    pub fn needs_estimate(&self) -> bool {
        self.report_lag > 0.0 || self.damping.iter().any(|damping| *damping > 0.0)
    }

    /// How much further, in s, a joint moves by each unit of q̇ (s), of q̈ (s²), and of the
    /// reference that is in its dead time (s), until it rests under zero reference.
    pub fn until_rest(&self) -> [SVector<f64, N>; 3] {
        let frequency: SVector<f64, N> = SVector::from_fn(|joint, _| self.frequency(joint).unwrap_or(0.0));
        let by_velocity = |joint: usize, _| match frequency[joint] {
            0.0 => self.time_constant[joint],
            omega => 2.0 * self.damping[joint] / omega,
        };
        let by_acceleration = |omega: f64| if omega > 0.0 { 1.0 / (omega * omega) } else { 0.0 };
        [SVector::from_fn(by_velocity), frequency.map(by_acceleration), self.further_dead_time()]
    }

    /// The slowest decay of a loop, as a time constant in s.
    pub fn slowest(&self) -> f64 {
        let slowest = |joint: usize| match self.frequency(joint) {
            None => self.time_constant[joint],
            Some(omega) => {
                let (sigma, square) = (self.damping[joint] * omega, self.damping[joint] * self.damping[joint] - 1.0);
                1.0 / (sigma - if square > 0.0 { omega * libm::sqrt(square) } else { 0.0 })
            }
        };
        (0..N).map(slowest).fold(0.0, f64::max)
    }
}
