//! Clarabel's sparse form against the core's solver: the two have nothing in common but the
//! problem.

use std::path::PathBuf;

use admittance_core::mpc::qp::QpOutcome;
use admittance_judge::clarabel_forms::{Form, Instance};
use admittance_judge::default_profile::{planar, spatial};
use admittance_judge::problem_file::{ProblemFile, Task};
use admittance_judge::sequence::{Runner, Sequence, Start};

const FILES: [&str; 6] = ["d2_h5", "d6c1_h20", "d6c3_h10", "d6c3_h20", "d6c6_h10", "d6c6_h20"];
/// Every so many problems of a sequence, one is compared.
const STRIDE: usize = 8;
/// Of Clarabel: the first that it reaches counts. The sparse form leaves out the constant of the
/// cost, which makes a relative gap mean little.
const TOLERANCES: [f64; 4] = [1e-14, 1e-13, 1e-12, 1e-11];
/// Largest difference, relative to the largest input of the problem.
const DIFFERENCE: f64 = 1e-6;

/// Inputs by Clarabel, step by step.
fn judged<const N: usize, const M: usize>(name: &str, sequence: &Sequence<N, M>, index: usize) -> Vec<f64> {
    let form = Form::sparse(sequence, index);
    let solution = TOLERANCES.iter().find_map(|tolerance| {
        let mut instance = Instance::exact(&form, *tolerance);
        let values = instance.prepare(&form);
        instance.solve(&form, &values).then(|| instance.solution().to_vec())
    });
    let all = solution.unwrap_or_else(|| panic!("{name} {index}: not solved by Clarabel"));
    all[all.len() - M * sequence.horizon.steps().len()..].to_vec()
}

/// Compares the inputs of some problems.
fn compare<const N: usize, const M: usize>(name: &str, sequence: &Sequence<N, M>) {
    let mut runner = Runner::new(sequence);
    let (mut worst, mut compared) = (0.0_f64, 0);
    for index in (0..sequence.problems.len()).step_by(STRIDE) {
        let judged = judged(name, sequence, index);
        let (difference, size) = runner.solve(sequence, index, Start::Cold, |outcome, rows, _, answer, _| {
            assert!(matches!(outcome, QpOutcome::Solved { .. }), "{name} {index}: {outcome:?}");
            let inputs = (0..sequence.horizon.steps().len()).flat_map(|step| answer.z[rows.inputs_of(step)].to_vec());
            let pairs = judged.iter().zip(inputs);
            pairs.fold((0.0_f64, 0.0_f64), |(most, size), (a, b)| (most.max((a - b).abs()), size.max(a.abs())))
        });
        // Where nothing is in the way all inputs are zero.
        let relative = difference / size.max(1e-3);
        assert!(relative <= DIFFERENCE, "{name} {index}: off by {relative:e} of {size}");
        (worst, compared) = (worst.max(relative), compared + 1);
    }
    println!("{name}: off by {worst:.1e} at most in {compared} problems");
}

struct Compare<'a>(&'a str);

impl Task for Compare<'_> {
    type Output = ();

    fn run<const N: usize, const M: usize>(self, sequence: &Sequence<N, M>) {
        compare(self.0, sequence);
    }
}

#[test]
fn files_have_the_same_solutions_in_the_sparse_form() {
    for name in FILES {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("problems").join(format!("{name}.bin"));
        ProblemFile::read(&path).expect("a file of problems").run(Compare(name));
    }
}

#[test]
fn generated_sequences_have_the_same_solutions_in_the_sparse_form() {
    compare("planar 4 ms", &planar(0.004, 0).expect("a solved sequence"));
    compare("planar 1 ms", &planar(0.001, 0).expect("a solved sequence"));
    compare("1 axis", &spatial::<1>(0).expect("a solved sequence"));
    compare("3 axes", &spatial::<3>(0).expect("a solved sequence"));
    compare("6 axes", &spatial::<6>(0).expect("a solved sequence"));
}
