//! The samples that travel through shared memory, schema version 1.
//!
//! All stamps are nanoseconds of `CLOCK_MONOTONIC` of this host, taken by the writer. Joint arrays hold `joint_count`
//! values, base to tip, and zeros after them. Cartesian arrays hold x, y, z, rx, ry, rz in the robot's base frame, at
//! the TCP; an axis that the arm does not control is zero. A wrench is the one that the ROBOT exerts on the
//! ENVIRONMENT: pushing along +x gives a positive x force. The state sample's alone may be a sensor's as it is: the
//! daemon's `[wrench]` section says how it is given.

use iceoryx2::prelude::ZeroCopySend;

use crate::layout::{SampleInfo, WireSample};
use crate::{MAX_JOINTS, MAX_PLAN, QUANTILES, REQUEST_VALUES, TASK_AXES, TEXT_LENGTH};

wire_sample! {
    /// The measured state of the robot and the references that the motion controller follows: one per cycle.
    struct StateSample: "admittanced.StateSample.v1", size 336,
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
        44 reserved: u32 ["1", "0"]
            "Not used: zero.";
        48 joint_position: [f64; MAX_JOINTS] ["rad", "finite; within the arm's joint limits"]
            "Measured joint positions q.";
        112 joint_velocity: [f64; MAX_JOINTS] ["rad/s", "finite"]
            "Measured joint velocities.";
        176 joint_position_reference: [f64; MAX_JOINTS] ["rad", "finite"]
            "Commanded joint positions q0: they advance with the twist reference alone, whatever the velocity \
             offset does.";
        240 twist_reference: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Commanded TCP velocity without any offset: linear x y z, then angular rx ry rz, base frame.";
        288 wrench: [f64; TASK_AXES] ["N, N m", "finite when wrench_valid = 1"]
            "Measured or estimated wrench: force x y z, then torque rx ry rz. Unless the daemon's [wrench] section \
             says otherwise (sign, sensor frame, bias, tool): the one that the ROBOT exerts on the ENVIRONMENT at the \
             TCP, base frame.";
    }
}

wire_sample! {
    /// The answer to one state sample: the velocity offset, the plan behind it, and why.
    struct CommandSample: "admittanced.CommandSample.v1", size 2096, writer "admittanced" {
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
        104 active_axes: u32 ["1", "0 to 63"]
            "Bit i is set when task axis i (0 = x .. 5 = rz) is in contact and controlled.";
        108 verdict: u32 as Verdict ["1", "a code of Verdict"]
            "Whether the force limits can be met over the horizon.";
        112 verdict_axis: u32 ["1", "0 to 5"]
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
            "Feasible: limit minus predicted peak. Infeasible: minus the newtons missing.";
        144 velocity_offset: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Velocity offset to add to the twist reference, base frame, at the TCP. It counts when motion = Offset.";
        192 joint_velocity_offset: [f64; MAX_JOINTS] ["rad/s", "finite"]
            "Joint-space image of the velocity offset at the measured pose: inverse Jacobian times velocity_offset.";
        256 twist_command: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Twist reference of the answered sample plus velocity_offset; zero when motion = Hold.";
        304 plan_end_ns: [u64; MAX_PLAN] ["ns", "increasing over the first plan_length values, 0 after them"]
            "End of each plan step, counted from the instant at which this command acts (state_stamp_ns plus the \
             command delay); step i is in force from the end of step i - 1 (0 for the first) to its own end.";
        560 planned_offset: [[f64; TASK_AXES]; MAX_PLAN] ["m/s, rad/s", "finite; 0 after plan_length steps"]
            "Velocity offset of each plan step, like velocity_offset, which equals the first step.";
    }
}

wire_sample! {
    /// What only the simulated plant knows and no real robot could tell: true forces and when commands became visible.
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
        96 joint_position: [f64; MAX_JOINTS] ["rad", "finite"]
            "True joint positions.";
        160 joint_velocity: [f64; MAX_JOINTS] ["rad/s", "finite"]
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

wire_sample! {
    /// A request to the daemon's service thread.
    struct RequestSample: "admittanced.RequestSample.v1", size 96, writer "a client such as admittancectl" {
        0 id: u64 ["1", "any"]
            "Chosen by the client; the response carries it back.";
        8 deadline_ns: u64 ["ns", "CLOCK_MONOTONIC"]
            "The server must not act on the request after this instant.";
        16 kind: u32 as RequestKind ["1", "a code of RequestKind"]
            "What is asked.";
        20 force: u32 ["1", "0 or 1"]
            "Of Reset: 1 = although the twist reference points inward or the force is above the release threshold.";
        24 law: u32 as Law ["1", "a code of Law; of other kinds 0"]
            "Of SetLaw: the law from now on.";
        28 given: u32 ["1", "0 to 255"]
            "Bit i is set when values[i] counts; what is not given stays as it is.";
        32 values: [f64; REQUEST_VALUES] ["see the request kind", "finite where given"]
            "Of SetForceLimit: f_max on x y z rx ry rz in N and N m. Of SetEnvironment: normal stiffness in N/m, surface \
             normal x y z (any length above zero, all three or none), contact point x y z in m (all three or none), \
             base frame.";
    }
}

wire_sample! {
    /// The daemon's answer to a request, with its state at that moment.
    struct ResponseSample: "admittanced.ResponseSample.v1", size 1408, writer "admittanced (service thread)" {
        0 id: u64 ["1", "any"]
            "id of the request.";
        8 state_sequence: u64 ["1", ">= 0"]
            "Sequence of the last state sample that was answered; 0 = none yet.";
        16 command_sequence: u64 ["1", ">= 0"]
            "Sequence of the last command published; 0 = none yet.";
        24 cycles: u64 ["1", ">= 0"]
            "State samples answered since the start of admittanced.";
        32 fallback_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        40 late_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        48 missed_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        56 rejected_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        64 uptime_ns: u64 ["ns", ">= 0"]
            "Time since the start of admittanced.";
        72 compute_time_ns: u64 ["ns", ">= 0"]
            "Compute time of the last cycle, as in the command sample.";
        80 status: u32 as ResponseStatus ["1", "a code of ResponseStatus"]
            "How the request ended.";
        84 mode: u32 as Mode ["1", "a code of Mode"]
            "Mode of the daemon.";
        88 motion: u32 as Motion ["1", "a code of Motion"]
            "Motion of the last command.";
        92 stop_reason: u32 as StopReason ["1", "a code of StopReason"]
            "Why the daemon is stopping or stopped.";
        96 active_axes: u32 ["1", "0 to 63"]
            "Active axes of the last command, as in the command sample.";
        100 verdict: u32 as Verdict ["1", "a code of Verdict"]
            "Verdict of the last command.";
        104 joint_count: u32 ["1", "1 to 8"]
            "Number of joints of the configured robot.";
        108 text_length: u32 ["B", "0 to 1024"]
            "Bytes of text that count.";
        112 verdict_margin: f64 ["N (N m on rx ry rz)", "finite"]
            "Verdict margin of the last command, as in the command sample.";
        120 verdict_time_s: f64 ["s", ">= 0, finite"]
            "Verdict time of the last command, as in the command sample.";
        128 wrench: [f64; TASK_AXES] ["N, N m", "finite"]
            "Wrench of the last accepted state sample as the law sees it: bias and tool removed, ROBOT on ENVIRONMENT, \
             at the TCP, base frame.";
        176 velocity_offset: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Velocity offset of the last command, base frame.";
        224 law: u32 as Law ["1", "a code of Law"]
            "Law in force.";
        228 enabled: u32 ["1", "0 or 1"]
            "1 when control is enabled.";
        232 force_limit: [f64; TASK_AXES] ["N, N m", ">= 0"]
            "f_max in force on every task axis; 0 after them.";
        280 wrench_bias: [f64; TASK_AXES] ["N, N m", "finite"]
            "Bias in force of the wrench as the state sample gives it.";
        328 normal_stiffness_n_m: f64 ["N/m", "> 0"]
            "Stiffness in force along the surface normal.";
        336 surface_normal: [f64; 3] ["1", "finite"]
            "Outward surface normal in force x y z, base frame; any length above zero.";
        360 contact_point: [f64; 3] ["m", "finite"]
            "Where the surface is believed to be: a point of it x y z, base frame; 0 before the first cycle.";
        384 text: [u8; TEXT_LENGTH] ["UTF-8", "valid UTF-8 over text_length bytes, 0 after them"]
            "For a person: what was done, or why it was refused.";
    }
}

wire_sample! {
    /// What the daemon's law was given and what it made of it: all that a replay needs, and a look at a cycle wants.
    struct RecordSample: "admittanced.RecordSample.v1", size 2752, writer "admittanced (service thread)" {
        0 sequence: u64 ["1", ">= 1, one more with every record"]
            "Number of this record; a reader that sees a gap has lost records. Restarts at 1 with a new boot_id.";
        8 now_ns: u64 ["ns", "CLOCK_MONOTONIC, not decreasing"]
            "The time that the law was given: when the sample was received, the silence noticed, the order taken.";
        16 boot_id: u64 ["1", "not 0"]
            "boot_id of admittanced.";
        24 expired_at: u64 ["1", ">= 0"]
            "How many times the law had asked whether its time is up when the answer was yes for the first time; \
             0 = never.";
        32 wake_up_latency_ns: u64 ["ns", ">= 0"]
            "From stamp_ns of the state sample to its reception; 0 without a sample.";
        40 compute_time_ns: u64 ["ns", ">= 0"]
            "From the state sample received to the command published, as in the command sample.";
        48 answer_time_ns: u64 ["ns", ">= 0"]
            "From stamp_ns of the state sample to the command published; 0 without a sample.";
        56 dropped_count: u64 ["1", ">= 0"]
            "Records since the start of admittanced that were dropped because its service thread was too slow.";
        64 limited_count: u64 ["1", ">= 0"]
            "Cycles since the start of admittanced whose offset a limit had to cut after the law.";
        72 contact_losses: u64 ["1", ">= 0"]
            "Contacts since the start of admittanced that were lost although they should have been kept.";
        80 kind: u32 as RecordKind ["1", "a code of RecordKind"]
            "What this record tells of.";
        84 iterations: u32 ["1", ">= 0"]
            "Iterations of the solver.";
        88 fault: u32 as Fault ["1", "a code of Fault"]
            "Why the state sample did not reach the law.";
        92 limited: u32 ["1", "0 or 1"]
            "1 when a limit had to cut the offset after the law.";
        96 forced: u32 ["1", "0 or 1"]
            "1 for a reset that was forced.";
        100 done: u32 ["1", "0 or 1"]
            "1 when the order was carried out, 0 when it was refused: of Reset, Replaced, Adjusted and Enable.";
        104 stop_order: u32 as StopReason ["1", "a code of StopReason"]
            "Of Stop: why control ends.";
        108 enabled: u32 ["1", "0 or 1"]
            "1 when control is enabled after this record.";
        112 contact_point: [f64; 3] ["m", "finite"]
            "Where the surface is believed to be after this cycle: a point of it x y z, base frame.";
        136 wrench: [f64; TASK_AXES] ["N, N m", "finite"]
            "The state sample's wrench as the law saw it: bias and tool removed, ROBOT on ENVIRONMENT, at the TCP, base \
             frame; 0 where the sample did not reach the law.";
        184 law: u32 as Law ["1", "a code of Law"]
            "Law in force after this record; this and the following fields are what requests may change.";
        188 reserved: u32 ["1", "0"]
            "Not used: zero.";
        192 force_limit: [f64; TASK_AXES] ["N, N m", ">= 0"]
            "f_max in force on every task axis; 0 after them.";
        240 wrench_bias: [f64; TASK_AXES] ["N, N m", "finite"]
            "Bias in force of the wrench as the state sample gives it.";
        288 normal_stiffness_n_m: f64 ["N/m", "> 0"]
            "Stiffness in force along the surface normal.";
        296 surface_normal: [f64; 3] ["1", "finite"]
            "Outward surface normal in force x y z, base frame; any length above zero.";
        320 state: StateSample ["see StateSample", "see StateSample"]
            "The state sample that was answered; all zero without one.";
        656 command: CommandSample ["see CommandSample", "see CommandSample"]
            "The last command: of Sample and Silence the one that answered, once a first state sample had come.";
    }
}

wire_sample! {
    /// How the daemon is doing: a few times a second.
    struct DiagnosticsSample: "admittanced.DiagnosticsSample.v1", size 544, writer "admittanced (service thread)" {
        0 sequence: u64 ["1", ">= 1, one more with every sample"]
            "Number of this sample; restarts at 1 with a new boot_id.";
        8 stamp_ns: u64 ["ns", "CLOCK_MONOTONIC, increasing"]
            "When it was published.";
        16 boot_id: u64 ["1", "any"]
            "boot_id of admittanced; 0 before its first record.";
        24 uptime_ns: u64 ["ns", ">= 0"]
            "Time since the start of admittanced.";
        32 cycles: u64 ["1", ">= 0"]
            "State samples answered since the start of admittanced.";
        40 cycles_last_second: u64 ["1", ">= 0"]
            "The same within the last complete second.";
        48 fallback_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        56 late_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        64 missed_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        72 rejected_count: u64 ["1", ">= 0"]
            "As in the command sample.";
        80 limited_count: u64 ["1", ">= 0"]
            "As in the record.";
        88 dropped_count: u64 ["1", ">= 0"]
            "Records that were dropped, as in the record.";
        96 contact_losses: u64 ["1", ">= 0"]
            "As in the record.";
        104 solver_failures: u64 ["1", ">= 0"]
            "Cycles since the start of admittanced in which the solver gave no usable answer although it had \
             time.";
        112 mode: u32 as Mode ["1", "a code of Mode"]
            "Mode of the daemon.";
        116 motion: u32 as Motion ["1", "a code of Motion"]
            "Motion of the last command.";
        120 stop_reason: u32 as StopReason ["1", "a code of StopReason"]
            "Why the daemon is stopping or stopped.";
        124 active_axes: u32 ["1", "0 to 63"]
            "Active axes of the last command, as in the command sample.";
        128 verdict: u32 as Verdict ["1", "a code of Verdict"]
            "Verdict of the last command.";
        132 verdict_axis: u32 ["1", "0 to 5"]
            "Task axis that the verdict speaks of.";
        136 verdict_side: u32 as Side ["1", "a code of Side"]
            "Force limit that the verdict speaks of.";
        140 task_axes: u32 ["1", "1 to 6"]
            "Task axes of the configured robot: the first ones of the Cartesian arrays.";
        144 verdict_margin: f64 ["N (N m on rx ry rz)", "finite"]
            "Verdict margin of the last command, as in the command sample.";
        152 verdict_time_s: f64 ["s", ">= 0, finite"]
            "Verdict time of the last command, as in the command sample.";
        160 wrench: [f64; TASK_AXES] ["N, N m", "finite"]
            "Wrench of the last accepted state sample as the law sees it: bias and tool removed, ROBOT on ENVIRONMENT, \
             at the TCP, base frame.";
        208 force_limit: [f64; TASK_AXES] ["N, N m", ">= 0"]
            "Limit in force of the wrench on each axis; 0 on axes that are not controlled.";
        256 minimum_force: [f64; TASK_AXES] ["N, N m", ">= 0"]
            "Configured minimum of the wrench on each axis in contact; 0 on axes that are not controlled.";
        304 velocity_offset: [f64; TASK_AXES] ["m/s, rad/s", "finite"]
            "Velocity offset of the last command, base frame.";
        352 wake_up_ns: [u64; QUANTILES] ["ns", ">= 0"]
            "p50, p99, p99.9 and maximum of the time from a state sample stamped to received, since the start of \
             admittanced; 0 before the first.";
        384 wake_up_last_second_ns: [u64; QUANTILES] ["ns", ">= 0"]
            "The same within the last complete second.";
        416 compute_ns: [u64; QUANTILES] ["ns", ">= 0"]
            "p50, p99, p99.9 and maximum of the time from a state sample received to its command published, since \
             the start of admittanced; 0 before the first.";
        448 compute_last_second_ns: [u64; QUANTILES] ["ns", ">= 0"]
            "The same within the last complete second.";
        480 answer_ns: [u64; QUANTILES] ["ns", ">= 0"]
            "p50, p99, p99.9 and maximum of the time from a state sample stamped to its command published, since \
             the start of admittanced; 0 before the first.";
        512 answer_last_second_ns: [u64; QUANTILES] ["ns", ">= 0"]
            "The same within the last complete second.";
    }
}

/// Every sample type of the contract.
pub const SAMPLES: &[SampleInfo] = &[
    StateSample::INFO,
    CommandSample::INFO,
    TruthSample::INFO,
    RequestSample::INFO,
    ResponseSample::INFO,
    RecordSample::INFO,
    DiagnosticsSample::INFO,
];

impl ResponseSample {
    /// Sets the text. What does not fit is cut at a character boundary.
    pub fn set_text(&mut self, text: &str) {
        let mut length = text.len().min(TEXT_LENGTH);
        while !text.is_char_boundary(length) {
            length -= 1;
        }
        self.text = [0; TEXT_LENGTH];
        self.text[..length].copy_from_slice(&text.as_bytes()[..length]);
        self.text_length = length as u32;
    }

    /// The text. Bytes of a foreign writer that are not UTF-8 appear as U+FFFD; a length beyond the field is cut.
    pub fn text(&self) -> std::borrow::Cow<'_, str> {
        let length = (self.text_length as usize).min(TEXT_LENGTH);
        String::from_utf8_lossy(&self.text[..length])
    }
}
