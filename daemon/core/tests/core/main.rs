//! Tests of the core, in one program: each of its own would instantiate controller and condensation
//! anew.

mod common;

mod condensation;
mod constraint_rows;
mod controller;
mod dynamics;
mod effective_mass;
mod free_motion;
mod jump;
mod kinematics;
mod missed;
mod model;
mod quantities;
mod rate;
mod redundancy;
mod requests;
mod sparse_formulation;
mod stopping;
mod wild_samples;
mod wrench;
