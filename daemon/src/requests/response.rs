//! The response to a request: what was done, and the daemon's state at that moment.

use admittance_host::clock::monotonic_ns;
use ipc_types::{ActiveRequest, RecordSample, ResponseSample, ResponseStatus};

use crate::channel::CycleRecord;
use crate::service_thread::ServiceThread;
use admittance_runner::settings::Settings;

impl ServiceThread {
    pub(super) fn respond(&mut self, request: ActiveRequest, status: ResponseStatus, text: &str) {
        // What an order has changed is in the last record.
        self.read_records();
        let response = self.response(request.id, status, text);
        if let Err(error) = request.send_copy(response) {
            tracing::warn!("a client did not take its response: {error:?}");
        }
    }

    fn response(&self, id: u64, status: ResponseStatus, text: &str) -> ResponseSample {
        let mut response = ResponseSample { id, status: status.code(), ..ResponseSample::zeroed() };
        response.uptime_ns = monotonic_ns().saturating_sub(self.started);
        response.cycles = self.diagnostics.cycles();
        response.joint_count = self.config.robot.joint.len() as u32;
        let settings = Settings::of(&self.config);
        response.law = settings.law.law().code();
        response.enabled = u32::from(self.enabled);
        response.force_limit = settings.force_limit;
        response.wrench_bias = settings.bias;
        response.normal_stiffness_n_m = settings.normal_stiffness;
        response.surface_normal = settings.surface_normal;
        if let Some(CycleRecord { sample, .. }) = &self.last {
            let last = &sample.command;
            response.state_sequence = last.state_sequence;
            response.command_sequence = last.sequence;
            response.fallback_count = last.fallback_count;
            response.late_count = last.late_count;
            response.missed_count = last.missed_count;
            response.rejected_count = last.rejected_count;
            response.compute_time_ns = last.compute_time_ns;
            response.mode = last.mode;
            response.motion = last.motion;
            response.stop_reason = last.stop_reason;
            response.active_axes = last.active_axes;
            response.verdict = last.verdict;
            response.verdict_axis = last.verdict_axis;
            response.verdict_side = last.verdict_side;
            response.verdict_margin = last.verdict_margin;
            response.verdict_time_s = last.verdict_time_s;
            response.wrench = self.diagnostics.wrench();
            response.velocity_offset = last.velocity_offset;
            response.contact_point = sample.contact_point;
            let told = self.config.environment.stiffness_range_n_m;
            response.believed_stiffness_n_m = likeliest_stiffness(sample, told, settings.normal_stiffness);
            response.believed_stiffness_band_n_m = sample.believed_stiffness_band_n_m;
            response.believed_normal = sample.believed_normal;
        }
        response.set_text(text);
        response
    }
}

/// The likeliest stiffness in N/m after a record, where a range of it is `told`, and `told_stiffness`
/// in it. While f̂ fades after a contact the law supposes the softest surface of the range, and keeps it
/// until the next touch: nobody believes in that one. What is believed then is what was learned, as
/// long as it is remembered, the band being about it, and after that what was told.
fn likeliest_stiffness(record: &RecordSample, told: Option<[f64; 2]>, told_stiffness: f64) -> f64 {
    let (band, stiffness) = (record.believed_stiffness_band_n_m, record.believed_stiffness_n_m);
    let [least, most] = band;
    match told {
        _ if record.command.active_axes != 0 || least >= most => stiffness,
        Some(told) if band == told => told_stiffness,
        Some([softest, hardest]) if softest <= least && most <= hardest => 0.5 * (least + most),
        // Harder than any that was told: it was learned as it is.
        Some(_) | None => stiffness,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_contact_the_stiffness_is_not_the_softest_of_the_range() {
        let told = [1e4, 5e5];
        let shown = |active_axes, stiffness, band, told| {
            let mut record = RecordSample::default();
            (record.believed_stiffness_n_m, record.believed_stiffness_band_n_m) = (stiffness, band);
            record.command.active_axes = active_axes;
            likeliest_stiffness(&record, told, 8e4)
        };
        assert_eq!(shown(0, 1e4, told, Some(told)), 8e4, "forgotten: what was told");
        assert_eq!(shown(0, 1e4, [0.9e5, 1.1e5], Some(told)), 1e5, "remembered for a second");
        assert_eq!(shown(2, 1e4, told, Some(told)), 1e4, "in contact: what the law goes by");
        assert_eq!(shown(0, 2e6, [1e4, 5e7], Some(told)), 2e6, "harder than told");
        assert_eq!(shown(0, 1e5, [1e5; 2], None), 1e5, "no range");
    }
}
