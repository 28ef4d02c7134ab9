//! The exact solution from a working set: only from the right one, and to the last digit.

use admittance_core::mpc::qp::{QpOutcome, RowState};
use admittance_judge::exact;
use admittance_judge::judge::Defendant;
use admittance_judge::random_qp::{DenseQp, MAX_ROWS, MAX_VARIABLES};

#[test]
fn a_solution_that_can_be_written_down_is_exact() {
    // ½ (x² + 3 y²) − x − y, x + y ≤ 0.5, y ≥ −5.
    let mut problem = DenseQp::new(2, |i, j| if i == j { 1.0 + 2.0 * i as f64 } else { 0.0 }, |_| -1.0);
    problem.push(&[1.0, 1.0], f64::NEG_INFINITY, 0.5);
    problem.push(&[0.0, 1.0], -5.0, f64::INFINITY);
    // x − 1 + λ = 0, 3 y − 1 + λ = 0: x = 3 y, 4 y = 0.5.
    let found = exact::solution(&problem, &[RowState::Upper, RowState::Inactive]);
    assert_eq!(found, Some(vec![0.375, 0.125]));
    assert_eq!(exact::solution(&problem, &[RowState::Inactive, RowState::Inactive]), None, "the first row is not met");
    assert_eq!(exact::solution(&problem, &[RowState::Upper, RowState::Lower]), None, "the second row pulls");
}

#[test]
fn only_the_working_set_of_the_solution_gives_one() {
    let mut defendant = Defendant::new(MAX_VARIABLES, MAX_ROWS + 1);
    let (mut proved, mut refused) = (0, 0);
    for seed in 0..60 {
        let problem = DenseQp::random(seed);
        let qp = problem.qp();
        let plea = defendant.solve(&qp, vec![RowState::Inactive; qp.row_count]);
        if !matches!(plea.outcome, QpOutcome::Solved { .. }) {
            continue;
        }
        let exact = exact::solution(&problem, &plea.working).expect("the solver's working set");
        let size = exact.iter().fold(1.0_f64, |size, z| size.max(z.abs()));
        let off = exact.iter().zip(&plea.z).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / size;
        assert!(off <= 1e-10, "{seed}: off by {off:e}");
        proved += 1;
        for row in 0..qp.row_count {
            // A row that pushes hard, left out; one that is far away, taken in.
            let mut working = plea.working.clone();
            working[row] = match working[row] {
                RowState::Inactive => RowState::Upper,
                _ if plea.multipliers[row].abs() > 1e-6 => RowState::Inactive,
                _ => continue,
            };
            let Some(other) = exact::solution(&problem, &working) else {
                refused += 1;
                continue;
            };
            // Rows that coincide can stand for one another.
            let off = exact.iter().zip(&other).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / size;
            assert!(off <= 1e-10, "{seed}, row {row}: another solution, {off:e} away");
        }
    }
    println!("{proved} proved, {refused} other working sets refused");
    assert!(proved > 20 && refused > 200);
}
