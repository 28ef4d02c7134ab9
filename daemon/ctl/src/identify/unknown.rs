//! What a recording cannot tell, and what motion would.

use admittance_core::quantities::AXIS_NAMES;
use admittance_runner::config::Config;
use serde::Serialize;

use super::found::Found;
use super::told::{COMMAND_DELAY, HARD, LIVELY, Quantity, REPORT_LAG, STIFFNESS, WRENCH_DEAD_TIME, WRENCH_LAG};

/// A joint has to reach this speed to show its loop, rad/s.
pub(super) const LEAST_SPEED_RAD_S: f64 = 0.02;
/// An axis whose part of the normal is smaller felt too little.
pub(super) const LEAST_NORMAL: f64 = 0.1;

/// Something that is not known.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Unknown {
    pub(super) what: String,
    pub(super) why: String,
    pub(super) motion: String,
}

/// Task axes on which a touch shows a force.
pub(super) fn loaded(config: &Config, axis: usize) -> bool {
    let normal = super::touch::normal(config);
    axis < 3 && normal[axis].abs() > LEAST_NORMAL
}

/// All of it, with what was noted already.
pub(super) fn unknown(config: &Config, found: &Found) -> Vec<Unknown> {
    let is_noted = |what: &Quantity| found.unknown.iter().any(|noted| noted.what == what.what);
    let mut all = found.unknown.clone();
    let mut say = |what: String, why: &str, motion: &str| {
        all.push(Unknown { what, why: why.to_owned(), motion: motion.to_owned() });
    };
    for (number, joint) in found.loops.joints.iter().enumerate().filter(|(_, joint)| !joint.is_told) {
        let why = if joint.range_rad_s < LEAST_SPEED_RAD_S {
            "it hardly moves"
        } else {
            "its speed changes too little for its noise, or whenever it does the daemon adds an offset"
        };
        say(format!("joint {number}: time constant, dead time and order"), why, LIVELY);
    }
    if !found.loops.report_lag_s.half_width.is_finite() {
        say(REPORT_LAG.what.to_owned(), "no joint shows it", REPORT_LAG.motion);
    }
    if found.command_delay_s.is_none() && !is_noted(&COMMAND_DELAY) {
        let why = "in free motion the daemon adds no offset, and only an offset acts late; what delays the twist reference is in \
                   the joints' dead time";
        say(COMMAND_DELAY.what.to_owned(), why, "a touch under control");
    }
    if found.impact_stiffness_n_m.is_some_and(|impact| !impact.has_an_end()) {
        let why = "the touches are explained by ever harder surfaces too, behind gears that give";
        let motion = "touches at 0.05 m/s and more, whose forces are ten times the noise within 20 ms";
        say("how hard the surface may be in an impact".to_owned(), why, motion);
    }
    let is_noted = is_noted(&STIFFNESS) || is_noted(&WRENCH_LAG) || is_noted(&WRENCH_DEAD_TIME);
    if found.stiffness_n_m.is_none() && !is_noted {
        let why = if found.touches.is_empty() {
            "nothing was touched, or a recording begins in the touch"
        } else {
            "the touches are too short or too soft"
        };
        say("stiffness, and lag and dead time of the wrench".to_owned(), why, HARD);
    } else if found.wrench_time_constant_s.is_some() {
        let axes = (0..config.robot.task_axes as usize).filter(|axis| !loaded(config, *axis));
        let names: Vec<&str> = axes.map(|axis| AXIS_NAMES[axis]).collect();
        if !names.is_empty() {
            let motion = "a touch on a surface that is tilted towards them";
            say(format!("the lag of the wrench on {}", names.join(" ")), "the touch did not load them", motion);
        }
    }
    all
}
