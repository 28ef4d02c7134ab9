//! What requests may change: read off a configuration, written into records, put back into a
//! configuration by a replay.

use admittance_core::quantities::{AXIS_NAMES, wrench_unit};
use admittance_host::config::short;
use ipc_types::{Law, RecordSample, TASK_AXES};

use crate::config::{Config, ContactPointName, LawName};

/// The values that requests may change, as they are in force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// control.law.
    pub law: LawName,
    /// contact.force_limit in N and N·m; 0 after the task axes.
    pub force_limit: [f64; TASK_AXES],
    /// environment.normal_stiffness_n_m.
    pub normal_stiffness: f64,
    /// environment.surface_normal, of any length above zero.
    pub surface_normal: [f64; 3],
    /// environment.contact_point_m; `None` when it is not configured but detected.
    pub contact_point: Option<[f64; 3]>,
    /// wrench.bias in N and N·m.
    pub bias: [f64; TASK_AXES],
}

impl Settings {
    /// Of a configuration.
    pub fn of(config: &Config) -> Self {
        let environment = &config.environment;
        let limit = |axis: usize| config.contact.force_limit.get(axis).copied().unwrap_or(0.0);
        Self {
            law: config.control.law,
            force_limit: std::array::from_fn(limit),
            normal_stiffness: environment.normal_stiffness_n_m,
            surface_normal: environment.surface_normal,
            contact_point: environment.contact_point_m.filter(|_| environment.contact == ContactPointName::Configured),
            bias: config.wrench.bias,
        }
    }

    /// Puts them into a configuration.
    pub fn apply(&self, config: &mut Config) {
        config.control.law = self.law;
        config.contact.force_limit.iter_mut().zip(self.force_limit).for_each(|(limit, value)| *limit = value);
        let environment = &mut config.environment;
        environment.normal_stiffness_n_m = self.normal_stiffness;
        environment.surface_normal = self.surface_normal;
        if environment.contact == ContactPointName::Configured && self.contact_point.is_some() {
            environment.contact_point_m = self.contact_point;
        }
        config.wrench.bias = self.bias;
    }

    /// Writes them into a record. A configured contact point is the one that the record holds
    /// anyway.
    pub fn write(&self, record: &mut RecordSample) {
        record.law = self.law.law().code();
        record.force_limit = self.force_limit;
        record.normal_stiffness_n_m = self.normal_stiffness;
        record.surface_normal = self.surface_normal;
        record.wrench_bias = self.bias;
    }

    /// The settings of a record; `None` if its law is unknown.
    pub fn read(record: &RecordSample) -> Option<Self> {
        Some(Self {
            law: LawName::of(Law::from_code(record.law)?),
            force_limit: record.force_limit,
            normal_stiffness: record.normal_stiffness_n_m,
            surface_normal: record.surface_normal,
            contact_point: Some(record.contact_point),
            bias: record.wrench_bias,
        })
    }

    /// What `new` changes, each as a phrase "from -> to" with its unit.
    pub fn changes(&self, new: &Self) -> Vec<String> {
        let mut changes = Vec::new();
        if self.law != new.law {
            changes.push(format!("law {} -> {}", self.law, new.law));
        }
        let mut on_axes = |what: &str, old: &[f64; TASK_AXES], new: &[f64; TASK_AXES], decimals: usize| {
            for axis in (0..TASK_AXES).filter(|axis| old[*axis] != new[*axis]) {
                let unit = wrench_unit(axis);
                changes.push(format!(
                    "{what} {} {:.decimals$} -> {:.decimals$} {unit}",
                    AXIS_NAMES[axis], old[axis], new[axis]
                ));
            }
        };
        on_axes("force limit", &self.force_limit, &new.force_limit, 1);
        on_axes("wrench bias", &self.bias, &new.bias, 3);
        if self.normal_stiffness != new.normal_stiffness {
            changes.push(format!("stiffness {:.0} -> {:.0} N/m", self.normal_stiffness, new.normal_stiffness));
        }
        if self.surface_normal != new.surface_normal {
            let (old, new) = (point(&self.surface_normal), point(&new.surface_normal));
            changes.push(format!("surface normal {old} -> {new}"));
        }
        if let (Some(old), Some(new)) = (self.contact_point, new.contact_point)
            && old != new
        {
            changes.push(format!("contact point {} -> {} m", point(&old), point(&new)));
        }
        changes
    }
}

/// "(0.1, 0.2, 0.3)".
pub fn point(values: &[f64; 3]) -> String {
    let [x, y, z] = values.map(length);
    format!("({x}, {y}, {z})")
}

/// A length in m, to 0.1 mm; one that is no length of an arm is short all the same.
pub fn length(value: f64) -> String {
    if value.abs() < 1e6 { format!("{value:.4}") } else { short(value) }
}
