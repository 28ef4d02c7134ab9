//! The `[rigid_body]` section of a scenario.

use admittance_core::robot::{Chain, DynamicsError, LinkInertia};
use admittance_host::config::ConfigError;
use admittance_host::config_section;
use nalgebra::SVector;

use super::{DriveParameters, Friction, Gear, JointParameters, RigidBody};

config_section! {
    /// A joint, with the link that it moves. Of a prismatic joint N takes the place of N m, m that of
    /// rad, and kg that of kg m^2 in what rotors weigh.
    pub struct RigidJointSection {
        /// Mass of the link; of the last one with the tool.
        mass_kg: f64, unit "kg", range 0.001..=5000.0;
        /// The link's centre of gravity in the frame of its joint.
        center_of_gravity_m: [f64; 3], unit "m", range -10.0..=10.0;
        /// Elements xx yy zz xy xz yz of the tensor of inertia about the centre of gravity, along the axes
        /// of the joint's frame: xy is −∫ x y dm, as in URDF.
        inertia_kg_m2: [f64; 6], unit "kg m^2", range -1e4..=1e4;
        /// Inertia of the motor's rotor, before the gear.
        rotor_inertia_kg_m2: f64 = 0.0, unit "kg m^2", range 0.0..=10.0;
        /// Turns of the motor for one of the joint; of a prismatic joint radians of the motor per metre.
        gear_ratio: f64 = 1.0, unit "1", range 1.0..=1000.0;
        /// Stiffness of a gear that gives, behind the rotor; a stiff one when absent.
        gear_stiffness_n_m_rad: Option<f64>, unit "N m/rad", range 100.0..=1e7;
        /// Damping of that gear.
        gear_damping_n_m_s_rad: f64 = 0.0, unit "N m s/rad", range 0.0..=1e4;
        /// Friction that grows with the joint's speed.
        viscous_friction_n_m_s_rad: f64 = 0.0, unit "N m s/rad", range 0.0..=1e4;
        /// Dry friction of a fast joint.
        coulomb_friction_n_m: f64 = 0.0, unit "N m", range 0.0..=1e4;
        /// Dry friction of a slow joint; as that of a fast one when absent.
        breakaway_friction_n_m: Option<f64>, unit "N m", range 0.0..=1e4;
        /// Speed at which 37 % of the difference between the two are left.
        stribeck_velocity_rad_s: f64 = 0.05, unit "rad/s", range 0.0001..=10.0;
        /// Speed at which dry friction reaches 1/√2 of its full value.
        slip_velocity_rad_s: f64 = 0.001, unit "rad/s", range 0.00001..=1.0;
        /// Largest torque of the drive, after the gear; without end when absent.
        torque_limit_n_m: Option<f64>, unit "N m", range 0.1..=1e5;
        /// Torque of the drive by speed error, both after the gear.
        speed_gain_n_m_s_rad: f64, unit "N m s/rad", range 0.0..=1e6;
        /// Counts of the motor's encoder in a turn of the motor; endless resolution when absent.
        encoder_counts: Option<u32>, unit "1", range 100..=1000000000;
    }
    cross_check gear_has_a_rotor;
}

config_section! {
    /// The drives: PI speed loops, with the torques that a model of the arm asks for.
    pub struct DriveSection {
        /// Ticks in a second.
        rate_hz: f64 = 8000.0, unit "Hz", range 500.0..=100000.0;
        /// Time in which the integral part of a lasting error grows to its proportional part.
        integral_time_s: f64 = 0.02, unit "s", range 0.0005..=100.0;
        /// What the model's torques are multiplied by: 1 is a model that is right, 0 is none.
        feed_forward_factor: f64 = 1.0, unit "1", range 0.0..=2.0;
    }
}

config_section! {
    /// The arm as rigid bodies (1), whose drives follow (4) as well as they can.
    pub struct RigidBodySection {
        /// Gravity in the base frame.
        gravity_m_s2: [f64; 3] = [0.0, 0.0, -9.81], unit "m/s^2", range -30.0..=30.0;
        /// One table for each joint, base first.
        joint: Vec<RigidJointSection>, length 2..=8;
        /// The drives.
        drive: DriveSection;
    }
    cross_check bodies_are_physical;
}

fn gear_has_a_rotor(joint: &RigidJointSection, path: &str, errors: &mut Vec<ConfigError>) {
    if joint.gear_stiffness_n_m_rad.is_some() && joint.rotor_inertia_kg_m2 == 0.0 {
        let accepted = format!("above 0 with {path}.gear_stiffness_n_m_rad");
        errors.push(ConfigError::new(format!("{path}.rotor_inertia_kg_m2"), joint.rotor_inertia_kg_m2, accepted));
    }
    if let Some(breakaway) = joint.breakaway_friction_n_m.filter(|breakaway| *breakaway < joint.coulomb_friction_n_m) {
        let accepted = format!("at least {path}.coulomb_friction_n_m = {} N m", joint.coulomb_friction_n_m);
        errors.push(ConfigError::new(format!("{path}.breakaway_friction_n_m"), breakaway, accepted));
    }
}

fn bodies_are_physical(arm: &RigidBodySection, path: &str, errors: &mut Vec<ConfigError>) {
    for (index, joint) in arm.joint.iter().enumerate().filter(|(_, joint)| !joint.link().is_physical()) {
        errors.push(ConfigError::new(
            format!("{path}.joint[{index}].inertia_kg_m2"),
            format!("{:?}", joint.inertia_kg_m2),
            LinkInertia::ACCEPTED,
        ));
    }
}

impl RigidJointSection {
    fn link(&self) -> LinkInertia {
        LinkInertia::of_elements(self.mass_kg, self.center_of_gravity_m, self.inertia_kg_m2)
    }

    fn parameters(&self) -> JointParameters {
        JointParameters {
            reflected_inertia: self.rotor_inertia_kg_m2 * self.gear_ratio * self.gear_ratio,
            friction: Friction {
                viscous: self.viscous_friction_n_m_s_rad,
                coulomb: self.coulomb_friction_n_m,
                breakaway: self.breakaway_friction_n_m.unwrap_or(self.coulomb_friction_n_m),
                stribeck_velocity: self.stribeck_velocity_rad_s,
                slip_velocity: self.slip_velocity_rad_s,
            },
            gear: self.gear_stiffness_n_m_rad.map(|stiffness| Gear { stiffness, damping: self.gear_damping_n_m_s_rad }),
        }
    }

    fn encoder_step(&self) -> f64 {
        let turn = std::f64::consts::TAU / self.gear_ratio;
        self.encoder_counts.map_or(0.0, |counts| turn / f64::from(counts))
    }
}

impl RigidBodySection {
    /// The arm at rest at `start` in rad or m, with the time constants T_V of (4) in s; `None` when the
    /// section has another number of joints than N.
    pub(crate) fn arm<const N: usize>(
        &self,
        chain: &Chain<N>,
        time_constant_s: SVector<f64, N>,
        start: &SVector<f64, N>,
    ) -> Option<Result<RigidBody<N>, DynamicsError>> {
        let joints: &[RigidJointSection; N] = self.joint.as_slice().try_into().ok()?;
        let of = |value: fn(&RigidJointSection) -> f64| SVector::from_fn(|joint, _| value(&joints[joint]));
        let drive = DriveParameters {
            period_ns: (1e9 / self.drive.rate_hz).round() as u64,
            time_constant_s,
            gain: of(|joint| joint.speed_gain_n_m_s_rad),
            integral_time_s: self.drive.integral_time_s,
            torque_limit: of(|joint| joint.torque_limit_n_m.unwrap_or(f64::INFINITY)),
            feed_forward_factor: self.drive.feed_forward_factor,
            encoder_step: of(RigidJointSection::encoder_step),
        };
        let links = std::array::from_fn(|joint| joints[joint].link());
        let parameters = std::array::from_fn(|joint| joints[joint].parameters());
        Some(RigidBody::new(*chain, links, self.gravity_m_s2.into(), parameters, drive, start))
    }
}
