//! admittance-egm whose loop fails when it is told to, to see what its robot is then sent: by SIGUSR1 once, by SIGUSR2 from then
//! on in all that it computes.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use admittance_client::Rotation;
use admittance_egm::arm::AnyArm;
use ipc_types::{MAX_JOINTS, TASK_AXES};

struct Failing {
    arm: Box<dyn AnyArm>,
    once: Arc<AtomicBool>,
    always: Arc<AtomicBool>,
}

impl Failing {
    fn fail_if_told(&self) {
        assert!(!self.once.swap(false, Ordering::Relaxed), "told to fail once");
        assert!(!self.always.load(Ordering::Relaxed), "told to fail always");
    }
}

impl AnyArm for Failing {
    fn tool(&self, position: &[f64; MAX_JOINTS]) -> Rotation {
        self.arm.tool(position)
    }

    fn twist(&self, position: &[f64; MAX_JOINTS], velocity: &[f64; MAX_JOINTS]) -> [f64; TASK_AXES] {
        self.fail_if_told();
        self.arm.twist(position, velocity)
    }

    fn joint_velocity(&self, position: &[f64; MAX_JOINTS], twist: &[f64; TASK_AXES]) -> Option<[f64; MAX_JOINTS]> {
        self.fail_if_told();
        self.arm.joint_velocity(position, twist)
    }
}

fn main() -> ExitCode {
    let told = |signal| {
        let flag = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(signal, Arc::clone(&flag)).expect("the signal can be handled");
        flag
    };
    let (once, always) = (told(signal_hook::consts::SIGUSR1), told(signal_hook::consts::SIGUSR2));
    admittance_egm::main_with_arm(std::env::args_os().skip(1), &|arm| {
        Box::new(Failing { arm, once: Arc::clone(&once), always: Arc::clone(&always) })
    })
    .into()
}
