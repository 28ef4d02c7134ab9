//! The fastest way out that the controller is allowed: a linear programme for Clarabel.

use admittance_runner::config::Config;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use plant_sim::pose::ArmPose;

/// The twist with the largest speed along `normal` where only the axes with admittance leave the twist
/// reference, none by more than its offset may be, within the joints' speeds. `None` where there is none.
///
/// With all axes free and no limit of the offset it is [`ArmPose::fastest_twist`].
pub(super) fn fastest_twist(
    config: &Config,
    pose: &ArmPose,
    normal: &[f64; 3],
    speeds: &[f64],
    reference: &[f64],
) -> Option<Vec<f64>> {
    let (jacobian, joints, axes) = (pose.jacobian(), speeds.len(), reference.len());
    let twist = |velocity: &[f64]| -> Vec<f64> {
        (0..axes).map(|axis| (0..joints).map(|joint| jacobian[joint][axis] * velocity[joint]).sum()).collect()
    };
    let reach = |axis: usize| match config.contact.admittance_axes[axis] {
        true => config.limits.velocity_offset[axis],
        false => 0.0,
    };
    // Joint velocities over their limits, so that all is of the order of one. First the rows of axes that keep
    // the reference, then J q̇ within the reach and q̇ within the limits, each a row and its negative.
    let mut columns = vec![Vec::new(); joints];
    let mut bounds = Vec::new();
    let of_axis = |axis: usize, sign: f64, columns: &mut [Vec<(usize, f64)>], bounds: &mut Vec<f64>| {
        for (joint, column) in columns.iter_mut().enumerate() {
            column.push((bounds.len(), sign * jacobian[joint][axis] * speeds[joint]));
        }
        bounds.push(sign * reference[axis] + reach(axis));
    };
    let (free, kept): (Vec<usize>, Vec<usize>) = (0..axes).partition(|&axis| config.contact.admittance_axes[axis]);
    for &axis in &kept {
        of_axis(axis, 1.0, &mut columns, &mut bounds);
    }
    for &axis in &free {
        for sign in [1.0, -1.0] {
            of_axis(axis, sign, &mut columns, &mut bounds);
        }
    }
    for column in &mut columns {
        for sign in [1.0, -1.0] {
            column.push((bounds.len(), sign));
            bounds.push(1.0);
        }
    }
    let along = |joint: usize| jacobian[joint].iter().zip(normal).map(|(moved, along)| moved * along).sum::<f64>();
    let cost: Vec<f64> = (0..joints).map(|joint| -along(joint) * speeds[joint]).collect();
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for column in &columns {
        let entries = column.iter().filter(|entry| entry.1 != 0.0);
        entries.for_each(|&(row, value)| {
            rows.push(row);
            values.push(value);
        });
        starts.push(rows.len());
    }
    let constraints = CscMatrix::new(bounds.len(), joints, starts, rows, values);
    let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
    let within = bounds.len() - kept.len();
    let cones = [SupportedConeT::ZeroConeT(kept.len()), SupportedConeT::NonnegativeConeT(within)];
    let mut solver =
        DefaultSolver::new(&CscMatrix::zeros((joints, joints)), &cost, &constraints, &bounds, &cones, settings).ok()?;
    solver.solve();
    if !matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return None;
    }
    let velocity: Vec<f64> = solver.solution.x.iter().zip(speeds).map(|(part, speed)| part * speed).collect();
    Some(twist(&velocity))
}
