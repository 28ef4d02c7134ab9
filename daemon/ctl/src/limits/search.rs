//! The highest safe speed, by bisection, when safety is nearly but not quite monotone in the speed.

use crate::parallel::{Progress, map_within};

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

/// What a speed has to be safe in: instants of contact, or worlds.
pub(crate) struct Cases<Try> {
    /// How many.
    pub(crate) count: u64,
    /// How many are tried at a time.
    pub(crate) threads: usize,
    /// Whether a speed in m/s is safe in the case with this number.
    pub(crate) try_case: Try,
}

/// What one case showed.
type Tried<Why> = Result<Result<(), Why>, String>;

impl<Try> Cases<Try> {
    /// Tries a speed in all cases, or up to the first in which it is not safe. Most agree: that one is
    /// tried first at the next speed, and `first` is its number.
    fn all<Why: Send>(&self, speed_m_s: f64, first: &mut u64) -> Tried<Why>
    where
        Try: Fn(f64, u64) -> Tried<Why> + Sync,
    {
        let (mut turn, silent) = (0, Progress::silent());
        while turn < self.count {
            // The others are begun together, but few at a time, lest many are tried in vain.
            let together = if turn == 0 { 1 } else { self.threads as u64 }.min(self.count - turn);
            let case = |index: u64| (*first + turn + index) % self.count;
            let tried = map_within(&silent, together, self.threads, |index| (self.try_case)(speed_m_s, case(index)))?;
            for (index, found) in (0..).zip(tried) {
                if let Err(why) = found {
                    *first = case(index);
                    return Ok(Err(why));
                }
            }
            turn += together;
        }
        Ok(Ok(()))
    }
}

/// About how many cases a search tries, of so many: all of them at the lowest speed, at half of
/// those that it bisects and at most of those below the answer, and else one.
pub(crate) fn expected_tries(cases: u64) -> u64 {
    9 * cases + 8
}

/// Searches from [`LOWEST_M_S`] to `highest_m_s`.
///
/// # Errors
/// Those of a case.
pub(crate) fn highest_safe<Why: Send, Try>(highest_m_s: f64, cases: &Cases<Try>) -> Result<Found<Why>, String>
where
    Try: Fn(f64, u64) -> Tried<Why> + Sync,
{
    let mut first = 0;
    let mut try_speed = |speed_m_s: f64| cases.all(speed_m_s, &mut first);
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

    fn search(highest: f64, is_safe: impl Fn(f64) -> bool + Sync) -> Found<()> {
        in_cases(highest, 1, |speed, _| is_safe(speed))
    }

    fn in_cases(highest: f64, count: u64, is_safe: impl Fn(f64, u64) -> bool + Sync) -> Found<()> {
        let try_case = |speed: f64, case: u64| Ok(if is_safe(speed, case) { Ok(()) } else { Err(()) });
        highest_safe(highest, &Cases { count, threads: 2, try_case }).unwrap()
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

    /// Each case with a boundary of its own: the case that leads at first is not the one that counts.
    #[test]
    fn the_answer_is_safe_in_all_cases() {
        for seed in 0..20_u64 {
            let boundary = |case: u64| 0.05 + ((case * 7 + seed * 3) % 23) as f64 * 0.02;
            // Case 0 is unsafe at the highest speeds alone, and the first that is found.
            let is_safe = |speed: f64, case: u64| if case == 0 { speed < 2.0 } else { speed <= boundary(case) };
            let least = (1..23).map(boundary).fold(f64::INFINITY, f64::min);
            let found = in_cases(3.0, 23, is_safe);
            let (beyond, ()) = found.beyond.unwrap();
            assert!(found.safe_m_s <= least && least < beyond && !found.lowered, "{found:?}, {least}");
            assert!(beyond <= found.safe_m_s * 1.02, "{found:?}");
        }
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let with = |threads| {
            let try_case = |speed: f64, case: u64| {
                let is_safe = speed <= 0.2 + ((case * 37 + 11) % 50) as f64 * 0.01;
                Ok(if is_safe { Ok(()) } else { Err(case) })
            };
            highest_safe(3.0, &Cases { count: 50, threads, try_case }).unwrap()
        };
        assert_eq!(with(1), with(7));
        assert!(with(7).beyond.is_some());
    }

    #[test]
    fn about_as_many_cases_are_tried_as_are_expected() {
        for (boundary, count) in [(0.4, 100), (0.07, 100), (1.3, 16)] {
            let tries = std::sync::atomic::AtomicU64::new(0);
            in_cases(3.0, count, |speed, _| {
                tries.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                speed <= boundary
            });
            let share = tries.into_inner() as f64 / expected_tries(count) as f64;
            assert!((0.8..1.25).contains(&share), "{share} of those expected, at {boundary} m/s");
        }
    }

    #[test]
    fn an_error_is_passed_on() {
        let cases = Cases { count: 1, threads: 1, try_case: |_, _| Err::<Result<(), ()>, _>("broken".to_owned()) };
        assert_eq!(highest_safe(3.0, &cases), Err("broken".to_owned()));
    }

    #[test]
    fn digits_are_significant_ones() {
        assert_eq!(round_to_digits(0.123456, 3), 0.123);
        assert_eq!(round_to_digits(1.23456, 3), 1.23);
        assert_eq!(round_to_digits(123456.0, 3), 123000.0);
        assert_eq!(round_to_digits(0.0, 3), 0.0);
    }
}
