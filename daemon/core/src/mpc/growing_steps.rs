//! Step lengths for a horizon that is not given: a fast cycle needs one as long in time as a slow
//! one.

use crate::output::MAX_STEPS;

/// Longest horizon of [`growing_steps`].
pub const GROWING_STEPS: usize = 16;
/// How many of them are as long as the first.
const EVEN_STEPS: usize = 4;

/// At most 16 step lengths in s that span `span` s: the first four are one sampling time each, the
/// others grow by a constant ratio; if even steps reach as far, fewer of those. A fast cycle needs
/// a horizon as long in time as a slow one.
pub fn growing_steps(sampling_time: f64, span: f64) -> ([f64; MAX_STEPS], usize) {
    let mut steps = [0.0; MAX_STEPS];
    let even = libm::ceil(span / sampling_time - 1e-9).max(EVEN_STEPS as f64);
    if even <= GROWING_STEPS as f64 {
        steps.fill(sampling_time);
        return (steps, even as usize);
    }
    let growing = |ratio: f64| {
        (1..=GROWING_STEPS - EVEN_STEPS).fold((1.0, 0.0), |(length, sum), _| (length * ratio, sum + length * ratio)).1
    };
    let missing = span / sampling_time - EVEN_STEPS as f64;
    let (mut low, mut high) = (1.0, 100.0);
    for _ in 0..60 {
        let ratio = (low + high) / 2.0;
        if growing(ratio) < missing { low = ratio } else { high = ratio }
    }
    let mut length = sampling_time;
    for (index, step) in steps[..GROWING_STEPS].iter_mut().enumerate() {
        if index >= EVEN_STEPS {
            length *= low;
        }
        *step = length;
    }
    (steps, GROWING_STEPS)
}
