//! A real wrench sensor between flange and tool: it feels the tool's weight besides the contact,
//! has its own axes away from the TCP, may report the reaction, is biased, and saturates.

use admittance_core::robot::{Pose, rotation_from_rpy};
use nalgebra::{Matrix3, Vector3, Vector6};

use crate::scenario::SensorSection;

/// What turns the wrench at the TCP into a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WrenchSensor {
    /// Pose in the frame of the TCP.
    pub pose: Pose,
    /// Whether it reports what the tool exerts on the robot.
    pub reports_reaction: bool,
    /// Reading without any load, in N and N m.
    pub bias: Vector6<f64>,
    /// m g of the tool in N, base frame.
    pub tool_weight: Vector3<f64>,
    /// Its centre of gravity in the frame of the TCP, m.
    pub tool_center_of_gravity: Vector3<f64>,
    /// Largest magnitude of each component of a reading.
    pub range: Option<Vector6<f64>>,
}

impl WrenchSensor {
    /// The sensor of a scenario.
    pub fn new(section: &SensorSection) -> Self {
        Self {
            pose: Pose { position: section.origin_m.into(), rotation: rotation_from_rpy(section.rpy_rad) },
            reports_reaction: section.reports_reaction,
            bias: section.bias.into(),
            tool_weight: Vector3::from(section.gravity_m_s2) * section.tool_mass_kg,
            tool_center_of_gravity: section.tool_center_of_gravity_m.into(),
            range: section.range.map(Into::into),
        }
    }

    /// Force and torque in the sensor's axes at its origin, when the tool at rest exerts `wrench`
    /// (base frame, at the TCP) on the environment; `tcp` is the orientation of the TCP.
    pub fn reading(&self, wrench: &Vector6<f64>, tcp: &Matrix3<f64>) -> Vector6<f64> {
        let contact_force = wrench.fixed_rows::<3>(0).into_owned();
        let contact_torque = wrench.fixed_rows::<3>(3).into_owned();
        // The robot holds the tool against its weight and the environment.
        let sensor = tcp * self.pose.position;
        let force = contact_force - self.tool_weight;
        let about_sensor = (tcp * self.tool_center_of_gravity - sensor).cross(&self.tool_weight);
        let torque = contact_torque - sensor.cross(&contact_force) - about_sensor;
        let into_sensor = (tcp * self.pose.rotation).transpose();
        let (force, torque) = (into_sensor * force, into_sensor * torque);
        let mut reading = Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z);
        if self.reports_reaction {
            reading = -reading;
        }
        reading += self.bias;
        self.range.map_or(reading, |range| reading.zip_map(&range, |value, range| value.clamp(-range, range)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tool of 2 kg that hangs 0.1 m below a sensor, itself 0.2 m above the TCP; all axes
    /// parallel.
    fn sensor() -> WrenchSensor {
        WrenchSensor {
            pose: Pose { position: Vector3::new(0.0, 0.0, 0.2), rotation: Matrix3::identity() },
            reports_reaction: false,
            bias: Vector6::zeros(),
            tool_weight: Vector3::new(0.0, 0.0, -20.0),
            tool_center_of_gravity: Vector3::new(0.03, 0.0, 0.1),
            range: None,
        }
    }

    #[test]
    fn it_feels_the_tool_and_the_contact_about_its_own_origin() {
        let upright = Matrix3::identity();
        // The robot holds 20 N up; 30 mm beside the sensor they turn it about y.
        let free = sensor().reading(&Vector6::zeros(), &upright);
        assert!((free - Vector6::new(0.0, 0.0, 20.0, 0.0, -0.6, 0.0)).norm() < 1e-12, "{free}");
        // Pushing along x at the TCP, 0.2 m below it.
        let pushing = sensor().reading(&Vector6::new(10.0, 0.0, 0.0, 0.0, 0.0, 0.0), &upright) - free;
        assert!((pushing - Vector6::new(10.0, 0.0, 0.0, 0.0, -2.0, 0.0)).norm() < 1e-12, "{pushing}");
        let reaction = WrenchSensor { reports_reaction: true, ..sensor() }.reading(&Vector6::zeros(), &upright);
        assert_eq!(reaction, -free);
    }

    #[test]
    fn it_is_biased_and_has_an_end() {
        let (bias, range) = (Vector6::repeat(3.0), Vector6::repeat(15.0));
        let sensor = WrenchSensor { bias, range: Some(range), ..sensor() };
        let reading = sensor.reading(&Vector6::zeros(), &Matrix3::identity());
        assert!((reading - Vector6::new(3.0, 3.0, 15.0, 3.0, 2.4, 3.0)).norm() < 1e-12, "{reading}");
    }
}
