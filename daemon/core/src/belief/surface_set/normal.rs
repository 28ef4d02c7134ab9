//! The normal distribution.

/// The probability that a normal error with this standard deviation is more than `excess`.
pub(super) fn above(excess: f64, deviation: f64) -> f64 {
    if deviation > 0.0 {
        0.5 * libm::erfc(excess / (deviation * core::f64::consts::SQRT_2))
    } else if excess < 0.0 {
        1.0
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_normal_distribution() {
        assert!((above(0.0, 2.0) - 0.5).abs() < 1e-15);
        assert!((above(2.0, 2.0) - 0.158_655_253_931_457).abs() < 1e-12);
        assert_eq!((above(-1.0, 0.0), above(1.0, 0.0)), (1.0, 0.0));
    }
}
