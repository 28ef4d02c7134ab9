//! From the daemon: inputs and outputs of its law.

use iceoryx2::prelude::ZeroCopySend;

use super::{CommandSample, StateSample};
use crate::{MAX_JOINTS, TASK_AXES};

wire_sample! {
    /// Inputs and outputs of the daemon's law: everything that a replay or an inspection of a cycle
    /// needs.
    struct RecordSample: "admittanced.RecordSample.v7", size 3640, writer "admittanced (service thread)" {
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
            "The state sample's wrench as the law saw it: bias and tool removed, ROBOT on ENVIRONMENT, at the TCP, task \
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
        320 belief_uncertainty_n: f64 ["N", ">= 0"]
            "What the predicted force may be off for not knowing the contact point better, after this cycle: two standard \
             deviations; 0 where the contact point is told.";
        328 expected_pressing_n: f64 ["N", "finite"]
            "Pressing force that the wrench estimate should show at expected_stamp_ns, by the surface as it is believed to \
             be.";
        336 expected_spring_n: f64 ["N", "finite"]
            "Force of the believed surface's spring at the pose of expected_stamp_ns.";
        344 expected_stamp_ns: u64 ["ns", "CLOCK_MONOTONIC"]
            "Stamp of the last state sample that the belief has followed; 0 = none yet.";
        352 tool_acceleration: [f64; TASK_AXES] ["m/s^2, m^2/s^2", "finite"]
            "What the wrench shows of the acceleration of the tool's centre of gravity after this cycle: what a tool of 1 kg \
             adds to it, at the TCP, task frame; 0 without a tool.";
        400 joint_velocity: [f64; MAX_JOINTS] ["rad/s or m/s", "finite"]
            "Joint velocities as the law sees them after this cycle: estimated where robot.velocity_loop says that they are \
             reported late, or that loops are of second order.";
        464 joint_acceleration: [f64; MAX_JOINTS] ["rad/s^2 or m/s^2", "finite"]
            "Joint accelerations, estimated; 0 of loops of first order.";
        528 state: StateSample ["see StateSample", "see StateSample"]
            "The state sample that was answered; all zero without one.";
        1000 command: CommandSample ["see CommandSample", "see CommandSample"]
            "The last command: of Sample and Silence the one that answered, once a first state sample had come.";
        3488 exceeded_count: u64 ["1", ">= 0"]
            "State samples since the start of admittanced whose wrench_without_lag was beyond the force limit of an axis by \
             more than the tolerance of the limit and the noise that was told.";
        3496 wrench_without_lag: [f64; TASK_AXES] ["N, N m", "finite"]
            "The wrench with the lag of its estimate taken out: mean over the last cycles, as many as its noise needs; 0 \
             where the sample did not reach the law.";
        3544 believed_stiffness_n_m: f64 ["N/m", ">= 0"]
            "Stiffness along the normal as it is believed to be after this cycle.";
        3552 believed_stiffness_band_n_m: [f64; 2] ["N/m", ">= 0"]
            "Least and greatest stiffness that it may be: one standard deviation where a range of it was told, and else that \
             stiffness.";
        3568 believed_normal: [f64; 3] ["1", "finite"]
            "Outward surface normal as it is believed to be after this cycle, base frame: surface_normal, unless a tolerance \
             of it was told.";
        3592 wrench_deviation: [f64; TASK_AXES] ["N, N m", ">= 0"]
            "Standard deviation of wrench where it follows from motor torques; 0 of a wrench that the state sample gives.";
    }
}

impl RecordSample {
    /// Angle in rad between the believed surface normal and the one that was told; 0 where that is
    /// rounding alone, and where a record does not have one.
    pub fn believed_tilt_rad(&self) -> f64 {
        super::angle_between(&self.believed_normal, &self.surface_normal)
    }
}
