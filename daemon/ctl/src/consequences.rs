//! What follows from a configuration, for `validate -v`: what is believed of the arm, and what a
//! simulated touch shows.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use admittance_core::mpc::qp::{Answer, Qp, QpOutcome, QpSolver};
use admittance_core::with_arm;
use admittance_host::config::short;
use admittance_runner::config::{Config, LawName, contact_distance_m, reach_m};
use admittance_runner::virtual_time::VirtualTime;
use admittance_runner::{cycle, parameters};
use plant_sim::run::VirtualRun;

use crate::limits::Touch;

/// Instants of contact within a cycle that the safe speed is safe at.
const INSTANTS: u32 = 4;

/// Line by line.
pub fn lines(config: &Config) -> Vec<String> {
    let mut lines = belief(config);
    lines.push(horizon(config));
    lines.push(reach(config));
    lines.extend(touch(config));
    lines
}

fn horizon(config: &Config) -> String {
    let (joints, axes) = (config.robot.joint.len(), config.robot.task_axes);
    let steps = with_arm!((joints, axes), <N, D> => {
        parameters::parameters::<N, D>(config, config.inputs_per_cycle()).map(|all| {
            (all.mpc.horizon, all.mpc.steps.iter().take(all.mpc.horizon).sum::<f64>())
        })
    }, else None);
    let (count, length) = steps.unwrap_or_default();
    let inputs = config.inputs_per_cycle();
    let within = if inputs == 1 { String::new() } else { format!(", {inputs} of them within a cycle") };
    format!("horizon: {} ms in {count} steps{within}", short(length * 1e3))
}

fn reach(config: &Config) -> String {
    let reach = match reach_m(config) {
        reach if reach.is_finite() => format!("reach: {} m from the first joint", short(reach)),
        _ => "reach: without end, for limits.joint_position of a prismatic joint is not given".to_owned(),
    };
    match contact_distance_m(config) {
        Some((point, _)) => format!("{reach}; the contact point is {} m away", short(point)),
        None => format!("{reach}; the contact point is not configured"),
    }
}

/// What the MPC's problems were like.
#[derive(Debug, Default)]
struct Work {
    variables: AtomicUsize,
    rows: AtomicUsize,
    iterations: AtomicUsize,
    times: Mutex<Vec<Duration>>,
}

struct Watched<S> {
    solver: S,
    work: Arc<Work>,
}

impl<S: QpSolver> QpSolver for Watched<S> {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        let begun = Instant::now();
        let outcome = self.solver.solve(qp, answer, expired);
        let taken = begun.elapsed();
        let work = &self.work;
        work.variables.fetch_max(qp.variables, Ordering::Relaxed);
        work.rows.fetch_max(qp.row_count, Ordering::Relaxed);
        work.iterations.fetch_max(outcome.iterations() as usize, Ordering::Relaxed);
        work.times.lock().unwrap_or_else(PoisonError::into_inner).push(taken);
        outcome
    }
}

/// The safe speed, and the work of a touch at half of it.
fn touch(config: &Config) -> Vec<String> {
    let touch = match Touch::of(config) {
        Ok(touch) => touch,
        Err((_, why)) => return vec![format!("safe speed: not known here: {why}")],
    };
    let speed = match touch.safe_speed(config, INSTANTS) {
        Ok(speed) => speed,
        Err(why) => return vec![format!("safe speed: {why}")],
    };
    let safe = format!(
        "safe speed: {} m/s into the surface, if all is as told ({INSTANTS} instants of contact; admittancectl limits \
         has what a cell may do)",
        short(speed)
    );
    match work(config, &touch, speed / 2.0) {
        Ok(work) => vec![work, safe],
        Err(why) => vec![format!("work: {why}"), safe],
    }
}

fn work(config: &Config, touch: &Touch, speed_m_s: f64) -> Result<String, String> {
    if config.control.law == LawName::Damping {
        return Ok("work: none, the damping law optimises nothing".to_owned());
    }
    let work = Arc::new(Work::default());
    let watched = Arc::clone(&work);
    let cycle = cycle::build_watched(config, &|solver| Box::new(Watched { solver, work: Arc::clone(&watched) }))?;
    let plant = VirtualRun::new(&touch.scenario(config, speed_m_s)).map_err(|error| error.to_string())?;
    let mut run = VirtualTime::new(cycle, plant);
    while run.step()?.is_some() {}
    let mut times = std::mem::take(&mut *work.times.lock().unwrap_or_else(PoisonError::into_inner));
    times.sort();
    let median = times.get(times.len() / 2).copied().unwrap_or_default();
    let seen = |number: &AtomicUsize| number.load(Ordering::Relaxed);
    Ok(format!(
        "work of a cycle in contact: up to {} variables, {} rows and {} iterations; solving takes {} us here, at the \
         median",
        seen(&work.variables),
        seen(&work.rows),
        seen(&work.iterations),
        median.as_micros()
    ))
}

/// What is told of a surface of which only a range is, and what is learned of it.
fn surface(config: &Config) -> Option<String> {
    let environment = &config.environment;
    let [least, most] = environment.stiffness_range_n_m.filter(|[least, most]| least < most)?;
    let point = match environment.contact_tolerance_m {
        Some(tolerance) => format!("contact point told within {} mm", short(tolerance * 1e3)),
        None => "contact point detected".to_owned(),
    };
    let normal = match environment.normal_tolerance_rad {
        0.0 => "normal as told".to_owned(),
        tolerance => {
            format!("normal told within {} rad ({:.1} degrees), learned", short(tolerance), tolerance.to_degrees())
        }
    };
    Some(format!(
        "surface: stiffness {} to {} N/m, learned at touch ({} N/m before it); {point}; {normal}",
        short(least),
        short(most),
        short(environment.normal_stiffness_n_m)
    ))
}

/// What is left free below the force limit for an arm that follows late.
fn lateness(config: &Config) -> Option<String> {
    /// For which approach the force is given, m/s.
    const SPEED_M_S: f64 = 0.1;
    let tolerance_s = config.control.lag_tolerance_s;
    let free_n = config.environment.normal_stiffness_n_m * SPEED_M_S * tolerance_s;
    (tolerance_s > 0.0 && config.control.law == LawName::Mpc).then(|| {
        format!(
            "the arm may follow {tolerance_s} s later than that: until it was halted a plan leaves {} N free below the \
             force limit at {SPEED_M_S} m/s, in proportion to the speed, where one can",
            short(free_n)
        )
    })
}

/// What a wrench that lags longer than told makes of the verdict.
fn longer_lag(config: &Config) -> Option<String> {
    let share = config.contact.wrench_lag_tolerance;
    (share > 0.0 && config.control.law == LawName::Mpc).then(|| {
        format!(
            "the wrench may lag {} % longer than that: a verdict is feasible where the limit would be kept if so much more of \
             the force were not shown yet, else AtRisk",
            short(share * 100.0)
        )
    })
}

/// What the drives are told to take, and what that makes of coming to rest.
fn drives(config: &Config) -> Option<String> {
    let limits = &config.limits;
    let accelerations = limits.joint_acceleration_rad_s2.as_ref()?;
    let jerk = match (&limits.joint_jerk_rad_s3, limits.stop_exceeds_jerk) {
        (None, _) => "of any jerk".to_owned(),
        (Some(jerks), false) => format!("with a jerk of at most {jerks:?} rad/s^3, in stops too"),
        (Some(jerks), true) => format!("with a jerk of at most {jerks:?} rad/s^3, which stops may exceed"),
    };
    let rest = limits.joint_speed_rad_s.as_ref().map_or_else(String::new, |speeds| {
        let slowest_s = speeds.iter().zip(accelerations).map(|(speed, most)| speed / most).fold(0.0, f64::max);
        format!("; full speed takes up to {} s to brake", short(slowest_s))
    });
    let interval_ms = config.control.sampling_time_s / f64::from(config.inputs_per_cycle()) * 1e3;
    Some(format!(
        "drives: a reference every {} ms, its acceleration at most {accelerations:?} rad/s^2 (m/s^2 of joints that slide), \
         {jerk}{rest}",
        short(interval_ms)
    ))
}

/// Which joint velocity is taken for a twist, where the motion controller leaves that to the daemon.
fn redundancy(config: &Config) -> Option<String> {
    let section = &config.redundancy;
    if !section.is_told() {
        return None;
    }
    let each = |values: &[f64]| values.iter().copied().map(short).collect::<Vec<_>>().join(", ");
    let mut said = vec![match &section.joint_weights {
        Some(weights) => format!("\"{}\" with the weights {}", section.resolution, each(weights)),
        None => format!("\"{}\", all joints weighted alike", section.resolution),
    }];
    said.push(match section.margin(config) {
        Some(margin) => {
            format!("joints are kept {} rad or m from their limits as long as others can move", each(&margin))
        }
        None => "limits of position are the MPC's alone".to_owned(),
    });
    if let (Some(factor), Some(below)) = (section.damping_factor, section.damping_below) {
        let (factor, below) = (short(factor), short(below));
        said.push(format!("damped by up to {factor} where the reciprocal condition number is below {below}"));
    }
    said.push("the motion controller has to say follows_joint_velocity = 1".to_owned());
    Some(format!("redundancy: {}", said.join("; ")))
}

/// What the controller believes of the arm.
fn belief(config: &Config) -> Vec<String> {
    let (robot, control) = (&config.robot, &config.control);
    let mut lines = Vec::new();
    for (joint, lag_s) in robot.velocity_time_constant_s.iter().enumerate() {
        let (damping, dead_time_s) = (robot.damping(joint), robot.dead_time_s(joint));
        let order = match damping {
            0.0 => format!("of first order, time constant {lag_s} s"),
            _ => format!("of second order, {:.1} rad/s at -3 dB, damping {}", 1.0 / lag_s, short(damping)),
        };
        lines.push(format!("joint {joint}: speed loop {order}, dead time {dead_time_s} s"));
    }
    lines.extend(drives(config));
    lines.push(match robot.report_lag_s() {
        0.0 => "joint velocities: as reported".to_owned(),
        lag_s => format!("joint velocities: reported with a lag of {lag_s} s, estimated"),
    });
    lines.push(format!(
        "wrench: time constants {:?} s, dead time {} s",
        config.contact.wrench_time_constant_s, config.contact.wrench_dead_time_s
    ));
    lines.extend(longer_lag(config));
    lines.extend(surface(config));
    lines.extend(redundancy(config));
    lines.push(format!(
        "a command acts {} s after its sample{}",
        control.command_delay_s,
        if config.mpc.model_delay { "" } else { ", which the model leaves out" }
    ));
    lines.extend(lateness(config));
    lines
}
