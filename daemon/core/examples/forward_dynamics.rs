//! Times the forward dynamics of an arm of six joints and prints the median and the 99th percentile
//! in µs:
//!
//! `cargo run --release -p admittance-core --example forward_dynamics`

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use admittance_core::robot::{ArmDynamics, Chain, Joint, JointKind, LinkInertia, Pose};
use nalgebra::{Matrix3, Vector3, Vector6};

/// So many answers are timed together: the clock's own time is spread over them.
const TOGETHER: u32 = 100;
const ROUNDS: usize = 2000;

fn arm() -> Result<ArmDynamics<6>, Box<dyn Error>> {
    let identity = Matrix3::identity();
    let joints = core::array::from_fn(|index| Joint {
        origin: Vector3::new(0.1, 0.05, 0.3),
        rotation: identity,
        axis: [Vector3::z(), Vector3::y(), Vector3::x()][index % 3],
        kind: JointKind::Revolute,
    });
    let chain = Chain::new(joints, Pose { position: Vector3::new(0.0, 0.0, 0.1), rotation: identity })?;
    let links = core::array::from_fn(|index| LinkInertia {
        mass: 10.0 - index as f64,
        center_of_gravity: Vector3::new(0.02, 0.03, 0.15),
        inertia: Matrix3::from_diagonal(&Vector3::new(0.05, 0.06, 0.02)),
    });
    Ok(ArmDynamics::new(chain, links, Vector6::from_element(0.5), Vector3::new(0.0, 0.0, -9.81))?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arm = arm()?;
    let (velocity, torque, wrench) =
        (Vector6::from_element(0.7), Vector6::from_element(20.0), Vector6::new(10.0, -20.0, 100.0, 1.0, 2.0, 3.0));
    let mut times_us = Vec::with_capacity(ROUNDS);
    for round in 0..ROUNDS {
        let q = Vector6::from_fn(|joint, _| 0.001 * round as f64 + 0.3 * joint as f64);
        let start = Instant::now();
        for _ in 0..TOGETHER {
            let answer = black_box(&arm).at(black_box(&q)).acceleration(&velocity, &torque, &wrench);
            black_box(answer);
        }
        times_us.push(start.elapsed().as_secs_f64() * 1e6 / f64::from(TOGETHER));
    }
    times_us.sort_by(f64::total_cmp);
    let at = |share: f64| times_us[(share * ROUNDS as f64) as usize];
    println!("forward dynamics of six joints: p50 {:.2} µs, p99 {:.2} µs", at(0.5), at(0.99));
    Ok(())
}
