//! Scenario files: the arm, the surface, the sensors, the commanded motion and the faults of one
//! run.

use admittance_host::config::ConfigError;
use admittance_host::ipc_section::IpcSection;
use admittance_host::realtime::RealtimeSection;
use admittance_host::robot_description::RobotDescription;
use admittance_host::twist_section::TwistSection;
use admittance_host::{config_enum, config_file, config_section};

use crate::drives_section::DrivesSection;
use crate::egm_section::EgmSection;
pub use crate::environment::SurfaceSection;
use crate::faults::FaultKind;
use crate::rigid_body::RigidBodySection;

config_section! {
    /// Cycle and integration.
    pub struct TimingSection {
        /// T_s: time between two state samples.
        sampling_time_s: f64, unit "s", range 0.0001..=0.1;
        /// The command for a sample acts this long after the sample's stamp.
        command_delay_s: f64 = 0.0, unit "s", range 0.0..=0.2;
        /// Longest interval over which the contact force is taken to be a straight line.
        substep_s: f64 = 0.0001, unit "s", range 0.000001..=0.001;
        /// Time at rest before the motion starts.
        settle_s: f64 = 0.5, unit "s", range 0.0..=60.0;
    }
    cross_check whole_nanoseconds;
}

fn whole_nanoseconds(timing: &TimingSection, path: &str, errors: &mut Vec<ConfigError>) {
    if timing.substep_s > timing.sampling_time_s {
        let accepted = format!("at most {path}.sampling_time_s = {} s", timing.sampling_time_s);
        errors.push(ConfigError::new(format!("{path}.substep_s"), timing.substep_s, accepted));
    }
}

config_section! {
    /// Where the arm starts, and when it touches.
    pub struct StartSection {
        /// Joint position at the start; with contact_time_s the guess from which it is solved, and
        /// its elbow. Of a prismatic joint in m.
        joint_position_rad: Vec<f64>, unit "rad, m", range -7.0..=7.0, length 2..=8;
        /// When the motion shall bring the TCP to surface.point_m, counted from its start, in whole
        /// samples; the start is where joint_position_rad says when absent.
        contact_time_s: Option<f64>, unit "s", range 0.0..=100.0;
        /// Share of a sample that the contact comes later than that.
        contact_phase: f64 = 0.0, unit "1", range 0.0..=1.0;
    }
}

config_section! {
    /// The wrench estimate (6).
    pub struct WrenchSection {
        /// T_est per task axis; 0 is an ideal sensor.
        time_constant_s: Vec<f64>, unit "s", range 0.0..=0.5, length 2..=6;
        /// Pure delay of the estimate.
        delay_s: f64 = 0.0, unit "s", range 0.0..=0.1;
    }
}

config_section! {
    /// A wrench sensor between flange and tool: the wrench is then given in its axes, at its
    /// origin, and feels the tool.
    pub struct SensorSection {
        /// Where it is in the frame of the TCP.
        origin_m: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -2.0..=2.0;
        /// Its orientation in the frame of the TCP: fixed-axis roll, pitch, yaw.
        rpy_rad: [f64; 3] = [0.0, 0.0, 0.0], unit "rad", range -7.0..=7.0;
        /// Whether the controller gives its readings in the axes of the base frame, about the TCP.
        in_base_axes: bool = false;
        /// Whether it reports what tool and environment exert on the robot.
        reports_reaction: bool = false;
        /// Reading without any load: forces x y z, then torques.
        bias: [f64; 6] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], unit "N, N m", range -1e4..=1e4;
        /// Mass of the tool: the sensor feels its weight, and its inertia as a point mass.
        tool_mass_kg: f64 = 0.0, unit "kg", range 0.0..=500.0;
        /// Its centre of gravity in the frame of the TCP.
        tool_center_of_gravity_m: [f64; 3] = [0.0, 0.0, 0.0], unit "m", range -2.0..=2.0;
        /// Gravity in the base frame.
        gravity_m_s2: [f64; 3] = [0.0, 0.0, -9.81], unit "m/s^2", range -30.0..=30.0;
        /// Largest magnitude of each component of a reading; without end when absent.
        range: Option<[f64; 6]>, unit "N, N m", range 0.001..=1e6;
    }
}

config_section! {
    /// Gaussian sensor noise, root mean square.
    pub struct NoiseSection {
        /// Of each wrench axis.
        wrench: f64 = 0.0, unit "N, N m", range 0.0..=1000.0;
        /// Of each joint position; in m of a prismatic joint.
        joint_position_rad: f64 = 0.0, unit "rad, m", range 0.0..=1.0;
        /// Of each joint velocity; in m/s of a prismatic joint.
        joint_velocity_rad_s: f64 = 0.0, unit "rad/s, m/s", range 0.0..=10.0;
        /// The same seed gives the same noise.
        seed: u64 = 1, unit "1";
    }
}

config_section! {
    /// A phase of constant commanded velocity ṗ0.
    pub struct MotionSection {
        /// How long.
        duration_s: f64, unit "s", range 0.0001..=3600.0;
        /// ṗ0 per task axis, base frame.
        twist: Vec<f64>, unit "m/s, rad/s", range -5.0..=5.0, length 2..=6;
        /// What the joints of a redundant arm are commanded beside it: of these joint velocities the part
        /// that leaves the TCP where it is. Needs controller.follows = "joint_velocity".
        beside_rad_s: Option<Vec<f64>>, unit "rad/s, m/s", range -20.0..=20.0, length 2..=8;
    }
}

config_enum! {
    /// What the joints follow.
    pub enum FollowsName {
        /// The twist: ṗ0 plus the velocity offset, by the joint velocity of least norm at each instant.
        Twist = "twist",
        /// Their own commanded velocity plus what the daemon adds to it: for its [redundancy].
        JointVelocity = "joint_velocity",
    }
}

config_section! {
    /// How the motion controller follows commands.
    pub struct ControllerSection {
        /// What its joints follow.
        follows: FollowsName = FollowsName::Twist;
    }
}

config_section! {
    /// A scripted fault.
    pub struct FaultSection {
        /// When, counted from the start of the motion.
        at_s: f64, unit "s", range -60.0..=3600.0;
        /// How long.
        duration_s: f64, unit "s", range 0.0..=3600.0;
        /// What.
        kind: FaultKind;
    }
}

config_section! {
    /// The whole file.
    pub struct Scenario {
        /// What logs and reports call it.
        name: String, length 1..=64;
        /// Where plant and daemon meet.
        ipc: IpcSection;
        /// The arm as it really is.
        robot: RobotDescription;
        /// Masses, friction and drives of the arm; when absent its joints follow (4), whatever they
        /// press on.
        rigid_body: Option<RigidBodySection>;
        /// What its drives take; any reference when absent.
        drives: Option<DrivesSection>;
        /// Cycle and integration.
        timing: TimingSection;
        /// Where the arm starts.
        start: StartSection;
        /// What the TCP may touch; free space when absent.
        surface: Option<SurfaceSection>;
        /// The wrench estimate.
        wrench: WrenchSection;
        /// What measures it; when absent the estimate is given as it is, base frame, robot on
        /// environment.
        sensor: Option<SensorSection>;
        /// Sensor noise.
        noise: NoiseSection;
        /// How the motion controller follows commands.
        controller: ControllerSection;
        /// Phases of the commanded motion, one after the other.
        motion: Vec<MotionSection>, length 1..=64;
        /// Other programs lead the arm once the motion has begun; the motion then says for how long alone, and its twists
        /// are zero.
        twist: Option<TwistSection>;
        /// Scripted faults.
        fault: Vec<FaultSection> = Vec::new(), length 0..=64;
        /// The robot's end of EGM; looked at with plant-sim --egm alone, which needs it.
        egm: Option<EgmSection>;
        /// How the real-time loop runs.
        realtime: RealtimeSection;
    }
    cross_check sizes;
}

config_file!(Scenario);

fn sizes(scenario: &Scenario, _: &str, errors: &mut Vec<ConfigError>) {
    let (joints, axes) = (scenario.robot.joint.len(), scenario.robot.task_axes as usize);
    let mut check = |key: String, found: usize, accepted: usize, which: &str| {
        if found != accepted {
            errors.push(ConfigError::new(
                key,
                format!("{found} values"),
                format!("{accepted} values, one for each {which}"),
            ));
        }
    };
    check("start.joint_position_rad".into(), scenario.start.joint_position_rad.len(), joints, "joint");
    check("wrench.time_constant_s".into(), scenario.wrench.time_constant_s.len(), axes, "task axis");
    if let Some(arm) = &scenario.rigid_body {
        check("rigid_body.joint".into(), arm.joint.len(), joints, "joint");
    }
    if let Some(drives) = &scenario.drives {
        let lists = [
            ("joint_speed_rad_s", drives.joint_speed_rad_s.as_ref()),
            ("joint_acceleration_rad_s2", Some(&drives.joint_acceleration_rad_s2)),
            ("joint_jerk_rad_s3", drives.joint_jerk_rad_s3.as_ref()),
        ];
        for (key, list) in lists.into_iter().filter_map(|(key, list)| Some((key, list?))) {
            check(format!("drives.{key}"), list.len(), joints, "joint");
        }
    }
    for (index, motion) in scenario.motion.iter().enumerate() {
        check(format!("motion[{index}].twist"), motion.twist.len(), axes, "task axis");
        if let Some(beside) = &motion.beside_rad_s {
            check(format!("motion[{index}].beside_rad_s"), beside.len(), joints, "joint");
        }
    }
    let beside = scenario.motion.iter().position(|motion| motion.beside_rad_s.is_some());
    if let Some(index) = beside.filter(|_| scenario.controller.follows == FollowsName::Twist) {
        let accepted = "no such key, or controller.follows = \"joint_velocity\"";
        errors.push(ConfigError::new(format!("motion[{index}].beside_rad_s"), "given", accepted));
    }
    let cycle_s = scenario.timing.sampling_time_s;
    if let Some(egm) = scenario.egm.as_ref().filter(|egm| egm.jitter_s >= cycle_s) {
        let accepted = format!("below timing.sampling_time_s = {cycle_s} s");
        errors.push(ConfigError::new("egm.jitter_s", egm.jitter_s, accepted));
    }
    if scenario.twist.is_some() {
        for (index, motion) in scenario.motion.iter().enumerate() {
            if motion.twist.iter().any(|value| *value != 0.0) {
                let key = format!("motion[{index}].twist");
                errors.push(ConfigError::new(key, format!("{:?}", motion.twist), "zeros with [twist], or no [twist]"));
            }
        }
    }
    let damping = scenario.robot.velocity_loop.as_ref().and_then(|beyond| beyond.damping.as_ref());
    let damped = damping.filter(|damping| damping.iter().any(|damping| *damping > 0.0));
    if let Some(damping) = damped.filter(|_| scenario.rigid_body.is_some()) {
        let key = "robot.velocity_loop.damping";
        errors.push(ConfigError::new(key, format!("{damping:?}"), "none with [rigid_body], whose drives follow (4)"));
    }
    if let Some(time_s) = scenario.start.contact_time_s.filter(|_| scenario.surface.is_none()) {
        errors.push(ConfigError::new("start.contact_time_s", time_s, "a [surface] to touch, or no contact_time_s"));
    }
}
