//! What a cycle costs through the C client, beside the same cycle through the Rust one: turn by turn, in one run. A
//! stand-in answers each sample at once, outside of what is measured; nobody listens to the notification.
//!
//! `cargo run --release -p admittance-client-c --example paired`

use std::ffi::CString;
use std::ptr::null_mut;
use std::time::Instant;

use admittance_client::{Arm, Controller, Limits};
use admittance_client_c::{
    ABI_VERSION, Client, Instruction, Options, Status, admittance_client_apply, admittance_client_begin,
    admittance_client_close, admittance_client_make_ready, admittance_client_open, admittance_client_publish,
    admittance_client_receive,
};
use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, Instance, IpcSettings, Node, Publisher, StateSample, quiet_iceoryx2};

const CYCLES: u64 = 100_000;
const WARM_UP: u64 = 1_000;
const SAMPLING_TIME_NS: u64 = 4_000_000;
const DELAY_NS: u64 = 250_000;

/// Answers what the controller asks.
struct StandIn {
    commands: Publisher<CommandSample>,
    _node: Node,
}

impl StandIn {
    fn new(settings: &IpcSettings) -> Self {
        let node = settings.node("stand-in").expect("a node");
        let service = services::command(&node, &settings.instance, Access::OpenOrCreate).expect("a service");
        Self { commands: service.publisher().expect("a publisher"), _node: node }
    }

    fn answer(&self, sequence: u64, stamp_ns: u64) {
        let mut answer = CommandSample { sequence, joint_count: 6, ..CommandSample::zeroed() };
        (answer.state_sequence, answer.state_stamp_ns) = (sequence, stamp_ns);
        answer.valid_until_ns = stamp_ns + 10 * SAMPLING_TIME_NS;
        answer.plan_length = 20;
        for step in 0..20 {
            answer.plan_end_ns[step] = (step as u64 + 1) * SAMPLING_TIME_NS;
            answer.planned_offset[step] = [0.01; 6];
        }
        self.commands.send_copy(answer).expect("a subscriber");
    }
}

/// Nanoseconds of a cycle without the stand-in's part: before the answer and after it.
fn in_rust(controller: &mut Controller, stand_in: &StandIn, stamp_ns: u64) -> u64 {
    let began = Instant::now();
    let sample = controller.begin(stamp_ns);
    let published = controller.publish(&sample);
    let before = began.elapsed();
    assert!(published);
    stand_in.answer(sample.sequence, stamp_ns);
    let began = Instant::now();
    let received = controller.receive(stamp_ns);
    let applied = controller.apply(stamp_ns + DELAY_NS);
    std::hint::black_box((applied, controller.next_change(stamp_ns + DELAY_NS)));
    let after = began.elapsed();
    assert!(matches!(received, Ok(Some(_))));
    controller.make_ready();
    (before + after).as_nanos() as u64
}

fn in_c(client: *mut Client, stand_in: &StandIn, stamp_ns: u64) -> u64 {
    let mut sample = StateSample::zeroed();
    let mut instruction = Instruction { velocity_offset: [0.0; 6], until_ns: 0, motion: 0, reserved: 0 };
    let began = Instant::now();
    // SAFETY: the handle is this thread's, and both samples are there.
    let published = unsafe {
        admittance_client_begin(client, stamp_ns, &raw mut sample);
        admittance_client_publish(client, &raw const sample)
    };
    let before = began.elapsed();
    assert_eq!(published, Status::Ok);
    stand_in.answer(sample.sequence, stamp_ns);
    let began = Instant::now();
    // SAFETY: as above.
    let received = unsafe {
        let received = admittance_client_receive(client, stamp_ns);
        admittance_client_apply(client, stamp_ns + DELAY_NS, &raw mut instruction);
        received
    };
    let after = began.elapsed();
    assert_eq!((received, std::hint::black_box(instruction).motion), (Status::Ok, 0));
    // SAFETY: as above.
    unsafe { admittance_client_make_ready(client) };
    (before + after).as_nanos() as u64
}

fn main() {
    quiet_iceoryx2();
    let directory = tempfile::Builder::new().prefix("adm-").tempdir().expect("a directory");
    let place = |instance: &str| IpcSettings {
        root_path: directory.path().join("ipc"),
        prefix: format!("paired{}_", std::process::id()),
        instance: Instance::new(instance).expect("a name"),
    };
    let (rust, c) = (place("rust"), place("c"));
    let stand_ins = [StandIn::new(&rust), StandIn::new(&c)];
    let limits = Limits { velocity_offset: [1.0; 6], joint_velocity_offset: [6.0; 8] };
    let arm = Arm { joint_count: 6, sampling_time_ns: SAMPLING_TIME_NS, command_delay_ns: DELAY_NS, limits };
    let mut controller = Controller::open(&rust, "rust", &arm, 1).expect("it opens");
    let text = |text: &str| CString::new(text).expect("no zero byte");
    let texts = [text(&c.root_path.to_string_lossy()), text(&c.prefix), text(c.instance.as_str()), text("c")];
    let options = Options {
        root_path: texts[0].as_ptr(),
        prefix: texts[1].as_ptr(),
        instance: texts[2].as_ptr(),
        name: texts[3].as_ptr(),
        sampling_time_ns: SAMPLING_TIME_NS,
        command_delay_ns: DELAY_NS,
        velocity_offset_limit: limits.velocity_offset,
        joint_velocity_offset_limit: limits.joint_velocity_offset,
        joint_count: 6,
        abi_version: ABI_VERSION,
    };
    let mut client: *mut Client = null_mut();
    // SAFETY: options and texts outlive the call, and there is room for the handle.
    let opened = unsafe { admittance_client_open(&raw const options, &raw mut client, null_mut(), 0) };
    assert_eq!(opened, Status::Ok);
    let (mut times, mut differences) = ([Vec::new(), Vec::new()], Vec::new());
    for cycle in 1..=WARM_UP + CYCLES {
        let stamp_ns = 1_000_000_000 + cycle * SAMPLING_TIME_NS;
        // Who is first changes, so that neither finds the other's caches each time.
        let (rust, c) = if cycle % 2 == 0 {
            let rust = in_rust(&mut controller, &stand_ins[0], stamp_ns);
            (rust, in_c(client, &stand_ins[1], stamp_ns))
        } else {
            let c = in_c(client, &stand_ins[1], stamp_ns);
            (in_rust(&mut controller, &stand_ins[0], stamp_ns), c)
        };
        if cycle > WARM_UP {
            times[0].push(rust);
            times[1].push(c);
            differences.push(c.cast_signed() - rust.cast_signed());
        }
    }
    // SAFETY: it is not used again.
    unsafe { admittance_client_close(client) };
    for (name, times) in ["Rust", "C"].into_iter().zip(&mut times) {
        times.sort_unstable();
        println!("{name}: p50 {} ns, p99 {} ns", times[times.len() / 2], times[times.len() * 99 / 100]);
    }
    differences.sort_unstable();
    let at = |percent: usize| differences[differences.len() * percent / 100];
    println!("C minus Rust, cycle by cycle: p50 {} ns, p90 {} ns, of {CYCLES} cycles", at(50), at(90));
}
