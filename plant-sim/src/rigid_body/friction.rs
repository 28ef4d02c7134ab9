//! Friction of a joint and its gear: viscous, Coulomb, and Stribeck's fall from the breakaway torque.

/// Friction against a joint's motion, on the joint's side of the gear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// N m s/rad.
    pub viscous: f64,
    /// Of a fast motion, N m.
    pub coulomb: f64,
    /// Of a slow motion, N m.
    pub breakaway: f64,
    /// Speed in rad/s at which 37 % of the difference between the two are left.
    pub stribeck_velocity: f64,
    /// Speed in rad/s at which dry friction reaches 1/√2 of its full value: it makes the jump at
    /// zero smooth, and a joint that sticks creeps.
    pub slip_velocity: f64,
}

impl Friction {
    /// Torque in N m against a velocity in rad/s, of the velocity's sign.
    pub fn torque(&self, velocity: f64) -> f64 {
        self.slope(velocity) * velocity
    }

    /// Torque over velocity, N m s/rad: what an implicit step needs to stay stable where it sticks.
    pub(super) fn slope(&self, velocity: f64) -> f64 {
        let relative = velocity / self.stribeck_velocity;
        let dry = self.coulomb + (self.breakaway - self.coulomb) * (-relative * relative).exp();
        self.viscous + dry / velocity.hypot(self.slip_velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_falls_from_breakaway_to_coulomb_and_rises_with_speed() {
        let friction =
            Friction { viscous: 3.0, coulomb: 5.0, breakaway: 8.0, stribeck_velocity: 0.05, slip_velocity: 1e-4 };
        assert_eq!(friction.torque(0.0), 0.0);
        let near = |velocity: f64, expected: f64| {
            let found = friction.torque(velocity);
            assert!((found - expected).abs() < 0.01 * expected.abs(), "{found} at {velocity}, not {expected}");
            assert_eq!(friction.torque(-velocity), -found);
        };
        near(1e-4, 8.0 / 2f64.sqrt());
        near(2e-3, 8.0);
        near(0.05, 5.0 + 3.0 * (-1f64).exp() + 0.15);
        near(1.0, 8.0);
        near(-2.0, -11.0);
    }
}
