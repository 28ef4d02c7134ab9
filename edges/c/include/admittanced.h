/* The wire contract of admittanced, schema version 1. Generated: do not edit.
 * Transport: iceoryx2 0.10, shared memory on one host.
 * Layout: C layout of the host (native byte order), explicit offsets, no implicit padding; shape [] is a scalar, [a, b] is a rows of b values.
 * Time: nanoseconds of CLOCK_MONOTONIC on this host, taken by the writer.
 * Cartesian arrays: x y z rx ry rz at the TCP in the robot's base frame; an axis that the arm does not control is 0; of the task frame where a field says so: that is the base frame unless the daemon's [task] says otherwise.
 * Joint arrays: base to tip; values after joint_count are 0.
 * Wrench: what the ROBOT exerts on the ENVIRONMENT: pushing along +x gives a positive x force.
 */
#ifndef ADMITTANCED_H
#define ADMITTANCED_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define ADMITTANCED_ASSERT static_assert
#define ADMITTANCED_ALIGNOF alignof
#else
#define ADMITTANCED_ASSERT _Static_assert
#define ADMITTANCED_ALIGNOF _Alignof
#endif

#define ADMITTANCED_SCHEMA_VERSION 1u
#define ADMITTANCED_MAX_JOINTS 8
#define ADMITTANCED_TASK_AXES 6
#define ADMITTANCED_MAX_PLAN 32
#define ADMITTANCED_QUANTILES 4
#define ADMITTANCED_REQUEST_VALUES 8
#define ADMITTANCED_TEXT_LENGTH 1024

/* Service names: printf formats of the instance name. */
#define ADMITTANCED_SERVICE_STATE "admittanced/%s/state" /* One state sample per cycle of the motion controller. */
#define ADMITTANCED_SERVICE_STATE_ARRIVAL "admittanced/%s/state-arrival" /* Notified with event id 0 after each state sample was published. */
#define ADMITTANCED_SERVICE_COMMAND "admittanced/%s/command" /* One command sample per state sample, and one per max_sample_age_s of silence. */
#define ADMITTANCED_SERVICE_COMMAND_ARRIVAL "admittanced/%s/command-arrival" /* Notified with event id 0 after each command sample was published. */
#define ADMITTANCED_SERVICE_TRUTH "admittanced/%s/truth" /* One truth sample per cycle of plant-sim; readers may fall behind by the buffer size without loss. */
#define ADMITTANCED_SERVICE_RECORD "admittanced/%s/record" /* One record per cycle and per order of admittanced; readers may fall behind by the buffer size, and see a gap in the records' sequence after that. */
#define ADMITTANCED_SERVICE_DIAGNOSTICS "admittanced/%s/diagnostics" /* State, counters and latencies of admittanced, a few times a second. */
#define ADMITTANCED_SERVICE_TWIST "admittanced/%s/twist" /* Where a program leads the TCP, for a motion controller that takes its commanded motion from here; one program at a time. */
#define ADMITTANCED_SERVICE_REQUEST "admittanced/%s/request" /* What an operator asks of the daemon, see RequestKind; one response per request. A client gives up by its own clock: a stopped server answers nothing. */

/* Motion What the motion controller does with a command. */
#define ADMITTANCED_MOTION_OFFSET 0u /* Move with the twist reference plus the velocity offset. */
#define ADMITTANCED_MOTION_HOLD 1u /* Zero joint velocity, whatever the twist reference is. */

/* Mode The mode of the daemon. */
#define ADMITTANCED_MODE_IDLE 0u /* Not in control. Disabled, or before the first sample: the offset is zero. Control lost: Hold. */
#define ADMITTANCED_MODE_FREE 1u /* No axis is in contact; the offset is zero or ramps to zero. */
#define ADMITTANCED_MODE_CONTACT 2u /* At least one axis is in contact and controlled. */
#define ADMITTANCED_MODE_STOPPING 3u /* A stop at the lowest reachable force is under way. */
#define ADMITTANCED_MODE_STOPPED 4u /* Held until a reset; only motion out of the surface is allowed. */

/* Source The source of a command's velocity offset. */
#define ADMITTANCED_SOURCE_NONE 0u /* No law acted: the offset is zero. */
#define ADMITTANCED_SOURCE_MPC 1u /* The model predictive controller's solution of this cycle. */
#define ADMITTANCED_SOURCE_DAMPING 2u /* The damping law, equation (3). */
#define ADMITTANCED_SOURCE_PLAN 3u /* Fallback: the last good plan, played by elapsed time. */
#define ADMITTANCED_SOURCE_RETREAT 4u /* Out of the surface without a solution, or at least no further into it. */
#define ADMITTANCED_SOURCE_RAMP 5u /* The offset of released axes, or of control that ends, on its way to zero. */
#define ADMITTANCED_SOURCE_MINIMUM_FORCE 6u /* The minimum-force stop: least violation of the upper force limit. */

/* Verdict Whether the force limits can be met over the horizon. */
#define ADMITTANCED_VERDICT_NONE 0u /* No verdict: no axis is in contact, or the law gives none. */
#define ADMITTANCED_VERDICT_FEASIBLE 1u /* The limits can be met; the margin is the newtons left. */
#define ADMITTANCED_VERDICT_INFEASIBLE 2u /* The limits cannot be met; axis, side, time and missing newtons are given. */
#define ADMITTANCED_VERDICT_AT_RISK 3u /* Some surfaces that may be there, or a wrench within what it may be off by, cannot be kept below the limit: the offset is that for the worst of them; axis, time and its newtons above the limit are given. */

/* Side Which force limit a verdict is about. */
#define ADMITTANCED_SIDE_NONE 0u /* No limit. */
#define ADMITTANCED_SIDE_UPPER 1u /* The upper limit: the force limit f_max. */
#define ADMITTANCED_SIDE_LOWER 2u /* The lower limit: contact would be lost. */

/* StopReason Why the daemon stops or has stopped, or why it is not in control. */
#define ADMITTANCED_STOP_REASON_NONE 0u /* Not stopping. */
#define ADMITTANCED_STOP_REASON_INFEASIBLE 1u /* The force limits could no longer be met. */
#define ADMITTANCED_STOP_REASON_STARTED_IN_CONTACT 2u /* The first sample, or the first after the motion controller restarted, was in contact. */
#define ADMITTANCED_STOP_REASON_SAMPLE_STALE 3u /* State samples were older than the accepted age, or stopped. */
#define ADMITTANCED_STOP_REASON_SAMPLE_INVALID 4u /* State samples were not finite, out of range, out of order, from the future, or jumped in position. */
#define ADMITTANCED_STOP_REASON_JOINT_COUNT 5u /* The state sample's joint count is not the configured robot's. */
#define ADMITTANCED_STOP_REASON_SINGULAR 6u /* The Jacobian is not invertible at the measured pose, or in contact nearly so. */
#define ADMITTANCED_STOP_REASON_RATE_MISMATCH 7u /* State samples do not arrive at the configured sampling time. */
#define ADMITTANCED_STOP_REASON_FALLBACK_EXHAUSTED 8u /* The solver ran out of time in more cycles in a row than the last plan may stand in for. */
#define ADMITTANCED_STOP_REASON_SOLVER_FAILED 9u /* The solver gave no usable answer in more cycles in a row than the last plan may stand in for. */
#define ADMITTANCED_STOP_REASON_DRIVES_DISABLED 10u /* The motion controller reported its drives as disabled. */
#define ADMITTANCED_STOP_REASON_SHUTDOWN 11u /* The daemon is ending. */
#define ADMITTANCED_STOP_REASON_DISABLED 12u /* Disabled by request. */
#define ADMITTANCED_STOP_REASON_INTERNAL_ERROR 13u /* The daemon's real-time thread failed. */
#define ADMITTANCED_STOP_REASON_CONTACT_LOST 14u /* The minimum force, once reached, was not held. */
#define ADMITTANCED_STOP_REASON_MEASURED_FORCE 15u /* The measured force passed the force limit by more than the guard allows. */
#define ADMITTANCED_STOP_REASON_MODEL_DISAGREES 16u /* The measured force differs from the predicted one, or contradicts the surface's sign. */
#define ADMITTANCED_STOP_REASON_FORCE_EXCEEDED 17u /* The force, as it is without the lag of the wrench estimate, passed its limit by more than the guard allows. */
#define ADMITTANCED_STOP_REASON_SAMPLES_MISSED 18u /* State samples were missed, one after the other or again and again: what the law acted on was too old. */
#define ADMITTANCED_STOP_REASON_SURFACE_OUTSIDE_RANGE 19u /* The surface is harder than the stiffest that was told. */

/* RequestKind What a request asks of the daemon. */
#define ADMITTANCED_REQUEST_KIND_STATUS 1u /* Report the daemon's state; changes nothing. */
#define ADMITTANCED_REQUEST_KIND_RESET 2u /* Release a latched stop. */
#define ADMITTANCED_REQUEST_KIND_ENABLE 3u /* Let control begin, once no axis is in contact. */
#define ADMITTANCED_REQUEST_KIND_DISABLE 4u /* End control: in free motion the offset ramps to zero, in contact the arm stops at a low force. */
#define ADMITTANCED_REQUEST_KIND_TARE 5u /* In free motion: take the mean of the last wrenches, the tool's weight apart, as the bias. */
#define ADMITTANCED_REQUEST_KIND_SET_FORCE_LIMIT 6u /* Another force limit on some axes. */
#define ADMITTANCED_REQUEST_KIND_SET_ENVIRONMENT 7u /* Another stiffness, normal or contact point of the surface. */
#define ADMITTANCED_REQUEST_KIND_SET_LAW 8u /* Another law. */
#define ADMITTANCED_REQUEST_KIND_RELOAD 9u /* Read the configuration file again, as SIGHUP does: what requests have changed is dropped. */

/* Law Which law computes the offset. */
#define ADMITTANCED_LAW_MPC 1u /* MPC-based admittance control (18). */
#define ADMITTANCED_LAW_DAMPING 2u /* Classic admittance control (3). */

/* ResponseStatus How a request ended. */
#define ADMITTANCED_RESPONSE_STATUS_DONE 0u /* The request was carried out. */
#define ADMITTANCED_RESPONSE_STATUS_REFUSED 1u /* The request was refused; the text says why. */
#define ADMITTANCED_RESPONSE_STATUS_EXPIRED 2u /* The request arrived after its deadline; nothing was done. */
#define ADMITTANCED_RESPONSE_STATUS_UNKNOWN 3u /* The request kind is not known to this daemon; nothing was done. */

/* RecordKind What a record tells of. */
#define ADMITTANCED_RECORD_KIND_SAMPLE 1u /* A state sample was answered. */
#define ADMITTANCED_RECORD_KIND_SILENCE 2u /* There was no state sample for too long. */
#define ADMITTANCED_RECORD_KIND_RESET 3u /* A reset was asked for. */
#define ADMITTANCED_RECORD_KIND_STOP 4u /* The end of control was ordered. */
#define ADMITTANCED_RECORD_KIND_REPLACED 5u /* A configuration that was read again was handed over. */
#define ADMITTANCED_RECORD_KIND_ADJUSTED 6u /* Values that a request changed were handed over. */
#define ADMITTANCED_RECORD_KIND_ENABLE 7u /* Enabling control was asked for. */

/* Fault Why a state sample did not reach the law. */
#define ADMITTANCED_FAULT_NONE 0u /* It did. */
#define ADMITTANCED_FAULT_JOINT_COUNT 1u /* Its joint count is not the configured robot's. */
#define ADMITTANCED_FAULT_NOT_FINITE 2u /* A value is NaN or infinite. */
#define ADMITTANCED_FAULT_IMPLAUSIBLE 3u /* A value is larger than any arm's. */
#define ADMITTANCED_FAULT_WRENCH_INVALID 4u /* Its wrench is marked as invalid. */
#define ADMITTANCED_FAULT_STALE 5u /* It was older than the accepted age. */
#define ADMITTANCED_FAULT_FROM_FUTURE 6u /* It was stamped more than one sampling time ahead. */
#define ADMITTANCED_FAULT_OUT_OF_ORDER 7u /* Its sequence or stamp does not follow the last accepted one's. */
#define ADMITTANCED_FAULT_SILENCE 8u /* There was none. */
#define ADMITTANCED_FAULT_WRENCH_SATURATED 9u /* Its wrench is at the end of the sensor's range. */
#define ADMITTANCED_FAULT_JUMP 10u /* A joint is not where it can have moved since the sample before. */
#define ADMITTANCED_FAULT_UNNUMBERED 11u /* Its sequence is 0: samples count from 1. */
#define ADMITTANCED_FAULT_NOT_FOLLOWING 12u /* Its joints do not follow what the law resolves, and it is to resolve redundancy. */

/* TaskAxis A task axis: a direction of the task frame, which is the base frame unless the daemon is told otherwise. An arm has the first D of them. */
#define ADMITTANCED_TASK_AXIS_X 0u /* Along x of the task frame: metres, newtons. */
#define ADMITTANCED_TASK_AXIS_Y 1u /* Along y of the task frame: metres, newtons. */
#define ADMITTANCED_TASK_AXIS_Z 2u /* Along z of the task frame: metres, newtons. */
#define ADMITTANCED_TASK_AXIS_RX 3u /* About x of the task frame: radians, newton metres. */
#define ADMITTANCED_TASK_AXIS_RY 4u /* About y of the task frame: radians, newton metres. */
#define ADMITTANCED_TASK_AXIS_RZ 5u /* About z of the task frame: radians, newton metres. */

/* TwistFrame The axes in which a twist is given. It is of the TCP in either. */
#define ADMITTANCED_TWIST_FRAME_BASE 0u /* Axes of the robot's base frame. */
#define ADMITTANCED_TWIST_FRAME_TOOL 1u /* Axes of the tool's frame as it is measured to stand. */

/* The measured state of the robot and the references that the motion controller follows: one per cycle. Written by the motion controller (plant-sim in a simulation). */
#define ADMITTANCED_STATE_SAMPLE_TYPE_NAME "admittanced.StateSample.v2"
typedef struct admittanced_state_sample {
    /* Number of this sample; restarts at 1 with a new boot_id. Unit: 1. Range: >= 1, one more with every sample. */
    uint64_t sequence;
    /* When the state was measured. The command that answers it acts at this instant plus the agreed command delay. Unit: ns. Range: CLOCK_MONOTONIC, increasing. */
    uint64_t stamp_ns;
    /* Chosen anew at each start of the writer; a change says that the writer restarted and its sequence with it. Unit: 1. Range: not 0. */
    uint64_t boot_id;
    /* The sequence of the command in force when the state was measured; 0 = none yet. Unit: 1. Range: >= 0. */
    uint64_t applied_command_sequence;
    /* Number of joints N: the first N values of each joint array count, the rest is zero. Unit: 1. Range: 1 to 8. */
    uint32_t joint_count;
    /* 1 when the wrench of this sample may be used; 0 = sensor or estimate failed (its values are then ignored). Unit: 1. Range: 0 or 1. */
    uint32_t wrench_valid;
    /* 1 when the drives follow commands; 0 = disabled or braked. Unit: 1. Range: 0 or 1. */
    uint32_t drives_enabled;
    /* 1 when the motion controller plays the planned offsets of a command by elapsed time within its cycle too; 0 = it follows the velocity offset until the next command, and gets one input per cycle. Unit: 1. Range: 0 or 1. */
    uint32_t plays_plan;
    /* Measured joint positions q: rad, of a prismatic joint m. Unit: rad or m. Range: finite; within the arm's joint limits. */
    double joint_position[8];
    /* Measured joint velocities. Unit: rad/s or m/s. Range: finite. */
    double joint_velocity[8];
    /* Commanded joint positions q0: they advance with the twist reference alone, whatever the velocity offset does. Unit: rad or m. Range: finite. */
    double joint_position_reference[8];
    /* Commanded TCP velocity without any offset: linear x y z, then angular rx ry rz, base frame. Unit: m/s, rad/s. Range: finite. */
    double twist_reference[6];
    /* Measured or estimated wrench: force x y z, then torque rx ry rz. Unless the daemon's [wrench] section says otherwise (sign, sensor frame, bias, tool): the one that the ROBOT exerts on the ENVIRONMENT at the TCP, base frame. Unit: N, N m. Range: finite when wrench_valid = 1. */
    double wrench[6];
    /* Torques of the motors at stamp_ns as the drives command them, times the gear ratio: on the joints' side, positive the way the joint turns. What friction and rotors take of them is still in them. Unit: N m. Range: finite when torque_valid = 1. */
    double joint_torque[8];
    /* 1 when joint_torque may be used; 0 = there is none, or it failed. Only wrench.source = "motor_torque" of the daemon looks at it. Unit: 1. Range: 0 or 1. */
    uint32_t torque_valid;
    /* 1 when the joints follow joint_velocity_reference plus joint_velocity_offset of the command, which [redundancy] of the daemon needs; 0 = the motion controller resolves twist_reference plus velocity_offset itself, by the joint velocity of least norm. Unit: 1. Range: 0 or 1. */
    uint32_t follows_joint_velocity;
    /* Commanded joint velocities without any offset: those that bring about twist_reference, and whatever the joints do beside it. Looked at when follows_joint_velocity = 1 alone. Unit: rad/s or m/s. Range: finite when follows_joint_velocity = 1. */
    double joint_velocity_reference[8];
} admittanced_state_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_state_sample) == 472, "admittanced_state_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_state_sample) == 8, "admittanced_state_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, sequence) == 0, "admittanced_state_sample.sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, stamp_ns) == 8, "admittanced_state_sample.stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, boot_id) == 16, "admittanced_state_sample.boot_id");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, applied_command_sequence) == 24, "admittanced_state_sample.applied_command_sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, joint_count) == 32, "admittanced_state_sample.joint_count");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, wrench_valid) == 36, "admittanced_state_sample.wrench_valid");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, drives_enabled) == 40, "admittanced_state_sample.drives_enabled");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, plays_plan) == 44, "admittanced_state_sample.plays_plan");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, joint_position) == 48, "admittanced_state_sample.joint_position");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, joint_velocity) == 112, "admittanced_state_sample.joint_velocity");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, joint_position_reference) == 176, "admittanced_state_sample.joint_position_reference");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, twist_reference) == 240, "admittanced_state_sample.twist_reference");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, wrench) == 288, "admittanced_state_sample.wrench");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, joint_torque) == 336, "admittanced_state_sample.joint_torque");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, torque_valid) == 400, "admittanced_state_sample.torque_valid");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, follows_joint_velocity) == 404, "admittanced_state_sample.follows_joint_velocity");
ADMITTANCED_ASSERT(offsetof(admittanced_state_sample, joint_velocity_reference) == 408, "admittanced_state_sample.joint_velocity_reference");

/* The answer to one state sample: the velocity offset, the plan behind it, and why. Written by admittanced. */
#define ADMITTANCED_COMMAND_SAMPLE_TYPE_NAME "admittanced.CommandSample.v3"
typedef struct admittanced_command_sample {
    /* Number of this command; restarts at 1 with a new boot_id. Unit: 1. Range: >= 1, one more with every command. */
    uint64_t sequence;
    /* When the command was published. Unit: ns. Range: CLOCK_MONOTONIC, increasing. */
    uint64_t stamp_ns;
    /* Chosen anew at each start of admittanced. Unit: 1. Range: not 0. */
    uint64_t boot_id;
    /* Sequence of the state sample that this command answers; 0 = none (for instance a hold at shutdown before any sample). Unit: 1. Range: >= 0. */
    uint64_t state_sequence;
    /* stamp_ns of the state sample that this command answers. Unit: ns. Range: CLOCK_MONOTONIC. */
    uint64_t state_stamp_ns;
    /* Until when the plan may be played if no newer command arrives; from then on the controller holds (zero joint velocity). Unit: ns. Range: CLOCK_MONOTONIC, >= state_stamp_ns. */
    uint64_t valid_until_ns;
    /* Cycles since the start of admittanced that were answered by a fallback (plan or retreat) instead of the law. Unit: 1. Range: >= 0. */
    uint64_t fallback_count;
    /* Cycles since the start of admittanced whose answer was published after its deadline. Unit: 1. Range: >= 0. */
    uint64_t late_count;
    /* State samples since the start of admittanced that were never seen: gaps in their sequence. Unit: 1. Range: >= 0. */
    uint64_t missed_count;
    /* State samples since the start of admittanced that were refused by validation. Unit: 1. Range: >= 0. */
    uint64_t rejected_count;
    /* From the state sample received to this command published. Unit: ns. Range: >= 0. */
    uint64_t compute_time_ns;
    /* Number of joints of the configured robot. Unit: 1. Range: 1 to 8. */
    uint32_t joint_count;
    /* Whether the controller moves with the offset or holds. Unit: 1. Range: a code of Motion. */
    uint32_t motion;
    /* Mode of the daemon after this cycle. Unit: 1. Range: a code of Mode. */
    uint32_t mode;
    /* What the velocity offset comes from. Unit: 1. Range: a code of Source. */
    uint32_t source;
    /* Bit i is set when task axis i (0 = x .. 5 = rz) is in contact and controlled. Unit: 1. Range: 0 to 63. */
    uint32_t active_axes;
    /* Whether the force limits can be met over the horizon. Unit: 1. Range: a code of Verdict. */
    uint32_t verdict;
    /* Task axis that the verdict speaks of (0 = x .. 5 = rz); 0 without a verdict. Unit: 1. Range: 0 to 5. */
    uint32_t verdict_axis;
    /* Force limit that the verdict speaks of. Unit: 1. Range: a code of Side. */
    uint32_t verdict_side;
    /* Why the daemon is stopping or stopped. Unit: 1. Range: a code of StopReason. */
    uint32_t stop_reason;
    /* Number of steps of the plan; 0 = no plan. Unit: 1. Range: 0 to 32. */
    uint32_t plan_length;
    /* Time from the state sample to the predicted peak (feasible) or to the first row that cannot be met (infeasible). Unit: s. Range: >= 0, finite. */
    double verdict_time_s;
    /* Feasible: limit minus predicted peak. Infeasible: minus the newtons missing. AtRisk: minus the newtons by which the worst that may be there exceeds the limit. Unit: N (N m on rx ry rz). Range: finite. */
    double verdict_margin;
    /* AtRisk: the share of all that may be there that cannot be kept below the limit; contact.risk says from which on to stop. 0 otherwise. Unit: 1. Range: 0 to 1. */
    double verdict_share;
    /* Velocity offset to add to the twist reference, base frame, at the TCP. It counts when motion = Offset. Unit: m/s, rad/s. Range: finite. */
    double velocity_offset[6];
    /* Joint-space image of the velocity offset at the measured pose: inverse Jacobian times velocity_offset. To a controller with follows_joint_velocity = 1: what its joints add to joint_velocity_reference, so that they move as the daemon's [redundancy] has it; 0 while the daemon is not in control. Unit: rad/s or m/s. Range: finite. */
    double joint_velocity_offset[8];
    /* Twist reference of the answered sample plus velocity_offset; zero when motion = Hold. Unit: m/s, rad/s. Range: finite. */
    double twist_command[6];
    /* End of each plan step, counted from the instant at which this command acts (state_stamp_ns plus the command delay); step i is in force from the end of step i - 1 (0 for the first) to its own end. Unit: ns. Range: increasing over the first plan_length values, 0 after them. */
    uint64_t plan_end_ns[32];
    /* Velocity offset of each plan step, like velocity_offset, which equals the first step. Unit: m/s, rad/s. Range: finite; 0 after plan_length steps. */
    double planned_offset[32][6];
    /* To a controller with follows_joint_velocity = 1: the inverse Jacobian that joint_velocity_offset was made with, a row for each joint, over x y z rx ry rz in the base frame. In plan step i the joints add joint_velocity_offset plus it times (planned_offset[i] minus velocity_offset). 0 to others. Unit: rad/m, 1, or of a prismatic joint 1, m/rad. Range: finite. */
    double joint_per_twist[8][6];
} admittanced_command_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_command_sample) == 2488, "admittanced_command_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_command_sample) == 8, "admittanced_command_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, sequence) == 0, "admittanced_command_sample.sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, stamp_ns) == 8, "admittanced_command_sample.stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, boot_id) == 16, "admittanced_command_sample.boot_id");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, state_sequence) == 24, "admittanced_command_sample.state_sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, state_stamp_ns) == 32, "admittanced_command_sample.state_stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, valid_until_ns) == 40, "admittanced_command_sample.valid_until_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, fallback_count) == 48, "admittanced_command_sample.fallback_count");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, late_count) == 56, "admittanced_command_sample.late_count");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, missed_count) == 64, "admittanced_command_sample.missed_count");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, rejected_count) == 72, "admittanced_command_sample.rejected_count");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, compute_time_ns) == 80, "admittanced_command_sample.compute_time_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, joint_count) == 88, "admittanced_command_sample.joint_count");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, motion) == 92, "admittanced_command_sample.motion");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, mode) == 96, "admittanced_command_sample.mode");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, source) == 100, "admittanced_command_sample.source");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, active_axes) == 104, "admittanced_command_sample.active_axes");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, verdict) == 108, "admittanced_command_sample.verdict");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, verdict_axis) == 112, "admittanced_command_sample.verdict_axis");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, verdict_side) == 116, "admittanced_command_sample.verdict_side");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, stop_reason) == 120, "admittanced_command_sample.stop_reason");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, plan_length) == 124, "admittanced_command_sample.plan_length");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, verdict_time_s) == 128, "admittanced_command_sample.verdict_time_s");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, verdict_margin) == 136, "admittanced_command_sample.verdict_margin");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, verdict_share) == 144, "admittanced_command_sample.verdict_share");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, velocity_offset) == 152, "admittanced_command_sample.velocity_offset");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, joint_velocity_offset) == 200, "admittanced_command_sample.joint_velocity_offset");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, twist_command) == 264, "admittanced_command_sample.twist_command");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, plan_end_ns) == 312, "admittanced_command_sample.plan_end_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, planned_offset) == 568, "admittanced_command_sample.planned_offset");
ADMITTANCED_ASSERT(offsetof(admittanced_command_sample, joint_per_twist) == 2104, "admittanced_command_sample.joint_per_twist");

/* What only the simulated plant knows, unlike a real robot: true forces, and when commands became visible. Written by plant-sim only. */
#define ADMITTANCED_TRUTH_SAMPLE_TYPE_NAME "admittanced.TruthSample.v1"
typedef struct admittanced_truth_sample {
    /* Sequence of the state sample of the same cycle. Unit: 1. Range: >= 1. */
    uint64_t sequence;
    /* stamp_ns of the state sample of the same cycle: all values are true at this instant unless they say otherwise. Unit: ns. Range: CLOCK_MONOTONIC, increasing. */
    uint64_t stamp_ns;
    /* boot_id of the plant. Unit: 1. Range: not 0. */
    uint64_t boot_id;
    /* From stamp_ns to the instant at which the answering command was visible to the plant; 0 = not seen before the next sample. Unit: ns. Range: >= 0. */
    uint64_t answer_time_ns;
    /* Cycles since the start whose command was not there when it had to act. Unit: 1. Range: >= 0. */
    uint64_t missed_commands;
    /* By how much the plant itself published its state sample late. Unit: ns. Range: >= 0. */
    uint64_t lateness_ns;
    /* 1 when the TCP touches the surface. Unit: 1. Range: 0 or 1. */
    uint32_t in_contact;
    /* Times since the start that contact ended after the first touch. Unit: 1. Range: >= 0. */
    uint32_t contact_losses;
    /* What the plant applied. Unit: 1. Range: a code of Motion. */
    uint32_t motion;
    /* 1 when the command for this cycle did not arrive in time. Unit: 1. Range: 0 or 1. */
    uint32_t missed;
    /* Time since the scenario's motion started; negative before. Unit: s. Range: finite. */
    double scenario_time_s;
    /* True force that the robot exerts along the inward surface normal. Unit: N. Range: >= 0. */
    double normal_force_n;
    /* True depth of the TCP below the undeformed surface, along its normal; negative = gap. Unit: m. Range: finite. */
    double penetration_m;
    /* Largest true normal force since the previous truth sample. Unit: N. Range: >= 0. */
    double peak_normal_force_n;
    /* True joint positions. Unit: rad or m. Range: finite. */
    double joint_position[8];
    /* True joint velocities. Unit: rad/s or m/s. Range: finite. */
    double joint_velocity[8];
    /* True TCP position x y z, base frame. Unit: m. Range: finite. */
    double tcp_position[3];
    /* True TCP orientation relative to the base frame as a rotation vector (axis times angle), base frame. Unit: rad. Range: finite. */
    double tcp_rotation[3];
    /* True TCP velocity, base frame. Unit: m/s, rad/s. Range: finite. */
    double tcp_twist[6];
    /* True wrench that the ROBOT exerts on the ENVIRONMENT at the TCP, base frame. Unit: N, N m. Range: finite. */
    double wrench[6];
    /* Per axis, the true wrench component of largest magnitude since the previous truth sample, with its sign. Unit: N, N m. Range: finite. */
    double peak_wrench[6];
    /* Velocity offset in force at stamp_ns, base frame. Unit: m/s, rad/s. Range: finite. */
    double velocity_offset[6];
} admittanced_truth_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_truth_sample) == 464, "admittanced_truth_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_truth_sample) == 8, "admittanced_truth_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, sequence) == 0, "admittanced_truth_sample.sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, stamp_ns) == 8, "admittanced_truth_sample.stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, boot_id) == 16, "admittanced_truth_sample.boot_id");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, answer_time_ns) == 24, "admittanced_truth_sample.answer_time_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, missed_commands) == 32, "admittanced_truth_sample.missed_commands");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, lateness_ns) == 40, "admittanced_truth_sample.lateness_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, in_contact) == 48, "admittanced_truth_sample.in_contact");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, contact_losses) == 52, "admittanced_truth_sample.contact_losses");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, motion) == 56, "admittanced_truth_sample.motion");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, missed) == 60, "admittanced_truth_sample.missed");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, scenario_time_s) == 64, "admittanced_truth_sample.scenario_time_s");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, normal_force_n) == 72, "admittanced_truth_sample.normal_force_n");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, penetration_m) == 80, "admittanced_truth_sample.penetration_m");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, peak_normal_force_n) == 88, "admittanced_truth_sample.peak_normal_force_n");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, joint_position) == 96, "admittanced_truth_sample.joint_position");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, joint_velocity) == 160, "admittanced_truth_sample.joint_velocity");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, tcp_position) == 224, "admittanced_truth_sample.tcp_position");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, tcp_rotation) == 248, "admittanced_truth_sample.tcp_rotation");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, tcp_twist) == 272, "admittanced_truth_sample.tcp_twist");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, wrench) == 320, "admittanced_truth_sample.wrench");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, peak_wrench) == 368, "admittanced_truth_sample.peak_wrench");
ADMITTANCED_ASSERT(offsetof(admittanced_truth_sample, velocity_offset) == 416, "admittanced_truth_sample.velocity_offset");

/* A request to the daemon's service thread. Written by a client such as admittancectl. */
#define ADMITTANCED_REQUEST_SAMPLE_TYPE_NAME "admittanced.RequestSample.v1"
typedef struct admittanced_request_sample {
    /* Chosen by the client; the response carries it back. Unit: 1. Range: any. */
    uint64_t id;
    /* The server must not act on the request after this instant. Unit: ns. Range: CLOCK_MONOTONIC. */
    uint64_t deadline_ns;
    /* What is asked. Unit: 1. Range: a code of RequestKind. */
    uint32_t kind;
    /* Of Reset: 1 = although the twist reference points inward or the force is above the release threshold. Unit: 1. Range: 0 or 1. */
    uint32_t force;
    /* Of SetLaw: the law from now on. Unit: 1. Range: a code of Law; of other kinds 0. */
    uint32_t law;
    /* Bit i is set when values[i] counts; what is not given stays as it is. Unit: 1. Range: 0 to 255. */
    uint32_t given;
    /* Of SetForceLimit: f_max on x y z rx ry rz in N and N m. Of SetEnvironment: normal stiffness in N/m, surface normal x y z (any length above zero, all three or none), contact point x y z in m (all three or none), base frame. Unit: see the request kind. Range: finite where given. */
    double values[8];
} admittanced_request_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_request_sample) == 96, "admittanced_request_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_request_sample) == 8, "admittanced_request_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_request_sample, id) == 0, "admittanced_request_sample.id");
ADMITTANCED_ASSERT(offsetof(admittanced_request_sample, deadline_ns) == 8, "admittanced_request_sample.deadline_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_request_sample, kind) == 16, "admittanced_request_sample.kind");
ADMITTANCED_ASSERT(offsetof(admittanced_request_sample, force) == 20, "admittanced_request_sample.force");
ADMITTANCED_ASSERT(offsetof(admittanced_request_sample, law) == 24, "admittanced_request_sample.law");
ADMITTANCED_ASSERT(offsetof(admittanced_request_sample, given) == 28, "admittanced_request_sample.given");
ADMITTANCED_ASSERT(offsetof(admittanced_request_sample, values) == 32, "admittanced_request_sample.values");

/* The daemon's answer to a request, with its state at that moment. Written by admittanced (service thread). */
#define ADMITTANCED_RESPONSE_SAMPLE_TYPE_NAME "admittanced.ResponseSample.v4"
typedef struct admittanced_response_sample {
    /* id of the request. Unit: 1. Range: any. */
    uint64_t id;
    /* Sequence of the last state sample that was answered; 0 = none yet. Unit: 1. Range: >= 0. */
    uint64_t state_sequence;
    /* Sequence of the last command published; 0 = none yet. Unit: 1. Range: >= 0. */
    uint64_t command_sequence;
    /* State samples answered since the start of admittanced. Unit: 1. Range: >= 0. */
    uint64_t cycles;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t fallback_count;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t late_count;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t missed_count;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t rejected_count;
    /* Time since the start of admittanced. Unit: ns. Range: >= 0. */
    uint64_t uptime_ns;
    /* Compute time of the last cycle, as in the command sample. Unit: ns. Range: >= 0. */
    uint64_t compute_time_ns;
    /* How the request ended. Unit: 1. Range: a code of ResponseStatus. */
    uint32_t status;
    /* Mode of the daemon. Unit: 1. Range: a code of Mode. */
    uint32_t mode;
    /* Motion of the last command. Unit: 1. Range: a code of Motion. */
    uint32_t motion;
    /* Why the daemon is stopping or stopped. Unit: 1. Range: a code of StopReason. */
    uint32_t stop_reason;
    /* Active axes of the last command, as in the command sample. Unit: 1. Range: 0 to 63. */
    uint32_t active_axes;
    /* Verdict of the last command. Unit: 1. Range: a code of Verdict. */
    uint32_t verdict;
    /* Number of joints of the configured robot. Unit: 1. Range: 1 to 8. */
    uint32_t joint_count;
    /* Bytes of text that count. Unit: B. Range: 0 to 1024. */
    uint32_t text_length;
    /* Verdict margin of the last command, as in the command sample. Unit: N (N m on rx ry rz). Range: finite. */
    double verdict_margin;
    /* Verdict time of the last command, as in the command sample. Unit: s. Range: >= 0, finite. */
    double verdict_time_s;
    /* Wrench of the last accepted state sample as the law sees it: bias and tool removed, ROBOT on ENVIRONMENT, at the TCP, task frame. Unit: N, N m. Range: finite. */
    double wrench[6];
    /* Velocity offset of the last command, base frame. Unit: m/s, rad/s. Range: finite. */
    double velocity_offset[6];
    /* Law in force. Unit: 1. Range: a code of Law. */
    uint32_t law;
    /* 1 when control is enabled. Unit: 1. Range: 0 or 1. */
    uint32_t enabled;
    /* f_max in force on every task axis; 0 after them. Unit: N, N m. Range: >= 0. */
    double force_limit[6];
    /* Bias in force of the wrench as the state sample gives it. Unit: N, N m. Range: finite. */
    double wrench_bias[6];
    /* Stiffness in force along the surface normal. Unit: N/m. Range: > 0. */
    double normal_stiffness_n_m;
    /* Outward surface normal in force x y z, base frame; any length above zero. Unit: 1. Range: finite. */
    double surface_normal[3];
    /* Where the surface is believed to be: a point of it x y z, base frame; 0 before the first cycle. Unit: m. Range: finite. */
    double contact_point[3];
    /* Task axis that the verdict speaks of, as in the command sample. Unit: 1. Range: 0 to 5. */
    uint32_t verdict_axis;
    /* Force limit that the verdict speaks of, as in the command sample. Unit: 1. Range: a code of Side. */
    uint32_t verdict_side;
    /* Stiffness along the normal as it is believed to be; out of contact what the next touch begins with. 0 before the first cycle. Unit: N/m. Range: >= 0. */
    double believed_stiffness_n_m;
    /* Least and greatest stiffness that it may be, as in the record. Unit: N/m. Range: >= 0. */
    double believed_stiffness_band_n_m[2];
    /* Outward surface normal as it is believed to be, base frame, as in the record; 0 before the first cycle. Unit: 1. Range: finite. */
    double believed_normal[3];
    /* AtRisk: the share that cannot be kept, as in the command sample. Unit: 1. Range: 0 to 1. */
    double verdict_share;
    /* For a person: what was done, or why it was refused. Unit: UTF-8. Range: valid UTF-8 over text_length bytes, 0 after them. */
    uint8_t text[1024];
} admittanced_response_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_response_sample) == 1472, "admittanced_response_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_response_sample) == 8, "admittanced_response_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, id) == 0, "admittanced_response_sample.id");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, state_sequence) == 8, "admittanced_response_sample.state_sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, command_sequence) == 16, "admittanced_response_sample.command_sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, cycles) == 24, "admittanced_response_sample.cycles");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, fallback_count) == 32, "admittanced_response_sample.fallback_count");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, late_count) == 40, "admittanced_response_sample.late_count");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, missed_count) == 48, "admittanced_response_sample.missed_count");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, rejected_count) == 56, "admittanced_response_sample.rejected_count");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, uptime_ns) == 64, "admittanced_response_sample.uptime_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, compute_time_ns) == 72, "admittanced_response_sample.compute_time_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, status) == 80, "admittanced_response_sample.status");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, mode) == 84, "admittanced_response_sample.mode");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, motion) == 88, "admittanced_response_sample.motion");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, stop_reason) == 92, "admittanced_response_sample.stop_reason");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, active_axes) == 96, "admittanced_response_sample.active_axes");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, verdict) == 100, "admittanced_response_sample.verdict");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, joint_count) == 104, "admittanced_response_sample.joint_count");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, text_length) == 108, "admittanced_response_sample.text_length");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, verdict_margin) == 112, "admittanced_response_sample.verdict_margin");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, verdict_time_s) == 120, "admittanced_response_sample.verdict_time_s");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, wrench) == 128, "admittanced_response_sample.wrench");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, velocity_offset) == 176, "admittanced_response_sample.velocity_offset");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, law) == 224, "admittanced_response_sample.law");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, enabled) == 228, "admittanced_response_sample.enabled");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, force_limit) == 232, "admittanced_response_sample.force_limit");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, wrench_bias) == 280, "admittanced_response_sample.wrench_bias");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, normal_stiffness_n_m) == 328, "admittanced_response_sample.normal_stiffness_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, surface_normal) == 336, "admittanced_response_sample.surface_normal");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, contact_point) == 360, "admittanced_response_sample.contact_point");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, verdict_axis) == 384, "admittanced_response_sample.verdict_axis");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, verdict_side) == 388, "admittanced_response_sample.verdict_side");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, believed_stiffness_n_m) == 392, "admittanced_response_sample.believed_stiffness_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, believed_stiffness_band_n_m) == 400, "admittanced_response_sample.believed_stiffness_band_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, believed_normal) == 416, "admittanced_response_sample.believed_normal");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, verdict_share) == 440, "admittanced_response_sample.verdict_share");
ADMITTANCED_ASSERT(offsetof(admittanced_response_sample, text) == 448, "admittanced_response_sample.text");

/* Inputs and outputs of the daemon's law: everything that a replay or an inspection of a cycle needs. Written by admittanced (service thread). */
#define ADMITTANCED_RECORD_SAMPLE_TYPE_NAME "admittanced.RecordSample.v7"
typedef struct admittanced_record_sample {
    /* Number of this record; a reader that sees a gap has lost records. Restarts at 1 with a new boot_id. Unit: 1. Range: >= 1, one more with every record. */
    uint64_t sequence;
    /* The time that the law was given: when the sample was received, the silence noticed, the order taken. Unit: ns. Range: CLOCK_MONOTONIC, not decreasing. */
    uint64_t now_ns;
    /* boot_id of admittanced. Unit: 1. Range: not 0. */
    uint64_t boot_id;
    /* How many times the law had asked whether its time is up when the answer was yes for the first time; 0 = never. Unit: 1. Range: >= 0. */
    uint64_t expired_at;
    /* From stamp_ns of the state sample to its reception; 0 without a sample. Unit: ns. Range: >= 0. */
    uint64_t wake_up_latency_ns;
    /* From the state sample received to the command published, as in the command sample. Unit: ns. Range: >= 0. */
    uint64_t compute_time_ns;
    /* From stamp_ns of the state sample to the command published; 0 without a sample. Unit: ns. Range: >= 0. */
    uint64_t answer_time_ns;
    /* Records since the start of admittanced that were dropped because its service thread was too slow. Unit: 1. Range: >= 0. */
    uint64_t dropped_count;
    /* Cycles since the start of admittanced whose offset a limit had to cut after the law. Unit: 1. Range: >= 0. */
    uint64_t limited_count;
    /* Contacts since the start of admittanced that were lost although they should have been kept. Unit: 1. Range: >= 0. */
    uint64_t contact_losses;
    /* What this record tells of. Unit: 1. Range: a code of RecordKind. */
    uint32_t kind;
    /* Iterations of the solver. Unit: 1. Range: >= 0. */
    uint32_t iterations;
    /* Why the state sample did not reach the law. Unit: 1. Range: a code of Fault. */
    uint32_t fault;
    /* 1 when a limit had to cut the offset after the law. Unit: 1. Range: 0 or 1. */
    uint32_t limited;
    /* 1 for a reset that was forced. Unit: 1. Range: 0 or 1. */
    uint32_t forced;
    /* 1 when the order was carried out, 0 when it was refused: of Reset, Replaced, Adjusted and Enable. Unit: 1. Range: 0 or 1. */
    uint32_t done;
    /* Of Stop: why control ends. Unit: 1. Range: a code of StopReason. */
    uint32_t stop_order;
    /* 1 when control is enabled after this record. Unit: 1. Range: 0 or 1. */
    uint32_t enabled;
    /* Where the surface is believed to be after this cycle: a point of it x y z, base frame. Unit: m. Range: finite. */
    double contact_point[3];
    /* The state sample's wrench as the law saw it: bias and tool removed, ROBOT on ENVIRONMENT, at the TCP, task frame; 0 where the sample did not reach the law. Unit: N, N m. Range: finite. */
    double wrench[6];
    /* Law in force after this record; this and the following fields are what requests may change. Unit: 1. Range: a code of Law. */
    uint32_t law;
    /* Not used: zero. Unit: 1. Range: 0. */
    uint32_t reserved;
    /* f_max in force on every task axis; 0 after them. Unit: N, N m. Range: >= 0. */
    double force_limit[6];
    /* Bias in force of the wrench as the state sample gives it. Unit: N, N m. Range: finite. */
    double wrench_bias[6];
    /* Stiffness in force along the surface normal. Unit: N/m. Range: > 0. */
    double normal_stiffness_n_m;
    /* Outward surface normal in force x y z, base frame; any length above zero. Unit: 1. Range: finite. */
    double surface_normal[3];
    /* What the predicted force may be off for not knowing the contact point better, after this cycle: two standard deviations; 0 where the contact point is told. Unit: N. Range: >= 0. */
    double belief_uncertainty_n;
    /* Pressing force that the wrench estimate should show at expected_stamp_ns, by the surface as it is believed to be. Unit: N. Range: finite. */
    double expected_pressing_n;
    /* Force of the believed surface's spring at the pose of expected_stamp_ns. Unit: N. Range: finite. */
    double expected_spring_n;
    /* Stamp of the last state sample that the belief has followed; 0 = none yet. Unit: ns. Range: CLOCK_MONOTONIC. */
    uint64_t expected_stamp_ns;
    /* What the wrench shows of the acceleration of the tool's centre of gravity after this cycle: what a tool of 1 kg adds to it, at the TCP, task frame; 0 without a tool. Unit: m/s^2, m^2/s^2. Range: finite. */
    double tool_acceleration[6];
    /* Joint velocities as the law sees them after this cycle: estimated where robot.velocity_loop says that they are reported late, or that loops are of second order. Unit: rad/s or m/s. Range: finite. */
    double joint_velocity[8];
    /* Joint accelerations, estimated; 0 of loops of first order. Unit: rad/s^2 or m/s^2. Range: finite. */
    double joint_acceleration[8];
    /* The state sample that was answered; all zero without one. Unit: see StateSample. Range: see StateSample. */
    admittanced_state_sample state;
    /* The last command: of Sample and Silence the one that answered, once a first state sample had come. Unit: see CommandSample. Range: see CommandSample. */
    admittanced_command_sample command;
    /* State samples since the start of admittanced whose wrench_without_lag was beyond the force limit of an axis by more than the tolerance of the limit and the noise that was told. Unit: 1. Range: >= 0. */
    uint64_t exceeded_count;
    /* The wrench with the lag of its estimate taken out: mean over the last cycles, as many as its noise needs; 0 where the sample did not reach the law. Unit: N, N m. Range: finite. */
    double wrench_without_lag[6];
    /* Stiffness along the normal as it is believed to be after this cycle. Unit: N/m. Range: >= 0. */
    double believed_stiffness_n_m;
    /* Least and greatest stiffness that it may be: one standard deviation where a range of it was told, and else that stiffness. Unit: N/m. Range: >= 0. */
    double believed_stiffness_band_n_m[2];
    /* Outward surface normal as it is believed to be after this cycle, base frame: surface_normal, unless a tolerance of it was told. Unit: 1. Range: finite. */
    double believed_normal[3];
    /* Standard deviation of wrench where it follows from motor torques; 0 of a wrench that the state sample gives. Unit: N, N m. Range: >= 0. */
    double wrench_deviation[6];
} admittanced_record_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_record_sample) == 3640, "admittanced_record_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_record_sample) == 8, "admittanced_record_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, sequence) == 0, "admittanced_record_sample.sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, now_ns) == 8, "admittanced_record_sample.now_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, boot_id) == 16, "admittanced_record_sample.boot_id");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, expired_at) == 24, "admittanced_record_sample.expired_at");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, wake_up_latency_ns) == 32, "admittanced_record_sample.wake_up_latency_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, compute_time_ns) == 40, "admittanced_record_sample.compute_time_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, answer_time_ns) == 48, "admittanced_record_sample.answer_time_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, dropped_count) == 56, "admittanced_record_sample.dropped_count");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, limited_count) == 64, "admittanced_record_sample.limited_count");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, contact_losses) == 72, "admittanced_record_sample.contact_losses");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, kind) == 80, "admittanced_record_sample.kind");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, iterations) == 84, "admittanced_record_sample.iterations");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, fault) == 88, "admittanced_record_sample.fault");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, limited) == 92, "admittanced_record_sample.limited");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, forced) == 96, "admittanced_record_sample.forced");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, done) == 100, "admittanced_record_sample.done");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, stop_order) == 104, "admittanced_record_sample.stop_order");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, enabled) == 108, "admittanced_record_sample.enabled");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, contact_point) == 112, "admittanced_record_sample.contact_point");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, wrench) == 136, "admittanced_record_sample.wrench");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, law) == 184, "admittanced_record_sample.law");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, reserved) == 188, "admittanced_record_sample.reserved");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, force_limit) == 192, "admittanced_record_sample.force_limit");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, wrench_bias) == 240, "admittanced_record_sample.wrench_bias");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, normal_stiffness_n_m) == 288, "admittanced_record_sample.normal_stiffness_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, surface_normal) == 296, "admittanced_record_sample.surface_normal");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, belief_uncertainty_n) == 320, "admittanced_record_sample.belief_uncertainty_n");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, expected_pressing_n) == 328, "admittanced_record_sample.expected_pressing_n");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, expected_spring_n) == 336, "admittanced_record_sample.expected_spring_n");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, expected_stamp_ns) == 344, "admittanced_record_sample.expected_stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, tool_acceleration) == 352, "admittanced_record_sample.tool_acceleration");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, joint_velocity) == 400, "admittanced_record_sample.joint_velocity");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, joint_acceleration) == 464, "admittanced_record_sample.joint_acceleration");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, state) == 528, "admittanced_record_sample.state");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, command) == 1000, "admittanced_record_sample.command");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, exceeded_count) == 3488, "admittanced_record_sample.exceeded_count");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, wrench_without_lag) == 3496, "admittanced_record_sample.wrench_without_lag");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, believed_stiffness_n_m) == 3544, "admittanced_record_sample.believed_stiffness_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, believed_stiffness_band_n_m) == 3552, "admittanced_record_sample.believed_stiffness_band_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, believed_normal) == 3568, "admittanced_record_sample.believed_normal");
ADMITTANCED_ASSERT(offsetof(admittanced_record_sample, wrench_deviation) == 3592, "admittanced_record_sample.wrench_deviation");

/* How the daemon is doing: a few times a second. Written by admittanced (service thread). */
#define ADMITTANCED_DIAGNOSTICS_SAMPLE_TYPE_NAME "admittanced.DiagnosticsSample.v5"
typedef struct admittanced_diagnostics_sample {
    /* Number of this sample; restarts at 1 with a new boot_id. Unit: 1. Range: >= 1, one more with every sample. */
    uint64_t sequence;
    /* When it was published. Unit: ns. Range: CLOCK_MONOTONIC, increasing. */
    uint64_t stamp_ns;
    /* boot_id of admittanced; 0 before its first record. Unit: 1. Range: any. */
    uint64_t boot_id;
    /* Time since the start of admittanced. Unit: ns. Range: >= 0. */
    uint64_t uptime_ns;
    /* State samples answered since the start of admittanced. Unit: 1. Range: >= 0. */
    uint64_t cycles;
    /* The same within the last complete second. Unit: 1. Range: >= 0. */
    uint64_t cycles_last_second;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t fallback_count;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t late_count;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t missed_count;
    /* As in the command sample. Unit: 1. Range: >= 0. */
    uint64_t rejected_count;
    /* As in the record. Unit: 1. Range: >= 0. */
    uint64_t limited_count;
    /* Records that were dropped, as in the record. Unit: 1. Range: >= 0. */
    uint64_t dropped_count;
    /* As in the record. Unit: 1. Range: >= 0. */
    uint64_t contact_losses;
    /* Cycles since the start of admittanced in which the solver gave no usable answer although it had time. Unit: 1. Range: >= 0. */
    uint64_t solver_failures;
    /* Mode of the daemon. Unit: 1. Range: a code of Mode. */
    uint32_t mode;
    /* Motion of the last command. Unit: 1. Range: a code of Motion. */
    uint32_t motion;
    /* Why the daemon is stopping or stopped. Unit: 1. Range: a code of StopReason. */
    uint32_t stop_reason;
    /* Active axes of the last command, as in the command sample. Unit: 1. Range: 0 to 63. */
    uint32_t active_axes;
    /* Verdict of the last command. Unit: 1. Range: a code of Verdict. */
    uint32_t verdict;
    /* Task axis that the verdict speaks of. Unit: 1. Range: 0 to 5. */
    uint32_t verdict_axis;
    /* Force limit that the verdict speaks of. Unit: 1. Range: a code of Side. */
    uint32_t verdict_side;
    /* Task axes of the configured robot: the first ones of the Cartesian arrays. Unit: 1. Range: 1 to 6. */
    uint32_t task_axes;
    /* Verdict margin of the last command, as in the command sample. Unit: N (N m on rx ry rz). Range: finite. */
    double verdict_margin;
    /* Verdict time of the last command, as in the command sample. Unit: s. Range: >= 0, finite. */
    double verdict_time_s;
    /* Wrench of the last accepted state sample as the law sees it: bias and tool removed, ROBOT on ENVIRONMENT, at the TCP, task frame. Unit: N, N m. Range: finite. */
    double wrench[6];
    /* Limit in force of the wrench on each axis; 0 on axes that are not controlled. Unit: N, N m. Range: >= 0. */
    double force_limit[6];
    /* Configured minimum of the wrench on each axis in contact; 0 on axes that are not controlled. Unit: N, N m. Range: >= 0. */
    double minimum_force[6];
    /* Velocity offset of the last command, base frame. Unit: m/s, rad/s. Range: finite. */
    double velocity_offset[6];
    /* p50, p99, p99.9 and maximum of the time from a state sample stamped to received, since the start of admittanced; 0 before the first. Unit: ns. Range: >= 0. */
    uint64_t wake_up_ns[4];
    /* The same within the last complete second. Unit: ns. Range: >= 0. */
    uint64_t wake_up_last_second_ns[4];
    /* p50, p99, p99.9 and maximum of the time from a state sample received to its command published, since the start of admittanced; 0 before the first. Unit: ns. Range: >= 0. */
    uint64_t compute_ns[4];
    /* The same within the last complete second. Unit: ns. Range: >= 0. */
    uint64_t compute_last_second_ns[4];
    /* p50, p99, p99.9 and maximum of the time from a state sample stamped to its command published, since the start of admittanced; 0 before the first. Unit: ns. Range: >= 0. */
    uint64_t answer_ns[4];
    /* The same within the last complete second. Unit: ns. Range: >= 0. */
    uint64_t answer_last_second_ns[4];
    /* As in the record. Unit: 1. Range: >= 0. */
    uint64_t exceeded_count;
    /* Stamp of the last accepted state sample, which is what the law acts on. Unit: ns. Range: CLOCK_MONOTONIC; 0 before the first. */
    uint64_t state_stamp_ns;
    /* Of the last 100 state samples up to that one, how many were never seen. Unit: 1. Range: 0 to 100. */
    uint64_t missed_lately;
    /* Stiffness along the normal as it is believed to be at that one; out of contact what the next touch begins with. 0 before the first. Unit: N/m. Range: >= 0. */
    double believed_stiffness_n_m;
    /* Least and greatest that it may be, as in the record. Unit: N/m. Range: >= 0. */
    double believed_stiffness_band_n_m[2];
    /* Angle between the believed surface normal and the one in force; 0 where no tolerance of it is told. Unit: rad. Range: >= 0, finite. */
    double believed_tilt_rad;
    /* Verdict share of the last command, as in the command sample. Unit: 1. Range: 0 to 1. */
    double verdict_share;
} admittanced_diagnostics_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_diagnostics_sample) == 608, "admittanced_diagnostics_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_diagnostics_sample) == 8, "admittanced_diagnostics_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, sequence) == 0, "admittanced_diagnostics_sample.sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, stamp_ns) == 8, "admittanced_diagnostics_sample.stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, boot_id) == 16, "admittanced_diagnostics_sample.boot_id");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, uptime_ns) == 24, "admittanced_diagnostics_sample.uptime_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, cycles) == 32, "admittanced_diagnostics_sample.cycles");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, cycles_last_second) == 40, "admittanced_diagnostics_sample.cycles_last_second");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, fallback_count) == 48, "admittanced_diagnostics_sample.fallback_count");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, late_count) == 56, "admittanced_diagnostics_sample.late_count");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, missed_count) == 64, "admittanced_diagnostics_sample.missed_count");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, rejected_count) == 72, "admittanced_diagnostics_sample.rejected_count");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, limited_count) == 80, "admittanced_diagnostics_sample.limited_count");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, dropped_count) == 88, "admittanced_diagnostics_sample.dropped_count");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, contact_losses) == 96, "admittanced_diagnostics_sample.contact_losses");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, solver_failures) == 104, "admittanced_diagnostics_sample.solver_failures");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, mode) == 112, "admittanced_diagnostics_sample.mode");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, motion) == 116, "admittanced_diagnostics_sample.motion");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, stop_reason) == 120, "admittanced_diagnostics_sample.stop_reason");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, active_axes) == 124, "admittanced_diagnostics_sample.active_axes");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, verdict) == 128, "admittanced_diagnostics_sample.verdict");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, verdict_axis) == 132, "admittanced_diagnostics_sample.verdict_axis");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, verdict_side) == 136, "admittanced_diagnostics_sample.verdict_side");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, task_axes) == 140, "admittanced_diagnostics_sample.task_axes");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, verdict_margin) == 144, "admittanced_diagnostics_sample.verdict_margin");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, verdict_time_s) == 152, "admittanced_diagnostics_sample.verdict_time_s");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, wrench) == 160, "admittanced_diagnostics_sample.wrench");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, force_limit) == 208, "admittanced_diagnostics_sample.force_limit");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, minimum_force) == 256, "admittanced_diagnostics_sample.minimum_force");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, velocity_offset) == 304, "admittanced_diagnostics_sample.velocity_offset");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, wake_up_ns) == 352, "admittanced_diagnostics_sample.wake_up_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, wake_up_last_second_ns) == 384, "admittanced_diagnostics_sample.wake_up_last_second_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, compute_ns) == 416, "admittanced_diagnostics_sample.compute_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, compute_last_second_ns) == 448, "admittanced_diagnostics_sample.compute_last_second_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, answer_ns) == 480, "admittanced_diagnostics_sample.answer_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, answer_last_second_ns) == 512, "admittanced_diagnostics_sample.answer_last_second_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, exceeded_count) == 544, "admittanced_diagnostics_sample.exceeded_count");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, state_stamp_ns) == 552, "admittanced_diagnostics_sample.state_stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, missed_lately) == 560, "admittanced_diagnostics_sample.missed_lately");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, believed_stiffness_n_m) == 568, "admittanced_diagnostics_sample.believed_stiffness_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, believed_stiffness_band_n_m) == 576, "admittanced_diagnostics_sample.believed_stiffness_band_n_m");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, believed_tilt_rad) == 592, "admittanced_diagnostics_sample.believed_tilt_rad");
ADMITTANCED_ASSERT(offsetof(admittanced_diagnostics_sample, verdict_share) == 600, "admittanced_diagnostics_sample.verdict_share");

/* Where a program leads the TCP, for a motion controller that takes its commanded motion from here. It counts for valid_for_ns and no longer; then the controller comes to rest. Written by a program that leads, such as admittancectl move. */
#define ADMITTANCED_TWIST_SAMPLE_TYPE_NAME "admittanced.TwistSample.v1"
typedef struct admittanced_twist_sample {
    /* Number of this sample; restarts at 1 with a new boot_id. Unit: 1. Range: >= 1, one more with every sample. */
    uint64_t sequence;
    /* When it was published. Unit: ns. Range: CLOCK_MONOTONIC, increasing. */
    uint64_t stamp_ns;
    /* Chosen anew at each start of the program that leads. Unit: 1. Range: not 0. */
    uint64_t boot_id;
    /* How long after stamp_ns it counts; the twist is zero from then on. Publish the next one before. Unit: ns. Range: >= 1, at most what the motion controller allows. */
    uint64_t valid_for_ns;
    /* The axes of twist. Unit: 1. Range: a code of TwistFrame. */
    uint32_t frame;
    /* Not used: zero. Unit: 1. Range: 0. */
    uint32_t reserved;
    /* Velocity of the TCP without any offset: linear x y z, then angular rx ry rz. The motion controller brings it down to its own limits. Unit: m/s, rad/s. Range: finite; 0 on axes that the arm does not control. */
    double twist[6];
} admittanced_twist_sample;
ADMITTANCED_ASSERT(sizeof(admittanced_twist_sample) == 88, "admittanced_twist_sample");
ADMITTANCED_ASSERT(ADMITTANCED_ALIGNOF(admittanced_twist_sample) == 8, "admittanced_twist_sample");
ADMITTANCED_ASSERT(offsetof(admittanced_twist_sample, sequence) == 0, "admittanced_twist_sample.sequence");
ADMITTANCED_ASSERT(offsetof(admittanced_twist_sample, stamp_ns) == 8, "admittanced_twist_sample.stamp_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_twist_sample, boot_id) == 16, "admittanced_twist_sample.boot_id");
ADMITTANCED_ASSERT(offsetof(admittanced_twist_sample, valid_for_ns) == 24, "admittanced_twist_sample.valid_for_ns");
ADMITTANCED_ASSERT(offsetof(admittanced_twist_sample, frame) == 32, "admittanced_twist_sample.frame");
ADMITTANCED_ASSERT(offsetof(admittanced_twist_sample, reserved) == 36, "admittanced_twist_sample.reserved");
ADMITTANCED_ASSERT(offsetof(admittanced_twist_sample, twist) == 40, "admittanced_twist_sample.twist");

#endif
