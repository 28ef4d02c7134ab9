//! The lateness of any program on this machine: a loop that sleeps until each instant, and does
//! nothing.

use admittance_host::clock::{monotonic_ns, sleep_until_ns};

use super::figures::Durations;
use super::{DAEMON_CPU, Plan, on_processor};

/// Lateness of each wake-up over one turn, on the daemon's processor.
pub(crate) fn run(plan: Plan, durations: &mut Durations) {
    let instants = (plan.turn_s * 1e9) as u64 / plan.period;
    let lateness = on_processor(DAEMON_CPU, move || {
        let mut lateness = Durations::new();
        let mut instant = monotonic_ns() + plan.period;
        for _ in 0..instants {
            sleep_until_ns(instant);
            let late = monotonic_ns().saturating_sub(instant);
            lateness.add(late, late > plan.budget);
            instant += plan.period;
        }
        lateness
    });
    durations.append(&lateness);
}
