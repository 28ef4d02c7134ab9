//! A whole controller over real shared memory.

#[path = "../../../ipc-types/tests/common/mod.rs"]
mod common;

use admittance_client::{Applied, Arm, Controller, ControllerError, Limits, OpenError, Reception, Rejection};
use common::Private;
use iceoryx2::prelude::ZeroCopySend;
use ipc_types::services::{command, command_arrival, state};
use ipc_types::{Access, CommandSample, ServiceError};

const ARM: Arm = Arm { joint_count: 2, sampling_time_ns: 4_000_000, command_delay_ns: 250_000, limits: Limits::NONE };
const START_NS: u64 = 1_000_000_000;

#[test]
fn a_cycle_numbers_its_sample_and_obeys_its_answer_at_the_instant_agreed() {
    let place = Private::new();
    let daemon = place.node("daemon").unwrap();
    let states = state(&daemon, &place.instance, Access::OpenOrCreate).unwrap().subscriber().unwrap();
    let commands = command(&daemon, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    let mut controller = Controller::open(&place, "controller", &ARM, 7).unwrap();
    for cycle in 1..=3 {
        let stamp_ns = START_NS + cycle * ARM.sampling_time_ns;
        let sample = controller.begin(stamp_ns);
        assert!(controller.publish(&sample));
        controller.make_ready();
        let seen = states.receive().unwrap().expect("published");
        let identity = (seen.sequence, seen.stamp_ns, seen.boot_id, seen.joint_count, seen.plays_plan);
        assert_eq!(identity, (cycle, stamp_ns, 7, 2, 1));
        assert_eq!(seen.applied_command_sequence, (cycle - 1) * 10);
        assert_eq!(controller.receive(stamp_ns), Ok(None), "nothing has been answered");
        let mut answer = CommandSample { sequence: cycle * 10, joint_count: 2, ..CommandSample::zeroed() };
        (answer.state_sequence, answer.state_stamp_ns) = (cycle, stamp_ns);
        answer.valid_until_ns = stamp_ns + 2 * ARM.sampling_time_ns;
        answer.velocity_offset[0] = cycle as f64;
        commands.send_copy(answer).unwrap();
        assert_eq!(controller.receive(stamp_ns), Ok(Some(Reception::InTime)));
        let acts_ns = stamp_ns + ARM.command_delay_ns;
        assert_eq!(controller.next_change(stamp_ns), Some(acts_ns));
        let before = if cycle == 1 { [0.0; 6] } else { [cycle as f64 - 1.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        assert_eq!(controller.apply(acts_ns - 1), Applied::Offset(before));
        assert_eq!(controller.apply(acts_ns), Applied::Offset(answer.velocity_offset));
        assert_eq!(controller.next_change(acts_ns), Some(answer.valid_until_ns));
        assert_eq!(controller.apply(answer.valid_until_ns), Applied::Hold);
    }
    let of_another = CommandSample { joint_count: 6, ..CommandSample::zeroed() };
    commands.send_copy(of_another).unwrap();
    assert!(matches!(controller.receive(START_NS), Err(Rejection::JointCount { got: 6, expected: 2, .. })));
    assert_eq!(controller.newest().map(|command| command.sequence), Some(30));
}

#[test]
fn answers_are_notified_of() {
    let place = Private::new();
    let daemon = place.node("daemon").unwrap();
    let notifier = command_arrival(&daemon, &place.instance, Access::OpenOrCreate).unwrap().notifier().unwrap();
    let controller = Controller::open(&place, "controller", &ARM, 7).unwrap();
    let answers = controller.answers().unwrap();
    assert_eq!(answers.try_wait(|_| {}), Ok(0), "none yet");
    notifier.notify().unwrap();
    assert_eq!(answers.try_wait(|_| {}), Ok(1));
}

#[test]
fn another_boot_begins_on_the_same_ports_and_uses_no_answer_to_the_one_before() {
    let place = Private::new();
    let daemon = place.node("daemon").unwrap();
    let commands = command(&daemon, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    let mut controller = Controller::open(&place, "controller", &ARM, 7).unwrap();
    let begun = controller.begin(START_NS);
    let mut answer = CommandSample { sequence: 1, joint_count: 2, ..CommandSample::zeroed() };
    (answer.state_sequence, answer.state_stamp_ns) = (begun.sequence, begun.stamp_ns);
    commands.send_copy(answer).unwrap();
    assert_eq!(controller.receive(START_NS), Ok(Some(Reception::InTime)));
    controller.restart(8);
    assert!(!controller.playback().has_received() && controller.newest().is_none());
    let again = controller.begin(START_NS + ARM.sampling_time_ns);
    assert_eq!((again.sequence, again.boot_id, again.applied_command_sequence), (1, 8, 0));
    commands.send_copy(answer).unwrap();
    assert!(matches!(controller.receive(START_NS), Err(Rejection::UnknownSample { answered: 1, .. })));
}

/// What a program of another version would send under the same service name.
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[type_name("admittanced.CommandSample.v999")]
#[repr(C)]
struct Foreign([u64; 4]);

#[test]
fn another_schema_is_refused_when_the_ports_are_opened() {
    let place = Private::new();
    let other = place.node("other").unwrap();
    let name = format!("admittanced/{}/command", place.instance).as_str().try_into().unwrap();
    let _service = other.service_builder(&name).publish_subscribe::<Foreign>().create().unwrap();
    let refused = Controller::open(&place, "controller", &ARM, 7).expect_err("another type");
    assert!(refused.to_string().contains("admittanced.CommandSample.v3"), "{refused}");
    assert!(
        matches!(&refused, ControllerError::Open(OpenError::Service(ServiceError::WrongType { .. }))),
        "{refused:?}"
    );
}

#[test]
fn what_cannot_be_an_arm_is_refused_by_name() {
    let place = Private::new();
    let refused = |arm: Arm| Controller::open(&place, "controller", &arm, 7).expect_err("no arm").to_string();
    assert_eq!(refused(Arm { joint_count: 9, ..ARM }), "joint_count = 9: accepted: 1 to 8");
    assert_eq!(refused(Arm { sampling_time_ns: 0, ..ARM }), "sampling_time_ns = 0: accepted: above 0");
    let error = refused(Arm { command_delay_ns: u64::MAX, ..ARM });
    assert!(error.contains("accepted: at most 4000000000"), "{error}");
}
