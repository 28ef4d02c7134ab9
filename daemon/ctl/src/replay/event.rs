//! One recorded event, given to the law again.

use admittance_core::quantities::Instant;
use admittance_runner::cycle::{self, Cycle, CycleReport};
use ipc_types::{CommandSample, RecordKind, RecordSample, StopReason};

/// Gives the law the event of a record; `command` is its last answer, and becomes its next. Returns
/// the part of the record that the law determines.
pub(super) fn replay(
    cycle: &mut dyn Cycle,
    record: &RecordSample,
    kind: RecordKind,
    command: &mut CommandSample,
) -> RecordSample {
    let mut replayed = *record;
    let mut report = CycleReport::default();
    let now = Instant::from_nanoseconds(record.now_ns);
    match kind {
        RecordKind::Sample => {
            let mut asked = 0;
            let mut expired = || {
                asked += 1;
                record.expired_at > 0 && asked >= record.expired_at
            };
            report = cycle.answer(&record.state, now, &mut expired, command);
        }
        RecordKind::Silence => report = cycle.silence(now, command),
        RecordKind::Reset => replayed.done = u32::from(cycle.reset(record.forced == 1).is_ok()),
        RecordKind::Stop => {
            if let Some(ending) = StopReason::from_code(record.stop_order).and_then(cycle::ending) {
                cycle.end(ending);
            }
        }
        RecordKind::Enable => replayed.done = u32::from(cycle.enable().is_ok()),
        RecordKind::Replaced | RecordKind::Adjusted => {}
    }
    report.write(&mut replayed);
    cycle.write(&mut replayed);
    let shell = &record.command;
    replayed.command = CommandSample {
        sequence: shell.sequence,
        stamp_ns: shell.stamp_ns,
        boot_id: shell.boot_id,
        compute_time_ns: shell.compute_time_ns,
        late_count: shell.late_count,
        ..*command
    };
    replayed
}

/// Copies the fields that a record of this version lacks, so that they are not compared.
pub(super) fn copy_missing(version: u32, replayed: &mut RecordSample, record: &RecordSample) {
    if version < 2 {
        replayed.belief_uncertainty_n = record.belief_uncertainty_n;
        replayed.expected_pressing_n = record.expected_pressing_n;
        replayed.expected_spring_n = record.expected_spring_n;
        replayed.expected_stamp_ns = record.expected_stamp_ns;
    }
    if version < 3 {
        replayed.tool_acceleration = record.tool_acceleration;
        replayed.joint_velocity = record.joint_velocity;
        replayed.joint_acceleration = record.joint_acceleration;
        replayed.exceeded_count = record.exceeded_count;
        replayed.wrench_without_lag = record.wrench_without_lag;
    }
    if version < 5 {
        replayed.believed_stiffness_n_m = record.believed_stiffness_n_m;
        replayed.believed_stiffness_band_n_m = record.believed_stiffness_band_n_m;
    }
    if version < 6 {
        replayed.believed_normal = record.believed_normal;
    }
    if version < 7 {
        replayed.wrench_deviation = record.wrench_deviation;
    }
    if version < 8 {
        replayed.command.verdict_share = record.command.verdict_share;
    }
}
