//! Configuration and scenario for the controller and the plant of a case, as texts that pass the
//! usual checks.

use std::fmt::Write as _;

use admittance_core::quantities::AXIS_NAMES;
use admittance_host::config::parse;
use admittance_runner::config::Config;
use nalgebra::Rotation3;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use super::arm::{Arm, Joint, Kind, PlanarTwo};
use super::draw::{ACTIVATION_THRESHOLD_N, AFTER_CONTACT_S, APPROACH_S, Draw, LONGEST_STOP_S};
use super::task::Frame;

/// Time at rest before the motion, in s.
const SETTLE_S: f64 = 0.02;
/// Longest step of the plant in s; the stiffest contact changes its force by 1 N in it at 0.04 m/s.
const SUBSTEP_S: f64 = 25e-6;
/// Offset limits in m/s that never bind: joint speeds are what is limited.
const OFFSET_LIMIT_M_S: f64 = 20.0;
/// β of torques, in N m.
pub(crate) const ACTIVATION_THRESHOLD_N_M: f64 = 1.0;
const LEAST_CONDITION: f64 = 0.001;

/// What the controller believes about the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Variant {
    /// What is true.
    Nominal,
    /// The truth, except for the contact point, which it has to find.
    Detected,
    /// A contact point 1 mm further out: it expects the force earlier than it comes.
    PointOut,
    /// A contact point 1 mm deeper.
    PointIn,
    /// Five times the true stiffness.
    Stiffer,
    /// A fifth of the true stiffness.
    Softer,
}

impl Variant {
    /// All, the true one first.
    pub(crate) const ALL: [Self; 6] =
        [Self::Nominal, Self::Detected, Self::PointOut, Self::PointIn, Self::Stiffer, Self::Softer];

    /// Key in JSON and heading of its column.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::Detected => "detected",
            Self::PointOut => "contact_point_plus_1mm",
            Self::PointIn => "contact_point_minus_1mm",
            Self::Stiffer => "stiffness_times_5",
            Self::Softer => "stiffness_over_5",
        }
    }

    /// (distance in m of the believed contact point along the outward normal, factor of the
    /// believed stiffness)
    fn belief(self) -> (f64, f64) {
        match self {
            Self::Nominal | Self::Detected => (0.0, 1.0),
            Self::PointOut => (0.001, 1.0),
            Self::PointIn => (-0.001, 1.0),
            Self::Stiffer => (0.0, 5.0),
            Self::Softer => (0.0, 0.2),
        }
    }
}

/// Which law the controller runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Profile {
    /// The default profile: what the study is about.
    Default,
    /// The paper's scheme exactly: Euler, five steps, axes in contact, joint-space weights, no
    /// bound but the forces.
    Paper,
}

/// The controller's configuration.
///
/// # Errors
/// What the configuration's checks say.
pub(crate) fn controller(draw: &Draw, profile: Profile, variant: Variant) -> Result<Config, String> {
    parse(&controller_text(draw, profile, variant), "controller.toml").map_err(|errors| errors.to_string())
}

/// The configuration as text. The one place where the controller's options are chosen.
pub(crate) fn controller_text(draw: &Draw, profile: Profile, variant: Variant) -> String {
    let (out_m, factor) = variant.belief();
    let (normal, point) = (draw.normal(), draw.contact_point_m());
    let sampling_time = draw.sampling_time_s;
    let axes = draw.arm.task_axes();
    let of_axes = |linear: f64, turning: f64| draw.of_axes(linear, turning);
    let minimum_force = match profile {
        Profile::Default => draw.minimum_force.clone(),
        Profile::Paper => of_axes(0.0, 0.0),
    };
    let release_threshold = match profile {
        Profile::Default => draw.release_threshold.clone(),
        Profile::Paper => of_axes(ACTIVATION_THRESHOLD_N, ACTIVATION_THRESHOLD_N_M),
    };
    let (contact, mpc) = match profile {
        Profile::Default => (
            "",
            format!(
                "position_weight = {:?}\nvelocity_weight = {:?}\nwrench_weight = {}\ninput_weight = {:?}",
                of_axes(0.0, 0.0),
                of_axes(1000.0, 100.0),
                format!("{:?}", vec!["1e-4"; axes]).replace('"', ""),
                of_axes(10.0, 1.0),
            ),
        ),
        Profile::Paper => (
            "sign = \"wrench\"\nlower_bound = \"always\"\nlimit_tolerance = 0.0\n",
            "discretization = \"euler\"\nhorizon = 5\nforce_points = \"step_ends\"\nmodel_delay = false\n\
             inputs = \"active\"\nweights = \"joint\"\nposition_weight = [1000.0, 1000.0]\n\
             velocity_weight = [1000.0, 1000.0]\nwrench_weight = [0.001, 0.001]\ninput_weight = [10.0, 10.0]\n\
             on_infeasible = \"halt\""
                .to_owned(),
        ),
    };
    format!(
        "{head}{task}\n\
         [control]\nlaw = \"mpc\"\nsampling_time_s = {sampling_time:?}\ncommand_delay_s = {delay:?}\n\
         answer_budget_s = {sampling_time:?}\nmax_sample_age_s = {age:?}\nspin_s = {spin:?}\n{condition}\n\
         [contact]\nadmittance_axes = {gives_way:?}\nactivation_threshold = {threshold:?}\n\
         release_threshold = {release_threshold:?}\nforce_limit = {limit:?}\nminimum_force = {minimum_force:?}\n\
         wrench_time_constant_s = {wrench:?}\n{contact}\n\
         [environment]\nnormal_stiffness_n_m = {stiffness:?}\nsurface_normal = {normal:?}\n\
         {point}\n\n\
         [mpc]\n{mpc}\n\n\
         [limits]\nvelocity_offset = {offset:?}\njoint_speed_rad_s = {speed:?}\n{drives}\n[stopping]\n\n[realtime]\n",
        head = arm_sections(draw),
        task = task_section(draw),
        delay = draw.delay_s(),
        age = 3.0 * sampling_time,
        spin = 0.25 * sampling_time,
        condition = least_condition(draw),
        gives_way = draw.task.gives_way,
        threshold = of_axes(ACTIVATION_THRESHOLD_N, ACTIVATION_THRESHOLD_N_M),
        limit = draw.task.force_limit,
        wrench = of_axes(draw.wrench_time_constant_s, draw.wrench_time_constant_s),
        stiffness = draw.stiffness_n_m * factor,
        point = match (variant, draw.task.frame) {
            (Variant::Detected, _) => "contact = \"detected\"".to_owned(),
            (_, frame) => {
                let point: [f64; 3] = std::array::from_fn(|axis| point[axis] + out_m * normal[axis]);
                let stands = if frame == Frame::Tool { standing(draw) } else { String::new() };
                format!("contact_point_m = {point:?}{stands}")
            }
        },
        offset = of_axes(OFFSET_LIMIT_M_S, OFFSET_LIMIT_M_S),
        speed = draw.joint_speed_limit,
        drives = drive_limits(draw),
    )
}

/// The keys of the drives' limits, which a configuration and a scenario share.
fn drive_limits(draw: &Draw) -> String {
    draw.drives.as_ref().map_or_else(String::new, |drives| {
        format!("joint_acceleration_rad_s2 = {:?}\njoint_jerk_rad_s3 = {:?}\n", drives.acceleration, drives.jerk)
    })
}

/// `[task]`, where it is another frame than the base frame.
fn task_section(draw: &Draw) -> String {
    let frame = match draw.task.frame {
        Frame::Base => return String::new(),
        Frame::Rpy(rpy) => format!("frame = \"rpy\"\nrpy_rad = {rpy:?}"),
        Frame::Surface => "frame = \"surface\"".to_owned(),
        Frame::Tool => "frame = \"tool\"".to_owned(),
    };
    format!("\n[task]\n{frame}\n")
}

/// How the tool stands at contact: in its frame it says where the normal is.
fn standing(draw: &Draw) -> String {
    let (roll, pitch, yaw) =
        Rotation3::from_matrix_unchecked(draw.arm.tool_axes(&draw.contact_position)).euler_angles();
    format!("\ncontact_rpy_rad = {:?}", [roll, pitch, yaw])
}

/// Two joints in a plane have the default; where metres and radians mix it is chosen for the arm, as in
/// deploy/robots.
fn least_condition(draw: &Draw) -> String {
    match &draw.arm {
        Arm::PlanarTwo(_) => String::new(),
        Arm::Chain(_) => format!("minimum_reciprocal_condition = {LEAST_CONDITION:?}\n"),
    }
}

/// The plant's scenario.
///
/// # Errors
/// What the scenario's checks say.
pub(crate) fn scenario(draw: &Draw) -> Result<Scenario, String> {
    parse(&scenario_text(draw), "scenario.toml").map_err(|errors| errors.to_string())
}

/// Whether the plant finds a start for this case.
pub(crate) fn can_be_set_up(draw: &Draw) -> bool {
    scenario(draw).is_ok_and(|scenario| VirtualRun::new(&scenario).is_ok())
}

/// The scenario as text.
pub(crate) fn scenario_text(draw: &Draw) -> String {
    let sampling_time = draw.sampling_time_s;
    format!(
        "name = \"study\"\n{head}\n\
         [timing]\nsampling_time_s = {sampling_time:?}\ncommand_delay_s = {delay:?}\nsubstep_s = {SUBSTEP_S:?}\n\
         settle_s = {SETTLE_S:?}\n\n\
         [start]\njoint_position_rad = {q:?}\ncontact_time_s = {APPROACH_S:?}\ncontact_phase = {phase:?}\n\n\
         [surface]\npoint_m = {point:?}\nnormal = {normal:?}\nstiffness_n_m = {stiffness:?}\n\n\
         [wrench]\ntime_constant_s = {wrench:?}\n\n[noise]\n\n\
         {drives}[[motion]]\nduration_s = {duration:?}\ntwist = {twist:?}\n\n[realtime]\n",
        drives = draw.drives.as_ref().map_or_else(String::new, |_| format!("[drives]\n{}\n", drive_limits(draw))),
        head = arm_sections(draw),
        delay = draw.delay_s(),
        q = draw.contact_position,
        phase = draw.contact_phase,
        point = draw.contact_point_m(),
        normal = draw.normal(),
        stiffness = draw.stiffness_n_m,
        wrench = vec![draw.wrench_time_constant_s; draw.arm.task_axes()],
        duration = APPROACH_S + AFTER_CONTACT_S + draw.drives.as_ref().map_or(0.0, |_| LONGEST_STOP_S),
        twist = draw.twist(),
    )
}

fn arm_sections(draw: &Draw) -> String {
    let head = |name: &str| {
        format!(
            "[ipc]\n\n[robot]\nname = \"{name}\"\ntask_axes = {}\nvelocity_time_constant_s = {:?}\n",
            draw.arm.task_axes(),
            draw.velocity_time_constant_s
        )
    };
    match &draw.arm {
        Arm::PlanarTwo(PlanarTwo { links_m: [first, second] }) => format!(
            "{}\n[[robot.joint]]\norigin_m = [0.0, 0.0, 0.0]\n\n[[robot.joint]]\norigin_m = [{first:?}, 0.0, 0.0]\n\n\
             [robot.tool]\norigin_m = [{second:?}, 0.0, 0.0]\n",
            head("planar 2R")
        ),
        Arm::Chain(chain) => {
            let names = draw.task.controlled.iter().map(|axis| AXIS_NAMES[*axis]).collect::<Vec<_>>();
            let mut text = format!("{}controlled_axes = {names:?}\n\n", head("study"));
            for Joint { origin_m, rpy_rad, axis, kind } in &chain.joints {
                let kind = match kind {
                    Kind::Turns => "revolute",
                    Kind::Slides => "prismatic",
                };
                let _ = write!(
                    text,
                    "[[robot.joint]]\norigin_m = {origin_m:?}\norigin_rpy_rad = {rpy_rad:?}\naxis = {axis:?}\n\
                     kind = \"{kind}\"\n\n"
                );
            }
            let (origin, rpy) = (chain.tool_m, chain.tool_rpy_rad);
            let _ = write!(text, "[robot.tool]\norigin_m = {origin:?}\norigin_rpy_rad = {rpy:?}\n");
            text
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_draw_is_an_acceptable_configuration_and_scenario() {
        for index in 0..200 {
            let draw = Draw::new(5, index).unwrap();
            scenario(&draw).unwrap();
            for variant in Variant::ALL {
                let config = controller(&draw, Profile::Default, variant).unwrap();
                admittance_runner::cycle::build(&config).unwrap();
            }
            controller(&draw, Profile::Paper, Variant::Nominal).unwrap();
        }
    }
}
