//! A motion controller's whole side in one: ports, identity of its samples, playback. One cycle is
//! [`Controller::begin`], [`Controller::publish`], [`Controller::receive`] until the answer is there or due,
//! [`Controller::apply`] whenever the joints are told what to follow, and [`Controller::make_ready`] in the slack.

use ipc_types::{CommandSample, IpcSettings, Listener, MAX_JOINTS, StateSample};

use crate::{Applied, LimitError, Limits, OpenError, Playback, Ports, Reception, Rejection, Slot};

/// What a motion controller and the daemon have agreed on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arm {
    /// Joints, 1 to 8.
    pub joint_count: usize,
    /// Time from sample to sample in ns.
    pub sampling_time_ns: u64,
    /// When the command of a sample acts, in ns after its stamp: `control.command_delay_s`.
    pub command_delay_ns: u64,
    /// The controller's own limits.
    pub limits: Limits,
}

/// Why a controller could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum ControllerError {
    /// A number of joints that no sample holds.
    #[error("joint_count = {got}: accepted: 1 to 8")]
    JointCount {
        /// The number.
        got: usize,
    },
    /// Cycles without length.
    #[error("sampling_time_ns = 0: accepted: above 0")]
    SamplingTime,
    /// A delay that would need more samples under way than are kept.
    #[error("command_delay_ns = {got}: accepted: at most {accepted}, which is 1000 sampling times")]
    CommandDelay {
        /// The delay.
        got: u64,
        /// The longest.
        accepted: u64,
    },
    /// A limit is none.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The ports do not open.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// Sampling times that a command delay may last.
const LONGEST_DELAY: u64 = 1000;

impl Arm {
    fn validate(&self) -> Result<(), ControllerError> {
        if !(1..=MAX_JOINTS).contains(&self.joint_count) {
            return Err(ControllerError::JointCount { got: self.joint_count });
        }
        if self.sampling_time_ns == 0 {
            return Err(ControllerError::SamplingTime);
        }
        let accepted = self.sampling_time_ns.saturating_mul(LONGEST_DELAY);
        if self.command_delay_ns > accepted {
            return Err(ControllerError::CommandDelay { got: self.command_delay_ns, accepted });
        }
        Ok(self.limits.validate(self.joint_count)?)
    }

    fn playback(&self) -> Playback {
        Playback::with_limits(self.joint_count, self.command_delay_ns, self.sampling_time_ns, self.limits)
    }
}

/// Ports and playback of one boot of a motion controller.
pub struct Controller {
    playback: Playback,
    /// Room for the next sample.
    slot: Option<Slot>,
    newest: Option<CommandSample>,
    arm: Arm,
    boot_id: u64,
    sequence: u64,
    ports: Ports,
}

impl std::fmt::Debug for Controller {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Controller {:#x} at sample {}", self.boot_id, self.sequence)
    }
}

impl Controller {
    /// Opens the ports; `name` is the node's name for tools. `boot_id` is chosen anew at each start, and not 0.
    ///
    /// # Errors
    /// [`ControllerError`].
    pub fn open(settings: &IpcSettings, name: &str, arm: &Arm, boot_id: u64) -> Result<Self, ControllerError> {
        arm.validate()?;
        let ports = Ports::open(settings, name)?;
        let slot = ports.loan();
        Ok(Self { playback: arm.playback(), slot, newest: None, arm: *arm, boot_id, sequence: 0, ports })
    }

    /// Begins another boot on the same ports: samples are numbered from 1 again, and no answer to an earlier one is used.
    pub fn restart(&mut self, boot_id: u64) {
        (self.playback, self.newest) = (self.arm.playback(), None);
        (self.boot_id, self.sequence) = (boot_id, 0);
    }

    /// A cycle begins whose state was measured at `stamp_ns`: the sample with its identity filled in, and no
    /// measurement yet. It says `plays_plan = 1`: the joints are to follow [`Self::apply`] at each instant that
    /// [`Self::next_change`] tells; a controller that does not, sets it to 0.
    pub fn begin(&mut self, stamp_ns: u64) -> StateSample {
        self.sequence += 1;
        self.playback.begin_sample(self.sequence, stamp_ns);
        StateSample {
            sequence: self.sequence,
            stamp_ns,
            boot_id: self.boot_id,
            applied_command_sequence: self.playback.applied_sequence(),
            joint_count: self.arm.joint_count as u32,
            plays_plan: 1,
            ..StateSample::zeroed()
        }
    }

    /// Publishes the sample and wakes the daemon. False when there was no room for it: the sample is then missed.
    pub fn publish(&mut self, sample: &StateSample) -> bool {
        let Some(slot) = self.slot.take().or_else(|| self.ports.loan()) else { return false };
        self.ports.send(slot, sample);
        self.ports.notify();
        true
    }

    /// Makes room for the next sample, so that publishing it need not: in the slack of a cycle.
    pub fn make_ready(&mut self) {
        if self.slot.is_none() {
            self.slot = self.ports.loan();
        }
    }

    /// Takes the newest answer that has not been taken yet, if there is one; it does not wait. `now_ns` says whether
    /// it is there before it has to act.
    ///
    /// # Errors
    /// [`Rejection`]: the answer is not used and counts as rejected.
    pub fn receive(&mut self, now_ns: u64) -> Result<Option<Reception>, Rejection> {
        let Some(command) = self.ports.command() else { return Ok(None) };
        let reception = self.playback.receive(&command, now_ns)?;
        self.newest = Some(command);
        Ok(Some(reception))
    }

    /// A listener that the daemon notifies of each answer, for who would rather wait for one than look for it.
    /// It is dropped before this controller: the last to go clears up.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn answers(&self) -> Result<Listener, OpenError> {
        self.ports.answers()
    }

    /// Puts the commands in force that are due by `now_ns`, and says what the joints are to do.
    pub fn apply(&mut self, now_ns: u64) -> Applied {
        self.playback.apply_due(now_ns);
        self.playback.applied(now_ns)
    }

    /// What the joints add to their commanded velocity then, rad/s or m/s, after [`Self::apply`]: of a controller that
    /// says `follows_joint_velocity = 1` in its samples.
    pub fn joint_velocity_offset(&self, now_ns: u64) -> [f64; MAX_JOINTS] {
        self.playback.joint_velocity_offset(now_ns)
    }

    /// The next instant after `now_ns` at which [`Self::apply`] says something else; `None` while nothing is due.
    pub fn next_change(&self, now_ns: u64) -> Option<u64> {
        let changes = [self.playback.next_due(), self.playback.next_change(now_ns)];
        changes.into_iter().flatten().min()
    }

    /// The newest answer that was accepted: mode, verdict and the rest of what the daemon says.
    pub fn newest(&self) -> Option<&CommandSample> {
        self.newest.as_ref()
    }

    /// What became of the answers so far.
    pub fn playback(&self) -> &Playback {
        &self.playback
    }

    /// Number of the sample of this cycle; 0 before the first.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }
}
