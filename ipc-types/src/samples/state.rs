//! From the motion controller: the measured state.

use iceoryx2::prelude::ZeroCopySend;

use crate::{MAX_JOINTS, TASK_AXES};

wire_sample! {
    /// The measured state of the robot and the references that the motion controller follows: one
    /// per cycle.
    struct StateSample: "admittanced.StateSample.v2", size 472,
    writer "the motion controller (plant-sim in a simulation)" {
        0 sequence: u64 ["1", ">= 1, one more with every sample"]
            "Number of this sample; restarts at 1 with a new boot_id.";
        8 stamp_ns: u64 ["ns", "CLOCK_MONOTONIC, increasing"]
            "When the state was measured. The command that answers it acts at this instant plus the agreed command \
             delay.";
        16 boot_id: u64 ["1", "not 0"]
            "Chosen anew at each start of the writer; a change says that the writer restarted and its sequence with \
             it.";
        24 applied_command_sequence: u64 ["1", ">= 0"]
            "The sequence of the command in force when the state was measured; 0 = none yet.";
        32 joint_count: u32 ["1", "1 to 8"]
            "Number of joints N: the first N values of each joint array count, the rest is zero.";
        36 wrench_valid: u32 ["1", "0 or 1"]
            "1 when the wrench of this sample may be used; 0 = sensor or estimate failed (its values are then \
             ignored).";
        40 drives_enabled: u32 ["1", "0 or 1"]
            "1 when the drives follow commands; 0 = disabled or braked.";
        44 plays_plan: u32 ["1", "0 or 1"]
            "1 when the motion controller plays the planned offsets of a command by elapsed time within its cycle too; \
             0 = it follows the velocity offset until the next command, and gets one input per cycle.";
        48 joint_position: [f64; MAX_JOINTS] ["rad or m", "finite; within the arm's joint limits"]
            "Measured joint positions q: rad, of a prismatic joint m.";
        112 joint_velocity: [f64; MAX_JOINTS] ["rad/s or m/s", "finite"]
            "Measured joint velocities.";
        176 joint_position_reference: [f64; MAX_JOINTS] ["rad or m", "finite"]
            "Commanded joint positions q0: they advance with the twist reference alone, whatever the velocity \
             offset does.";
        240 twist_reference: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Commanded TCP velocity without any offset: linear x y z, then angular rx ry rz, base frame.";
        288 wrench: [f64; TASK_AXES] ["N, N m", "finite when wrench_valid = 1"]
            "Measured or estimated wrench: force x y z, then torque rx ry rz. Unless the daemon's [wrench] section \
             says otherwise (sign, sensor frame, bias, tool): the one that the ROBOT exerts on the ENVIRONMENT at the \
             TCP, base frame.";
        336 joint_torque: [f64; MAX_JOINTS] ["N m", "finite when torque_valid = 1"]
            "Torques of the motors at stamp_ns as the drives command them, times the gear ratio: on the joints' side, \
             positive the way the joint turns. What friction and rotors take of them is still in them.";
        400 torque_valid: u32 ["1", "0 or 1"]
            "1 when joint_torque may be used; 0 = there is none, or it failed. Only wrench.source = \"motor_torque\" of \
             the daemon looks at it.";
        404 follows_joint_velocity: u32 ["1", "0 or 1"]
            "1 when the joints follow joint_velocity_reference plus joint_velocity_offset of the command, which [redundancy] of \
             the daemon needs; 0 = the motion controller resolves twist_reference plus velocity_offset itself, by the joint \
             velocity of least norm.";
        408 joint_velocity_reference: [f64; MAX_JOINTS] ["rad/s or m/s", "finite when follows_joint_velocity = 1"]
            "Commanded joint velocities without any offset: those that bring about twist_reference, and whatever the joints do \
             beside it. Looked at when follows_joint_velocity = 1 alone.";
    }
}
