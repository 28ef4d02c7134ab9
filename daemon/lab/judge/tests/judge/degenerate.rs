//! Degenerate problems with solutions that are known by hand: each rule of the solver's
//! documentation has its test.

use admittance_core::mpc::qp::{
    ActiveSet, Answer, QpOutcome, QpSolver, RowState, SolverCapacity, certificate_gap, kkt_residual, padded,
};
use admittance_judge::judge::{Defendant, Plea};
use admittance_judge::random_qp::DenseQp;

const ROUNDING: f64 = 1e-10;

/// ½ |z − to|².
fn towards(to: &[f64]) -> DenseQp {
    DenseQp::new(to.len(), |row, column| if row == column { 1.0 } else { 0.0 }, |i| -to[i])
}

fn solve(problem: &DenseQp) -> Plea {
    solve_from(problem, vec![RowState::Inactive; problem.rows.count()])
}

fn solve_from(problem: &DenseQp, working: Vec<RowState>) -> Plea {
    Defendant::new(problem.variables, problem.rows.count()).solve(&problem.qp(), working)
}

fn assert_solution(problem: &DenseQp, plea: &Plea, expected: &[f64]) {
    assert!(matches!(plea.outcome, QpOutcome::Solved { .. }), "{:?}", plea.outcome);
    for (z, expected) in plea.z.iter().zip(expected) {
        assert!((z - expected).abs() <= ROUNDING, "{:?}, not {expected:?}", plea.z);
    }
    let mut scratch = vec![0.0; 3 * padded(problem.variables) + padded(problem.rows.count())];
    let residual = kkt_residual(&problem.qp(), &plea.z, &plea.multipliers, &mut scratch);
    assert!(residual.is_within(ROUNDING), "{residual:?}");
}

#[test]
fn without_rows_the_minimum_is_the_answer() {
    let problem = towards(&[3.0, -2.0, 1.0]);
    assert_solution(&problem, &solve(&problem), &[3.0, -2.0, 1.0]);
}

#[test]
fn of_parallel_rows_the_tighter_one_holds() {
    // As the force rows of two axes on an inclined plane: one force, two bounds.
    let mut problem = towards(&[4.0, 4.0]);
    problem.push(&[1.0, 1.0], 0.0, 4.0);
    problem.push(&[0.5, 0.5], 0.0, 1.0);
    problem.push(&[-3.0, -3.0], -15.0, 0.0);
    let plea = solve(&problem);
    assert_solution(&problem, &plea, &[1.0, 1.0]);
    assert_eq!(plea.working, [RowState::Inactive, RowState::Upper, RowState::Inactive]);
}

#[test]
fn the_same_row_twice_counts_once() {
    let mut problem = towards(&[4.0, 0.0]);
    for _ in 0..3 {
        problem.push(&[2.0, 1.0], f64::NEG_INFINITY, 3.0);
    }
    // The nearest point to (4, 0) with 2a + b = 3.
    let plea = solve(&problem);
    assert_solution(&problem, &plea, &[2.0, -1.0]);
    assert_eq!(plea.working.iter().filter(|state| **state != RowState::Inactive).count(), 1);
    // All of them guessed: the first is taken, the others depend on it.
    assert_solution(&problem, &solve_from(&problem, vec![RowState::Upper; 3]), &[2.0, -1.0]);
}

#[test]
fn rows_that_differ_by_rounding_are_one() {
    let mut problem = towards(&[4.0, 0.0]);
    for index in 0..8 {
        problem.push(&[2.0 + 1e-13 * f64::from(index), 1.0], f64::NEG_INFINITY, 3.0);
    }
    assert_solution(&problem, &solve(&problem), &[2.0, -1.0]);
    assert_solution(&problem, &solve_from(&problem, vec![RowState::Upper; 8]), &[2.0, -1.0]);
}

#[test]
fn nearly_parallel_rows_stay_apart() {
    // Both push at (1, 1), with multiplier 1; their angle is 1e-5.
    let mut problem = towards(&[3.0, 1.0 + 1e-5]);
    problem.push(&[1.0, 0.0], f64::NEG_INFINITY, 1.0);
    problem.push(&[1.0, 1e-5], f64::NEG_INFINITY, 1.0 + 1e-5);
    let plea = solve(&problem);
    assert!(matches!(plea.outcome, QpOutcome::Solved { .. }), "{:?}", plea.outcome);
    assert!((plea.z[0] - 1.0).abs() <= 1e-6 && (plea.z[1] - 1.0).abs() <= 1e-6, "{:?}", plea.z);
}

#[test]
fn many_rows_through_one_point_do_not_cycle() {
    // A fan of 60 rows through the origin in the plane; the minimum is cut off by all of them.
    let mut problem = towards(&[1.0, 10.0]);
    for index in 0..60 {
        let angle = 0.2 + 2.7 * f64::from(index) / 60.0;
        problem.push(&[angle.cos(), angle.sin()], f64::NEG_INFINITY, 0.0);
    }
    let plea = solve(&problem);
    assert_solution(&problem, &plea, &[0.0, 0.0]);
    assert!(plea.outcome.iterations() <= 60, "{:?}", plea.outcome);
}

#[test]
fn of_equally_violated_rows_the_first_is_taken() {
    let mut problem = towards(&[2.0, 2.0]);
    problem.push(&[1.0, 0.0], f64::NEG_INFINITY, 1.0);
    problem.push(&[0.0, 1.0], f64::NEG_INFINITY, 1.0);
    problem.push(&[1.0, 0.0], f64::NEG_INFINITY, 1.0);
    let plea = solve(&problem);
    assert_solution(&problem, &plea, &[1.0, 1.0]);
    assert_eq!(plea.working, [RowState::Upper, RowState::Upper, RowState::Inactive]);
}

#[test]
fn equalities_hold_from_either_side() {
    let mut problem = towards(&[5.0, 0.0]);
    problem.push(&[1.0, 1.0], 2.0, 2.0);
    problem.push(&[1.0, -1.0], -6.0, -6.0);
    assert_solution(&problem, &solve(&problem), &[-2.0, 4.0]);
    for guess in [RowState::Lower, RowState::Upper] {
        assert_solution(&problem, &solve_from(&problem, vec![guess; 2]), &[-2.0, 4.0]);
    }
}

#[test]
fn weights_over_seven_decades_keep_their_digits() {
    // H from 1e-3.5 to 1e3.5, every other variable at its bound.
    let weight = |i: usize| 10.0_f64.powf(-3.5 + i as f64);
    let mut problem =
        DenseQp::new(8, |row, column| if row == column { weight(row) } else { 0.0 }, |i| -2.0 * weight(i));
    for i in (0..8).step_by(2) {
        problem.push(&std::array::from_fn::<_, 8, _>(|j| f64::from(i == j)), -1.0, 1.0);
    }
    assert_solution(&problem, &solve(&problem), &[1.0, 2.0, 1.0, 2.0, 1.0, 2.0, 1.0, 2.0]);
}

#[test]
fn any_guess_leads_to_the_same_answer() {
    let mut problem = towards(&[3.0, -3.0, 2.0]);
    problem.push(&[1.0, 0.0, 0.0], -1.0, 1.0);
    problem.push(&[0.0, 1.0, 0.0], -1.0, 1.0);
    problem.push(&[1.0, 1.0, 1.0], -0.5, 0.5);
    let states = [RowState::Inactive, RowState::Lower, RowState::Upper];
    let expected = solve(&problem).z;
    for guess in 0..27 {
        let guess = [guess % 3, guess / 3 % 3, guess / 9].map(|state| states[state]);
        assert_solution(&problem, &solve_from(&problem, guess.to_vec()), &expected[..3]);
    }
}

#[test]
fn a_row_that_another_meets_exactly_does_not_cycle() {
    // Both rows hold at (0, −1), the first without pushing: adding the second lets it go by a hair
    // before the full step.
    let mut problem = DenseQp::new(2, |i, j| if i == j { [0.1_f64.sqrt(), 1.0][i] } else { 0.0 }, |_| 0.0);
    problem.push(&[-1.0, -1.0], 1.0, f64::INFINITY);
    problem.push(&[0.0, -1.0], 1.0, f64::INFINITY);
    assert_solution(&problem, &solve(&problem), &[0.0, -1.0]);
    // The same at a minimum cut off by one row only.
    let mut problem = towards(&[0.0, -1.0]);
    problem.push(&[1.0, 3.0], 0.0, f64::INFINITY);
    problem.push(&[0.0, -1.0], f64::NEG_INFINITY, 0.0);
    assert_solution(&problem, &solve(&problem), &[0.0, 0.0]);
    let mut problem = DenseQp::new(2, |i, j| if i == j { [1.0, 100.0][i] } else { 0.0 }, |i| [-2.0, 0.0][i]);
    problem.push(&[1.0, 1.0], f64::NEG_INFINITY, 0.0);
    problem.push(&[1.0, 0.0], f64::NEG_INFINITY, 0.0);
    assert_solution(&problem, &solve(&problem), &[0.0, 0.0]);
}

#[test]
fn a_row_that_does_not_push_does_not_pull() {
    // The minimum without the other rows lies on the last: its multiplier is nothing but rounding,
    // and of either sign.
    let mut problem = DenseQp::new(3, |i, j| if i == j { [1.0, 0.001, 1.0][i] } else { 0.0 }, |i| [2.0, 0.0, 0.0][i]);
    problem.push(&[1.0, 1.0, 1.0], f64::NEG_INFINITY, 18.0);
    problem.push(&[0.0, 0.0, -1.0], 0.0, f64::INFINITY);
    problem.push(&[1.0, 0.0, 0.0], 0.0, f64::INFINITY);
    let plea = solve_from(&problem, vec![RowState::Upper, RowState::Lower, RowState::Lower]);
    assert_solution(&problem, &plea, &[0.0, 0.0, 0.0]);
}

#[test]
fn a_contradiction_is_proven_with_its_size() {
    // z0 ≤ 1 and z0 ≥ 2 cannot both be met: some row is violated by 0.5 at the least.
    let mut problem = towards(&[0.0, 0.0]);
    problem.push(&[0.0, 1.0], -1.0, 1.0);
    problem.push(&[1.0, 0.0], f64::NEG_INFINITY, 1.0);
    problem.push(&[-1.0, 0.0], f64::NEG_INFINITY, -2.0);
    let plea = solve(&problem);
    assert!(matches!(plea.outcome, QpOutcome::Infeasible { .. }), "{:?}", plea.outcome);
    let mut scratch = [0.0; 4];
    let gap = certificate_gap(&problem.qp(), &plea.multipliers, 1e6, &|_| true, &mut scratch);
    assert!(gap.is_some_and(|gap| (gap - 0.5).abs() <= ROUNDING), "{gap:?}");
    // Where only one of the two may give, it has to give all.
    let gap = certificate_gap(&problem.qp(), &plea.multipliers, 1e6, &|row| row == 1, &mut scratch);
    assert!(gap.is_some_and(|gap| (gap - 1.0).abs() <= ROUNDING), "{gap:?}");
}

#[test]
fn a_certificate_that_proves_nothing_is_refused() {
    let mut problem = towards(&[0.0]);
    problem.push(&[1.0], -1.0, 1.0);
    for multiplier in [1.0, -1.0, 0.0, f64::NAN] {
        let gap = certificate_gap(&problem.qp(), &[multiplier], 1e3, &|_| true, &mut [0.0; 4]);
        assert_eq!(gap, None, "{multiplier}");
    }
}

#[test]
fn more_contradictions_than_variables_end() {
    let mut problem = towards(&[0.0, 0.0, 0.0]);
    for index in 0..30 {
        let angle = f64::from(index);
        problem.push(&[angle.sin(), angle.cos(), 1.0], 1.0, 2.0);
        problem.push(&[-angle.sin(), -angle.cos(), -1.0], 1.0, 2.0);
    }
    let plea = solve(&problem);
    assert!(matches!(plea.outcome, QpOutcome::Infeasible { .. }), "{:?}", plea.outcome);
    let gap = certificate_gap(&problem.qp(), &plea.multipliers, 1e3, &|_| true, &mut [0.0; 4]);
    assert!(gap.is_some(), "{:?}", plea.multipliers);
}

/// The outcome with a limit of iterations, and time up after some questions.
fn limited(problem: &DenseQp, max_iterations: u32, questions: u32) -> QpOutcome {
    limited_from(problem, RowState::Inactive, max_iterations, questions)
}

/// As [`limited`], with one guess for all rows.
fn limited_from(problem: &DenseQp, guess: RowState, max_iterations: u32, mut questions: u32) -> QpOutcome {
    let capacity = SolverCapacity { variables: problem.variables, rows: problem.rows.count() };
    let mut solver =
        ActiveSet::new(capacity, max_iterations, vec![0.0; capacity.storage_len()]).expect("a small problem");
    let (mut z, mut multipliers) = (vec![0.0; padded(problem.variables)], vec![0.0; problem.rows.count()]);
    let mut working = vec![guess; problem.rows.count()];
    let mut answer = Answer { z: &mut z, multipliers: &mut multipliers, working: &mut working };
    let mut expired = || {
        questions = questions.saturating_sub(1);
        questions == 0
    };
    solver.solve(&problem.qp(), &mut answer, &mut expired)
}

#[test]
fn work_is_bounded() {
    let mut problem = towards(&[9.0; 8]);
    for i in 0..8 {
        problem.push(&std::array::from_fn::<_, 8, _>(|j| f64::from(i == j)), -1.0, 1.0);
    }
    assert_eq!(limited(&problem, 8, u32::MAX), QpOutcome::Solved { iterations: 8 });
    assert_eq!(limited(&problem, 7, u32::MAX), QpOutcome::Failed { iterations: 7 });
    assert_eq!(limited(&problem, 8, 1), QpOutcome::Expired { iterations: 0 });
    assert_eq!(limited(&problem, 8, 4), QpOutcome::Expired { iterations: 3 });
    // A wrong guess: every row has to leave again, and counts.
    let mut far = towards(&[0.0; 8]);
    for i in 0..8 {
        far.push(&std::array::from_fn::<_, 8, _>(|j| f64::from(i == j)), -1.0, 1.0);
    }
    assert_eq!(limited_from(&far, RowState::Upper, 8, u32::MAX), QpOutcome::Solved { iterations: 8 });
    assert_eq!(limited_from(&far, RowState::Upper, 7, u32::MAX), QpOutcome::Failed { iterations: 7 });
    assert_eq!(limited_from(&far, RowState::Upper, 8, 3), QpOutcome::Expired { iterations: 2 });
    let small = towards(&[1.0]);
    let capacity = SolverCapacity { variables: 200, rows: 1 };
    assert!(ActiveSet::new(capacity, 1, vec![0.0; capacity.storage_len()]).is_none(), "more than MAX_VARIABLES");
    let capacity = SolverCapacity { variables: 1, rows: 0 };
    assert!(ActiveSet::new(capacity, 1, vec![0.0; capacity.storage_len() - 1]).is_none(), "too little storage");
    assert_eq!(limited(&small, 0, u32::MAX), QpOutcome::Solved { iterations: 0 });
}

#[test]
fn what_is_no_problem_is_no_solution() {
    let indefinite = DenseQp::new(2, |row, column| if row == column { 1.0 } else { 2.0 }, |_| 1.0);
    assert_eq!(solve(&indefinite).outcome, QpOutcome::Failed { iterations: 0 });
    let not_a_number = DenseQp::new(2, |row, column| if row == column { f64::NAN } else { 0.0 }, |_| 1.0);
    assert_eq!(solve(&not_a_number).outcome, QpOutcome::Failed { iterations: 0 });
    // A gradient that is no number passes no check.
    let problem = towards(&[f64::NAN, 0.0]);
    let plea = solve(&problem);
    let residual = kkt_residual(&problem.qp(), &plea.z, &plea.multipliers, &mut [0.0; 16]);
    assert!(!residual.is_within(1e3), "{residual:?}");
}
