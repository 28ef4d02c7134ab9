//! State samples of a foreign plant, one after the other as on the wire: a six-joint arm rests on a
//! floor in another physics engine, at 1 kHz. The solver of version 0.1 exchanged rows without end
//! in it.

use admittance_core::quantities::Instant;
use admittance_host::config::parse;
use admittance_runner::config::Config;
use admittance_runner::cycle;
use ipc_types::{CommandSample, MAX_JOINTS, Mode, StateSample, StopReason, TASK_AXES};

const CONFIG: &str = include_str!("../../../deploy/robots/six-joint.toml");
const SAMPLES: &[u8] = include_bytes!("../../cases/steady-six-joint-contact.samples");
/// Of the first version, without torques.
const SAMPLE_LENGTH: usize = 336;

fn sample(bytes: &[u8]) -> StateSample {
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"));
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
    let joints = |at: usize| -> [f64; MAX_JOINTS] { std::array::from_fn(|i| f64::from_bits(number(at + 8 * i))) };
    let axes = |at: usize| -> [f64; TASK_AXES] { std::array::from_fn(|i| f64::from_bits(number(at + 8 * i))) };
    StateSample {
        sequence: number(0),
        stamp_ns: number(8),
        boot_id: number(16),
        applied_command_sequence: number(24),
        joint_count: word(32),
        wrench_valid: word(36),
        drives_enabled: word(40),
        plays_plan: word(44),
        joint_position: joints(48),
        joint_velocity: joints(112),
        joint_position_reference: joints(176),
        twist_reference: axes(240),
        wrench: axes(288),
        ..StateSample::zeroed()
    }
}

#[test]
fn a_steady_contact_of_a_foreign_plant_is_solved_in_every_cycle() {
    // As shipped, and the weight that version 0.1 had.
    for weight in [None, Some(0.01)] {
        let mut config: Config = parse(CONFIG, "six-joint.toml").expect("valid");
        if let Some(weight) = weight {
            config.mpc.wrench_weight.fill(weight);
        }
        let mut cycle = cycle::build(&config).expect("a controller");
        let (mut contacts, mut iterations) = (0, 0);
        for bytes in SAMPLES.chunks_exact(SAMPLE_LENGTH) {
            let state = sample(bytes);
            let mut command = CommandSample::zeroed();
            let now = Instant::from_nanoseconds(state.stamp_ns);
            let report = cycle.answer(&state, now, &mut || false, &mut command);
            let at = format!("weight {weight:?}, sample {}", state.sequence);
            assert_eq!((report.fault, command.stop_reason), (None, StopReason::NONE), "{at}");
            assert_eq!(cycle.counters().fallback, 0, "{at}: {} iterations", report.iterations);
            contacts += u32::from(command.mode == Mode::Contact.code());
            iterations = iterations.max(report.iterations);
        }
        println!("weight {weight:?}: {contacts} cycles in contact, at most {iterations} iterations");
        assert!(contacts > 600 && SAMPLES.len().is_multiple_of(SAMPLE_LENGTH), "{contacts} cycles in contact");
    }
}
