//! Prints how much faster than real time the six-joint arm with masses is simulated:
//!
//! `cargo run --release -p plant-sim --example rigid_body_speed`

use std::error::Error;
use std::time::Instant;

use admittance_host::config::parse;
use ipc_types::VirtualPlant;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;

const SCENARIO: &str = include_str!("../scenarios/six-joint-masses.toml");

fn main() -> Result<(), Box<dyn Error>> {
    let scenario: Scenario = parse(SCENARIO, "six-joint-masses.toml")?;
    let mut run = VirtualRun::new(&scenario)?;
    let (begin, start_ns) = (Instant::now(), run.now_ns());
    let mut peak_n = 0.0f64;
    while !run.is_finished() {
        peak_n = peak_n.max(run.advance(None)?.peak_normal_force_n);
    }
    let simulated_s = (run.now_ns() - start_ns) as f64 * 1e-9;
    let factor = simulated_s / begin.elapsed().as_secs_f64();
    println!("{simulated_s} s with a peak of {peak_n:.1} N, {factor:.1} times faster than real time");
    Ok(())
}
