use admittance_host::config::parse;
use admittanced::config::Config;
use admittanced::cycle;
use ipc_types::{CommandSample, Verdict};
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
use plant_sim::summary::Summary;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let file = std::fs::read_to_string(&args[1]).unwrap();
    let ts: f64 = args[2].parse().unwrap();
    let speeds: Vec<f64> = args[3].split(',').map(|s| s.parse().unwrap()).collect();
    let n: u32 = args[4].parse().unwrap();
    let delay: f64 = args.get(5).map_or(0.0, |s| s.parse().unwrap());
    let detected = args.get(6).is_some_and(|s| s == "detected");
    let verbose = args.get(7).is_some();
    let mut config: Config = parse(&file, "c").unwrap();
    config.control.sampling_time_s = ts;
    config.control.answer_budget_s = ts / 2.0;
    config.control.max_sample_age_s = 3.0 * ts;
    config.control.spin_s = ts / 4.0;
    config.control.command_delay_s = delay;
    if detected {
        config.environment.contact = admittanced::config::ContactPointName::Detected;
    }
    for speed in speeds {
        let (mut worst, mut least, mut infeasible, mut losses, mut stops, mut settled, mut tang, mut iters) =
            (0.0f64, 1e9f64, 0, 0, 0, 0.0f64, (1e9f64, -1e9f64), 0);
        let mut reasons = std::collections::BTreeMap::new();
        let mut cps: f64 = 0.0;
        for i in 0..n {
            let mut scenario: Scenario = parse(include_str!("../../plant-sim/scenarios/paper.toml"), "s").unwrap();
            scenario.timing.sampling_time_s = ts;
            scenario.timing.command_delay_s = delay;
            scenario.start.contact_phase = f64::from(i) / f64::from(n);
            for phase in &mut scenario.motion {
                let s = phase.twist.iter().map(|v| v * v).sum::<f64>().sqrt();
                if s > 0.0 {
                    for v in &mut phase.twist {
                        *v *= speed / s;
                    }
                }
                phase.duration_s = 1.0;
            }
            scenario.start.contact_time_s = Some(0.2);
            let mut cycle = cycle::build(&config).unwrap();
            let mut plant = VirtualRun::new(&scenario).unwrap();
            let mut summary = Summary::of_scenario(&scenario);
            let mut command = CommandSample::zeroed();
            let mut bad = false;
            while !plant.is_finished() {
                let state = *plant.sample().unwrap();
                let report = cycle.answer(&state, state.stamp_ns, &mut || false, &mut command);
                iters = iters.max(report.iterations);
                command.sequence += 1;
                if command.verdict == Verdict::Infeasible.code() && !bad {
                    bad = true;
                }
                let truth = plant.advance(Some(&command)).unwrap();
                if verbose
                    && truth.in_contact == 1
                    && summary.first_contact_s.is_some_and(|c| truth.scenario_time_s < c + 0.06)
                {
                    println!(
                        "t {:.5} F {:.1} peak {:.1} f^ {:.1} mode {} src {} verdict {} margin {:.2} at {:.4} off {:.3} {:.3} it {} stop {}",
                        truth.scenario_time_s,
                        truth.normal_force_n,
                        truth.peak_normal_force_n,
                        -(state.wrench[0] * 0.42261826 + state.wrench[1] * 0.90630779),
                        command.mode,
                        command.source,
                        command.verdict,
                        command.verdict_margin,
                        command.verdict_time_s,
                        command.velocity_offset[0],
                        command.velocity_offset[1],
                        report.iterations,
                        command.stop_reason
                    );
                }
                summary.add(&truth);
                if command.stop_reason != 0 {
                    *reasons.entry(command.stop_reason).or_insert(0) += 1;
                }
            }
            let peak = summary.peak_force_y_n;
            worst = worst.max(peak);
            least = least.min(peak);
            infeasible += u32::from(bad);
            losses += summary.contact_losses;
            stops += u32::from(command.stop_reason != 0);
            settled = settled.max(summary.settled_force_y_n());
            let t = summary.tangential_speed_m_s();
            tang = (tang.0.min(t), tang.1.max(t));
            cps = cps.max(0.0);
        }
        println!(
            "ts {ts} v {speed}: peak_y {least:.1}..{worst:.2} infeasible {infeasible} losses {losses} stops {stops} {reasons:?} settled_y {settled:.1} tang/cmd {:.4}..{:.4} iters {iters}",
            tang.0 / (speed * 25f64.to_radians().sin()),
            tang.1 / (speed * 25f64.to_radians().sin())
        );
    }
}
