//! The approach to the paper's surface (docs/design.md, "A faster cycle buys speed"), by a
//! simulation of its own: the state at the first active sample.

use super::arm::{Arm, PlanarTwo, dot, lag};
use super::attainable::Contact;
use super::draw::Draw;

const STIFFNESS_N_M: f64 = 1e5;
const THRESHOLD_N: f64 = 5.0;
const WRENCH_TIME_CONSTANT_S: f64 = 0.020;
const VELOCITY_TIME_CONSTANT_S: [f64; 2] = [0.015, 0.010];
const JOINT_SPEED_RAD_S: f64 = 3.0;
const INSTANTS: u32 = 32;
const SUBSTEP_S: f64 = 1e-5;

/// The contact whose instant lets the tool in deepest before the first active sample.
pub(super) fn worst_instant(sampling_time_s: f64, speed_m_s: f64) -> Contact {
    worst_of(INSTANTS, sampling_time_s, speed_m_s)
}

/// The same among this many instants, evenly spread over a sample.
pub(super) fn worst_of(instants: u32, sampling_time_s: f64, speed_m_s: f64) -> Contact {
    let contacts = (0..instants).map(|i| contact(sampling_time_s, speed_m_s, f64::from(i) / f64::from(instants)));
    let depth = |contact: &Contact| contact.penetration_m(&contact.joint_position);
    contacts.max_by(|a, b| depth(a).total_cmp(&depth(b))).expect("there are instants")
}

fn contact(sampling_time_s: f64, speed_m_s: f64, phase: f64) -> Contact {
    let arm = Arm::PlanarTwo(PlanarTwo { links_m: [1.0, 1.0] });
    let Draw { task, .. } = Draw::of_the_paper(sampling_time_s, speed_m_s, phase);
    let (sine, cosine) = 25f64.to_radians().sin_cos();
    let (normal, point, twist) = ([sine, cosine, 0.0], [1.32, 0.68, 0.0], [0.0, -speed_m_s]);
    // At full speed some samples above the point, elbow below zero; the lags have settled.
    let height = (4.0 * 0.004 + phase * sampling_time_s) * speed_m_s;
    let (x, y) = (point[0], point[1] + height);
    let square: f64 = x * x + y * y;
    let q2 = -((square - 2.0) / 2.0).acos();
    let q1 = y.atan2(x) - q2.sin().atan2(1.0 + q2.cos());
    let mut q = [q1, q2];
    let mut velocity = arm.joint_velocity(&q, &[0, 1], &twist);
    let mut estimate = [0.0_f64; 2];
    let substeps = (sampling_time_s / SUBSTEP_S).round() as u32;
    while estimate.iter().all(|force| force.abs() <= THRESHOLD_N) {
        let reference = arm.joint_velocity(&q, &[0, 1], &twist);
        for _ in 0..substeps {
            for joint in 0..2 {
                let (moved, next) = lag(VELOCITY_TIME_CONSTANT_S[joint], velocity[joint], reference[joint], SUBSTEP_S);
                q[joint] += moved;
                velocity[joint] = next;
            }
            let tcp = arm.tcp(&q);
            let depth = dot(normal, std::array::from_fn(|axis| point[axis] - tcp[axis])).max(0.0);
            for axis in 0..2 {
                let force = -normal[axis] * STIFFNESS_N_M * depth;
                estimate[axis] += (force - estimate[axis]) * (SUBSTEP_S / WRENCH_TIME_CONSTANT_S);
            }
        }
    }
    Contact {
        arm,
        task,
        twist: twist.to_vec(),
        velocity_time_constant_s: VELOCITY_TIME_CONSTANT_S.to_vec(),
        joint_speed_bounds: vec![(-JOINT_SPEED_RAD_S, JOINT_SPEED_RAD_S); 2],
        normal,
        surface_point_m: point,
        stiffness_n_m: STIFFNESS_N_M,
        damping_n_s_m: 0.0,
        limit_n: f64::INFINITY,
        joint_position: q.to_vec(),
        joint_velocity: velocity,
        pending: Vec::new(),
        sampling_time_s,
        drives: None,
    }
}
