//! Scratch.
use admittance_host::config::parse;
use admittanced::config::Config;
use admittanced::cycle;
use ipc_types::CommandSample;
use plant_sim::run::VirtualRun;
use plant_sim::scenario::Scenario;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let config: Config = parse(&std::fs::read_to_string(&args[1]).unwrap(), "c").unwrap();
    let scenario: Scenario = parse(&std::fs::read_to_string(&args[2]).unwrap(), "s").unwrap();
    let span: f64 = args.get(3).map_or(0.06, |s| s.parse().unwrap());
    let n = config.environment.surface_normal;
    let mut cycle = cycle::build(&config).unwrap();
    let mut plant = VirtualRun::new(&scenario).unwrap();
    let mut command = CommandSample::zeroed();
    let mut first = None;
    while !plant.is_finished() {
        let state = *plant.sample().unwrap();
        let report = cycle.answer(&state, state.stamp_ns, &mut || false, &mut command);
        command.sequence += 1;
        let truth = plant.advance(Some(&command)).unwrap();
        if truth.in_contact == 1 {
            first.get_or_insert(truth.scenario_time_s);
        }
        if first.is_some_and(|f| truth.scenario_time_s < f + span) {
            let v = -(truth.tcp_twist[0] * n[0] + truth.tcp_twist[1] * n[1]);
            let off = -(command.velocity_offset[0] * n[0] + command.velocity_offset[1] * n[1]);
            let tw = -(command.twist_command[0] * n[0] + command.twist_command[1] * n[1]);
            println!(
                "t {:.5} F {:6.1} peak {:6.1} vin {:6.3} f^ {:6.1} mode {} src {} verdict {} margin {:7.2} at {:.4} off {:6.3} twist {:6.3} rates {:.2} {:.2} it {} stop {} loss {}",
                truth.scenario_time_s,
                truth.normal_force_n,
                truth.peak_normal_force_n,
                v,
                -(state.wrench[0] * n[0] + state.wrench[1] * n[1]),
                command.mode,
                command.source,
                command.verdict,
                command.verdict_margin,
                command.verdict_time_s,
                off,
                tw,
                command.joint_velocity_offset[0],
                command.joint_velocity_offset[1],
                report.iterations,
                command.stop_reason,
                truth.contact_losses
            );
        }
    }
}
