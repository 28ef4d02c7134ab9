//! What a row of the fault matrix says: data that the tests check and the page prints.

use std::fmt;

pub use super::expectation::{Counter, End, Expectation, Force, Line, Robot, Step};
pub use super::injection::{Disk, Injection, Newcomer, Signal};
pub use super::said::{CONTACT, FREE, Said, idle, stopped, stopping, withdrawn};

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
