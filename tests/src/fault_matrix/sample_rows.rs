//! Rows about the state samples: what plant-sim spoils on its way to the daemon.

use ipc_types::StopReason;
use plant_sim::faults::FaultKind;

use super::row::{
    CONTACT, Counter, Expectation, FREE, Force, Injection, Key, Robot, Row, Step, idle, stopped, stopping,
};
use super::{by_daemon, row};

/// Samples that don't reach the law: for `max_consecutive_fallbacks` cycles the last plan bridges
/// them, then the arm stops.
fn refused(name: &'static str, fault: &'static str, kind: FaultKind, reason: StopReason, log: &str) -> Row {
    let stop = format!("Stopped: {}", reason.name());
    Row {
        fault,
        injection: Injection::Scripted(kind),
        ..row(
            name,
            Expectation {
                robot: Robot::PlaysPlan,
                command: vec![FREE, stopped(reason)],
                counted: vec![Counter::Rejected],
                log: by_daemon(&[log, &stop]),
                recovery: vec![Step::FaultEnds, Step::Stand, Step::Reset],
                ..Expectation::undisturbed(FREE)
            },
            Expectation {
                robot: Robot::Retreats,
                command: vec![CONTACT, stopping(reason), stopped(reason)],
                counted: vec![Counter::Rejected, Counter::Fallback],
                log: by_daemon(&[log, &stop]),
                force: Force::PlanThenHold,
                recovery: vec![Step::FaultEnds, Step::Retreat, Step::Reset],
                ..Expectation::undisturbed(CONTACT)
            },
        )
    }
}

/// Of a controller that leaves it to the daemon how a twist moves its joints.
const FOLLOWING: [Key; 1] = [("controller", "{ follows = \"joint_velocity\" }")];

/// The same where the motion controller can't take the answers either: they name a sample that it
/// did not make, or are valid no longer.
fn refused_unanswered(name: &'static str, fault: &'static str, kind: FaultKind, reason: StopReason, log: &str) -> Row {
    let mut row = refused(name, fault, kind, reason, log);
    row.contact.robot = Robot::PlaysPlan;
    row
}

/// What is said in the log, and changes nothing.
fn noticed(name: &'static str, fault: &'static str, kind: FaultKind, daemon: &'static [Key], log: &str) -> Row {
    let expected = |said| Expectation { log: by_daemon(&[log]), ..Expectation::undisturbed(said) };
    Row { fault, injection: Injection::Scripted(kind), daemon, ..row(name, expected(FREE), expected(CONTACT)) }
}

/// A value of a field that is not finite.
fn not_finite(name: &'static str, fault: &'static str, kind: FaultKind, field: &str) -> Row {
    refused(name, fault, kind, StopReason::SampleInvalid, &format!("{field}[1] is not finite"))
}

pub(super) fn rows() -> Vec<Row> {
    use FaultKind as Kind;
    use StopReason::{DrivesDisabled, JointCount, SampleInvalid, SampleStale, SamplesMissed};
    let mut rows = vec![
        refused_unanswered(
            "sample_stale",
            "State samples carry stamps that are a second old.",
            Kind::Stale,
            SampleStale,
            "older than max_sample_age_s",
        ),
        refused_unanswered(
            "sample_repeated",
            "The motion controller publishes the same sample again and again.",
            Kind::Freeze,
            SampleStale,
            "does not follow the last accepted sample",
        ),
        refused_unanswered(
            "sample_out_of_order",
            "The sequence of the state samples counts down.",
            Kind::OutOfOrder,
            SampleInvalid,
            "does not follow the last accepted sample",
        ),
        refused_unanswered(
            "sample_from_future",
            "State samples are stamped a second ahead.",
            Kind::FromFuture,
            SampleInvalid,
            "ahead of CLOCK_MONOTONIC",
        ),
        Row {
            fault: "The motion controller pauses for 5 ms in each cycle for a while; no sample is lost.",
            injection: Injection::Scripted(Kind::Overrun),
            ..row("controller_pauses", Expectation::undisturbed(FREE), Expectation::undisturbed(CONTACT))
        },
        Row {
            fault: "The motion controller publishes nothing for a while.",
            injection: Injection::Scripted(Kind::Drop),
            ..row(
                "samples_missing",
                Expectation {
                    robot: Robot::PlaysPlan,
                    command: vec![FREE, idle(SampleStale)],
                    counted: vec![Counter::Missed],
                    log: by_daemon(&["Idle: SampleStale, no sample for longer than max_sample_age_s"]),
                    recovery: vec![Step::FaultEnds],
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::Retreats,
                    command: vec![CONTACT, stopping(SampleStale), stopped(SampleStale)],
                    counted: vec![Counter::Missed, Counter::Fallback],
                    log: by_daemon(&["Stopped: SampleStale, no sample for longer than max_sample_age_s"]),
                    force: Force::PlanThenHold,
                    recovery: vec![Step::FaultEnds, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
        Row {
            fault: "Of thirteen state samples the daemon sees one.",
            injection: Injection::Scripted(Kind::Sparse),
            daemon: &[("control.max_sample_age_s", "0.06")],
            ..row(
                "samples_sparse",
                Expectation {
                    robot: Robot::PlaysPlan,
                    command: vec![FREE, idle(SamplesMissed)],
                    counted: vec![Counter::Missed],
                    log: by_daemon(&[
                        "state samples missed: what the law acted on became up to 52.0 ms old",
                        "Idle: SamplesMissed, 12 state samples before this one were missed, 36 of the last 100",
                    ]),
                    recovery: vec![Step::FaultEnds],
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::ComesToRest,
                    command: vec![CONTACT, stopping(SamplesMissed), stopped(SamplesMissed)],
                    counted: vec![Counter::Missed],
                    log: by_daemon(&[
                        "state samples missed: what the law acted on became up to 52.0 ms old",
                        "Stopped: SamplesMissed",
                    ]),
                    force: Force::Limit,
                    recovery: vec![Step::FaultEnds, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
        noticed(
            "samples_unnotified",
            "The motion controller forgets to notify the daemon, which waits for nothing else: it looks for samples that \
             are due.",
            Kind::Unnotified,
            &[("control.wait", "\"event\"")],
            "the motion controller must notify state-arrival after each sample",
        ),
        noticed(
            "sequence_jump",
            "The sequence of the state samples jumps ahead by a million.",
            Kind::SequenceJump,
            &[],
            "sequence jumped by 1000000 to ",
        ),
        {
            let expected = |said| Expectation {
                counted: vec![Counter::Rejected],
                log: by_daemon(&["does not follow the last accepted sample"]),
                ..Expectation::undisturbed(said)
            };
            Row {
                fault: "The stamp of one state sample is a cycle late; the next is on schedule, and so has the same stamp.",
                injection: Injection::Scripted(Kind::LateStamp),
                ..row("stamp_late", expected(FREE), expected(CONTACT))
            }
        },
        refused(
            "sequence_unnumbered",
            "The motion controller leaves the sequence at 0.",
            Kind::Unnumbered,
            SampleInvalid,
            "sequence = 0: the motion controller must number its samples, from 1",
        ),
        refused(
            "wrench_invalid",
            "The motion controller flags its wrench as invalid, and sends zeros.",
            Kind::WrenchInvalid,
            SampleInvalid,
            "wrench_valid = 0: the motion controller marks its wrench as invalid",
        ),
        Row {
            // Near a singular pose alone does that change what the joints are told.
            daemon: &[("redundancy", "{ damping_factor = 0.1, damping_below = 0.1 }")],
            scenario: [&FOLLOWING, &FOLLOWING],
            ..refused(
                "not_following",
                "The daemon is to resolve twists, and the motion controller says that its joints no longer follow what it resolves.",
                Kind::NotFollowing,
                SampleInvalid,
                "follows_joint_velocity = 0: with [redundancy]",
            )
        },
        refused(
            "joint_count",
            "State samples speak of one joint more than the robot has.",
            Kind::JointCount,
            JointCount,
            "joint_count = 3: this daemon is configured for 2 joints",
        ),
        refused(
            "position_jump",
            "A joint position jumps by 0.1 rad, more than its speed allows, and stays there.",
            Kind::PositionJump,
            SampleInvalid,
            "joint_position[1] jumped by ",
        ),
        Row {
            fault: "The drives are disabled: the joints are braked.",
            injection: Injection::Scripted(Kind::DrivesDisabled),
            ..row(
                "drives_disabled",
                Expectation {
                    robot: Robot::StandsStill,
                    command: vec![FREE, idle(DrivesDisabled)],
                    log: by_daemon(&["Idle: DrivesDisabled"]),
                    recovery: vec![Step::FaultEnds],
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::StandsStill,
                    command: vec![CONTACT, stopped(DrivesDisabled)],
                    log: by_daemon(&["Stopped: DrivesDisabled"]),
                    force: Force::PlanThenHold,
                    recovery: vec![Step::FaultEnds, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
    ];
    rows.extend([
        not_finite("nan_joint_position", "A joint position is NaN.", Kind::NanJointPosition, "joint_position"),
        not_finite("nan_joint_velocity", "A joint velocity is NaN.", Kind::NanJointVelocity, "joint_velocity"),
        not_finite(
            "nan_joint_position_reference",
            "A commanded joint position is NaN.",
            Kind::NanJointPositionReference,
            "joint_position_reference",
        ),
        not_finite(
            "nan_twist_reference",
            "The commanded TCP velocity is NaN on one axis.",
            Kind::NanTwistReference,
            "twist_reference",
        ),
        not_finite("nan_wrench", "The wrench is NaN on one axis.", Kind::NanWrench, "wrench"),
        not_finite("inf_joint_position", "A joint position is infinite.", Kind::InfJointPosition, "joint_position"),
        not_finite("inf_joint_velocity", "A joint velocity is infinite.", Kind::InfJointVelocity, "joint_velocity"),
        not_finite(
            "inf_joint_position_reference",
            "A commanded joint position is infinite.",
            Kind::InfJointPositionReference,
            "joint_position_reference",
        ),
        not_finite(
            "inf_twist_reference",
            "The commanded TCP velocity is infinite on one axis.",
            Kind::InfTwistReference,
            "twist_reference",
        ),
        not_finite("inf_wrench", "The wrench is infinite on one axis.", Kind::InfWrench, "wrench"),
    ]);
    rows
}
