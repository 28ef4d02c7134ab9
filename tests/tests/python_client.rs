//! The Python package: a controller in Python beside the real daemon, and a recording as arrays.

use std::path::Path;
use std::process::Command;

use end_to_end::c_controller::installed;
use end_to_end::session::{MPC_PAPER, PATIENT, output, start_daemon, with_keys, write};
use end_to_end::{Need, PATIENCE, PrivateIpc, needs, python, undisturbed};

const PACKAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../edges/python/admittance");

/// Runs a script with the package as a wheel would have it: with the library beside it.
fn run(ipc: &PrivateIpc, script: &str, arguments: &[&str]) -> String {
    let packages = ipc.directory().join("packages");
    let package = packages.join("admittance");
    std::fs::create_dir_all(&package).expect("a directory");
    for entry in std::fs::read_dir(PACKAGE).expect("the package is there") {
        let path = entry.expect("it can be listed").path();
        if path.is_file() {
            std::fs::copy(&path, package.join(path.file_name().expect("a file"))).expect("copied");
        }
    }
    let library = installed().join("lib/libadmittance_client.so");
    std::fs::copy(library, package.join("libadmittance_client.so")).expect("copied");
    let mut command = Command::new(python().expect("needs(Python) found one"));
    command.env("PYTHONPATH", &packages).arg("-c").arg(script).args(arguments);
    let (code, text) = output(&mut command);
    assert_eq!(code, Some(0), "{text}");
    text
}

#[test]
fn a_controller_in_python_is_answered_and_holds_when_its_daemon_ends() {
    undisturbed(|| {
        if !needs(Need::Python) || !needs(Need::CToolchain) {
            return;
        }
        let ipc = PrivateIpc::new("planar");
        let mut daemon = start_daemon(&ipc, &write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &PATIENT)));
        let settings = ipc.settings();
        let script = r#"
import os, signal, sys, time
import admittance

root_path, prefix, instance, daemon = sys.argv[1:]
answered, in_time = 0, 0
with admittance.Client(root_path=root_path, prefix=prefix, instance=instance, joint_count=2, sampling_time_s=0.004,
                       command_delay_s=0.001, velocity_offset_limit=[1.0] * 6,
                       joint_velocity_offset_limit=[6.0, 6.0]) as client:
    assert client.newest() is None
    stamp = time.monotonic_ns() + 4_000_000
    for cycle in range(100):
        time.sleep(max(0, stamp - time.monotonic_ns()) * 1e-9)
        sample = client.begin(stamp)
        sample.joint_position[0:2] = sample.joint_position_reference[0:2] = [1.2, -1.3]
        sample.wrench_valid = sample.drives_enabled = 1
        client.publish(sample)
        while time.monotonic_ns() < stamp + 3_000_000:
            if client.receive(time.monotonic_ns()):
                answered += 1
                break
        told = client.apply(stamp + 1_000_000)
        client.make_ready()
        stamp += 4_000_000
    command = client.newest()
    assert answered > 50 and command.joint_count == 2 and not told.hold, (answered, told)
    os.kill(int(daemon), signal.SIGKILL)
    until = told.until_ns
    told = client.apply(stamp + 1_000_000_000)
    assert told.hold and set(told.velocity_offset) == {0.0}, told
    for limits in ([0.0] + [1.0] * 5, [1.0] * 5 + [float("nan")]):
        try:
            admittance.Client(root_path=root_path, prefix=prefix, instance="other", joint_count=2, sampling_time_s=0.004,
                              command_delay_s=0.001, velocity_offset_limit=limits,
                              joint_velocity_offset_limit=[1.0, 1.0])
            raise SystemExit("a limit that is none was accepted")
        except admittance.Failure as failure:
            assert "limit of velocity_offset" in str(failure), failure
    try:
        admittance.Client(root_path=root_path, prefix=prefix, instance="other", joint_count=2, sampling_time_s=0.004,
                          command_delay_s=0.001, velocity_offset_limit=[1.0] * 6, joint_velocity_offset_limit=[1.0])
        raise SystemExit("a joint without a limit was accepted")
    except ValueError as error:
        assert "joint_velocity_offset_limit: 1 values: accepted: 2" in str(error), error
print(answered, "of 100 answered")
"#;
        let arguments = [
            &settings.root_path.to_string_lossy(),
            settings.prefix.as_str(),
            settings.instance.as_str(),
            &daemon.id().to_string(),
        ];
        println!("{}", run(&ipc, script, &arguments));
        daemon.wait_for_exit(PATIENCE);
    });
}

#[test]
fn a_recording_is_arrays_of_the_numbers_that_it_holds() {
    if !needs(Need::Python) || !needs(Need::CToolchain) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/damping-high.mcap");
    // What the package says is held to what the reader of MCAP says, number by number.
    let script = r#"
import json, sys
import numpy as np
from mcap.reader import make_reader
import admittance

recording = admittance.Recording(sys.argv[1])
with open(sys.argv[1], "rb") as file:
    messages = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages(topics=["/state"])]
assert recording.wrench.shape == (len(messages), 6) and len(messages) > 10
assert np.array_equal(recording.wrench, np.array([message["wrench"] for message in messages]))
assert np.abs(recording.wrench[:, 1]).max() > 1.0
assert recording.time_s[0] == 0.0 and (np.diff(recording.time_s) > 0).all()
assert recording.velocity_offset.shape[1] == 6 and "[contact]" in recording.configuration
try:
    recording.state.wrnch
    raise SystemExit("a field that is none was found")
except AttributeError as error:
    assert "accepted" in str(error) and "wrench" in str(error), error
print(len(messages), "samples")
"#;
    println!("{}", run(&ipc, script, &[&file.to_string_lossy()]));
}
