//! What solvers are checked and timed with: problem files with exact solutions ([`problem_file`]), random problems
//! ([`random_qp`]), and Clarabel, an interior-point method that shares nothing with the solver in the core, as the judge
//! ([`judge`]) and as the measure of speed ([`bench`]).

pub mod bench;
pub mod clarabel_forms;
pub mod default_profile;
pub mod judge;
pub mod problem_file;
pub mod random_qp;
pub mod sequence;
