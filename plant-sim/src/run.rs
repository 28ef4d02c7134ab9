//! A plant of any of the known arms behind one interface, and its run in virtual time.

use admittance_client::{Applied, Reception, Rejection, Rotation};
use admittance_core::with_arm;
use ipc_types::{CommandSample, MAX_JOINTS, StateSample, TASK_AXES, TruthSample, VirtualPlant};

use crate::plant::{CycleTiming, Divergence, Led, Plant, Retreated};
use crate::rigid_body::Overload;
use crate::scenario::Scenario;
use crate::setup::{self, SetupError};

/// What a person is told of a run that met a singular pose.
pub const SINGULAR: &str = "the arm met a pose at which its Jacobian has no inverse: change the scenario's motion";

/// A plant, whatever its arm.
pub trait AnyPlant {
    /// The state sample of the current instant.
    fn sample(&self) -> &StateSample;
    /// Whether the sample is published.
    fn publishes(&self) -> bool;
    /// Whether the daemon is notified of it.
    fn notifies(&self) -> bool;
    /// Stamp of the current sample in ns.
    fn now_ns(&self) -> u64;
    /// Takes a command that became visible at `visible_ns`. True when it is there before it has to
    /// act.
    ///
    /// # Errors
    /// [`Rejection`].
    fn receive(&mut self, command: &CommandSample, visible_ns: u64) -> Result<bool, Rejection>;
    /// Ends the wait for commands of this sample and returns the truth at its instant.
    fn settle(&mut self, timing: CycleTiming) -> TruthSample;
    /// Goes on to the next sample.
    fn integrate(&mut self);
    /// See [`Plant::lead`].
    fn lead(&mut self, twist: &[f64; TASK_AXES]);
    /// See [`Plant::tool_axes`].
    fn tool_axes(&self) -> Rotation;
    /// See [`Plant::cycle_end_ns`].
    fn cycle_end_ns(&self) -> u64;
    /// See [`Plant::shows_commands`].
    fn shows_commands(&self) -> bool;
    /// See [`Plant::led_truth`].
    fn led_truth(&mut self, led: &Led) -> TruthSample;
    /// See [`Plant::follow`].
    fn follow(&mut self, applied: &Applied, until_ns: u64);
    /// See [`Plant::follow_joints`].
    fn follow_joints(&mut self, speeds: &[f64; MAX_JOINTS], until_ns: u64);
    /// See [`Plant::arrive`].
    fn arrive(&mut self, has_received: bool);
    /// Whether a valid command was ever received.
    fn has_received(&self) -> bool;
    /// Commands that were not accepted.
    fn rejected(&self) -> u64;
    /// Whether the motion is over.
    fn is_finished(&self) -> bool;
    /// Whether the arm met a singular pose.
    fn met_singularity(&self) -> bool;
    /// Where the motion ended to be finite; `None` as long as it is.
    fn divergence(&self) -> Option<Divergence>;
    /// Drives that cannot hold the arm where it starts.
    fn overloads(&self) -> &[Overload];
    /// Ends the motion and moves the tool out of the surface, if it is not clear of it.
    fn begin_retreat(&mut self);
    /// How that ended; `None` before.
    fn retreated(&self) -> Option<Retreated>;
    /// See [`Plant::streamed`]: of each reference what was asked for, and what the drives were given.
    fn streamed(&self) -> Vec<[Vec<f64>; 2]>;
}

impl<const N: usize, const D: usize> AnyPlant for Plant<N, D> {
    fn sample(&self) -> &StateSample {
        self.sample()
    }

    fn publishes(&self) -> bool {
        self.publishes()
    }

    fn notifies(&self) -> bool {
        self.notifies()
    }

    fn now_ns(&self) -> u64 {
        self.now_ns()
    }

    fn receive(&mut self, command: &CommandSample, visible_ns: u64) -> Result<bool, Rejection> {
        self.receive(command, visible_ns).map(|reception| reception == Some(Reception::InTime))
    }

    fn settle(&mut self, timing: CycleTiming) -> TruthSample {
        self.settle(timing)
    }

    fn integrate(&mut self) {
        self.integrate();
    }

    fn lead(&mut self, twist: &[f64; TASK_AXES]) {
        self.lead(twist);
    }

    fn tool_axes(&self) -> Rotation {
        self.tool_axes()
    }

    fn cycle_end_ns(&self) -> u64 {
        self.cycle_end_ns()
    }

    fn shows_commands(&self) -> bool {
        self.shows_commands()
    }

    fn led_truth(&mut self, led: &Led) -> TruthSample {
        self.led_truth(led)
    }

    fn follow(&mut self, applied: &Applied, until_ns: u64) {
        self.follow(applied, until_ns);
    }

    fn follow_joints(&mut self, speeds: &[f64; MAX_JOINTS], until_ns: u64) {
        self.follow_joints(speeds, until_ns);
    }

    fn arrive(&mut self, has_received: bool) {
        self.arrive(has_received);
    }

    fn has_received(&self) -> bool {
        self.playback().has_received()
    }

    fn rejected(&self) -> u64 {
        self.playback().rejected()
    }

    fn is_finished(&self) -> bool {
        self.is_finished()
    }

    fn met_singularity(&self) -> bool {
        self.met_singularity()
    }

    fn divergence(&self) -> Option<Divergence> {
        self.divergence()
    }

    fn overloads(&self) -> &[Overload] {
        self.overloads()
    }

    fn begin_retreat(&mut self) {
        self.begin_retreat();
    }

    fn retreated(&self) -> Option<Retreated> {
        self.retreated()
    }

    fn streamed(&self) -> Vec<[Vec<f64>; 2]> {
        let (asked, given) = self.streamed();
        asked.iter().zip(given).map(|(asked, given)| [asked, given].map(|r| r.as_slice().to_vec())).collect()
    }
}

/// The plant of a scenario; see [`setup::plant`].
///
/// # Errors
/// [`SetupError`].
pub fn any_plant(
    scenario: &Scenario,
    first_stamp_ns: u64,
    boot_id: u64,
    wait_for_command: bool,
) -> Result<Box<dyn AnyPlant>, SetupError> {
    let (joints, axes) = (scenario.robot.joint.len(), scenario.robot.task_axes);
    with_arm!((joints, axes), <N, D> => {
        Ok(Box::new(setup::plant::<N, D>(scenario, first_stamp_ns, boot_id, wait_for_command)?))
    }, else {
        Err(SetupError::Arm { joints, axes })
    })
}

/// Stamp of the first sample in virtual time: any instant that leaves room below.
const VIRTUAL_START_NS: u64 = 1_000_000_000;

/// A run in virtual time: no clock, no sleep, the same plant.
pub struct VirtualRun {
    plant: Box<dyn AnyPlant>,
}

impl std::fmt::Debug for VirtualRun {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "VirtualRun at {} ns", self.plant.now_ns())
    }
}

impl VirtualRun {
    /// A run of the scenario; the settling time passes whether or not commands come.
    ///
    /// # Errors
    /// [`SetupError`].
    pub fn new(scenario: &Scenario) -> Result<Self, SetupError> {
        Ok(Self { plant: any_plant(scenario, VIRTUAL_START_NS, 1, false)? })
    }

    /// Whether the arm met a singular pose; its joints are then held there.
    pub fn met_singularity(&self) -> bool {
        self.plant.met_singularity()
    }

    /// Drives that cannot hold the arm where it starts.
    pub fn overloads(&self) -> &[Overload] {
        self.plant.overloads()
    }

    /// The references that went to the drives in the last cycle, where the scenario has `[drives]`: of each what was asked
    /// for, and what they were given.
    pub fn streamed(&self) -> Vec<[Vec<f64>; 2]> {
        self.plant.streamed()
    }
}

impl VirtualPlant for VirtualRun {
    fn sample(&self) -> Option<&StateSample> {
        self.plant.publishes().then(|| self.plant.sample())
    }

    fn now_ns(&self) -> u64 {
        self.plant.now_ns()
    }

    fn advance(&mut self, answer: Option<&CommandSample>) -> Result<TruthSample, String> {
        let now_ns = self.plant.now_ns();
        let received = answer.map_or(Ok(false), |command| self.plant.receive(command, now_ns));
        let truth = self.plant.settle(CycleTiming::default());
        self.plant.integrate();
        if let Some(divergence) = self.plant.divergence() {
            return Err(divergence.to_string());
        }
        received.map(|_| truth).map_err(|rejection| rejection.to_string())
    }

    fn is_finished(&self) -> bool {
        self.plant.is_finished()
    }
}
