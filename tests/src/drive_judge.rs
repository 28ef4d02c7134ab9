//! A judge of what drives are given, of its own: it knows a list of references and how often they come, and takes
//! differences. It shares nothing with what keeps the limits.

/// What a drive's maker publishes, per joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// rad/s.
    pub speed: Vec<f64>,
    /// rad/s².
    pub acceleration: Vec<f64>,
    /// rad/s³.
    pub jerk: Vec<f64>,
}

impl Published {
    /// Franka Research 3: "Limits for Franka Research 3 (FR3)", joint space, in the Franka Control Interface's
    /// documentation (<https://frankarobotics.github.io/docs/robot_specifications.html>), the speeds without what they lose
    /// near the ends of the joints; the same numbers are in `include/franka/rate_limiting.h` of libfranka, which takes the same
    /// differences of references 1 ms apart.
    pub fn fr3() -> Self {
        Self {
            speed: vec![2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26],
            acceleration: vec![10.0; 7],
            jerk: vec![5000.0; 7],
        }
    }

    /// Those of the first joints.
    #[must_use]
    pub fn of_joints(mut self, joints: usize) -> Self {
        for limits in [&mut self.speed, &mut self.acceleration, &mut self.jerk] {
            limits.truncate(joints);
        }
        self
    }
}

/// The largest of each over its limit, and at which reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Worst {
    /// |r| over the limit.
    pub speed: (f64, usize),
    /// |r_k − r_{k−1}| / h over the limit.
    pub acceleration: (f64, usize),
    /// |a_k − a_{k−1}| / h over the limit.
    pub jerk: (f64, usize),
}

impl Worst {
    /// The largest of the three.
    pub fn most(&self) -> f64 {
        self.speed.0.max(self.acceleration.0).max(self.jerk.0)
    }
}

/// Judges `references` that came `interval_s` apart, from an arm that stood still.
pub fn judge<'a>(references: impl IntoIterator<Item = &'a [f64]>, interval_s: f64, limits: &Published) -> Worst {
    let joints = limits.speed.len();
    let (mut before, mut change_before) = (vec![0.0; joints], vec![0.0; joints]);
    let mut worst = Worst { speed: (0.0, 0), acceleration: (0.0, 0), jerk: (0.0, 0) };
    let raise = |worst: &mut (f64, usize), value: f64, at| {
        if value > worst.0 {
            *worst = (value, at);
        }
    };
    for (at, reference) in references.into_iter().enumerate() {
        for joint in 0..joints {
            assert!(reference[joint].is_finite(), "reference {at} of joint {joint}: {}", reference[joint]);
            let change = (reference[joint] - before[joint]) / interval_s;
            let jerk = (change - change_before[joint]) / interval_s;
            raise(&mut worst.speed, reference[joint].abs() / limits.speed[joint], at);
            raise(&mut worst.acceleration, change.abs() / limits.acceleration[joint], at);
            raise(&mut worst.jerk, jerk.abs() / limits.jerk[joint], at);
            (before[joint], change_before[joint]) = (reference[joint], change);
        }
    }
    worst
}
