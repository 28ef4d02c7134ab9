//! What a joint's value is in: SI on this side, degrees and millimetres on the robot's.

/// What a joint of a robot is given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointUnit {
    /// A revolute joint: degrees, and degrees per second.
    Degree,
    /// A prismatic joint: mm, and mm/s.
    Millimetre,
}

impl JointUnit {
    /// From the robot's unit to rad or m, or the same per second.
    #[must_use]
    pub fn to_si(self, value: f64) -> f64 {
        match self {
            Self::Degree => value.to_radians(),
            Self::Millimetre => value * 1e-3,
        }
    }

    /// From rad or m, or the same per second, to the robot's unit.
    #[must_use]
    pub fn from_si(self, value: f64) -> f64 {
        match self {
            Self::Degree => value.to_degrees(),
            Self::Millimetre => value * 1e3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_and_millimetres_end_here() {
        assert!((JointUnit::Degree.to_si(180.0) - std::f64::consts::PI).abs() < 1e-15);
        assert!((JointUnit::Millimetre.to_si(250.0) - 0.25).abs() < 1e-15);
        for unit in [JointUnit::Degree, JointUnit::Millimetre] {
            assert!((unit.from_si(unit.to_si(-12.5)) + 12.5).abs() < 1e-12, "{unit:?}");
        }
    }
}
