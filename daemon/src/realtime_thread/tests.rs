use std::any::Any;

use admittance_core::Counters;
use admittance_core::belief::Snapshot;
use admittance_core::supervisor::{EnableRefused, ResetRefused};
use ipc_types::{Instance, MAX_JOINTS, TASK_AXES};

use super::*;
use crate::channel::channel;
use crate::probe::Unobserved;
use admittance_runner::cycle::Memory;
use admittance_runner::settings::Settings;

/// A controller with a bug.
struct Panics;

impl Cycle for Panics {
    fn answer(
        &mut self,
        state: &StateSample,
        _: Instant,
        _: &mut dyn FnMut() -> bool,
        _: &mut CommandSample,
    ) -> CycleReport {
        panic!("a bug, met at sample {}", state.sequence)
    }

    fn silence(&mut self, _: Instant, _: &mut CommandSample) -> CycleReport {
        CycleReport::default()
    }

    fn end(&mut self, _: Ending) {}

    fn reset(&mut self, _: bool) -> Result<(), ResetRefused> {
        Err(ResetRefused::NoSample)
    }

    fn enable(&mut self) -> Result<bool, EnableRefused> {
        Err(EnableRefused::Ending)
    }

    fn is_enabled(&self) -> bool {
        true
    }

    fn settings(&self) -> &Settings {
        unreachable!("only records ask for it")
    }

    fn mode(&self) -> Mode {
        Mode::Contact
    }

    fn belief(&self) -> Snapshot {
        Memory::recorded(&RecordSample::zeroed()).belief
    }

    fn tool_acceleration(&self) -> [f64; TASK_AXES] {
        [0.0; TASK_AXES]
    }

    fn joint_motion(&self) -> [[f64; MAX_JOINTS]; 2] {
        [[0.0; MAX_JOINTS]; 2]
    }

    fn counters(&self) -> Counters {
        Counters::default()
    }

    fn take_over(&mut self, _: &dyn Cycle) -> bool {
        false
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// Settings of a place of its own whose name begins so.
fn place(name: &str) -> IpcSettings {
    let name = format!("{name}{:x}_", std::process::id());
    IpcSettings {
        root_path: ipc_types::users_root_path().join(&name),
        prefix: name,
        instance: Instance::new("panics").expect("a name"),
    }
}

/// The thread, with a law that panics.
fn thread(settings: &IpcSettings) -> RealtimeThread {
    let realtime = RealtimeSection {
        lock_memory: false,
        priority: 0,
        cpu: None,
        cpu_dma_latency_us: None,
        require_realtime: false,
    };
    let timing = LoopTiming {
        answer_budget: 1_000_000,
        max_sample_age: 5_000_000,
        sampling_time: 4_000_000,
        wait: Wait::Event,
        spin: 0,
    };
    let (realtime_end, _) = channel();
    RealtimeThread {
        settings: settings.clone(),
        realtime,
        timing,
        cycle: Box::new(Panics),
        channel: realtime_end,
        boot_id: 7,
    }
}

#[test]
fn it_answers_nothing_before_it_may() {
    let settings = place("go");
    let node = settings.node("test").expect("a node");
    let state = services::state(&node, &settings.instance, Access::OpenOrCreate).expect("the first");
    let states = state.publisher().expect("no other publisher");
    let (started, start) = std::sync::mpsc::channel();
    let (go, may_go) = std::sync::mpsc::channel::<()>();
    let thread = thread(&settings);
    let handle = std::thread::spawn(move || thread.run(&started, &may_go, Unobserved));
    start.recv().expect("the thread tells").expect("its ports open");
    // The law would panic.
    states.send_copy(StateSample { sequence: 1, stamp_ns: monotonic_ns(), ..StateSample::zeroed() }).expect("sent");
    std::thread::sleep(std::time::Duration::from_millis(20));
    drop(go);
    assert_eq!(handle.join().expect("no panic"), ExitCode::Unavailable);
    drop((states, state, node));
    ipc_types::remove_all(&settings).expect("removed");
}

#[test]
fn a_panic_is_a_hold_and_an_internal_error() {
    let settings = place("pan");
    let thread = thread(&settings);
    let (started, start) = std::sync::mpsc::channel();
    let (go, may_go) = std::sync::mpsc::channel();
    let handle = std::thread::spawn(move || thread.run(&started, &may_go, Unobserved));
    start.recv().expect("the thread tells").expect("its ports open");
    go.send(()).expect("it waits");

    let node = settings.node("test").expect("a node");
    let state = services::state(&node, &settings.instance, Access::Open).expect("the daemon made it");
    let states = state.publisher().expect("no other publisher");
    let command = services::command(&node, &settings.instance, Access::Open).expect("the daemon made it");
    let commands = command.subscriber().expect("a subscriber");
    states.send_copy(StateSample { sequence: 1, stamp_ns: monotonic_ns(), ..StateSample::zeroed() }).expect("sent");
    assert_eq!(handle.join().expect("the panic does not leave the thread"), ExitCode::Internal);
    let last = commands.receive().expect("received").expect("a last command");
    assert_eq!((last.motion, last.stop_reason), (Motion::Hold.code(), StopReason::InternalError.code()));
    assert_eq!(last.boot_id, 7);
    drop((last, commands, command, states, state, node));
    ipc_types::remove_all(&settings).expect("removed");
}
