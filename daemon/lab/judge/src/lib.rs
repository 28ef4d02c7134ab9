//! What solvers are checked and timed with: problem files with exact solutions ([`problem_file`]),
//! random problems ([`random_qp`]), and Clarabel, an interior-point method that shares nothing with
//! the solver in the core, as the judge ([`judge`]) and as the measure of speed ([`mod@bench`]).
//! Where Clarabel is too coarse, double-double arithmetic decides ([`exact`]).
//!
//! # Fuzzing
//! [`fuzzing`] makes small degenerate problems from bytes and checks the answers. `cargo test --release`
//! replays the corpus and some thousand random inputs; a fuzzer that follows coverage looks for
//! more, on the stable toolchain (it wants a C++ compiler):
//!
//! ```sh
//! cargo install --locked cargo-fuzz
//! export RUSTFLAGS=-Ctarget-cpu=x86-64-v3
//! cargo fuzz run --fuzz-dir daemon/lab/judge/fuzz -s none qp \
//!     /tmp/corpus daemon/lab/judge/fuzz/corpus/qp -- -max_total_time=60
//! ```
//!
//! cargo-fuzz sets RUSTFLAGS and with it switches off those of `.cargo/config.toml`: hence the
//! processor, without which `wide` rounds between multiplication and addition. New inputs go to the
//! first folder. One that fails is left in `fuzz/artifacts/qp`, and the problem printed as lines of
//! a test: write the test, keep the input in `fuzz/corpus/qp`.

pub mod bench;
pub mod clarabel_forms;
pub mod clarabel_solver;
pub mod default_profile;
pub mod exact;
pub mod fuzzing;
pub mod judge;
pub mod problem_file;
pub mod random_qp;
pub mod sequence;
