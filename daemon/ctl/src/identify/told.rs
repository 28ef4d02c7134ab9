//! Which of the values that were found are worth to be told: an interval that is wide beside what the
//! value changes tells nothing, and a value that cannot be has a cause.

use admittance_runner::config::{Config, GivenInName, WrenchSourceName};
use serde::Serialize;

use super::estimate::Estimate;
use super::text::with_interval;
use super::tool::FoundTool;
use super::unknown::Unknown;

/// Something that is told with an interval.
pub(super) struct Quantity {
    pub(super) what: &'static str,
    /// An interval of this half-width tells it whatever its value; a quarter of the value does so too.
    pub(super) narrow: f64,
    /// From the unit of the key to that which is printed.
    factor: f64,
    unit: &'static str,
    /// What would tell it.
    pub(super) motion: &'static str,
}

const fn in_ms(what: &'static str, narrow: f64, motion: &'static str) -> Quantity {
    Quantity { what, narrow, factor: 1e3, unit: "ms", motion }
}

pub(super) const LIVELY: &str =
    "free motion in which every joint changes its speed by 0.1 rad/s or more (0.1 m/s where it slides), a dozen times";
pub(super) const HARD: &str = "a touch of half a second with 20 N or more, and ten times the noise";

pub(super) const COMMAND_DELAY: Quantity = in_ms("the command delay", 2e-4, HARD);
pub(super) const REPORT_LAG: Quantity = in_ms("the lag of the reported joint velocities", 5e-4, LIVELY);
pub(super) const JOINT_DEAD_TIME: Quantity = in_ms("dead time", 5e-4, LIVELY);
pub(super) const WRENCH_LAG: Quantity = in_ms("the lag of the wrench", 5e-4, HARD);
pub(super) const WRENCH_DEAD_TIME: Quantity = in_ms("the dead time of the wrench", 5e-4, HARD);
pub(super) const DAMPING: Quantity = Quantity { what: "damping", narrow: 0.05, factor: 1.0, unit: "", motion: LIVELY };
pub(super) const STIFFNESS: Quantity =
    Quantity { what: "the stiffness", narrow: 0.0, factor: 1e-3, unit: "N/mm", motion: HARD };
const CENTER: Quantity = Quantity {
    what: "the centre of gravity of the tool",
    narrow: 0.01,
    factor: 1e3,
    unit: "mm",
    motion: "rests of half a second with the tool turned by 30 degrees or more about two axes",
};
const BIAS: [Quantity; 2] = [
    Quantity { what: "the bias of the forces", narrow: 0.5, factor: 1.0, unit: "N", ..CENTER },
    Quantity { what: "the bias of the torques", narrow: 0.1, factor: 1.0, unit: "N m", ..CENTER },
];

impl Quantity {
    /// Whether the interval is narrow beside what the value changes.
    pub(super) fn tells(&self, found: &Estimate) -> bool {
        found.value.is_finite() && found.half_width <= self.narrow.max(0.25 * found.value.abs())
    }

    /// The value where it is told; else it is noted with its interval, if that has an end.
    pub(super) fn told(&self, found: Option<Estimate>, unknown: &mut Vec<Unknown>) -> Option<Estimate> {
        let found = found?;
        if self.tells(&found) {
            return Some(found);
        }
        if found.half_width.is_finite() {
            let interval = with_interval(&found, self.factor, self.unit);
            let narrow = if self.narrow > 0.0 {
                format!("+- {:?} {} or a quarter of the value", self.narrow * self.factor, self.unit)
            } else {
                "a quarter of the value".to_owned()
            };
            let why = format!("{interval} is too wide an interval, told is within {narrow}");
            unknown.push(Unknown { what: self.what.to_owned(), why, motion: self.motion.to_owned() });
        }
        None
    }
}

/// What is told of tool and sensor.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ToldTool {
    pub(super) mass_kg: Option<Estimate>,
    /// In the frame of the TCP.
    pub(super) center_of_gravity_m: Option<[Option<Estimate>; 3]>,
    /// None on what the sensor does not show.
    pub(super) bias: [Option<Estimate>; 6],
    /// Standard deviation on one axis of x y z, N.
    pub(super) noise_n: Estimate,
}

/// What is told; the rest is noted.
pub(super) fn tool(config: &Config, found: Option<&FoundTool>, unknown: &mut Vec<Unknown>) -> Option<ToldTool> {
    let what = "mass and centre of gravity of the tool, bias and noise of the wrench";
    let mut say = |what: &str, why: String, motion: &str| {
        unknown.push(Unknown { what: what.to_owned(), why, motion: motion.to_owned() });
    };
    if config.wrench.source == WrenchSourceName::MotorTorque {
        // What is left of such a wrench in free motion is what [dynamics] is off by.
        let why = "wrench.source = \"motor_torque\": no sensor is looked at, and the tool belongs to the last link"
            .to_owned();
        say(what, why, "a wrench that the samples give");
        return None;
    }
    let Some(found) = found else {
        say(what, "too few samples of free motion have a wrench that can be used".to_owned(), "a second of it");
        return None;
    };
    let free = "free motion that touches nothing, recorded with control.start_enabled = false";
    let forces = &config.contact.activation_threshold[..(config.robot.task_axes as usize).min(3)];
    let threshold = forces.iter().copied().fold(f64::INFINITY, f64::min);
    if found.noise_n.value > threshold {
        let noise = found.noise_n.value;
        let why = format!(
            "{noise:.0} N are left of the forces, above contact.activation_threshold of {threshold:?} N: something pressed on the \
             arm in what was taken for free motion"
        );
        say(what, why, free);
        return None;
    }
    let mass = found.mass_kg;
    if mass.value + mass.half_width < 0.0 {
        let mass = mass.value;
        let why = format!(
            "the mass would be below zero, {mass:.2} kg: something pressed on the arm in what was taken for free motion, or \
             wrench.sign or wrench.gravity_m_s2 is told wrongly"
        );
        say(what, why, free);
        return None;
    }
    if !found.is_told {
        let (why, motion) = if config.wrench.given_in == GivenInName::Base {
            (
                "the wrench is given in the base frame, where a bias looks like a weight; quick starts and stops tell them apart",
                "starts and stops of the tool at 1 m/s^2 or more",
            )
        } else {
            ("its weight and a bias look the same in one orientation", CENTER.motion)
        };
        say("mass and centre of gravity of the tool", why.to_owned(), motion);
        return Some(ToldTool { mass_kg: None, center_of_gravity_m: None, bias: [None; 6], noise_n: found.noise_n });
    }
    Some(ToldTool {
        mass_kg: Some(Estimate { value: mass.value.max(0.0), ..mass }),
        center_of_gravity_m: found.center_of_gravity_m.map(|all| all.map(|one| CENTER.told(Some(one), unknown))),
        bias: [0, 1, 2, 3, 4, 5].map(|of| BIAS[of / 3].told(Some(found.bias[of]), unknown)),
        noise_n: found.noise_n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_interval_is_not_told_and_noted() {
        let mut unknown = Vec::new();
        let mut told = |of: &Quantity, value: f64, half: f64| of.told(Some(Estimate::new(value, half)), &mut unknown);
        assert!(told(&WRENCH_LAG, 0.02, 0.004).is_some() && told(&COMMAND_DELAY, 0.0, 1e-4).is_some());
        assert!(told(&WRENCH_LAG, 0.0, 1.5).is_none() && told(&COMMAND_DELAY, 0.0007, 0.0015).is_none());
        assert!(told(&STIFFNESS, 1e5, f64::INFINITY).is_none() && told(&STIFFNESS, f64::NAN, 1.0).is_none());
        let said: Vec<&str> = unknown.iter().map(|unknown| unknown.what.as_str()).collect();
        assert_eq!(said[..2], ["the lag of the wrench", "the command delay"]);
        assert!(unknown[1].why.starts_with("0.7 +- 1.5 ms is too wide"), "{}", unknown[1].why);
    }
}
