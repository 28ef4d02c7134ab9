//! What an arm is asked for: in which frame, which directions it controls, which of them give way and
//! how much each may press. As the judge knows it, by rules of its own.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::arm::{Arm, Rows, dot, least_norm, product, unseen};

/// Normal components below this have no bound (docs/design.md, "Two profiles").
pub(crate) const LEAST_NORMAL_COMPONENT: f64 = 0.1;
/// Least length of what is left of an axis beside a normal that counts as not along it.
const LEAST_LEFT: f64 = 0.1;

/// Whose directions they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Frame {
    /// The base frame's.
    Base,
    /// Those of the base frame turned by fixed-axis roll, pitch, yaw in rad.
    Rpy([f64; 3]),
    /// z is the normal, x as near to the base frame's as that allows.
    Surface,
    /// The TCP's: they turn with it.
    Tool,
}

/// The directions of a task.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Task {
    /// Whose.
    pub(crate) frame: Frame,
    /// Those that the arm controls, of x y z rx ry rz.
    pub(crate) controlled: Vec<usize>,
    /// Which of them give way; one for each task axis.
    pub(crate) gives_way: Vec<bool>,
    /// f_max of each task axis, N and N m.
    pub(crate) force_limit: Vec<f64>,
}

impl Task {
    /// The directions x y z of the frame in the base frame, as columns; `None` of the base frame.
    pub(crate) fn axes(&self, arm: &Arm, q: &[f64], normal: [f64; 3]) -> Option<Matrix3<f64>> {
        match self.frame {
            Frame::Base => None,
            Frame::Rpy([roll, pitch, yaw]) => Some(Rotation3::from_euler_angles(roll, pitch, yaw).into_inner()),
            Frame::Surface => Some(on_surface(Vector3::from(normal))),
            Frame::Tool => Some(arm.tool_axes(q)),
        }
    }

    /// A vector of the base frame in directions of the frame.
    pub(crate) fn seen(&self, arm: &Arm, q: &[f64], normal: [f64; 3], vector: [f64; 3]) -> [f64; 3] {
        self.axes(arm, q, normal).map_or(vector, |axes| (axes.transpose() * Vector3::from(vector)).into())
    }

    /// The directions that give way and feel a surface, with the part of its normal along each.
    fn bounded(&self, normal: [f64; 3]) -> impl Iterator<Item = (usize, f64)> {
        let feels = move |(axis, part): &(usize, f64)| {
            self.gives_way.get(*axis).is_some_and(|gives| *gives) && part.abs() >= LEAST_NORMAL_COMPONENT
        };
        normal.into_iter().enumerate().filter(feels)
    }

    /// Normal force in N at which the first direction is at its limit.
    pub(crate) fn normal_force_limit_n(&self, arm: &Arm, q: &[f64], normal: [f64; 3]) -> f64 {
        let seen = self.seen(arm, q, normal, normal);
        self.bounded(seen).map(|(axis, part)| self.force_limit[axis] / part.abs()).fold(f64::INFINITY, f64::min)
    }

    /// Normal force in N at which every direction that gives way presses with its least force.
    pub(crate) fn least_normal_force_n(&self, arm: &Arm, q: &[f64], normal: [f64; 3], minimum_force: &[f64]) -> f64 {
        let seen = self.seen(arm, q, normal, normal);
        self.bounded(seen).map(|(axis, part)| minimum_force[axis] / part.abs()).fold(0.0, f64::max)
    }

    /// The part of the normal along the directions that give way: (its length, the largest component).
    pub(crate) fn giving_part(&self, arm: &Arm, q: &[f64], normal: [f64; 3]) -> (f64, f64) {
        let parts: Vec<f64> = self.bounded(self.seen(arm, q, normal, normal)).map(|(_, part)| part.abs()).collect();
        (parts.iter().map(|part| part * part).sum::<f64>().sqrt(), parts.into_iter().fold(0.0, f64::max))
    }

    /// The velocity that offsets have to take out of a motion for each m/s that it goes into the surface: along
    /// what of the normal gives way, m/s in the base frame.
    pub(crate) fn way_out(&self, arm: &Arm, q: &[f64], normal: [f64; 3]) -> [f64; 3] {
        let linear = arm.task_axes().min(3);
        if self.gives_way[..linear].iter().all(|gives| *gives) {
            return normal;
        }
        let mut part = self.seen(arm, q, normal, normal);
        part.iter_mut()
            .enumerate()
            .filter(|(axis, _)| !self.gives_way.get(*axis).is_some_and(|gives| *gives))
            .for_each(|(_, part)| *part = 0.0);
        let length = part.iter().map(|part| part * part).sum::<f64>();
        let part = part.map(|part| part / length);
        self.axes(arm, q, normal).map_or(part, |axes| (axes * Vector3::from(part)).into())
    }

    /// Whether any joint velocity is one that offsets can ask for.
    pub(crate) fn is_free(&self, arm: &Arm) -> bool {
        self.controlled.len() == arm.joints() && self.controlled.iter().all(|axis| self.gives_way[*axis])
    }

    /// The Jacobian of the directions that the arm controls, row by row, and ṗ0 (base frame) in them.
    fn motion(&self, arm: &Arm, q: &[f64], normal: [f64; 3], twist: &[f64]) -> (Rows, Vec<f64>) {
        let jacobian = arm.jacobian(q);
        let axes = self.axes(arm, q, normal);
        // A direction's value: its part along each axis of the base frame, in its half of the six.
        let along = |direction: usize, value: &dyn Fn(usize) -> f64| match &axes {
            None => value(direction),
            Some(axes) => {
                let half = direction - direction % 3;
                let there = (half..half + 3).filter(|axis| *axis < arm.task_axes());
                there.map(|axis| axes[(axis % 3, direction % 3)] * value(axis)).sum()
            }
        };
        let row = |direction: &usize| -> Vec<f64> {
            (0..arm.joints()).map(|joint| along(*direction, &|axis| jacobian[axis][joint])).collect()
        };
        let wanted = self.controlled.iter().map(|direction| along(*direction, &|axis| twist[axis]));
        (self.controlled.iter().map(row).collect(), wanted.collect())
    }

    /// What offsets cannot change: E and e with E q̇_ref = e for every joint reference that a command
    /// near q can lead to. The directions that do not give way follow ṗ0, and the joints of a
    /// redundant arm do not move beside what the task needs.
    pub(crate) fn kept(&self, arm: &Arm, q: &[f64], normal: [f64; 3], twist: &[f64]) -> (Rows, Vec<f64>) {
        let (rows, wanted) = self.motion(arm, q, normal, twist);
        let spare = unseen(&rows);
        let all = self.controlled.iter().zip(rows.into_iter().zip(wanted));
        let stays = all.filter(|(axis, _)| !self.gives_way[**axis]).map(|(_, row)| row);
        stays.chain(spare.into_iter().map(|row| (row, 0.0))).unzip()
    }

    /// The joint reference that an arm at q has from offsets with which a reference that is nearly this
    /// was meant.
    pub(crate) fn commanded(
        &self,
        arm: &Arm,
        q: &[f64],
        normal: [f64; 3],
        twist: &[f64],
        reference: &[f64],
    ) -> Vec<f64> {
        let (rows, mut wanted) = self.motion(arm, q, normal, twist);
        for ((wanted, row), axis) in wanted.iter_mut().zip(&rows).zip(&self.controlled) {
            if self.gives_way[*axis] {
                *wanted = product(row, reference);
            }
        }
        least_norm(&rows, &wanted)
    }

    /// About the fastest normal speed in m/s that offsets lead to with these joint speeds, and how much
    /// of it each joint has: where not every joint is free, that of an offset along the normal alone.
    pub(crate) fn outward(&self, arm: &Arm, q: &[f64], normal: [f64; 3], limits: &[f64]) -> (f64, Vec<f64>) {
        let lever = arm.lever(q, normal);
        let of_each = |most: f64, speeds: &mut dyn Iterator<Item = f64>| {
            let weights: Vec<f64> = lever.iter().zip(speeds).map(|(lever, speed)| lever * speed).collect();
            (most * weights.iter().sum::<f64>(), weights)
        };
        if self.is_free(arm) {
            let most = limits.iter().copied().fold(0.0, f64::max);
            return of_each(most, &mut lever.iter().zip(limits).map(|(lever, limit)| (limit / most).copysign(*lever)));
        }
        let (rows, _) = self.motion(arm, q, normal, &vec![0.0; arm.task_axes()]);
        let seen = self.seen(arm, q, normal, normal);
        let out = |axis: &usize| if *axis < 3 && self.gives_way[*axis] { seen[*axis] } else { 0.0 };
        let unit = least_norm(&rows, &self.controlled.iter().map(out).collect::<Vec<_>>());
        let most = unit.iter().zip(limits).map(|(speed, limit)| limit / speed.abs()).fold(f64::INFINITY, f64::min);
        of_each(most, &mut unit.into_iter())
    }
}

/// The frame whose z is a normal.
fn on_surface(z: Vector3<f64>) -> Matrix3<f64> {
    let beside = |axis: Vector3<f64>| axis - z * z.dot(&axis);
    let along = beside(Vector3::x());
    let x = if along.norm() > LEAST_LEFT { along } else { beside(Vector3::y()) }.normalize();
    Matrix3::from_columns(&[x, z.cross(&x), z])
}

/// Speed into a surface along its normal of a twist, m/s.
pub(crate) fn inward_m_s(twist: &[f64], normal: [f64; 3]) -> f64 {
    -dot(linear(twist), normal)
}

/// The linear part of a twist, in m/s.
pub(crate) fn linear(twist: &[f64]) -> [f64; 3] {
    std::array::from_fn(|axis| twist.get(axis).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::super::arm::{Chain, Joint, Kind};
    use super::*;

    /// Five joints that turn, of which x y z are controlled.
    fn arm() -> Arm {
        let axes = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.6, 0.8]];
        let joint = |axis| Joint { origin_m: [0.1, 0.02, 0.3], rpy_rad: [0.1, 0.0, 0.2], axis, kind: Kind::Turns };
        Arm::Chain(Chain { joints: axes.map(joint).to_vec(), tool_m: [0.1, 0.0, 0.1], tool_rpy_rad: [0.3, 0.4, 0.5] })
    }

    fn task(frame: Frame, gives_way: [bool; 3]) -> Task {
        let gives_way = gives_way.into_iter().chain([false; 3]).collect();
        Task { frame, controlled: vec![0, 1, 2], gives_way, force_limit: vec![100.0, 150.0, 200.0, 1.0, 1.0, 1.0] }
    }

    const Q: [f64; 5] = [0.3, 0.4, 1.1, -0.7, 0.9];
    const NORMAL: [f64; 3] = [0.6, 0.0, 0.8];

    #[test]
    fn what_is_kept_follows_the_twist_and_has_no_motion_to_spare() {
        let (arm, twist) = (arm(), [0.1, -0.2, 0.3, 0.0, 0.0, 0.0]);
        for frame in [Frame::Base, Frame::Rpy([0.3, -0.2, 1.0]), Frame::Surface, Frame::Tool] {
            let task = task(frame, [false, true, true]);
            let (rows, values) = task.kept(&arm, &Q, NORMAL, &twist);
            assert_eq!(rows.len(), 3, "one direction that stays, two joints too many");
            let keeps =
                |x: &[f64]| rows.iter().zip(&values).all(|(row, value)| (product(row, x) - value).abs() < 1e-12);
            // ṗ0 without an offset keeps it, and so does any offset where the arm gives way.
            assert!(keeps(&arm.joint_velocity(&Q, &task.controlled, &twist)), "{frame:?}");
            let reference = task.commanded(&arm, &Q, NORMAL, &twist, &[0.5, -0.3, 0.2, 0.8, -0.1]);
            assert!(keeps(&reference), "{frame:?}");
            let again = task.commanded(&arm, &Q, NORMAL, &twist, &reference);
            assert!(again.iter().zip(&reference).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn the_first_limit_is_that_of_the_frame() {
        let arm = arm();
        let limit = |frame, gives_way| task(frame, gives_way).normal_force_limit_n(&arm, &Q, NORMAL);
        assert!((limit(Frame::Base, [true; 3]) - 100.0 / 0.6).abs() < 1e-12);
        assert!((limit(Frame::Base, [false, true, true]) - 200.0 / 0.8).abs() < 1e-12);
        assert!((limit(Frame::Surface, [true; 3]) - 200.0).abs() < 1e-12);
        // Sliding on: what is left of a motion along the normal is none of it.
        for (frame, gives_way) in [
            (Frame::Base, [true; 3]),
            (Frame::Tool, [false, true, true]),
            (Frame::Rpy([0.3, 0.1, 2.0]), [true, false, false]),
        ] {
            let out = task(frame, gives_way).way_out(&arm, &Q, NORMAL);
            assert!((dot(out, NORMAL) - 1.0).abs() < 1e-12, "{frame:?}: {out:?}");
        }
        let (length, largest) = task(Frame::Base, [true, true, false]).giving_part(&arm, &Q, NORMAL);
        assert!((length - 0.6).abs() < 1e-15 && (largest - 0.6).abs() < 1e-15);
    }
}
