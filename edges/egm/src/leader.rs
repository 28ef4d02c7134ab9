//! Where the arm is led when other programs lead it: their twist in place of the robot's planned path, and the commanded
//! joint positions that follow from it.

use admittance_client::{LeadLimits, LeadRefusal, Led, OpenError};
use ipc_types::{IpcSettings, MAX_JOINTS};

use crate::arm::AnyArm;
use crate::guide::Bearing;
use crate::lead::Lead;
use crate::reading::Reading;

/// A program's twist as where the robot is led.
pub(crate) struct Leader {
    led: Led,
    commanded: Option<Commanded>,
}

/// q0, which goes on with ṗ0 whatever the offset does.
#[derive(Clone, Copy)]
struct Commanded {
    /// Rad or m.
    position: [f64; MAX_JOINTS],
    /// J⁻¹(q) ṗ0, rad/s or m/s.
    velocity: [f64; MAX_JOINTS],
    stamp_ns: u64,
}

impl Leader {
    pub(crate) fn open(settings: &IpcSettings, limits: LeadLimits) -> Result<Self, OpenError> {
        Ok(Self { led: Led::open(settings, "admittance-egm twist", limits)?, commanded: None })
    }

    /// A session begins, in which the arm stands.
    pub(crate) fn rest(&mut self) {
        self.led.rest();
        self.commanded = None;
    }

    /// ṗ0 and q0 of a sample.
    pub(crate) fn lead(&mut self, arm: &dyn AnyArm, reading: &Reading, stamp_ns: u64, now_ns: u64) -> Lead {
        if !reading.follows {
            self.led.halt();
        }
        let twist = self.led.twist(now_ns, &arm.tool(&reading.position), say);
        let position = match self.commanded.filter(|_| reading.follows) {
            // It begins where the arm is.
            None => reading.position,
            Some(before) => {
                let elapsed_s = stamp_ns.saturating_sub(before.stamp_ns) as f64 * 1e-9;
                std::array::from_fn(|joint| before.position[joint] + before.velocity[joint] * elapsed_s)
            }
        };
        let velocity = arm.joint_velocity(&reading.position, &twist).unwrap_or([0.0; MAX_JOINTS]);
        self.commanded = Some(Commanded { position, velocity, stamp_ns });
        Lead { twist, position }
    }

    /// Puts ṗ0 of this instant there, between two samples: no faster than the daemon was told.
    pub(crate) fn go_on(&mut self, bearing: &mut Bearing, now_ns: u64) {
        bearing.twist = self.led.coast(now_ns);
    }

    /// The joints hold: where they were led no longer counts, and how fast does not either.
    pub(crate) fn hold(&mut self) {
        self.led.halt();
        self.commanded = None;
    }
}

/// At powers of two: a line for each would fill the log and block the loop.
fn say(refusal: &LeadRefusal, count: u64) {
    if count.is_power_of_two() {
        tracing::warn!("a twist that is not followed: {refusal} ({count} so far)");
    }
}
