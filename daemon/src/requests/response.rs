//! The response to a request: what was done, and the daemon's state at that moment.

use admittance_host::clock::monotonic_ns;
use ipc_types::{ActiveRequest, ResponseSample, ResponseStatus};

use crate::channel::CycleRecord;
use crate::likeliest_stiffness::likeliest_stiffness;
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
            response.verdict_share = last.verdict_share;
            response.wrench = self.diagnostics.wrench();
            response.velocity_offset = last.velocity_offset;
            response.contact_point = sample.contact_point;
            let told = self.config.environment.stiffness_range_n_m;
            response.believed_stiffness_n_m = likeliest_stiffness(sample, told);
            response.believed_stiffness_band_n_m = sample.believed_stiffness_band_n_m;
            response.believed_normal = sample.believed_normal;
        }
        response.set_text(text);
        response
    }
}
