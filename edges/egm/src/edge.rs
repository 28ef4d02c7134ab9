//! The loop: one message of the robot, one state sample, one answer. What is sent when nothing comes is decided here too.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use admittance_client::{Applied, Arm, Controller, ControllerError, LeadLimits, OpenError};
use admittance_host::arrival::ArrivalEstimate;
use admittance_host::clock::{monotonic_ns, pause, sleep_until_ns};
use admittance_host::notifications::Notifications;
use egm_messages::{EgmRobot, Message};
use ipc_types::{IpcSettings, MAX_JOINTS, StateSample};

use crate::fade;
use crate::guide::{Bearing, Guide};
use crate::lead::Lead;
use crate::leader::Leader;
use crate::link::{Link, Received};
use crate::notify::Notify;
use crate::reading::{BadMessage, Leads, Reading};
use crate::session::{Measured, Session};

/// A session is over when no message has counted for so long, in ns; the next message begins another one.
const SESSION_ENDS_NS: u64 = 100_000_000;
/// Zeros go on for so long after the last message that counted, in ns: the robot may still hear, though it is not heard.
const UNHEARD_NS: u64 = 1_000_000_000;
/// Messages with zeros before the program ends: one may be lost, ten are not.
const LAST_ZEROS: u32 = 10;
/// A signal ends the program after this time in ns at the latest, whatever the plan says.
const LONGEST_FAREWELL_NS: u64 = 500_000_000;
/// Time in ns between two looks for the daemon's answer, of which it notifies: a notification may be missed.
const LOOK_NS: u64 = 500_000;
/// The longest wait for a datagram, ns: the watchdog is fed meanwhile.
const LONGEST_WAIT_NS: u64 = 100_000_000;
/// Datagrams in a row after which what is due is looked at: a flood keeps nobody from his zeros.
const MOST_AT_ONCE: usize = 16;

/// What the loop is built with.
#[derive(Debug)]
pub(crate) struct Setup {
    pub(crate) settings: IpcSettings,
    pub(crate) arm: Arm,
    /// For how long before and after a message of the robot is due it is looked for again and again, ns.
    pub(crate) spin_ns: u64,
    /// How long the daemon's answer is awaited, ns from the arrival of the robot's message.
    pub(crate) answer_ns: u64,
    /// In rad/s or m/s.
    pub(crate) speed_limit: [f64; MAX_JOINTS],
    /// From `torqueRef` to N m on the joints' side; `None` where it is not looked at.
    pub(crate) torque_factor: Option<[f64; MAX_JOINTS]>,
    /// What other programs may ask for, where they lead the arm.
    pub(crate) lead: Option<LeadLimits>,
}

/// Why the loop cannot go on.
#[derive(Debug, thiserror::Error)]
pub(crate) enum EdgeError {
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error("the UDP socket: {0}")]
    Socket(#[from] io::Error),
}

/// The robot of a session.
#[derive(Debug)]
struct Peer {
    address: SocketAddr,
    session: Session,
    /// Where it was at the last sample; `None` before the first.
    bearing: Option<Bearing>,
    /// Arrival of the last message that counted, ns.
    heard_ns: u64,
}

/// What was not used, for the log.
#[derive(Debug, Default)]
struct Counts {
    strangers: u64,
    bad: u64,
    refused: u64,
    rejected: u64,
    unanswered: u64,
}

pub(crate) struct Edge {
    setup: Setup,
    guide: Guide,
    /// `None`: the robot's own program leads.
    leader: Option<Leader>,
    /// Before the controller, whose node goes last.
    answers: Notifications,
    controller: Controller,
    link: Link,
    stop: Arc<AtomicBool>,
    peer: Option<Peer>,
    /// When the robot's next message is due.
    arrival: ArrivalEstimate,
    /// Number of the next message to the robot.
    sequence: u32,
    /// The instant of the plan that was sent last, ns.
    played_ns: u64,
    /// When something has to be sent, though nothing came.
    due_ns: u64,
    counts: Counts,
}

/// How a message ended.
enum Outcome {
    /// It does not count.
    Ignored,
    /// It counts, and is no sample.
    Heard,
    Sample(Box<Measured>),
}

impl Edge {
    pub(crate) fn new(setup: Setup, guide: Guide, link: Link, stop: Arc<AtomicBool>) -> Result<Self, EdgeError> {
        let controller = Controller::open(&setup.settings, "admittance-egm", &setup.arm, boot_id())?;
        let answers = Notifications::new(controller.answers()?);
        let counts = Counts::default();
        let leader = setup.lead.map(|limits| Leader::open(&setup.settings, limits)).transpose()?;
        Ok(Self {
            arrival: ArrivalEstimate::new(setup.arm.sampling_time_ns),
            setup,
            guide,
            leader,
            controller,
            answers,
            link,
            stop,
            peer: None,
            sequence: 0,
            played_ns: 0,
            due_ns: 0,
            counts,
        })
    }

    /// Runs until a signal.
    pub(crate) fn run(&mut self, notify: &mut Notify) -> Result<(), EdgeError> {
        while !self.stop.load(Ordering::Relaxed) {
            self.turn(true)?;
            notify.turned();
        }
        Ok(())
    }

    /// The daemon has no further samples: its last plan is played to its end, ever slower.
    pub(crate) fn play_out(&mut self) -> Result<(), EdgeError> {
        let give_up_ns = monotonic_ns() + LONGEST_FAREWELL_NS;
        while self.peer.is_some()
            && !matches!(self.applied(self.played_ns).0, Applied::Hold)
            && monotonic_ns() < give_up_ns
        {
            self.turn(false)?;
        }
        Ok(())
    }

    /// Zeros, a few cycles long, whatever was before: the robot keeps the last speed that it was told.
    pub(crate) fn say_farewell(&mut self) {
        let Some(Peer { address, bearing, .. }) = self.peer.take() else { return };
        let external_axes = bearing.map_or(0, |bearing| bearing.external_axes);
        for _ in 0..LAST_ZEROS {
            self.send(&[0.0; MAX_JOINTS], external_axes, address);
            sleep_until_ns(monotonic_ns() + self.setup.arm.sampling_time_ns);
        }
        tracing::info!("the robot was sent zeros");
    }

    /// Waits for a message or for what is due, and answers it. `publishes`: messages become state samples.
    fn turn(&mut self, publishes: bool) -> Result<(), EdgeError> {
        self.wait();
        let mut taken = 0;
        while taken < MOST_AT_ONCE {
            let arrival_ns = monotonic_ns();
            let Some(outcome) = self.receive(arrival_ns)? else {
                if !self.is_nearly_due(arrival_ns) {
                    break;
                }
                self.arrival.look(false);
                pause();
                continue;
            };
            taken += 1;
            match outcome {
                Outcome::Ignored => {}
                Outcome::Heard => self.bridge(arrival_ns),
                Outcome::Sample(measured) => {
                    if publishes {
                        self.cycle(&measured, arrival_ns);
                    } else {
                        self.bridge(arrival_ns);
                    }
                    break;
                }
            }
        }
        if monotonic_ns() >= self.due_ns {
            self.bridge_silence();
        }
        Ok(())
    }

    /// Blocks until there is a datagram, until one is nearly due, or until something has to be sent.
    fn wait(&mut self) {
        let now_ns = monotonic_ns();
        let until_ns = if self.peer.is_some() { self.due_ns } else { u64::MAX };
        if self.is_nearly_due(now_ns) {
            return;
        }
        // A blocked thread wakes far later than one that looks.
        let looks_ns = self.looked_for_ns().map(|due_ns| due_ns.saturating_sub(self.setup.spin_ns));
        let looks_ns = looks_ns.filter(|looks_ns| now_ns < *looks_ns).unwrap_or(u64::MAX);
        self.link.wait(until_ns.min(looks_ns).saturating_sub(now_ns).min(LONGEST_WAIT_NS));
        self.arrival.look(monotonic_ns() >= looks_ns);
    }

    /// Whether the robot's next message is due, within the time for which it is looked for.
    fn is_nearly_due(&self, now_ns: u64) -> bool {
        self.looked_for_ns().is_some_and(|due_ns| due_ns.abs_diff(now_ns) < self.setup.spin_ns)
    }

    /// When a message is due that is looked for, ns.
    fn looked_for_ns(&self) -> Option<u64> {
        let looks = self.setup.spin_ns > 0 && self.peer.is_some();
        self.arrival.next().filter(|_| looks)
    }

    /// Takes a datagram; `None` when there is none.
    fn receive(&mut self, arrival_ns: u64) -> Result<Option<Outcome>, EdgeError> {
        let is_live = |peer: &Peer| arrival_ns.saturating_sub(peer.heard_ns) < SESSION_ENDS_NS;
        let (datagram, from) = match self.link.receive()? {
            None => return Ok(None),
            Some(Received::Datagram(datagram, from)) => (datagram, from),
            Some(Received::Stranger(from)) => {
                note(&mut self.counts.strangers, || format!("a datagram from {from}, which is not egm.robot_address"));
                return Ok(Some(Outcome::Ignored));
            }
            Some(Received::TooLong) => {
                note(&mut self.counts.bad, || "a datagram that is longer than any message".to_owned());
                return Ok(Some(Outcome::Ignored));
            }
        };
        if let Some(peer) = self.peer.as_ref().filter(|peer| is_live(peer) && peer.address != from) {
            let robot = peer.address;
            note(&mut self.counts.strangers, || format!("a datagram from {from}; the robot is {robot}"));
            return Ok(Some(Outcome::Ignored));
        }
        let message = EgmRobot::decode(datagram).map_err(BadMessage::from);
        let leads = if self.leader.is_some() { Leads::OtherPrograms } else { Leads::PlannedPath };
        let reading = match message.and_then(|message| Reading::of(&message, self.guide.units(), leads)) {
            Ok(reading) => reading,
            Err(bad) => {
                note(&mut self.counts.bad, || format!("a message that cannot be used: {bad}"));
                return Ok(Some(Outcome::Ignored));
            }
        };
        if !self.peer.as_ref().is_some_and(is_live) {
            self.begin_session(from, arrival_ns);
        }
        let Some(peer) = &mut self.peer else { return Ok(Some(Outcome::Ignored)) };
        let outcome = match peer.session.take(&reading, arrival_ns) {
            Ok(measured) => {
                peer.heard_ns = arrival_ns;
                measured.map_or(Outcome::Heard, |measured| Outcome::Sample(Box::new(measured)))
            }
            Err(refusal) => {
                note(&mut self.counts.refused, || refusal.to_string());
                Outcome::Ignored
            }
        };
        Ok(Some(outcome))
    }

    fn begin_session(&mut self, address: SocketAddr, arrival_ns: u64) {
        // Samples of another session are of another boot: nothing of what was before goes on.
        self.controller.restart(boot_id());
        if let Some(leader) = &mut self.leader {
            leader.rest();
        }
        let session = Session::new(self.setup.arm.sampling_time_ns, self.setup.speed_limit);
        tracing::info!("a session of the robot begins: {address}");
        self.peer = Some(Peer { address, session, bearing: None, heard_ns: arrival_ns });
    }

    /// One sample, and its answer.
    fn cycle(&mut self, measured: &Measured, arrival_ns: u64) {
        let lead = match &mut self.leader {
            Some(leader) => leader.lead(self.guide.arm(), &measured.reading, measured.stamp_ns, arrival_ns),
            None => Lead::of_planned_path(self.guide.arm(), measured),
        };
        // A cycle whose message was lost has a number of its own: the daemon is to see that it is missing, and not another rate.
        for before in (1..=measured.missed).rev() {
            let _ = self.controller.begin(measured.stamp_ns.saturating_sub(before * self.setup.arm.sampling_time_ns));
        }
        let mut sample = self.controller.begin(measured.stamp_ns);
        fill(&mut sample, measured, &lead, self.setup.torque_factor.as_ref());
        self.controller.publish(&sample);
        if !self.await_answer(sample.sequence, arrival_ns + self.setup.answer_ns) {
            self.counts.unanswered += 1;
        }
        if let Some(peer) = &mut self.peer {
            peer.bearing = Some(Bearing::new(&measured.reading, &lead));
        }
        self.play(measured.stamp_ns + self.setup.arm.command_delay_ns, arrival_ns);
        // From here on there is time.
        self.controller.make_ready();
        self.answers.drain();
        self.arrival.see(sample.boot_id, sample.sequence, sample.stamp_ns, arrival_ns);
    }

    /// Whether the answer to this sample comes before `until_ns`.
    fn await_answer(&mut self, sequence: u64, until_ns: u64) -> bool {
        loop {
            let now_ns = monotonic_ns();
            match self.controller.receive(now_ns) {
                Ok(Some(_)) => {
                    if self.controller.newest().is_some_and(|newest| newest.state_sequence == sequence) {
                        return true;
                    }
                }
                Ok(None) => {}
                Err(rejection) => {
                    note(&mut self.counts.rejected, || format!("an answer that is not used: {rejection}"))
                }
            }
            if now_ns >= until_ns {
                return false;
            }
            // Two processes may share a processor: looking again and again would take it from the daemon.
            self.answers.block(LOOK_NS.min(until_ns - now_ns));
        }
    }

    /// An answer to a message that is no sample: the plan goes on.
    fn bridge(&mut self, arrival_ns: u64) {
        self.go_on(arrival_ns);
        self.play(self.played_ns + self.setup.arm.sampling_time_ns, arrival_ns);
    }

    /// The robot was not heard in time: it may hear all the same.
    fn bridge_silence(&mut self) {
        let now_ns = monotonic_ns();
        match &self.peer {
            None => {}
            Some(peer) if now_ns.saturating_sub(peer.heard_ns) > UNHEARD_NS => {
                tracing::warn!("the robot {} is silent: nothing is sent until it is heard again", peer.address);
                self.peer = None;
            }
            Some(_) => {
                self.go_on(now_ns);
                self.play(self.played_ns + self.setup.arm.sampling_time_ns, now_ns);
                // From here on once a cycle, not a half later each time.
                self.due_ns = now_ns + self.setup.arm.sampling_time_ns;
            }
        }
    }

    /// Who leads goes on doing so, or no longer does, though there is no sample.
    fn go_on(&mut self, now_ns: u64) {
        let bearing = self.peer.as_mut().and_then(|peer| peer.bearing.as_mut());
        if let Some((leader, bearing)) = self.leader.as_mut().zip(bearing) {
            leader.go_on(bearing, now_ns);
        }
    }

    /// Sends what the plan says about this instant.
    fn play(&mut self, at_ns: u64, arrival_ns: u64) {
        self.played_ns = at_ns;
        let cycle_ns = self.setup.arm.sampling_time_ns;
        self.due_ns = arrival_ns + cycle_ns + cycle_ns / 2;
        let (applied, part) = self.applied(self.played_ns);
        if let (Applied::Hold, Some(leader)) = (&applied, &mut self.leader) {
            leader.hold();
        }
        let Some(peer) = &self.peer else { return };
        let address = peer.address;
        let (speeds, external_axes) = match &peer.bearing {
            Some(bearing) => (self.guide.speeds(&applied, part, bearing), bearing.external_axes),
            None => ([0.0; MAX_JOINTS], 0),
        };
        self.send(&speeds, external_axes, address);
    }

    /// What the joints are to do at an instant, and which part of it; before the first answer they hold.
    fn applied(&mut self, at_ns: u64) -> (Applied, f64) {
        let applied = self.controller.apply(at_ns);
        match self.controller.playback().in_force() {
            Some(command) => (applied, fade::part(command, self.setup.arm.command_delay_ns, at_ns)),
            None => (Applied::Hold, 0.0),
        }
    }

    fn send(&mut self, speeds: &[f64; MAX_JOINTS], external_axes: usize, to: SocketAddr) {
        let message = self.guide.message(self.sequence, monotonic_ns(), speeds, external_axes);
        self.link.send(&message.encode_to_vec(), to);
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// What happened, in one line, for the end.
    pub(crate) fn summary(&self) -> String {
        let Counts { strangers, bad, refused, rejected, unanswered } = &self.counts;
        format!(
            "{} samples in the last session; {unanswered} without an answer in time, {rejected} answers not used; {bad} datagrams \
             that are no messages, {refused} messages out of order or not believed, {strangers} from elsewhere",
            self.controller.sequence()
        )
    }
}

fn boot_id() -> u64 {
    (monotonic_ns() ^ u64::from(std::process::id()) << 32) | 1
}

fn fill(sample: &mut StateSample, measured: &Measured, lead: &Lead, torque_factor: Option<&[f64; MAX_JOINTS]>) {
    let reading = &measured.reading;
    // Offsets change with the robot's messages alone.
    sample.plays_plan = 0;
    sample.joint_position = reading.position;
    sample.joint_velocity = measured.velocity;
    sample.joint_position_reference = lead.position;
    sample.twist_reference = lead.twist;
    sample.drives_enabled = u32::from(reading.follows);
    if let Some(wrench) = reading.wrench {
        sample.wrench_valid = 1;
        sample.wrench = wrench;
    }
    if let Some((factor, torque)) = torque_factor.zip(reading.torque) {
        let torque = std::array::from_fn(|joint| factor[joint] * torque[joint]);
        if torque.iter().all(|value: &f64| value.is_finite()) {
            sample.torque_valid = 1;
            sample.joint_torque = torque;
        }
    }
}

/// Counts, and says so at powers of two: a line for each would fill the log and block the loop.
fn note(count: &mut u64, what: impl FnOnce() -> String) {
    *count += 1;
    if count.is_power_of_two() {
        tracing::warn!("{} ({count} so far)", what());
    }
}
