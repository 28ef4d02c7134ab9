//! The demo, interrupted by a person: it leaves no process and no file behind. (CI runs the whole
//! of it.)

use std::process::Command;

use end_to_end::{Child, PATIENCE, binaries, wait_until};

/// Processes whose command line contains `text`.
fn processes_with(text: &str) -> Vec<String> {
    let entries = std::fs::read_dir("/proc").expect("/proc can be read");
    entries
        .filter_map(|entry| std::fs::read_to_string(entry.ok()?.path().join("cmdline")).ok())
        .filter(|line| line.contains(text))
        .collect()
}

#[test]
fn an_interrupted_demo_leaves_nothing() {
    let directory = tempfile::tempdir().expect("a directory");
    let report = directory.path().join("report");
    let mut demo = Child::spawn(Command::new(&binaries().admittancectl).arg("demo").arg("--report").arg(&report));
    let prefix = format!("adm{:x}_", demo.id());
    wait_until("daemon and plant of the demo run", PATIENCE, || processes_with(&prefix).len() >= 2);
    demo.signal(libc::SIGINT);
    let status = demo.wait_for_exit(PATIENCE);
    assert_eq!(status.code(), Some(1), "{}", demo.report());
    assert!(demo.stderr().contains("interrupted; nothing is claimed"), "{}", demo.report());
    assert!(processes_with(&prefix).is_empty(), "{:?}", processes_with(&prefix));
    assert!(ipc_types::shared_memory_files(&prefix).expect("/dev/shm can be read").is_empty());
    assert!(!report.exists());
}
