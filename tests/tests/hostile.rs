//! `admittance-lab hostile` finds what is broken: daemons that are broken on purpose, each in one of
//! the ways in which none may be.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::{PrivateIpc, binaries};

/// Attacks a daemon that this script plays: `$daemon` is the real one, `$@` its arguments, `$2` its
/// file.
fn attacked(kind: &str, script: &str) -> (Option<i32>, String) {
    let ipc = PrivateIpc::new("planar");
    let program = player(ipc.directory(), script);
    let mut lab = Command::new(&binaries().admittance_lab);
    lab.args(["hostile", "--seed", "1", "--index", "0", "--daemon"]).arg(program).arg(kind);
    // What is found is kept there for a person to look at.
    lab.env("TMPDIR", ipc.directory());
    let output = lab.output().expect("it starts");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

fn player(directory: &Path, script: &str) -> PathBuf {
    let program = directory.join("daemon");
    let daemon = binaries().admittanced.display();
    std::fs::write(&program, format!("#!/bin/sh\nset -eu\ndaemon={daemon}\n{script}\n")).expect("written");
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("its own file");
    program
}

#[test]
fn what_is_broken_on_purpose_is_found() {
    let broken: [(&str, &str, &str); 5] = [
        (
            "samples",
            "sed -i 's/^max_sample_age_s = .*/max_sample_age_s = 1.0/' \"$2\"; exec $daemon \"$@\"",
            "a sample was used that has an age above max_sample_age_s",
        ),
        ("samples", "unset WATCHDOG_USEC; exec $daemon \"$@\"", "the watchdog was not fed for"),
        ("requests", "echo 'thread panicked' >&2; exec $daemon \"$@\"", "the daemon: thread panicked"),
        ("restarts", "exec $daemon --version", "the daemon process ended with exit status: 0"),
        // A newcomer reads the first file, whatever there is by now.
        (
            "configurations",
            "file=$2; [ -e $file.first ] || cp $file $file.first; shift 2; \
             case $* in *newcomer*) file=$file.first;; esac; exec $daemon --config $file \"$@\"",
            "a daemon starts with what validate refuses",
        ),
    ];
    for (kind, script, expected) in broken {
        let (code, text) = attacked(kind, script);
        println!("{text}");
        assert_eq!((code, text.contains(expected)), (Some(1), true), "{kind} of {script}: {text}");
        assert!(text.contains(&format!("FOUND: admittance-lab hostile {kind} --seed 1 --index 0")), "{text}");
    }
}

/// The same of admittance-egm, which `$edge` is.
fn edge_attacked(script: &str) -> (Option<i32>, String) {
    let ipc = PrivateIpc::new("planar");
    let edge = binaries().admittance_egm.display();
    let program = player(ipc.directory(), &format!("edge={edge}\n{script}"));
    let mut lab = Command::new(&binaries().admittance_lab);
    lab.args(["hostile", "--seed", "1", "--index", "0", "--datagrams", "4000", "--edge"]).arg(program).arg("egm");
    lab.env("TMPDIR", ipc.directory());
    let output = lab.output().expect("it starts");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

#[test]
fn an_edge_that_is_broken_on_purpose_is_found() {
    let broken = [
        ("echo 'thread panicked' >&2; exec $edge \"$@\"", "the edge: thread panicked"),
        ("(sleep 2; kill $$) & exec $edge \"$@\"", "the edge process ended with exit status: 0"),
    ];
    for (script, expected) in broken {
        let (code, text) = edge_attacked(script);
        println!("{text}");
        assert_eq!((code, text.contains(expected)), (Some(1), true), "{script}: {text}");
        assert!(text.contains("FOUND: admittance-lab hostile egm --seed 1 --index 0 --datagrams 4000"), "{text}");
    }
    let (code, text) = edge_attacked("exec $edge \"$@\"");
    assert_eq!((code, text.contains("found in 0")), (Some(0), true), "{text}");
}

#[test]
fn a_daemon_that_is_not_broken_is_none_of_it() {
    let (code, text) = attacked("restarts", "exec $daemon \"$@\"");
    assert_eq!((code, text.contains("found in 0")), (Some(0), true), "{text}");
}

#[test]
fn damages_of_recordings_are_counted_by_how_they_are_read() {
    let mut lab = Command::new(&binaries().admittance_lab);
    let output = lab.args(["hostile", "recordings", "--seed", "1", "--recordings", "200"]).output().expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!((output.status.code(), text.contains("200 damaged")), (Some(0), true), "{text}");
}
