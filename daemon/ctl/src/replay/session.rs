//! The law over recorded events.

use std::collections::BTreeMap;

use admittance_core::quantities::Instant;
use admittance_host::config;
use admittance_runner::config::{Config, WrenchSourceName};
use admittance_runner::cycle::{self, Cycle, Memory};
use admittance_runner::settings::Settings;
use ipc_types::layout::WireType as _;
use ipc_types::{CommandSample, Fault, Mode, RecordKind, RecordSample, Source, StopReason};

use super::counts::{Counts, Earlier};
use super::defaults::Defaults;
use super::difference::Difference;
use super::event;
use crate::Exit;

/// Cycles in a row in free motion, without an offset, after which a fresh controller is where the
/// recorded one is: it remembers 104 samples and 16 commands.
pub(super) const RUN_IN: u64 = 128;

/// Where the replay stands.
enum State {
    /// Looking for a place to begin.
    Searching,
    /// A fresh controller follows the records until it is where the recorded one was; so many
    /// cycles so far.
    RunningIn(Box<dyn Cycle>, u64),
    /// Every answer is compared.
    Comparing(Box<dyn Cycle>),
    /// Nothing after this can be compared.
    Over,
}

/// A replay.
pub(crate) struct Session<'a> {
    config: Config,
    configurations: &'a BTreeMap<u64, String>,
    record_version: u32,
    state: State,
    /// The last answer of the replay.
    command: CommandSample,
    /// By how much the recorded counters were ahead when comparing began.
    ahead: Option<Counts>,
    /// What earlier versions counted besides, since then.
    earlier: Earlier,
    last: Option<(u64, u64)>,
    first: Option<Instant>,
    compared: u64,
    remarks: Vec<String>,
}

impl<'a> Session<'a> {
    /// A replay that begins with this configuration; those of later records replace it.
    /// Fields that records of `record_version` lack are not compared; keys that later ones lack mean
    /// what they did then.
    pub(crate) fn new(
        config: Config,
        configurations: &'a BTreeMap<u64, String>,
        record_version: u32,
    ) -> Result<Self, (Exit, String)> {
        cycle::build(&config).map_err(|why| (Exit::Config, why))?;
        Ok(Self {
            config,
            configurations,
            record_version,
            state: State::Searching,
            command: CommandSample::zeroed(),
            ahead: None,
            earlier: Earlier::default(),
            last: None,
            first: None,
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
        Instant::from_nanoseconds(record.now_ns).since(self.first.unwrap_or_default()).seconds()
    }

    /// Replays a record; what differs, if something does.
    pub(crate) fn take(&mut self, record: &RecordSample) -> Result<Option<Difference>, (Exit, String)> {
        self.first.get_or_insert(Instant::from_nanoseconds(record.now_ns));
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
                // A fresh controller is compared at once.
                if matches!(self.state, State::Comparing(_)) { self.compare(record, kind) } else { Ok(None) }
            }
            State::RunningIn(mut cycle, done) => {
                if is_free(record, kind) {
                    event::replay(&mut *cycle, record, kind, &mut self.command);
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

    /// Checks whether the replay can begin with this record.
    fn search(&mut self, record: &RecordSample, kind: RecordKind) -> Result<(), (Exit, String)> {
        self.state = State::Searching;
        // Before the first command no sample was answered, and silences leave nothing behind but a
        // count.
        let is_first = matches!(kind, RecordKind::Sample | RecordKind::Silence) && record.command.sequence <= 1;
        if record.sequence == 1 || is_first {
            // An order of this very record comes after the start; one that was before the recording
            // is in force.
            let mut config = self.config.clone();
            if record.sequence != 1 {
                settings(record)?.apply(&mut config);
                config.control.start_enabled = record.enabled == 1;
            }
            let cycle = cycle::build(&config).map_err(|why| (Exit::Config, why))?;
            self.begin(cycle, record, "the controller was fresh");
        } else if is_free(record, kind)
            && !remembers_surface(record, &self.config)
            && self.config.wrench.source == WrenchSourceName::Sample
            && !self.config.redundancy.is_told()
        {
            // An observer of torques forgets too slowly to be run in, and what joints do beside the task changes
            // as slowly as it is configured to.
            // What requests have changed since the file was read is in every record, and free
            // motion was enabled.
            settings(record)?.apply(&mut self.config);
            let mut config = self.config.clone();
            config.control.start_enabled = true;
            let memory = Memory::recorded(record);
            let mut cycle = cycle::build_remembering(&config, &memory).map_err(|why| (Exit::Config, why))?;
            event::replay(&mut *cycle, record, kind, &mut self.command);
            self.state = State::RunningIn(cycle, 1);
        }
        Ok(())
    }

    fn begin(&mut self, cycle: Box<dyn Cycle>, record: &RecordSample, why: &str) {
        self.remarks.push(format!(
            "compared from record {} on ({:.3} s): {why}",
            record.sequence,
            self.seconds(record)
        ));
        (self.ahead, self.earlier, self.state) = (None, Earlier::after(record), State::Comparing(cycle));
    }

    fn compare(&mut self, record: &RecordSample, kind: RecordKind) -> Result<Option<Difference>, (Exit, String)> {
        let State::Comparing(mut cycle) = std::mem::replace(&mut self.state, State::Over) else { return Ok(None) };
        if kind == RecordKind::Stop && StopReason::from_code(record.stop_order).and_then(cycle::ending).is_none() {
            return Err((
                Exit::DataError,
                format!("record {}: {} is not the reason of any order", record.sequence, record.stop_order),
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
        let mut replayed = event::replay(&mut *cycle, record, kind, &mut self.command);
        self.earlier.count(&replayed, kind);
        event::copy_missing(self.record_version, &mut replayed, record);
        if self.record_version < 4 {
            replayed.command.rejected_count += self.earlier.silences;
        }
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
            if is_first { Counts::NONE } else { Counts::of(record).zip(Counts::of(&replayed), u64::wrapping_sub) }
        });
        Counts::of(&replayed).zip(ahead, u64::wrapping_add).write(&mut replayed);
        if record.command.missed_count == replayed.command.missed_count.wrapping_add(self.earlier.refused) {
            replayed.command.missed_count = record.command.missed_count;
        }
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
            Defaults::of(self.record_version).complete(&mut self.config);
        }
        settings(record)?.apply(&mut self.config);
        Ok(true)
    }
}

/// The values that requests may change, as they are in force after a record.
fn settings(record: &RecordSample) -> Result<Settings, (Exit, String)> {
    let unknown = || format!("record {} is under the unknown law {}", record.sequence, record.law);
    Settings::read(record).ok_or_else(|| (Exit::DataError, unknown()))
}

/// Whether more is known of a surface than was told, which is remembered for a second after a contact: of
/// that a record has only what is likeliest.
fn remembers_surface(record: &RecordSample, config: &Config) -> bool {
    let range = config.environment.stiffness_range_n_m;
    range.is_some_and(|range| range[0] < range[1] && record.believed_stiffness_band_n_m != range)
        || record.believed_tilt_rad() > 0.0
}

/// Whether a record is a plain cycle in free motion, without an offset on its way to zero.
fn is_free(record: &RecordSample, kind: RecordKind) -> bool {
    let command = &record.command;
    [Source::None, Source::Damping].map(Source::code).contains(&command.source)
        && kind == RecordKind::Sample
        && command.mode == Mode::Free.code()
        && command.active_axes == 0
        && command.stop_reason == StopReason::NONE
        && record.fault == Fault::NONE
}

#[cfg(test)]
mod tests;
