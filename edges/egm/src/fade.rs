//! How a plan that nobody renews is played: ever slower, so that the speed has come to zero by the time the plan ends.

use ipc_types::CommandSample;

/// Which part of its speeds a command is played with at `at_ns`: 1 in the cycle that it was given for, which begins
/// `command_delay_ns` after its sample, and 1 − (t/T)² once t of the T have gone by for which its plan may be played. The first
/// cycles are nearly as planned, since a plan that leads out of a surface brakes in them; at the end nothing is left to
/// be cut off.
pub fn part(command: &CommandSample, command_delay_ns: u64, at_ns: u64) -> f64 {
    let acts_ns = command.state_stamp_ns.saturating_add(command_delay_ns);
    let whole = command.valid_until_ns.saturating_sub(acts_ns);
    let gone = at_ns.saturating_sub(acts_ns);
    if gone >= whole {
        return 0.0;
    }
    let gone = gone as f64 / whole as f64;
    1.0 - gone * gone
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Of a sample at 100 ms, which acts from 104 ms on for a cycle of 4 ms and three more.
    fn command() -> CommandSample {
        CommandSample { state_stamp_ns: 100 * MS, valid_until_ns: 120 * MS, ..CommandSample::zeroed() }
    }

    #[test]
    fn it_falls_from_cycle_to_cycle_and_ends_at_nothing() {
        let parts: Vec<f64> = (0..6).map(|cycle| part(&command(), 4 * MS, (104 + 4 * cycle) * MS)).collect();
        assert_eq!(parts, [1.0, 0.9375, 0.75, 0.4375, 0.0, 0.0]);
    }

    #[test]
    fn before_it_acts_it_is_whole_and_without_a_plan_there_is_nothing() {
        assert_eq!(part(&command(), 4 * MS, 90 * MS), 1.0);
        assert_eq!(part(&CommandSample::zeroed(), 4 * MS, 90 * MS), 0.0);
    }
}
