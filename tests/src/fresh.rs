//! A seed that nobody has chosen, beside those that a test has.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::SystemTime;

use crate::machine::say;

/// Names the seed of what was found.
const SEED: &str = "ADMITTANCE_TESTS_SEED";

/// Checks with a fresh seed. What fails is printed as FOUND, and doesn't fail the test: the change that is
/// tested did not bring it about. With the seed told by `ADMITTANCE_TESTS_SEED` it does.
///
/// # Panics
/// As `check` does, with a seed that is told; and when that is no number.
pub fn fresh(check: impl FnOnce(u64)) {
    if let Ok(told) = std::env::var(SEED) {
        return check(told.parse().unwrap_or_else(|_| panic!("{SEED} = {told}: accepted: a whole number")));
    }
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("after 1970");
    let seed = u64::from(now.subsec_nanos());
    if catch_unwind(AssertUnwindSafe(|| check(seed))).is_err() {
        let test = std::thread::current().name().unwrap_or("test").to_owned();
        say(&format!("FOUND: {SEED}={seed} cargo test --release {test}"));
    }
}

/// The share of a whole, 0 to 1, with a number among those of a seed.
pub fn share(seed: u64, index: u64) -> f64 {
    // The golden ratio spreads them evenly, whatever the seed.
    const STEP: f64 = 0.618_033_988_749_894_9;
    ((seed % 1_000_000) as f64 * 1e-6 + index as f64 * STEP).fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_fresh_seed_finds_does_not_fail_the_test() {
        let mut seen = 0;
        fresh(|_| {
            seen += 1;
            assert!(seen > 1, "found");
        });
        assert_eq!(seen, 1);
        let shares: Vec<f64> = (0..100).map(|index| share(123_456_789, index)).collect();
        let most_apart = |mut shares: Vec<f64>| {
            shares.sort_by(f64::total_cmp);
            shares.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
        };
        assert!(shares.iter().all(|share| (0.0..1.0).contains(share)) && most_apart(shares) < 0.03);
    }
}
