//! Random problems of up to 120 variables and 240 rows against Clarabel: 200, or as many as
//! ADMITTANCE_LARGE_PROBLEMS says.

use admittance_judge::judge::Defendant;
use admittance_judge::random_qp::DenseQp;

const VARIABLES: usize = 120;
const ROWS: usize = 240;

#[test]
fn large_random_problems_are_judged_alike() {
    let problems: u64 = std::env::var("ADMITTANCE_LARGE_PROBLEMS")
        .map_or(200, |text| text.parse().expect("ADMITTANCE_LARGE_PROBLEMS is a number of problems"));
    let tally = Defendant::new(VARIABLES, ROWS + 1)
        .try_problems((0..problems).map(|seed| (seed, DenseQp::random_up_to(seed, VARIABLES, ROWS))));
    println!(
        "{} solved, {} Clarabel off ({} of both after a second look), {} infeasible, {} excluded, at most {} iterations",
        tally.solved, tally.judge_off, tally.appeals, tally.infeasible, tally.excluded, tally.most_iterations
    );
    assert!(tally.disagreements.is_empty(), "{:?}", tally.disagreements);
}

#[test]
fn large_problems_on_which_clarabel_is_off_are_solved_exactly() {
    // 80 digits confirm the solver's answers to 3e-13 of their size.
    let tally = Defendant::new(VARIABLES, ROWS + 1)
        .try_problems([697, 1635, 1915].map(|seed| (seed, DenseQp::random_up_to(seed, VARIABLES, ROWS))));
    assert!(tally.disagreements.is_empty(), "{:?}", tally.disagreements);
    assert_eq!(tally.solved + tally.judge_off, 3);
}
