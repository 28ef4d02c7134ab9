//! What is looked for in every cycle of the daemon, by its records: each has the sample as the
//! daemon saw it, the answer, and the instant for which the law answered.

use admittance_runner::config::Config;
use ipc_types::services::{self, Access};
use ipc_types::{Fault, Instance, Mode, Motion, Node, RecordKind, RecordSample, StateSample, StopReason, Subscriber};

use super::arena::Findings;
use crate::answers::{Bounds, Sequence};

/// Tolerance of the instants, ns: none of it is the machine's, since the law is told its instant.
const TOLERANCE_NS: u64 = 10_000_000;

/// What makes a sample unusable, whatever came before it.
#[derive(Debug, Clone, Copy)]
struct Accepted {
    joints: usize,
    axes: usize,
    /// Age and future, ns.
    age: u64,
    ahead: u64,
    /// How long after the last usable sample the arm may still move without another, ns.
    bridge: u64,
}

impl Accepted {
    fn of(config: &Config) -> Self {
        let ns = |seconds: f64| (seconds * 1e9) as u64;
        let (control, cycle) = (&config.control, ns(config.control.sampling_time_s));
        let age = ns(control.max_sample_age_s);
        let plan = cycle * (u64::from(control.max_consecutive_fallbacks) + 1);
        let bridge = plan + ns(config.stopping.retreat_time_s) + age + 2 * cycle + TOLERANCE_NS;
        Self { joints: config.robot.joint.len(), axes: config.robot.task_axes as usize, age, ahead: 2 * cycle, bridge }
    }

    /// Why nobody may act on this sample at `now` (ns).
    fn refuses(&self, state: &StateSample, now: u64) -> Option<&'static str> {
        let is_finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let joints = [&state.joint_position, &state.joint_velocity, &state.joint_position_reference];
        match () {
            () if state.joint_count as usize != self.joints => Some("another joint count"),
            () if !joints.iter().all(|values| is_finite(&values[..self.joints])) => Some("joints that are not finite"),
            () if !is_finite(&state.twist_reference[..self.axes]) => Some("a twist that is not finite"),
            () if state.wrench_valid != 1 => Some("a wrench that is not valid"),
            () if !is_finite(&state.wrench[..self.axes]) => Some("a wrench that is not finite"),
            () if now > state.stamp_ns.saturating_add(self.age) => Some("an age above max_sample_age_s"),
            () if state.stamp_ns > now.saturating_add(self.ahead) => Some("a stamp from the future"),
            () => None,
        }
    }
}

/// Follows the records of a daemon.
pub(crate) struct Watch {
    records: Subscriber<RecordSample>,
    bounds: Bounds,
    judge: Judge,
    /// Records seen, and of them samples that were refused.
    pub(crate) seen: u64,
    pub(crate) refused: u64,
}

impl Watch {
    pub(crate) fn new(node: &Node, instance: &Instance, config: &Config, bounds: Bounds) -> Result<Self, String> {
        // After a kill the service may be gone until the next daemon comes.
        let service = services::record(node, instance, Access::OpenOrCreate).map_err(|error| error.to_string())?;
        let records = service.subscriber().map_err(|error| error.to_string())?;
        Ok(Self { records, bounds, judge: Judge::new(config), seen: 0, refused: 0 })
    }

    /// From now on this configuration may be in force, and a command what `bounds` allow. Arm and
    /// cycle stay as they are: a reload does not change them.
    pub(crate) fn allow(&mut self, config: &Config, bounds: Bounds) {
        let bridge = &mut self.judge.accepted.bridge;
        *bridge = (*bridge).max(Accepted::of(config).bridge);
        self.bounds = bounds;
    }

    /// Looks at all records that have come.
    pub(crate) fn look(&mut self, findings: &mut Findings) {
        while let Ok(Some(record)) = self.records.receive() {
            self.seen += 1;
            self.refused += u64::from(record.fault != Fault::NONE && record.kind == RecordKind::Sample.code());
            self.judge.see(&record, &self.bounds, findings);
        }
    }
}

/// What is known between records.
struct Judge {
    accepted: Accepted,
    commands: Sequence,
    /// When the law last had a sample that may be usable, ns; whether it was in control then, and no
    /// order has come since.
    usable: Option<u64>,
    controlled: bool,
}

impl Judge {
    fn new(config: &Config) -> Self {
        Self { accepted: Accepted::of(config), commands: Sequence::default(), usable: None, controlled: false }
    }

    fn see(&mut self, record: &RecordSample, bounds: &Bounds, findings: &mut Findings) {
        let command = &record.command;
        let is = |kind: RecordKind| record.kind == kind.code();
        if !(is(RecordKind::Sample) || is(RecordKind::Silence)) {
            self.controlled = false;
            return;
        }
        if record.boot_id != self.commands.boot_id {
            (self.usable, self.controlled) = (None, false);
        }
        // Before the first sample there is no command.
        if command.sequence == 0 {
            return;
        }
        let told = |what: String| format!("record {} of daemon {:#x}: {what}", record.sequence, record.boot_id);
        if let Some(why) = self.commands.check(record.boot_id, command.sequence) {
            findings.note(told(format!("command {why}")));
        }
        for (invariant, what) in bounds.flaws(command) {
            findings.note(told(format!("{invariant:?}: {what}")));
        }
        not_finite(record).into_iter().for_each(|field| findings.note(told(format!("{field} is not finite"))));
        self.usability(record, &told, findings);
    }

    /// A sample that nobody may act on is refused, and after a while without another the arm is
    /// held.
    fn usability(&mut self, record: &RecordSample, told: &dyn Fn(String) -> String, findings: &mut Findings) {
        let (command, now) = (&record.command, record.now_ns);
        let refused = match record.kind == RecordKind::Sample.code() {
            true => self.accepted.refuses(&record.state, now),
            false => Some("silence"),
        };
        let Some(why) = refused else {
            let in_control = [Mode::Free, Mode::Contact, Mode::Stopping, Mode::Stopped].map(Mode::code);
            (self.usable, self.controlled) = (Some(now), in_control.contains(&command.mode));
            return;
        };
        if record.fault == Fault::NONE {
            findings.note(told(format!("a sample was used that has {why}")));
        }
        let is_over = self.usable.is_some_and(|usable| now > usable + self.accepted.bridge);
        if is_over && self.controlled && command.motion != Motion::Hold.code() {
            let silence = now.saturating_sub(self.usable.unwrap_or(now)) as f64 * 1e-6;
            let reason = StopReason::from_code(command.stop_reason);
            findings.note(told(format!("not held after {silence:.0} ms without a usable sample ({why}, {reason:?})")));
        }
    }
}

/// Fields of a record that a reader relies on.
fn not_finite(record: &RecordSample) -> Vec<&'static str> {
    let fields: [(&str, &[f64]); 13] = [
        ("contact_point", &record.contact_point),
        ("wrench", &record.wrench),
        ("force_limit", &record.force_limit),
        ("wrench_bias", &record.wrench_bias),
        ("belief_uncertainty_n", std::slice::from_ref(&record.belief_uncertainty_n)),
        ("expected_pressing_n", std::slice::from_ref(&record.expected_pressing_n)),
        ("tool_acceleration", &record.tool_acceleration),
        ("joint_velocity", &record.joint_velocity),
        ("joint_acceleration", &record.joint_acceleration),
        ("wrench_without_lag", &record.wrench_without_lag),
        ("believed_stiffness_n_m", std::slice::from_ref(&record.believed_stiffness_n_m)),
        ("believed_stiffness_band_n_m", &record.believed_stiffness_band_n_m),
        ("believed_normal", &record.believed_normal),
    ];
    let is_bad = |values: &[f64]| values.iter().any(|value| !value.is_finite());
    fields.into_iter().filter(|(_, values)| is_bad(values)).map(|(field, _)| field).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use admittancectl::demo::CONTROLLERS;
    use ipc_types::CommandSample;

    const SECOND: u64 = 1_000_000_000;

    /// A usable sample at `now`, answered in Free.
    fn answered(now: u64, sequence: u64) -> RecordSample {
        let state = StateSample { joint_count: 2, wrench_valid: 1, stamp_ns: now, ..StateSample::zeroed() };
        let command = CommandSample {
            sequence,
            joint_count: 2,
            stamp_ns: now,
            mode: Mode::Free.code(),
            ..CommandSample::zeroed()
        };
        let kind = RecordKind::Sample.code();
        RecordSample { sequence, boot_id: 1, now_ns: now, kind, state, command, ..RecordSample::zeroed() }
    }

    fn seen(records: &[RecordSample]) -> Vec<String> {
        let config = super::super::arena::parsed(CONTROLLERS[3].config).expect("shipped");
        let (mut judge, mut findings) = (Judge::new(&config), Findings::default());
        let bounds = Bounds::of(&config);
        records.iter().for_each(|record| judge.see(record, &bounds, &mut findings));
        findings.0
    }

    #[test]
    fn who_moves_on_without_usable_samples_is_found() {
        let first = answered(SECOND, 1);
        let silent = |after: u64, motion: Motion| {
            let mut record = RecordSample { fault: Fault::Silence.code(), ..answered(SECOND + after, 2) };
            (record.kind, record.state) = (RecordKind::Silence.code(), StateSample::zeroed());
            record.command.motion = motion.code();
            record
        };
        assert_eq!(seen(&[first, silent(50_000_000, Motion::Offset)]), [""; 0], "the last plan, and a retreat");
        assert_eq!(seen(&[first, silent(SECOND, Motion::Hold)]), [""; 0]);
        let found = seen(&[first, silent(SECOND, Motion::Offset)]);
        assert!(found.len() == 1 && found[0].contains("not held after 1000 ms"), "{found:?}");
        // Whoever was not in control need not hold; nor is it known after an order.
        let mut idle = first;
        idle.command.mode = Mode::Idle.code();
        assert_eq!(seen(&[idle, silent(SECOND, Motion::Offset)]), [""; 0]);
        let order = RecordSample { kind: RecordKind::Stop.code(), ..first };
        assert_eq!(seen(&[first, order, silent(SECOND, Motion::Offset)]), [""; 0]);
    }

    #[test]
    fn a_sample_that_nobody_may_use_is_not_to_be_used() {
        type Spoil = fn(&mut StateSample);
        let spoilt: [(&str, Spoil); 7] = [
            ("another joint count", |state| state.joint_count = 3),
            ("joints", |state| state.joint_velocity[1] = f64::NAN),
            ("a twist", |state| state.twist_reference[0] = f64::INFINITY),
            ("a wrench that is not valid", |state| state.wrench_valid = 2),
            ("a wrench that is not finite", |state| state.wrench[1] = f64::NEG_INFINITY),
            ("an age", |state| state.stamp_ns -= 50_000_000),
            ("a stamp from the future", |state| state.stamp_ns += 50_000_000),
        ];
        for (why, spoil) in spoilt {
            let mut record = answered(SECOND, 1);
            spoil(&mut record.state);
            let found = seen(&[record]);
            assert!(found.len() == 1 && found[0].contains(why), "{why}: {found:?}");
            let refused = RecordSample { fault: Fault::NotFinite.code(), ..record };
            assert_eq!(seen(&[refused]), [""; 0], "{why}");
        }
        // What the arm does not have does not count.
        let mut record = answered(SECOND, 1);
        (record.state.joint_position[5], record.state.wrench[4]) = (f64::NAN, f64::NAN);
        assert_eq!(seen(&[record]), [""; 0]);
        let mut record = answered(SECOND, 1);
        record.joint_velocity[0] = f64::NAN;
        assert!(seen(&[record])[0].contains("joint_velocity is not finite"));
    }
}
