//! Rows about the processes: killed, stopped, started twice, and the places where they meet and
//! write.

use ipc_types::StopReason;

use super::row::{
    CONTACT, Counter, Disk, End, Expectation, FREE, Force, Injection, Newcomer, Robot, Row, Signal, Step, Who, idle,
    stopped, stopping, withdrawn,
};
use super::{LONG, by_daemon, by_newcomer, row};

/// A fault that the running pair must not notice: the new process ends with `code` and logs `log`.
fn unnoticed(
    name: &'static str,
    fault: &'static str,
    injection: Injection,
    code: i32,
    log: &[&str],
    recovery: &[Step],
) -> Row {
    let expected = |said, force| Expectation {
        log: by_newcomer(log),
        ends: vec![End::Code(Who::Newcomer, code)],
        recovery: recovery.to_vec(),
        force,
        ..Expectation::undisturbed(said)
    };
    Row { fault, injection, timeline: LONG, ..row(name, expected(FREE, Force::None), expected(CONTACT, Force::Limit)) }
}

fn killed_or_stopped() -> Vec<Row> {
    use StopReason::{SampleStale, SamplesMissed, Shutdown, StartedInContact};
    let silent_free = |recovery: Vec<Step>| Expectation {
        robot: Robot::NotRunning,
        command: vec![FREE, idle(SampleStale)],
        counted: Vec::new(),
        log: by_daemon(&["Idle: SampleStale, no sample for longer than max_sample_age_s"]),
        recovery,
        ..Expectation::undisturbed(FREE)
    };
    let silent_contact = |recovery: Vec<Step>| Expectation {
        robot: Robot::NotRunning,
        command: vec![CONTACT, stopping(SampleStale), stopped(SampleStale)],
        counted: vec![Counter::Fallback],
        log: by_daemon(&["Stopped: SampleStale, no sample for longer than max_sample_age_s"]),
        force: Force::PlanThenHold,
        recovery,
        ..Expectation::undisturbed(CONTACT)
    };
    let unanswered = |said, force, recovery: Vec<Step>| Expectation {
        robot: Robot::PlaysPlan,
        force,
        recovery,
        ..Expectation::undisturbed(said)
    };
    let (plant, daemon) = (Who::Plant, Who::Daemon);
    let killed = |who| vec![End::Signal(who, Signal::Kill)];
    vec![
        Row {
            fault: "The motion controller is killed, and started again.",
            injection: Injection::Signal(plant, Signal::Kill),
            ..row(
                "plant_killed",
                Expectation { ends: killed(plant), ..silent_free(vec![Step::Start(plant)]) },
                Expectation {
                    ends: killed(plant),
                    ..silent_contact(vec![Step::Start(plant), Step::Retreat, Step::Reset])
                },
            )
        },
        Row {
            fault: "The motion controller is stopped, and goes on later: it first publishes what it has missed, with old stamps.",
            injection: Injection::Signal(plant, Signal::Stop),
            timeline: LONG,
            ..row(
                "plant_stopped",
                Expectation { counted: vec![Counter::Rejected], ..silent_free(vec![Step::Continue(plant)]) },
                Expectation {
                    counted: vec![Counter::Rejected, Counter::Fallback],
                    ..silent_contact(vec![Step::Continue(plant), Step::Retreat, Step::Reset])
                },
            )
        },
        Row {
            fault: "The daemon is killed, and started again while the arm is where it came to stand.",
            injection: Injection::Signal(daemon, Signal::Kill),
            timeline: LONG,
            ..row(
                "daemon_killed",
                Expectation { ends: killed(daemon), ..unanswered(FREE, Force::None, vec![Step::Start(daemon)]) },
                Expectation {
                    ends: killed(daemon),
                    ..unanswered(
                        CONTACT,
                        Force::PlanThenHold,
                        vec![Step::Start(daemon), Step::See(stopped(StartedInContact)), Step::Retreat, Step::Reset],
                    )
                },
            )
        },
        Row {
            fault: "The daemon is stopped, and goes on later.",
            injection: Injection::Signal(daemon, Signal::Stop),
            timeline: LONG,
            ..row(
                "daemon_stopped",
                Expectation {
                    counted: vec![Counter::Missed],
                    ..unanswered(FREE, Force::None, vec![Step::Continue(daemon)])
                },
                Expectation {
                    counted: vec![Counter::Missed],
                    ..unanswered(
                        CONTACT,
                        Force::PlanThenHold,
                        vec![Step::Continue(daemon), Step::See(stopped(SamplesMissed)), Step::Retreat, Step::Reset],
                    )
                },
            )
        },
        Row {
            fault: "The daemon is restarted while it controls.",
            injection: Injection::Restart,
            timeline: LONG,
            ..row(
                "daemon_restarted",
                Expectation {
                    robot: Robot::Pauses,
                    command: vec![FREE, withdrawn(Shutdown), FREE],
                    log: by_daemon(&["SIGTERM: ending control", "Idle: Shutdown", "ended"]),
                    ends: vec![End::Code(daemon, 0)],
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::ComesToRest,
                    command: vec![CONTACT, stopping(Shutdown), stopped(Shutdown), stopped(StartedInContact)],
                    log: by_daemon(&["SIGTERM: ending control", "Stopped: Shutdown", "Stopped: StartedInContact"]),
                    ends: vec![End::Code(daemon, 0)],
                    force: Force::PlanThenHold,
                    recovery: vec![Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
    ]
}

/// Rows in which something is started beside a running pair, or its surroundings go.
fn surroundings() -> Vec<Row> {
    let mut rows = vec![
        unnoticed(
            "two_daemons",
            "A second daemon is started for the instance.",
            Injection::Start(Newcomer::SameInstance),
            69,
            &["instance planar is held by process"],
            &[],
        ),
        unnoticed(
            "foreign_service_size",
            "A foreign process has created a service of the daemon's name with samples of another size.",
            Injection::Start(Newcomer::ForeignSize),
            69,
            &["service admittanced/other/state carries admittanced.StateSample.v2 (400 bytes), this program speaks \
               admittanced.StateSample.v2 (472 bytes)"],
            &[],
        ),
        unnoticed(
            "foreign_service_version",
            "A foreign process has created a service of the daemon's name with another schema version.",
            Injection::Start(Newcomer::ForeignVersion),
            69,
            &["service admittanced/other/state carries admittanced.StateSample.v1 (408 bytes), this program speaks \
               admittanced.StateSample.v2 (472 bytes)"],
            &[],
        ),
        unnoticed(
            "shared_memory_full",
            "/dev/shm is nearly full when a daemon starts.",
            Injection::Start(Newcomer::FullSharedMemory),
            69,
            &["/dev/shm is full: it has", "bytes free, accepted: at least"],
            &[],
        ),
        unnoticed(
            "descriptors_few",
            "A daemon is started that may open too few files.",
            Injection::Start(Newcomer::FewDescriptors),
            69,
            &["too few file descriptors: ", "accepted: at least 192"],
            &[],
        ),
        unnoticed(
            "request_flood",
            "Eight clients ask the daemon 10,000 things a second, orders for the real-time thread among them. One more client is \
             answered all the same, signals are acted on, and the watchdog is fed (under a real systemd: `tests/systemd`).",
            Injection::Start(Newcomer::Flood),
            0,
            &[],
            &[],
        ),
        unnoticed(
            "root_removed",
            "The root directory is removed under running programs. What runs goes on; what starts later finds nothing (the \
             newcomer is `admittancectl status`). Both have to end before either is started: one that ends later removes the new \
             services' files.",
            Injection::RemoveRoot,
            69,
            &["(ipc.root_path) is not there: is admittanced running"],
            &[],
        ),
        unnoticed(
            "recording_unwritable",
            "The path of a recording cannot be written.",
            Injection::Record(Disk::Missing),
            73,
            &["No such file or directory"],
            &[],
        ),
        unnoticed(
            "recording_disk_full",
            "The disk becomes full while a recording is made.",
            Injection::Record(Disk::Full),
            74,
            &["No space left on device", "what was written until a second before is readable"],
            &[],
        ),
        unnoticed(
            "recording_damaged",
            "A bit of a recording has flipped.",
            Injection::ReplayDamaged,
            65,
            &["damaged at byte", "--recover goes on with what is whole"],
            &[],
        ),
    ];
    let (daemon, plant) = (Who::Daemon, Who::Plant);
    let anew = [Step::End(daemon), Step::End(plant), Step::Start(daemon), Step::Start(plant)];
    for row in rows.iter_mut().filter(|row| row.injection == Injection::RemoveRoot) {
        row.free.recovery = anew.to_vec();
        row.contact.recovery = [&[Step::Retreat], &anew[..]].concat();
    }
    rows
}

pub(super) fn rows() -> Vec<Row> {
    [killed_or_stopped(), surroundings()].concat()
}
