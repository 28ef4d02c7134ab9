//! Strict configuration: one declaration per key, and everything else follows from it.
//!
//! [`config_section!`](crate::config_section) declares a section (a TOML table): each key's name,
//! type, unit, accepted range, default and meaning. [`config_enum!`](crate::config_enum) declares a
//! key's list of names. From them come
//!
//! - the struct with its serde `Deserialize` (an unknown key is an error),
//! - [`parse`], which reports *all* errors of a text at once, each with line, dotted key, value and
//!   what is accepted,
//! - [`Section::check`], the same ranges for a struct that was built in code,
//! - [`Section::keys`], the table of keys, for documentation ([`keys_markdown`]) and for tests
//!   ([`mutation`]).
//!
//! ```
//! use admittance_host::config::{ConfigError, Section, parse};
//! use admittance_host::{config_enum, config_file, config_section};
//!
//! config_enum! {
//!     /// Which law computes the offset.
//!     pub enum Law {
//!         /// The predictive controller.
//!         Mpc = "mpc",
//!         /// The damping baseline (3).
//!         Damping = "damping",
//!     }
//! }
//!
//! config_section! {
//!     /// The control law.
//!     pub struct Control {
//!         /// Time between two samples.
//!         sampling_time_s: f64, unit "s", range 0.0001..=0.1;
//!         /// Steps that the law looks ahead.
//!         horizon: u32 = 5, unit "steps", range 1..=32;
//!         /// Which law runs.
//!         law: Law = Law::Mpc;
//!         /// Weight of each axis.
//!         weights: Vec<f64>, unit "1", range 0.0.., length 1..=6;
//!         /// Where the surface is; detected at the first touch when absent.
//!         contact_point_m: Option<[f64; 3]>, unit "m", range -10.0..=10.0;
//!     }
//!     cross_check one_step_is_not_enough;
//! }
//!
//! fn one_step_is_not_enough(control: &Control, path: &str, errors: &mut Vec<ConfigError>) {
//!     if control.law == Law::Mpc && control.horizon < 2 {
//!         let key = format!("{path}.horizon");
//!         errors.push(ConfigError::new(key, control.horizon, "2 to 32 steps with law = \"mpc\""));
//!     }
//! }
//!
//! config_section! {
//!     /// The whole file.
//!     pub struct Config {
//!         /// The control law.
//!         control: Control;
//!     }
//! }
//! config_file!(Config);
//!
//! let text = "[control]\nsampling_time_s = 0.004\nweights = [1.0, 0.5]";
//! let config: Config = parse(text, "cell.toml").unwrap();
//! assert_eq!(config.control.horizon, 5);
//!
//! let text = "[control]\nsampling_time_s = 5\nhorizn = 3\nweights = [1.0]";
//! let message = parse::<Config>(text, "cell.toml").unwrap_err().to_string();
//! for expected in [
//!     "cell.toml:2: control.sampling_time_s = 5: accepted: 0.0001 to 0.1 s",
//!     "cell.toml:3: control.horizn = 3: unknown key, did you mean control.horizon?",
//! ] {
//!     assert!(message.contains(expected), "{message}");
//! }
//! ```
//!
//! # The syntax of a key
//! `name: type [= default] [, unit "…"] [, range a..=b] [, length a..=b] [, each "axis"];`, in this order, with a
//! doc comment above it.
//!
//! - Without a default the key is required; an `Option` is then absent, and a section whose keys
//!   all have defaults may be left out as a whole.
//! - Types: `f64`, integers, `bool`, `String`, `PathBuf`, a `config_enum!`, another section
//!   (`[table]`), and `Option`, `Vec` (of a section: `[[table]]`) and fixed-size arrays of these.
//! - `unit`: "1" for a number without dimension. Every number has one;
//!   [`mutation::check_every_key`] insists.
//! - `range` is written in the key's own number type and applies to each element; open ends and
//!   `(Bound::Excluded(0.0), Bound::Unbounded)` are possible. Numbers that are not finite are never
//!   accepted.
//! - `length` bounds the elements of a `Vec` or the characters of a string.
//! - `each "axis"` (last) says that a list has one value for each task axis: errors then name it.
//!
//! `removed name "why";` after the keys names one that older files may have, and says what there is
//! instead.
//!
//! `cross_check function;` after the struct names a
//! `fn(&Section, path: &str, &mut Vec<ConfigError>)` for rules between keys. It runs only when
//! every key of the section is acceptable by itself, so it may rely on ranges and lengths.

mod docs;
mod error;
mod file;
mod macros;
pub mod mutation;
mod parse;
mod plain;
#[doc(hidden)]
pub mod private;
mod range;
mod rust_types;
mod suggest;
mod syntax;
mod value;

pub use docs::{KeyDoc, keys_markdown};
pub use error::{ConfigError, ConfigErrors, LoadError, Problem};
pub use file::{LARGEST_FILE, read_bytes, read_text};
pub use parse::{load, parse};
pub use plain::{escaped, fixed, percent, short};
pub use range::{Bounds, Limits, LimitsOf, NoRange, Number, Scalar};
pub use value::{Choice, File, Key, Kind, Section, Value, join};
