//! From the daemon: how it is doing.

use iceoryx2::prelude::ZeroCopySend;

use crate::{QUANTILES, TASK_AXES};

wire_sample! {
    /// How the daemon is doing: a few times a second.
    struct DiagnosticsSample: "admittanced.DiagnosticsSample.v5", size 608, writer "admittanced (service thread)" {
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
        124 active_axes: u32 as {TaskAxis} ["1", "0 to 63"]
            "Active axes of the last command, as in the command sample.";
        128 verdict: u32 as Verdict ["1", "a code of Verdict"]
            "Verdict of the last command.";
        132 verdict_axis: u32 as TaskAxis ["1", "0 to 5"]
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
             at the TCP, task frame.";
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
        544 exceeded_count: u64 ["1", ">= 0"]
            "As in the record.";
        552 state_stamp_ns: u64 ["ns", "CLOCK_MONOTONIC; 0 before the first"]
            "Stamp of the last accepted state sample, which is what the law acts on.";
        560 missed_lately: u64 ["1", "0 to 100"]
            "Of the last 100 state samples up to that one, how many were never seen.";
        568 believed_stiffness_n_m: f64 ["N/m", ">= 0"]
            "Stiffness along the normal as it is believed to be at that one; out of contact what the next touch begins with. 0 \
             before the first.";
        576 believed_stiffness_band_n_m: [f64; 2] ["N/m", ">= 0"]
            "Least and greatest that it may be, as in the record.";
        592 believed_tilt_rad: f64 ["rad", ">= 0, finite"]
            "Angle between the believed surface normal and the one in force; 0 where no tolerance of it is told.";
        600 verdict_share: f64 ["1", "0 to 1"]
            "Verdict share of the last command, as in the command sample.";
    }
}
