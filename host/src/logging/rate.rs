//! How many lines of one kind are logged: some at once, then one per second; the others are
//! counted, and their number told ("12 more like this").
//!
//! Lines are of one kind that come from the same place in the code and differ in digits alone.

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::fmt::Debug;
use std::hash::{Hash, Hasher};
use std::sync::{LazyLock, Mutex, PoisonError};

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::layer::{Context, Filter};

use crate::clock::monotonic_ns;

/// Lines of one kind that may come at once.
const BURST: u64 = 20;
/// Time in ns after which one more may come.
const REFILL_NS: u64 = 1_000_000_000;
/// Least time in ns between two lines that tell how many were withheld.
const TELL_NS: u64 = 5_000_000_000;
/// Kinds that are told apart. Beyond them lines are of the same kind that come from the same place.
const KINDS: usize = 256;
/// Target of the lines about lines, which are not counted themselves.
const TARGET: &str = "admittanced::more_like_this";

/// Withholds what is too much.
pub(super) struct RateLimit;

impl<S: Subscriber> Filter<S> for RateLimit {
    fn enabled(&self, _: &Metadata<'_>, _: &Context<'_, S>) -> bool {
        true
    }

    fn event_enabled(&self, event: &Event<'_>, _: &Context<'_, S>) -> bool {
        if event.metadata().target() == TARGET {
            return true;
        }
        let mut message = Message(String::new());
        event.record(&mut message);
        let place = event.metadata();
        let place = (place.callsite(), *place.level());
        with_kinds(|kinds| kinds.take(monotonic_ns(), hash(&place.0), place.1, message.0))
    }
}

/// Logs how many lines were withheld of each kind, where it is time to. A program that goes on
/// calls it now and then.
pub fn tell_withheld() {
    tell(with_kinds(|kinds| kinds.told(monotonic_ns(), TELL_NS)));
}

/// Logs how many lines were withheld of each kind, before a program ends.
pub fn tell_all_withheld() {
    tell(with_kinds(|kinds| kinds.told(monotonic_ns(), 0)));
}

fn tell(withheld: Vec<Withheld>) {
    for Withheld { level, count, last } in withheld {
        if level == Level::ERROR {
            tracing::error!(target: TARGET, count, "{count} more like this: {last}");
        } else if level == Level::WARN {
            tracing::warn!(target: TARGET, count, "{count} more like this: {last}");
        } else {
            tracing::info!(target: TARGET, count, "{count} more like this: {last}");
        }
    }
}

fn with_kinds<T>(act: impl FnOnce(&mut Kinds) -> T) -> T {
    static SEEN: LazyLock<Mutex<Kinds>> = LazyLock::new(Mutex::default);
    act(&mut SEEN.lock().unwrap_or_else(PoisonError::into_inner))
}

/// The text of an event.
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// What is told of lines that were withheld.
#[derive(Debug, PartialEq)]
struct Withheld {
    level: Level,
    count: u64,
    /// The last of them.
    last: String,
}

/// One kind of line.
#[derive(Debug)]
struct Kind {
    /// Lines that may come now.
    left: u64,
    /// Since when `left` has grown, ns.
    since: u64,
    /// When lines that were withheld were last told, or the first came that is to be, ns.
    told: u64,
    withheld: Withheld,
}

/// All kinds that have come lately.
#[derive(Debug, Default)]
struct Kinds(HashMap<u64, Kind>);

impl Kinds {
    /// Whether a line is logged that comes `now` (ns) from `place`.
    fn take(&mut self, now: u64, place: u64, level: Level, message: String) -> bool {
        let key = self.key(now, place, &message);
        let fresh =
            || Kind { left: BURST, since: now, told: now, withheld: Withheld { level, count: 0, last: String::new() } };
        let kind = self.0.entry(key).or_insert_with(fresh);
        kind.refill(now);
        if kind.left > 0 {
            kind.left -= 1;
            return true;
        }
        if kind.withheld.count == 0 && now.saturating_sub(kind.told) >= TELL_NS {
            kind.told = now;
        }
        kind.withheld.count += 1;
        kind.withheld.last = message;
        false
    }

    fn key(&mut self, now: u64, place: u64, message: &str) -> u64 {
        let words: String = message.chars().filter(|character| !character.is_ascii_digit()).collect();
        let key = hash(&(place, words));
        if self.0.len() >= KINDS && !self.0.contains_key(&key) {
            self.0.retain(|_, kind| kind.withheld.count > 0 || !kind.is_rested(now));
            if self.0.len() >= KINDS {
                return place;
            }
        }
        key
    }

    /// What is to be told `now` (ns), `least` ns after the last time; it is told once.
    fn told(&mut self, now: u64, least: u64) -> Vec<Withheld> {
        let due = |kind: &&mut Kind| kind.withheld.count > 0 && now.saturating_sub(kind.told) >= least;
        let tell = |kind: &mut Kind| {
            kind.told = now;
            let fresh = Withheld { level: kind.withheld.level, count: 0, last: String::new() };
            std::mem::replace(&mut kind.withheld, fresh)
        };
        self.0.values_mut().filter(due).map(tell).collect()
    }
}

impl Kind {
    fn refill(&mut self, now: u64) {
        let grown = now.saturating_sub(self.since) / REFILL_NS;
        self.left = self.left.saturating_add(grown).min(BURST);
        self.since += grown * REFILL_NS;
    }

    /// Whether nothing has come for so long that it might be forgotten.
    fn is_rested(&self, now: u64) -> bool {
        now.saturating_sub(self.since) / REFILL_NS + self.left >= BURST
    }
}

fn hash(value: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    /// How many of `lines` that come in a second from `now` on are logged.
    fn logged(kinds: &mut Kinds, now: u64, lines: u64, text: impl Fn(u64) -> String) -> usize {
        let come = |line: &u64| kinds.take(now + line * SECOND / lines, 1, Level::WARN, text(*line));
        (0..lines).filter(come).count()
    }

    #[test]
    fn many_lines_of_one_kind_are_counted_and_others_come_through() {
        let mut kinds = Kinds::default();
        let flood = |line: u64| format!("request {line} refused");
        assert_eq!(logged(&mut kinds, 0, 1000, flood), BURST as usize);
        assert!(kinds.take(SECOND / 2, 1, Level::INFO, "another thing".to_owned()));
        assert!(kinds.take(SECOND / 2, 2, Level::INFO, flood(0)), "the same from another place");
        assert_eq!(logged(&mut kinds, SECOND, 1000, flood), 1);
        assert_eq!(kinds.told(2 * SECOND, TELL_NS), []);
        let told = kinds.told(10 * SECOND, TELL_NS);
        let expected = Withheld { level: Level::WARN, count: 2000 - BURST - 1, last: flood(999) };
        assert_eq!((told, kinds.told(20 * SECOND, 0)), (vec![expected], vec![]));
        assert_eq!(logged(&mut kinds, 60 * SECOND, 1000, flood), BURST as usize, "after a pause");
    }

    #[test]
    fn as_many_kinds_as_somebody_invents_are_bounded() {
        let mut kinds = Kinds::default();
        let word = |line: u64| "x".repeat(line as usize);
        let first = logged(&mut kinds, 0, 2000, word);
        assert!(kinds.0.len() <= KINDS + 1, "{}", kinds.0.len());
        assert!(first <= KINDS + BURST as usize, "{first}");
        let later = logged(&mut kinds, 3600 * SECOND, 2000, |line| word(line + 10_000));
        assert!(later > BURST as usize, "what has rested makes room: {later}");
    }
}
