//! The wrench estimate, equation (6): each axis of the true wrench through a first-order lag T_est,
//! then a pure delay.

use nalgebra::SVector;
use std::collections::VecDeque;

/// First-order estimate of the wrench on D task axes, in N and N m.
#[derive(Debug, Clone, PartialEq)]
pub struct WrenchEstimate<const D: usize> {
    time_constant_s: SVector<f64, D>,
    estimate: SVector<f64, D>,
    truth: SVector<f64, D>,
}

/// The effect of an interval on the estimate; it depends on the interval's length alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimateStep<const D: usize> {
    /// e^(−h/T) per axis; 0 for an ideal axis.
    decay: SVector<f64, D>,
    /// (T/h)(1 − e^(−h/T)) per axis: the share of the interval's change that is still missing at
    /// its end.
    missing: SVector<f64, D>,
}

impl<const D: usize> WrenchEstimate<D> {
    /// An estimate at rest without any force; a time constant (s) of 0 is an ideal measurement:
    /// f̂ = f.
    pub fn new(time_constant_s: SVector<f64, D>) -> Self {
        Self { time_constant_s, estimate: SVector::zeros(), truth: SVector::zeros() }
    }

    /// The step of an interval of `duration_s` above zero.
    pub fn step(&self, duration_s: f64) -> EstimateStep<D> {
        let lost = self.time_constant_s.map(|tau| if tau > 0.0 { -(-duration_s / tau).exp_m1() } else { 1.0 });
        EstimateStep {
            decay: lost.map(|lost| 1.0 - lost),
            missing: lost.component_mul(&self.time_constant_s) / duration_s,
        }
    }

    /// Advances the estimate over an interval in which the true wrench goes in a straight line to
    /// `truth`; exact for that.
    pub fn advance(&mut self, step: &EstimateStep<D>, truth: &SVector<f64, D>) {
        let error = self.estimate - self.truth;
        self.estimate = truth + error.component_mul(&step.decay) - (truth - self.truth).component_mul(&step.missing);
        self.truth = *truth;
    }

    /// Lets the true wrench jump by so much at this instant.
    pub fn jump(&mut self, by: &SVector<f64, D>) {
        self.truth += by;
    }

    /// f̂ in N and N m.
    pub fn estimate(&self) -> &SVector<f64, D> {
        &self.estimate
    }

    /// Whether the estimate and the truth behind it are exactly zero.
    pub fn is_zero(&self) -> bool {
        self.estimate.iter().chain(self.truth.iter()).all(|value| *value == 0.0)
    }
}

/// A pure delay of a signal sampled at uneven instants; between them it is a straight line, before
/// the first it is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayLine<const D: usize> {
    delay_ns: u64,
    history: VecDeque<(u64, SVector<f64, D>)>,
}

impl<const D: usize> DelayLine<D> {
    /// A delay of `delay_ns` that is given at most `capacity` values in any interval of that
    /// length; it never allocates again.
    pub fn new(delay_ns: u64, capacity: usize) -> Self {
        Self { delay_ns, history: VecDeque::with_capacity(capacity + 2) }
    }

    /// Whether there is no delay at all: then nothing needs to be pushed.
    pub fn is_none(&self) -> bool {
        self.delay_ns == 0
    }

    /// Adds the value at an instant, later than all before it.
    pub fn push(&mut self, now_ns: u64, value: &SVector<f64, D>) {
        let oldest = now_ns.saturating_sub(self.delay_ns);
        // Two values bracket the delayed instant: earlier ones are never needed again.
        while self.history.len() > 1 && self.history[1].0 <= oldest {
            self.history.pop_front();
        }
        if self.history.len() == self.history.capacity() {
            self.history.pop_front();
        }
        self.history.push_back((now_ns, *value));
    }

    /// The value of `delay_ns` before `now_ns`, the instant of the last push.
    pub fn delayed(&self, now_ns: u64) -> SVector<f64, D> {
        let Some(instant) = now_ns.checked_sub(self.delay_ns) else { return SVector::zeros() };
        let next = self.history.partition_point(|(stamp, _)| *stamp <= instant);
        if next == 0 {
            return SVector::zeros();
        }
        let (start_ns, start) = &self.history[next - 1];
        match self.history.get(next) {
            None => *start,
            Some((end_ns, end)) => start + (end - start) * ((instant - start_ns) as f64 / (end_ns - start_ns) as f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector1, Vector2};

    #[test]
    fn ramp_response_is_the_analytic_one() {
        // f = r t: f̂ = r (t − T + T e^(−t/T)).
        let (tau, rate, end) = (0.020, 5000.0, 0.031);
        for steps in [1, 13, 620] {
            let mut estimate = WrenchEstimate::new(Vector2::new(tau, 0.0));
            let step = estimate.step(end / f64::from(steps));
            for index in 1..=steps {
                let truth = rate * end * f64::from(index) / f64::from(steps);
                estimate.advance(&step, &Vector2::new(truth, truth));
            }
            let expected = rate * (end - tau + tau * (-end / tau).exp());
            assert!((estimate.estimate()[0] - expected).abs() < 1e-9, "{steps} steps: {}", estimate.estimate()[0]);
            assert_eq!(estimate.estimate()[1], rate * end, "an ideal axis follows at once");
        }
    }

    #[test]
    fn decay_after_release_is_exponential() {
        let mut estimate = WrenchEstimate::new(Vector1::new(0.020));
        let (rise, fall) = (estimate.step(0.5), estimate.step(0.030));
        estimate.advance(&rise, &Vector1::new(100.0));
        estimate.advance(&rise, &Vector1::new(100.0));
        let before = estimate.estimate()[0];
        // A drop within one nanosecond, then zero.
        let jump = estimate.step(1e-9);
        estimate.advance(&jump, &Vector1::new(0.0));
        estimate.advance(&fall, &Vector1::new(0.0));
        assert!((estimate.estimate()[0] / before - (-1.5f64).exp()).abs() < 1e-7);
        assert!(!estimate.is_zero());
    }

    #[test]
    fn delay_line_gives_the_past_and_does_not_grow() {
        let mut line = DelayLine::<1>::new(1_000, 12);
        let capacity = line.history.capacity();
        for instant in (0..20_000u64).step_by(90) {
            line.push(instant, &Vector1::new(instant as f64 * 2.0));
            let expected = if instant < 1_000 { 0.0 } else { (instant - 1_000) as f64 * 2.0 };
            assert!((line.delayed(instant)[0] - expected).abs() < 1e-9, "at {instant}");
        }
        assert_eq!(line.history.capacity(), capacity);
    }
}
