//! From the wrench as it is given to f̂: bias, frame, sign, the tool's weight and inertia, and the
//! deadband.
//!
//! A sensor between flange and tool feels the environment, and the weight and the inertia of the
//! tool. With the wrench w that is given, its bias b, the sign s (+1: robot on environment, −1: the
//! reaction), T from the sensor's frame to the base frame at the TCP, and as wrenches about the TCP
//! the tool's weight G and what accelerates the tool, A: f̂ = s T (w − b) + G − A. For s T (w − b)
//! is what the robot exerts on tool and environment together; −G of it holds the tool, A moves it.

use nalgebra::{Matrix3, SVector, Vector3, Vector6};

use crate::quantities::{BaseWrench, GivenWrench};
use crate::robot::Pose;
use crate::turn::Turn;

/// Where a wrench is given: its axes, and the point that its torques are about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GivenIn {
    /// Axes of the base frame, at the TCP.
    Base,
    /// Axes of another frame, at the TCP, from which this leads to the base frame.
    Turned(Turn),
    /// The sensor's own axes, at its origin: its pose in the frame of the TCP.
    Sensor(Pose),
}

/// Which of two opposite wrenches is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GivenSign {
    /// What the robot exerts on tool and environment.
    OnEnvironment,
    /// What they exert on the robot.
    Reaction,
}

/// How f̂ follows from what is given; six values are forces x y z in N, then torques in N·m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditioning<const D: usize> {
    /// Where it is given.
    pub given_in: GivenIn,
    /// The direction of the wrench: who exerts it on whom.
    pub sign: GivenSign,
    /// What is given without any load.
    pub bias: Vector6<f64>,
    /// Magnitudes from which on the sensor is at the end of its range.
    pub saturation: Option<Vector6<f64>>,
    /// Up to this magnitude a task axis counts as free of force. A larger force is not reduced: a
    /// limit must see all of it.
    pub deadband: SVector<f64, D>,
    /// Mass of the tool in kg.
    pub tool_mass: f64,
    /// m g of the tool in N, base frame.
    pub tool_weight: Vector3<f64>,
    /// Its centre of gravity in the frame of the TCP, m.
    pub tool_center_of_gravity: Vector3<f64>,
}

impl<const D: usize> Conditioning<D> {
    /// Takes what is given as f̂.
    pub fn none() -> Self {
        Self {
            given_in: GivenIn::Base,
            sign: GivenSign::OnEnvironment,
            bias: Vector6::zeros(),
            saturation: None,
            deadband: SVector::zeros(),
            tool_mass: 0.0,
            tool_weight: Vector3::zeros(),
            tool_center_of_gravity: Vector3::zeros(),
        }
    }

    /// The same where the base frame is the one that a turn leads to.
    #[must_use]
    pub(crate) fn seen_from(&self, turn: &Turn) -> Self {
        let given_in = match self.given_in {
            GivenIn::Base => GivenIn::Turned(*turn),
            GivenIn::Turned(given) => GivenIn::Turned(given.then(turn)),
            GivenIn::Sensor(sensor) => GivenIn::Sensor(sensor),
        };
        Self { given_in, tool_weight: turn.vector(&self.tool_weight), ..*self }
    }

    /// The first value of `given` at the end of the sensor's range.
    pub fn saturated(&self, given: &GivenWrench) -> Option<usize> {
        let ranges = self.saturation.as_ref()?;
        given.0.iter().zip(ranges).position(|(value, range)| value.abs() >= *range)
    }

    /// f̂ on the task axes, for the orientation of the TCP in the base frame; `acceleration` is the
    /// wrench that accelerates a tool of 1 kg, in m/s² and m²/s².
    pub fn wrench(&self, given: &GivenWrench, tcp: &Matrix3<f64>, acceleration: &SVector<f64, D>) -> SVector<f64, D> {
        let wrench = self.at_rest(given, tcp).on_task_axes::<D>() - acceleration * self.tool_mass;
        wrench.zip_map(&self.deadband, |value, deadband| {
            // NaN is in no deadband.
            let is_within = deadband > 0.0 && value.abs() <= deadband;
            if is_within { 0.0 } else { value }
        })
    }

    /// What the robot exerts on the environment while the tool is not accelerated, before the
    /// deadband.
    fn at_rest(&self, given: &GivenWrench, tcp: &Matrix3<f64>) -> BaseWrench {
        let unbiased = given.0 - self.bias;
        let (mut force, mut torque) = halves(&unbiased);
        match &self.given_in {
            GivenIn::Base => {}
            GivenIn::Turned(turn) => (force, torque) = (turn.vector(&force), turn.vector(&torque)),
            GivenIn::Sensor(sensor) => {
                let rotation = tcp * sensor.rotation;
                force = rotation * force;
                torque = rotation * torque + (tcp * sensor.position).cross(&force);
            }
        }
        if self.sign == GivenSign::Reaction {
            (force, torque) = (-force, -torque);
        }
        if self.tool_weight != Vector3::zeros() {
            force += self.tool_weight;
            torque += (tcp * self.tool_center_of_gravity).cross(&self.tool_weight);
        }
        BaseWrench(joined(&force, &torque))
    }

    /// The reading when only the tool loads the sensor, without bias: the reference for finding the
    /// bias. `acceleration` as in [`Self::wrench`].
    pub fn unloaded(&self, tcp: &Matrix3<f64>, acceleration: &Vector6<f64>) -> GivenWrench {
        let weight = self.tool_weight;
        let lever = tcp * self.tool_center_of_gravity;
        // f̂ = 0: s T w = A − G.
        let (moving_force, moving_torque) = halves(&(acceleration * self.tool_mass));
        let (mut force, mut torque) = (moving_force - weight, moving_torque - lever.cross(&weight));
        if self.sign == GivenSign::Reaction {
            (force, torque) = (-force, -torque);
        }
        match &self.given_in {
            GivenIn::Base => {}
            GivenIn::Turned(turn) => (force, torque) = (turn.back(&force), turn.back(&torque)),
            GivenIn::Sensor(sensor) => {
                let rotation = (tcp * sensor.rotation).transpose();
                torque = rotation * (torque - (tcp * sensor.position).cross(&force));
                force = rotation * force;
            }
        }
        GivenWrench(joined(&force, &torque))
    }
}

fn halves(wrench: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (Vector3::new(wrench[0], wrench[1], wrench[2]), Vector3::new(wrench[3], wrench[4], wrench[5]))
}

fn joined(force: &Vector3<f64>, torque: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
}
