//! The edge's own file and the daemon's, checked together.

use std::path::Path;
use std::process::Command;

use end_to_end::session::{output, with_keys, write};
use end_to_end::{PrivateIpc, binaries};

use crate::cell::{DAEMON, EDGE, tell_edge};

fn edge_command(ipc: &PrivateIpc, edge: &Path, daemon: &Path) -> Command {
    let mut command = Command::new(&binaries().admittance_egm);
    tell_edge(&mut command, ipc, edge, daemon);
    command
}

#[test]
fn files_are_checked_and_what_is_wrong_is_named() {
    let ipc = PrivateIpc::new("egm");
    let check = |edge: &str, daemon: &str| {
        let (edge, daemon) = (write(&ipc, "edge.toml", edge), write(&ipc, "daemon.toml", daemon));
        output(edge_command(&ipc, &edge, &daemon).arg("--check"))
    };
    assert_eq!(check(EDGE, DAEMON), (Some(0), "valid: 0.0.0.0:6510 for 192.168.125.1\n".to_owned()));
    let wrong = [
        (with_keys(EDGE, &[("egm.robot_address", "\"robot\"")]), DAEMON.to_owned(), "egm.robot_address = \"robot\""),
        (
            with_keys(EDGE, &[("egm.joint_speed_limit_deg_s", "[9.0, 9.0]")]),
            DAEMON.to_owned(),
            "has 2 values: accepted: 6",
        ),
        (
            EDGE.to_owned(),
            with_keys(DAEMON, &[("control.command_delay_s", "0.001")]),
            "control.command_delay_s = 0.001",
        ),
        (
            EDGE.to_owned(),
            format!("{DAEMON}\n[redundancy]\ndamping_factor = 0.05\ndamping_below = 0.2\n"),
            "[redundancy]: accepted with EGM: absent",
        ),
        (
            EDGE.to_owned(),
            with_keys(DAEMON, &[("limits.joint_acceleration_rad_s2", "[10.0, 10.0, 10.0, 10.0, 10.0, 10.0]")]),
            "limits.joint_acceleration_rad_s2 = [10.0",
        ),
    ];
    for (edge, daemon, expected) in wrong {
        let (code, text) = check(&edge, &daemon);
        assert_eq!(code, Some(78), "{text}");
        assert!(text.contains(expected) && text.contains("accepted"), "{text}");
    }
    let missing = Path::new("/no/such/file");
    assert_eq!(output(&mut edge_command(&ipc, missing, missing)).0, Some(66));
    assert_eq!(output(Command::new(&binaries().admittance_egm).arg("--confg")).0, Some(64));
}
