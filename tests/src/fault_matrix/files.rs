//! The daemon's and the plant's files of a row, with and without the fault.

use super::row::{Injection, Row, Situation};
use super::run::{FAULT_AT_S, FREE_MOTION_S};
use super::{DAEMON_KEYS, SCRIPTED_S};
use crate::closed_loop::MPC_DEFAULT;
use crate::session::{PAPER_SCENARIO, with_keys};

/// When the arm touches.
const TOUCH_AT_S: &str = "0.2";

/// The daemon's file of a row.
pub(super) fn daemon_file(row: &Row) -> String {
    with_keys(MPC_DEFAULT, &[&DAEMON_KEYS[..], row.daemon].concat())
}

/// The daemon's file without its fault.
pub(super) fn sound_daemon_file() -> String {
    with_keys(MPC_DEFAULT, &DAEMON_KEYS)
}

/// The scenario of a row.
pub(super) fn scenario_file(row: &Row, situation: Situation) -> String {
    scenario(row, situation, row.scenario(situation))
}

/// The scenario without its fault.
pub(super) fn sound_scenario_file(row: &Row, situation: Situation) -> String {
    scenario(row, situation, &[])
}

fn scenario(row: &Row, situation: Situation, keys: &[(&str, &str)]) -> String {
    let line = row.timeline;
    let (motion, touch) = match situation {
        Situation::Free => {
            let speed = line.approach * 0.2;
            (
                format!(
                    "{{ duration_s = {FREE_MOTION_S:?}, twist = [0.0, {:?}] }}, {{ duration_s = 60.0, twist = [0.0, 0.0] }}",
                    -speed
                ),
                // As the scenario's guess stands: 14 cm above the surface.
                None,
            )
        }
        Situation::Contact => (
            format!(
                "{{ duration_s = {:?}, twist = [0.0, {:?}] }}, {{ duration_s = {:?}, twist = [0.016, 0.036] }}, \
                 {{ duration_s = {:?}, twist = [0.0, 0.0] }}, {{ duration_s = 60.0, twist = [0.0, -0.1] }}",
                line.press, -line.approach, line.retreat, line.rest
            ),
            Some(TOUCH_AT_S),
        ),
    };
    let motion = format!("[{motion}]");
    let fault = match row.injection {
        Injection::Scripted(kind) => {
            let at = FAULT_AT_S[usize::from(situation == Situation::Contact)];
            format!("[{{ at_s = {at:?}, duration_s = {SCRIPTED_S:?}, kind = \"{kind}\" }}]")
        }
        _ => "[]".to_owned(),
    };
    let own = [
        ("motion", motion.as_str()),
        ("fault", &fault),
        ("timing.settle_s", "0.05"),
        ("timing.command_delay_s", "0.001"),
    ];
    let mut text = with_keys(PAPER_SCENARIO, &own);
    if let Some(touch) = touch {
        text = with_keys(&text, &[("start.contact_time_s", touch)]);
    } else {
        let mut table: toml::Table = text.parse().expect("TOML");
        table["start"].as_table_mut().expect("a section").remove("contact_time_s");
        text = table.to_string();
    }
    with_keys(&text, keys)
}
