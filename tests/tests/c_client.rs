//! The C client as it is installed: its libraries and headers, and a motion controller in C beside the real daemon.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use end_to_end::c_controller::{Library, TruthRelay, command_of, compile, controller_command, installed, link};
use end_to_end::session::{MPC_PAPER, PAPER_SCENARIO, PATIENT, output, start_daemon, wait_for_log, with_keys, write};
use end_to_end::{Child, Need, PATIENCE, PrivateIpc, needs, undisturbed};
use ipc_types::services::{self, Access};
use ipc_types::{Motion, TruthSample};

const DELAY: (&str, &str) = ("timing.command_delay_s", "0.001");

#[test]
fn the_examples_compile_as_c_and_as_cpp_without_a_warning_and_views_are_spans() {
    if !needs(Need::CToolchain) {
        return;
    }
    compile("gcc", &["-std=c11", "-x", "c"], "controller.c", "controller-c11");
    compile("g++", &["-std=c++17", "-x", "c++"], "controller.c", "controller-cpp");
    let ipc = PrivateIpc::new("planar");
    let settings = ipc.settings();
    for standard in ["-std=c++17", "-std=c++20"] {
        let program = compile("g++", &[standard, "-x", "c++"], "raii.cpp", &format!("raii{standard}"));
        let mut command = Command::new(program);
        command.arg(&settings.root_path).args([&settings.prefix, settings.instance.as_str()]);
        let (code, text) = output(&mut command);
        assert_eq!(code, Some(0), "{standard}: {text}");
        assert!(text.contains("limit of velocity_offset[1] = 0: accepted: above 0"), "{standard}: {text}");
    }
}

#[test]
fn the_shared_library_shows_what_the_header_declares_each_with_its_version() {
    if !needs(Need::CToolchain) {
        return;
    }
    let library = installed().join("lib/libadmittance_client.so");
    let (code, symbols) = output(Command::new("nm").args(["-D", "--defined-only"]).arg(library));
    assert_eq!(code, Some(0), "{symbols}");
    let mut shown: Vec<&str> =
        symbols.lines().filter_map(|line| line.split_once(" T ").map(|(_, name)| name)).collect();
    shown.sort_unstable();
    let header = std::fs::read_to_string(installed().join("include/admittance_client.h")).expect("installed");
    let declared = header.lines().filter(|line| !line.starts_with([' ', '/', '#', '*']));
    let mut declared: Vec<String> = declared
        .filter_map(|line| line.split_once('(').and_then(|(before, _)| before.rsplit([' ', '*']).next()))
        .map(|name| format!("{name}@@ADMITTANCE_CLIENT_1"))
        .collect();
    declared.sort_unstable();
    assert_eq!(shown, declared);
}

/// The controller's truth of one motion, while `each` may do something.
fn drive(ipc: &PrivateIpc, scenario: &Path, each: impl FnMut(&TruthSample)) -> (Vec<TruthSample>, String) {
    let relay = TruthRelay::new(ipc);
    watch(ipc, controller_command(ipc, scenario, &relay), each)
}

/// The truth of this controller's motion.
fn watch(ipc: &PrivateIpc, mut controller: Command, mut each: impl FnMut(&TruthSample)) -> (Vec<TruthSample>, String) {
    let node = ipc.settings().node("test").expect("a node");
    let truths = services::truth(&node, &ipc.settings().instance, Access::OpenOrCreate).expect("a service");
    let truths = truths.subscriber().expect("a subscriber");
    let mut controller = Child::spawn(&mut controller);
    let mut series = Vec::new();
    let patience = Instant::now() + PATIENCE;
    loop {
        let ended = controller.exit_status();
        while let Ok(Some(truth)) = truths.receive() {
            each(&truth);
            series.push(*truth);
        }
        if ended.is_some() {
            break;
        }
        assert!(Instant::now() < patience, "the motion does not end: {}", controller.report());
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(controller.exit_status().and_then(|status| status.code()), Some(0), "{}", controller.report());
    (series, controller.stderr())
}

#[test]
fn a_controller_in_c_touches_and_slides_within_the_limit() {
    touches_and_slides(Library::Shared, "gcc", &["-std=c11", "-O2"]);
}

/// The library is in the program then, and pkg-config knows what it wants besides.
#[test]
fn a_controller_with_the_static_library_does_so_as_well() {
    touches_and_slides(Library::Static, "gcc", &["-std=c11", "-O2"]);
}

#[test]
fn a_controller_that_is_compiled_as_cpp_does_so_as_well() {
    touches_and_slides(Library::Shared, "g++", &["-std=c++17", "-O2", "-x", "c++"]);
}

fn touches_and_slides(library: Library, compiler: &str, arguments: &[&str]) {
    undisturbed(|| {
        if !needs(Need::CToolchain) {
            return;
        }
        let program = link(library, compiler, arguments, "controller.c", &format!("controller-{library:?}-{compiler}"));
        let (code, wanted) = output(Command::new("readelf").arg("--dynamic").arg(&program));
        assert_eq!(code, Some(0), "{wanted}");
        assert_eq!(wanted.contains("[libadmittance_client.so.1]"), library == Library::Shared, "{wanted}");
        let ipc = PrivateIpc::new("planar");
        let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &PATIENT)));
        let scenario = write(&ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[DELAY]));
        let relay = TruthRelay::new(&ipc);
        let (truths, said) = watch(&ipc, command_of(&program, &ipc, &scenario, &relay), |_| {});
        let peak = truths.iter().map(|truth| truth.peak_wrench[1].abs()).fold(0.0, f64::max);
        let last = truths.last().expect("a run");
        println!("peak |f_y| {peak:.1} N, {} cycles, {} missed", truths.len(), last.missed_commands);
        assert_eq!(said, "", "nothing is refused");
        // As `the_papers_experiment_keeps_the_limit_and_the_contact` accepts of plant-sim.
        assert!(peak > 50.0 && peak <= 230.0, "{peak} N");
        assert_eq!((last.contact_losses, last.in_contact), (0, 1));
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}

#[test]
fn a_controller_in_c_holds_without_its_daemon_and_goes_on_with_a_new_one() {
    undisturbed(|| {
        if !needs(Need::CToolchain) {
            return;
        }
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &PATIENT));
        let mut daemon = Some(start_daemon(&ipc, &config));
        let motion = "[{ duration_s = 2.5, twist = [0.0, -0.02] }]";
        let changes = [DELAY, ("motion", motion), ("start.contact_time_s", "20.0")];
        let scenario = write(&ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &changes));
        let (mut held, mut restarted) = (None, false);
        let (truths, said) = drive(&ipc, &scenario, |truth| {
            if truth.scenario_time_s >= 0.3
                && let Some(mut running) = daemon.take_if(|_| !restarted)
            {
                running.signal(libc::SIGKILL);
                running.wait_for_exit(PATIENCE);
            }
            if !restarted && daemon.is_none() && truth.motion == Motion::Hold.code() {
                held = Some(truth.scenario_time_s);
                restarted = true;
                daemon = Some(start_daemon(&ipc, &config));
            }
        });
        let held = held.expect("it holds when the plan has ended");
        let last = truths.last().expect("a run");
        println!("held at {held:.3} s; {} missed", last.missed_commands);
        assert_eq!((last.motion, said.as_str()), (Motion::Offset.code(), ""), "it goes on");
        let speed = |truth: &TruthSample| truth.tcp_twist[1];
        assert!((speed(last) + 0.02).abs() < 1e-3, "{} m/s", speed(last));
        let mut daemon = daemon.expect("started anew");
        wait_for_log(&mut daemon, "Free");
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}

#[test]
fn between_measuring_and_following_there_is_one_system_call_and_no_allocation() {
    if !needs(Need::CToolchain) || !needs(Need::Strace) {
        return;
    }
    let program = compile("gcc", &["-std=c11", "-O2", "-x", "c"], "fence.c", "fence");
    let ipc = PrivateIpc::new("planar");
    let _daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &PATIENT)));
    let (settings, trace) = (ipc.settings(), ipc.directory().join("trace"));
    let run = |work: &str| {
        let mut command = Command::new("strace");
        command.args(["-f", "-o"]).arg(&trace).arg(&program).arg(&settings.root_path);
        command.args([&settings.prefix, settings.instance.as_str(), work]);
        let (code, text) = output(&mut command);
        let trace = std::fs::read_to_string(&trace).expect("strace has written it");
        // The program marks the beginning and the end of its cycles by asking for its parent.
        let words = trace.lines().filter_map(|line| line.split_whitespace().nth(1));
        let calls: Vec<&str> = words.filter(|word| !word.starts_with("<...")).collect();
        let mut parts = calls.split(|call| call.starts_with("getppid("));
        let inside: Vec<String> = parts.nth(1).expect("marked").iter().map(|&call| call.to_owned()).collect();
        assert!(parts.next().is_some(), "the end is marked too: {trace}");
        (code, text, inside)
    };
    let (code, text, calls) = run("cycle");
    assert_eq!(code, Some(0), "{text}");
    println!("{text}{} system calls in 250 cycles", calls.len());
    // None where the daemon woke by itself and has yet to take the notification before.
    assert!(calls.len() <= 251 && calls.iter().all(|call| call.starts_with("send")), "{calls:?}");
    // The fence sees what it is there for.
    let (code, text, calls) = run("spoilt");
    assert_eq!((code, text.contains("allocations")), (Some(1), true), "{text}");
    assert_eq!(calls.iter().filter(|call| call.starts_with("getpid(")).count(), 250, "{calls:?}");
}
