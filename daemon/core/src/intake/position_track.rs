//! Jumps of the measured joint position. A joint that moved further than it can have since the
//! previous sample means a faulty encoder or sender; and in contact each millimetre of error
//! becomes force, in proportion to the stiffness.

use nalgebra::SVector;

use super::{Sample, SampleFault};
use crate::quantities::Instant;
use crate::robot::Chain;

/// Speed in rad/s or m/s that no joint exceeds, where no limit is configured: twice that of a fast wrist.
const FASTEST: f64 = 20.0;
/// Multiple of a configured limit. The limit binds the reference under control, but in free motion
/// the motion controller may exceed it, and stamps jitter.
const BEYOND_LIMIT: f64 = 2.0;
/// Resolution and noise of a joint position, rad or m.
const RESOLUTION: f64 = 1e-3;

/// The joint position from sample to sample. A joint that jumped stays suspect until it is back
/// where it can be: waiting does not make a jump true. Out of control a new track may begin, of a
/// stopped arm when a person resets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PositionTrack<const N: usize> {
    seen: Option<Seen<N>>,
    /// How far each joint is from where it can be, rad or m; 0 unless it jumped.
    jumped: SVector<f64, N>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen<const N: usize> {
    boot_id: u64,
    stamp: Instant,
    /// rad or m.
    position: SVector<f64, N>,
}

impl<const N: usize> PositionTrack<N> {
    /// Nothing seen.
    pub(super) fn new() -> Self {
        Self { seen: None, jumped: SVector::zeros() }
    }

    /// Takes in the position of a sample that is otherwise valid. `joint_speed`: the configured
    /// limits, rad/s or m/s; `chain`: which of the two.
    ///
    /// # Errors
    /// [`SampleFault::Jump`] of the first joint that is somewhere it cannot have moved to.
    pub(super) fn follow<const D: usize>(
        &mut self,
        sample: &Sample<N, D>,
        joint_speed: Option<&SVector<f64, N>>,
        chain: &Chain<N>,
    ) -> Result<(), SampleFault> {
        let now = Seen { boot_id: sample.boot_id, stamp: sample.stamp, position: sample.joint_position };
        let Some(before) = self.seen.replace(now).filter(|before| before.boot_id == now.boot_id) else {
            self.jumped = SVector::zeros();
            return Ok(());
        };
        let elapsed = now.stamp.since(before.stamp).seconds();
        let mut found = Ok(());
        for joint in 0..N {
            let speed = joint_speed.map_or(FASTEST, |limit| BEYOND_LIMIT * limit[joint]);
            let most = RESOLUTION + speed * elapsed;
            let moved = now.position[joint] - before.position[joint];
            let off = self.jumped[joint] + moved;
            if self.jumped[joint] != 0.0 && off.abs() <= most {
                self.jumped[joint] = 0.0;
            } else if moved.abs() > most {
                self.jumped[joint] = off;
            }
            if self.jumped[joint] != 0.0 && found.is_ok() {
                found =
                    Err(SampleFault::Jump { joint, off: self.jumped[joint], most, kind: chain.joints()[joint].kind });
            }
        }
        found
    }
}
