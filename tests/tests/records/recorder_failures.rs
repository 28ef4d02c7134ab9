//! A recorder that is killed, or cannot write.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use end_to_end::session::{ctl_command, output, run_plant, start_daemon, write};
use end_to_end::{Child, PATIENCE, PrivateIpc, undisturbed};
use ipc_types::services::{self, Access};
use ipc_types::{RecordSample, TruthSample};

use crate::python_reader::read_with_python;
use crate::{number_before, paper_scenario, patient_default, replay, start_recorder};

#[test]
fn a_killed_recorder_leaves_what_it_had_flushed() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &patient_default());
        let mut daemon = start_daemon(&ipc, &config);
        let file = ipc.directory().join("killed.mcap");
        let mut recorder = start_recorder(&ipc, &config, &file);
        let truths = run_plant(&ipc, &paper_scenario(&ipc), |truth| {
            if truth.scenario_time_s > 1.5 {
                recorder.signal(libc::SIGKILL);
            }
        });
        assert_eq!(recorder.wait_for_exit(PATIENCE).code(), None, "killed");
        assert!(daemon.exit_status().is_none(), "{}", daemon.report());
        let before = truths.iter().filter(|truth| truth.scenario_time_s <= 1.5).count() as u64;
        let (code, text) = replay(&file);
        assert_eq!(code, Some(0), "{text}");
        assert!(text.contains("breaks off"), "{text}");
        let compared = number_before(&text, " cycles, bit-identical");
        println!("{compared} of {before} cycles before the kill are readable");
        // A recorder that only writes at its end, or full chunks, would have left nothing.
        assert!(compared > 200 && compared <= before + 20, "{compared} of {before}: {text}");
        read_with_python(&file, false);
    });
}

#[test]
fn a_recorder_that_cannot_write_says_so_and_the_daemon_goes_on() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &patient_default());
        let record = |file: &str, more: &[&str]| output(ctl_command(&ipc, "record", &config).arg(file).args(more));
        let (code, text) = record("x.mcap", &[]);
        assert_eq!((code, text.contains("is admittanced running")), (Some(69), true), "{text}");
        let mut daemon = start_daemon(&ipc, &config);
        let (code, text) = record("/no/such/directory/x.mcap", &[]);
        assert_eq!((code, text.contains("/no/such/directory/x.mcap")), (Some(73), true), "{text}");
        let existing = write(&ipc, "existing.mcap", "precious");
        let (code, text) = record(&existing.to_string_lossy(), &[]);
        assert_eq!((code, text.contains("--overwrite")), (Some(73), true), "{text}");
        assert_eq!(std::fs::read_to_string(&existing).expect("it is there"), "precious");
        // A disk that is full.
        let (code, text) = record("/dev/full", &["--overwrite"]);
        assert_eq!((code, text.contains("No space left")), (Some(74), true), "{text}");
        let (code, text) = record(&existing.to_string_lossy(), &["--overwrite", "--seconds", "0.2"]);
        assert_eq!((code, text.contains(" records; gaps: 0,")), (Some(0), true), "{text}");
        let (code, text) = replay(&existing);
        assert_eq!((code, text.contains("no cycle can be compared")), (Some(65), true), "{text}");
        let (code, text) = replay(&config);
        assert_eq!((code, text.contains("not an MCAP file")), (Some(65), true), "{text}");
        daemon.terminate();
        assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    });
}

/// What comes faster than it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Flood {
    Records,
    /// Of a plant, with no record at all.
    Truths,
}

/// Its disk may be slow, or the machine busy: an end, and a chunk in time, need a look at the clock between two records.
#[test]
fn a_recorder_to_which_records_come_faster_than_it_writes_ends_when_it_should() {
    ends_when_it_should(Flood::Records);
}

#[test]
fn a_recorder_to_which_truths_come_faster_than_it_writes_ends_when_it_should() {
    ends_when_it_should(Flood::Truths);
}

fn ends_when_it_should(flood: Flood) {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", &patient_default());
    let settings = ipc.settings();
    let is_over = &AtomicBool::new(false);
    let (publishes, publishing) = mpsc::channel();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let node = settings.node("test").expect("a node");
            let service = services::record(&node, &settings.instance, Access::OpenOrCreate).expect("a service");
            let publisher = service.publisher().expect("there is no daemon");
            let truths = services::truth(&node, &settings.instance, Access::OpenOrCreate).expect("a service");
            let truths = truths.publisher().expect("there is no plant");
            publishes.send(()).expect("it is waited for");
            // A thousand in a millisecond, which nothing turns into JSON.
            for sequence in 1.. {
                if is_over.load(Ordering::Relaxed) {
                    break;
                }
                // A full buffer is what this is about.
                let _ = match flood {
                    Flood::Records => {
                        publisher.send_copy(RecordSample { boot_id: 1, sequence, ..RecordSample::zeroed() })
                    }
                    Flood::Truths => truths.send_copy(TruthSample { sequence, ..TruthSample::zeroed() }),
                };
                if sequence % 1000 == 0 {
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
        });
        publishing.recv().expect("a publisher: there is no daemon");
        let end = |mut recorder: Child| {
            let status = recorder.wait_for_exit(PATIENCE);
            (status.code(), recorder.stdout(), recorder.stderr())
        };
        let ended = catch_unwind(AssertUnwindSafe(|| {
            let file = |name: &str| ipc.directory().join(name);
            let mut by_time = ctl_command(&ipc, "record", &config);
            let by_time = end(Child::spawn(by_time.arg(file("seconds.mcap")).args(["--seconds", "0.5"])));
            let mut recorder = start_recorder(&ipc, &config, &file("signal.mcap"));
            // It is in the middle of it.
            let begun = std::fs::metadata(file("signal.mcap")).expect("it is there").len();
            recorder.wait_until("a chunk", PATIENCE, |_| {
                std::fs::metadata(file("signal.mcap")).is_ok_and(|now| now.len() > begun + 10_000)
            });
            recorder.signal(libc::SIGINT);
            [by_time, end(recorder)]
        }));
        is_over.store(true, Ordering::Relaxed);
        for (code, said, remarks) in ended.unwrap_or_else(|failure| resume_unwind(failure)) {
            println!("{said}");
            // It tells of gaps among records alone.
            let (is_counted, is_gap) = (number_before(&said, " records;") > 0, remarks.contains("gap: "));
            let are_records = flood == Flood::Records;
            assert_eq!((code, is_counted, is_gap), (Some(0), are_records, are_records), "{said} {remarks}");
        }
    });
}
