//! From the matrices of a file to a sequence of problems of the core.

use admittance_core::mpc::condensation::InputAxes;
use admittance_core::mpc::constraints::{AxisBound, Constraints, ForceBounds};
use admittance_core::mpc::cost::{SetPoint, Weights};
use admittance_core::mpc::horizon::Horizon;
use admittance_core::mpc::model::{Discretization, Model, State};
use admittance_core::robot::{Interval, VelocityLoops};
use nalgebra::{SMatrix, SVector};

use super::ProblemFile;
use crate::sequence::{Problem, Sequence};

impl ProblemFile {
    pub(super) fn sequence<const N: usize, const M: usize>(&self) -> Sequence<N, M> {
        let (nx, nc) = (self.states(), self.forces);
        let first = &self.records[0].a;
        let t = self.sampling_time();
        let lag = |row: usize| t / (1.0 - first[row * nx + row]);
        let velocity_time_constant = SVector::<f64, N>::from_fn(|i, _| lag(N + i));
        // Axes without a force have no estimate; any constant will do.
        let axes = |value: &dyn Fn(usize) -> f64, other: f64| {
            SVector::<f64, N>::from_fn(|axis, _| if axis < nc { value(axis) } else { other })
        };
        let joints = |values: &[f64]| SVector::<f64, N>::from_column_slice(values);
        let weight = &self.state_weight;
        let problems = self.records.iter().map(|record| {
            let known = SVector::<f64, N>::from_fn(|i, _| record.c[N + i] * velocity_time_constant[i] / t);
            let mut force = ForceBounds::none();
            for axis in 0..nc {
                let (minimum, maximum) = (record.f_lower[axis], record.f_upper[axis]);
                force.push(AxisBound { axis, sign: 1.0, minimum, maximum });
            }
            let joint_speed =
                Interval { lower: joints(&record.v_lower) + known, upper: joints(&record.v_upper) + known };
            let x = |values: &[f64]| {
                let wrench = axes(&|axis| values[2 * N + axis], 0.0);
                State::<N, N>::moving(joints(&values[..N]), joints(&values[N..2 * N]), wrench)
            };
            let reference = x(&record.set_point);
            Problem {
                model: Model {
                    jacobian_inverse: SMatrix::from_fn(|joint, axis| {
                        if axis < M { record.jacobian_inverse[joint * M + axis] } else { 0.0 }
                    }),
                    wrench_gradient: SMatrix::from_fn(
                        |joint, axis| {
                            if axis < nc { record.f[axis * N + joint] } else { 0.0 }
                        },
                    ),
                    wrench_offset: axes(&|axis| record.f0[axis], 0.0),
                },
                initial: x(&record.initial),
                known_reference: vec![known; self.horizon],
                drift: SVector::zeros(),
                constraints: Constraints { joint_speed: Some(joint_speed), ..Constraints::of_force(force) },
                set_point: SetPoint {
                    joint_position: reference.joint_position,
                    joint_velocity: reference.joint_velocity,
                    wrench: reference.wrench,
                    input: SVector::zeros(),
                    fading_velocity: SVector::zeros(),
                    fading_input: SVector::zeros(),
                },
                jacobian: SMatrix::zeros(),
                previous_input: SVector::zeros(),
                solution: record.solution.clone(),
            }
        });
        Sequence {
            horizon: Horizon::new(
                Discretization::Euler,
                &vec![t; self.horizon],
                |_| &[],
                &VelocityLoops::first_order(velocity_time_constant),
                &axes(&|axis| lag(2 * N + axis), 0.02),
            ),
            inputs: InputAxes::from_mask(&std::array::from_fn(|axis| axis < M)),
            wrench_axes: InputAxes::from_mask(&std::array::from_fn(|axis| axis < nc)),
            weights: Weights::Joint {
                position: joints(&weight[..N]),
                velocity: joints(&weight[N..2 * N]),
                wrench: axes(&|axis| weight[2 * N + axis], 0.0),
            },
            input_weight: SVector::from_fn(|axis, _| if axis < M { self.input_weight[axis] } else { 1.0 }),
            problems: problems.collect(),
        }
    }
}
