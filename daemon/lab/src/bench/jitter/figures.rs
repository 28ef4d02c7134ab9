//! Durations and their printed figures.

use comfy_table::{CellAlignment, Table, presets};
use hdrhistogram::Histogram;
use serde::Serialize;
use serde_json::{Value, json};

/// Longest duration that is resolved, ns; longer ones count as this.
const LONGEST: u64 = 60_000_000_000;

/// Durations of one kind, in ns, and how many of them took too long. Adding to it allocates
/// nothing.
#[derive(Debug, Clone)]
pub(crate) struct Durations {
    histogram: Histogram<u64>,
    missed: u64,
    endless: u64,
}

/// Percentiles of durations, µs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Percentiles {
    pub(crate) p50: f64,
    pub(crate) p99: f64,
    pub(crate) p999: f64,
    pub(crate) max: f64,
}

impl Durations {
    pub(crate) fn new() -> Self {
        let histogram = Histogram::new_with_bounds(1, LONGEST, 3).expect("bounds and digits that the crate accepts");
        Self { histogram, missed: 0, endless: 0 }
    }

    /// Adds a duration, and whether it was too long.
    pub(crate) fn add(&mut self, duration: u64, missed: bool) {
        self.histogram.saturating_record(duration);
        self.missed += u64::from(missed);
    }

    /// Adds one that never ended: too long, and in no percentile.
    pub(crate) fn add_endless(&mut self) {
        self.missed += 1;
        self.endless += 1;
    }

    pub(crate) fn append(&mut self, other: &Self) {
        // Both have the same bounds.
        let _ = self.histogram.add(&other.histogram);
        self.missed += other.missed;
        self.endless += other.endless;
    }

    /// How many ended.
    pub(crate) fn count(&self) -> u64 {
        self.histogram.len()
    }

    /// How many there were.
    pub(crate) fn total(&self) -> u64 {
        self.count() + self.endless
    }

    pub(crate) fn missed(&self) -> u64 {
        self.missed
    }

    /// How many in a million took too long.
    pub(crate) fn missed_per_million(&self) -> f64 {
        self.missed as f64 * 1e6 / self.total().max(1) as f64
    }

    /// NaN, which JSON has as null, without any duration.
    pub(crate) fn percentiles(&self) -> Percentiles {
        let at = |share: f64| {
            if self.count() == 0 { f64::NAN } else { self.histogram.value_at_quantile(share) as f64 * 1e-3 }
        };
        Percentiles { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: at(1.0) }
    }
}

impl Percentiles {
    fn over(&self, other: &Self) -> Self {
        Self {
            p50: self.p50 / other.p50,
            p99: self.p99 / other.p99,
            p999: self.p999 / other.p999,
            max: self.max / other.max,
        }
    }

    pub(crate) fn cells(&self) -> [String; 4] {
        [self.p50, self.p99, self.p999, self.max].map(|value| format!("{value:.1}"))
    }
}

/// The parts of a cycle in contact.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    /// From the sample received to the command sent.
    pub(crate) compute: Durations,
    /// From the sample visible to the command sent, without the solver's time.
    pub(crate) shell: Durations,
}

/// Everything measured.
#[derive(Debug, Clone)]
pub(crate) struct Figures {
    pub(crate) rate_hz: u32,
    pub(crate) budget_us: f64,
    pub(crate) load: bool,
    pub(crate) has_fifo: bool,
    pub(crate) reference: Durations,
    pub(crate) cycle: Durations,
    pub(crate) parts: Parts,
    /// Of one processor, at 1 kHz with wait = "event".
    pub(crate) free_motion_cpu_percent: f64,
    /// Round trips through one cache line of bare shared memory, with the bytes of the samples, and
    /// through iceoryx2.
    pub(crate) ping_pong: Durations,
    pub(crate) ping_pong_of_samples: Durations,
    pub(crate) spinning: Durations,
    /// Wake-up lateness according to cyclictest, or why it could not be measured.
    pub(crate) cyclictest: Result<Percentiles, String>,
}

impl Figures {
    pub(crate) fn json(&self) -> Value {
        let (reference, cycle) = (self.reference.percentiles(), self.cycle.percentiles());
        let (ping_pong, spinning) = (self.ping_pong.percentiles(), self.spinning.percentiles());
        let of_samples = self.ping_pong_of_samples.percentiles();
        json!({
            "rate_hz": self.rate_hz,
            "cycles": self.cycle.total(),
            "missed": self.cycle.missed(),
            "reference_missed": self.reference.missed(),
            "reference_us": reference,
            "cycle_us": cycle,
            "ratio": cycle.over(&reference),
            "missed_per_million": self.cycle.missed_per_million(),
            "reference_missed_per_million": self.reference.missed_per_million(),
            "reference_cycles": self.reference.total(),
            "budget_us": self.budget_us,
            "load": self.load,
            "fifo": self.has_fifo,
            "shell_us": self.parts.shell.percentiles(),
            "contact_cycle_us": self.parts.compute.percentiles(),
            "free_motion_cpu_percent": self.free_motion_cpu_percent,
            "ping_pong_us": ping_pong,
            "ping_pong_of_samples_us": of_samples,
            "spinning_round_trip_us": spinning,
            "spinning_over_ping_pong": spinning.p50 / ping_pong.p50,
            "spinning_over_ping_pong_of_samples": spinning.p50 / of_samples.p50,
            "cyclictest_us": self.cyclictest.as_ref().ok(),
        })
    }

    pub(crate) fn table(&self) -> String {
        let (reference, cycle) = (self.reference.percentiles(), self.cycle.percentiles());
        let (ping_pong, spinning) = (self.ping_pong.percentiles(), self.spinning.percentiles());
        let of_samples = self.ping_pong_of_samples.percentiles();
        let compute = self.parts.compute.percentiles();
        let shell = self.parts.shell.percentiles();
        let mut table = Table::new();
        table.load_style(presets::ASCII_MARKDOWN);
        table.set_header(["us", "p50", "p99", "p99.9", "max", "goal"]);
        let mut row = |name: &str, cells: [String; 4], goal: &str| {
            table.add_row([&[name.to_owned()], &cells[..], &[goal.to_owned()]].concat());
        };
        row("reference loop, wake-up", reference.cells(), "");
        if let Ok(cyclictest) = &self.cyclictest {
            row("cyclictest, wake-up", cyclictest.cells(), "");
        }
        row("plant, daemon, plant", cycle.cells(), "");
        row("ratio", cycle.over(&reference).cells(), "");
        row("sample visible to command sent, less solver", shell.cells(), "p99 15");
        row("contact cycle, received to sent", compute.cells(), "p50 10, p99 25");
        row("ping-pong in shared memory, one cache line", ping_pong.cells(), "");
        row("ping-pong in shared memory, bytes of the samples", of_samples.cells(), "");
        row("iceoryx2 round trip, spinning", spinning.cells(), "");
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let cyclictest = match &self.cyclictest {
            Ok(_) => String::new(),
            Err(why) => format!("cyclictest: {why}\n"),
        };
        format!(
            "{} Hz, {} cycles, budget {:.0} us{}{}\n{table}\n\
             missed per million: {:.0}, reference {:.0} (goal at 4000 Hz: at most the reference's plus 10)\n\
             spinning round trip over ping-pong, medians: {:.2} with the samples' bytes (goal 2.5), {:.2} with one cache line\n\
             free motion at 1000 Hz with wait = \"event\": {:.2} % of a processor (goal 3)\n{cyclictest}",
            self.rate_hz,
            self.cycle.total(),
            self.budget_us,
            if self.load { ", under load" } else { "" },
            if self.has_fifo { "" } else { ", WITHOUT SCHED_FIFO" },
            self.cycle.missed_per_million(),
            self.reference.missed_per_million(),
            spinning.p50 / of_samples.p50,
            spinning.p50 / ping_pong.p50,
            self.free_motion_cpu_percent,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn durations(range: std::ops::Range<u64>) -> Durations {
        let mut durations = Durations::new();
        range.for_each(|us| durations.add(us * 1000, us >= 990));
        durations
    }

    fn figures(cycle: Durations) -> Figures {
        Figures {
            rate_hz: 1000,
            budget_us: 250.0,
            load: false,
            has_fifo: true,
            reference: durations(0..1000),
            cycle,
            parts: Parts { compute: durations(0..10), shell: durations(0..10) },
            free_motion_cpu_percent: 1.0,
            ping_pong: durations(0..3),
            ping_pong_of_samples: durations(0..4),
            spinning: durations(0..5),
            cyclictest: Err("not installed".to_owned()),
        }
    }

    #[test]
    fn json_has_the_agreed_keys() {
        let json = figures(durations(0..2000)).json();
        for key in ["rate_hz", "cycles", "missed", "reference_missed"] {
            assert!(json[key].is_u64(), "{key}: {}", json[key]);
        }
        for key in ["reference_us", "cycle_us", "ratio"] {
            for percentile in ["p50", "p99", "p999", "max"] {
                assert!(json[key][percentile].is_number(), "{key}.{percentile}: {}", json[key][percentile]);
            }
        }
        assert_eq!(
            (&json["cycles"], &json["missed"], &json["reference_missed"]),
            (&2000.into(), &1010.into(), &10.into())
        );
        assert!((json["ratio"]["p50"].as_f64().expect("a number") - 2.0).abs() < 0.01);
    }

    #[test]
    fn what_never_ended_is_missed_and_in_no_percentile() {
        let mut cycle = durations(0..999);
        cycle.add_endless();
        let mut twice = cycle.clone();
        twice.append(&cycle);
        assert_eq!((cycle.count(), cycle.total(), cycle.missed()), (999, 1000, 10));
        assert_eq!((twice.count(), twice.total(), twice.missed()), (1998, 2000, 20));
        assert!((twice.missed_per_million() - 10_000.0).abs() < 1e-9);
        assert!(twice.percentiles().max < 1000.0);
    }

    #[test]
    fn nothing_measured_is_no_number_and_no_panic() {
        let figures = figures(Durations::new());
        assert!(figures.json()["cycle_us"]["p50"].is_null());
        assert!(figures.table().contains("cyclictest: not installed"));
    }
}
