//! All that a daemon answered, cycle by cycle, as its records tell: whoever looks for the newest command sees one in several.

use std::time::Duration;

use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, IpcSettings, Node, RecordSample, Subscriber};

use crate::machine::was_away_within;

/// Up to this time (ns) before an instant there may be no answer.
const UNSEEN_NS: u64 = 50_000_000;

/// The commands of a daemon, in order.
pub struct Answers {
    /// Before the node, which goes last.
    records: Subscriber<RecordSample>,
    _node: Node,
    seen: Vec<CommandSample>,
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

    /// Fails when a count rose up to an instant (ns) but for what a processor excuses that was away for at least `least` in that very
    /// cycle: hardly a run on a shared machine has none of that. What the first answer has, and what is between two that are
    /// not neighbours, nothing excuses.
    ///
    /// # Panics
    /// Then, with the `log`, and where the answers do not reach up to the instant.
    pub fn assert_excused(
        &self,
        what: &str,
        count: impl Fn(&CommandSample) -> u64,
        until_ns: u64,
        least: Duration,
        log: &str,
    ) {
        let answers = self.until(until_ns);
        let newest_ns = answers.last().map_or(0, |command| command.stamp_ns);
        assert!(newest_ns + UNSEEN_NS > until_ns, "{what}: nothing is known of the last {} ns", until_ns - newest_ns);
        let (mut away, mut otherwise) = (0, answers.first().map_or(0, &count));
        for pair in answers.windows(2) {
            let [before, after] = pair else { continue };
            let rise = count(after) - count(before);
            let is_next = after.sequence == before.sequence + 1;
            let is_excused = is_next && was_away_within(before.state_stamp_ns, after.stamp_ns, least);
            *(if is_excused { &mut away } else { &mut otherwise }) += rise;
        }
        println!("{what}: {away} while a processor was away, of {} answers", answers.len());
        assert_eq!(otherwise, 0, "{what}, beside {away} while a processor was away: {log}");
        assert!(away < 50, "of a run of which so much is missing nothing is known: {log}");
    }
}
