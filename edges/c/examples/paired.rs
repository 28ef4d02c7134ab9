//! What a cycle costs through the C client, beside the same cycle through the Rust one: turn by turn, in one run. A
//! stand-in, a process of its own, answers each sample at once, outside of what is measured; nobody listens to the notification.
//!
//! `cargo run --release -p admittance-client-c --example paired`: the C functions are linked into this program.
//! `cargo run --release -p admittance-client-c --example paired -- PREFIX/lib/libadmittance_client.so`: they are those of the
//! library as it was installed, and called by their addresses in it.

use std::ffi::{CStr, CString, OsStr, OsString, c_char, c_void};
use std::io::{BufRead, BufReader};
use std::mem::transmute;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::ptr::null_mut;
use std::time::{Duration, Instant};

use admittance_client::{Arm, Controller, Limits};
use admittance_client_c::{
    ABI_VERSION, Client, Instruction, Options, Status, admittance_client_apply, admittance_client_begin,
    admittance_client_close, admittance_client_make_ready, admittance_client_open, admittance_client_publish,
    admittance_client_receive,
};
use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, Instance, IpcSettings, Node, Publisher, StateSample, Subscriber, quiet_iceoryx2};

const CYCLES: u64 = 100_000;
const WARM_UP: u64 = 1_000;
const SAMPLING_TIME_NS: u64 = 4_000_000;
const DELAY_NS: u64 = 250_000;

/// Answers what one controller asks.
struct StandIn {
    states: Subscriber<StateSample>,
    commands: Publisher<CommandSample>,
    _node: Node,
}

impl StandIn {
    fn new(settings: &IpcSettings) -> Self {
        let node = settings.node("stand-in").expect("a node");
        let states = services::state(&node, &settings.instance, Access::OpenOrCreate).expect("a service");
        let commands = services::command(&node, &settings.instance, Access::OpenOrCreate).expect("a service");
        Self {
            states: states.subscriber().expect("a subscriber"),
            commands: commands.publisher().expect("a publisher"),
            _node: node,
        }
    }

    fn answer(&self) {
        let Ok(Some(state)) = self.states.receive() else { return };
        let (sequence, stamp_ns) = (state.sequence, state.stamp_ns);
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

/// A process of its own, since a process has one iceoryx2 in one place: with the shared library there are two in the other one.
fn stand_in(root_path: &OsStr, prefix: &OsStr) -> ! {
    let places = ["rust", "c"].map(|instance| place(Path::new(root_path), &prefix.to_string_lossy(), instance));
    let both = places.each_ref().map(StandIn::new);
    println!("ready");
    loop {
        both.iter().for_each(StandIn::answer);
    }
}

fn place(root_path: &Path, prefix: &str, instance: &str) -> IpcSettings {
    IpcSettings {
        root_path: root_path.to_owned(),
        prefix: format!("{prefix}{instance}_"),
        instance: Instance::new(instance).expect("a name"),
    }
}

/// What came, and how long the call took that brought it.
fn awaited<T>(mut receive: impl FnMut() -> Option<T>) -> (Duration, T) {
    loop {
        let began = Instant::now();
        let received = receive();
        let elapsed = began.elapsed();
        if let Some(received) = received {
            return (elapsed, received);
        }
    }
}

type Open = unsafe extern "C" fn(*const Options, *mut *mut Client, *mut c_char, usize) -> Status;
type Begin = unsafe extern "C" fn(*mut Client, u64, *mut StateSample) -> Status;
type Publish = unsafe extern "C" fn(*mut Client, *const StateSample) -> Status;
type Receive = unsafe extern "C" fn(*mut Client, u64) -> Status;
type Apply = unsafe extern "C" fn(*mut Client, u64, *mut Instruction) -> Status;
type MakeReady = unsafe extern "C" fn(*mut Client) -> Status;
type Close = unsafe extern "C" fn(*mut Client);

/// What is called in C.
struct Functions {
    open: Open,
    begin: Begin,
    publish: Publish,
    receive: Receive,
    apply: Apply,
    make_ready: MakeReady,
    close: Close,
}

impl Functions {
    fn linked() -> Self {
        Self {
            open: admittance_client_open,
            begin: admittance_client_begin,
            publish: admittance_client_publish,
            receive: admittance_client_receive,
            apply: admittance_client_apply,
            make_ready: admittance_client_make_ready,
            close: admittance_client_close,
        }
    }

    /// Those of a shared library, which has an iceoryx2 of its own beside this program's.
    fn of(library: &OsStr) -> Self {
        let path = CString::new(library.as_bytes()).expect("no zero byte");
        // SAFETY: the path ends in a zero byte; the library is this project's, and is never closed.
        let handle = unsafe { libc::dlopen(path.as_ptr(), libc::RTLD_NOW) };
        assert!(!handle.is_null(), "{}: it cannot be loaded", library.display());
        let address = |name: &CStr| {
            // SAFETY: the handle is open, and the name ends in a zero byte.
            let address = unsafe { libc::dlsym(handle, name.as_ptr()) };
            assert!(!address.is_null(), "{name:?} is not in {}", library.display());
            address
        };
        // SAFETY: each function has the type that the header, which is written from these declarations, gives it.
        unsafe {
            Self {
                open: transmute::<*mut c_void, Open>(address(c"admittance_client_open")),
                begin: transmute::<*mut c_void, Begin>(address(c"admittance_client_begin")),
                publish: transmute::<*mut c_void, Publish>(address(c"admittance_client_publish")),
                receive: transmute::<*mut c_void, Receive>(address(c"admittance_client_receive")),
                apply: transmute::<*mut c_void, Apply>(address(c"admittance_client_apply")),
                make_ready: transmute::<*mut c_void, MakeReady>(address(c"admittance_client_make_ready")),
                close: transmute::<*mut c_void, Close>(address(c"admittance_client_close")),
            }
        }
    }
}

/// Nanoseconds of a cycle without the stand-in's part: until the sample is out, the call that brings the answer, and what is
/// done with it.
fn in_rust(controller: &mut Controller, stamp_ns: u64) -> u64 {
    let began = Instant::now();
    let sample = controller.begin(stamp_ns);
    let published = controller.publish(&sample);
    let before = began.elapsed();
    assert!(published);
    let (received, _) = awaited(|| controller.receive(stamp_ns).expect("a sound answer").map(|_| ()));
    let began = Instant::now();
    let applied = controller.apply(stamp_ns + DELAY_NS);
    std::hint::black_box((applied, controller.next_change(stamp_ns + DELAY_NS)));
    let after = began.elapsed();
    controller.make_ready();
    (before + received + after).as_nanos() as u64
}

fn in_c(c: &Functions, client: *mut Client, stamp_ns: u64) -> u64 {
    let mut sample = StateSample::zeroed();
    let mut instruction = Instruction { velocity_offset: [0.0; 6], until_ns: 0, motion: 0, reserved: 0 };
    let began = Instant::now();
    // SAFETY: the handle is this thread's, and both samples are there.
    let published = unsafe {
        (c.begin)(client, stamp_ns, &raw mut sample);
        (c.publish)(client, &raw const sample)
    };
    let before = began.elapsed();
    assert_eq!(published, Status::Ok);
    let (received, _) = awaited(|| {
        // SAFETY: as above.
        let status = unsafe { (c.receive)(client, stamp_ns) };
        assert!(matches!(status, Status::Ok | Status::NoAnswer), "{status:?}");
        (status == Status::Ok).then_some(())
    });
    let began = Instant::now();
    // SAFETY: as above.
    unsafe { (c.apply)(client, stamp_ns + DELAY_NS, &raw mut instruction) };
    let after = began.elapsed();
    assert_eq!(std::hint::black_box(instruction).motion, 0);
    // SAFETY: as above.
    unsafe { (c.make_ready)(client) };
    (before + received + after).as_nanos() as u64
}

/// A process that does not outlive this one's work.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        // It may have ended in the meantime: then there is nothing to kill.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() {
    quiet_iceoryx2();
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    if let [role, root_path, prefix] = &arguments[..]
        && role == "--stand-in"
    {
        stand_in(root_path, prefix);
    }
    let library = arguments.first();
    let functions = library.as_ref().map_or_else(Functions::linked, |library| Functions::of(library));
    let directory = tempfile::Builder::new().prefix("adm-").tempdir().expect("a directory");
    let (root_path, prefix) = (directory.path().join("ipc"), format!("p{}", std::process::id()));
    let [rust, c] = ["rust", "c"].map(|instance| place(&root_path, &prefix, instance));
    let mut stand_in = Command::new(std::env::current_exe().expect("this program has a path"));
    stand_in.arg("--stand-in").arg(&root_path).arg(&prefix).stdout(Stdio::piped());
    let mut stand_in = Ended(stand_in.spawn().expect("it starts"));
    let mut ready = String::new();
    BufReader::new(stand_in.0.stdout.take().expect("piped")).read_line(&mut ready).expect("it is ready");
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
    let opened = unsafe { (functions.open)(&raw const options, &raw mut client, null_mut(), 0) };
    assert_eq!(opened, Status::Ok);
    let (mut times, mut differences) = ([Vec::new(), Vec::new()], Vec::new());
    for cycle in 1..=WARM_UP + CYCLES {
        let stamp_ns = 1_000_000_000 + cycle * SAMPLING_TIME_NS;
        // Who is first changes, so that neither finds the other's caches each time.
        let (rust, c) = if cycle % 2 == 0 {
            let rust = in_rust(&mut controller, stamp_ns);
            (rust, in_c(&functions, client, stamp_ns))
        } else {
            let c = in_c(&functions, client, stamp_ns);
            (in_rust(&mut controller, stamp_ns), c)
        };
        if cycle > WARM_UP {
            times[0].push(rust);
            times[1].push(c);
            differences.push(c.cast_signed() - rust.cast_signed());
        }
    }
    // SAFETY: it is not used again.
    unsafe { (functions.close)(client) };
    for (name, times) in ["Rust", "C"].into_iter().zip(&mut times) {
        times.sort_unstable();
        println!("{name}: p50 {} ns, p99 {} ns", times[times.len() / 2], times[times.len() * 99 / 100]);
    }
    let whose = library.map_or("linked into this program".to_owned(), |library| format!("of {}", library.display()));
    println!("the C functions are {whose}");
    differences.sort_unstable();
    let at = |percent: usize| differences[differences.len() * percent / 100];
    println!(
        "C minus Rust, cycle by cycle: p50 {} ns, p90 {} ns, p99 {} ns, of {CYCLES} cycles",
        at(50),
        at(90),
        at(99)
    );
}
