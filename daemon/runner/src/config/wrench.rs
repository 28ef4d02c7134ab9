//! `[wrench]`: how the state sample's wrench is given, and what is removed from it.

use admittance_host::config::ConfigError;
use admittance_host::{config_enum, config_section};

config_enum! {
    /// Axes of the wrench in the state sample, and the point that its torques are about.
    pub enum GivenInName {
        /// Axes of the robot's base frame, at the TCP.
        Base = "base",
        /// The sensor's own axes, at its origin: sensor_origin_m and sensor_rpy_rad say where that
        /// is.
        Sensor = "sensor",
    }
}

config_enum! {
    /// Which of the two opposite wrenches the state sample gives.
    pub enum GivenSignName {
        /// The one that the robot exerts on its environment.
        OnEnvironment = "on_environment",
        /// The one that the environment exerts on the robot: the sign is flipped.
        Reaction = "reaction",
    }
}

config_enum! {
    /// Where the wrench comes from.
    pub enum WrenchSourceName {
        /// The state sample gives it.
        Sample = "sample",
        /// It follows from the state sample's joint_torque, by what [dynamics] tells of the arm;
        /// contact.wrench_time_constant_s is then the lag that the estimate is made to have.
        MotorTorque = "motor_torque",
    }
}

config_section! {
    /// How the state sample's wrench is given. Bias, frame, sign, and the weight and the inertia of
    /// the tool are removed before anything else sees it; lists of six are forces x y z, then
    /// torques rx ry rz, as the sample gives them.
    pub struct WrenchSection {
        /// Where it comes from; all that follows is about one that the state sample gives, but for deadband
        /// and gravity_m_s2.
        source: WrenchSourceName = WrenchSourceName::Sample;
        /// Its axes, and the point that its torques are about.
        given_in: GivenInName = GivenInName::Base;
        /// The direction of the wrench: who exerts it on whom.
        sign: GivenSignName = GivenSignName::OnEnvironment;
        /// With given_in = "sensor": where the sensor is in the frame of the TCP; the lever arm of
        /// its torques.
        sensor_origin_m: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -2.0..=2.0;
        /// With given_in = "sensor": its orientation in the frame of the TCP: fixed-axis roll,
        /// pitch, yaw.
        sensor_rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
        /// What the sample gives without any load. `admittancectl tare` finds it in free motion.
        bias: [f64; 6] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], unit "N, N m", range -1e4..=1e4;
        /// End of the sensor's range: a value of this magnitude or more makes the sample one that
        /// must not be used. No such check when absent.
        saturation: Option<[f64; 6]>, unit "N, N m", range 0.001..=1e6;
        /// Magnitude up to which a task axis counts as without force, one value per axis; at most
        /// the release threshold. Larger forces are left as they are. None when absent.
        deadband: Option<Vec<f64>>, unit "N, N m", range 0.0..=1e4, length 2..=6, each "axis";
        /// Mass of what hangs on the sensor and is not compensated by the controller. Its inertia is
        /// removed as that of a point mass, which contact.wrench_time_constant_s delays as it does
        /// any force; its acceleration follows from the reported joint velocities.
        tool_mass_kg: f64 = 0.0, unit "kg", range 0.0..=500.0;
        /// Its centre of gravity in the frame of the TCP.
        tool_center_of_gravity_m: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -2.0..=2.0;
        /// Gravity in the base frame: of an arm on a wall or ceiling, or a planar one that stands,
        /// another than the default.
        gravity_m_s2: [f64; 3] = [0.0, 0.0, -9.81], unit "m/s^2", range -30.0..=30.0;
    }
    cross_check sensor_frame_is_used;
}

fn sensor_frame_is_used(wrench: &WrenchSection, path: &str, errors: &mut Vec<ConfigError>) {
    if wrench.given_in == GivenInName::Sensor {
        return;
    }
    for (key, values) in [("sensor_origin_m", wrench.sensor_origin_m), ("sensor_rpy_rad", wrench.sensor_rpy_rad)] {
        if values != [0.0; 3] {
            let accepted = format!("no such key, or {path}.given_in = \"sensor\"");
            errors.push(ConfigError::new(format!("{path}.{key}"), format!("{values:?}"), accepted));
        }
    }
}
