//! What a joint has between its drive and its link.

use super::Friction;

/// A joint's mechanics, on the joint's side of its gear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointParameters {
    /// The rotor's inertia times the gear ratio squared, kg m²; above zero where the gear gives.
    pub reflected_inertia: f64,
    /// At the rotor, where the gear gives.
    pub friction: Friction,
    /// Gear that gives; `None` is stiff.
    pub gear: Option<Gear>,
}

/// A spring and a damper between rotor and link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gear {
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
}
