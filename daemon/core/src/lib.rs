//! MPC-based admittance control after Wahrburg & Listmann, "MPC-based Admittance Control for Robotic Manipulators"
//! (CDC 2016), as a pure state machine: no clock, no I/O, no heap. Equation numbers in parentheses are the paper's.
//!
//! The data path of one cycle, file by file: [`wrench`] (f̂ from what is given) → [`sample`] (what may reach the law)
//! → [`contact`] (which axes are in contact) → [`model`] (17) over a [`horizon`] → [`cost`] (18a) and [`constraints`] (18d),
//! (18e) → [`condensation`] (one dense QP) → [`warm_start`] → [`qp`] (solve and check) → [`feasibility`] (the verdict)
//! → [`plan`] → [`controller`] (all of it in order, with [`mode`]).
//!
//! # Glossary
//! | symbol | name in code | meaning |
//! |---|---|---|
//! | N, D | `N`, `D` | joints; task axes, the first D of x y z rx ry rz |
//! | m, H | `inputs.len()`, `horizon` | axes with an input in this cycle; steps of the prediction |
//! | q, q̇ | `joint_position`, `joint_velocity` | rad, rad/s |
//! | f̂ | `wrench` | estimate of the wrench that the robot exerts on the environment at the TCP, base frame; N, N·m |
//! | f_lin | `linear_wrench` | the spring's wrench, linear in q (16) |
//! | ṗ0, Δṗ | `twist_reference`, `velocity_offset` | commanded TCP twist and the output added to it, base frame; m/s, rad/s |
//! | x = \[q; q̇; f̂\] | [`model::State`] | state of the prediction (7) |
//! | Ψ, J, J⁻¹ | [`robot::Kinematics`], [`robot::InverseJacobian`] | forward kinematics, Jacobian and its inverse at the measured q |
//! | T_V, Λ_TV | `velocity_time_constant` | joint speed loops (4), (9); s |
//! | r, V | `reference`, `columns` | joint velocity reference J⁻¹ ṗ; columns of J⁻¹ that belong to inputs |
//! | T_est, Λ_Test | `wrench_time_constant` | wrench estimate (6), (12); s, 0 means f̂ = f |
//! | K_e | `stiffness` | environment (11), (20) in the base frame; N/m |
//! | β | `activation_threshold` | section III.C; N |
//! | f_max, f_min | `force_limit`, `minimum_force` | bounds of s·f_lin on an active axis (18d), (18e); N |
//! | s | `sign` | sign of the contact of an active axis: +1 or −1 |
//! | Q, R | [`cost::Weights`], `input_weight` | weights of (18a) |
#![no_std]
#![forbid(unsafe_code)]

mod answer;
pub mod condensation;
pub mod constraints;
pub mod contact;
pub mod controller;
pub mod cost;
pub mod damping;
mod detection;
pub mod environment;
mod fallback;
pub mod feasibility;
mod guards;
pub mod horizon;
mod jump;
pub mod mode;
pub mod model;
mod optimization;
pub mod outcome;
pub mod parameters;
pub mod plan;
pub mod qp;
mod requests;
pub mod robot;
pub mod sample;
mod stopping;
pub mod under_way;
pub mod warm_start;
pub mod wrench;

pub use requests::{EnableRefused, ResetRefused};
