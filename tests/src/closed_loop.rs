//! The daemon's cycle against the plant in virtual time, sample by sample: no clock, no process,
//! every sample recorded.

use admittance_core::Counters;
use admittance_core::quantities::Span;
use admittance_host::config::parse;
use admittance_runner::config::{Config, GivenInName};
use admittance_runner::cycle::{self, Cycle, CycleReport};
use admittance_runner::virtual_time::{Step, VirtualTime};
use ipc_types::{CommandSample, Mode, StateSample, StopReason, TruthSample, Verdict};
use plant_sim::drives_section::DrivesSection;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::{MotionSection, Scenario, SensorSection};

use crate::drive_judge::Published;
use crate::session::PAPER_SCENARIO;
use crate::share;

/// The default profile for the paper's arm.
pub const MPC_DEFAULT: &str = include_str!("../../deploy/demo/mpc-default.toml");

/// The outward normal of the paper's surface, x and y.
pub const NORMAL: [f64; 2] = [0.42261826174069944, 0.9063077870366499];

/// Time in s at the end of a run over which settled values are means.
const SETTLED_S: f64 = 0.1;

/// A controller and the plant that it is run against.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// The controller's file.
    pub config: Config,
    /// The plant's file.
    pub scenario: Scenario,
}

impl Experiment {
    /// The default profile on the paper's arm and surface: T_s (s), the speed (m/s) of the paper's
    /// motion, straight down. First contact 0.2 s after the start, the run 1 s.
    pub fn paper(sampling_time: f64, speed: f64) -> Self {
        Self::new(MPC_DEFAULT, PAPER_SCENARIO, sampling_time).with_motion(&[(1.0, &[0.0, -speed])])
    }

    /// From the text of both files, at T_s = `sampling_time` (s), without command delay.
    ///
    /// # Panics
    /// When a file is not valid.
    pub fn new(config: &str, scenario: &str, sampling_time: f64) -> Self {
        let mut config: Config = parse(config, "controller.toml").expect("the config is valid");
        let mut scenario: Scenario = parse(scenario, "scenario.toml").expect("the scenario is valid");
        config.control.sampling_time_s = sampling_time;
        config.control.answer_budget_s = sampling_time / 2.0;
        config.control.max_sample_age_s = 3.0 * sampling_time;
        config.control.spin_s = sampling_time / 4.0;
        scenario.timing.sampling_time_s = sampling_time;
        scenario.timing.settle_s = 0.05;
        scenario.start.contact_time_s = Some(0.2);
        scenario.noise.wrench = 0.0;
        Self { config, scenario }.with_delay(0.0)
    }

    /// The same with phases of (duration in s, ṗ0).
    #[must_use]
    pub fn with_motion(mut self, phases: &[(f64, &[f64])]) -> Self {
        let section = |(duration_s, twist): &(f64, &[f64])| MotionSection {
            duration_s: *duration_s,
            twist: twist.to_vec(),
            beside_rad_s: None,
        };
        self.scenario.motion = phases.iter().map(section).collect();
        self
    }

    /// The same with a command delay in s, which both sides know.
    #[must_use]
    pub fn with_delay(mut self, delay: f64) -> Self {
        self.config.control.command_delay_s = delay;
        self.scenario.timing.command_delay_s = delay;
        self
    }

    /// The same with this wrench estimate time constant in s on both sides.
    #[must_use]
    pub fn with_wrench_lag(mut self, lag: f64) -> Self {
        self.config.contact.wrench_time_constant_s.fill(lag);
        self.scenario.wrench.time_constant_s.fill(lag);
        self
    }

    /// The same with a surface of this outward normal on both sides.
    #[must_use]
    pub fn with_normal(mut self, normal: [f64; 3]) -> Self {
        self.config.environment.surface_normal = normal;
        self.scenario.surface.as_mut().expect("a surface").normal = normal;
        self
    }

    /// The same with a tool of this mass (kg) on a sensor at the flange, told as it is. In the
    /// frame of the TCP: the sensor's origin (m) and rotation (rad), the tool's centre of gravity
    /// (m).
    #[must_use]
    pub fn with_tool(mut self, mass_kg: f64, origin_m: [f64; 3], rpy_rad: [f64; 3], center_m: [f64; 3]) -> Self {
        let wrench = &mut self.config.wrench;
        wrench.given_in = GivenInName::Sensor;
        (wrench.sensor_origin_m, wrench.sensor_rpy_rad) = (origin_m, rpy_rad);
        (wrench.tool_mass_kg, wrench.tool_center_of_gravity_m) = (mass_kg, center_m);
        self.scenario.sensor = Some(SensorSection {
            origin_m,
            rpy_rad,
            in_base_axes: false,
            reports_reaction: false,
            bias: [0.0; 6],
            tool_mass_kg: mass_kg,
            tool_center_of_gravity_m: center_m,
            gravity_m_s2: wrench.gravity_m_s2,
            range: None,
        });
        self
    }

    /// The same with drives that refuse jumps on both sides, whose references come `interval_s` apart.
    #[must_use]
    pub fn with_drives(mut self, drives: Published, interval_s: f64) -> Self {
        let limits = &mut self.config.limits;
        limits.joint_speed_rad_s = Some(drives.speed.clone());
        limits.joint_acceleration_rad_s2 = Some(drives.acceleration.clone());
        limits.joint_jerk_rad_s3 = Some(drives.jerk.clone());
        self.scenario.drives = Some(DrivesSection {
            joint_speed_rad_s: Some(drives.speed),
            joint_acceleration_rad_s2: drives.acceleration,
            joint_jerk_rad_s3: Some(drives.jerk),
            interval_s: Some(interval_s),
        });
        self
    }

    /// The same with the first contact at this share of a sample.
    #[must_use]
    pub fn at_instant(mut self, share: f64) -> Self {
        self.scenario.start.contact_phase = share;
        self
    }

    /// Runs to the end of the motion.
    pub fn run(&self) -> Run {
        self.run_with(|_, _| {})
    }

    /// Runs to the end of the motion; `before` sees the controller and every sample before it is
    /// answered.
    ///
    /// # Panics
    /// When config or scenario cannot be set up, or the plant refuses a command.
    pub fn run_with(&self, before: impl FnMut(&mut dyn Cycle, &StateSample)) -> Run {
        self.run_in_time(before, |_, _| false)
    }

    /// Runs to the end of the motion like [`Self::run_with`]. `expired` says whether time is up
    /// when the law asks about a sample; it is given how often the law has asked, this time
    /// included.
    ///
    /// # Panics
    /// As [`Self::run_with`].
    pub fn run_in_time(
        &self,
        mut before: impl FnMut(&mut dyn Cycle, &StateSample),
        expired: impl FnMut(&StateSample, u64) -> bool,
    ) -> Run {
        let before = |cycle: &mut Box<dyn Cycle>, state: &StateSample| before(cycle.as_mut(), state);
        self.run_replacing(before, expired)
    }

    /// The same where `before` may put another controller in the place of the present one.
    ///
    /// # Panics
    /// As [`Self::run_with`].
    pub fn run_replacing(
        &self,
        mut before: impl FnMut(&mut Box<dyn Cycle>, &StateSample),
        mut expired: impl FnMut(&StateSample, u64) -> bool,
    ) -> Run {
        let plant = VirtualRun::new(&self.scenario).expect("the scenario can be set up");
        let mut run = VirtualTime::new(cycle::build(&self.config).expect("the config describes a controller"), plant);
        let mut instants = Vec::new();
        while let Some(state) = run.sample().expect("no fault drops samples").copied() {
            before(&mut run.cycle, &state);
            let step = run.step_in_time(|asked| expired(&state, asked)).expect("the plant takes every command");
            let Some(Step { state, command, report, truth, .. }) = step else { break };
            let belief = run.cycle.belief();
            let (contact_point, normal, stiffness) =
                (belief.contact_point.into(), belief.normal.into(), belief.stiffness);
            let tool_acceleration = run.cycle.tool_acceleration();
            instants.push(Instant {
                state,
                command,
                report,
                truth,
                contact_point,
                normal,
                stiffness,
                tool_acceleration,
                streamed: run.plant().streamed(),
            });
        }
        let normal = self.scenario.surface.as_ref().map_or([0.0; 3], |surface| surface.normal);
        Run { instants, counters: run.cycle.counters(), normal, sampling_time: self.scenario.timing.sampling_time_s }
    }

    /// Runs `count` instants of contact, evenly over a sample.
    pub fn at_instants(&self, count: u32, mut each: impl FnMut(f64, &Run)) {
        for instant in 0..count {
            let share = f64::from(instant) / f64::from(count);
            each(share, &self.clone().at_instant(share).run());
        }
    }

    /// Runs `count` instants of contact of a seed.
    pub fn at_instants_of(&self, seed: u64, count: u64, mut each: impl FnMut(f64, &Run)) {
        for share in (0..count).map(|index| share(seed, index)) {
            each(share, &self.clone().at_instant(share).run());
        }
    }
}

/// One cycle of a run.
#[derive(Debug, Clone)]
pub struct Instant {
    /// The sample.
    pub state: StateSample,
    /// Its answer.
    pub command: CommandSample,
    /// What the cycle says besides.
    pub report: CycleReport,
    /// What was true at the instant of the sample.
    pub truth: TruthSample,
    /// Where the controller believes the surface to be, m.
    pub contact_point: [f64; 3],
    /// Its outward normal as it is believed to be.
    pub normal: [f64; 3],
    /// The stiffness as it is believed to be, N/m.
    pub stiffness: f64,
    /// What the wrench shows of the tool's acceleration, m/s² and m²/s².
    pub tool_acceleration: [f64; 6],
    /// The references that went to drives that refuse jumps until the next sample: of each what was asked for, and what
    /// they were given.
    pub streamed: Vec<[Vec<f64>; 2]>,
}

impl Instant {
    /// Scenario time in s.
    pub fn time(&self) -> f64 {
        self.truth.scenario_time_s
    }

    /// Whether the mode after this cycle is `mode`.
    pub fn is_in(&self, mode: Mode) -> bool {
        self.command.mode == mode.code()
    }

    /// Inputs of the plan as (offset, length in s).
    pub fn plan(&self) -> impl Iterator<Item = ([f64; 6], f64)> {
        let mut begun = 0;
        (0..self.command.plan_length as usize).map(move |step| {
            let length = Span::from_nanoseconds(self.command.plan_end_ns[step] - begun).seconds();
            begun = self.command.plan_end_ns[step];
            (self.command.planned_offset[step], length)
        })
    }
}

/// A run, all of it.
#[derive(Debug, Clone)]
pub struct Run {
    /// Every cycle.
    pub instants: Vec<Instant>,
    /// The controller's counts at the end.
    pub counters: Counters,
    normal: [f64; 3],
    sampling_time: f64,
}

impl Run {
    /// The last cycle.
    ///
    /// # Panics
    /// When there is none.
    pub fn last(&self) -> &Instant {
        self.instants.last().expect("a run has cycles")
    }

    /// Largest true |f| on this axis in N, between samples as well.
    pub fn peak(&self, axis: usize) -> f64 {
        self.instants.iter().map(|at| at.truth.peak_wrench[axis].abs()).fold(0.0, f64::max)
    }

    /// Largest true force along the normal in N, between samples as well.
    pub fn peak_normal(&self) -> f64 {
        self.instants.iter().map(|at| at.truth.peak_normal_force_n).fold(0.0, f64::max)
    }

    /// Times that contact ended.
    pub fn losses(&self) -> u32 {
        self.last().truth.contact_losses
    }

    /// Cycles with the verdict infeasible.
    pub fn infeasible(&self) -> usize {
        self.instants.iter().filter(|at| at.command.verdict == Verdict::Infeasible.code()).count()
    }

    /// The first stop reason of the run that is not `None`.
    pub fn stop_reason(&self) -> Option<u32> {
        let reason = |at: &Instant| Some(at.command.stop_reason).filter(|reason| *reason != StopReason::NONE);
        self.instants.iter().find_map(reason)
    }

    /// Whether some cycle was in contact.
    pub fn touched(&self) -> bool {
        self.instants.iter().any(|at| at.is_in(Mode::Contact))
    }

    /// Most iterations of a cycle.
    pub fn iterations(&self) -> u32 {
        self.instants.iter().map(|at| at.report.iterations).max().unwrap_or(0)
    }

    /// Longest plan.
    pub fn steps(&self) -> u32 {
        self.instants.iter().map(|at| at.command.plan_length).max().unwrap_or(0)
    }

    /// Cycles in which the offset was cut after the law.
    pub fn limited(&self) -> usize {
        self.instants.iter().filter(|at| at.report.limited).count()
    }

    /// Mean of `value` over the last tenth of a second of the motion; the last sample of a run is
    /// the one after it.
    pub fn settled(&self, value: impl Fn(&Instant) -> f64) -> f64 {
        let end = self.instants.len() - 1;
        let count = ((SETTLED_S / self.sampling_time) as usize).min(end);
        self.instants[end - count..end].iter().map(value).sum::<f64>() / count as f64
    }

    /// Mean true force along the normal over the last tenth of a second, N.
    pub fn settled_normal(&self) -> f64 {
        self.settled(|at| at.truth.normal_force_n)
    }

    /// Largest less smallest true force along the normal over the last tenth of a second, N.
    pub fn settled_swing(&self) -> f64 {
        let end = self.instants.len() - 1;
        let count = ((SETTLED_S / self.sampling_time) as usize).min(end);
        let forces = self.instants[end - count..end].iter().map(|at| at.truth.normal_force_n);
        let (least, most) =
            forces.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), force| (least.min(force), most.max(force)));
        most - least
    }

    /// True speed along the surface over the commanded one, over the last tenth of a second.
    pub fn tangential_share(&self) -> f64 {
        let along = |twist: &[f64; 6]| {
            let normal = &self.normal;
            let square: f64 = normal.iter().map(|n| n * n).sum();
            let out: f64 = normal.iter().zip(twist).map(|(n, v)| n * v).sum();
            std::array::from_fn::<f64, 3, _>(|axis| twist[axis] - normal[axis] * out / square)
        };
        let share = |at: &Instant| {
            let (real, commanded) = (along(&at.truth.tcp_twist), along(&at.state.twist_reference));
            let product: f64 = real.iter().zip(commanded).map(|(a, b)| a * b).sum();
            product / commanded.iter().map(|v| v * v).sum::<f64>()
        };
        self.settled(share)
    }
}
