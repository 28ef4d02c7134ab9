//! A controller whose solver follows a script, and what its outcomes are compared with.

use std::collections::VecDeque;

use admittance_core::Outcome;
use admittance_core::Parameters;
use admittance_core::intake::Sample;
use admittance_core::mpc::qp::{ActiveSet, Answer, Qp, QpOutcome, QpSolver};
use admittance_core::vocabulary::Motion;
use admittance_core::vocabulary::{ModeName as Mode, StopReason};
use nalgebra::Vector2;

use super::{PlanarController, active_set, controller, pressing, pushing, step};

/// What the solver does instead of solving.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Script {
    Solve,
    Expire,
    Fail,
    /// Claims infeasibility with the same multiplier on every row.
    Claim(f64),
    /// Claims a solution that is wrong.
    Lie(f64),
}

/// Follows its script, then solves.
pub(crate) struct Scripted {
    pub(crate) script: VecDeque<Script>,
    pub(crate) solver: ActiveSet<Vec<f64>>,
}

impl Scripted {
    fn next(&mut self, answer: &mut Answer<'_>) -> Option<QpOutcome> {
        match self.script.pop_front().unwrap_or(Script::Solve) {
            Script::Solve => None,
            Script::Expire => Some(QpOutcome::Expired { iterations: 3 }),
            Script::Fail => Some(QpOutcome::Failed { iterations: 50 }),
            Script::Claim(multiplier) => {
                answer.multipliers.fill(multiplier);
                Some(QpOutcome::Infeasible { iterations: 4 })
            }
            Script::Lie(z) => {
                answer.z.fill(z);
                answer.multipliers.fill(0.0);
                Some(QpOutcome::Solved { iterations: 5 })
            }
        }
    }
}

impl QpSolver for Scripted {
    fn solve(&mut self, qp: &Qp<'_>, answer: &mut Answer<'_>, expired: &mut dyn FnMut() -> bool) -> QpOutcome {
        self.next(answer).unwrap_or_else(|| self.solver.solve(qp, answer, expired))
    }
}

pub(crate) type Scenario = PlanarController<Scripted>;

pub(crate) fn scenario(parameters: Parameters<2, 2>, script: &[Script]) -> Scenario {
    let solver = Scripted { script: script.iter().copied().collect(), solver: active_set() };
    controller(parameters, solver)
}

/// Sample 1 in the air, sample 2 in contact, pressing with 60 N and pushing on at 0.05 m/s.
pub(crate) fn touched(parameters: Parameters<2, 2>, script: &[Script]) -> (Scenario, Outcome<2, 2>) {
    let mut controller = scenario(parameters, script);
    assert_eq!(step(&mut controller, &pressing(-100.0, 1)).mode, Mode::Free);
    let outcome = step(&mut controller, &contact(2));
    assert_eq!((outcome.mode, outcome.active_axes), (Mode::Contact, 0b11));
    (controller, outcome)
}

pub(crate) fn contact(sequence: u64) -> Sample<2, 2> {
    pushing(60.0, 0.05, sequence)
}

pub(crate) fn offsets(controller: &Scenario) -> Vec<Vector2<f64>> {
    let offsets: Vec<_> = controller.plan().steps().map(|(offset, _)| *offset).collect();
    assert!(
        offsets.windows(2).all(|pair| pair[0] != pair[1]) && offsets.iter().all(|o| o.norm() > 1e-4),
        "{offsets:?}"
    );
    offsets
}

pub(crate) fn close(a: &Vector2<f64>, b: &Vector2<f64>) -> bool {
    (a - b).norm() <= 1e-12
}

pub(crate) fn assert_held(outcome: &Outcome<2, 2>, reason: StopReason, what: &str) {
    assert_eq!(
        (outcome.movement.motion, outcome.mode, outcome.stop_reason),
        (Motion::Hold, Mode::Stopped, Some(reason)),
        "{what}"
    );
    assert_eq!(
        (outcome.movement.velocity_offset, outcome.movement.twist_command),
        (Vector2::zeros(), Vector2::zeros()),
        "{what}"
    );
}

pub(crate) fn assert_stopping(outcome: &Outcome<2, 2>, reason: StopReason) {
    assert_eq!(
        (outcome.movement.motion, outcome.mode, outcome.stop_reason),
        (Motion::Offset, Mode::Stopping, Some(reason))
    );
}
