//! Jumps of the measured joint position: what no joint can have moved since the sample before is an encoder or a sender gone
//! wrong, and a pose that is off by a millimetre is a force that is off by the stiffness times that.

use nalgebra::SVector;

use crate::sample::{Sample, SampleFault};

/// Speed in rad/s that no joint passes where no limit is configured: twice that of a fast wrist.
const FASTEST: f64 = 20.0;
/// A configured limit binds the reference under control; in free motion the motion controller may pass it, and stamps jitter.
const BEYOND_LIMIT: f64 = 2.0;
/// Resolution and noise of a joint position, rad.
const RESOLUTION: f64 = 1e-3;

/// The joint position from sample to sample. Samples that jumped are followed as well: the arm does not come to be where they
/// say because time goes by, only by returning to where it can be, or by a person's word.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionTrack<const N: usize> {
    seen: Option<Seen<N>>,
    /// By how much each joint is off where it can be, rad; 0 unless it jumped.
    jumped: SVector<f64, N>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen<const N: usize> {
    boot_id: u64,
    /// ns.
    stamp: u64,
    /// rad.
    position: SVector<f64, N>,
}

impl<const N: usize> PositionTrack<N> {
    /// Nothing seen.
    pub(crate) fn new() -> Self {
        Self { seen: None, jumped: SVector::zeros() }
    }

    /// Takes the position of a sample that is in order otherwise. `joint_speed`: the configured limits, rad/s.
    ///
    /// # Errors
    /// [`SampleFault::Jump`] of the first joint that is not where it can be.
    pub(crate) fn follow<const D: usize>(
        &mut self,
        sample: &Sample<N, D>,
        joint_speed: Option<&SVector<f64, N>>,
    ) -> Result<(), SampleFault> {
        let now = Seen { boot_id: sample.boot_id, stamp: sample.stamp, position: sample.joint_position };
        let Some(before) = self.seen.replace(now).filter(|before| before.boot_id == now.boot_id) else {
            self.jumped = SVector::zeros();
            return Ok(());
        };
        let elapsed = now.stamp.saturating_sub(before.stamp) as f64 * 1e-9;
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
                found = Err(SampleFault::Jump { joint, off: self.jumped[joint], most });
            }
        }
        found
    }

    /// Believes the next sample, wherever it is: for an arm that is not under control.
    pub(crate) fn forget(&mut self) {
        *self = Self::new();
    }
}
