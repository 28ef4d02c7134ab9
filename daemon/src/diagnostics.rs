//! How the daemon is doing: counters and latencies over all cycles and over the last second,
//! published a few times a second.

use admittance_host::clock::monotonic_ns;
use hdrhistogram::Histogram;
use ipc_types::services::{self, Access};
use ipc_types::{
    DiagnosticsSample, Fault, Instance, Mode, Node, Publisher, QUANTILES, RecordKind, RecordSample, Source, TASK_AXES,
};

use crate::channel::CycleRecord;
use crate::likeliest_stiffness::likeliest_stiffness;
use admittance_runner::config::Config;

/// Between two samples in ns.
const INTERVAL_NS: u64 = 200_000_000;
const SECOND_NS: u64 = 1_000_000_000;
/// Longest time in ns that a histogram resolves; longer ones count as this.
const LONGEST_NS: u64 = 60 * SECOND_NS;
/// Significant decimal digits of a histogram.
const DIGITS: u8 = 3;

/// One latency, over all cycles and by the second.
#[derive(Debug)]
struct Latency {
    all: Histogram<u64>,
    second: Histogram<u64>,
    last_second: [u64; QUANTILES],
}

impl Latency {
    fn new() -> Result<Self, String> {
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).map_err(|error| error.to_string());
        Ok(Self { all: histogram()?, second: histogram()?, last_second: [0; QUANTILES] })
    }

    fn add(&mut self, value_ns: u64) {
        self.all.saturating_record(value_ns);
        self.second.saturating_record(value_ns);
    }

    fn end_second(&mut self) {
        self.last_second = quantiles(&self.second);
        self.second.reset();
    }
}

/// p50, p99, p99.9 and the maximum; 0 without values.
fn quantiles(histogram: &Histogram<u64>) -> [u64; QUANTILES] {
    if histogram.is_empty() {
        return [0; QUANTILES];
    }
    [
        histogram.value_at_quantile(0.5),
        histogram.value_at_quantile(0.99),
        histogram.value_at_quantile(0.999),
        histogram.max(),
    ]
}

/// Collects figures of all cycles, and publishes them.
pub(crate) struct Diagnostics {
    publisher: Publisher<DiagnosticsSample>,
    sample: DiagnosticsSample,
    /// The range of stiffness that is told, N/m.
    stiffness_range: Option<[f64; 2]>,
    wake_up: Latency,
    compute: Latency,
    answer: Latency,
    started: u64,
    second_since: u64,
    cycles_this_second: u64,
    published_at: u64,
}

impl Diagnostics {
    /// Opens the service. `started` is the start of the daemon in ns.
    pub(crate) fn open(node: &Node, instance: &Instance, config: &Config, started: u64) -> Result<Self, String> {
        let service = services::diagnostics(node, instance, Access::OpenOrCreate).map_err(|error| error.to_string())?;
        let mut diagnostics = Self {
            publisher: service.publisher().map_err(|error| error.to_string())?,
            sample: DiagnosticsSample::zeroed(),
            stiffness_range: None,
            wake_up: Latency::new()?,
            compute: Latency::new()?,
            answer: Latency::new()?,
            started,
            second_since: started,
            cycles_this_second: 0,
            published_at: 0,
        };
        diagnostics.configure(config);
        Ok(diagnostics)
    }

    /// Takes over the limits and the range of stiffness of a configuration.
    pub(crate) fn configure(&mut self, config: &Config) {
        let contact = &config.contact;
        let of_controlled = |values: &[f64]| -> [f64; TASK_AXES] {
            let value = |axis: usize| values.get(axis).copied().unwrap_or(0.0);
            let is_controlled = |axis: usize| contact.admittance_axes.get(axis) == Some(&true);
            std::array::from_fn(|axis| if is_controlled(axis) { value(axis) } else { 0.0 })
        };
        self.sample.force_limit = of_controlled(&contact.force_limit);
        self.sample.minimum_force = of_controlled(&contact.minimum_force);
        self.sample.task_axes = config.robot.task_axes;
        self.stiffness_range = config.environment.stiffness_range_n_m;
    }

    /// Learns the daemon's boot id.
    pub(crate) fn heard_of(&mut self, boot_id: u64) {
        self.sample.boot_id = boot_id;
    }

    /// State samples answered.
    pub(crate) fn cycles(&self) -> u64 {
        self.sample.cycles
    }

    /// Wrench of the last accepted state sample in N and N m.
    pub(crate) fn wrench(&self) -> [f64; TASK_AXES] {
        self.sample.wrench
    }

    /// Takes a cycle in. A silence is none, nor is a sample that cannot be answered.
    pub(crate) fn cycle(&mut self, CycleRecord { sample: record, report }: &CycleRecord) {
        let command = &record.command;
        if record.kind != RecordKind::Sample.code() || command.state_sequence == 0 {
            return;
        }
        self.sample.cycles += 1;
        self.cycles_this_second += 1;
        if record.fault != Fault::NONE {
            return;
        }
        // Only the stamp of an accepted sample is reliable.
        self.wake_up.add(record.wake_up_latency_ns);
        self.compute.add(record.compute_time_ns);
        self.answer.add(record.answer_time_ns);
        self.sample.wrench = record.wrench;
        self.sample.state_stamp_ns = record.state.stamp_ns;
        self.sample.believed_stiffness_n_m = likeliest_stiffness(record, self.stiffness_range);
        self.sample.believed_stiffness_band_n_m = record.believed_stiffness_band_n_m;
        self.sample.believed_tilt_rad = record.believed_tilt_rad();
        self.sample.missed_lately = report.arrival.map_or(0, |arrival| arrival.missed_lately.into());
        let controls = [Mode::Contact, Mode::Stopping].map(Mode::code).contains(&command.mode);
        let stands_in = [Source::Plan, Source::Retreat].map(Source::code).contains(&command.source);
        self.sample.solver_failures += u64::from(controls && stands_in && record.expired_at == 0);
    }

    /// Publishes, if it is time.
    pub(crate) fn publish(&mut self, last: Option<&RecordSample>, dropped: u64) {
        let now = monotonic_ns();
        if now.saturating_sub(self.second_since) >= SECOND_NS {
            self.second_since = now;
            self.sample.cycles_last_second = std::mem::take(&mut self.cycles_this_second);
            [&mut self.wake_up, &mut self.compute, &mut self.answer].into_iter().for_each(Latency::end_second);
        }
        if now.saturating_sub(self.published_at) < INTERVAL_NS {
            return;
        }
        self.published_at = now;
        let sample = &mut self.sample;
        sample.sequence += 1;
        sample.stamp_ns = now;
        sample.uptime_ns = now.saturating_sub(self.started);
        sample.dropped_count = dropped;
        if let Some(record) = last {
            let command = &record.command;
            sample.limited_count = record.limited_count;
            sample.contact_losses = record.contact_losses;
            sample.exceeded_count = record.exceeded_count;
            sample.fallback_count = command.fallback_count;
            sample.late_count = command.late_count;
            sample.missed_count = command.missed_count;
            sample.rejected_count = command.rejected_count;
            sample.mode = command.mode;
            sample.motion = command.motion;
            sample.stop_reason = command.stop_reason;
            sample.active_axes = command.active_axes;
            sample.verdict = command.verdict;
            sample.verdict_axis = command.verdict_axis;
            sample.verdict_side = command.verdict_side;
            sample.verdict_margin = command.verdict_margin;
            sample.verdict_time_s = command.verdict_time_s;
            sample.verdict_share = command.verdict_share;
            sample.velocity_offset = command.velocity_offset;
        }
        (sample.wake_up_ns, sample.wake_up_last_second_ns) = (quantiles(&self.wake_up.all), self.wake_up.last_second);
        (sample.compute_ns, sample.compute_last_second_ns) = (quantiles(&self.compute.all), self.compute.last_second);
        (sample.answer_ns, sample.answer_last_second_ns) = (quantiles(&self.answer.all), self.answer.last_second);
        // No subscriber is no failure.
        let _ = self.publisher.send_copy(*sample);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_values() {
        let mut latency = Latency::new().expect("the bounds are valid");
        assert_eq!(quantiles(&latency.all), [0; QUANTILES]);
        (1..=1000).for_each(|us| latency.add(us * 1_000));
        latency.end_second();
        // Three digits of each value are kept.
        for (found, exact) in latency.last_second.iter().zip([500_000_u64, 990_000, 999_000, 1_000_000]) {
            assert!(found.abs_diff(exact) * 1000 <= exact, "{found} is not {exact}");
        }
        latency.add(2_000_000);
        latency.end_second();
        assert!(latency.last_second.iter().all(|value| value.abs_diff(2_000_000) <= 2_000));
        assert!(quantiles(&latency.all)[0] < 510_000, "all cycles count");
        latency.add(u64::MAX);
        assert!(quantiles(&latency.all)[3] >= LONGEST_NS, "a value beyond the range counts as the longest");
    }
}
