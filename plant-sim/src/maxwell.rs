//! A surface that creeps: beside its spring a Maxwell element, a spring in series with a damper
//! (the standard linear solid). Pressed at once it is as stiff as both springs; what is held
//! relaxes to the main spring's force; and after a touch the surface needs time to come back.
//!
//! With the depth x of the surface, the damper's extension s and the relaxation time τ: τ ṡ = x −
//! s. While the tool presses, x is its depth; else the surface carries no force and x = k₁ s / (k +
//! k₁).

/// The Maxwell element of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Maxwell {
    /// Stiffness k₁ of its spring, N/m.
    pub stiffness: f64,
    /// τ: its damping over its stiffness, s.
    pub relaxation_time: f64,
}

/// How far such a surface has given way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Creep {
    /// Extension s of the damper, m.
    pub extension: f64,
    /// Depth x of the surface, m.
    depth: f64,
}

impl Maxwell {
    /// Depth in m at which the surface carries no force, beside a main spring of `stiffness` (N/m).
    pub fn free_depth(&self, stiffness: f64, creep: &Creep) -> f64 {
        creep.extension * self.stiffness / (stiffness + self.stiffness)
    }

    /// The creep after `duration_s`, over which the tool goes to `penetration` (m) in a straight
    /// line; exact for that while it presses, and while it does not.
    #[must_use]
    pub fn advanced(&self, stiffness: f64, creep: &Creep, penetration: f64, duration_s: f64) -> Creep {
        let extension = if penetration > self.free_depth(stiffness, creep) {
            let lost = -(-duration_s / self.relaxation_time).exp_m1();
            let missing = lost * self.relaxation_time / duration_s;
            penetration + (creep.extension - creep.depth) * (1.0 - lost) - (penetration - creep.depth) * missing
        } else {
            let share = stiffness / (stiffness + self.stiffness);
            creep.extension * (-duration_s * share / self.relaxation_time).exp()
        };
        let creep = Creep { extension, depth: 0.0 };
        Creep { depth: penetration.max(self.free_depth(stiffness, &creep)), ..creep }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STIFFNESS: f64 = 1e5;
    const MAXWELL: Maxwell = Maxwell { stiffness: 6e4, relaxation_time: 0.02 };

    fn force(creep: &Creep, penetration: f64) -> f64 {
        if penetration <= MAXWELL.free_depth(STIFFNESS, creep) {
            return 0.0;
        }
        STIFFNESS * penetration + MAXWELL.stiffness * (penetration - creep.extension)
    }

    #[test]
    fn an_oscillation_has_the_storage_and_loss_modulus_of_the_standard_linear_solid() {
        // F/δ = k + k₁ iωτ / (1 + iωτ).
        let (omega, mean, amplitude, h) = (80.0, 0.002, 0.0008, 1e-5);
        let x: f64 = omega * MAXWELL.relaxation_time;
        let storage = STIFFNESS + MAXWELL.stiffness * x * x / (1.0 + x * x);
        let loss = MAXWELL.stiffness * x / (1.0 + x * x);
        let mut creep = Creep::default();
        let mut worst = 0.0_f64;
        for step in 1..=80_000 {
            let (sine, cosine) = (omega * h * f64::from(step)).sin_cos();
            let depth = mean + amplitude * sine;
            creep = MAXWELL.advanced(STIFFNESS, &creep, depth, h);
            if step > 40_000 {
                let expected = STIFFNESS * mean + amplitude * (storage * sine + loss * cosine);
                worst = worst.max((force(&creep, depth) - expected).abs());
            }
        }
        assert!(worst < 1e-4, "off by {worst} N");
    }

    #[test]
    fn what_is_held_relaxes_and_what_is_left_comes_back() {
        // Pressed in within a nanosecond: both springs, then the main one.
        let pressed = MAXWELL.advanced(STIFFNESS, &Creep::default(), 0.001, 1e-9);
        assert!((force(&pressed, 0.001) - 160.0).abs() < 1e-4);
        for parts in [1, 9] {
            let (mut held, mut left) = (pressed, MAXWELL.advanced(STIFFNESS, &pressed, 0.001, 0.03));
            for _ in 0..parts {
                held = MAXWELL.advanced(STIFFNESS, &held, 0.001, 0.03 / f64::from(parts));
            }
            let expected = 100.0 + 60.0 * (-0.03_f64 / 0.02).exp();
            assert!((force(&held, 0.001) - expected).abs() < 1e-4, "{} N", force(&held, 0.001));
            // Left alone: ṡ = −s k / ((k + k₁) τ).
            let (before, expected) = (left.extension, (-0.05_f64 / (0.02 * 1.6)).exp());
            for _ in 0..parts {
                left = MAXWELL.advanced(STIFFNESS, &left, -0.1, 0.05 / f64::from(parts));
            }
            assert!((left.extension / before - expected).abs() < 1e-12);
            assert!(MAXWELL.free_depth(STIFFNESS, &left) > 1e-5, "the surface is still deeper than it was");
        }
    }

    #[test]
    fn it_gives_no_energy_and_never_pulls() {
        // Touches and lifts off at many rhythms, among them some faster than it recovers.
        for omega in [3.0, 30.0, 100.0, 900.0] {
            let steps = 40_000;
            let h = std::f64::consts::TAU / omega / f64::from(steps) * 3.0;
            let (mut creep, mut work, mut before) = (Creep::default(), 0.0, (0.0, 0.0));
            for step in 1..=steps {
                let depth = 0.002 * (omega * h * f64::from(step)).sin();
                creep = MAXWELL.advanced(STIFFNESS, &creep, depth, h);
                let force = force(&creep, depth);
                assert!(force >= 0.0, "a pull at depth {depth}");
                work += 0.5 * (force + before.1) * (depth - before.0);
                assert!(work > -1e-9, "{work} J after {step} steps at {omega} rad/s");
                before = (depth, force);
            }
            assert!(work > 1e-4, "{work} J are lost in three touches at {omega} rad/s");
        }
    }
}
