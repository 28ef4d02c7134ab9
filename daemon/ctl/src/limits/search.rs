//! The highest safe speed, by bisection, when safety is nearly but not quite monotone in the speed.

/// Lowest speed that is tried, in m/s.
pub(crate) const LOWEST_M_S: f64 = 0.01;
/// Ratio of the lowest speed known to be unsafe to the answer at which the search ends.
pub(crate) const RESOLUTION: f64 = 1.015;
/// Shares of the answer at which, or near which, speeds have to be safe as well.
const CHECKED_BELOW: [f64; 5] = [0.95, 0.9, 0.8, 0.65, 0.5];
/// How near, as a share of the speed: within it a speed that the bisection tried counts.
const NEAR: f64 = 0.02;

/// What the search found; `Why` says why a speed is not safe.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Found<Why> {
    /// The highest speed in m/s that was tried and is safe; 0 when the lowest one is not.
    pub(crate) safe_m_s: f64,
    /// The next higher speed that was tried and is not; `None` when the highest one is safe.
    pub(crate) beyond: Option<(f64, Why)>,
    /// Whether a higher speed was safe although a lower one was not.
    pub(crate) lowered: bool,
}

/// Searches from [`LOWEST_M_S`] to `highest_m_s`.
///
/// # Errors
/// Those of `try_speed`.
pub(crate) fn highest_safe<Why>(
    highest_m_s: f64,
    mut try_speed: impl FnMut(f64) -> Result<Result<(), Why>, String>,
) -> Result<Found<Why>, String> {
    let lowest = LOWEST_M_S.min(highest_m_s);
    if let Err(why) = try_speed(lowest)? {
        return Ok(Found { safe_m_s: 0.0, beyond: Some((lowest, why)), lowered: false });
    }
    let (mut safe, mut beyond) = match try_speed(highest_m_s)? {
        Ok(()) => (highest_m_s, None),
        Err(why) => (lowest, Some((highest_m_s, why))),
    };
    let (mut lowered, mut known_safe) = (false, Vec::new());
    loop {
        while let Some((unsafe_speed, _)) = &beyond {
            let middle = round_to_digits((safe * unsafe_speed).sqrt(), 3);
            if *unsafe_speed <= safe * RESOLUTION || middle <= safe || middle >= *unsafe_speed {
                break;
            }
            match try_speed(middle)? {
                Ok(()) => {
                    safe = middle;
                    known_safe.push(middle);
                }
                Err(why) => beyond = Some((middle, why)),
            }
        }
        let mut failed = None;
        for share in CHECKED_BELOW {
            let speed = round_to_digits(safe * share, 3);
            if speed <= lowest || known_safe.iter().any(|known: &f64| (known - speed).abs() <= NEAR * speed) {
                continue;
            }
            match try_speed(speed)? {
                Ok(()) => known_safe.push(speed),
                Err(why) => {
                    failed = Some((speed, why));
                    break;
                }
            }
        }
        // Each round ends below the one before, so this terminates.
        if failed.is_none() {
            return Ok(Found { safe_m_s: safe, beyond, lowered });
        }
        (safe, beyond, lowered) = (lowest, failed, true);
    }
}

/// `value` with this many significant digits: the printed speed is the one that was tried.
pub(crate) fn round_to_digits(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let decimals = digits - 1 - value.abs().log10().floor() as i32;
    let scale = 10f64.powi(decimals.abs());
    // Dividing by a power of ten is exact where multiplying by its inverse is not.
    if decimals >= 0 { (value * scale).round() / scale } else { (value / scale).round() * scale }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(highest: f64, is_safe: impl Fn(f64) -> bool) -> Found<()> {
        highest_safe(highest, |speed| Ok(if is_safe(speed) { Ok(()) } else { Err(()) })).unwrap()
    }

    #[test]
    fn the_boundary_is_found_to_the_resolution() {
        for boundary in [0.0123, 0.1, 0.4567, 0.998, 1.01, 2.9] {
            let found = search(3.0, |speed| speed <= boundary);
            let (beyond, ()) = found.beyond.unwrap();
            assert!(found.safe_m_s <= boundary && beyond > boundary && !found.lowered);
            assert!(beyond <= found.safe_m_s * 1.02, "{boundary}: {} {beyond}", found.safe_m_s);
        }
    }

    #[test]
    fn the_ends_of_the_range_are_answers() {
        assert_eq!(search(3.0, |_| true), Found { safe_m_s: 3.0, beyond: None, lowered: false });
        assert_eq!(search(3.0, |_| false), Found { safe_m_s: 0.0, beyond: Some((0.01, ())), lowered: false });
        assert_eq!(search(0.004, |_| true).safe_m_s, 0.004);
    }

    #[test]
    fn an_unsafe_speed_below_lowers_the_answer() {
        let found = search(3.0, |speed| speed <= 0.5 || (0.55..=0.8).contains(&speed));
        assert!((0.49..=0.5).contains(&found.safe_m_s) && found.lowered, "{}", found.safe_m_s);
    }

    #[test]
    fn an_error_is_passed_on() {
        assert_eq!(highest_safe::<()>(3.0, |_| Err("broken".to_owned())), Err("broken".to_owned()));
    }

    #[test]
    fn digits_are_significant_ones() {
        assert_eq!(round_to_digits(0.123456, 3), 0.123);
        assert_eq!(round_to_digits(1.23456, 3), 1.23);
        assert_eq!(round_to_digits(123456.0, 3), 123000.0);
        assert_eq!(round_to_digits(0.0, 3), 0.0);
    }
}
