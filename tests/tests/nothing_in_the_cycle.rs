//! From sample received to command sent: no heap, no page fault, and only the system calls that
//! waiting and the one notification need.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use admittance_host::clock::monotonic_ns;
use admittance_host::exit::ExitCode;
use admittance_runner::config::{Config, ContactPointName, FrameName};
use admittance_runner::cycle;
use admittanced::probe::{ObservedThread, Probe};
use end_to_end::closed_loop::{Experiment, MPC_DEFAULT};
use end_to_end::session::{PAPER_SCENARIO, PATIENT, run_plant, start_daemon, wait_for_log, with_keys, write};
use end_to_end::{Child, Need, PATIENCE, PrivateIpc, Strace, certain, needs, undisturbed};
use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, Mode, Motion, TruthSample};
use plant_sim::plant::CycleTiming;
use plant_sim::run::any_plant;

/// Counts each thread's calls to the heap.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static FREES: Cell<u64> = const { Cell::new(0) };
}

fn count(counter: &'static std::thread::LocalKey<Cell<u64>>) {
    // A thread that is ending has no thread-locals any more, and no cycle.
    let _ = counter.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches const thread-locals
// without destructors only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(&ALLOCATIONS);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(&ALLOCATIONS);
        // SAFETY: as the caller promises.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(&ALLOCATIONS);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(&FREES);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static HEAP: Counting = Counting;

/// The fence's counts over the cycles in contact.
#[derive(Debug, Default)]
struct Seen {
    cycles: AtomicU64,
    /// Cycles, allocations and frees without a change of connections.
    dirty: AtomicU64,
    allocations: AtomicU64,
    frees: AtomicU64,
    /// The next cycle meets a change of connections.
    changed: AtomicBool,
    /// Cycles that met one, and allocations in them.
    excepted: AtomicU64,
    excepted_allocations: AtomicU64,
}

/// The fence around a cycle.
struct Fence {
    seen: &'static Seen,
    allocations: u64,
    frees: u64,
    /// Something in the cycle allocates.
    is_spoilt: bool,
}

impl Probe for Fence {
    fn looking(&mut self) {
        (self.allocations, self.frees) = (ALLOCATIONS.get(), FREES.get());
        if self.is_spoilt {
            drop(std::hint::black_box(Box::new(0_u64)));
        }
    }

    fn sent(&mut self, command: &CommandSample, _: u64) {
        let (allocations, frees) = (ALLOCATIONS.get() - self.allocations, FREES.get() - self.frees);
        let add = |counter: &AtomicU64, value: u64| _ = counter.fetch_add(value, Ordering::Relaxed);
        if self.seen.changed.swap(false, Ordering::Relaxed) {
            add(&self.seen.excepted, 1);
            add(&self.seen.excepted_allocations, allocations);
        } else if command.mode == Mode::Contact.code() {
            add(&self.seen.cycles, 1);
            add(&self.seen.dirty, u64::from(allocations > 0));
            add(&self.seen.allocations, allocations);
            add(&self.seen.frees, frees);
        }
    }
}

/// Answers are never late and samples never stale: the plant's time passes as fast as both can
/// compute.
const NO_DEADLINE_S: f64 = 600.0;
/// Of the stiffness, N/m, about that of the plant.
const RANGE: [f64; 2] = [3e4, 3e5];
/// How far in the past the plant's time begins: it never catches up with the clock's.
const HEAD_START_NS: u64 = 120_000_000_000;

/// The real-time thread against the plant, over real ports, for this many cycles in contact, configured as
/// `told`; every `change` cycles a reader of commands joins, or leaves.
fn fenced(is_spoilt: bool, told: impl FnOnce(&mut Config), contact_cycles: u64, change: u64) -> &'static Seen {
    let ipc = PrivateIpc::new("planar");
    // It presses and slides, up and down: rows of the optimisation come and go.
    let phases: Vec<(f64, &[f64])> =
        (0..32).map(|phase| (0.5, if phase % 2 == 0 { &[0.05, -0.12][..] } else { &[-0.12, -0.05][..] })).collect();
    let mut experiment = Experiment::new(MPC_DEFAULT, PAPER_SCENARIO, 0.001).with_motion(&phases);
    told(&mut experiment.config);
    experiment.config.control.answer_budget_s = NO_DEADLINE_S;
    experiment.config.control.max_sample_age_s = NO_DEADLINE_S;
    let realtime = &mut experiment.config.realtime;
    // Irrelevant for this test, and not permitted everywhere.
    (realtime.lock_memory, realtime.priority, realtime.cpu) = (false, 0, None);
    // The thread never outlives its test; its messages may.
    let seen: &'static Seen = Box::leak(Box::default());
    let fence = Fence { seen, allocations: 0, frees: 0, is_spoilt };
    let cycle = cycle::build(&experiment.config).expect("the config describes a controller");
    let mut thread = ObservedThread::start(&experiment.config, cycle, ipc.settings(), fence).expect("its ports open");

    let node = ipc.settings().node("plant").expect("a node");
    let instance = &ipc.settings().instance;
    let states = services::state(&node, instance, Access::Open).expect("the daemon made it");
    let states = states.publisher().expect("the only one");
    let arrival = services::state_arrival(&node, instance, Access::Open).expect("the daemon made it");
    let arrived = arrival.notifier().expect("a notifier");
    let command = services::command(&node, instance, Access::Open).expect("the daemon made it");
    let commands = command.subscriber().expect("a subscriber");
    let mut plant =
        any_plant(&experiment.scenario, monotonic_ns() - HEAD_START_NS, 1, false).expect("the scenario is sound");
    let mut visitor = None;
    let mut changes = 0;
    let begun = Instant::now();
    while !thread.is_finished() {
        let contacts = seen.cycles.load(Ordering::Relaxed);
        if contacts >= contact_cycles {
            thread.stop();
        } else if contacts / change > changes {
            changes += 1;
            visitor = if visitor.is_none() { Some(command.subscriber().expect("a subscriber")) } else { None };
            seen.changed.store(true, Ordering::Relaxed);
        }
        states.send_copy(*plant.sample()).expect("sent");
        arrived.notify().expect("notified");
        let stamp = plant.now_ns();
        while !thread.is_finished() {
            assert!(begun.elapsed() < PATIENCE, "hangs after {contacts} cycles in contact");
            if let Some(answer) = commands.receive().expect("a live service")
                && answer.state_sequence == plant.sample().sequence
            {
                plant.receive(&answer, stamp).expect("the plant takes every command");
                break;
            }
            std::thread::yield_now();
        }
        plant.settle(CycleTiming::default());
        plant.integrate();
        assert!(!plant.is_finished(), "the motion is over after {contacts} cycles in contact");
    }
    drop(visitor);
    assert_eq!(thread.join(), ExitCode::Ok);
    assert_eq!(seen.excepted.load(Ordering::Relaxed), changes, "each change of connections excepts one cycle");
    println!("{seen:?} in {:?}", begun.elapsed());
    seen
}

#[test]
fn ten_thousand_contact_cycles_leave_the_heap_alone() {
    let seen = fenced(false, |_| {}, 10_000, 1_500);
    let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
    assert!(of(&seen.cycles) >= 10_000);
    assert_eq!((of(&seen.dirty), of(&seen.allocations)), (0, 0), "{seen:?}");
    // iceoryx2 gives back what the loan of the command took, in the slack of the cycle before.
    assert!(of(&seen.frees) <= of(&seen.cycles), "{seen:?}");
    assert_eq!(of(&seen.excepted), 6);
    assert!(
        of(&seen.excepted_allocations) > 0,
        "a new connection allocates: the fence would have seen it elsewhere too"
    );
}

/// What the controller remembers is turned in each cycle.
#[test]
fn a_frame_that_turns_with_the_tool_leaves_the_heap_alone() {
    let seen = fenced(false, |config| config.task.frame = FrameName::Tool, 3_000, 1_500);
    let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
    assert!(of(&seen.cycles) >= 3_000);
    assert_eq!((of(&seen.dirty), of(&seen.allocations)), (0, 0), "{seen:?}");
}

/// Touched and pressed on again and again: the belief is a set.
#[test]
fn a_range_of_the_stiffness_leaves_the_heap_alone() {
    let range = |config: &mut Config| {
        let environment = &mut config.environment;
        environment.stiffness_range_n_m = Some(RANGE);
        (environment.contact, environment.contact_point_m) = (ContactPointName::Detected, None);
        environment.normal_tolerance_rad = 0.05;
    };
    let seen = fenced(false, range, 3_000, 1_500);
    let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
    assert!(of(&seen.cycles) >= 3_000);
    assert_eq!((of(&seen.dirty), of(&seen.allocations)), (0, 0), "{seen:?}");
}

#[test]
fn the_fence_sees_a_cycle_that_allocates() {
    let seen = fenced(true, |_| {}, 100, u64::MAX);
    assert!(seen.dirty.load(Ordering::Relaxed) >= 100, "{seen:?}");
}

/// What the daemon is told of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Told {
    Stiffness,
    Range,
}

/// A scenario that stays in contact for two seconds and more: time enough for observers.
fn long_contact() -> String {
    let changes = [
        ("timing.sampling_time_s", "0.01"),
        ("timing.command_delay_s", "0.001"),
        ("start.contact_time_s", "0.5"),
        ("motion", "[{ duration_s = 3.5, twist = [0.0, -0.05] }]"),
    ];
    with_keys(PAPER_SCENARIO, &changes)
}

/// The default profile for it; with a range of the stiffness, if that is what is `told`.
fn patient(wait: &str, told: Told) -> String {
    let (wait, range) = (format!("\"{wait}\""), format!("{RANGE:?}"));
    let learned = [("environment.stiffness_range_n_m", range.as_str()), ("environment.contact_tolerance_m", "0.001")];
    let changes = [
        ("control.sampling_time_s", "0.01"),
        ("control.command_delay_s", "0.001"),
        ("control.spin_s", "0.0005"),
        ("control.wait", wait.as_str()),
        ("realtime.require_realtime", "true"),
    ];
    let budget = ("control.answer_budget_s", "0.009");
    let learned = if told == Told::Range { &learned[..] } else { &[] };
    with_keys(MPC_DEFAULT, &[&PATIENT, &changes[..], &[budget], learned].concat())
}

/// Fails when a busy machine made the daemon stop the arm.
fn assert_never_held(truths: &[TruthSample]) {
    let held = truths.iter().find(|truth| truth.scenario_time_s > 0.0 && truth.motion == Motion::Hold.code());
    assert!(held.is_none(), "{held:?}");
}

/// The directory of the daemon's real-time thread below /proc.
fn realtime_task(daemon: &Child) -> std::path::PathBuf {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", daemon.id())).expect("the daemon runs");
    let named = |path: &Path| std::fs::read_to_string(path.join("comm")).is_ok_and(|name| name.trim() == "real-time");
    tasks.flatten().map(|task| task.path()).find(|path| named(path)).expect("the thread has its name")
}

/// Minor and major page faults of a thread so far.
fn page_faults(task: &Path) -> (u64, u64) {
    let stat = std::fs::read_to_string(task.join("stat")).expect("the thread runs");
    let (_, fields) = stat.rsplit_once(") ").expect("a name in parentheses");
    // The state is field 3 of proc(5), minflt 10, majflt 12.
    let field = |number: usize| fields.split(' ').nth(number - 3).and_then(|text| text.parse().ok()).expect("a number");
    (field(10), field(12))
}

#[test]
fn contact_takes_no_page_fault() {
    takes_no_page_fault(Told::Stiffness);
}

#[test]
fn contact_with_a_range_takes_no_page_fault() {
    takes_no_page_fault(Told::Range);
}

fn takes_no_page_fault(told: Told) {
    undisturbed(|| {
        if !needs(Need::Root) {
            return;
        }
        let ipc = PrivateIpc::new("planar");
        let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &patient("hybrid", told)));
        wait_for_log(&mut daemon, "real time: lock memory: done");
        let task = realtime_task(&daemon);
        let mut readings = Vec::new();
        let truths = run_plant(&ipc, &write(&ipc, "scenario.toml", &long_contact()), |truth| {
            if truth.in_contact == 1 {
                readings.push(page_faults(&task));
            }
        });
        assert_never_held(&truths);
        let (first, last) = (readings[0], readings[readings.len() - 1]);
        println!("{first:?} at first contact, {last:?} after {} cycles", readings.len());
        assert!(readings.len() > 200, "{} cycles in contact", readings.len());
        certain(|| assert!(readings.iter().all(|faults| *faults == first), "{readings:?}"));
    });
}

/// System calls of the real-time thread over a while in contact, by name, and the cycles in that
/// while.
fn system_calls(wait: &str, told: Told) -> (BTreeMap<String, usize>, usize) {
    let ipc = PrivateIpc::new("planar");
    let daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &patient(wait, told)));
    let task = realtime_task(&daemon);
    let thread = task.file_name().and_then(|name| name.to_str()).expect("a number").to_owned();
    // A listener waits for commands: only then is there anything to notify.
    let node = ipc.settings().node("listener").expect("a node");
    let arrival = services::command_arrival(&node, &ipc.settings().instance, Access::Open).expect("the daemon made it");
    let listener = arrival.listener().expect("a listener");
    let trace = ipc.directory().join("trace");
    let mut strace = None;
    let mut cycles = 0;
    let truths = run_plant(&ipc, &write(&ipc, "scenario.toml", &long_contact()), |truth| {
        let _ = listener.try_wait(|_| {});
        let watched = truth.scenario_time_s >= 0.7 && truth.scenario_time_s < 3.0;
        if watched && strace.is_none() {
            strace = Some(Strace::attach(&thread, &trace));
        } else if watched {
            cycles += 1;
        } else if let Some(strace) = strace.take_if(|_| truth.scenario_time_s >= 3.0) {
            strace.detach();
        }
    });
    assert_never_held(&truths);
    let text = std::fs::read_to_string(&trace).expect("strace wrote it");
    let mut calls = BTreeMap::new();
    for name in text.lines().filter_map(|line| line.split_once('(').map(|(name, _)| name)) {
        *calls.entry(name.to_owned()).or_insert(0) += 1;
    }
    (calls, cycles)
}

#[test]
fn the_real_time_thread_only_waits_and_notifies() {
    undisturbed(|| {
        if !needs(Need::Strace) || !needs(Need::Root) {
            return;
        }
        // Largest number of each that a cycle needs: to block, to take the notification and see
        // that it was the last, and again that none has come meanwhile, to notify. `hybrid` comes
        // to blocking only when a sample is late.
        let event = &[("ppoll", 1), ("recvfrom", 3), ("sendto", 1)][..];
        let hybrid = &[event, &[("clock_nanosleep", 1)]].concat()[..];
        let waits =
            [("event", event, Told::Stiffness), ("hybrid", hybrid, Told::Stiffness), ("event", event, Told::Range)];
        for (wait, accepted, told) in waits {
            let (calls, cycles) = system_calls(wait, told);
            println!("{wait}, {told:?}: {calls:?} in {cycles} cycles");
            assert!(cycles >= 100, "{cycles} cycles watched");
            let total: usize = calls.values().sum();
            assert!(total > 0, "strace saw nothing");
            certain(|| {
                for (name, count) in &calls {
                    let most = accepted.iter().find(|(accepted, _)| accepted == name).map(|(_, most)| most * cycles);
                    let most =
                        most.unwrap_or_else(|| panic!("{wait}: {name} is neither waiting nor notifying: {calls:?}"));
                    // strace comes and goes in the middle of a cycle.
                    assert!(*count <= most + most / 10 + 20, "{wait}: {count} times {name} in {cycles} cycles");
                }
            });
        }
    });
}
