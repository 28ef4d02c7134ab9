//! When a command acts. The command that answers sample k acts at t_k plus the command delay,
//! exactly. A command that is not there by then is missed: the last one received is played on by
//! elapsed time until its valid-until, then the joints hold.

use std::collections::VecDeque;

use ipc_types::{CommandSample, MAX_JOINTS, Motion, TASK_AXES};

use crate::limits::Limits;
use crate::rejection::{Rejection, check};

/// Answered samples that are kept after their command was due, to check the stamps of late answers.
const REMEMBERED: usize = 8;

/// What became of an accepted command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reception {
    /// It is there before it has to act.
    InTime,
    /// It came too late to act: only its plan may still be played.
    Late,
}

/// What the joints are to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Applied {
    /// Follow ṗ0 plus this velocity offset in m/s and rad/s.
    Offset([f64; TASK_AXES]),
    /// Zero joint velocity.
    Hold,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    sequence: u64,
    stamp_ns: u64,
    due_ns: u64,
    command: Option<CommandSample>,
    resolved: bool,
}

/// The commands under way and the one in force.
#[derive(Debug, Clone)]
pub struct Playback {
    joint_count: u32,
    limits: Limits,
    delay_ns: u64,
    slots: VecDeque<Slot>,
    capacity: usize,
    /// Stamp of the first sample of this boot.
    first_stamp_ns: Option<u64>,
    in_force: Option<CommandSample>,
    late: Option<CommandSample>,
    first_answered: Option<u64>,
    newest_answered: u64,
    missed: u64,
    rejected: u64,
}

impl Playback {
    /// For a robot of this size, without limits of its own; commands act `delay_ns` after their sample. No further
    /// allocation follows.
    pub fn new(joint_count: usize, delay_ns: u64, sampling_time_ns: u64) -> Self {
        Self::with_limits(joint_count, delay_ns, sampling_time_ns, Limits::NONE)
    }

    /// The same for a motion controller that refuses what is beyond its limits.
    pub fn with_limits(joint_count: usize, delay_ns: u64, sampling_time_ns: u64, limits: Limits) -> Self {
        let capacity = (delay_ns / sampling_time_ns) as usize + 2 + REMEMBERED;
        Self {
            joint_count: joint_count as u32,
            limits,
            delay_ns,
            slots: VecDeque::with_capacity(capacity),
            capacity,
            first_stamp_ns: None,
            in_force: None,
            late: None,
            first_answered: None,
            newest_answered: 0,
            missed: 0,
            rejected: 0,
        }
    }

    /// A sample was taken: its command will be due after the delay. An offset of a late command
    /// starts here.
    pub fn begin_sample(&mut self, sequence: u64, stamp_ns: u64) {
        if self.slots.len() == self.capacity {
            self.slots.pop_front();
        }
        self.first_stamp_ns.get_or_insert(stamp_ns);
        let due_ns = stamp_ns.saturating_add(self.delay_ns);
        self.slots.push_back(Slot { sequence, stamp_ns, due_ns, command: None, resolved: false });
        if let Some(late) = self.late.take() {
            self.in_force = Some(late);
        }
    }

    /// Takes a command that became visible at `visible_ns`.
    ///
    /// # Errors
    /// [`Rejection`]: the command is not used and counts as rejected.
    pub fn receive(&mut self, command: &CommandSample, visible_ns: u64) -> Result<Reception, Rejection> {
        if let Err(rejection) = self.validate(command) {
            self.rejected += 1;
            return Err(rejection);
        }
        self.first_answered.get_or_insert(command.state_sequence);
        self.newest_answered = self.newest_answered.max(command.state_sequence);
        let slot = self.slots.iter_mut().rev().find(|slot| slot.sequence == command.state_sequence);
        match slot {
            Some(slot) if !slot.resolved && visible_ns <= slot.due_ns => {
                slot.command = Some(*command);
                Ok(Reception::InTime)
            }
            _ => {
                self.late = Some(*command);
                Ok(Reception::Late)
            }
        }
    }

    fn validate(&self, command: &CommandSample) -> Result<(), Rejection> {
        let (sequence, motion) = (command.sequence, check(command, self.joint_count, &self.limits)?);
        let (answered, stamp_ns) = (command.state_sequence, command.state_stamp_ns);
        if answered == 0 && motion == Motion::Hold {
            // From a daemon that ends before it has answered anything: holding is always right.
            return Ok(());
        }
        if answered < self.newest_answered {
            return Err(Rejection::Older { answered, newest: self.newest_answered, sequence });
        }
        let is_own = match self.slots.iter().find(|slot| slot.sequence == answered) {
            Some(remembered) => remembered.stamp_ns == stamp_ns,
            // A sample this old was published: commands for it are late but valid. One of an earlier boot may have
            // had its number, and a stamp from before this boot.
            None => self.was_before_the_remembered(answered, stamp_ns),
        };
        if !is_own {
            return Err(Rejection::UnknownSample { answered, stamp_ns, sequence });
        }
        Ok(())
    }

    fn was_before_the_remembered(&self, answered: u64, stamp_ns: u64) -> bool {
        let (Some(oldest), Some(first_stamp_ns)) = (self.slots.front(), self.first_stamp_ns) else { return false };
        (1..oldest.sequence).contains(&answered) && (first_stamp_ns..oldest.stamp_ns).contains(&stamp_ns)
    }

    /// When the next command is due that has neither been applied nor missed yet.
    pub fn next_due(&self) -> Option<u64> {
        self.slots.iter().find(|slot| !slot.resolved).map(|slot| slot.due_ns)
    }

    /// Whether a command that is due before `end_ns` is missing, although commands have come
    /// before.
    pub fn is_missing(&self, end_ns: u64) -> bool {
        self.slots.iter().any(|slot| !slot.resolved && slot.due_ns < end_ns && self.is_missed(slot))
    }

    /// Puts the commands in force that are due by `now_ns`, and counts the missed ones.
    pub fn apply_due(&mut self, now_ns: u64) {
        while let Some(index) = self.slots.iter().position(|slot| !slot.resolved && slot.due_ns <= now_ns) {
            self.missed += u64::from(self.is_missed(&self.slots[index]));
            self.slots[index].resolved = true;
            if let Some(command) = self.slots[index].command {
                self.in_force = Some(command);
                // One that answers a later sample is newer, though it was late for it.
                self.late = self.late.filter(|late| late.state_sequence > command.state_sequence);
            }
        }
    }

    /// What the command in force says for the instant `now_ns`; before the first command ever, an
    /// offset of zero.
    pub fn applied(&self, now_ns: u64) -> Applied {
        let Some(command) = &self.in_force else { return Applied::Offset([0.0; TASK_AXES]) };
        if command.motion == Motion::Hold.code() || now_ns >= command.valid_until_ns {
            return Applied::Hold;
        }
        Applied::Offset(match self.step(command, now_ns) {
            0 => command.velocity_offset,
            step => command.planned_offset[step],
        })
    }

    /// What the joints add to their commanded velocity at the instant `now_ns`, rad/s or m/s: of a controller that says
    /// `follows_joint_velocity = 1`. 0 before the first command ever, and without meaning while [`Self::applied`] holds.
    pub fn joint_velocity_offset(&self, now_ns: u64) -> [f64; MAX_JOINTS] {
        let (Some(command), Applied::Offset(offset)) = (&self.in_force, self.applied(now_ns)) else {
            return [0.0; MAX_JOINTS];
        };
        in_joints(command, &offset)
    }

    /// The next instant after `now_ns` at which the command in force changes what it says; `None`
    /// when it does not.
    pub fn next_change(&self, now_ns: u64) -> Option<u64> {
        let command = self.in_force.as_ref()?;
        if command.motion == Motion::Hold.code() || now_ns >= command.valid_until_ns {
            return None;
        }
        let step = self.step(command, now_ns);
        // The last step is in force until the command is no longer valid.
        if step + 1 < command.plan_length as usize {
            let acts_ns = command.state_stamp_ns.saturating_add(self.delay_ns);
            Some(acts_ns.saturating_add(command.plan_end_ns[step]).min(command.valid_until_ns))
        } else {
            Some(command.valid_until_ns)
        }
    }

    fn step(&self, command: &CommandSample, now_ns: u64) -> usize {
        let elapsed = now_ns.saturating_sub(command.state_stamp_ns.saturating_add(self.delay_ns));
        let length = command.plan_length as usize;
        command.plan_end_ns[..length].partition_point(|end| *end <= elapsed).min(length.saturating_sub(1))
    }

    /// Samples from before the first command ever have missed nothing.
    fn is_missed(&self, slot: &Slot) -> bool {
        slot.command.is_none() && self.first_answered.is_some_and(|first| slot.sequence > first)
    }

    /// Whether a valid command was ever received.
    pub fn has_received(&self) -> bool {
        self.first_answered.is_some()
    }

    /// The command that is played, also when its plan has ended; `None` before the first.
    pub fn in_force(&self) -> Option<&CommandSample> {
        self.in_force.as_ref()
    }

    /// Sequence of the command in force; 0 = none yet.
    pub fn applied_sequence(&self) -> u64 {
        self.in_force.as_ref().map_or(0, |command| command.sequence)
    }

    /// Commands that came too late to act, or never, since the first valid one.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Commands that were rejected.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }
}

/// What the joints of such a controller add to their commanded velocity while this offset is in force, rad/s or m/s.
pub(crate) fn in_joints(command: &CommandSample, offset: &[f64; TASK_AXES]) -> [f64; MAX_JOINTS] {
    let mut joints = command.joint_velocity_offset;
    for (joint, row) in joints.iter_mut().zip(&command.joint_per_twist) {
        for axis in 0..TASK_AXES {
            *joint += row[axis] * (offset[axis] - command.velocity_offset[axis]);
        }
    }
    joints
}
