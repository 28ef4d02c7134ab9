//! The optimal control problem behind [`super::attainable`] as a linear programme for Clarabel, in
//! sparse stage form: joint positions and velocities at the start of every input are variables,
//! tied by the exact first-order lags, and each instant of the grid is one row of seven numbers.

use std::fmt;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use super::arm::{lag, product};
use super::attainable::{Contact, JointState};

/// Distance in s of the instants at which the force counts; within an input that is no multiple of
/// it, the next smaller distance that divides it.
pub(super) const GRID_S: f64 = 1e-4;
/// Tolerances, each with the regularisation of the factorisation: where an interior point breaks off, which it does
/// of problems that are nearly singular, it is asked again with the next.
const ATTEMPTS: [(f64, f64); 4] = [(1e-9, 1e-8), (1e-9, 1e-7), (1e-8, 1e-7), (1e-8, 1e-6)];
const MAX_ITERATIONS: u32 = 200;
/// Variables of a stage, for each joint: references first, then velocities, then positions.
const STAGE: usize = 3;

/// One input, and the trajectory along which the kinematics are linearised.
#[derive(Debug, Clone)]
pub(super) struct Stage {
    /// How long the input is held, in s.
    pub(super) duration_s: f64,
    /// Where the trajectory is at its start; `None`: at the pose of the start of the problem, all
    /// the time.
    pub(super) state: Option<JointState>,
    /// The trajectory's reference in rad/s or m/s.
    pub(super) reference: Vec<f64>,
}

/// What the programme answers.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    /// Largest k·penetration in N.
    pub(super) optimum_n: f64,
    /// Reference in rad/s or m/s of each input.
    pub(super) references: Vec<Vec<f64>>,
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum NoAnswer {
    /// No input meets the bounds, whatever the force.
    Contradicted,
    /// Clarabel does not solve the problem: its status.
    Unsolved(String),
}

impl fmt::Display for NoAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Contradicted => f.write_str("no input keeps the directions that do not give way, within the limits"),
            Self::Unsolved(status) => f.write_str(status),
        }
    }
}

impl From<NoAnswer> for String {
    fn from(why: NoAnswer) -> Self {
        why.to_string()
    }
}

/// Rows of A x + s = b as triplets.
#[derive(Default)]
struct Rows {
    triplets: Vec<(usize, usize, f64)>,
    bounds: Vec<f64>,
}

impl Rows {
    fn push(&mut self, entries: &[(usize, f64)], bound: f64) {
        let row = self.bounds.len();
        self.triplets
            .extend(entries.iter().filter(|entry| entry.1 != 0.0).map(|(column, value)| (row, *column, *value)));
        self.bounds.push(bound);
    }
}

/// Values that bring all variables to the order of one.
#[derive(Clone, Copy)]
struct Scale {
    speed: f64,
    angle: f64,
    force: f64,
}

/// min s subject to the force (k·penetration, and its damping) ≤ s at all instants of the grid, `peak_before_n` ≤ s, and the
/// bounds of the references; with `keeps_contact` also penetration ≥ 0.
///
/// # Errors
/// [`NoAnswer`].
pub(super) fn minimise(
    contact: &Contact,
    start: &JointState,
    peak_before_n: f64,
    stages: &[Stage],
    keeps_contact: bool,
) -> Result<Solution, NoAnswer> {
    let scale = scale(contact, start, peak_before_n);
    let width = STAGE * contact.arm.joints();
    let peak = width * stages.len();
    let mut rows = Rows::default();
    dynamics(contact, start, stages, scale, &mut rows);
    kept(contact, start, stages, scale, &mut rows);
    let equalities = rows.bounds.len();
    rows.push(&[(peak, -1.0)], -peak_before_n / scale.force);
    for (m, stage) in stages.iter().enumerate() {
        for (joint, (least, most)) in contact.joint_speed_bounds.iter().enumerate() {
            let reference = width * m + joint;
            rows.push(&[(reference, 1.0)], most / scale.speed);
            rows.push(&[(reference, -1.0)], -least / scale.speed);
        }
        drive_rows(contact, stages, m, scale, &mut rows);
        let peak = Some(peak);
        force_rows(contact, start, stage, m, peak, scale, &mut rows);
        if keeps_contact {
            force_rows(contact, start, stage, m, None, scale, &mut rows);
        }
    }
    let inequalities = rows.bounds.len() - equalities;
    let mut gradient = vec![0.0; peak + 1];
    gradient[peak] = 1.0;
    let x = solve(&gradient, &rows, equalities, inequalities)?;
    let references = (0..stages.len()).map(|m| {
        let bounds = contact.joint_speed_bounds.iter().enumerate();
        // An interior point may be outside by its tolerance.
        bounds.map(|(joint, (least, most))| (x[width * m + joint] * scale.speed).clamp(*least, *most)).collect()
    });
    Ok(Solution { optimum_n: x[peak] * scale.force, references: references.collect() })
}

fn scale(contact: &Contact, start: &JointState, peak_before_n: f64) -> Scale {
    let speed = contact.joint_speed_bounds.iter().fold(0.0_f64, |most, (a, b)| most.max(a.abs()).max(b.abs()));
    let longest = contact.velocity_time_constant_s.iter().copied().fold(0.0, f64::max);
    // What the force would be if the arm coasted into the surface for one time constant.
    let inward = -product(&contact.arm.lever(&start.position, contact.normal), &start.velocity);
    let force = peak_before_n.abs() + contact.stiffness_n_m * inward.abs() * longest;
    Scale { speed: speed.max(1e-3), angle: speed.max(1e-3) * longest, force: force.max(1e-3) }
}

/// Velocity and position (the latter relative to the start) at the start of every input.
fn dynamics(contact: &Contact, start: &JointState, stages: &[Stage], scale: Scale, rows: &mut Rows) {
    let joints = contact.arm.joints();
    let width = STAGE * joints;
    for joint in 0..joints {
        let (velocity, position) = (joints + joint, 2 * joints + joint);
        rows.push(&[(velocity, 1.0)], start.velocity[joint] / scale.speed);
        rows.push(&[(position, 1.0)], 0.0);
        let time_constant = contact.velocity_time_constant_s[joint];
        for (m, stage) in stages.iter().enumerate().take(stages.len().saturating_sub(1)) {
            let (at, next) = (width * m, width * (m + 1));
            let (by_velocity, decay) = lag(time_constant, 1.0, 0.0, stage.duration_s);
            let (by_reference, gain) = lag(time_constant, 0.0, 1.0, stage.duration_s);
            rows.push(&[(next + velocity, 1.0), (at + velocity, -decay), (at + joint, -gain)], 0.0);
            let ratio = scale.speed / scale.angle;
            rows.push(
                &[
                    (next + position, 1.0),
                    (at + position, -1.0),
                    (at + velocity, -by_velocity * ratio),
                    (at + joint, -by_reference * ratio),
                ],
                0.0,
            );
        }
    }
}

/// What offsets cannot change about the references, in the pose in which each input begins.
fn kept(contact: &Contact, start: &JointState, stages: &[Stage], scale: Scale, rows: &mut Rows) {
    if contact.task.is_free(&contact.arm) {
        return;
    }
    let width = STAGE * contact.arm.joints();
    for (m, stage) in stages.iter().enumerate() {
        let position = &stage.state.as_ref().unwrap_or(start).position;
        let (kept, values) = contact.task.kept(&contact.arm, position, contact.normal, &contact.twist);
        for (row, value) in kept.iter().zip(values) {
            let entries: Vec<(usize, f64)> =
                row.iter().enumerate().map(|(joint, factor)| (width * m + joint, *factor)).collect();
            rows.push(&entries, value / scale.speed);
        }
    }
}

/// What the drives allow of the reference of one input: its change over the time that the one before was held, and
/// the change of that.
fn drive_rows(contact: &Contact, stages: &[Stage], m: usize, scale: Scale, rows: &mut Rows) {
    let Some(drives) = &contact.drives else { return };
    let width = STAGE * contact.arm.joints();
    let held = |m: usize| if m == 0 { contact.sampling_time_s } else { stages[m - 1].duration_s };
    for joint in 0..contact.arm.joints() {
        // (r_k − r_{k−1}) / h as entries and a number, in rad/s² or m/s².
        let change = |k: usize, sign: f64| {
            let factor = sign * scale.speed / held(k);
            let mut entries = vec![(width * k + joint, factor)];
            let known = if k == 0 { -sign * drives.before[joint] / held(0) } else { 0.0 };
            if k > 0 {
                entries.push((width * (k - 1) + joint, -factor));
            }
            (entries, known)
        };
        for sign in [1.0, -1.0] {
            let unit = 1.0 / drives.acceleration[joint];
            let scaled = |entries: Vec<(usize, f64)>, by: f64| -> Vec<(usize, f64)> {
                entries.into_iter().map(|(column, value)| (column, value * by)).collect()
            };
            let (entries, known) = change(m, sign);
            rows.push(&scaled(entries.clone(), unit), 1.0 - known * unit);
            // Before the first input the reference was steady.
            let (before, known_before) = if m == 0 { (Vec::new(), 0.0) } else { change(m - 1, -sign) };
            let unit = 1.0 / (drives.jerk[joint] * held(m));
            rows.push(&scaled([entries, before].concat(), unit), 1.0 - (known + known_before) * unit);
        }
    }
}

/// The force ≤ s at the instants of one input, its end included; without a variable for s,
/// penetration ≥ 0 there.
fn force_rows(
    contact: &Contact,
    start: &JointState,
    stage: &Stage,
    m: usize,
    peak: Option<usize>,
    scale: Scale,
    rows: &mut Rows,
) {
    let instants = (stage.duration_s / GRID_S - 1e-9).ceil().max(1.0) as u32;
    let joints = contact.arm.joints();
    let at = STAGE * joints * m;
    let sign = if peak.is_some() { 1.0 } else { -1.0 };
    // Damping counts in the force, not in whether there is contact.
    let damping_n_s_m = if peak.is_some() { contact.damping_n_s_m } else { 0.0 };
    for instant in 1..=instants {
        let time = stage.duration_s * f64::from(instant) / f64::from(instants);
        let around = match &stage.state {
            Some(state) => contact.advance(state, &stage.reference, time).position,
            None => start.position.clone(),
        };
        let weight = contact.weight(&around);
        let unit = contact.stiffness_n_m / scale.force * sign * weight;
        let by_rate = damping_n_s_m / scale.force * weight;
        // penetration(q) ≈ penetration(q̄) − g·(q − q̄), with q counted from the start.
        let lever = contact.arm.lever(&around, contact.normal);
        let moved: Vec<f64> = around.iter().zip(&start.position).map(|(around, start)| around - start).collect();
        let mut entries = Vec::with_capacity(1 + STAGE * joints);
        for (joint, lever) in lever.iter().enumerate() {
            let time_constant = contact.velocity_time_constant_s[joint];
            let (by_velocity, left) = lag(time_constant, 1.0, 0.0, time);
            let (by_reference, gained) = lag(time_constant, 0.0, 1.0, time);
            let (factor, rate) = (-unit * lever, -by_rate * lever);
            entries.push((at + joint, (factor * by_reference + rate * gained) * scale.speed));
            entries.push((at + joints + joint, (factor * by_velocity + rate * left) * scale.speed));
            entries.push((at + 2 * joints + joint, factor * scale.angle));
        }
        entries.extend(peak.map(|peak| (peak, -1.0)));
        rows.push(&entries, -unit * (contact.penetration_m(&around) + product(&lever, &moved)));
    }
}

fn solve(gradient: &[f64], rows: &Rows, equalities: usize, inequalities: usize) -> Result<Vec<f64>, NoAnswer> {
    let variables = gradient.len();
    let (mut i, mut j, mut v) = (Vec::new(), Vec::new(), Vec::new());
    for (row, column, value) in &rows.triplets {
        i.push(*row);
        j.push(*column);
        v.push(*value);
    }
    let matrix = CscMatrix::new_from_triplets(rows.bounds.len(), variables, i, j, v);
    let hessian = CscMatrix::spalloc((variables, variables), 0);
    let cones = [SupportedConeT::ZeroConeT(equalities), SupportedConeT::NonnegativeConeT(inequalities)];
    let mut status = String::new();
    for (tolerance, regularization) in ATTEMPTS {
        let settings = DefaultSettings {
            verbose: false,
            max_iter: MAX_ITERATIONS,
            tol_gap_abs: tolerance,
            tol_gap_rel: tolerance,
            tol_feas: tolerance,
            static_regularization_constant: regularization,
            max_threads: 1,
            presolve_enable: false,
            ..DefaultSettings::default()
        };
        let mut solver = DefaultSolver::new(&hessian, gradient, &matrix, &rows.bounds, &cones, settings)
            .map_err(|error| NoAnswer::Unsolved(format!("Clarabel: {error}")))?;
        solver.solve();
        match solver.solution.status {
            // "Almost" is a relative gap of 5e-5 at most: newtons / 20,000.
            SolverStatus::Solved | SolverStatus::AlmostSolved => return Ok(solver.solution.x.clone()),
            SolverStatus::PrimalInfeasible => return Err(NoAnswer::Contradicted),
            other => status = format!("Clarabel: {other:?} after {} iterations", solver.solution.iterations),
        }
    }
    Err(NoAnswer::Unsolved(status))
}
