//! A recorder that is killed, or cannot write.

use end_to_end::session::{ctl_command, output, run_plant, start_daemon, write};
use end_to_end::{PATIENCE, PrivateIpc, undisturbed};

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
