//! How well loops predict the joint velocities of a motion that they were not fitted to.

use std::fmt::{Display, Formatter};

use serde::Serialize;

use super::found::{Case, Found};
use super::joint_loop::Loop;
use super::least_squares::mean_square;
use super::unknown::LEAST_SPEED_RAD_S;

/// Of a joint, as parts of the range of its velocity (RMS).
#[derive(Debug, Clone, Serialize)]
pub(super) struct Predicted {
    joint: usize,
    /// rad/s; m/s of a joint that slides.
    range_rad_s: f64,
    speed_unit: &'static str,
    /// None where the joint does not move.
    found_error: Option<f64>,
    configured_error: Option<f64>,
}

/// Of all joints; commands are taken to act as was found.
pub(super) fn predicted(mut case: Case<'_>, found: &Found) -> Vec<Predicted> {
    let robot = &case.config.robot;
    let configured = |joint: usize| Loop {
        time_constant_s: robot.velocity_time_constant_s[joint],
        damping: robot.damping(joint),
        dead_time_s: robot.dead_time_s(joint),
        report_lag_s: robot.report_lag_s(),
    };
    let configured: Vec<Loop> = (0..robot.joint.len()).map(configured).collect();
    if let Some(delay) = &found.command_delay_s {
        case.refer(delay.value);
    }
    let evidence = case.evidence();
    let error = |model: &Loop, joint: usize| {
        let all = case.tracks.iter().zip(evidence.follow(model, joint));
        let all: Vec<f64> = all
            .flat_map(|(track, moved)| {
                let of = |(shown, velocity): (super::joint_loop::Moving, &[f64; 8])| shown.shown - velocity[joint];
                moved.into_iter().zip(&track.velocity).map(of).collect::<Vec<_>>()
            })
            .collect();
        mean_square(&all).sqrt()
    };
    let of = |(joint, of): (usize, &super::loops::FoundLoop)| {
        let shown = || case.tracks.iter().flat_map(|track| track.velocity.iter().map(|velocity| velocity[joint]));
        let range_rad_s = shown().fold(f64::NEG_INFINITY, f64::max) - shown().fold(f64::INFINITY, f64::min);
        let [found_error, configured_error] = [&of.model, &configured[joint]]
            .map(|model| (range_rad_s >= LEAST_SPEED_RAD_S).then(|| error(model, joint) / range_rad_s));
        Predicted { joint, range_rad_s, speed_unit: case.speed_units[joint], found_error, configured_error }
    };
    found.loops.joints.iter().enumerate().map(of).collect()
}

impl Display for Predicted {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { joint, range_rad_s, speed_unit, found_error, configured_error } = self;
        let (Some(found), Some(configured)) = (found_error, configured_error) else {
            return write!(f, "joint {joint}: does not move, its range is {range_rad_s:.3} {speed_unit}");
        };
        write!(
            f,
            "joint {joint}: predicted within {:.2} % of its range of {range_rad_s:.3} {speed_unit} (RMS); as configured {:.2} %",
            100.0 * found,
            100.0 * configured
        )
    }
}
