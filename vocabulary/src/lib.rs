//! The names that the law, the wire contract, configuration files and tools share: each is declared
//! here, once, with its code on the wire and its meaning in a sentence.
//!
//! Types that carry data (a fault of a sample, a verdict with its newtons) live where the data is
//! made, and give their name by an exhaustive match.
//!
//! ```
//! use admittance_vocabulary::{ModeName, StopReason};
//!
//! assert_eq!(ModeName::from_code(2), Some(ModeName::Contact));
//! assert_eq!(StopReason::Infeasible.name(), "Infeasible");
//! // Where there may be none, the code of that is 0.
//! assert_eq!(StopReason::code_of(None), StopReason::NONE);
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod declaration;
mod names;

pub use declaration::{EnumInfo, EnumValueInfo, Named};
pub use names::{FaultName, LawName, ModeName, Motion, Side, Source, StopReason, TaskAxis, VerdictName};
