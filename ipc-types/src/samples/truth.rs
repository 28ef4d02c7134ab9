//! From the simulated plant: what is true.

use iceoryx2::prelude::ZeroCopySend;

use crate::{MAX_JOINTS, TASK_AXES};

wire_sample! {
    /// What only the simulated plant knows, unlike a real robot: true forces, and when commands
    /// became visible.
    struct TruthSample: "admittanced.TruthSample.v1", size 464, writer "plant-sim only" {
        0 sequence: u64 ["1", ">= 1"]
            "Sequence of the state sample of the same cycle.";
        8 stamp_ns: u64 ["ns", "CLOCK_MONOTONIC, increasing"]
            "stamp_ns of the state sample of the same cycle: all values are true at this instant unless they say \
             otherwise.";
        16 boot_id: u64 ["1", "not 0"]
            "boot_id of the plant.";
        24 answer_time_ns: u64 ["ns", ">= 0"]
            "From stamp_ns to the instant at which the answering command was visible to the plant; 0 = not seen \
             before the next sample.";
        32 missed_commands: u64 ["1", ">= 0"]
            "Cycles since the start whose command was not there when it had to act.";
        40 lateness_ns: u64 ["ns", ">= 0"]
            "By how much the plant itself published its state sample late.";
        48 in_contact: u32 ["1", "0 or 1"]
            "1 when the TCP touches the surface.";
        52 contact_losses: u32 ["1", ">= 0"]
            "Times since the start that contact ended after the first touch.";
        56 motion: u32 as Motion ["1", "a code of Motion"]
            "What the plant applied.";
        60 missed: u32 ["1", "0 or 1"]
            "1 when the command for this cycle did not arrive in time.";
        64 scenario_time_s: f64 ["s", "finite"]
            "Time since the scenario's motion started; negative before.";
        72 normal_force_n: f64 ["N", ">= 0"]
            "True force that the robot exerts along the inward surface normal.";
        80 penetration_m: f64 ["m", "finite"]
            "True depth of the TCP below the undeformed surface, along its normal; negative = gap.";
        88 peak_normal_force_n: f64 ["N", ">= 0"]
            "Largest true normal force since the previous truth sample.";
        96 joint_position: [f64; MAX_JOINTS] ["rad or m", "finite"]
            "True joint positions.";
        160 joint_velocity: [f64; MAX_JOINTS] ["rad/s or m/s", "finite"]
            "True joint velocities.";
        224 tcp_position: [f64; 3] ["m", "finite"]
            "True TCP position x y z, base frame.";
        248 tcp_rotation: [f64; 3] ["rad", "finite"]
            "True TCP orientation relative to the base frame as a rotation vector (axis times angle), base frame.";
        272 tcp_twist: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "True TCP velocity, base frame.";
        320 wrench: [f64; TASK_AXES] ["N, N m", "finite"]
            "True wrench that the ROBOT exerts on the ENVIRONMENT at the TCP, base frame.";
        368 peak_wrench: [f64; TASK_AXES] ["N, N m", "finite"]
            "Per axis, the true wrench component of largest magnitude since the previous truth sample, with its sign.";
        416 velocity_offset: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Velocity offset in force at stamp_ns, base frame.";
    }
}
