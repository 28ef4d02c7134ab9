//! How the normal force grows with the depth.

/// The law of a contact, beside a damper that any may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// f = k δ.
    Linear,
    /// f = k δ (1 + (δ/d)²), a cubic (Duffing) spring: k at a touch, and harder with the depth.
    Hardening {
        /// d in m, where the cubic part is as large as the linear one.
        depth: f64,
    },
    /// f = k d (δ/d)ⁿ (1 + α δ̇), Hunt and Crossley 1975: no jump of the force at a touch.
    HuntCrossley {
        /// n; Hertz's 3/2 for a ball.
        exponent: f64,
        /// d in m, where the force without damping is k d.
        depth: f64,
        /// α in s/m.
        damping: f64,
    },
}

impl Law {
    /// Force in N at a depth in m above zero that does not change, of a surface of stiffness k in N/m.
    pub(super) fn force(&self, stiffness: f64, depth: f64) -> f64 {
        match self {
            Self::Linear => stiffness * depth,
            Self::Hardening { depth: cubic } => stiffness * depth * (1.0 + (depth / cubic).powi(2)),
            Self::HuntCrossley { exponent, depth: at, .. } => stiffness * at * (depth / at).powf(*exponent),
        }
    }

    /// What the law adds to the force by the speed in which the depth grows, N s/m.
    pub(super) fn damping(&self, stiffness: f64, depth: f64) -> f64 {
        match self {
            Self::Linear | Self::Hardening { .. } => 0.0,
            Self::HuntCrossley { damping, .. } => damping * self.force(stiffness, depth),
        }
    }

    /// Growth of that force with the depth, N/m.
    pub(super) fn tangent(&self, stiffness: f64, depth: f64) -> f64 {
        match self {
            Self::Linear => stiffness,
            Self::Hardening { depth: cubic } => stiffness * (1.0 + 3.0 * (depth / cubic).powi(2)),
            Self::HuntCrossley { exponent, depth: at, .. } => stiffness * exponent * (depth / at).powf(exponent - 1.0),
        }
    }

    /// Depth in m at which the surface, without damping, has taken up an energy in J.
    pub(super) fn depth_of(&self, stiffness: f64, energy: f64) -> f64 {
        let linear = 2.0 * energy / stiffness;
        match self {
            Self::Linear => linear.sqrt(),
            // ½ k δ² + ¼ k δ⁴/d².
            Self::Hardening { depth: cubic } => {
                let square = cubic * cubic;
                (square * ((1.0 + 2.0 * linear / square).sqrt() - 1.0)).sqrt()
            }
            Self::HuntCrossley { exponent, depth: at, .. } => {
                let power = exponent + 1.0;
                at * (power * energy / (stiffness * at * at)).powf(1.0 / power)
            }
        }
    }

    /// Whether the force depends on the speed.
    pub(super) fn needs_velocity(&self) -> bool {
        matches!(self, Self::HuntCrossley { damping, .. } if *damping > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_force_is_its_law_s() {
        // By hand at 1e5 N/m and 2 mm: 200 N; 200 (1 + 4) N with d = 1 mm; 100 · 2^1.5 N.
        let force = |law: Law| law.force(1e5, 0.002);
        assert!((force(Law::Linear) - 200.0).abs() < 1e-9);
        assert!((force(Law::Hardening { depth: 0.001 }) - 1000.0).abs() < 1e-9);
        let hertz = Law::HuntCrossley { exponent: 1.5, depth: 0.001, damping: 0.4 };
        assert!((force(hertz) - 282.842_712_474_619).abs() < 1e-9);
        assert!((hertz.damping(1e5, 0.002) - 113.137_084_989_847_6).abs() < 1e-9);
        assert_eq!(Law::Linear.damping(1e5, 0.002), 0.0);
    }

    #[test]
    fn tangent_and_depth_are_those_of_the_force() {
        let hertz = Law::HuntCrossley { exponent: 1.5, depth: 0.001, damping: 0.4 };
        for law in [Law::Linear, Law::Hardening { depth: 0.001 }, hertz] {
            let force = |depth: f64| law.force(1e5, depth);
            let slope = (force(0.002 + 1e-8) - force(0.002 - 1e-8)) / 2e-8;
            assert!((law.tangent(1e5, 0.002) / slope - 1.0).abs() < 1e-6, "{law:?}: {slope}");
            // The work on the way there, by the midpoint rule.
            let work: f64 = (0..10_000).map(|step| force((f64::from(step) + 0.5) * 2e-7) * 2e-7).sum();
            assert!((law.depth_of(1e5, work) / 0.002 - 1.0).abs() < 1e-6, "{law:?}: {work} J");
        }
    }
}
