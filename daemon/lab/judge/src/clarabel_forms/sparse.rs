//! The sparse form: states and inputs are variables, the dynamics equalities.

use admittance_core::mpc::Weights;
use nalgebra::SMatrix;

use super::Form;
use crate::sequence::{Problem, Sequence};

/// Writes the sparse form of one problem: x_1..x_H (q, q̇, then f̂ on the wrench axes), then
/// u_0..u_{H−1}.
pub(super) struct SparseBuilder<'a, const N: usize, const M: usize> {
    sequence: &'a Sequence<N, M>,
    problem: &'a Problem<N>,
    axes: &'a [usize],
    wrench_axes: &'a [usize],
    form: Form,
}

impl<'a, const N: usize, const M: usize> SparseBuilder<'a, N, M> {
    pub(super) fn new(sequence: &'a Sequence<N, M>, problem: &'a Problem<N>) -> Self {
        Self {
            sequence,
            problem,
            axes: sequence.inputs.as_slice(),
            wrench_axes: sequence.wrench_axes.as_slice(),
            form: Form::default(),
        }
    }

    fn steps(&self) -> usize {
        self.sequence.horizon.steps().len()
    }

    fn states(&self) -> usize {
        2 * N + self.wrench_axes.len()
    }

    /// Column of q at the start of step `step`, from 1 on; q̇ and f̂ follow.
    fn state(&self, step: usize) -> usize {
        (step - 1) * self.states()
    }

    /// Column of the first input in step `step`.
    fn input(&self, step: usize) -> usize {
        self.steps() * self.states() + step * M
    }

    pub(super) fn build(mut self) -> Form {
        let variables = self.steps() * (self.states() + M);
        self.form.gradient = vec![0.0; variables];
        self.push_cost();
        self.push_dynamics();
        self.form.equalities = self.form.bounds.len();
        for sign in [1.0, -1.0] {
            self.push_force_rows(sign);
            self.push_joint_rows(sign);
            self.push_input_rows(sign);
        }
        self.form
    }

    fn push_cost(&mut self) {
        let (sequence, problem) = (self.sequence, self.problem);
        let set_point = &problem.set_point;
        // No sequence fades; the core's own tests have problems that do.
        assert!(
            set_point.fading_velocity.amax() == 0.0 && set_point.fading_input.amax() == 0.0,
            "a set point that fades"
        );
        let (Weights::Joint { wrench, .. } | Weights::Task { wrench, .. }) = &sequence.weights;
        for step in 1..=self.steps() {
            let (state, share) = (self.state(step), sequence.horizon.share(step - 1));
            match &sequence.weights {
                Weights::Joint { position, velocity, .. } => {
                    for (offset, weight, target) in
                        [(0, position, &set_point.joint_position), (N, velocity, &set_point.joint_velocity)]
                    {
                        for joint in 0..N {
                            self.push_square(state + offset + joint, share * weight[joint], target[joint]);
                        }
                    }
                }
                Weights::Task { position, velocity, .. } => {
                    for (offset, weight, target) in
                        [(0, position, &set_point.joint_position), (N, velocity, &set_point.joint_velocity)]
                    {
                        if weight.iter().all(|weight| *weight == 0.0) {
                            continue;
                        }
                        // Jᵀ W J, its upper triangle.
                        let jacobian = &problem.jacobian;
                        let block = jacobian.tr_mul(&SMatrix::from_diagonal(weight)) * jacobian * share;
                        let gradient = -2.0 * block * target;
                        for column in 0..N {
                            for row in 0..=column {
                                let at = (state + offset + row, state + offset + column);
                                self.form.hessian.push(at.0, at.1, 2.0 * block[(row, column)]);
                            }
                            self.form.gradient[state + offset + column] = gradient[column];
                        }
                    }
                }
            }
            for (position, &axis) in self.wrench_axes.iter().enumerate() {
                self.push_square(state + 2 * N + position, share * wrench[axis], set_point.wrench[axis]);
            }
        }
        for step in 0..self.steps() {
            for (position, &axis) in self.axes.iter().enumerate() {
                let share = sequence.horizon.share(step);
                let (weight, target) = (share * sequence.input_weight[axis], set_point.input[axis]);
                self.push_square(self.input(step) + position, weight, target);
            }
        }
    }

    /// weight · (variable − target)².
    fn push_square(&mut self, column: usize, weight: f64, target: f64) {
        self.form.hessian.push(column, column, 2.0 * weight);
        self.form.gradient[column] = -2.0 * weight * target;
    }

    fn push_dynamics(&mut self) {
        let (problem, model) = (self.problem, &self.problem.model);
        let initial = &problem.initial;
        for (k, step) in self.sequence.horizon.steps().iter().enumerate() {
            let known = &problem.known_reference[k];
            for joint in 0..N {
                let (a, b) = (step.position_by[0][joint], step.position_by_reference[joint]);
                let mut right = b * known[joint];
                self.push(self.state(k + 1) + joint, 1.0);
                self.push_before(k, joint, -1.0, initial.joint_position[joint], &mut right);
                self.push_before(k, N + joint, -a, initial.joint_velocity[joint], &mut right);
                if self.sequence.horizon.first_reached() == 0 {
                    self.push_reference(k, joint, -b);
                }
                self.form.bounds.push(right);
            }
            for joint in 0..N {
                let (c, d) = (step.carried_by[0][0][joint], step.carried_by_reference[0][joint]);
                let mut right = d * known[joint];
                self.push(self.state(k + 1) + N + joint, 1.0);
                self.push_before(k, N + joint, -c, initial.joint_velocity[joint], &mut right);
                self.push_reference(k, joint, -d);
                self.form.bounds.push(right);
            }
            for (position, &axis) in self.wrench_axes.iter().enumerate() {
                let (decay, follows) = (step.wrench_decay[axis], self.sequence.horizon.follows_within());
                let mut right = (1.0 - decay) * model.wrench_offset[axis];
                self.push(self.state(k + 1) + 2 * N + position, 1.0);
                self.push_before(k, 2 * N + position, -decay, initial.wrench[axis], &mut right);
                for joint in 0..N {
                    let gradient = model.wrench_gradient[(joint, axis)];
                    let start = (initial.joint_position[joint], initial.joint_velocity[joint]);
                    self.push_before(k, joint, (decay - 1.0) * gradient, start.0, &mut right);
                    if follows {
                        let by_velocity = step.wrench_by[0][(joint, axis)] * gradient;
                        self.push_before(k, N + joint, -by_velocity, start.1, &mut right);
                        right += step.wrench_by_reference[(joint, axis)] * gradient * known[joint];
                    }
                }
                if follows {
                    for (input, &input_axis) in self.axes.iter().enumerate() {
                        let by_joint = |joint| {
                            let by_reference = step.wrench_by_reference[(joint, axis)];
                            by_reference
                                * model.wrench_gradient[(joint, axis)]
                                * model.jacobian_inverse[(joint, input_axis)]
                        };
                        self.push(self.input(k) + input, -(0..N).map(by_joint).sum::<f64>());
                    }
                }
                self.form.bounds.push(right);
            }
        }
    }

    /// An entry of the row that ends with the next bound.
    fn push(&mut self, column: usize, value: f64) {
        self.form.matrix.push(self.form.bounds.len(), column, value);
    }

    /// `factor` times an entry of the state at the start of step `step`: a variable, or `initial`
    /// moved to the right.
    fn push_before(&mut self, step: usize, entry: usize, factor: f64, initial: f64, right: &mut f64) {
        if step == 0 {
            *right -= factor * initial;
        } else {
            self.push(self.state(step) + entry, factor);
        }
    }

    /// `factor` times what the inputs of a step add to a joint's velocity reference.
    fn push_reference(&mut self, step: usize, joint: usize, factor: f64) {
        for (position, &axis) in self.axes.iter().enumerate() {
            self.push(self.input(step) + position, factor * self.problem.model.jacobian_inverse[(joint, axis)]);
        }
    }

    /// Upper bounds with `sign` 1, lower with −1; so in the others.
    fn push_force_rows(&mut self, sign: f64) {
        let (problem, model) = (self.problem, &self.problem.model);
        let steps = self.sequence.horizon.steps();
        for point in self.sequence.horizon.force_points() {
            let (k, a, b) = (point.step, &point.position_by[0], &point.position_by_reference);
            let is_end = *a == steps[k].position_by[0] && *b == steps[k].position_by_reference;
            for bound in problem.constraints.force.as_slice() {
                // In hundreds of newtons.
                let scale = sign * 0.01;
                let limit = if sign > 0.0 { bound.maximum } else { bound.minimum };
                let mut right = scale * (limit - bound.sign * model.wrench_offset[bound.axis]);
                for joint in 0..N {
                    let gradient = scale * bound.sign * model.wrench_gradient[(joint, bound.axis)];
                    if is_end {
                        self.push(self.state(k + 1) + joint, gradient);
                        continue;
                    }
                    let initial = (problem.initial.joint_position[joint], problem.initial.joint_velocity[joint]);
                    self.push_before(k, joint, gradient, initial.0, &mut right);
                    self.push_before(k, N + joint, gradient * a[joint], initial.1, &mut right);
                    right -= gradient * b[joint] * problem.known_reference[k][joint];
                }
                if !is_end && self.sequence.horizon.first_reached() == 0 {
                    for (position, &axis) in self.axes.iter().enumerate() {
                        let by_joint = |joint| {
                            let gradient = model.wrench_gradient[(joint, bound.axis)];
                            gradient * b[joint] * model.jacobian_inverse[(joint, axis)]
                        };
                        let value = scale * bound.sign * (0..N).map(by_joint).sum::<f64>();
                        self.push(self.input(k) + position, value);
                    }
                }
                self.form.bounds.push(right);
            }
        }
    }

    fn push_joint_rows(&mut self, sign: f64) {
        let problem = self.problem;
        if let Some(interval) = &problem.constraints.joint_speed {
            let limits = if sign > 0.0 { &interval.upper } else { &interval.lower };
            for (step, joint) in (0..self.steps()).flat_map(|step| (0..N).map(move |joint| (step, joint))) {
                self.push_reference(step, joint, sign);
                let known = problem.known_reference[step][joint] + problem.drift[joint];
                self.form.bounds.push(sign * (limits[joint] - known));
            }
        }
        if let Some(interval) = &problem.constraints.rest_position {
            let limits = if sign > 0.0 { &interval.upper } else { &interval.lower };
            let lag = &self.sequence.horizon.until_rest()[0];
            let ends = self.sequence.horizon.steps().iter().scan(0.0, |time, step| {
                *time += step.duration;
                Some(*time)
            });
            let ends: Vec<f64> = ends.collect();
            for (step, joint) in (0..self.steps()).flat_map(|step| (0..N).map(move |joint| (step, joint))) {
                self.push(self.state(step + 1) + joint, sign);
                self.push(self.state(step + 1) + N + joint, sign * lag[joint]);
                // The state drifts, the joints don't.
                self.form.bounds.push(sign * (limits[joint] - problem.drift[joint] * ends[step]));
            }
        }
    }

    fn push_input_rows(&mut self, sign: f64) {
        let problem = self.problem;
        for step in 0..self.steps() {
            // Bounded on one side.
            if let (Some(speed), true) = (&problem.constraints.normal_speed, sign < 0.0) {
                for (position, &axis) in self.axes.iter().enumerate() {
                    self.push(self.input(step) + position, -speed.normal[axis]);
                }
                self.form.bounds.push(-speed.least[step]);
            }
            for (position, &axis) in self.axes.iter().enumerate() {
                if let Some(interval) = &problem.constraints.offset {
                    let limit = if sign > 0.0 { interval.upper[axis] } else { interval.lower[axis] };
                    self.push(self.input(step) + position, sign);
                    self.form.bounds.push(sign * limit);
                }
                if let Some(interval) = &problem.constraints.rate {
                    let since = self.sequence.horizon.steps()[step.saturating_sub(1)].duration;
                    let limit = since * if sign > 0.0 { interval.upper[axis] } else { interval.lower[axis] };
                    self.push(self.input(step) + position, sign);
                    let before = if step == 0 {
                        problem.previous_input[axis]
                    } else {
                        self.push(self.input(step - 1) + position, -sign);
                        0.0
                    };
                    self.form.bounds.push(sign * (limit + before));
                }
            }
        }
    }
}
