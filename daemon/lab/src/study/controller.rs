//! Configuration and scenario for the controller and the plant of a case, as texts that pass the
//! usual checks.

use admittance_host::config::parse;
use admittance_runner::config::Config;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

use super::draw::{ACTIVATION_THRESHOLD_N, AFTER_CONTACT_S, APPROACH_S, Draw};

/// Time at rest before the motion, in s.
const SETTLE_S: f64 = 0.02;
/// Longest step of the plant in s; the stiffest contact changes its force by 1 N in it at 0.04 m/s.
const SUBSTEP_S: f64 = 25e-6;
/// Offset limits in m/s that never bind: joint speeds are what is limited.
const OFFSET_LIMIT_M_S: f64 = 20.0;

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
    let [normal_x, normal_y] = draw.normal();
    let [x, y] = draw.contact_point_m();
    let sampling_time = draw.sampling_time_s;
    let minimum_force = match profile {
        Profile::Default => draw.minimum_force_n,
        Profile::Paper => [0.0; 2],
    };
    let release_threshold = match profile {
        Profile::Default => draw.release_threshold_n,
        Profile::Paper => [ACTIVATION_THRESHOLD_N; 2],
    };
    let (contact, mpc) = match profile {
        Profile::Default => (
            "",
            "position_weight = [0.0, 0.0]\nvelocity_weight = [1000.0, 1000.0]\nwrench_weight = [1e-4, 1e-4]\n\
             input_weight = [10.0, 10.0]",
        ),
        Profile::Paper => (
            "sign = \"wrench\"\nlower_bound = \"always\"\nlimit_tolerance = 0.0\n",
            "discretization = \"euler\"\nhorizon = 5\nforce_points = \"step_ends\"\nmodel_delay = false\n\
             inputs = \"active\"\nweights = \"joint\"\nposition_weight = [1000.0, 1000.0]\n\
             velocity_weight = [1000.0, 1000.0]\nwrench_weight = [0.001, 0.001]\ninput_weight = [10.0, 10.0]\n\
             on_infeasible = \"halt\"",
        ),
    };
    format!(
        "{head}\n\
         [control]\nlaw = \"mpc\"\nsampling_time_s = {sampling_time:?}\ncommand_delay_s = {delay:?}\n\
         answer_budget_s = {sampling_time:?}\nmax_sample_age_s = {age:?}\nspin_s = {spin:?}\n\n\
         [contact]\nadmittance_axes = [true, true]\nactivation_threshold = {threshold:?}\n\
         release_threshold = {release_threshold:?}\nforce_limit = {limit:?}\nminimum_force = {minimum_force:?}\n\
         wrench_time_constant_s = {wrench:?}\n{contact}\n\
         [environment]\nnormal_stiffness_n_m = {stiffness:?}\nsurface_normal = {normal:?}\n\
         {point}\n\n\
         [mpc]\n{mpc}\n\n\
         [limits]\nvelocity_offset = {offset:?}\njoint_speed_rad_s = {speed:?}\n\n[stopping]\n\n[realtime]\n",
        head = arm_sections(draw),
        delay = draw.delay_s(),
        age = 3.0 * sampling_time,
        spin = 0.25 * sampling_time,
        threshold = [ACTIVATION_THRESHOLD_N; 2],
        limit = [draw.force_limit_n; 2],
        wrench = [draw.wrench_time_constant_s; 2],
        stiffness = draw.stiffness_n_m * factor,
        normal = [normal_x, normal_y, 0.0],
        point = match variant {
            Variant::Detected => "contact = \"detected\"".to_owned(),
            _ => format!("contact_point_m = {:?}", [x + out_m * normal_x, y + out_m * normal_y, 0.0]),
        },
        offset = [OFFSET_LIMIT_M_S; 2],
        speed = [draw.joint_speed_limit_rad_s; 2],
    )
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
    let ([normal_x, normal_y], [x, y]) = (draw.normal(), draw.contact_point_m());
    let sampling_time = draw.sampling_time_s;
    format!(
        "name = \"study\"\n{head}\n\
         [timing]\nsampling_time_s = {sampling_time:?}\ncommand_delay_s = {delay:?}\nsubstep_s = {SUBSTEP_S:?}\n\
         settle_s = {SETTLE_S:?}\n\n\
         [start]\njoint_position_rad = {q:?}\ncontact_time_s = {APPROACH_S:?}\ncontact_phase = {phase:?}\n\n\
         [surface]\npoint_m = {point:?}\nnormal = {normal:?}\nstiffness_n_m = {stiffness:?}\n\n\
         [wrench]\ntime_constant_s = {wrench:?}\n\n[noise]\n\n\
         [[motion]]\nduration_s = {duration:?}\ntwist = {twist:?}\n\n[realtime]\n",
        head = arm_sections(draw),
        delay = draw.delay_s(),
        q = draw.contact_position_rad,
        phase = draw.contact_phase,
        point = [x, y, 0.0],
        normal = [normal_x, normal_y, 0.0],
        stiffness = draw.stiffness_n_m,
        wrench = [draw.wrench_time_constant_s; 2],
        duration = APPROACH_S + AFTER_CONTACT_S,
        twist = draw.twist_m_s(),
    )
}

fn arm_sections(draw: &Draw) -> String {
    let [first, second] = draw.arm.links_m;
    format!(
        "[ipc]\n\n[robot]\nname = \"planar 2R\"\ntask_axes = 2\nvelocity_time_constant_s = {:?}\n\n\
         [[robot.joint]]\norigin_m = [0.0, 0.0, 0.0]\n\n[[robot.joint]]\norigin_m = [{first:?}, 0.0, 0.0]\n\n\
         [robot.tool]\norigin_m = [{second:?}, 0.0, 0.0]\n",
        draw.velocity_time_constant_s
    )
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
