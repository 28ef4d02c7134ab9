//! cyclictest of rt-tests, if it is installed: the same wake-up as the reference loop's, measured
//! independently.

use std::process::Command;

use super::figures::{Durations, Percentiles};
use super::{DAEMON_CPU, PRIORITY, Plan};

/// Histogram in µs: what takes longer is only counted.
const LONGEST_US: u64 = 20_000;

/// Wake-up lateness over one turn, or why it could not be measured.
pub(crate) fn run(plan: Plan) -> Result<Percentiles, String> {
    let mut command = Command::new("cyclictest");
    command.args(["--quiet", "--mlockall", "--threads=1"]);
    command.arg(format!("--affinity={DAEMON_CPU}")).arg(format!("--priority={PRIORITY}"));
    command.arg(format!("--interval={}", plan.period / 1000)).arg(format!("--histogram={LONGEST_US}"));
    command.arg(format!("--duration={}", plan.turn_s.ceil()));
    let output = match command.output() {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err("not installed (Debian: apt install rt-tests)".to_owned());
        }
        Err(error) => return Err(error.to_string()),
    };
    let text = String::from_utf8_lossy(&output.stdout);
    match histogram(&text) {
        Some(durations) if output.status.success() => Ok(durations.percentiles()),
        _ => Err(format!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim())),
    }
}

/// Reads lines of microseconds and counts; the maximum comes from the summary, since the histogram
/// ends before.
fn histogram(text: &str) -> Option<Durations> {
    let mut durations = Durations::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut fields = line.split_whitespace();
        let (Some(us), Some(count)) = (fields.next(), fields.next()) else { continue };
        let (us, count): (u64, u64) = (us.parse().ok()?, count.parse().ok()?);
        (0..count).for_each(|_| durations.add(us * 1000, false));
    }
    let summary = |key: &str| {
        let value = text.lines().find_map(|line| line.strip_prefix(key))?;
        value.split_whitespace().next()?.parse::<u64>().ok()
    };
    for _ in 0..summary("# Histogram Overflows:").unwrap_or(0) {
        durations.add(summary("# Max Latencies:")? * 1000, false);
    }
    (durations.count() > 0).then_some(durations)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_output_is_read() {
        let text = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000005 000098\n000007 000001\n\
            # Total: 000000099\n# Min Latencies: 00005\n# Max Latencies: 31000\n# Histogram Overflows: 00001\n";
        let percentiles = histogram(text).expect("a histogram").percentiles();
        assert!((percentiles.p50 - 5.0).abs() < 0.1 && (percentiles.p99 - 7.0).abs() < 0.1, "{percentiles:?}");
        assert!((percentiles.max - 31_000.0).abs() < 31.0, "{percentiles:?}");
        assert!(histogram("").is_none());
    }
}
