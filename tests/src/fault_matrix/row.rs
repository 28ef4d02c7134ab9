//! What a row of the fault matrix says: data that the tests check and the page prints.

use std::fmt;

use ipc_types::{CommandSample, Mode, Motion, Source, StopReason};

pub use super::injection::{Disk, Injection, Newcomer, Signal};

/// A key of a file, "section.key", and its value as TOML.
pub type Key = (&'static str, &'static str);

/// Where the arm is when the fault comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Situation {
    /// In free motion.
    Free,
    /// In contact, sliding along the surface at the minimum force.
    Contact,
}

impl Situation {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Free, Self::Contact];

    /// In a test's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Contact => "contact",
        }
    }

    /// What the command says while nothing is wrong.
    pub fn undisturbed(self) -> Said {
        match self {
            Self::Free => FREE,
            Self::Contact => CONTACT,
        }
    }
}

/// A process of the matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// admittanced.
    Daemon,
    /// plant-sim: the motion controller and the robot.
    Plant,
    /// What the fault itself starts: a second daemon, a recorder.
    Newcomer,
}

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Daemon => "the daemon",
            Self::Plant => "the motion controller",
            Self::Newcomer => "the newcomer",
        })
    }
}

/// What a command says of the daemon's state.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Said {
    /// Mode.
    pub mode: Mode,
    /// Offset or hold.
    pub motion: Motion,
    /// Stop reason.
    pub reason: StopReason,
}

/// Free motion under control.
pub const FREE: Said = Said { mode: Mode::Free, motion: Motion::Offset, reason: StopReason::None };
/// Contact under control.
pub const CONTACT: Said = Said { mode: Mode::Contact, motion: Motion::Offset, reason: StopReason::None };

/// On the way to a low force.
pub const fn stopping(reason: StopReason) -> Said {
    Said { mode: Mode::Stopping, motion: Motion::Offset, reason }
}

/// Held until a reset.
pub const fn stopped(reason: StopReason) -> Said {
    Said { mode: Mode::Stopped, motion: Motion::Hold, reason }
}

/// Not controlling.
pub const fn idle(reason: StopReason) -> Said {
    Said { mode: Mode::Idle, motion: Motion::Offset, reason }
}

impl Said {
    /// What this command says; `None` when a code is not of the contract.
    pub fn of(command: &CommandSample) -> Option<Self> {
        Some(Self {
            mode: Mode::from_code(command.mode)?,
            motion: Motion::from_code(command.motion)?,
            reason: StopReason::from_code(command.stop_reason)?,
        })
    }
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}", self.mode.name(), self.motion.name())?;
        if self.reason == StopReason::None { Ok(()) } else { write!(f, ", {}", self.reason.name()) }
    }
}

impl fmt::Debug for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// What the robot does, up to when the recovery begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Robot {
    /// Goes on with the commanded motion and the offset of the law.
    GoesOn,
    /// Goes on with the commanded motion without an offset: nobody controls it.
    GoesOnUncontrolled,
    /// Stands still once the last plan has ended, and goes on when a daemon answers again.
    Pauses,
    /// Plays the last plan until its end, then stands still.
    PlaysPlan,
    /// Plays the last plan, retreats out of the surface open loop, then stands still.
    Retreats,
    /// Comes to rest at a low force by the minimum-force stop, then stands still.
    MinimumForceStop,
    /// The same, where the force may be low enough for a standstill at once.
    ComesToRest,
    /// Stands still at once.
    StandsStill,
    /// The simulation does not run.
    NotRunning,
}

impl Robot {
    /// Where the offset of some command of the fault comes from.
    pub fn source(self) -> Option<Source> {
        match self {
            Self::Retreats => Some(Source::Retreat),
            Self::MinimumForceStop => Some(Source::MinimumForce),
            _ => None,
        }
    }
}

impl fmt::Display for Robot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::GoesOn => "goes on under control",
            Self::GoesOnUncontrolled => "goes on with the commanded motion, without an offset",
            Self::Pauses => "plays the last plan to its end, stands still, and goes on when the daemon answers again",
            Self::PlaysPlan => "plays the last plan to its end, then stands still",
            Self::Retreats => "plays the last plan, retreats out of the surface, then stands still",
            Self::MinimumForceStop => "comes to rest at a low force (minimum-force stop), then stands still",
            Self::ComesToRest => {
                "stands still, after a minimum-force stop where the force is not low enough already: *Stopping* may be left out"
            }
            Self::StandsStill => "stands still at once",
            Self::NotRunning => "is not simulated meanwhile",
        })
    }
}

/// A count of the command that grows by the fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counter {
    /// `rejected_count`: samples that did not reach the law, and silences.
    Rejected,
    /// `missed_count`: gaps in the sequence of the samples.
    Missed,
    /// `fallback_count`: cycles in contact without the law's answer.
    Fallback,
}

impl Counter {
    /// Name of the field.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rejected => "rejected_count",
            Self::Missed => "missed_count",
            Self::Fallback => "fallback_count",
        }
    }

    /// Its value.
    pub fn of(self, command: &CommandSample) -> u64 {
        match self {
            Self::Rejected => command.rejected_count,
            Self::Missed => command.missed_count,
            Self::Fallback => command.fallback_count,
        }
    }
}

/// Text that someone's log contains.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// Whose.
    pub by: Who,
    /// The text.
    pub text: String,
}

/// How a process ends by the fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// With this exit code.
    Code(Who, i32),
    /// By this signal.
    Signal(Who, Signal),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Code(who, code) => write!(f, "{who} ends with {code}"),
            Self::Signal(who, Signal::Kill) => write!(f, "{who} is killed"),
            Self::Signal(who, Signal::Stop) => write!(f, "{who} is stopped"),
        }
    }
}

/// What the true normal force stays under, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Force {
    /// There is none.
    None,
    /// The limit itself, min f_max / |n|: the law goes on.
    Limit,
    /// What the plan in force and the standstill after it can reach.
    PlanThenHold,
    /// What the same daemon reaches in virtual time, at the worst of some instants of contact.
    VirtualTime,
}

impl Force {
    /// Every bound.
    pub const ALL: [Self; 4] = [Self::None, Self::Limit, Self::PlanThenHold, Self::VirtualTime];

    /// What it is computed from, and why.
    pub fn reason(self) -> &'static str {
        match self {
            Self::None => "nothing is touched",
            Self::Limit => {
                "the smallest `force_limit` / |n|: the law goes on, and on a plane all forces are one normal force"
            }
            Self::PlanThenHold => {
                "the force when the fault came, and the stiffness times the way into the surface that the last plan leads and \
                 the joints coast, each for its own time constant, once they are held; a tenth and 2 N more for what straight \
                 lines leave out"
            }
            Self::VirtualTime => {
                "1.25 times the largest force of the same configuration in virtual time, over eight instants of contact within \
                 a sample: the law is in force, but its model or its touch is what is wrong"
            }
        }
    }
}

impl fmt::Display for Force {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::Limit => "below the limit",
            Self::PlanThenHold => "below plan, then hold",
            Self::VirtualTime => "below virtual time",
        })
    }
}

/// A step of the recovery; the test takes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The fault ends by itself.
    FaultEnds,
    /// SIGCONT.
    Continue(Who),
    /// The process is started again.
    Start(Who),
    /// The process is ended by SIGTERM.
    End(Who),
    /// The motion controller is ended by SIGTERM and started again, at the start of its motion.
    RestartPlant,
    /// The daemon's file gets its sound keys back.
    CorrectFile,
    /// The daemon reads its file again.
    Reload,
    /// The command says this.
    See(Said),
    /// The motion controller moves the arm out of the surface.
    Retreat,
    /// The commanded motion no longer leads into the surface.
    Stand,
    /// `admittancectl reset`.
    Reset,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FaultEnds => f.write_str("the fault ends"),
            Self::Continue(who) => write!(f, "SIGCONT to {who}"),
            Self::Start(who) => write!(f, "start {who} again"),
            Self::End(who) => write!(f, "end {who}"),
            Self::RestartPlant => f.write_str("restart the motion controller"),
            Self::CorrectFile => f.write_str("correct the configuration"),
            Self::Reload => f.write_str("SIGHUP"),
            Self::See(said) => write!(f, "the command says *{said}*"),
            Self::Retreat => f.write_str("command a motion out of the surface"),
            Self::Stand => f.write_str("command standstill"),
            Self::Reset => f.write_str("`admittancectl reset`"),
        }
    }
}

/// What a fault leads to.
#[derive(Debug, Clone)]
pub struct Expectation {
    /// Why the fault is none here, where it is none.
    pub note: &'static str,
    /// The robot.
    pub robot: Robot,
    /// What the commands say, one after the other, from the fault to the recovery: these and no others.
    pub command: Vec<Said>,
    /// Counts that grow. `rejected_count` does not unless it is here.
    pub counted: Vec<Counter>,
    /// The log.
    pub log: Vec<Line>,
    /// Processes that end; all others go on, and end with 0 when asked to.
    pub ends: Vec<End>,
    /// The true force.
    pub force: Force,
    /// Steps after which control goes on as before.
    pub recovery: Vec<Step>,
}

/// Phases of the commanded motion: speed, and durations in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timeline {
    /// Speed of the approach and of the pressing, straight down, in m/s.
    pub approach: f64,
    /// Down onto the surface and along it.
    pub press: f64,
    /// Out of the surface.
    pub retreat: f64,
    /// Standstill.
    pub rest: f64,
}

/// A fault.
#[derive(Debug, Clone)]
pub struct Row {
    /// In names of tests.
    pub name: &'static str,
    /// What goes wrong.
    pub fault: &'static str,
    /// How it is brought about.
    pub injection: Injection,
    /// Keys of the daemon's file that are part of it.
    pub daemon: &'static [Key],
    /// Keys of the scenario that are part of it, in free motion and in contact.
    pub scenario: [&'static [Key]; 2],
    /// Phases of the motion.
    pub timeline: Timeline,
    /// In free motion.
    pub free: Expectation,
    /// In contact.
    pub contact: Expectation,
}

impl Row {
    /// What is expected in this situation.
    pub fn expected(&self, situation: Situation) -> &Expectation {
        match situation {
            Situation::Free => &self.free,
            Situation::Contact => &self.contact,
        }
    }

    /// Keys of the scenario in this situation.
    pub fn scenario(&self, situation: Situation) -> &'static [Key] {
        self.scenario[usize::from(situation == Situation::Contact)]
    }
}
