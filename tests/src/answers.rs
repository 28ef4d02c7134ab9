//! All that a daemon answered, cycle by cycle, as its records tell: whoever looks for the newest command sees one in several.

use std::time::Duration;

use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, IpcSettings, Node, RecordSample, Subscriber};

use crate::machine::was_away_within;

/// The commands of a daemon, in order.
pub struct Answers {
    /// Before the node, which goes last.
    records: Subscriber<RecordSample>,
    _node: Node,
    seen: Vec<CommandSample>,
}

/// How often a count of the daemon rose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rises {
    /// From one answer to the next, while a processor was away between their samples.
    pub away: u64,
    /// Otherwise.
    pub otherwise: u64,
}

impl Answers {
    /// Those of the daemon of this place, which is there already, from now on.
    ///
    /// # Panics
    /// When it is not.
    pub fn of(settings: &IpcSettings) -> Self {
        let node = settings.node("answers").expect("a node");
        let service = services::record(&node, &settings.instance, Access::Open).expect("the daemon made it");
        Self { records: service.subscriber().expect("a subscriber"), _node: node, seen: Vec::new() }
    }

    /// Takes what has come.
    pub fn collect(&mut self) {
        while let Ok(Some(record)) = self.records.receive() {
            let newest = self.seen.last().map_or(0, |command| command.sequence);
            // A record without an answer has the last one once more.
            if record.command.sequence > newest {
                self.seen.push(record.command);
            }
        }
    }

    /// Those up to this instant of CLOCK_MONOTONIC, ns.
    pub fn until(&self, until_ns: u64) -> &[CommandSample] {
        &self.seen[..self.seen.partition_point(|command| command.stamp_ns <= until_ns)]
    }

    /// How often a count rose up to an instant, and how much of that a processor excuses that was away for at least `least`
    /// in that very cycle. What the first answer has, and what is between two that are not neighbours, nothing excuses.
    pub fn rises(&self, count: impl Fn(&CommandSample) -> u64, until_ns: u64, least: Duration) -> Rises {
        let answers = self.until(until_ns);
        let mut rises = Rises { away: 0, otherwise: answers.first().map_or(0, &count) };
        for pair in answers.windows(2) {
            let [before, after] = pair else { continue };
            let rise = count(after) - count(before);
            let is_next = after.sequence == before.sequence + 1;
            if rise > 0 && is_next && was_away_within(before.state_stamp_ns, after.stamp_ns, least) {
                rises.away += rise;
            } else {
                rises.otherwise += rise;
            }
        }
        rises
    }

    /// Fails when a count rose for another reason than a processor that was away for at least `least`. Hardly a run on a shared
    /// machine has none of those.
    ///
    /// # Panics
    /// Then, with the `log`.
    pub fn assert_excused(
        &self,
        what: &str,
        count: impl Fn(&CommandSample) -> u64,
        until_ns: u64,
        least: Duration,
        log: &str,
    ) {
        let Rises { away, otherwise } = self.rises(count, until_ns, least);
        println!("{what}: {away} while a processor was away");
        assert_eq!(otherwise, 0, "{what}, beside {away} while a processor was away: {log}");
        assert!(away < 50, "of a run of which so much is missing nothing is known: {log}");
    }
}
