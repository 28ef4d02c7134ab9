//! Requests that change a value in force: tare, force limit, environment, law. Each within bounds
//! of `[requests]`; the new controller is built and checked here, and handed over as a whole.

use admittance_host::config::{Section as _, short};
use ipc_types::{Law, Mode, REQUEST_VALUES, RequestSample, TASK_AXES};
use nalgebra::Vector3;

use super::{Begun, Refusal, Step};
use crate::channel::{Order, OrderError, Outcome, Replacement};
use crate::service_thread::ServiceThread;
use crate::tare;
use admittance_core::quantities::{AXIS_NAMES, wrench_unit};
use admittance_runner::config::{Config, ContactPointName, LawName};
use admittance_runner::cycle;
use admittance_runner::settings::{Settings, length, point};

/// Where values of an environment are in a request.
const STIFFNESS: usize = 0;
const NORMAL: usize = 1;
const CONTACT_POINT: usize = 4;

impl ServiceThread {
    pub(super) fn set_force_limit(&mut self, request: &RequestSample) -> Begun {
        let requests = &self.config.requests;
        let (Some(min), Some(max)) = (&requests.force_limit_min, &requests.force_limit_max) else {
            return not_allowed("requests.force_limit_min and requests.force_limit_max");
        };
        let mut settings = Settings::of(&self.config);
        let mut any = false;
        for (axis, value) in given(request) {
            let (Some(min), Some(max)) = (min.get(axis), max.get(axis)) else {
                let axes = AXIS_NAMES[..min.len()].join(" ");
                let name = AXIS_NAMES.get(axis).unwrap_or(&"the last");
                return Err(Refusal::Refused(format!("this arm has no axis {name}; accepted: {axes}")));
            };
            if !(*min..=*max).contains(&value) {
                let unit = wrench_unit(axis);
                return Err(Refusal::Refused(format!(
                    "force limit {} = {} {unit}; accepted: {min} to {max} {unit} (requests.force_limit_min, _max)",
                    AXIS_NAMES[axis],
                    short(value)
                )));
            }
            settings.force_limit[axis] = value;
            any = true;
        }
        if !any {
            return Err(Refusal::Refused("no axis is given; accepted: a value for one axis or more".to_owned()));
        }
        self.change(&settings, Replacement::ForceLimit, "")
    }

    pub(super) fn set_environment(&mut self, request: &RequestSample) -> Begun {
        let (requests, file) = (&self.config.requests, &self.file.environment);
        let mut settings = Settings::of(&self.config);
        let (normal, contact_point) = (vector(request, NORMAL)?, vector(request, CONTACT_POINT)?);
        let stiffness = given(request).find(|(index, _)| *index == STIFFNESS);
        if normal.is_none() && contact_point.is_none() && stiffness.is_none() {
            let accepted = "accepted: a stiffness, a surface normal, a contact point, or several of them";
            return Err(Refusal::Refused(format!("no value is given; {accepted}")));
        }
        if let Some((_, value)) = stiffness {
            let (Some(min), Some(max)) = (requests.normal_stiffness_min_n_m, requests.normal_stiffness_max_n_m) else {
                return not_allowed("requests.normal_stiffness_min_n_m and requests.normal_stiffness_max_n_m");
            };
            if !(min..=max).contains(&value) {
                let bounds = "(requests.normal_stiffness_min_n_m, _max_n_m)";
                return Err(Refusal::Refused(format!(
                    "stiffness = {} N/m; accepted: {min} to {max} N/m {bounds}",
                    short(value)
                )));
            }
            settings.normal_stiffness = value;
        }
        if let Some(normal) = normal {
            let Some(accepted) = requests.surface_normal_angle_rad else {
                return not_allowed("requests.surface_normal_angle_rad");
            };
            let Some(unit) =
                Vector3::from(normal).try_normalize(1e-6).filter(|unit| unit.iter().all(|n| n.is_finite()))
            else {
                return Err(Refusal::Refused(format!(
                    "surface normal = {}; accepted: a vector that is not zero",
                    point(&normal)
                )));
            };
            let angle = Vector3::from(file.surface_normal).angle(&unit);
            if !(0.0..=accepted).contains(&angle) {
                return Err(Refusal::Refused(format!(
                    "surface normal = {} is {angle:.4} rad from the file's {}; accepted: at most {accepted} rad \
                     (requests.surface_normal_angle_rad)",
                    point(&normal),
                    point(&file.surface_normal)
                )));
            }
            settings.surface_normal = unit.into();
        }
        if let Some(place) = contact_point {
            let Some(accepted) = requests.contact_point_distance_m else {
                return not_allowed("requests.contact_point_distance_m");
            };
            let known = file.contact_point_m.filter(|_| file.contact == ContactPointName::Configured);
            let Some(known) = known else {
                let text =
                    "the contact point is detected, not given; accepted with environment.contact = \"configured\"";
                return Err(Refusal::Refused(text.to_owned()));
            };
            let distance = (Vector3::from(place) - Vector3::from(known)).norm();
            if !(0.0..=accepted).contains(&distance) {
                return Err(Refusal::Refused(format!(
                    "contact point = {} m is {} m from the file's {}; accepted: at most {accepted} m \
                     (requests.contact_point_distance_m)",
                    point(&place),
                    length(distance),
                    point(&known)
                )));
            }
            settings.contact_point = Some(place);
        }
        self.change(&settings, Replacement::Behaviour, "")
    }

    pub(super) fn set_law(&mut self, request: &RequestSample) -> Begun {
        if !self.config.requests.law {
            return not_allowed("requests.law = true");
        }
        let Some(law) = Law::from_code(request.law).map(LawName::of) else {
            let known: Vec<String> = Law::ALL.iter().map(|law| format!("{} ({law})", law.code())).collect();
            let text = format!("law {} is not known; accepted: {}", request.law, known.join(", "));
            return Err(Refusal::Refused(text));
        };
        let settings = Settings { law, ..Settings::of(&self.config) };
        self.change(&settings, Replacement::Behaviour, "")
    }

    pub(super) fn tare(&mut self) -> Begun {
        let Some(largest) = self.config.requests.tare_bias_max else {
            return not_allowed("requests.tare_bias_max");
        };
        let is_free = self.last.as_ref().is_some_and(|last| last.sample.command.mode == Mode::Free.code());
        if let Some(why) = Replacement::Bias.refused_in(Mode::Idle).filter(|_| !is_free) {
            return Err(Refusal::Refused(why.to_owned()));
        }
        let bias = self.free.bias(&self.config)?;
        if let Some(index) = (0..TASK_AXES).find(|index| bias[*index].abs() > largest[*index]) {
            let unit = wrench_unit(index);
            return Err(Refusal::Refused(format!(
                "the bias on {} would be {:.3} {unit}; accepted: at most {} {unit} (requests.tare_bias_max): is the tool free, and \
                 its weight configured?",
                AXIS_NAMES[index], bias[index], largest[index]
            )));
        }
        let settings = Settings { bias, ..Settings::of(&self.config) };
        self.change(&settings, Replacement::Bias, &format!("; the mean of {} samples", tare::SAMPLES))
    }

    /// Hands over a controller with other settings. The answer says what changed, and `remark`.
    fn change(&mut self, settings: &Settings, kind: Replacement, remark: &str) -> Begun {
        let changes = Settings::of(&self.config).changes(settings);
        if changes.is_empty() {
            return Ok(Step::Done(format!("nothing changed: these are the values in force{remark}")));
        }
        let mut new = self.config.clone();
        settings.apply(&mut new);
        let mut errors = Vec::new();
        new.check("", &mut errors);
        if !errors.is_empty() {
            let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
            return Err(Refusal::Refused(errors.join("; ")));
        }
        let answer = changes.join(", ") + remark;
        Self::hand_over(new, kind, |_| answer)
    }

    /// Builds the controller of a configuration to be put in force; `then` answers when it is.
    pub(super) fn hand_over(
        config: Config,
        kind: Replacement,
        then: impl FnOnce(&mut Self) -> String + 'static,
    ) -> Begun {
        let new = cycle::build(&config)?;
        Ok(Step::order(Order::Replace { new, kind }, move |service, outcome| {
            let Outcome::Replaced { unused, refused } = outcome else { return Err(OrderError::Late.into()) };
            drop(unused);
            if let Some(why) = refused {
                return Err(Refusal::Refused(format!("{why}; the values in force stay")));
            }
            service.diagnostics.configure(&config);
            service.config = config;
            Ok(then(service))
        }))
    }
}

fn not_allowed(keys: &str) -> Begun {
    Err(Refusal::Refused(format!("the configuration does not allow it; accepted with {keys}")))
}

/// Index and value of what a request gives.
fn given(request: &RequestSample) -> impl Iterator<Item = (usize, f64)> {
    (0..REQUEST_VALUES).filter(|index| request.given & (1 << index) != 0).map(|index| (index, request.values[index]))
}

/// Three values of a request from `first` on; all of them, or none.
fn vector(request: &RequestSample, first: usize) -> Result<Option<[f64; 3]>, Refusal> {
    match (request.given >> first) & 0b111 {
        0 => Ok(None),
        0b111 => Ok(Some(std::array::from_fn(|index| request.values[first + index]))),
        mask => {
            let found = mask.count_ones();
            Err(Refusal::Refused(format!("{found} of the coordinates x y z are given; accepted: all three, or none")))
        }
    }
}
