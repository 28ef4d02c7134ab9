//! Sequences of the default profile's shape: solved warm as they are cold, the impact inside, the
//! same for the same seed.

use admittance_core::mpc::constraints::RowKind;
use admittance_core::mpc::qp::{QpOutcome, RowState};
use admittance_judge::clarabel_forms::{Form, Instance};
use admittance_judge::default_profile::{PROBLEMS, planar, spatial};
use admittance_judge::sequence::{Runner, Sequence, Start};

/// Seeds that are tried of each shape.
const SEEDS: u64 = 8;
/// Largest deviation from Clarabel at its own tolerance of 1e-8, m/s.
const CLARABEL_DEVIATION: f64 = 3e-4;

/// Kinds of rows that act in the sequences of every shape; those of the normal speed do in some.
const KINDS: [RowKind; 4] = [RowKind::Force, RowKind::Rate, RowKind::JointSpeed, RowKind::RestPosition];
/// In how many problems of a shape, at the least.
const PROBLEMS_WITH: usize = 32;
/// Active rows of the normal speed, at the least.
const SLOWED: usize = 5;

/// Solves the sequences of a shape. The number of active rows that bound the speed into the
/// surface.
fn check<const N: usize, const M: usize>(shape: &str, sequence: impl Fn(u64) -> Sequence<N, M>) -> usize {
    let (mut slowed, mut problems_with) = (0, [0; KINDS.len()]);
    for seed in 0..SEEDS {
        let (with, rows) = check_one(&format!("{shape}, seed {seed}"), &sequence(seed));
        problems_with.iter_mut().zip(with).for_each(|(sum, count)| *sum += count);
        slowed += rows;
    }
    for (kind, count) in KINDS.into_iter().zip(problems_with) {
        assert!(count >= PROBLEMS_WITH, "{shape}: {kind:?} rows are active in {count} problems");
    }
    slowed
}

/// Solves a sequence warm. The problems with active rows of each of [`KINDS`], and the active rows
/// of the normal speed.
fn check_one<const N: usize, const M: usize>(name: &str, sequence: &Sequence<N, M>) -> ([usize; KINDS.len()], usize) {
    assert_eq!(sequence.problems.len(), PROBLEMS);
    let mut runner = Runner::new(sequence);
    let (mut most, mut at_limit, mut worst, mut total) = (0, Vec::new(), 0.0_f64, 0);
    let mut rows_per_kind = Vec::new();
    let mut problems_with = KINDS.map(|kind| (kind, 0));
    for index in 0..PROBLEMS {
        let (outcome, deviation, residual) = runner.deviation(sequence, index, Start::Warm);
        assert!(matches!(outcome, QpOutcome::Solved { .. }), "{name} {index}: {outcome:?}");
        assert!(deviation <= 1e-9, "{name} {index}: off by {deviation:e}");
        assert!(residual.is_within(1e-9), "{name} {index}: {residual:?}");
        most = most.max(outcome.iterations());
        worst = worst.max(deviation);
        total += outcome.iterations();
        let active = runner.solve(sequence, index, Start::Cold, |_, rows, _, answer, _| {
            let active = answer.working.iter().enumerate().filter(|(_, state)| **state != RowState::Inactive);
            let kinds: Vec<RowKind> = active.filter_map(|(row, _)| Some(rows.layout.row(row)?.kind)).collect();
            (kinds, rows.layout.rows())
        });
        if active.0.contains(&RowKind::Force) {
            at_limit.push(index);
        }
        for (kind, count) in &mut problems_with {
            *count += usize::from(active.0.contains(kind));
        }
        rows_per_kind.extend(active.0);
        if index == 0 {
            println!("{name}: {} variables, {} rows", M * sequence.horizon.steps().len(), active.1);
        }
    }
    let count = |kind: RowKind| rows_per_kind.iter().filter(|other| **other == kind).count();
    println!(
        "{name}: force active in {} problems, {:?}..{:?}; active rows: force {}, rate {}, normal speed {}, joint speed {}, \
         position {}; \
         iterations {:.1} in the mean, {most} at most; off by {worst:.1e}",
        at_limit.len(),
        at_limit.first(),
        at_limit.last(),
        count(RowKind::Force),
        count(RowKind::Rate),
        count(RowKind::NormalSpeed),
        count(RowKind::JointSpeed),
        count(RowKind::RestPosition),
        f64::from(total) / PROBLEMS as f64,
    );
    println!("{name}: problems with active rows {problems_with:?}");
    assert!(at_limit.first().is_some_and(|first| *first > 5), "{name}: the impact is inside, {at_limit:?}");
    (problems_with.map(|(_, problems)| problems), count(RowKind::NormalSpeed))
}

#[test]
fn planar_sequences_are_solved() {
    let slowed = check("planar 4 ms", |seed| planar(0.004, seed).expect("a solved sequence"))
        + check("planar 1 ms", |seed| planar(0.001, seed).expect("a solved sequence"));
    assert!(slowed >= SLOWED, "{slowed} active rows of the normal speed");
}

#[test]
fn spatial_sequences_are_solved() {
    let slowed = check("1 axis", |seed| spatial::<1>(seed).expect("a solved sequence"))
        + check("3 axes", |seed| spatial::<3>(seed).expect("a solved sequence"))
        + check("6 axes", |seed| spatial::<6>(seed).expect("a solved sequence"));
    assert!(slowed >= SLOWED, "{slowed} active rows of the normal speed");
}

#[test]
fn a_seed_gives_one_sequence() {
    let bits = |seed| {
        let sequence = spatial::<3>(seed).expect("a solved sequence");
        sequence
            .problems
            .iter()
            .flat_map(|p| p.solution.iter().map(|u| u.to_bits()).collect::<Vec<_>>())
            .collect::<Vec<_>>()
    };
    assert_eq!(bits(1), bits(1));
    assert_ne!(bits(1), bits(2));
}

/// Clarabel in the condensed form against the solver: rows that left something out would change the
/// solution.
fn compare<const N: usize, const M: usize>(name: &str, sequence: &Sequence<N, M>) {
    let mut runner = Runner::new(sequence);
    let forms: Vec<Form> = (0..PROBLEMS).map(|index| Form::condensed(&mut runner, sequence, index)).collect();
    let mut instance = Instance::new(&forms[0], true);
    let (mut worst, mut unsolved) = (0.0_f64, 0);
    for (index, form) in forms.iter().enumerate() {
        let values = instance.prepare(form);
        if !instance.solve(form, &values) {
            unsolved += 1;
            continue;
        }
        worst = runner.solve(sequence, index, Start::Cold, |_, _, _, answer, _| {
            let both = instance.solution().iter().zip(answer.z.iter());
            both.fold(worst, |worst, (judge, z)| worst.max((judge - z).abs()))
        });
    }
    println!("{name}: off from Clarabel by {worst:.1e} m/s at most, {unsolved} not solved by it");
    assert!(
        worst <= CLARABEL_DEVIATION && unsolved <= PROBLEMS / 10,
        "{name}: off by {worst:e}, {unsolved} not solved"
    );
}

#[test]
fn clarabel_finds_the_same_inputs() {
    compare("planar 4 ms", &planar(0.004, 0).expect("a solved sequence"));
    compare("planar 1 ms", &planar(0.001, 0).expect("a solved sequence"));
    compare("1 axis", &spatial::<1>(0).expect("a solved sequence"));
    compare("3 axes", &spatial::<3>(0).expect("a solved sequence"));
}
