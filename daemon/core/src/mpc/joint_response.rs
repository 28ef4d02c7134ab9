//! What a joint's speed loop does over a stretch of constant reference, and what a wrench estimate
//! shows of it, in closed form.

use crate::robot::VelocityLoops;

/// A speed loop: (4), or of second order q⃛ + 2σ q̈ + ω² (q̇ − r) = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Order {
    /// T_V in s.
    First { lag: f64 },
    /// ω² in 1/s², and σ = ζω in 1/s.
    Second { square: f64, sigma: f64 },
}

impl Order {
    /// Of a joint.
    pub(super) fn of<const N: usize>(loops: &VelocityLoops<N>, joint: usize) -> Self {
        loops.frequency(joint).map_or(Self::First { lag: loops.time_constant[joint] }, |omega| Self::Second {
            square: omega * omega,
            sigma: loops.damping[joint] * omega,
        })
    }
}

/// The motion of a joint over a stretch: of q, and of q̇ and q̈ (0 and 1), by q̇ and q̈ at its
/// start and by the reference; and, of two stretches, by the earlier one's reference.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Motion {
    pub(super) position_by: [f64; 2],
    pub(super) position_by_earlier: f64,
    pub(super) position_by_reference: f64,
    pub(super) carried_by: [[f64; 2]; 2],
    pub(super) carried_by_earlier: [f64; 2],
    pub(super) carried_by_reference: [f64; 2],
}

impl Motion {
    /// Over `t` s under one reference.
    pub(super) fn over(t: f64, order: Order) -> Self {
        let (position_by, carried_by, by_reference) = match order {
            Order::First { lag } => {
                let gain = -libm::expm1(-t / lag);
                ([lag * gain, 0.0], [[libm::exp(-t / lag), 0.0], [0.0; 2]], [gain, 0.0])
            }
            Order::Second { square, sigma } => {
                // The impulse response s of 1/(p² + 2σp + ω²), and its derivative.
                let (slope, s) = impulse_response(t, square, sigma);
                let decay = slope + 2.0 * sigma * s;
                let by_acceleration = (1.0 - decay) / square;
                let position_by = [s + 2.0 * sigma * by_acceleration, by_acceleration];
                (position_by, [[decay, s], [-square * s, slope]], [1.0 - decay, square * s])
            }
        };
        Self {
            position_by,
            // q̇ and r together move a joint by t.
            position_by_reference: t - position_by[0],
            carried_by,
            carried_by_reference: by_reference,
            ..Self::default()
        }
    }

    /// This stretch, and then `next` under another reference.
    pub(super) fn then(&self, next: &Self) -> Self {
        let through = |by: [f64; 2]| {
            let to = |row: usize| next.carried_by[row][0] * by[0] + next.carried_by[row][1] * by[1];
            [to(0), to(1)]
        };
        let moved = |by: [f64; 2]| next.position_by[0] * by[0] + next.position_by[1] * by[1];
        let column = |from: usize| [self.carried_by[0][from], self.carried_by[1][from]];
        let (by_velocity, by_acceleration) = (through(column(0)), through(column(1)));
        Self {
            position_by: [0, 1].map(|from| self.position_by[from] + moved(column(from))),
            position_by_earlier: self.position_by_reference + moved(self.carried_by_reference),
            position_by_reference: next.position_by_reference,
            carried_by: [0, 1].map(|to| [by_velocity[to], by_acceleration[to]]),
            carried_by_earlier: through(self.carried_by_reference),
            carried_by_reference: next.carried_by_reference,
        }
    }
}

/// What a first-order filter of q, at rest at q's start, shows at the end of a stretch.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Estimate {
    pub(super) by: [f64; 2],
    pub(super) by_earlier: f64,
    pub(super) by_reference: f64,
    /// What is left of an error.
    decay: f64,
}

impl Estimate {
    /// Over `t` s with the time constant `lag` (s), of a joint that does `motion` meanwhile.
    pub(super) fn over(t: f64, order: Order, lag: f64, motion: &Motion) -> Self {
        if lag <= 0.0 {
            let (by, by_reference) = (motion.position_by, motion.position_by_reference);
            return Self { by, by_reference, ..Self::default() };
        }
        let gain = -libm::expm1(-t / lag);
        let by = match order {
            Order::First { lag: joint_lag } => [first_order(t, joint_lag, lag), 0.0],
            Order::Second { square, sigma } => {
                // The filtered impulse response u; W u' = s − u, and 1/(pD) = (1/p − (p +
                // 2σ)/D)/ω².
                let u = filtered_impulse(t, square, sigma, lag);
                let slope = (motion.carried_by[0][1] - u) / lag;
                let by_acceleration = (gain - slope - 2.0 * sigma * u) / square;
                [u + 2.0 * sigma * by_acceleration, by_acceleration]
            }
        };
        Self { by, by_reference: t - lag * gain - by[0], decay: libm::exp(-t / lag), ..Self::default() }
    }

    /// This stretch, in which the joint did `motion`, and then `next`.
    pub(super) fn then(&self, motion: &Motion, next: &Self) -> Self {
        // The filter goes on towards where q was at the start of the second.
        let of = |filtered: f64, position: f64, carried: [f64; 2]| {
            let moved = next.by[0] * carried[0] + next.by[1] * carried[1];
            next.decay * filtered + (1.0 - next.decay) * position + moved
        };
        let from = |from: usize| {
            let carried = [motion.carried_by[0][from], motion.carried_by[1][from]];
            of(self.by[from], motion.position_by[from], carried)
        };
        Self {
            by: [from(0), from(1)],
            by_earlier: of(self.by_reference, motion.position_by_reference, motion.carried_by_reference),
            by_reference: next.by_reference,
            decay: self.decay * next.decay,
        }
    }
}

/// The filtered response of a loop with the time constant T: that of its position to q̇ = 1, a(s) =
/// T (1 − exp(−s/T)), filtered with W over t: T (1 − exp(−t/W) − I), I = 1/W ∫₀ᵗ exp(−(t − s)/W)
/// exp(−s/T) ds.
fn first_order(t: f64, joint_lag: f64, lag: f64) -> f64 {
    // I = t/W exp(−t/W) (exp(x) − 1) / x with x = t/W − t/T; and the same from the slower
    // exponential, so that nothing overflows. At W = T the quotient is 1.
    let x = t / lag - t / joint_lag;
    let slower = libm::exp(-t / lag.max(joint_lag));
    let quotient = if x == 0.0 { 1.0 } else { -libm::expm1(-x.abs()) / x.abs() };
    joint_lag * (-libm::expm1(-t / lag) - t / lag * slower * quotient)
}

/// s' and s at `t`, s the response of 1/(p² + 2σp + ω²) to an impulse.
fn impulse_response(t: f64, square: f64, sigma: f64) -> (f64, f64) {
    let split = square - sigma * sigma;
    let (fading, x) = (libm::exp(-sigma * t), split * t * t);
    let (cosine, sine) = if x.abs() < 1e-4 {
        (fading * (1.0 - x / 2.0 + x * x / 24.0), fading * t * (1.0 - x / 6.0 + x * x / 120.0))
    } else if split > 0.0 {
        let root = libm::sqrt(split);
        (fading * libm::cos(root * t), fading * libm::sin(root * t) / root)
    } else {
        // Much damping would overflow where the two factors are apart.
        let root = libm::sqrt(-split);
        let (slow, fast) = (libm::exp((root - sigma) * t), libm::exp((-root - sigma) * t));
        (0.5 * (slow + fast), 0.5 * (slow - fast) / root)
    };
    (cosine - sigma * sine, sine)
}

/// The impulse response s at `t`, filtered with the time constant W = `lag`: 1/W times the divided
/// difference of exp(p t) over the two poles of the loop and −1/W.
fn filtered_impulse(t: f64, square: f64, sigma: f64, lag: f64) -> f64 {
    // Poles as seen from −σ: ±i√split and `filter`.
    let (split, filter) = (square - sigma * sigma, sigma - 1.0 / lag);
    let root = libm::sqrt(split.abs());
    if filter.abs().max(root) * t <= 1.0 {
        // Close together in the time t: Σ h_n tⁿ⁺² / (n + 2)!, h_n the complete symmetric
        // polynomials.
        const TERMS: u32 = 20;
        let (mut of_loop, mut of_all, mut power, mut sum) = ([1.0, 0.0], 1.0, 0.5 * t * t, 0.0);
        for n in 0..TERMS {
            sum += of_all * power;
            power *= t / f64::from(n + 3);
            of_loop = [of_loop[1], -split * of_loop[0]];
            of_all = filter * of_all + of_loop[0];
        }
        return libm::exp(-sigma * t) * sum / lag;
    }
    if split >= 0.0 {
        // Partial fractions: the filter's pole is far from the loop's.
        let (slope, s) = impulse_response(t, square, sigma);
        let numerator = libm::exp(-t / lag) - slope - (2.0 * sigma - 1.0 / lag) * s;
        return numerator / (lag * (filter * filter + split));
    }
    // Real poles, one of which may be the filter's: by the largest difference.
    let mut poles = [-root - sigma, root - sigma, -1.0 / lag];
    poles.sort_unstable_by(f64::total_cmp);
    let difference = |low: f64, high: f64| {
        let gap = high - low;
        libm::exp(high * t) * if gap > 0.0 { -libm::expm1(-gap * t) / gap } else { t }
    };
    let [low, middle, high] = poles;
    (difference(middle, high) - difference(low, middle)) / ((high - low) * lag)
}
