//! The services over real shared memory, each test in its own private root path and prefix.

mod common;

use std::path::PathBuf;

use common::Private;
use iceoryx2::prelude::ZeroCopySend;
use ipc_types::services::{command, command_arrival, request, state, state_arrival, truth};
use ipc_types::{
    Access, CommandSample, Instance, IpcSettings, MAX_PLAN, PortError, RemoveError, RequestSample, ResponseSample,
    ServiceError, StateSample, TruthSample, quiet_iceoryx2, remove_all, shared_memory_files,
};

#[test]
fn the_newest_sample_and_a_wake_up_arrive() {
    let place = Private::new();
    let (controller, daemon) = (place.node("controller").unwrap(), place.node("daemon").unwrap());
    let publisher = state(&controller, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    let notifier = state_arrival(&controller, &place.instance, Access::OpenOrCreate).unwrap().notifier().unwrap();
    let subscriber = state(&daemon, &place.instance, Access::OpenOrCreate).unwrap().subscriber().unwrap();
    let listener = state_arrival(&daemon, &place.instance, Access::Open).unwrap().listener().unwrap();
    for sequence in 1..=3 {
        let mut sample = StateSample::zeroed();
        (sample.sequence, sample.wrench[5]) = (sequence, f64::NAN);
        publisher.send_copy(sample).unwrap();
        notifier.notify().unwrap();
    }
    let mut woken = false;
    listener.try_wait(|_| woken = true).unwrap();
    assert!(woken);
    let received = subscriber.receive().unwrap().expect("a sample");
    assert_eq!((received.sequence, received.wrench[5].is_nan()), (3, true));
    assert!(subscriber.receive().unwrap().is_none(), "buffer 1: older samples are gone");
}

#[test]
fn a_truth_reader_may_fall_behind_by_the_buffer() {
    let place = Private::new();
    let node = place.node("plant-sim").unwrap();
    let publisher = truth(&node, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    let subscriber = truth(&node, &place.instance, Access::Open).unwrap().subscriber().unwrap();
    for sequence in 1..=1030 {
        publisher.send_copy(TruthSample { sequence, ..TruthSample::zeroed() }).unwrap();
    }
    let received: Vec<u64> =
        std::iter::from_fn(|| subscriber.receive().unwrap()).map(|sample| sample.sequence).collect();
    assert_eq!(received, (7..=1030).collect::<Vec<_>>());
}

#[test]
fn every_port_that_the_contract_promises_can_be_made() {
    let place = Private::new();
    let node = place.node("daemon").unwrap();
    let service = command(&node, &place.instance, Access::OpenOrCreate).unwrap();
    let _publisher = service.publisher().unwrap();
    let _subscribers: Vec<_> = (0..8).map(|_| service.subscriber().unwrap()).collect();
    let one_too_many = service.subscriber().unwrap_err();
    assert_eq!(
        one_too_many.to_string(),
        "service admittanced/r1/command already has 8 subscribers, all that it allows: end one of them and try again"
    );
    let arrival = command_arrival(&node, &place.instance, Access::OpenOrCreate).unwrap();
    let _listeners: Vec<_> = (0..8).map(|_| arrival.listener().unwrap()).collect();
    let requests = request(&node, &place.instance, Access::OpenOrCreate).unwrap();
    let _clients: Vec<_> = (0..8).map(|_| requests.client().unwrap()).collect();
    let _nodes: Vec<_> = (0..19)
        .map(|_| {
            let node = place.node("reader").unwrap();
            (command(&node, &place.instance, Access::Open).unwrap(), node)
        })
        .collect();
    let last = place.node("reader").unwrap();
    let error = command(&last, &place.instance, Access::Open).unwrap_err();
    assert!(matches!(error, ServiceError::TooManyNodes { .. }), "{error}");
}

#[test]
fn a_second_publisher_and_a_second_server_are_refused() {
    let place = Private::new();
    let (first, second) = (place.node("first").unwrap(), place.node("second").unwrap());
    let publisher = command(&first, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    let other = command(&second, &place.instance, Access::OpenOrCreate).unwrap();
    let error = other.publisher().unwrap_err();
    assert!(matches!(error, PortError::Taken { .. }), "{error:?}");
    assert!(error.to_string().starts_with("another process already publishes admittanced/r1/command: "), "{error}");
    let _server = request(&first, &place.instance, Access::OpenOrCreate).unwrap().server().unwrap();
    let error = request(&second, &place.instance, Access::OpenOrCreate).unwrap().server().unwrap_err();
    assert!(error.to_string().starts_with("another process already serves admittanced/r1/request: "), "{error}");
    drop(publisher);
    other.publisher().expect("the place is free again");
}

#[test]
fn opening_what_nobody_created_says_whom_to_start() {
    let place = Private::new();
    let node = place.node("admittancectl").unwrap();
    let root = place.root_path.display();
    let expected = |name: &str, program: &str| {
        format!(
            "no service admittanced/r1/{name} in {root} with prefix \"{}\": is {program} running with this instance, \
             root \
             path and prefix?",
            place.prefix
        )
    };
    let instance = &place.instance;
    let messages = [
        state(&node, instance, Access::Open).unwrap_err().to_string(),
        command_arrival(&node, instance, Access::Open).unwrap_err().to_string(),
        truth(&node, instance, Access::Open).unwrap_err().to_string(),
        request(&node, instance, Access::Open).unwrap_err().to_string(),
    ];
    assert_eq!(
        messages,
        [
            expected("state", "admittanced"),
            expected("command-arrival", "admittanced"),
            expected("truth", "plant-sim"),
            expected("request", "admittanced"),
        ]
    );
}

/// What a program of a later schema version would publish.
#[repr(C)]
#[derive(Debug, ZeroCopySend)]
#[type_name("admittanced.StateSample.v3")]
struct LaterStateSample {
    bytes: [u64; 51],
}

/// The right name with another size.
#[repr(C)]
#[derive(Debug, ZeroCopySend)]
#[type_name("admittanced.StateSample.v2")]
struct ShortStateSample {
    bytes: [u64; 50],
}

#[test]
fn a_foreign_type_is_named() {
    fn with<T: std::fmt::Debug + ZeroCopySend>() -> String {
        let place = Private::new();
        let node = place.node("foreign").unwrap();
        let name = "admittanced/r1/state".try_into().unwrap();
        let _foreign = node.service_builder(&name).publish_subscribe::<T>().create().unwrap();
        let error = state(&node, &place.instance, Access::OpenOrCreate).unwrap_err();
        assert!(matches!(error, ServiceError::WrongType { .. }), "{error}");
        error.to_string()
    }
    let later = "service admittanced/r1/state carries admittanced.StateSample.v3 (408 bytes), this program speaks \
                 admittanced.StateSample.v2 (472 bytes): ";
    let error = with::<LaterStateSample>();
    assert!(error.starts_with(later), "{error}");
    let error = with::<ShortStateSample>();
    assert!(error.contains("carries admittanced.StateSample.v2 (400 bytes), this program speaks"), "{error}");
}

#[test]
fn a_foreign_quality_of_service_is_refused() {
    let place = Private::new();
    let node = place.node("foreign").unwrap();
    let name = "admittanced/r1/state".try_into().unwrap();
    let _foreign = node.service_builder(&name).publish_subscribe::<StateSample>().max_subscribers(2).create().unwrap();
    let error = state(&node, &place.instance, Access::OpenOrCreate).unwrap_err();
    assert!(matches!(error, ServiceError::WrongQos { .. }), "{error}");
    assert!(error.to_string().contains("DoesNotSupportRequestedAmountOfSubscribers"), "{error}");
}

#[test]
fn a_damaged_service_file_says_what_to_remove() {
    let place = Private::new();
    let node = place.node("daemon").unwrap();
    let service = state(&node, &place.instance, Access::OpenOrCreate).unwrap();
    let directory = place.root_path.join("services");
    let file = std::fs::read_dir(&directory).unwrap().next().expect("one service").unwrap().path();
    drop(service);
    std::fs::write(&file, "garbage").unwrap();
    let error = state(&node, &place.instance, Access::OpenOrCreate).unwrap_err();
    assert!(matches!(error, ServiceError::Damaged { .. }), "{error}");
    let advice = format!("then remove {} and /dev/shm/{}*", place.root_path.display(), place.prefix);
    assert!(error.to_string().ends_with(&advice), "{error}");
}

#[test]
fn a_request_is_answered_and_an_abandoned_one_is_not_served() {
    let place = Private::new();
    let (daemon, tool) = (place.node("daemon").unwrap(), place.node("tool").unwrap());
    let server = request(&daemon, &place.instance, Access::OpenOrCreate).unwrap().server().unwrap();
    let client = request(&tool, &place.instance, Access::Open).unwrap().client().unwrap();
    drop(client.send_copy(RequestSample { id: 1, ..RequestSample::zeroed() }).unwrap());
    let pending = client.send_copy(RequestSample { id: 2, ..RequestSample::zeroed() }).unwrap();
    let active = server.receive().unwrap().expect("the request whose client still waits");
    assert_eq!(active.id, 2);
    let mut response = ResponseSample::zeroed();
    response.id = active.id;
    response.set_text("done");
    active.send_copy(response).unwrap();
    assert_eq!(pending.receive().unwrap().expect("a response").text(), "done");
    assert!(server.receive().unwrap().is_none());
}

#[test]
fn a_peer_that_stands_still_blocks_nobody() {
    let place = Private::new();
    let (daemon, tool) = (place.node("daemon").unwrap(), place.node("tool").unwrap());
    let _server = request(&daemon, &place.instance, Access::OpenOrCreate).unwrap().server().unwrap();
    let client = request(&tool, &place.instance, Access::Open).unwrap().client().unwrap();
    let _listener = state_arrival(&daemon, &place.instance, Access::OpenOrCreate).unwrap().listener().unwrap();
    let notifier = state_arrival(&tool, &place.instance, Access::Open).unwrap().notifier().unwrap();
    let _subscriber = command(&tool, &place.instance, Access::OpenOrCreate).unwrap().subscriber().unwrap();
    let publisher = command(&daemon, &place.instance, Access::Open).unwrap().publisher().unwrap();
    for id in 0..2000 {
        // Each call must return; whether it delivered is another question.
        drop(client.send_copy(RequestSample { id, ..RequestSample::zeroed() }).unwrap());
        let _ = notifier.notify();
        publisher.send_copy(CommandSample { plan_length: MAX_PLAN as u32, ..CommandSample::zeroed() }).unwrap();
    }
}

#[test]
fn the_longest_root_path_takes_a_listener() {
    quiet_iceoryx2();
    let prefix = format!("t{}_l_", std::process::id());
    let root = "r".repeat(107 - 1 - prefix.len() - 45 - format!("/tmp/{prefix}/").len());
    let place = Private::below(prefix, &root);
    let node = place.node("daemon").unwrap();
    let _listener = state_arrival(&node, &place.instance, Access::OpenOrCreate).unwrap().listener().unwrap();
    let deeper = IpcSettings { root_path: format!("{}r", place.root_path.display()).into(), ..place.0.clone() };
    let error = deeper.node("daemon").unwrap_err().to_string();
    assert!(error.contains("limited to 107 bytes"), "{error}");
}

#[test]
fn two_instances_share_a_place_without_meeting() {
    let place = Private::new();
    let node = place.node("daemon").unwrap();
    let other = Instance::new("r2").unwrap();
    let _one = command(&node, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    let _two = command(&node, &other, Access::OpenOrCreate).unwrap().publisher().unwrap();
}

#[test]
fn removal_takes_everything_of_its_own_and_nothing_else() {
    let (place, neighbour) = (Private::new(), Private::new());
    let node = neighbour.node("neighbour").unwrap();
    let _kept = state(&node, &neighbour.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    let node = place.node("daemon").unwrap();
    let publisher = state(&node, &place.instance, Access::OpenOrCreate).unwrap().publisher().unwrap();
    std::fs::write(place.root_path.join("r1.lock"), "1").unwrap();
    assert!(!shared_memory_files(&place.prefix).unwrap().is_empty());
    // As after SIGKILL: nothing is released by its owner.
    std::mem::forget((publisher, node));
    let before = shared_memory_files(&neighbour.prefix).unwrap().len();
    remove_all(&place).unwrap();
    assert!(!place.root_path.exists());
    assert_eq!(shared_memory_files(&place.prefix).unwrap(), Vec::<PathBuf>::new());
    assert_eq!(shared_memory_files(&neighbour.prefix).unwrap().len(), before);
    remove_all(&place).expect("nothing there is no error");
}

#[test]
fn removal_refuses_what_may_belong_to_others() {
    let place = Private::new();
    for prefix in ["", "iox2_"] {
        let shared = IpcSettings { prefix: prefix.into(), ..place.0.clone() };
        let error = remove_all(&shared).unwrap_err();
        assert!(matches!(error, RemoveError::SharedPrefix { .. }), "{error}");
    }
    for root in ["/tmp/iceoryx2", "/tmp/iceoryx2/", "/tmp", "/"] {
        let shared = IpcSettings { root_path: root.into(), ..place.0.clone() };
        let error = remove_all(&shared).unwrap_err();
        assert!(matches!(error, RemoveError::SharedRootPath { .. } | RemoveError::Settings(_)), "{error}");
    }
    let node = place.node("daemon").unwrap();
    let notes = place.root_path.join("notes.txt");
    std::fs::write(&notes, "mine").unwrap();
    let error = remove_all(&place).unwrap_err();
    assert!(matches!(&error, RemoveError::ForeignEntry { entry, .. } if *entry == notes), "{error}");
    assert!(notes.exists() && place.root_path.join("nodes").exists());
    drop(node);
    std::fs::remove_file(notes).unwrap();
}

/// What a program leaves that is killed while it makes the service: here the file that says what the
/// service is, without the memory that it needs.
fn half_made(place: &Private) -> std::path::PathBuf {
    let node = place.node("killed").unwrap();
    let service = state(&node, &place.instance, Access::OpenOrCreate).unwrap();
    let file = files(&place.root_path.join("services")).pop().expect("one service");
    let bytes = std::fs::read(&file).unwrap();
    drop(service);
    drop(node);
    std::fs::create_dir_all(place.root_path.join("services")).unwrap();
    std::fs::write(&file, bytes).unwrap();
    std::fs::set_permissions(&file, std::os::unix::fs::PermissionsExt::from_mode(0o400)).unwrap();
    file
}

fn files(directory: &std::path::Path) -> Vec<std::path::PathBuf> {
    std::fs::read_dir(directory).into_iter().flatten().map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn a_service_that_was_left_half_made_is_made_anew_beside_programs_that_live() {
    let place = Private::new();
    let file = half_made(&place);
    // What is removed where nobody lives is not what this test is about.
    std::fs::rename(&file, place.root_path.join("kept")).unwrap();
    let living = place.node("living").unwrap();
    std::fs::rename(place.root_path.join("kept"), &file).unwrap();
    let tool = state(&living, &place.instance, Access::Open).unwrap_err();
    assert!(matches!(tool, ServiceError::Busy { .. }), "a tool makes and removes nothing: {tool}");
    let daemon = place.node("daemon").unwrap();
    let service = state(&daemon, &place.instance, Access::OpenOrCreate).expect("made anew");
    let publisher = service.publisher().unwrap();
    let subscriber = state(&living, &place.instance, Access::Open).unwrap().subscriber().unwrap();
    publisher.send_copy(StateSample { sequence: 7, ..StateSample::zeroed() }).unwrap();
    assert_eq!(subscriber.receive().unwrap().expect("they have met").sequence, 7);
    drop((publisher, subscriber, service));
    assert!(!file.exists(), "the service has gone with its last user");
    // Killed even earlier: there is a file, and nothing in it.
    let unwritten = || {
        std::fs::write(&file, "").unwrap();
        std::fs::set_permissions(&file, std::os::unix::fs::PermissionsExt::from_mode(0o600)).unwrap();
    };
    unwritten();
    drop(state(&daemon, &place.instance, Access::OpenOrCreate).expect("made anew"));
    // What a living node is at it is left alone.
    unwritten();
    let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
    let tag = place.root_path.join(format!("nodes/{}/{name}.service_tag", living.id().value()));
    std::fs::write(&tag, "").unwrap();
    let error = state(&daemon, &place.instance, Access::OpenOrCreate).unwrap_err();
    assert!(matches!(error, ServiceError::Busy { .. }) && file.exists(), "{error}");
    std::fs::remove_file(tag).unwrap();
}

/// iceoryx2 itself would wait for it for ever, when it clears up after the node.
#[test]
fn memory_that_was_left_half_made_holds_nobody_up() {
    use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
    let place = Private::new();
    let living = place.node("living").unwrap();
    let path = std::path::Path::new("/dev/shm").join(format!("{}{}_12.dynamic", place.prefix, "0a".repeat(20)));
    let mut options = std::fs::OpenOptions::new();
    options.create_new(true).write(true).mode(0o200);
    let maker = options.open(&path).unwrap();
    drop(place.node("guest").unwrap());
    assert!(path.exists(), "who makes it lives");
    drop(maker);
    let guest = place.node("guest").unwrap();
    assert!(!path.exists(), "at the start of a node");
    drop(options.open(&path).unwrap());
    drop(guest);
    assert!(!path.exists(), "at its end");
    drop(options.open(&path).unwrap());
    drop(state(&living, &place.instance, Access::OpenOrCreate).unwrap());
    assert!(!path.exists(), "and before a service");
    // What is complete stays.
    std::fs::write(&path, "x").unwrap();
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o600)).unwrap();
    drop(place.node("guest").unwrap());
    assert!(path.exists());
}

#[test]
fn where_nobody_lives_nothing_is_left() {
    let place = Private::new();
    half_made(&place);
    let orphan = std::path::Path::new("/dev/shm").join(format!("{}{}_12.event_mgmt", place.prefix, "0a".repeat(20)));
    std::fs::write(&orphan, "x").unwrap();
    let living = place.node("living").unwrap();
    assert!(!orphan.exists() && files(&place.root_path.join("services")).is_empty());
    // Beside a program that lives it stays, whoever comes and goes.
    std::fs::write(&orphan, "x").unwrap();
    drop(place.node("guest").unwrap());
    assert!(orphan.exists());
    drop(living);
    assert!(!orphan.exists());
    assert!(ipc_types::shared_memory_files(&place.prefix).unwrap().is_empty());
    assert!(files(&place.root_path.join("nodes")).is_empty() && files(&place.root_path.join("services")).is_empty());
    // One of another root path is not to suffer for it.
    let other = Private::new();
    let settings = ipc_types::IpcSettings { prefix: other.prefix.clone(), ..place.0.clone() };
    let kept = other.node("living").unwrap();
    let service = state(&kept, &other.instance, Access::OpenOrCreate).unwrap();
    let before = ipc_types::shared_memory_files(&other.prefix).unwrap().len();
    drop(settings.node("another root path, the same prefix").unwrap());
    assert_eq!(ipc_types::shared_memory_files(&other.prefix).unwrap().len(), before);
    drop(service);
}
