//! Steps the law through the samples of a contact at 1 kHz, and nothing else: instructions.py counts
//! its instructions.
//!
//! `cycles ARM known|range|both|times ROUNDS`: two, six or seven joints, six of which all six directions give way or whose
//! task frame is the tool's, or the name of another robot's file, and what the controller is told of the stiffness.
//! `both` times the one and the other in turns, cycle by cycle, and says what a range costs: the belief. `times` is `known`, each
//! cycle in turns with a fixed piece of arithmetic of about its length: what of the times is the machine's shows there.

use std::hint::black_box;
use std::time::Instant as Clock;

use admittance_core::quantities::Instant;
use admittance_host::config::parse;
use admittance_runner::config::{Config, ContactPointName, FrameName};
use admittance_runner::cycle;
use admittance_runner::virtual_time::VirtualTime;
use ipc_types::{CommandSample, Mode, StateSample};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

const SAMPLING_TIME_S: f64 = 0.001;
/// Samples before the touch, and from it on.
const FREE: usize = 50;
const IN_CONTACT: usize = 250;

fn cell(joints: &str) -> Option<(&'static str, &'static str)> {
    Some(match joints {
        "two" => (
            include_str!("../../../deploy/demo/mpc-default.toml"),
            include_str!("../../../plant-sim/scenarios/paper.toml"),
        ),
        // All six directions give way; the frame of the tool, which turns.
        "six" | "six-all" | "six-tool" => (
            include_str!("../../../deploy/robots/six-joint.toml"),
            include_str!("../../../plant-sim/scenarios/six-joint.toml"),
        ),
        "seven" => (
            include_str!("../../../deploy/robots/seven-joint.toml"),
            include_str!("../../../plant-sim/scenarios/seven-joint.toml"),
        ),
        "scara" => {
            (include_str!("../../../deploy/robots/scara.toml"), include_str!("../../../plant-sim/scenarios/scara.toml"))
        }
        "planar-three" => (
            include_str!("../../../deploy/robots/planar-three.toml"),
            include_str!("../../../plant-sim/scenarios/planar-three.toml"),
        ),
        "gantry" => (
            include_str!("../../../deploy/robots/gantry.toml"),
            include_str!("../../../plant-sim/scenarios/gantry.toml"),
        ),
        "five-joint" => (
            include_str!("../../../deploy/robots/five-joint.toml"),
            include_str!("../../../plant-sim/scenarios/five-joint.toml"),
        ),
        "rail" => {
            (include_str!("../../../deploy/robots/rail.toml"), include_str!("../../../plant-sim/scenarios/rail.toml"))
        }
        "eight-joint" => (
            include_str!("../../../deploy/robots/eight-joint.toml"),
            include_str!("../../../plant-sim/scenarios/eight-joint.toml"),
        ),
        _ => return None,
    })
}

/// What the controller is told, and the samples of the contact that this makes.
struct Contact {
    config: Config,
    samples: Vec<StateSample>,
}

fn contact(joints: &str, told: &str) -> Result<Contact, Box<dyn std::error::Error>> {
    let (config, scenario) = cell(joints).ok_or(
        "accepted: two, six, six-all, six-tool, seven, scara, planar-three, gantry, five-joint, rail, eight-joint",
    )?;
    let mut config: Config = parse(config, "controller.toml")?;
    let mut scenario: Scenario = parse(scenario, "scenario.toml")?;
    let control = &mut config.control;
    (control.sampling_time_s, control.max_sample_age_s) = (SAMPLING_TIME_S, 3.0 * SAMPLING_TIME_S);
    (control.answer_budget_s, control.spin_s) = (SAMPLING_TIME_S / 2.0, SAMPLING_TIME_S / 4.0);
    scenario.timing.sampling_time_s = SAMPLING_TIME_S;
    if joints == "six-all" {
        config.contact.admittance_axes.fill(true);
    }
    if joints == "six-tool" {
        config.task.frame = FrameName::Tool;
    }
    if told == "range" {
        let environment = &mut config.environment;
        let stiffness = environment.normal_stiffness_n_m;
        environment.stiffness_range_n_m = Some([stiffness / 3.0, stiffness * 3.0]);
        environment.contact = ContactPointName::Detected;
        environment.wrench_noise_n = 0.5;
    }

    let mut run = VirtualTime::new(cycle::build(&config)?, VirtualRun::new(&scenario)?);
    let (mut samples, mut touched) = (Vec::<StateSample>::new(), None);
    while let Some(step) = run.step()? {
        samples.push(step.state);
        if step.truth.in_contact == 1 {
            touched.get_or_insert(samples.len());
        }
    }
    let touched = touched.ok_or("nothing was touched")?;
    let samples = samples.get(touched - FREE..touched + IN_CONTACT).ok_or("the contact is too short")?;
    Ok(Contact { config, samples: samples.to_vec() })
}

impl Contact {
    /// Answers every sample once; `answered` gets what `begin` gave before it.
    fn round<T>(
        &self,
        begin: impl Fn() -> T,
        mut answered: impl FnMut(&CommandSample, T),
    ) -> Result<(), Box<dyn std::error::Error>> {
        let mut command = CommandSample::zeroed();
        let mut cycle = cycle::build(&self.config)?;
        for state in &self.samples {
            let begun = begin();
            cycle.answer(state, Instant::from_nanoseconds(state.stamp_ns), &mut || false, &mut command);
            answered(&command, begun);
        }
        Ok(())
    }
}

/// What this part of times in ns is not above, as µs; sorts them.
fn quantile_us(times: &mut [u64], part: f64) -> f64 {
    times.sort_unstable();
    times.get((times.len() as f64 * part) as usize).map_or(f64::NAN, |time| *time as f64 * 1e-3)
}

/// The median of times in ns, as µs.
fn median_us(times: &mut [u64]) -> f64 {
    quantile_us(times, 0.5)
}

/// Divisions that are timed: a few microseconds.
const DIVISIONS: u32 = 1000;

/// So many divisions, each of which waits for the one before: nothing but time passes.
fn spin(divisions: u32) -> u64 {
    let begun = Clock::now();
    (0..divisions).fold(black_box(2.0), |x: f64, _| black_box(1.0 + 1.0 / x));
    begun.elapsed().as_nanos() as u64
}

/// Times cycles in contact in turns with a fixed spin.
fn time_beside_spin(joints: &str, rounds: u32) -> Result<(), Box<dyn std::error::Error>> {
    let contact = contact(joints, "known")?;
    let mut warm_up = Vec::new();
    contact.round(Clock::now, |_, begun| warm_up.push(begun.elapsed().as_nanos() as u64))?;
    let fastest = (0..100).map(|_| spin(DIVISIONS)).min().unwrap_or(1);
    let divisions = (median_us(&mut warm_up) * 1e3 / fastest as f64 * f64::from(DIVISIONS)) as u32;
    let (mut cycles, mut spins, mut least) = (Vec::new(), Vec::new(), vec![u64::MAX; contact.samples.len()]);
    for _ in 0..rounds {
        let mut sample = 0;
        contact.round(Clock::now, |command, begun| {
            let took = begun.elapsed().as_nanos() as u64;
            if command.mode == Mode::Contact.code() {
                cycles.push(took);
                least[sample] = least[sample].min(took);
            }
            sample += 1;
            spins.push(spin(divisions));
        })?;
    }
    // A cycle of a contact is the same in every round: what it takes in the best one is the computation.
    least.retain(|time| *time < u64::MAX);
    println!("{joints}, us                        p50     p99   p99.9     max");
    for (what, times) in
        [("cycles in contact", &mut cycles), ("a fixed spin", &mut spins), ("each cycle at its best", &mut least)]
    {
        let [p50, p99, p999, most] = [0.5, 0.99, 0.999, 1.0 - f64::EPSILON].map(|part| quantile_us(times, part));
        println!("{what:<26} {p50:>7.1} {p99:>7.1} {p999:>7.1} {most:>7.1}   of {}", times.len());
    }
    Ok(())
}

/// Times cycles in contact with the stiffness known, and with a range of it, in turns.
fn time_both(joints: &str, rounds: u32) -> Result<(), Box<dyn std::error::Error>> {
    let contacts = [contact(joints, "known")?, contact(joints, "range")?];
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..rounds {
        for (contact, times) in contacts.iter().zip(&mut times) {
            contact.round(Clock::now, |command, begun| {
                let took = begun.elapsed();
                if command.mode == Mode::Contact.code() {
                    times.push(took.as_nanos() as u64);
                }
            })?;
        }
    }
    let [known, range] = times.each_mut().map(|times| median_us(times));
    println!(
        "{joints}: p50 of {} and {} cycles in contact: stiffness known {known:.2} us, a range {range:.2} us, \
        {:+.2} us, times {:.2}",
        times[0].len(),
        times[1].len(),
        range - known,
        range / known
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [joints, told, rounds] = arguments.as_slice() else { return Err("three arguments: ARM TOLD ROUNDS".into()) };
    let rounds = rounds.parse::<u32>()?;
    match told.as_str() {
        "both" => return time_both(joints, rounds),
        "times" => return time_beside_spin(joints, rounds),
        _ => {}
    }
    let contact = contact(joints, told)?;
    let mut mode = None;
    for _ in 0..rounds {
        contact.round(|| (), |command, ()| mode = Some(command.mode))?;
    }
    println!("{} cycles, the last one in mode {mode:?}", contact.samples.len());
    Ok(())
}
