//! The samples that travel through shared memory.
//!
//! All stamps are nanoseconds of `CLOCK_MONOTONIC` of this host, taken by the writer. Joint arrays
//! hold `joint_count` values, base to tip, and zeros after them. Cartesian arrays hold x, y, z, rx,
//! ry, rz in the robot's base frame, at the TCP; an axis that the arm does not control is zero. Where
//! a field says so they are of the task frame, which is the base frame unless the daemon's `[task]`
//! section says otherwise. A wrench is the one that the ROBOT exerts on the ENVIRONMENT: pushing along +x gives a positive x
//! force. The state sample's alone may be a sensor's as it is: the daemon's `[wrench]` section says
//! how it is given.

mod command;
mod diagnostics;
mod record;
mod request;
mod state;
mod truth;
mod twist;

pub use command::CommandSample;
pub use diagnostics::DiagnosticsSample;
pub use record::RecordSample;
pub use request::{RequestSample, ResponseSample};
pub use state::StateSample;
pub use truth::TruthSample;
pub use twist::TwistSample;

use crate::layout::{SampleInfo, WireSample};

/// Every sample type of the contract.
pub const SAMPLES: &[SampleInfo] = &[
    StateSample::INFO,
    CommandSample::INFO,
    TruthSample::INFO,
    RequestSample::INFO,
    ResponseSample::INFO,
    RecordSample::INFO,
    DiagnosticsSample::INFO,
    TwistSample::INFO,
];

/// Angle in rad between two vectors; 0 where that is rounding alone, or one of them is zero.
fn angle_between(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    let ([a, b, c], [x, y, z]) = (one, other);
    let across = [b * z - c * y, c * x - a * z, a * y - b * x];
    let angle = across.iter().map(|part| part * part).sum::<f64>().sqrt().atan2(a * x + b * y + c * z);
    if angle < 1e-9 { 0.0 } else { angle }
}
