//! `admittancectl set-force-limit`, `set-environment` and `set-law`.

use admittance_core::quantities::AXIS_NAMES;
use admittance_runner::config::LawName;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use ipc_types::{Law, RequestKind, RequestSample};

use super::{request, tell};
use crate::Exit;
use crate::target::Target;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Within requests.force_limit_min and _max of the configuration; in every mode. Below the present force the daemon \
    reduces it if that is feasible, and stops at a low force if not. It lasts until a reload or a restart.\n\nExamples:\n  \
    admittancectl set-force-limit x=120 y=120 --instance cell-3\n  admittancectl set-force-limit z=80 --config cell.toml"
)]
pub(crate) struct SetForceLimitArgs {
    /// Axis (x y z rx ry rz) and its limit in N, of rx ry rz in N m.
    #[arg(required = true, value_name = "AXIS=LIMIT", value_parser = axis_and_value)]
    limits: Vec<(usize, f64)>,
    #[command(flatten)]
    target: Target,
}

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Within the bounds of [requests] in the configuration; not in contact. It lasts until a reload or a restart.\n\n\
    Examples:\n  admittancectl set-environment --stiffness 2e4 --instance cell-3\n  \
    admittancectl set-environment --normal 0 0 1 --contact-point 0.4 0.1 0.02 --instance cell-3"
)]
#[group(id = "environment", required = true, multiple = true, args = ["stiffness", "normal", "contact_point"])]
pub(crate) struct SetEnvironmentArgs {
    /// Stiffness along the surface normal in N/m.
    #[arg(long, value_name = "N/M")]
    stiffness: Option<f64>,
    /// Outward surface normal, base frame; any length above zero.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    normal: Option<Vec<f64>>,
    /// Position of the TCP at first contact in m, base frame.
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    contact_point: Option<Vec<f64>>,
    #[command(flatten)]
    target: Target,
}

/// The laws by the names that the configuration gives them.
fn laws() -> impl TypedValueParser<Value = Law> {
    let name = |law: &Law| LawName::of(*law).name();
    PossibleValuesParser::new(Law::ALL.iter().map(name))
        .map(move |text| *Law::ALL.iter().find(|law| name(law) == text).expect("one of the names that are accepted"))
}

#[derive(Debug, clap::Args)]
#[command(
    after_help = "With requests.law = true in the configuration; not in contact. It lasts until a reload or a restart.\n\nExample:\n  \
    admittancectl set-law damping --instance cell-3"
)]
pub(crate) struct SetLawArgs {
    /// The law from now on.
    #[arg(value_parser = laws())]
    law: Law,
    #[command(flatten)]
    target: Target,
}

fn axis_and_value(text: &str) -> Result<(usize, f64), String> {
    let accepted =
        || format!("accepted: AXIS=LIMIT with an axis of {} and a number, such as x=120", AXIS_NAMES.join(" "));
    let (axis, value) = text.split_once('=').ok_or_else(accepted)?;
    let axis = AXIS_NAMES.iter().position(|name| *name == axis).ok_or_else(accepted)?;
    Ok((axis, value.parse().map_err(|_| accepted())?))
}

/// Puts values into a request from `first` on.
fn give(request: &mut RequestSample, first: usize, values: &[f64]) {
    for (index, value) in (first..).zip(values) {
        request.values[index] = *value;
        request.given |= 1 << index;
    }
}

pub(crate) fn set_force_limit(args: &SetForceLimitArgs) -> Result<Exit, (Exit, String)> {
    let mut wanted = request(RequestKind::SetForceLimit);
    for (axis, value) in &args.limits {
        give(&mut wanted, *axis, &[*value]);
    }
    tell(&args.target, wanted)
}

pub(crate) fn set_environment(args: &SetEnvironmentArgs) -> Result<Exit, (Exit, String)> {
    let mut wanted = request(RequestKind::SetEnvironment);
    give(&mut wanted, 0, args.stiffness.as_slice());
    give(&mut wanted, 1, args.normal.as_deref().unwrap_or_default());
    give(&mut wanted, 4, args.contact_point.as_deref().unwrap_or_default());
    tell(&args.target, wanted)
}

pub(crate) fn set_law(args: &SetLawArgs) -> Result<Exit, (Exit, String)> {
    tell(&args.target, RequestSample { law: args.law.code(), ..request(RequestKind::SetLaw) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_name_their_axis() {
        assert_eq!(axis_and_value("x=120"), Ok((0, 120.0)));
        assert_eq!(axis_and_value("rz=2.5"), Ok((5, 2.5)));
        for text in ["", "x", "w=3", "x=", "x=many"] {
            assert!(axis_and_value(text).is_err_and(|why| why.contains("accepted: AXIS=LIMIT")), "{text}");
        }
    }
}
