//! The solver before its judge, in one program: each of its own would instantiate solver and
//! condensation anew.

mod default_profile;
mod degenerate;
mod exact;
mod fuzz_corpus;
mod hard_cases;
mod problem_files;
mod random_large;
mod random_problems;
mod sparse_form;
