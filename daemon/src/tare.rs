//! Taring: the bias of the wrench from the last samples in free motion, without the tool's weight
//! and inertia.

use std::collections::VecDeque;

use admittance_core::intake::Conditioning;
use admittance_core::quantities::GivenWrench;
use admittance_core::robot::Posture;
use admittance_core::with_arm;
use admittance_host::robot_description::RobotDescription;
use ipc_types::{Fault, Mode, RecordKind, RecordSample, StateSample, TASK_AXES};
use nalgebra::{Matrix3, SVector, Vector6};

use admittance_core::quantities::{AXIS_NAMES, wrench_unit};
use admittance_runner::config::{Config, GivenInName, WrenchSection, WrenchSourceName};
use admittance_runner::parameters;
use admittance_runner::task_frame::TaskFrame;

/// Samples whose mean becomes the bias.
pub(crate) const SAMPLES: usize = 200;
/// Difference between the means of both halves of the samples, in standard deviations that noise
/// alone gives it, from which the wrench counts as moving.
const MOVING: f64 = 5.0;
/// The same as a part of the release threshold: noise that is correlated looks quieter than it is.
const NEGLIGIBLE: f64 = 0.1;

/// The last samples in a row that the law was given in free motion.
#[derive(Debug, Default)]
pub(crate) struct FreeSamples(VecDeque<FreeSample>);

#[derive(Debug, Clone, Copy)]
struct FreeSample {
    state: StateSample,
    /// What a tool of 1 kg added to the wrench, in the task frame, in m/s² and m²/s².
    tool_acceleration: Vector6<f64>,
}

impl FreeSamples {
    /// Takes note of a cycle.
    pub(crate) fn cycle(&mut self, record: &RecordSample) {
        let is_usable = record.kind == RecordKind::Sample.code() && record.fault == Fault::NONE;
        if !is_usable || record.command.mode != Mode::Free.code() {
            self.0.clear();
            return;
        }
        if self.0.len() == SAMPLES {
            self.0.pop_front();
        }
        self.0.push_back(FreeSample { state: record.state, tool_acceleration: record.tool_acceleration.into() });
    }

    /// The bias that they speak of, the one in force replaced.
    ///
    /// # Errors
    /// A sentence that says why there is none.
    pub(crate) fn bias(&mut self, config: &Config) -> Result<[f64; TASK_AXES], String> {
        if config.wrench.source == WrenchSourceName::MotorTorque {
            return Err(
                "wrench.source = \"motor_torque\" has no sensor to tare: tell masses and friction in [dynamics]"
                    .to_owned(),
            );
        }
        if self.0.len() < SAMPLES {
            return Err(format!(
                "{} usable samples in a row in free motion, accepted: {SAMPLES}; wait, or see why samples are missing",
                self.0.len()
            ));
        }
        bias_of(config, self.0.make_contiguous())
    }
}

/// Mean of what is given beside the tool's weight and inertia.
///
/// # Errors
/// A sentence when the wrench moves by more than its noise.
fn bias_of(config: &Config, samples: &[FreeSample]) -> Result<[f64; TASK_AXES], String> {
    // The deadband would hide the bias.
    let wrench = WrenchSection { deadband: None, ..config.wrench.clone() };
    let conditioning: Conditioning<TASK_AXES> =
        parameters::conditioning(&wrench).ok_or("[wrench] does not describe a sensor")?;
    let orientations: Vec<Matrix3<f64>> = samples
        .iter()
        .map(|sample| {
            orientation(&config.robot, &sample.state).ok_or("the configuration describes no arm that is known")
        })
        .collect::<Result<_, _>>()?;
    let wrenches = || {
        let given = |sample: &FreeSample| (GivenWrench(sample.state.wrench.into()), sample.tool_acceleration);
        samples.iter().map(given).zip(&orientations)
    };
    let felt: Vec<Vector6<f64>> = wrenches()
        .map(|((given, acceleration), orientation)| {
            let frame = TaskFrame::with_tool(config, orientation);
            frame.twist(conditioning.wrench(&given, orientation, &frame.twist_in_base(acceleration)))
        })
        .collect();
    let axes = (config.robot.task_axes as usize).min(TASK_AXES);
    for axis in 0..axes {
        let (drift, noise) = drift(felt.iter().map(|wrench| wrench[axis]));
        let accepted = (MOVING * noise).max(NEGLIGIBLE * config.contact.release_threshold[axis]);
        if drift > accepted {
            return Err(format!(
                "the wrench is moving: on {} its mean went by {drift:.2} {unit} within {SAMPLES} samples, accepted: at most \
                 {accepted:.2} {unit}; let the arm rest, and nothing touch the tool",
                AXIS_NAMES[axis],
                unit = wrench_unit(axis),
            ));
        }
    }
    let sum: Vector6<f64> = wrenches()
        .map(|((given, acceleration), orientation)| {
            let acceleration = TaskFrame::with_tool(config, orientation).twist_in_base(acceleration);
            given.0 - conditioning.unloaded(orientation, &acceleration).0
        })
        .sum();
    let mut bias: [f64; TASK_AXES] = (sum / samples.len() as f64).into();
    // In the base frame the axes that the arm does not control have no reading.
    if config.wrench.given_in == GivenInName::Base {
        bias[axes..].copy_from_slice(&config.wrench.bias[axes..]);
    }
    Ok(bias)
}

/// Difference of the means of both halves, and the standard deviation that white noise as strong as
/// the values' gives it.
fn drift(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, second) = values.split_at(values.len() / 2);
    // From differences of neighbours, which a slow drift hardly affects.
    let squares: f64 = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    let variance = squares / (2.0 * (values.len() - 1) as f64);
    ((mean(second) - mean(first)).abs(), (4.0 * variance / values.len() as f64).sqrt())
}

fn orientation(robot: &RobotDescription, state: &StateSample) -> Option<Matrix3<f64>> {
    fn of<const N: usize, const D: usize>(robot: &RobotDescription, state: &StateSample) -> Option<Matrix3<f64>> {
        let position = SVector::<f64, N>::from_fn(|joint, _| state.joint_position[joint]);
        Some(Posture::<N, D>::new(&robot.chain()?, &position).pose().rotation)
    }
    with_arm!((robot.joint.len(), robot.task_axes), <N, D> => of::<N, D>(robot, state), else None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> Config {
        let text = include_str!("../../deploy/demo/mpc-default.toml");
        admittance_host::config::parse(text, "mpc-default.toml").expect("valid")
    }

    /// A record of free motion with this wrench along y, and a noise of ±0.4 N.
    fn record(index: usize, force: f64) -> RecordSample {
        let mut record = RecordSample { kind: RecordKind::Sample.code(), ..RecordSample::zeroed() };
        record.command.mode = Mode::Free.code();
        record.state.joint_position[1] = -1.0;
        record.state.wrench[1] = force + if index.is_multiple_of(2) { 0.4 } else { -0.4 };
        record
    }

    fn bias(force: impl Fn(usize) -> f64, count: usize) -> Result<[f64; TASK_AXES], String> {
        let mut free = FreeSamples::default();
        (0..count).for_each(|index| free.cycle(&record(index, force(index))));
        free.bias(&config())
    }

    #[test]
    fn the_mean_of_the_last_samples_is_the_bias() {
        // What was before the last of them is not looked at.
        let found = bias(|index| if index < 100 { 40.0 } else { 2.5 }, 100 + SAMPLES).expect("at rest");
        assert!((found[1] - 2.5).abs() < 1e-12 && found[0] == 0.0, "{found:?}");
    }

    #[test]
    fn too_few_samples_or_a_gap_among_them_are_none() {
        let why = bias(|_| 2.5, SAMPLES - 1).expect_err("one is missing");
        assert!(why.contains("199 usable samples") && why.contains("accepted: 200"), "{why}");
        let mut free = FreeSamples::default();
        (0..SAMPLES).for_each(|index| free.cycle(&record(index, 2.5)));
        assert!(free.bias(&config()).is_ok());
        let bad = [
            RecordSample { fault: Fault::WrenchInvalid.code(), ..record(0, 2.5) },
            RecordSample { kind: RecordKind::Silence.code(), ..record(0, 2.5) },
        ];
        for bad in bad {
            free.cycle(&bad);
            assert!(free.bias(&config()).is_err_and(|why| why.starts_with("0 usable samples")));
        }
        let mut in_contact = record(0, 2.5);
        in_contact.command.mode = Mode::Contact.code();
        free.cycle(&record(0, 2.5));
        free.cycle(&in_contact);
        assert!(free.bias(&config()).is_err_and(|why| why.starts_with("0 usable samples")));
    }

    #[test]
    fn a_wrench_that_moves_by_more_than_its_noise_is_no_bias() {
        let why = bias(|index| index as f64 * 0.01, SAMPLES).expect_err("it moves");
        assert!(why.contains("the wrench is moving: on y its mean went by 1.00 N"), "{why}");
        // A tenth of the release threshold is nothing.
        assert!(bias(|index| index as f64 * 0.001, SAMPLES).is_ok());
    }

    #[test]
    fn what_accelerates_the_tool_is_no_bias() {
        let mut config = config();
        config.wrench.tool_mass_kg = 3.0;
        // Brought to speed and on: a mean force that is no bias, and a drift that is none either.
        let acceleration = |index: usize| if index < 80 { 2.0 } else { 0.0 };
        let tared = |tells: f64| {
            let mut free = FreeSamples::default();
            for index in 0..SAMPLES {
                let mut record = record(index, 2.5 + 3.0 * acceleration(index));
                record.tool_acceleration[1] = tells * acceleration(index);
                free.cycle(&record);
            }
            free.bias(&config)
        };
        let found = tared(1.0).expect("nothing else moves");
        assert!((found[1] - 2.5).abs() < 1e-12, "{found:?}");
        assert!(tared(0.0).is_err_and(|why| why.contains("the wrench is moving")));
    }
}
