//! What a fault leads to: the robot, the commands, the logs, the force and the recovery.

use std::fmt;

use ipc_types::{CommandSample, Source};

use super::row::{Said, Signal, Who};

/// What the robot does, up to when the recovery begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Robot {
    /// Goes on with the commanded motion and the offset of the law.
    GoesOn,
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

/// Text that a process's log contains.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// The process that logs it.
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
    /// Why this is no fault in this situation, if so.
    pub note: &'static str,
    /// The robot.
    pub robot: Robot,
    /// What the commands say, one after the other, from the fault to the recovery: these and no
    /// others.
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
