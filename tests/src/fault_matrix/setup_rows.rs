//! Rows about what is configured and commanded: files, the model of the surface, the solver, the
//! motion.

use ipc_types::StopReason;

use super::row::{
    CONTACT, Counter, Expectation, FREE, Force, Injection, Key, Robot, Row, Said, Step, Timeline, idle, stopped,
    stopping,
};
use super::{LONG, TIMELINE, by_daemon, row};

/// The model says something else than the arm feels: nothing happens before the touch.
fn wrong_model(
    name: &'static str,
    fault: &'static str,
    daemon: &'static [Key],
    reason: StopReason,
    command: Vec<Said>,
) -> Row {
    Row {
        fault,
        daemon,
        ..row(
            name,
            Expectation {
                note: "Without contact the model of the surface is not used.",
                ..Expectation::undisturbed(FREE)
            },
            Expectation {
                robot: Robot::MinimumForceStop,
                command,
                log: by_daemon(&[&format!("Stopping: {}", reason.name()), &format!("Stopped: {}", reason.name())]),
                force: Force::VirtualTime,
                recovery: vec![Step::CorrectFile, Step::Reload, Step::Retreat, Step::Reset],
                ..Expectation::undisturbed(CONTACT)
            },
        )
    }
}

fn files() -> Vec<Row> {
    let refused = |said, force| Expectation {
        log: by_daemon(&["reload refused: ", "control.sampling_time_s"]),
        recovery: vec![Step::CorrectFile, Step::Reload],
        force,
        ..Expectation::undisturbed(said)
    };
    vec![
        Row {
            fault: "The configuration is replaced by garbage, and the daemon told to read it. It goes on with the old one.",
            injection: Injection::ReloadText("[control]\nsampling_time_s = \"fast\"\n"),
            ..row("configuration_garbage", refused(FREE, Force::None), refused(CONTACT, Force::Limit))
        },
        Row {
            fault: "A person lowers the force limit below the present force.",
            injection: Injection::Request(&["set-force-limit", "x=40", "y=40"]),
            // The law aims at 120 N along the normal.
            daemon: &[
                ("contact.normal_force_reference_n", "120.0"),
                ("mpc.wrench_weight", "[1.0, 1.0]"),
                ("requests", "{ force_limit_min = [10.0, 10.0], force_limit_max = [200.0, 200.0] }"),
            ],
            timeline: Timeline { approach: 0.15, ..LONG },
            ..row(
                "limit_lowered",
                Expectation {
                    note: "There is no force: it takes effect at once.",
                    log: by_daemon(&["request: force limit x 200.0 -> 40.0 N, force limit y 200.0 -> 40.0 N"]),
                    recovery: vec![Step::Reload],
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::MinimumForceStop,
                    command: vec![CONTACT, stopping(StopReason::Infeasible), stopped(StopReason::Infeasible)],
                    log: by_daemon(&[
                        "request: force limit x 200.0 -> 40.0 N",
                        "Stopping: Infeasible",
                        "Stopped: Infeasible",
                    ]),
                    force: Force::VirtualTime,
                    recovery: vec![Step::Reload, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
        Row {
            fault: "A file with a force limit below the present force is loaded.",
            injection: Injection::ReloadKeys(&[
                ("contact.force_limit", "[120.0, 100.0]"),
                ("contact.minimum_force", "[6.0, 6.0]"),
            ]),
            // f_y = 107 N on the plane. With 80 N the touch that follows would be too fast to promise.
            daemon: &[("contact.minimum_force", "[50.0, 50.0]")],
            timeline: Timeline { approach: 0.15, ..TIMELINE },
            ..row(
                "limit_lowered_by_file",
                Expectation {
                    note: "There is no force: it takes effect at once.",
                    log: by_daemon(&["reload: the new configuration is in force"]),
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    log: by_daemon(&["reload refused: the arm is in contact"]),
                    force: Force::Limit,
                    recovery: vec![Step::Retreat, Step::Reload],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
    ]
}

fn motions() -> Vec<Row> {
    use StopReason::{Infeasible, RateMismatch, Singular};
    vec![
        Row {
            fault: "The commanded motion leads to a singular pose.",
            // The commanded pose goes on behind the arm's: it must not be the plant that meets the
            // singularity first.
            daemon: &[("control.minimum_reciprocal_condition", "0.2")],
            scenario: [
                &[
                    ("start.joint_position_rad", "[1.0, -1.0]"),
                    ("motion", "[{ duration_s = 5.0, twist = [0.16, 0.13] }]"),
                ],
                &[(
                    "motion",
                    "[{ duration_s = 0.3, twist = [0.0, -0.25] }, { duration_s = 5.0, twist = [0.227, -0.106] }]",
                )],
            ],
            ..row(
                "singular_pose",
                Expectation {
                    robot: Robot::StandsStill,
                    command: vec![FREE, stopped(Singular)],
                    log: by_daemon(&["Stopped: Singular, the Jacobian is not invertible at the measured pose"]),
                    recovery: vec![Step::RestartPlant, Step::Stand, Step::Reset],
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::MinimumForceStop,
                    command: vec![FREE, CONTACT, stopping(Singular), stopped(Singular)],
                    log: by_daemon(&["Stopped: Singular, the Jacobian is not invertible at the measured pose"]),
                    force: Force::Limit,
                    recovery: vec![Step::RestartPlant, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
        Row {
            fault: "The arm touches too fast for its force limit.",
            timeline: Timeline { approach: 0.6, ..TIMELINE },
            ..row(
                "infeasible_touch",
                Expectation { note: "Nothing is touched: nothing happens.", ..Expectation::undisturbed(FREE) },
                Expectation {
                    robot: Robot::MinimumForceStop,
                    command: vec![FREE, stopping(Infeasible), stopped(Infeasible)],
                    log: by_daemon(&["Stopping: Infeasible, the upper limit on y is missed by at least"]),
                    force: Force::VirtualTime,
                    recovery: vec![Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
        Row {
            fault: "The motion controller's cycle is 4.1 ms where the daemon is configured for 4 ms.",
            // The rate is known after 64 samples: the arm touches before.
            scenario: [
                &[("timing.sampling_time_s", "0.0041")],
                &[("timing.sampling_time_s", "0.0041"), ("start.contact_time_s", "0.1")],
            ],
            ..row(
                "wrong_rate",
                Expectation {
                    robot: Robot::StandsStill,
                    command: vec![FREE, idle(RateMismatch)],
                    log: by_daemon(&["Idle: RateMismatch, samples come every 4.1000 ms: set \
                                      control.sampling_time_s to the controller's cycle"]),
                    recovery: vec![Step::RestartPlant],
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::ComesToRest,
                    command: vec![FREE, CONTACT, stopping(RateMismatch), stopped(RateMismatch)],
                    log: by_daemon(&["Stopped: RateMismatch, samples come every 4.1000 ms: set \
                                      control.sampling_time_s to the controller's cycle"]),
                    force: Force::VirtualTime,
                    recovery: vec![Step::RestartPlant, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
    ]
}

fn models() -> Vec<Row> {
    use StopReason::{ForceExceeded, ModelDisagrees, SolverFailed, SurfaceOutsideRange};
    vec![
        wrong_model(
            "wrong_stiffness",
            "The surface is twenty times as stiff as configured.",
            &[("environment.normal_stiffness_n_m", "5e3")],
            ModelDisagrees,
            vec![FREE, CONTACT, stopping(ModelDisagrees), stopped(ModelDisagrees)],
        ),
        wrong_model(
            "wrong_contact_point",
            "The surface is 4 mm nearer than configured.",
            &[("environment.contact_point_m", "[1.31831, 0.676375, 0.0]")],
            ModelDisagrees,
            vec![FREE, CONTACT, stopping(ModelDisagrees), stopped(ModelDisagrees)],
        ),
        Row {
            fault: "The surface is five times as stiff as configured.",
            scenario: [&[], &[("surface.stiffness_n_m", "5e5")]],
            ..row(
                "stiffer_surface",
                Expectation {
                    note: "Without contact the model of the surface is not used.",
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::MinimumForceStop,
                    command: vec![FREE, CONTACT, stopping(ForceExceeded), stopped(ForceExceeded)],
                    log: by_daemon(&["Stopping: ForceExceeded", "Stopped: ForceExceeded"]),
                    force: Force::VirtualTime,
                    recovery: vec![Step::RestartPlant, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
        Row {
            fault: "Of the surface a range of stiffness is told, and it is five times as hard as the hardest.",
            daemon: &[
                ("environment.normal_stiffness_n_m", "1.5e4"),
                ("environment.stiffness_range_n_m", "[1e4, 2e4]"),
                ("environment.contact_tolerance_m", "0.002"),
                ("environment.wrench_noise_n", "0.5"),
            ],
            ..row(
                "surface_outside_range",
                Expectation {
                    note: "Without contact the model of the surface is not used.",
                    ..Expectation::undisturbed(FREE)
                },
                Expectation {
                    robot: Robot::MinimumForceStop,
                    command: vec![FREE, CONTACT, stopping(SurfaceOutsideRange), stopped(SurfaceOutsideRange)],
                    log: by_daemon(&[
                        "Stopping: SurfaceOutsideRange, it is harder than environment.stiffness_range_n_m allows",
                        "Stopped: SurfaceOutsideRange",
                    ]),
                    force: Force::VirtualTime,
                    recovery: vec![Step::CorrectFile, Step::Reload, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
        Row {
            fault: "The solver does not converge.",
            // Too few for a cycle in contact, enough for a minimum-force stop.
            daemon: &[("mpc.max_iterations", "8"), ("mpc.wrench_weight", "[0.01, 0.01]")],
            timeline: Timeline { approach: 0.1, press: 1.6, ..TIMELINE },
            ..row(
                "solver_fails",
                Expectation { note: "Without contact nothing is solved.", ..Expectation::undisturbed(FREE) },
                Expectation {
                    robot: Robot::MinimumForceStop,
                    command: vec![FREE, CONTACT, stopping(SolverFailed), stopped(SolverFailed)],
                    counted: vec![Counter::Fallback],
                    log: by_daemon(&["Stopping: SolverFailed", "Stopped: SolverFailed"]),
                    force: Force::VirtualTime,
                    recovery: vec![Step::CorrectFile, Step::Reload, Step::Retreat, Step::Reset],
                    ..Expectation::undisturbed(CONTACT)
                },
            )
        },
    ]
}

pub(super) fn rows() -> Vec<Row> {
    let from_start = |row: Row| Row { injection: Injection::FromStart, ..row };
    files().into_iter().chain([motions(), models()].concat().into_iter().map(from_start)).collect()
}
