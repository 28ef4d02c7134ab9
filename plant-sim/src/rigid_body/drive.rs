//! The drives: a PI speed loop for each joint, and the torques that a model of the whole arm asks for.
//!
//! The reference passes through (4) first, so that it has an acceleration: of a drive whose model is
//! right, on an arm without friction, (4) is then what the joint does.

use admittance_core::robot::ArmDynamics;
use nalgebra::{SVector, Vector6};

/// The parameters of the drives of N joints.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveParameters<const N: usize> {
    /// Time between two ticks in ns, above zero.
    pub period_ns: u64,
    /// T_V of (4) in s.
    pub time_constant_s: SVector<f64, N>,
    /// Torque by speed error, N m s/rad.
    pub gain: SVector<f64, N>,
    /// Time in s in which the integral part of a lasting error grows to its proportional part.
    pub integral_time_s: f64,
    /// Largest torque either way, N m.
    pub torque_limit: SVector<f64, N>,
    /// What M q̈ + C q̇ + G of the reference is multiplied by: 1 is a model that is right, 0 is none.
    pub feed_forward_factor: f64,
    /// Step of the encoders on the joints' side in rad; 0 where they have none.
    pub encoder_step: SVector<f64, N>,
}

/// The drives as they run.
#[derive(Debug, Clone)]
pub(super) struct Drive<const N: usize> {
    /// With all rotors on their joints.
    model: ArmDynamics<N>,
    parameters: DriveParameters<N>,
    /// What is left of the distance from the reference after a period (4).
    decay: SVector<f64, N>,
    /// What q̇ should be, rad/s.
    desired: SVector<f64, N>,
    integral: SVector<f64, N>,
    /// As the encoders showed it at the last tick, rad.
    seen: SVector<f64, N>,
    measured_velocity: SVector<f64, N>,
}

impl<const N: usize> Drive<N> {
    /// At rest with the motors at `position`, where `torque` holds them.
    pub(super) fn new(
        model: ArmDynamics<N>,
        parameters: DriveParameters<N>,
        position: &SVector<f64, N>,
        torque: &SVector<f64, N>,
    ) -> Self {
        let period_s = crate::seconds(parameters.period_ns);
        let mut drive = Self {
            decay: parameters.time_constant_s.map(|time_constant| (-period_s / time_constant).exp()),
            model,
            parameters,
            desired: SVector::zeros(),
            integral: SVector::zeros(),
            seen: SVector::zeros(),
            measured_velocity: SVector::zeros(),
        };
        drive.seen = drive.quantised(position);
        drive.integral = torque - drive.feed_forward(&SVector::zeros());
        drive
    }

    pub(super) fn model(&self) -> &ArmDynamics<N> {
        &self.model
    }

    pub(super) fn parameters(&self) -> &DriveParameters<N> {
        &self.parameters
    }

    /// With encoders of endless resolution; where they stand is to be set anew.
    pub(super) fn without_encoder_steps(&self) -> Self {
        let parameters = DriveParameters { encoder_step: SVector::zeros(), ..self.parameters.clone() };
        Self { parameters, ..self.clone() }
    }

    pub(super) fn period_ns(&self) -> u64 {
        self.parameters.period_ns
    }

    /// Difference of the encoders over the last period, rad/s.
    pub(super) fn measured_velocity(&self) -> &SVector<f64, N> {
        &self.measured_velocity
    }

    /// What the encoders show of motors at a position in rad.
    pub(super) fn quantised(&self, position: &SVector<f64, N>) -> SVector<f64, N> {
        position.zip_map(&self.parameters.encoder_step, |position, step| {
            if step > 0.0 { (position / step).round() * step } else { position }
        })
    }

    /// M q̈ + C q̇ + G of the reference at the position that is seen, as far as the drive knows.
    fn feed_forward(&self, acceleration: &SVector<f64, N>) -> SVector<f64, N> {
        if self.parameters.feed_forward_factor == 0.0 {
            return SVector::zeros();
        }
        let needed = self.model.at(&self.seen).torque(&self.desired, acceleration, &Vector6::zeros());
        needed * self.parameters.feed_forward_factor
    }

    /// The torques from here to the next tick, from the motors' position in rad and the velocity
    /// reference in rad/s.
    pub(super) fn tick(&mut self, position: &SVector<f64, N>, reference: &SVector<f64, N>) -> SVector<f64, N> {
        let period_s = crate::seconds(self.parameters.period_ns);
        let seen = self.quantised(position);
        self.measured_velocity = (seen - self.seen) / period_s;
        self.seen = seen;
        let next = reference + (self.desired - reference).component_mul(&self.decay);
        let forward = self.feed_forward(&((next - self.desired) / period_s));
        let mut torque = SVector::zeros();
        for joint in 0..N {
            let error = self.desired[joint] - self.measured_velocity[joint];
            let proportional = self.parameters.gain[joint] * error;
            let asked = forward[joint] + proportional + self.integral[joint];
            let limit = self.parameters.torque_limit[joint];
            torque[joint] = asked.clamp(-limit, limit);
            // Anti-windup: at its limit a drive sums up nothing that leads further beyond it.
            if asked.abs() <= limit || asked * error < 0.0 {
                self.integral[joint] += proportional * period_s / self.parameters.integral_time_s;
            }
        }
        self.desired = next;
        torque
    }
}

#[cfg(test)]
mod tests {
    use admittance_core::robot::{Chain, Joint, JointKind, LinkInertia, Pose};
    use nalgebra::{Matrix3, Vector1, Vector3};

    use super::*;

    const GAIN: f64 = 100.0;
    const INTEGRAL_TIME_S: f64 = 0.02;
    const LIMIT_N_M: f64 = 10.0;
    const STEP_RAD: f64 = 1e-3;
    const PERIOD_NS: u64 = 125_000;
    const TIME_CONSTANT_S: f64 = 0.01;

    /// A drive of one joint that knows no model.
    fn drive() -> Drive<1> {
        let (rotation, origin) = (Matrix3::identity(), Vector3::zeros());
        let joint = Joint { origin, rotation, axis: Vector3::z(), kind: JointKind::Revolute };
        let chain = Chain::new([joint], Pose { position: Vector3::x(), rotation }).unwrap();
        let link = LinkInertia::of_elements(1.0, [0.5, 0.0, 0.0], [0.1, 0.1, 0.1, 0.0, 0.0, 0.0]);
        let model = ArmDynamics::new(chain, [link], Vector1::zeros(), Vector3::zeros()).unwrap();
        let parameters = DriveParameters {
            period_ns: PERIOD_NS,
            time_constant_s: Vector1::new(TIME_CONSTANT_S),
            gain: Vector1::new(GAIN),
            integral_time_s: INTEGRAL_TIME_S,
            torque_limit: Vector1::new(LIMIT_N_M),
            feed_forward_factor: 0.0,
            encoder_step: Vector1::new(STEP_RAD),
        };
        Drive::new(model, parameters, &Vector1::zeros(), &Vector1::zeros())
    }

    /// Ticks in so many seconds with the motor held where it is; the torque then, N m.
    fn held(drive: &mut Drive<1>, reference: f64, duration_s: f64) -> f64 {
        let ticks = (duration_s / crate::seconds(PERIOD_NS)).round() as usize;
        (0..ticks).fold(0.0, |_, _| drive.tick(&Vector1::zeros(), &Vector1::new(reference))[0])
    }

    #[test]
    fn a_drive_at_its_limit_remembers_nothing_of_how_long() {
        let (mut short, mut long) = (drive(), drive());
        assert_eq!(held(&mut short, 1.0, 0.2), LIMIT_N_M);
        assert_eq!(held(&mut long, 1.0, 2.0), LIMIT_N_M);
        assert_eq!(short.integral, long.integral);
        assert!(long.integral[0] > 0.0 && long.integral[0] < LIMIT_N_M, "{} N m", long.integral[0]);
        // Told to go back it does so as soon as its reference has turned, ln 2 time constants later.
        assert!(held(&mut long, -1.0, 1.5 * TIME_CONSTANT_S) < 0.0);
    }

    #[test]
    fn below_its_limit_a_lasting_error_is_summed_up() {
        let mut drive = drive();
        let (proportional, time_s) = (0.02 * GAIN, 0.06);
        let expected = proportional * (1.0 + (time_s - TIME_CONSTANT_S) / INTEGRAL_TIME_S);
        let found = held(&mut drive, 0.02, time_s);
        assert!((found / expected - 1.0).abs() < 0.01, "{found} N m, not {expected}");
    }

    #[test]
    fn an_encoder_shows_whole_steps() {
        let mut drive = drive();
        let torque = |drive: &mut Drive<1>, position: f64| drive.tick(&Vector1::new(position), &Vector1::zeros())[0];
        // Less than half a step is not seen.
        assert_eq!(torque(&mut drive, 0.49 * STEP_RAD), 0.0);
        assert_eq!(drive.measured_velocity()[0], 0.0);
        // A little more is a whole step within one period, and nothing in the next.
        let velocity = STEP_RAD / crate::seconds(PERIOD_NS);
        assert_eq!(torque(&mut drive, 0.51 * STEP_RAD), -LIMIT_N_M);
        assert!((drive.measured_velocity()[0] / velocity - 1.0).abs() < 1e-12);
        let _ = torque(&mut drive, 0.51 * STEP_RAD);
        assert_eq!(drive.measured_velocity()[0], 0.0);
        // Without steps every bit of a way shows.
        let mut fine = drive.without_encoder_steps();
        fine.seen = Vector1::zeros();
        let _ = torque(&mut fine, 1e-9);
        assert!((fine.measured_velocity()[0] * crate::seconds(PERIOD_NS) - 1e-9).abs() < 1e-18);
    }
}
