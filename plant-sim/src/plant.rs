//! The plant: joint loops, contact and wrench estimate of one arm, stepped from sample to sample.
//! It has no clock and does no input or output; time is in nanoseconds and passed along by the
//! steps themselves.

mod dead_time;
mod divergence;
mod led;
mod measurement;
mod parameters;
mod pressing;
mod retreat;
mod streaming;
mod substep;

pub use divergence::Divergence;
pub use led::Led;
pub use measurement::CycleTiming;
pub use parameters::PlantParameters;
pub use retreat::Retreated;

use dead_time::DeadTime;
use measurement::Peaks;
use retreat::Retreat;
use streaming::Streaming;

use crate::environment::{Contact, Surface};
use crate::faults::FaultKind;
use crate::joint_loop::JointState;
use crate::joints::PreparedStep;
use crate::maxwell::Creep;
use crate::motion::{MINIMUM_RECIPROCAL_CONDITION, advance_reference, commanded_joint_velocity};
use crate::rigid_body::Overload;
use crate::seconds;
use crate::wrench_estimate::{DelayLine, EstimateStep};
use admittance_client::{Applied, Playback, Reception, Rejection};
use admittance_core::robot::{Chain, Kinematics};
use ipc_types::{CommandSample, MAX_JOINTS, StateSample, TruthSample};
use nalgebra::{SVector, Vector3};

#[derive(Debug, Clone, Copy)]
struct Substep<const N: usize, const D: usize> {
    duration_ns: u64,
    joints: PreparedStep<N>,
    /// Part of the way to the true q̇ that the reported one goes.
    velocity_share: f64,
    estimate: EstimateStep<D>,
}

/// The plant at the instant of its current sample.
#[derive(Debug, Clone)]
pub struct Plant<const N: usize, const D: usize> {
    parameters: PlantParameters<N, D>,
    playback: Playback,
    delay_line: DelayLine<D>,
    usual_substep: Substep<N, D>,
    /// Largest distance in m of the TCP from each joint's axis, whatever the pose.
    reach: SVector<f64, N>,
    now_ns: u64,
    /// Instant of the current sample, ns.
    began_ns: u64,
    sequence: u64,
    index: i64,
    /// When the motion began, in ns; `None` before.
    motion_began_ns: Option<u64>,
    joints: JointState<N>,
    /// q̇ as the controller reports it, rad/s.
    reported_velocity: SVector<f64, N>,
    /// q̇_ref on its way to the loops.
    dead_time: DeadTime<N>,
    /// Between the two, where the drives refuse jumps.
    streaming: Option<Streaming<N>>,
    position_reference: SVector<f64, N>,
    /// q̇0 from the current sample to the next, rad/s or m/s; zero of an arm that follows a twist.
    velocity_reference: SVector<f64, N>,
    kinematics: Kinematics<N>,
    creep: Creep,
    contact: Contact,
    /// Wrench on the task axes that accelerates the tool, N and N m.
    tool_inertia: SVector<f64, D>,
    touched: bool,
    contact_losses: u32,
    peaks: Peaks,
    singular: bool,
    divergence: Option<Divergence>,
    /// Drives that cannot hold the arm where it starts.
    overloads: Vec<Overload>,
    /// Where another program leads the arm, from this sample and from the next one on, m/s and rad/s; `None` where the motion
    /// does.
    lead: Option<[SVector<f64, D>; 2]>,
    /// The way out of the surface, once it has begun.
    retreat: Option<Retreat>,
    sample: StateSample,
}

impl<const N: usize, const D: usize> Plant<N, D> {
    /// The plant at its first sample.
    pub fn new(mut parameters: PlantParameters<N, D>) -> Self {
        let kinematics = parameters.chain.kinematics(&parameters.start);
        let creep = Creep::default();
        let contact = contact_of(parameters.surface.as_ref(), &kinematics, &SVector::zeros(), &creep, 0.0);
        parameters.joints = parameters.joints.resting_at(&parameters.start, &contact.force);
        let index = -parameters.waiting_samples();
        let substeps = parameters.wrench_delay_ns / parameters.substep_ns.max(1);
        let cycles = parameters.wrench_delay_ns / parameters.sampling_time_ns + 1;
        // Besides the substeps, each plan step and each command ends an interval.
        let delayed_values = substeps + cycles * (ipc_types::MAX_PLAN as u64 + 4);
        let longest_ns = parameters.dead_time_ns.iter().copied().max().unwrap_or(0);
        let changes = (longest_ns / parameters.sampling_time_ns + 2) * (ipc_types::MAX_PLAN as u64 + 4);
        let mut plant = Self {
            playback: Playback::new(N, parameters.command_delay_ns, parameters.sampling_time_ns),
            delay_line: DelayLine::new(parameters.wrench_delay_ns, delayed_values as usize),
            usual_substep: substep_of(&parameters, parameters.substep_ns),
            reach: reach_of(&parameters.chain),
            now_ns: parameters.first_stamp_ns,
            began_ns: parameters.first_stamp_ns,
            sequence: 1,
            index,
            motion_began_ns: (index == 0).then_some(parameters.first_stamp_ns),
            joints: JointState::at_rest(parameters.start),
            reported_velocity: SVector::zeros(),
            dead_time: DeadTime::new(parameters.dead_time_ns, changes as usize),
            streaming: parameters.drives.map(|drives| {
                let longest_ns = 4 * parameters.sampling_time_ns;
                Streaming::new(drives, parameters.first_stamp_ns, parameters.command_delay_ns, longest_ns)
            }),
            position_reference: parameters.start,
            velocity_reference: SVector::zeros(),
            kinematics,
            creep,
            contact,
            tool_inertia: SVector::zeros(),
            touched: contact.touches,
            contact_losses: 0,
            peaks: Peaks::of(&contact),
            singular: false,
            divergence: None,
            overloads: parameters.joints.overloads(),
            lead: None,
            retreat: None,
            sample: StateSample::zeroed(),
            parameters,
        };
        plant.playback.begin_sample(plant.sequence, plant.now_ns);
        plant.measure();
        plant
    }

    /// The state sample of the current instant, faults and noise included.
    pub fn sample(&self) -> &StateSample {
        &self.sample
    }

    /// Whether the sample is published at all.
    pub fn publishes(&self) -> bool {
        self.parameters.faults.publishes(self.index)
    }

    /// Whether the daemon is notified of the sample.
    pub fn notifies(&self) -> bool {
        !self.fault(FaultKind::Unnotified)
    }

    /// Stamp of the current sample in ns, also when a fault shows another one.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Takes a command that became visible at `visible_ns`; `None` when a fault hides it.
    ///
    /// # Errors
    /// [`Rejection`] when the command is not acceptable; it then counts as missed.
    pub fn receive(&mut self, command: &CommandSample, visible_ns: u64) -> Result<Option<Reception>, Rejection> {
        if self.fault(FaultKind::CommandLoss) {
            return Ok(None);
        }
        self.playback.receive(command, visible_ns).map(Some)
    }

    /// Commands and their fate so far.
    pub fn playback(&self) -> &Playback {
        &self.playback
    }

    /// Ends the wait for commands of this sample and returns the truth at its instant. Call once
    /// per cycle, before [`Self::integrate`].
    pub fn settle(&mut self, timing: CycleTiming) -> TruthSample {
        let end_ns = self.now_ns + self.cycle_ns();
        let missed = self.playback.is_missing(end_ns);
        // Counted here, because a command that is due at this very instant would otherwise count
        // twice.
        let missed_commands = self.playback.missed() + u64::from(missed);
        self.playback.apply_due(self.now_ns);
        self.truth(&Led { timing, applied: self.applied(), missed, missed_commands })
    }

    /// Goes on to the next sample: the joints follow the commands, each from the instant at which
    /// it acts.
    pub fn integrate(&mut self) {
        let cycle_ns = self.cycle_ns();
        let twist = self.twist_reference();
        self.pass_cycle(&twist);
        self.lead_on(&twist, cycle_ns);
    }

    /// The commanded position goes on with the twist, and what is then is measured.
    fn lead_on(&mut self, twist: &SVector<f64, D>, cycle_ns: u64) {
        let duration_s = seconds(cycle_ns);
        // Of the sample before: the cycle that ends here.
        let beside = if self.is_commanded() { self.parameters.motion.beside(self.index - 1) } else { SVector::zeros() };
        match advance_reference(&self.parameters.chain, &self.position_reference, twist, &beside, duration_s) {
            Ok(position) => self.position_reference = position,
            Err(_) => self.singular = true,
        }
        self.go_on_retreating();
        self.measure();
    }

    /// Goes to the instant of the next sample, without anything that a controller would be shown.
    pub(crate) fn integrate_unseen(&mut self) {
        let twist = self.twist_reference();
        self.pass_cycle(&twist);
    }

    fn pass_cycle(&mut self, twist: &SVector<f64, D>) {
        let start_ns = self.now_ns;
        let end_ns = start_ns + self.cycle_ns();
        self.streaming.iter_mut().for_each(Streaming::forget);
        while self.now_ns < end_ns {
            self.playback.apply_due(self.now_ns);
            self.update_reference(twist);
            let streamed = self.streaming.as_ref().map(Streaming::next_ns);
            let until_ns = [self.playback.next_due(), self.playback.next_change(self.now_ns), streamed];
            let until_ns = until_ns.into_iter().flatten().fold(end_ns, u64::min);
            self.integrate_until(until_ns, start_ns);
        }
        self.enter_sample(self.playback.has_received());
    }

    fn enter_sample(&mut self, has_received: bool) {
        if self.index < 0 && self.parameters.wait_for_command && !has_received {
            self.index = -self.parameters.waiting_samples();
        } else {
            self.index += 1;
        }
        if self.index == 0 {
            self.motion_began_ns = Some(self.now_ns);
        }
        self.lead = self.lead.map(|[_, next]| [next, next]);
        self.sequence += self.parameters.faults.sequence_step(self.index);
        self.began_ns = self.now_ns;
        self.playback.begin_sample(self.sequence, self.now_ns);
    }

    /// Index of the current sample, 0 at the start of the motion and negative before.
    pub fn index(&self) -> i64 {
        self.index
    }

    /// Whether the motion is over: its last sample is behind.
    pub fn is_finished(&self) -> bool {
        self.index > self.parameters.motion.samples()
    }

    /// Whether the arm or its command met a pose at which J has no inverse; the joints are then
    /// held there.
    pub fn met_singularity(&self) -> bool {
        self.singular
    }

    /// Where the motion ended to be finite, if it did; the joints are then held there.
    pub fn divergence(&self) -> Option<Divergence> {
        self.divergence
    }

    /// What of the scenario the arm cannot do, though it runs.
    pub fn overloads(&self) -> &[Overload] {
        &self.overloads
    }

    /// True joint position in rad.
    pub fn joint_position(&self) -> &SVector<f64, N> {
        &self.joints.position
    }

    /// True TCP position in m, base frame.
    pub fn tcp_position(&self) -> Vector3<f64> {
        self.kinematics.pose.position
    }

    /// Integrates to an instant within the current cycle, as [`Self::integrate`] would pass through
    /// it.
    pub(crate) fn integrate_partly(&mut self, instant_ns: u64) {
        let start_ns = self.now_ns;
        let twist = self.twist_reference();
        self.playback.apply_due(self.now_ns);
        self.update_reference(&twist);
        let next = |plant: &Self| {
            let streamed = plant.streaming.as_ref().map(Streaming::next_ns);
            [plant.playback.next_due(), streamed].into_iter().flatten().min().filter(|due_ns| *due_ns <= instant_ns)
        };
        while let Some(due_ns) = next(self) {
            self.integrate_until(due_ns, start_ns);
            self.playback.apply_due(self.now_ns);
            self.update_reference(&twist);
        }
        self.integrate_until(instant_ns, start_ns);
    }

    /// Time of the current sample in s from the start of the motion.
    fn scenario_time_s(&self) -> f64 {
        self.index as f64 * seconds(self.parameters.sampling_time_ns)
    }

    /// Time in s from the start of the motion; 0 before.
    fn time_s(&self) -> f64 {
        self.motion_began_ns.map_or(0.0, |began_ns| seconds(self.now_ns - began_ns))
    }

    /// How long the current cycle lasts.
    fn cycle_ns(&self) -> u64 {
        self.parameters.sampling_time_ns + self.parameters.faults.overrun_ns(self.index)
    }

    fn fault(&self, kind: FaultKind) -> bool {
        self.parameters.faults.active(kind, self.index)
    }

    fn twist_reference(&self) -> SVector<f64, D> {
        if self.fault(FaultKind::DrivesDisabled) { SVector::zeros() } else { self.commanded_twist() }
    }

    /// q̇_ref = J⁻¹(q)(ṗ0 + Δṗ), or zero when holding.
    fn update_reference(&mut self, twist: &SVector<f64, D>) {
        let applied = self.applied();
        let mut reference = if self.parameters.follows_joint_velocity {
            self.joints_told(&applied)
        } else {
            self.reference_of(&applied, twist)
        };
        let is_braked = self.fault(FaultKind::DrivesDisabled);
        if let Some(streaming) = &mut self.streaming {
            if is_braked {
                streaming.stand();
            }
            let Some(given) = streaming.next(self.now_ns, &reference) else { return };
            reference = given;
        }
        self.dead_time.push(self.now_ns, &reference);
    }

    /// The references that went to drives that refuse jumps in the last cycle, rad/s or m/s: what was asked for at each,
    /// and what they were given. None where the scenario has no `[drives]`.
    pub fn streamed(&self) -> (&[SVector<f64, N>], &[SVector<f64, N>]) {
        self.streaming.as_ref().map_or((&[], &[]), Streaming::of_cycle)
    }

    /// q̇_ref = q̇0 and what the daemon adds to it, or zero when holding.
    fn joints_told(&self, applied: &Applied) -> SVector<f64, N> {
        if *applied == Applied::Hold || self.fault(FaultKind::DrivesDisabled) {
            return SVector::zeros();
        }
        let added = if self.is_jogged() { [0.0; MAX_JOINTS] } else { self.playback.joint_velocity_offset(self.now_ns) };
        SVector::from_fn(|joint, _| self.velocity_reference[joint] + added[joint])
    }

    /// What the joints are commanded from the current sample to the next.
    fn update_velocity_reference(&mut self) {
        if !self.parameters.follows_joint_velocity {
            return;
        }
        let twist = self.twist_reference();
        let is_still = self.fault(FaultKind::DrivesDisabled) || !self.is_commanded();
        let beside = if is_still { SVector::zeros() } else { self.parameters.motion.beside(self.index) };
        match commanded_joint_velocity(&self.parameters.chain, &self.position_reference, &twist, &beside) {
            Ok(velocity) => self.velocity_reference = velocity,
            Err(_) => (self.singular, self.velocity_reference) = (true, SVector::zeros()),
        }
    }

    fn reference_of(&mut self, applied: &Applied, twist: &SVector<f64, D>) -> SVector<f64, N> {
        let Applied::Offset(offset) = applied else { return SVector::zeros() };
        let twist = SVector::<f64, D>::from_fn(|axis, _| twist[axis] + offset[axis]);
        if self.fault(FaultKind::DrivesDisabled) || twist.iter().all(|value| *value == 0.0) {
            return SVector::zeros();
        }
        match self.kinematics.inverse::<D>(MINIMUM_RECIPROCAL_CONDITION) {
            Ok(inverse) => inverse.joint_velocity(&twist),
            Err(_) => {
                self.singular = true;
                SVector::zeros()
            }
        }
    }

    /// Constant velocity reference from here to `until_ns`, which each joint follows after its dead
    /// time; substeps lie on a grid that starts at `start_ns`.
    fn integrate_until(&mut self, until_ns: u64, start_ns: u64) {
        while self.now_ns < until_ns {
            let reference = self.dead_time.reached(self.now_ns);
            let next_ns = self.dead_time.next_change(self.now_ns).map_or(until_ns, |change| change.min(until_ns));
            self.follow_until(next_ns, start_ns, &reference);
        }
    }

    fn follow_until(&mut self, until_ns: u64, start_ns: u64, reference: &SVector<f64, N>) {
        let grid_ns = self.parameters.substep_ns;
        while self.now_ns < until_ns {
            let from_ns = self.now_ns;
            let is_free = self.stays_free(until_ns - from_ns, reference);
            if is_free && self.steps_are_exact(reference) {
                self.substep(until_ns - from_ns, reference, false);
                continue;
            }
            let on_grid = |now_ns: u64| until_ns.min(start_ns + ((now_ns - start_ns) / grid_ns + 1) * grid_ns);
            // The steps of a free arm differ in what is reported alone: where it is shows at their end.
            while is_free && self.now_ns < until_ns {
                self.substep(on_grid(self.now_ns) - self.now_ns, reference, true);
            }
            if is_free {
                self.look(until_ns - from_ns);
            } else {
                self.substep(on_grid(from_ns) - from_ns, reference, false);
            }
        }
    }
}

/// The gap that the truth shows where there is no surface: finite, as its contract says, and beyond
/// any arm.
const NO_SURFACE_GAP_M: f64 = 1e6;

fn substep_of<const N: usize, const D: usize>(parameters: &PlantParameters<N, D>, duration_ns: u64) -> Substep<N, D> {
    let duration_s = seconds(duration_ns);
    let lag_s = parameters.velocity_lag_s;
    Substep {
        duration_ns,
        joints: parameters.joints.prepare(duration_ns),
        velocity_share: if lag_s > 0.0 { -(-duration_s / lag_s).exp_m1() } else { 1.0 },
        estimate: parameters.estimate.step(duration_s),
    }
}

fn contact_of<const N: usize>(
    surface: Option<&Surface>,
    kinematics: &Kinematics<N>,
    velocity: &SVector<f64, N>,
    creep: &Creep,
    time_s: f64,
) -> Contact {
    let Some(surface) = surface else { return Contact::none(-NO_SURFACE_GAP_M) };
    let tcp_velocity = if surface.needs_velocity() {
        (kinematics.jacobian * velocity).fixed_rows::<3>(0).into_owned()
    } else {
        Vector3::zeros()
    };
    surface.contact(&kinematics.pose.position, &tcp_velocity, creep, time_s)
}

/// Upper bound of the TCP's distance from each joint's axis: the length of everything after the
/// joint.
fn reach_of<const N: usize>(chain: &Chain<N>) -> SVector<f64, N> {
    let mut reach = SVector::zeros();
    let mut length = chain.tool().position.norm();
    for (joint, description) in chain.joints().iter().enumerate().rev() {
        reach[joint] = length;
        length += description.origin.norm();
    }
    reach
}
