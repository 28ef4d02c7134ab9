//! What the daemon is configured with, and what the plant plays, in one touch.

use toml::{Table, Value};

use crate::keys::{parsed, set};

use super::injection::{CONTACT_S, Fault, PRESSES_S, RETREATS_S, STANDS_AT_MOST_S, Touch};
use admittancectl::Outcome;
use admittancectl::demo::{CONTROLLERS, SCENARIO};

/// T_s in s, and what the daemon has of it for its answer: a busy machine is to disturb few
/// touches.
const SAMPLING_TIME_S: f64 = 0.004;
const ANSWER_BUDGET_S: f64 = 0.002;
/// Of the plant before its motion, s.
pub(super) const SETTLE_S: f64 = 0.3;
/// The paper's surface, outward.
const NORMAL: [f64; 2] = [0.422_618_261_740_699_44, 0.906_307_787_036_649_9];
/// Speed of the retreat that the motion controller commands, m/s.
const RETREAT_M_S: f64 = 0.1;

/// A configuration of the daemon for surfaces of this stiffness, N/m.
pub(crate) fn config(stiffness: f64) -> Outcome<String> {
    let mut table = parsed(CONTROLLERS[3].config)?;
    let keys = [
        ("control", "sampling_time_s", SAMPLING_TIME_S),
        ("control", "command_delay_s", ANSWER_BUDGET_S),
        ("control", "answer_budget_s", ANSWER_BUDGET_S),
        ("control", "max_sample_age_s", 4.0 * SAMPLING_TIME_S),
        ("environment", "normal_stiffness_n_m", stiffness),
    ];
    keys.iter().for_each(|(section, key, value)| set(&mut table, section, key, *value));
    Ok(table.to_string())
}

/// What the plant plays: the touch, with this going wrong.
pub(super) fn scenario(touch: &Touch, fault: Option<Fault>) -> Outcome<String> {
    let mut table = parsed(SCENARIO)?;
    let keys = [
        ("timing", "sampling_time_s", SAMPLING_TIME_S),
        ("timing", "command_delay_s", ANSWER_BUDGET_S),
        ("timing", "settle_s", SETTLE_S),
        ("start", "contact_time_s", CONTACT_S),
        ("start", "contact_phase", touch.contact_phase),
        ("surface", "stiffness_n_m", touch.stiffness_n_m),
    ];
    keys.iter().for_each(|(section, key, value)| set(&mut table, section, key, *value));
    let away = NORMAL.map(|n| n * RETREAT_M_S);
    let phases = [(PRESSES_S, [0.0, -touch.speed_m_s]), (RETREATS_S, away), (STANDS_AT_MOST_S, [0.0, 0.0])];
    let phase = |(duration, twist): (f64, [f64; 2])| {
        let twist = Value::Array(twist.map(Value::Float).to_vec());
        Value::Table(Table::from_iter([("duration_s".to_owned(), duration.into()), ("twist".to_owned(), twist)]))
    };
    table.insert("motion".to_owned(), Value::Array(phases.map(phase).to_vec()));
    if let Some(Fault::Scripted(kind)) = fault {
        let fault = Table::from_iter([
            ("at_s".to_owned(), touch.at_s.into()),
            ("duration_s".to_owned(), touch.duration_s.into()),
            ("kind".to_owned(), kind.name().into()),
        ]);
        table.insert("fault".to_owned(), Value::Array(vec![Value::Table(fault)]));
    }
    Ok(table.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::injection::Draw;
    use super::*;

    #[test]
    fn what_is_drawn_are_valid_files() {
        let mut draw = Draw::new(1, Fault::all());
        for _ in 0..40 {
            let touch = draw.touch();
            let config = config(touch.stiffness_n_m).expect("valid");
            let config = admittance_host::config::parse(&config, "daemon.toml");
            let config: admittance_runner::config::Config = config.expect("valid");
            admittance_runner::cycle::build(&config).expect("a controller");
            let scenario = scenario(&touch, Some(touch.fault)).expect("valid");
            let scenario = admittance_host::config::parse(&scenario, "scenario.toml").expect("valid");
            plant_sim::run::VirtualRun::new(&scenario).expect("a plant");
        }
    }
}
