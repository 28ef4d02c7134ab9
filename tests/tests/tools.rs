//! What programs do when what they print has no reader, the machine lacks what they need, their
//! terminal goes, or there is far too much to log.

use std::fs::File;
use std::io::Read;
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use admittance_host::clock::monotonic_ns;
use end_to_end::session::{
    MPC_PAPER, PAPER_SCENARIO, ctl_command, daemon_command, output, plant_command, start_daemon, wait_for_log, write,
};
use end_to_end::{Child, Need, PATIENCE, PrivateIpc, binaries, needs, take_terminal, wait_until};
use ipc_types::services::{self, Access};
use ipc_types::{StateSample, VirtualPlant as _};
use plant_sim::run::VirtualRun;

/// A pipe that nobody reads.
fn closed_pipe() -> Stdio {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    writer.into()
}

fn ctl(words: &[&str]) -> Command {
    let mut command = Command::new(&binaries().admittancectl);
    command.args(words);
    command
}

#[test]
fn without_a_reader_a_tool_ends_quietly() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let mut daemon = start_daemon(&ipc, &config);
    let file = config.to_str().expect("its path is text");
    let of_daemon = |words: &str, more: &[&str]| {
        let mut command = ctl_command(&ipc, words, &config);
        command.args(more);
        command
    };
    let mut lab = Command::new(&binaries().admittance_lab);
    lab.args(["flood", "--seconds", "1", "--config", file, "--root-path"]).arg(&ipc.settings().root_path);
    lab.args(["--prefix", &ipc.settings().prefix]);
    let tools = [
        of_daemon("status", &[]),
        of_daemon("status", &["--json"]),
        of_daemon("reset", &[]),
        ctl(&["validate", file]),
        ctl(&["schema"]),
        ctl(&["doctor"]),
        lab,
    ];
    for mut tool in tools {
        let Output { status, stderr, .. } = tool.stdout(closed_pipe()).output().expect("it starts");
        let stderr = String::from_utf8_lossy(&stderr);
        assert_eq!((status.signal(), &*stderr), (Some(libc::SIGPIPE), ""), "{tool:?}: {status}");
        // Nor does it matter who reads the complaints.
        let status = tool.stdout(closed_pipe()).stderr(closed_pipe()).status().expect("it starts");
        assert_eq!(status.signal(), Some(libc::SIGPIPE), "{tool:?}: {status}");
    }
    // A full disk is no reader that has gone.
    let full = || File::options().write(true).open("/dev/full").expect("every Linux has it");
    let Output { status, stderr, .. } = of_daemon("status", &[]).stdout(full()).output().expect("it starts");
    let stderr = String::from_utf8_lossy(&stderr);
    assert_eq!(status.code(), Some(74), "{stderr}");
    assert!(stderr.starts_with("admittancectl: stdout: No space left on device"), "{stderr}");
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
}

#[test]
fn a_daemon_whose_log_nobody_reads_goes_on() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let mut daemon =
        daemon_command(&ipc, &config).stdin(Stdio::null()).stderr(closed_pipe()).spawn().expect("it starts");
    let status = || output(ctl_command(&ipc, "status", &config).arg("--json"));
    wait_until("an answer", PATIENCE, || status().0 == Some(0));
    let id = daemon.id().cast_signed();
    // SAFETY: kill touches no memory of this process; the id is that of its own child, not reaped.
    let signal = |signal| unsafe { libc::kill(id, signal) };
    signal(libc::SIGHUP);
    let (code, text) = output(&mut ctl_command(&ipc, "reset", &config));
    assert_eq!(code, Some(1), "{text}");
    assert_eq!(status().0, Some(0));
    signal(libc::SIGTERM);
    assert_eq!(daemon.wait().expect("it is a child").code(), Some(0));
}

/// Every program that connects, with the words that let it.
fn programs(ipc: &PrivateIpc, config: &Path) -> Vec<Command> {
    let scenario = write(ipc, "scenario.toml", PAPER_SCENARIO);
    let mut record = ctl_command(ipc, "record", config);
    record.arg(ipc.directory().join("record.mcap"));
    let requests = ["status", "reset", "enable", "disable", "tare", "reload"];
    let mut programs: Vec<_> = requests.iter().map(|words| ctl_command(ipc, words, config)).collect();
    programs.extend([record, daemon_command(ipc, config), plant_command(ipc, &scenario)]);
    programs
}

/// What a program says in a shell that this script has prepared.
fn in_a_shell(script: &str, program: &Command) -> (Option<i32>, String) {
    let mut shell = Command::new("unshare");
    shell.args(["--mount", "--propagation", "private", "--", "sh", "-euc", &format!("{script}; exec \"$@\""), "sh"]);
    output(shell.arg(program.get_program()).args(program.get_args()))
}

#[test]
fn what_the_machine_lacks_is_said_by_every_program() {
    if !needs(Need::Root) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let full = "mount -t tmpfs -o size=64k tmpfs /dev/shm; head -c 64k /dev/zero >/dev/shm/full";
    let lacking = [
        (full, "/dev/shm is full: it has 0 bytes free, accepted: at least "),
        ("ulimit -n 16", "too few file descriptors: "),
    ];
    for (script, expected) in lacking {
        for program in programs(&ipc, &config) {
            let (code, text) = in_a_shell(script, &program);
            assert_eq!((code, text.contains(expected)), (Some(69), true), "{program:?} after {script}: {text}");
            assert_eq!(text.lines().filter(|line| !line.contains("INFO")).count(), 1, "just that: {text}");
        }
    }
}

/// Both ends of a new terminal, which no program inherits unasked: the first one's only owner can
/// make it go.
fn terminal() -> (File, File) {
    let open = |path: &str| File::options().read(true).write(true).custom_flags(libc::O_NOCTTY).open(path);
    let master = open("/dev/ptmx").expect("every Linux has it");
    let size = libc::winsize { ws_row: 40, ws_col: 110, ws_xpixel: 0, ws_ypixel: 0 };
    let mut number = -1;
    // SAFETY: the descriptor is open; of both requests the first reads a size and the second writes
    // a number, which are valid for that.
    let done = unsafe {
        [
            libc::unlockpt(master.as_raw_fd()),
            libc::ioctl(master.as_raw_fd(), libc::TIOCSWINSZ, &raw const size),
            libc::ioctl(master.as_raw_fd(), libc::TIOCGPTN, &raw mut number),
        ]
    };
    assert_eq!(done, [0; 3], "no terminal: {}", std::io::Error::last_os_error());
    let slave = open(&format!("/dev/pts/{number}")).expect("just made");
    (master, slave)
}

/// Processor time of a process so far, s.
fn processor_time(process: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).expect("it runs");
    // Fields 14 and 15 of proc(5), counted from after the name, which ends field 2.
    let fields = stat.rsplit(')').next().expect("a name").split_whitespace().skip(11).take(2);
    let ticks: f64 = fields.map(|field| field.parse::<f64>().expect("a number")).sum();
    // SAFETY: it takes a number and touches no memory.
    ticks / unsafe { libc::sysconf(libc::_SC_CLK_TCK) } as f64
}

/// Runs a program on a terminal that goes once the program has drawn something. Where it is the
/// program's controlling terminal SIGHUP tells of that, else nothing does. `None` when the program
/// has to be killed.
fn on_a_terminal_that_goes(command: &mut Command, is_controlling: bool) -> Option<ExitStatus> {
    let (mut master, slave) = terminal();
    let end = || Stdio::from(slave.try_clone().expect("a descriptor is left"));
    command.stdin(end()).stdout(end()).stderr(end()).env("TERM", "xterm");
    // SAFETY: between fork and exec only async-signal-safe calls are made and nothing is allocated.
    unsafe { command.pre_exec(move || if is_controlling { take_terminal() } else { Ok(()) }) };
    let mut child = command.spawn().expect("it starts");
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    drop(slave);
    let mut drawn = [0; 4096];
    let mut text = String::new();
    while !text.contains("Counters") {
        let length = master.read(&mut drawn).expect("it draws");
        text += &String::from_utf8_lossy(&drawn[..length]);
    }
    drop(master);
    let end = Instant::now() + Duration::from_secs(20);
    let mut status = None;
    while status.is_none() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(5));
        status = child.try_wait().expect("it is a child");
    }
    // Nothing to kill where it has ended.
    let _ = child.kill();
    child.wait().expect("it is a child");
    status
}

#[test]
fn limits_says_how_far_it_is_and_when_it_will_be_done() {
    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/robots/planar.toml");
    // How far it was each time, in per cent, where it says what is left as well.
    let shares = |text: &str, left: &str| -> Vec<u32> {
        let share = |line: &str| line.split(" % of ").next()?.split_whitespace().last()?.parse().ok();
        text.split(['\r', '\n']).filter(|line| line.contains(left)).filter_map(share).collect()
    };
    let grows = |shares: Vec<u32>| shares.iter().any(|share| *share > 0) && shares.is_sorted();
    let (mut limits, _terminal) = Child::spawn_on_terminal(&mut ctl(&["limits", robot]));
    limits.wait_until("a bar", PATIENCE, |limits| grows(shares(&limits.stdout(), "s left")));
    limits.signal(libc::SIGINT);
    assert!(!limits.wait_for_exit(PATIENCE).success());
    let mut limits = Child::spawn(&mut ctl(&["limits", robot]));
    limits.wait_until("a line", PATIENCE, |limits| grows(shares(&limits.stderr(), " s left")));
    limits.signal(libc::SIGTERM);
    assert!(!limits.wait_for_exit(PATIENCE).success());
}

#[test]
fn top_ends_with_its_terminal() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let mut daemon = start_daemon(&ipc, &config);
    for is_controlling in [false, true] {
        let status = on_a_terminal_that_goes(&mut ctl_command(&ipc, "top", &config), is_controlling);
        assert_eq!(status.and_then(|status| status.code()), Some(0), "{is_controlling}: {status:?}");
    }
    for signal in [libc::SIGTERM, libc::SIGHUP] {
        let (mut top, _terminal) = Child::spawn_on_terminal(&mut ctl_command(&ipc, "top", &config));
        top.wait_until("the picture", PATIENCE, |top| top.stdout().contains("Counters"));
        // One that only waits does not spin: a share of the time, whatever the machine does meanwhile.
        let (begun, before) = (Instant::now(), processor_time(top.id()));
        std::thread::sleep(Duration::from_secs(2));
        let (used, elapsed) = (processor_time(top.id()) - before, begun.elapsed().as_secs_f64());
        println!("top used {used:.2} of {elapsed:.2} s");
        assert!(used < 0.5 * elapsed, "it spins: {used:.2} of {elapsed:.2} s");
        top.signal(signal);
        assert_eq!(top.wait_for_exit(PATIENCE).code(), Some(0), "{}", top.report());
    }
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
}

#[test]
fn of_drives_that_flap_the_log_has_some_lines_and_their_number() {
    let ipc = PrivateIpc::new("planar");
    let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", MPC_PAPER));
    let scenario = admittance_host::config::parse(PAPER_SCENARIO, "paper.toml").expect("shipped");
    let sample = *VirtualRun::new(&scenario).expect("an arm").sample().expect("it publishes");
    let node = ipc.settings().node("test").expect("a node");
    let instance = &ipc.settings().instance;
    let states = services::state(&node, instance, Access::Open).expect("the daemon's").publisher().expect("free");
    let arrived =
        services::state_arrival(&node, instance, Access::Open).expect("the daemon's").notifier().expect("free");
    let begun = monotonic_ns();
    for sequence in 1..=1500 {
        let due = begun + sequence * 4_000_000;
        admittance_host::clock::sleep_until_ns(due);
        let drives_enabled = u32::from(sequence % 2 == 0);
        let sample = StateSample { boot_id: 1, sequence, stamp_ns: monotonic_ns(), drives_enabled, ..sample };
        states.send_copy(sample).expect("sent");
        arrived.notify().expect("notified");
    }
    wait_for_log(&mut daemon, "more like this: Idle: DrivesDisabled");
    wait_for_log(&mut daemon, "more like this: Free");
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    let log = daemon.stderr();
    let told = |text: &str| {
        let more = log.lines().filter(|line| line.contains(&format!(" more like this: {text}")));
        let count = |line: &str| line.rsplit_once("count=").and_then(|(_, count)| count.trim().parse::<u64>().ok());
        more.filter_map(count).sum::<u64>()
    };
    let said = |text: &str| log.lines().filter(|line| line.contains(text) && !line.contains("more like this")).count();
    let (idle, free) = ("Idle: DrivesDisabled", "INFO Free");
    println!("{} lines and {} withheld, {} and {}", said(idle), told(idle), said(free), told("Free"));
    assert!((1..60).contains(&said(idle)) && (1..60).contains(&said(free)), "{log}");
    assert!(said(idle) as u64 + told(idle) > 200, "all are counted: {log}");
}
