//! The daemon's cycle against the plant in virtual time, sample by sample: one program, since each
//! of its own would be linked with both.

mod contact_ends;
mod deadline;
mod default_profile;
mod detection;
mod drive_limits;
mod foreign_contact;
mod heavy_tool;
mod inputs_within_the_cycle;
mod lag_tolerance;
mod limits_are_constraints;
mod masses_verdict;
mod motor_torque;
mod paper_experiment;
mod redundancy;
mod settling;
mod stops_and_guards;
mod straight_line;
mod task_frame;
mod task_frame_directions;
mod task_frame_horizon;
mod task_frame_sideways;
mod task_frame_stops;
mod turned_world;
mod unknown_normal;
mod unknown_surface;
mod unlagged;
mod ur10e_impact;
mod velocity_loops;
