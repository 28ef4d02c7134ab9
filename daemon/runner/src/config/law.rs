//! What the law cannot live with, by the names of its keys. The law itself checks it.

use admittance_core::with_arm;
use admittance_core::{ParameterError, Parameters};
use admittance_host::config::ConfigError;

use super::Config;
use crate::parameters::parameters;
use crate::task_frame::TaskFrame;

/// Lets the law check what it would be built from; of what is not acceptable by itself nothing can be
/// built.
pub(super) fn check_law(config: &Config, errors: &mut Vec<ConfigError>) {
    if !errors.is_empty() {
        return;
    }
    let (joints, axes) = (config.robot.joint.len(), config.robot.task_axes);
    let checked = with_arm!((joints, axes), <N, D> => {
        let parameters = parameters::<N, D>(config, config.inputs_per_cycle());
        parameters.map_or(Ok(()), |parameters: Parameters<N, D>| TaskFrame::of(config).see(&parameters).check())
    }, else Ok(()));
    if let Err(error) = checked {
        let (key, value) = named(config, error);
        errors.push(ConfigError::new(key, value, accepted(config, error)));
    }
}

/// The key that is at fault, or the first of them, and its value.
fn named(config: &Config, error: ParameterError) -> (&'static str, String) {
    let contact = &config.contact;
    match error {
        ParameterError::Horizon => ("mpc.horizon", format!("{:?}", config.mpc.horizon)),
        ParameterError::SamplingTime => ("control.sampling_time_s", config.control.sampling_time_s.to_string()),
        ParameterError::TimeConstant => {
            ("robot.velocity_time_constant_s", format!("{:?}", config.robot.velocity_time_constant_s))
        }
        ParameterError::VelocityLoops => ("robot.velocity_loop", "as given".to_owned()),
        ParameterError::AdmittanceAxes => ("contact.admittance_axes", format!("{:?}", contact.admittance_axes)),
        ParameterError::InputWeight => ("mpc.input_weight", format!("{:?}", config.mpc.input_weight)),
        ParameterError::Thresholds => ("contact.release_threshold", format!("{:?}", contact.release_threshold)),
        ParameterError::ForceLimit => ("contact.force_limit", format!("{:?}", contact.force_limit)),
        ParameterError::Damping => ("damping.damping_n_s_m", "as given".to_owned()),
        ParameterError::MinimumForce => ("contact.minimum_force", format!("{:?}", contact.minimum_force)),
        ParameterError::Detection | ParameterError::MotorTorque => {
            ("contact.wrench_time_constant_s", format!("{:?}", contact.wrench_time_constant_s))
        }
        ParameterError::WrenchDeadTime => ("contact.wrench_dead_time_s", contact.wrench_dead_time_s.to_string()),
        ParameterError::DriveLimits => {
            ("limits.joint_acceleration_rad_s2", format!("{:?}", config.limits.joint_acceleration_rad_s2))
        }
        ParameterError::Storage => ("mpc.horizon", format!("{:?}", config.mpc.horizon)),
    }
}

fn accepted(config: &Config, error: ParameterError) -> String {
    let contact = &config.contact;
    match error {
        ParameterError::MinimumForce => format!(
            "on every axis with a component n of environment.surface_normal more than contact.release_threshold = {:?}, and \
             the largest minimum_force / |n| below the smallest force_limit / |n| (contact.force_limit = {:?}); or \
             contact.lower_bound = \"always\"",
            contact.release_threshold, contact.force_limit
        ),
        ParameterError::Detection => "one value on all axes with a component of environment.surface_normal, and \
             contact.wrench_dead_time_s = 0, with environment.contact = \"detected\" or environment.stiffness_range_n_m"
            .to_owned(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use admittance_host::config::parse;

    use super::*;

    /// The file's own checks find it before; a law would have no inputs for it.
    #[test]
    fn no_more_axes_give_way_than_the_arm_has_joints() {
        let text = include_str!("../../../../deploy/robots/planar-three.toml");
        let mut config: Config = parse(text, "planar-three.toml").unwrap();
        for (giving_way, is_accepted) in [(3, true), (4, false)] {
            let axes = &mut config.contact.admittance_axes;
            (0..axes.len()).for_each(|axis| axes[axis] = axis < giving_way);
            let mut errors = Vec::new();
            check_law(&config, &mut errors);
            let said: String = errors.iter().map(ToString::to_string).collect();
            assert_eq!(said.is_empty(), is_accepted, "{giving_way}: {said}");
            assert!(is_accepted || said.contains("contact.admittance_axes") && said.contains("joints"), "{said}");
        }
    }
}
