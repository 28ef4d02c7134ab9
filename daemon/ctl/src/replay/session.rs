//! The law over recorded events.

use std::collections::BTreeMap;

use admittance_host::config;
use admittanced::config::Config;
use admittanced::cycle::{self, Cycle, CycleReport};
use admittanced::settings::Settings;
use ipc_types::layout::WireType as _;
use ipc_types::{CommandSample, Fault, Mode, RecordKind, RecordSample, Source, StopReason};

use super::difference::Difference;
use crate::Exit;

/// Cycles in a row in free motion, without an offset, after which a fresh controller is where the recorded one is: it remembers
/// 64 samples and 16 commands.
pub(super) const RUN_IN: u64 = 128;

/// Where the replay stands.
enum State {
    /// Looking for a place to begin.
    Searching,
    /// A fresh controller follows the records until it is where the recorded one was; so many cycles so far.
    RunningIn(Box<dyn Cycle + Send>, u64),
    /// Every answer is compared.
    Comparing(Box<dyn Cycle + Send>),
    /// Nothing after this can be compared.
    Over,
}

/// A replay.
pub(crate) struct Session<'a> {
    config: Config,
    configurations: &'a BTreeMap<u64, String>,
    state: State,
    /// The last answer of the replay.
    command: CommandSample,
    /// What the recorded counters were ahead when the comparing began.
    ahead: Option<Counts>,
    last: Option<(u64, u64)>,
    first_ns: Option<u64>,
    compared: u64,
    remarks: Vec<String>,
}

/// Running counts of a record, which a fresh controller begins at zero.
#[derive(Clone, Copy)]
struct Counts([u64; 5]);

impl Counts {
    fn of(record: &RecordSample) -> Self {
        let command = &record.command;
        let counts = [command.fallback_count, command.missed_count, command.rejected_count];
        Self([counts[0], counts[1], counts[2], record.limited_count, record.contact_losses])
    }

    fn zip(self, other: Self, with: fn(u64, u64) -> u64) -> Self {
        Self(std::array::from_fn(|index| with(self.0[index], other.0[index])))
    }

    fn write(self, record: &mut RecordSample) {
        let command = &mut record.command;
        [
            command.fallback_count,
            command.missed_count,
            command.rejected_count,
            record.limited_count,
            record.contact_losses,
        ] = self.0;
    }
}

impl<'a> Session<'a> {
    /// A replay that begins with this configuration; those of later records replace it.
    pub(crate) fn new(config: Config, configurations: &'a BTreeMap<u64, String>) -> Result<Self, (Exit, String)> {
        cycle::build(&config).map_err(|why| (Exit::Config, why))?;
        Ok(Self {
            config,
            configurations,
            state: State::Searching,
            command: CommandSample::zeroed(),
            ahead: None,
            last: None,
            first_ns: None,
            compared: 0,
            remarks: Vec::new(),
        })
    }

    /// Cycles compared so far, all of them bit-identical.
    pub(crate) fn compared(&self) -> u64 {
        self.compared
    }

    /// Where comparing began and was interrupted.
    pub(crate) fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Time of a record after the first in s.
    pub(crate) fn seconds(&self, record: &RecordSample) -> f64 {
        record.now_ns.saturating_sub(self.first_ns.unwrap_or(record.now_ns)) as f64 * 1e-9
    }

    /// Replays a record; what differs, if something does.
    pub(crate) fn take(&mut self, record: &RecordSample) -> Result<Option<Difference>, (Exit, String)> {
        self.first_ns.get_or_insert(record.now_ns);
        let follows = self.last == Some((record.boot_id, record.sequence.wrapping_sub(1)));
        if !follows && self.last.is_some() && !matches!(self.state, State::Over) {
            let restarted = self.last.is_some_and(|(boot_id, _)| boot_id != record.boot_id);
            let what = if restarted { "restart of the daemon" } else { "gap" };
            self.remarks.push(format!(
                "{what} before record {} ({:.3} s): the replay begins anew after it",
                record.sequence,
                self.seconds(record)
            ));
            self.state = State::Searching;
        }
        self.last = Some((record.boot_id, record.sequence));
        let Some(kind) = RecordKind::from_code(record.kind) else {
            return Err((
                Exit::DataError,
                format!("record {} is of the unknown kind {}", record.sequence, record.kind),
            ));
        };
        let is_handed_over = [RecordKind::Replaced, RecordKind::Adjusted].contains(&kind) && record.done == 1;
        if is_handed_over && !matches!(self.state, State::Over) && !self.adopt(record, kind)? {
            self.state = State::Over;
        }
        match std::mem::replace(&mut self.state, State::Over) {
            State::Over => Ok(None),
            State::Searching => {
                self.search(record, kind)?;
                // A controller that nothing has happened to yet: compared at once.
                if matches!(self.state, State::Comparing(_)) { self.compare(record, kind) } else { Ok(None) }
            }
            State::RunningIn(mut cycle, done) => {
                if is_free(record, kind) {
                    self.event(&mut *cycle, record, kind);
                    let done = done + 1;
                    if done < RUN_IN {
                        self.state = State::RunningIn(cycle, done);
                    } else {
                        self.begin(
                            cycle,
                            record,
                            &format!("the controller's state is known after {RUN_IN} cycles in free motion"),
                        );
                    }
                } else {
                    self.state = State::Searching;
                }
                Ok(None)
            }
            comparing => {
                self.state = comparing;
                self.compare(record, kind)
            }
        }
    }

    /// Looks whether the replay can begin with this record.
    fn search(&mut self, record: &RecordSample, kind: RecordKind) -> Result<(), (Exit, String)> {
        self.state = State::Searching;
        // Before the first command no sample was answered, and silences leave nothing behind but a count.
        let is_first = matches!(kind, RecordKind::Sample | RecordKind::Silence) && record.command.sequence <= 1;
        if record.sequence == 1 || is_first {
            // An order of this very record comes after the start; one that was before the recording is in force.
            let mut config = self.config.clone();
            if record.sequence != 1 {
                settings(record)?.apply(&mut config);
                config.control.start_enabled = record.enabled == 1;
            }
            let cycle = cycle::build(&config).map_err(|why| (Exit::Config, why))?;
            self.begin(cycle, record, "the controller was fresh");
        } else if is_free(record, kind) {
            // What requests have changed since the file was read is in every record, and free motion was enabled.
            settings(record)?.apply(&mut self.config);
            let mut config = self.config.clone();
            config.control.start_enabled = true;
            let mut cycle = cycle::build(&config).map_err(|why| (Exit::Config, why))?;
            cycle.assume_contact_point(record.contact_point);
            self.event(&mut *cycle, record, kind);
            self.state = State::RunningIn(cycle, 1);
        }
        Ok(())
    }

    fn begin(&mut self, cycle: Box<dyn Cycle + Send>, record: &RecordSample, why: &str) {
        self.remarks.push(format!(
            "compared from record {} on ({:.3} s): {why}",
            record.sequence,
            self.seconds(record)
        ));
        (self.ahead, self.state) = (None, State::Comparing(cycle));
    }

    /// Lets the law have the event again. What the law determines of the record.
    fn event(&mut self, cycle: &mut dyn Cycle, record: &RecordSample, kind: RecordKind) -> RecordSample {
        let mut replayed = *record;
        let mut report = CycleReport::default();
        match kind {
            RecordKind::Sample => {
                let mut asked = 0;
                let mut expired = || {
                    asked += 1;
                    record.expired_at > 0 && asked >= record.expired_at
                };
                report = cycle.answer(&record.state, record.now_ns, &mut expired, &mut self.command);
            }
            RecordKind::Silence => report = cycle.silence(record.now_ns, &mut self.command),
            RecordKind::Reset => replayed.done = u32::from(cycle.reset(record.forced == 1).is_ok()),
            RecordKind::Stop => {
                if let Some(reason) = cycle::ordered_reason(record.stop_order) {
                    cycle.request_stop(reason);
                }
            }
            RecordKind::Enable => replayed.done = u32::from(cycle.enable().is_ok()),
            RecordKind::Replaced | RecordKind::Adjusted => {}
        }
        let counters = cycle.counters();
        replayed.limited_count = counters.limited;
        replayed.contact_losses = counters.contacts_lost;
        replayed.iterations = report.iterations;
        replayed.limited = u32::from(report.limited);
        replayed.fault = report.fault_code().code();
        replayed.contact_point = cycle.contact_point();
        replayed.wrench = report.wrench;
        replayed.enabled = u32::from(cycle.is_enabled());
        cycle.settings().write(&mut replayed);
        let shell = &record.command;
        replayed.command = CommandSample {
            sequence: shell.sequence,
            stamp_ns: shell.stamp_ns,
            boot_id: shell.boot_id,
            compute_time_ns: shell.compute_time_ns,
            late_count: shell.late_count,
            ..self.command
        };
        replayed
    }

    fn compare(&mut self, record: &RecordSample, kind: RecordKind) -> Result<Option<Difference>, (Exit, String)> {
        let State::Comparing(mut cycle) = std::mem::replace(&mut self.state, State::Over) else { return Ok(None) };
        if kind == RecordKind::Stop && cycle::ordered_reason(record.stop_order).is_none() {
            return Err((
                Exit::DataError,
                format!("record {}: {} is no reason of an order", record.sequence, record.stop_order),
            ));
        }
        if [RecordKind::Replaced, RecordKind::Adjusted].contains(&kind) && record.done == 1 {
            let mut new = cycle::build(&self.config).map_err(|why| (Exit::Config, why))?;
            if !new.take_over(&*cycle) {
                return Err((
                    Exit::Config,
                    format!("record {}: the new configuration is for another arm", record.sequence),
                ));
            }
            cycle = new;
        }
        let mut replayed = self.event(&mut *cycle, record, kind);
        self.state = State::Comparing(cycle);
        // Before the first sample, and for an order, there is no answer.
        let is_cycle = matches!(kind, RecordKind::Sample | RecordKind::Silence);
        if !is_cycle || record.command.state_sequence == 0 {
            let orders = [("done", record.done, replayed.done), ("enabled", record.enabled, replayed.enabled)];
            let differs = orders.into_iter().find(|(_, recorded, replayed)| recorded != replayed);
            return Ok(differs.map(|(field, recorded, replayed)| Difference::of(field, recorded, replayed)));
        }
        let ahead = *self.ahead.get_or_insert_with(|| {
            let is_first = record.sequence == 1;
            if is_first { Counts([0; 5]) } else { Counts::of(record).zip(Counts::of(&replayed), u64::wrapping_sub) }
        });
        Counts::of(&replayed).zip(ahead, u64::wrapping_add).write(&mut replayed);
        if record.same_bits(&replayed) {
            self.compared += 1;
            return Ok(None);
        }
        Ok(Some(Difference::between(&record.to_json(), &replayed.to_json())))
    }

    /// Takes over the configuration that holds from this record on; false when it was not recorded.
    fn adopt(&mut self, record: &RecordSample, kind: RecordKind) -> Result<bool, (Exit, String)> {
        if kind == RecordKind::Replaced {
            let Some(text) = self.configurations.get(&record.sequence) else {
                self.remarks.push(format!(
                    "record {} ({:.3} s): the daemon took a new configuration that is not in the recording: nothing after it is compared",
                    record.sequence,
                    self.seconds(record)
                ));
                return Ok(false);
            };
            let name = format!("the configuration recorded with record {}", record.sequence);
            self.config = config::parse(text, &name).map_err(|error| (Exit::Config, error.to_string()))?;
        }
        settings(record)?.apply(&mut self.config);
        Ok(true)
    }
}

/// What requests may change, as it is in force after a record.
fn settings(record: &RecordSample) -> Result<Settings, (Exit, String)> {
    let unknown = || format!("record {} is under the unknown law {}", record.sequence, record.law);
    Settings::read(record).ok_or_else(|| (Exit::DataError, unknown()))
}

/// Whether a record is a plain cycle in free motion, without an offset on its way to zero.
fn is_free(record: &RecordSample, kind: RecordKind) -> bool {
    let command = &record.command;
    [Source::None, Source::Damping].map(Source::code).contains(&command.source)
        && kind == RecordKind::Sample
        && command.mode == Mode::Free.code()
        && command.active_axes == 0
        && command.stop_reason == StopReason::None.code()
        && record.fault == Fault::None.code()
}

#[cfg(test)]
mod tests {
    use plant_sim::run::VirtualRun;
    use plant_sim::scenario::Scenario;

    use super::*;

    const CONFIG: &str = include_str!("../../../../deploy/demo/mpc-default.toml");
    const SCENARIO: &str = include_str!("../../../../plant-sim/scenarios/paper.toml");

    fn config() -> Config {
        config::parse(CONFIG, "mpc-default.toml").expect("valid")
    }

    /// What a daemon would record of the paper's contact in virtual time. Its time is up as `is_over` says of a record's
    /// sequence and of how often the law has asked.
    fn records(is_over: fn(u64, u64) -> bool) -> Vec<RecordSample> {
        let scenario: Scenario = config::parse(SCENARIO, "paper.toml").expect("valid");
        let mut plant = VirtualRun::new(&scenario).expect("the scenario can be set up");
        let mut cycle = cycle::build(&config()).expect("a known arm");
        let mut command = CommandSample { boot_id: 7, ..CommandSample::zeroed() };
        let mut records = Vec::new();
        while !plant.is_finished() {
            let state = *plant.sample().expect("no faults in this scenario");
            let sequence = records.len() as u64 + 1;
            let (mut asked, mut expired_at) = (0, 0);
            let mut expired = || {
                asked += 1;
                if is_over(sequence, asked) && expired_at == 0 {
                    expired_at = asked;
                }
                is_over(sequence, asked)
            };
            let report = cycle.answer(&state, state.stamp_ns + 5, &mut expired, &mut command);
            command.sequence = sequence;
            plant.advance(Some(&command)).expect("the plant accepts it");
            let (limited_count, contact_losses) = (cycle.counters().limited, cycle.counters().contacts_lost);
            records.push(RecordSample {
                sequence,
                now_ns: state.stamp_ns + 5,
                boot_id: 7,
                expired_at,
                limited_count,
                contact_losses,
                kind: RecordKind::Sample.code(),
                iterations: report.iterations,
                fault: report.fault_code().code(),
                limited: u32::from(report.limited),
                contact_point: cycle.contact_point(),
                wrench: report.wrench,
                enabled: u32::from(cycle.is_enabled()),
                state,
                command,
                ..RecordSample::zeroed()
            });
            if let Some(record) = records.last_mut() {
                cycle.settings().write(record);
            }
        }
        records
    }

    /// Replays records until one differs; the sequence of that one, and how many were compared.
    fn replay(records: &[RecordSample]) -> (Option<u64>, u64) {
        let configurations = BTreeMap::new();
        let mut session = Session::new(config(), &configurations).expect("a known arm");
        for record in records {
            if session.take(record).expect("sound records").is_some() {
                return (Some(record.sequence), session.compared());
            }
        }
        (None, session.compared())
    }

    #[test]
    fn a_time_that_was_up_is_up_again_at_the_same_question() {
        // In every third cycle at the first question, else at the second.
        let mut records = records(|sequence, asked| asked >= if sequence.is_multiple_of(3) { 1 } else { 2 });
        let count = records.len() as u64;
        let expired: Vec<usize> = (0..records.len()).filter(|index| records[*index].expired_at > 0).collect();
        for question in 1..=2 {
            assert!(
                expired.iter().any(|index| records[*index].expired_at == question),
                "a cycle of {question} questions"
            );
        }
        assert_eq!(replay(&records), (None, count));
        let first = expired[0];
        records[first].expired_at = 0;
        assert_eq!(replay(&records), (Some(records[first].sequence), first as u64));
    }

    #[test]
    fn one_bit_is_found_wherever_it_is() {
        let records = records(|_, _| false);
        let touched = records.iter().position(|record| record.command.active_axes != 0).expect("a contact");
        let alterations: [fn(&mut RecordSample); 5] = [
            |record| {
                record.command.velocity_offset[1] = f64::from_bits(record.command.velocity_offset[1].to_bits() ^ 1)
            },
            |record| record.command.planned_offset[31][5] = -0.0,
            |record| record.command.valid_until_ns += 1,
            |record| record.command.rejected_count += 1,
            |record| record.iterations += 1,
        ];
        for alter in alterations {
            let mut records = records.clone();
            alter(&mut records[touched + 3]);
            assert_eq!(replay(&records), (Some(touched as u64 + 4), touched as u64 + 3));
        }
        // A sample that is another leads to another answer.
        let mut records = records;
        records[touched + 3].state.wrench[1] -= 1.0;
        assert_eq!(replay(&records).0, Some(touched as u64 + 4));
    }

    #[test]
    fn after_a_gap_the_replay_begins_anew_in_free_motion() {
        let records = records(|_, _| false);
        let touched = records.iter().position(|record| record.command.active_axes != 0).expect("a contact");
        let begin = touched - RUN_IN as usize - 10;
        let compared = |records: &[RecordSample]| replay(records);
        // As a recording that begins late.
        assert_eq!(compared(&records[begin..]), (None, (records.len() - begin) as u64 - RUN_IN));
        // A gap before the run-in, and one within it.
        let gap = [&records[..50], &records[begin..]].concat();
        assert_eq!(compared(&gap), (None, 50 + (records.len() - begin) as u64 - RUN_IN));
        let late_gap = [&records[..begin + 20], &records[begin + 21..]].concat();
        assert_eq!(compared(&late_gap), (None, (begin + 20) as u64), "too few cycles are left to find the state from");
        assert_eq!(compared(&records[touched..]), (None, 0));
    }
}
