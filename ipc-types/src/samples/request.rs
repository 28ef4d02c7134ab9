//! Requests to the daemon, and their answers.

use iceoryx2::prelude::ZeroCopySend;

use crate::{REQUEST_VALUES, TASK_AXES, TEXT_LENGTH};

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
    struct ResponseSample: "admittanced.ResponseSample.v4", size 1472, writer "admittanced (service thread)" {
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
        96 active_axes: u32 as {TaskAxis} ["1", "0 to 63"]
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
             at the TCP, task frame.";
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
        384 verdict_axis: u32 as TaskAxis ["1", "0 to 5"]
            "Task axis that the verdict speaks of, as in the command sample.";
        388 verdict_side: u32 as Side ["1", "a code of Side"]
            "Force limit that the verdict speaks of, as in the command sample.";
        392 believed_stiffness_n_m: f64 ["N/m", ">= 0"]
            "Stiffness along the normal as it is believed to be; out of contact what the next touch begins with. 0 before the \
             first cycle.";
        400 believed_stiffness_band_n_m: [f64; 2] ["N/m", ">= 0"]
            "Least and greatest stiffness that it may be, as in the record.";
        416 believed_normal: [f64; 3] ["1", "finite"]
            "Outward surface normal as it is believed to be, base frame, as in the record; 0 before the first cycle.";
        440 verdict_share: f64 ["1", "0 to 1"]
            "AtRisk: the share that cannot be kept, as in the command sample.";
        448 text: [u8; TEXT_LENGTH] ["UTF-8", "valid UTF-8 over text_length bytes, 0 after them"]
            "For a person: what was done, or why it was refused.";
    }
}

impl ResponseSample {
    /// Angle in rad between the believed surface normal and the one in force, as that of the record.
    pub fn believed_tilt_rad(&self) -> f64 {
        super::angle_between(&self.believed_normal, &self.surface_normal)
    }

    /// Sets the text, cut at a character boundary if it does not fit.
    pub fn set_text(&mut self, text: &str) {
        let mut length = text.len().min(TEXT_LENGTH);
        while !text.is_char_boundary(length) {
            length -= 1;
        }
        self.text = [0; TEXT_LENGTH];
        self.text[..length].copy_from_slice(&text.as_bytes()[..length]);
        self.text_length = length as u32;
    }

    /// The text. Bytes of a foreign writer that are not UTF-8 appear as U+FFFD; a length beyond the
    /// field is cut.
    pub fn text(&self) -> std::borrow::Cow<'_, str> {
        let length = (self.text_length as usize).min(TEXT_LENGTH);
        String::from_utf8_lossy(&self.text[..length])
    }
}
