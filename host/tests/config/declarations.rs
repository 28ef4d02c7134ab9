//! What a declaration tells documentation.

use admittance_host::config::{Section, keys_markdown};

use crate::sample::{Config, Joint, Law};

#[test]
fn keys_tell_all_that_was_declared() {
    let keys = Config::keys("");
    let key = |path: &str| keys.iter().find(|key| key.path == path).unwrap_or_else(|| panic!("{path}"));
    let sampling = key("control.sampling_time_s");
    assert_eq!(sampling.meaning, "Time between two samples, exactly.");
    assert_eq!((sampling.unit, sampling.range.as_str(), sampling.is_required()), (Some("s"), "0.0001 to 0.1 s", true));
    assert_eq!(key("control.horizon").default.as_deref(), Some("5"));
    assert_eq!(key("control.law").default.as_deref(), Some("\"mpc\""));
    assert_eq!(key("control.stiffness_n_per_m").range, "above 0 N/m");
    assert_eq!(key("control.stop_force_n").range, "1 to below 1000 N");
    assert_eq!(key("control.surface").default.as_deref(), Some("[[1.0, 0.0], [0.0, 1.0]]"));
    assert_eq!(key("control.surface").kind.name(), "array of 2 arrays of 2 numbers");
    assert_eq!(key("robot.joint[].length_m").range, "0 to 5 m");
    assert!(key("robot.joint").is_required());
    assert!(!key("ipc").is_required() && !key("noise").is_required() && key("control").is_required());
    assert_eq!(Joint::keys("robot.joint[]")[0].path, "robot.joint[].length_m");

    let table = keys_markdown(&keys);
    assert_eq!(table.lines().count(), keys.len() + 2);
    let row =
        "| `control.sampling_time_s` | number | s | 0.0001 to 0.1 s | required | Time between two samples, exactly. |";
    assert!(table.contains(row), "{table}");
    let row = "| `control.law` | name |  | \"mpc\" or \"high_damping\" | `\"mpc\"` | Which law runs.<br>`\"mpc\"`: The \
               predictive controller, with its verdict.<br>`\"high_damping\"`: The damping baseline (3). |";
    assert!(table.contains(row), "{table}");
}

#[test]
fn enums_know_their_names() {
    assert_eq!(Law::ALL, [Law::Mpc, Law::HighDamping]);
    assert_eq!(Law::HighDamping.name(), "high_damping");
    assert_eq!(format!("{:>5}", Law::Mpc), "  mpc");
}
