//! Friction of a joint as it is told, and how far it may be from that.

/// Friction against a joint's motion, on the joint's side of its gear: viscous, dry, and Stribeck's
/// fall from the breakaway torque to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFriction {
    /// N m s/rad.
    pub viscous: f64,
    /// Dry friction of a fast joint, N m.
    pub coulomb: f64,
    /// Dry friction of a slow joint, N m; at least `coulomb`.
    pub breakaway: f64,
    /// Speed in rad/s at which 37 % of the difference between the two are left; above zero.
    pub stribeck_velocity: f64,
    /// Speed in rad/s at which dry friction reaches 1/√2 of its full value; above zero.
    pub slip_velocity: f64,
    /// Standard deviation of all of it, as a share of it.
    pub tolerance: f64,
    /// Standard deviation in N m of what is not told at all.
    pub unknown: f64,
}

impl JointFriction {
    /// Torque in N m against a velocity in rad/s, of the velocity's sign.
    pub fn torque(&self, velocity: f64) -> f64 {
        self.viscous * velocity + self.dry(velocity) * velocity / libm::hypot(velocity, self.slip_velocity)
    }

    /// Variance in (N m)² of what of that torque is no share of it, of a velocity that is known but for
    /// `deviation` in rad/s. A joint that may stick may be held by anything up to its dry friction.
    pub fn variance(&self, velocity: f64, deviation: f64) -> f64 {
        let dry = self.dry(velocity);
        let speed = libm::hypot(velocity, self.slip_velocity);
        // The slope of v/√(v² + s²).
        let slope = self.slip_velocity * self.slip_velocity / (speed * speed * speed);
        let stuck = dry * (slope * deviation).min(1.0);
        stuck * stuck + self.unknown * self.unknown
    }

    fn dry(&self, velocity: f64) -> f64 {
        let relative = velocity / self.stribeck_velocity;
        self.coulomb + (self.breakaway - self.coulomb) * libm::exp(-relative * relative)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRICTION: JointFriction = JointFriction {
        viscous: 3.0,
        coulomb: 5.0,
        breakaway: 8.0,
        stribeck_velocity: 0.05,
        slip_velocity: 1e-3,
        tolerance: 0.1,
        unknown: 0.5,
    };

    #[test]
    fn a_fast_joint_is_as_sure_as_it_was_told_and_one_that_sticks_is_not() {
        let deviation = |velocity: f64| FRICTION.variance(velocity, 2e-3).sqrt();
        assert!((FRICTION.torque(1.0) - 8.0).abs() < 1e-3 && (FRICTION.torque(-1.0) + 8.0).abs() < 1e-3);
        assert!((deviation(1.0) - 0.5).abs() < 1e-3, "{}", deviation(1.0));
        assert!((deviation(0.0) - 8f64.hypot(0.5)).abs() < 1e-9, "{}", deviation(0.0));
    }
}
