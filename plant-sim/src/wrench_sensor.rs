//! A real wrench sensor between flange and tool: it feels the tool's weight (and, in the wrench
//! that it is given, the tool's inertia) besides the contact,
//! has its own axes away from the TCP, may report the reaction, is biased, and saturates.

use admittance_core::robot::{Pose, rotation_from_rpy};
use nalgebra::{Matrix3, Vector3, Vector6};

use crate::scenario::SensorSection;
use crate::tool_inertia::Tool;

/// What turns the wrench at the TCP into a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WrenchSensor {
    /// Pose in the frame of the TCP.
    pub pose: Pose,
    /// Whether its readings come in the axes of the base frame, about the TCP, wherever it is.
    pub in_base_axes: bool,
    /// Whether it reports what the tool exerts on the robot.
    pub reports_reaction: bool,
    /// Reading without any load, in N and N m.
    pub bias: Vector6<f64>,
    /// What hangs on it.
    pub tool: Tool,
    /// In the base frame, m/s².
    pub gravity: Vector3<f64>,
    /// Largest magnitude of each component of a reading.
    pub range: Option<Vector6<f64>>,
}

impl WrenchSensor {
    /// The sensor of a scenario.
    pub fn new(section: &SensorSection) -> Self {
        Self {
            pose: Pose { position: section.origin_m.into(), rotation: rotation_from_rpy(section.rpy_rad) },
            in_base_axes: section.in_base_axes,
            reports_reaction: section.reports_reaction,
            bias: section.bias.into(),
            tool: Tool { mass: section.tool_mass_kg, center_of_gravity: section.tool_center_of_gravity_m.into() },
            gravity: section.gravity_m_s2.into(),
            range: section.range.map(Into::into),
        }
    }

    /// Force and torque in the sensor's axes at its origin, when the robot exerts `wrench` (base
    /// frame, at the TCP) to press on the environment and to accelerate the tool; `tcp` is the
    /// orientation of the TCP.
    pub fn reading(&self, wrench: &Vector6<f64>, tcp: &Matrix3<f64>) -> Vector6<f64> {
        let given_force = wrench.fixed_rows::<3>(0).into_owned();
        let given_torque = wrench.fixed_rows::<3>(3).into_owned();
        // The robot holds the tool against its weight besides.
        let (into_sensor, sensor) = if self.in_base_axes {
            (Matrix3::identity(), Vector3::zeros())
        } else {
            ((tcp * self.pose.rotation).transpose(), tcp * self.pose.position)
        };
        let weight = self.gravity * self.tool.mass;
        let force = given_force - weight;
        let about_sensor = (tcp * self.tool.center_of_gravity - sensor).cross(&weight);
        let torque = given_torque - sensor.cross(&given_force) - about_sensor;
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
            in_base_axes: false,
            reports_reaction: false,
            bias: Vector6::zeros(),
            tool: Tool { mass: 2.0, center_of_gravity: Vector3::new(0.03, 0.0, 0.1) },
            gravity: Vector3::new(0.0, 0.0, -10.0),
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
        // Upside down in the base frame's axes: the centre of gravity is on the other side of the
        // TCP.
        let turned = rotation_from_rpy([0.0, std::f64::consts::PI, 0.0]);
        let in_base = WrenchSensor { in_base_axes: true, ..sensor() }.reading(&Vector6::zeros(), &turned);
        assert!((in_base - Vector6::new(0.0, 0.0, 20.0, 0.0, 0.6, 0.0)).norm() < 1e-12, "{in_base}");
    }

    #[test]
    fn it_is_biased_and_has_an_end() {
        let (bias, range) = (Vector6::repeat(3.0), Vector6::repeat(15.0));
        let sensor = WrenchSensor { bias, range: Some(range), ..sensor() };
        let reading = sensor.reading(&Vector6::zeros(), &Matrix3::identity());
        assert!((reading - Vector6::new(3.0, 3.0, 15.0, 3.0, 2.4, 3.0)).norm() < 1e-12, "{reading}");
    }
}
