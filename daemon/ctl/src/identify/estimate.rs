//! A number that was found, and how far it may be off.

use serde::Serialize;

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Estimate {
    pub(super) value: f64,
    /// Half of the interval.
    pub(super) half_width: f64,
}

impl Estimate {
    pub(super) fn new(value: f64, half_width: f64) -> Self {
        Self { value, half_width }
    }

    /// The same with more doubt, of another origin.
    #[must_use]
    pub(super) fn doubted(self, half_width: f64) -> Self {
        Self { half_width: self.half_width.hypot(half_width), ..self }
    }

    /// Whether it is more than zero for certain.
    pub(super) fn is_there(&self) -> bool {
        self.value > self.half_width
    }

    /// The mean of several, each by how certain it is. What they disagree by is doubt as well.
    pub(super) fn mean(of: &[Self]) -> Option<Self> {
        // One that may be anything has no weight.
        let weight = |one: &Self| {
            if one.half_width.is_finite() { 1.0 / (one.half_width * one.half_width).max(1e-300) } else { 0.0 }
        };
        let sum: f64 = of.iter().map(weight).sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let value = of.iter().map(|one| weight(one) * one.value).sum::<f64>() / sum;
        // In half widths: 1 is what is expected of them.
        let apart = of.iter().map(|one| weight(one) * (one.value - value).powi(2)).sum::<f64>();
        let expected = 0.26 * (of.iter().filter(|one| weight(one) > 0.0).count() as f64 - 1.0);
        let factor = if expected > 0.0 { (apart / expected).sqrt().max(1.0) } else { 1.0 };
        Some(Self { value, half_width: factor / sum.sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_disagrees_is_doubted() {
        let mean = |values: &[(f64, f64)]| {
            let all: Vec<Estimate> = values.iter().map(|(value, half)| Estimate::new(*value, *half)).collect();
            Estimate::mean(&all)
        };
        assert_eq!(mean(&[]), None);
        let agreeing = mean(&[(1.0, 0.1), (1.04, 0.1)]).expect("a mean");
        assert!((agreeing.value - 1.02).abs() < 1e-12 && (agreeing.half_width - 0.1 / 2f64.sqrt()).abs() < 1e-9);
        let apart = mean(&[(1.0, 0.1), (2.0, 0.1)]).expect("a mean");
        assert!(apart.half_width > 0.5, "{apart:?}");
        assert_eq!(mean(&[(1.0, f64::INFINITY), (2.0, f64::NAN)]), None);
        let one = mean(&[(1.0, f64::INFINITY), (2.0, 0.1)]).expect("a mean");
        assert!((one.value - 2.0).abs() < 1e-12 && (one.half_width - 0.1).abs() < 1e-9, "{one:?}");
    }
}
