//! `[dynamics]`: what the arm weighs, how it rubs and where it gives, for impacts and for a wrench from
//! motor torques.

use admittance_core::belief::{ImpactModel, SurfaceStiffness};
use admittance_core::intake::TorqueModel;
use admittance_core::robot::{ArmDynamics, Chain, JointFriction, LinkInertia};
use admittance_host::config::ConfigError;
use admittance_host::config_section;
use nalgebra::{SVector, Vector3};

use super::Config;

config_section! {
    /// A joint, with the link that it moves. Friction has no default: what nobody knows is told by
    /// unknown_friction_n_m, not by 0.
    pub struct JointDynamics {
        /// Mass of the link; of the last one with the tool.
        mass_kg: f64, unit "kg", range 0.001..=5000.0;
        /// The link's centre of gravity in the frame of its joint.
        center_of_gravity_m: [f64; 3], unit "m", range -10.0..=10.0;
        /// Elements xx yy zz xy xz yz of the tensor of inertia about the centre of gravity, along the axes
        /// of the joint's frame: xy is −∫ x y dm, as in URDF.
        inertia_kg_m2: [f64; 6], unit "kg m^2", range -1e4..=1e4;
        /// Inertia of the motor's rotor, before the gear.
        rotor_inertia_kg_m2: f64 = 0.0, unit "kg m^2", range 0.0..=10.0;
        /// Turns of the motor for one of the joint.
        gear_ratio: f64 = 1.0, unit "1", range 1.0..=1000.0;
        /// Stiffness of a gear that gives, behind the rotor: in an impact the link goes on without it. A
        /// stiff one when absent.
        gear_stiffness_n_m_rad: Option<f64>, unit "N m/rad", range 100.0..=1e7;
        /// Friction that grows with the joint's speed.
        viscous_friction_n_m_s_rad: f64, unit "N m s/rad", range 0.0..=1e4;
        /// Dry friction of a fast joint.
        coulomb_friction_n_m: f64, unit "N m", range 0.0..=1e4;
        /// Dry friction of a slow joint; as that of a fast one when absent.
        breakaway_friction_n_m: Option<f64>, unit "N m", range 0.0..=1e4;
        /// Speed at which 37 % of the difference between the two are left.
        stribeck_velocity_rad_s: f64 = 0.05, unit "rad/s", range 0.0001..=10.0;
        /// Speed at which dry friction reaches 1/√2 of its full value.
        slip_velocity_rad_s: f64 = 0.001, unit "rad/s", range 0.00001..=1.0;
        /// Standard deviation of friction that is not told, and of what else a torque is off by for long.
        unknown_friction_n_m: f64 = 0.0, unit "N m", range 0.0..=1e4;
        /// Standard deviation of the torque's noise from sample to sample.
        torque_noise_n_m: f64 = 0.5, unit "N m", range 0.0001..=1e3;
    }
    cross_check is_a_joint;
}

config_section! {
    /// The arm's masses, friction and gears; gravity is wrench.gravity_m_s2. By masses and gears the MPC
    /// knows what an impact presses. Required with wrench.source = "motor_torque".
    pub struct DynamicsSection {
        /// Standard deviation of each link's mass, as a share of it.
        mass_tolerance: f64 = 0.02, unit "1", range 0.0..=1.0;
        /// Standard deviation of each joint's friction, as a share of it.
        friction_tolerance: f64 = 0.2, unit "1", range 0.0..=1.0;
        /// Standard deviation of the torque that accelerates a joint, as a share of it: inertias that are off,
        /// and gears that give, which swing (some 0.5).
        acceleration_tolerance: f64 = 0.1, unit "1", range 0.0..=2.0;
        /// Standard deviation of the noise of the reported joint velocities.
        velocity_noise_rad_s: f64 = 0.0005, unit "rad/s", range 0.000001..=1.0;
        /// One table for each joint, base first.
        joint: Vec<JointDynamics>, length 2..=8;
    }
}

/// A table for each joint.
pub(super) fn check_joints(config: &Config, errors: &mut Vec<ConfigError>) {
    let joints = config.robot.joint.len();
    if let Some(found) = config.dynamics.as_ref().map(|dynamics| dynamics.joint.len()).filter(|found| *found != joints)
    {
        let accepted = format!("{joints} tables, one for each [[robot.joint]]");
        errors.push(ConfigError::new("dynamics.joint", format!("{found} tables"), accepted));
    }
}

fn is_a_joint(joint: &JointDynamics, path: &str, errors: &mut Vec<ConfigError>) {
    if !joint.link().is_physical() {
        errors.push(ConfigError::new(
            format!("{path}.inertia_kg_m2"),
            format!("{:?}", joint.inertia_kg_m2),
            LinkInertia::ACCEPTED,
        ));
    }
    if let Some(breakaway) = joint.breakaway_friction_n_m.filter(|breakaway| *breakaway < joint.coulomb_friction_n_m) {
        let accepted = format!("at least {path}.coulomb_friction_n_m = {} N m", joint.coulomb_friction_n_m);
        errors.push(ConfigError::new(format!("{path}.breakaway_friction_n_m"), breakaway, accepted));
    }
}

impl JointDynamics {
    fn link(&self) -> LinkInertia {
        LinkInertia::of_elements(self.mass_kg, self.center_of_gravity_m, self.inertia_kg_m2)
    }

    /// What the rotor weighs on the joint's side of its gear, kg m².
    fn reflected(&self) -> f64 {
        self.rotor_inertia_kg_m2 * self.gear_ratio * self.gear_ratio
    }

    fn friction(&self, tolerance: f64) -> JointFriction {
        JointFriction {
            viscous: self.viscous_friction_n_m_s_rad,
            coulomb: self.coulomb_friction_n_m,
            breakaway: self.breakaway_friction_n_m.unwrap_or(self.coulomb_friction_n_m),
            stribeck_velocity: self.stribeck_velocity_rad_s,
            slip_velocity: self.slip_velocity_rad_s,
            tolerance,
            unknown: self.unknown_friction_n_m,
        }
    }
}

impl DynamicsSection {
    /// The arm as an impact with a surface of this stiffness in N/m meets it; `None` when the section has
    /// another number of joints than N.
    pub(crate) fn impact<const N: usize>(
        &self,
        chain: &Chain<N>,
        gravity: Vector3<f64>,
        surface_stiffness: SurfaceStiffness,
    ) -> Option<ImpactModel<N>> {
        let joints: &[JointDynamics; N] = self.joint.as_slice().try_into().ok()?;
        let of = |value: fn(&JointDynamics) -> f64| SVector::from_fn(|joint, _| value(&joints[joint]));
        let moves_along = of(|joint| if joint.gear_stiffness_n_m_rad.is_none() { joint.reflected() } else { 0.0 });
        let links = std::array::from_fn(|joint| joints[joint].link());
        Some(ImpactModel {
            links: ArmDynamics::new(*chain, links, moves_along, gravity).ok()?,
            compliance: of(|joint| joint.gear_stiffness_n_m_rad.map_or(0.0, f64::recip)),
            surface_stiffness,
        })
    }

    /// What the observer knows of an arm of this chain; `None` when the section has another number of
    /// joints than N.
    pub(crate) fn model<const N: usize>(&self, chain: &Chain<N>, gravity: Vector3<f64>) -> Option<TorqueModel<N>> {
        let joints: &[JointDynamics; N] = self.joint.as_slice().try_into().ok()?;
        let of = |value: fn(&JointDynamics) -> f64| SVector::from_fn(|joint, _| value(&joints[joint]));
        let reflected = of(JointDynamics::reflected);
        let links = std::array::from_fn(|joint| joints[joint].link());
        Some(TorqueModel {
            dynamics: ArmDynamics::new(*chain, links, reflected, gravity).ok()?,
            friction: std::array::from_fn(|joint| joints[joint].friction(self.friction_tolerance)),
            mass_tolerance: self.mass_tolerance,
            acceleration_tolerance: self.acceleration_tolerance,
            torque_noise: of(|joint| joint.torque_noise_n_m),
            velocity_noise: self.velocity_noise_rad_s,
        })
    }
}
