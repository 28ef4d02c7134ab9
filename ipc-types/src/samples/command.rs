//! To the motion controller: the answer to a state sample.

use iceoryx2::prelude::ZeroCopySend;

use crate::{MAX_JOINTS, MAX_PLAN, TASK_AXES};

wire_sample! {
    /// The answer to one state sample: the velocity offset, the plan behind it, and why.
    struct CommandSample: "admittanced.CommandSample.v3", size 2488, writer "admittanced" {
        0 sequence: u64 ["1", ">= 1, one more with every command"]
            "Number of this command; restarts at 1 with a new boot_id.";
        8 stamp_ns: u64 ["ns", "CLOCK_MONOTONIC, increasing"]
            "When the command was published.";
        16 boot_id: u64 ["1", "not 0"]
            "Chosen anew at each start of admittanced.";
        24 state_sequence: u64 ["1", ">= 0"]
            "Sequence of the state sample that this command answers; 0 = none (for instance a hold at shutdown \
             before any sample).";
        32 state_stamp_ns: u64 ["ns", "CLOCK_MONOTONIC"]
            "stamp_ns of the state sample that this command answers.";
        40 valid_until_ns: u64 ["ns", "CLOCK_MONOTONIC, >= state_stamp_ns"]
            "Until when the plan may be played if no newer command arrives; from then on the controller holds (zero \
             joint velocity).";
        48 fallback_count: u64 ["1", ">= 0"]
            "Cycles since the start of admittanced that were answered by a fallback (plan or retreat) instead of the \
             law.";
        56 late_count: u64 ["1", ">= 0"]
            "Cycles since the start of admittanced whose answer was published after its deadline.";
        64 missed_count: u64 ["1", ">= 0"]
            "State samples since the start of admittanced that were never seen: gaps in their sequence.";
        72 rejected_count: u64 ["1", ">= 0"]
            "State samples since the start of admittanced that were refused by validation.";
        80 compute_time_ns: u64 ["ns", ">= 0"]
            "From the state sample received to this command published.";
        88 joint_count: u32 ["1", "1 to 8"]
            "Number of joints of the configured robot.";
        92 motion: u32 as Motion ["1", "a code of Motion"]
            "Whether the controller moves with the offset or holds.";
        96 mode: u32 as Mode ["1", "a code of Mode"]
            "Mode of the daemon after this cycle.";
        100 source: u32 as Source ["1", "a code of Source"]
            "What the velocity offset comes from.";
        104 active_axes: u32 as {TaskAxis} ["1", "0 to 63"]
            "Bit i is set when task axis i (0 = x .. 5 = rz) is in contact and controlled.";
        108 verdict: u32 as Verdict ["1", "a code of Verdict"]
            "Whether the force limits can be met over the horizon.";
        112 verdict_axis: u32 as TaskAxis ["1", "0 to 5"]
            "Task axis that the verdict speaks of (0 = x .. 5 = rz); 0 without a verdict.";
        116 verdict_side: u32 as Side ["1", "a code of Side"]
            "Force limit that the verdict speaks of.";
        120 stop_reason: u32 as StopReason ["1", "a code of StopReason"]
            "Why the daemon is stopping or stopped.";
        124 plan_length: u32 ["1", "0 to 32"]
            "Number of steps of the plan; 0 = no plan.";
        128 verdict_time_s: f64 ["s", ">= 0, finite"]
            "Time from the state sample to the predicted peak (feasible) or to the first row that cannot be met \
             (infeasible).";
        136 verdict_margin: f64 ["N (N m on rx ry rz)", "finite"]
            "Feasible: limit minus predicted peak. Infeasible: minus the newtons missing. AtRisk: minus the newtons by which the \
             worst that may be there exceeds the limit.";
        144 verdict_share: f64 ["1", "0 to 1"]
            "AtRisk: the share of all that may be there that cannot be kept below the limit; contact.risk says from which on \
             to stop. 0 otherwise.";
        152 velocity_offset: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Velocity offset to add to the twist reference, base frame, at the TCP. It counts when motion = Offset.";
        200 joint_velocity_offset: [f64; MAX_JOINTS] ["rad/s or m/s", "finite"]
            "Joint-space image of the velocity offset at the measured pose: inverse Jacobian times velocity_offset. To a \
             controller with follows_joint_velocity = 1: what its joints add to joint_velocity_reference, so that they move \
             as the daemon's [redundancy] has it; 0 while the daemon is not in control.";
        264 twist_command: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Twist reference of the answered sample plus velocity_offset; zero when motion = Hold.";
        312 plan_end_ns: [u64; MAX_PLAN] ["ns", "increasing over the first plan_length values, 0 after them"]
            "End of each plan step, counted from the instant at which this command acts (state_stamp_ns plus the \
             command delay); step i is in force from the end of step i - 1 (0 for the first) to its own end.";
        568 planned_offset: [[f64; TASK_AXES]; MAX_PLAN] ["m/s, rad/s", "finite; 0 after plan_length steps"]
            "Velocity offset of each plan step, like velocity_offset, which equals the first step.";
        2104 joint_per_twist: [[f64; TASK_AXES]; MAX_JOINTS] ["rad/m, 1, or of a prismatic joint 1, m/rad", "finite"]
            "To a controller with follows_joint_velocity = 1: the inverse Jacobian that joint_velocity_offset was made with, a \
             row for each joint, over x y z rx ry rz in the base frame. In plan step i the joints add joint_velocity_offset \
             plus it times (planned_offset[i] minus velocity_offset). 0 to others.";
    }
}
