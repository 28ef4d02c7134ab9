//! The Python package: a controller in Python beside the real daemon, a recording as arrays, and runs in virtual
//! time.

use std::path::Path;

use admittance_host::config::parse;
use end_to_end::closed_loop::{Experiment, MPC_DEFAULT};
use end_to_end::python_package::run;
use end_to_end::session::{MPC_PAPER, PAPER_SCENARIO, PATIENT, start_daemon, with_keys, write};
use end_to_end::{Need, PATIENCE, PrivateIpc, binaries, needs, undisturbed};

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
    try:
        admittance.StateSample().wrench_vald = 1
        raise SystemExit("a field that is none was set")
    except AttributeError as error:
        assert "wrench_vald" in str(error), error
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

#[test]
fn a_simulation_from_python_is_virtual_time_to_the_bit() {
    if !needs(Need::Python) || !needs(Need::CToolchain) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let [config, scenario] = [("daemon.toml", MPC_DEFAULT), ("scenario.toml", PAPER_SCENARIO)]
        .map(|(name, text)| write(&ipc, name, text).to_string_lossy().into_owned());
    let experiment = Experiment {
        config: parse(MPC_DEFAULT, "daemon.toml").expect("shipped"),
        scenario: parse(PAPER_SCENARIO, "scenario.toml").expect("shipped"),
    };
    let instants = experiment.run().instants;
    let expected = serde_json::json!({
        "wrench": instants.iter().map(|at| at.state.wrench).collect::<Vec<_>>(),
        "velocity_offset": instants.iter().map(|at| at.command.velocity_offset).collect::<Vec<_>>(),
        "peak": instants.iter().map(|at| at.truth.peak_normal_force_n).collect::<Vec<_>>(),
    });
    let expected = write(&ipc, "expected.json", &expected.to_string()).to_string_lossy().into_owned();
    let script = r#"
import json, pathlib, sys
import numpy as np
import admittance

config, scenario, program, expected = sys.argv[1:]
expected = json.loads(pathlib.Path(expected).read_text())
out = pathlib.Path(config).with_name("kept.mcap")
runs = [admittance.simulate(config, scenario, program=program), admittance.simulate(config, scenario, program=program, out=out)]
for run in runs:
    for key, found in (("wrench", run.wrench), ("velocity_offset", run.velocity_offset), ("peak", run.truth.peak_normal_force_n)):
        assert found.tobytes() == np.array(expected[key], float).tobytes(), key
    assert {"Free", "Contact"} <= set(run.command.mode) and "[contact]" in run.configuration
assert np.array_equal(admittance.Recording(out).wrench, runs[0].wrench)
for failing, code, words in (
    ((config, "none.toml"), 66, "none.toml"),
    ((scenario, scenario), 78, "scenario.toml"),
):
    try:
        admittance.simulate(*failing, program=program)
        raise SystemExit(f"{failing} was simulated")
    except admittance.SimulationFailed as failure:
        assert failure.code == code and words in str(failure), failure
try:
    admittance.simulate(config, scenario, program="no-such-program")
    raise SystemExit("a program that is none was found")
except FileNotFoundError as error:
    assert "no-such-program" in str(error) and "cargo build" in str(error), error
try:
    # The sources alone bring no program, whatever PATH has.
    admittance.simulate(config, scenario)
    raise SystemExit("a program that is not there was run")
except FileNotFoundError as error:
    assert "a wheel of this package brings it" in str(error), error
print(len(runs[0].wrench), "samples, peak", max(expected["peak"]), "N")
"#;
    let program = binaries().admittancectl.to_string_lossy();
    println!("{}", run(&ipc, script, &[&config, &scenario, &program, &expected]));
}

#[test]
fn what_an_operator_asks_from_python_is_answered_or_refused_with_the_reason() {
    if !needs(Need::Python) || !needs(Need::CToolchain) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let settings = ipc.settings();
    // Both ends are found by the file alone, as on a machine with one robot.
    let root_path = format!("{:?}", settings.root_path.to_string_lossy());
    let [prefix, instance] = [settings.prefix.as_str(), settings.instance.as_str()].map(|name| format!("{name:?}"));
    let place =
        [("ipc.root_path", root_path.as_str()), ("ipc.prefix", prefix.as_str()), ("ipc.instance", instance.as_str())];
    let config = write(&ipc, "daemon.toml", &with_keys(MPC_PAPER, &[&PATIENT[..], &place].concat()));
    let mut daemon = start_daemon(&ipc, &config);
    let script = r#"
import sys
import admittance

config, program = sys.argv[1:]
found = admittance.status(config=config, program=program)
assert found["mode"] == "Idle" and found["version"] >= 1, found
said = admittance.request("disable", config=config, program=program)
assert "disabled" in said.lower(), said
assert "disabled" in admittance.request("status", config=config, program=program).lower()
admittance.request("enable", config=config, program=program)
for kind, arguments, code, words in (
    ("reset", (), 1, "Stopped"),
    ("set-force-limit", ("x=fast",), 64, "fast"),
    ("no-such-request", (), 64, "no-such-request"),
):
    try:
        raise SystemExit(f"{kind} was answered: {admittance.request(kind, *arguments, config=config, program=program)}")
    except admittance.RequestFailed as failure:
        assert failure.code == code and words in str(failure), (kind, failure.code, str(failure))
print(said)
"#;
    let program = binaries().admittancectl.to_string_lossy();
    let config = config.to_string_lossy();
    println!("{}", run(&ipc, script, &[&config, &program]));
    daemon.signal(libc::SIGKILL);
    daemon.wait_for_exit(PATIENCE);
    let script = r#"
import sys
import admittance

config, program = sys.argv[1:]
try:
    raise SystemExit(f"nobody said {admittance.status(config=config, program=program)}")
except admittance.RequestFailed as failure:
    assert failure.code == 69, (failure.code, str(failure))
    print(failure)
"#;
    println!("{}", run(&ipc, script, &[&config, &program]));
}
