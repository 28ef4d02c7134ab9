//! How far the tool leaves a line on which it was sent, and how far it was told to.

use end_to_end::closed_loop::{Instant, Run};
use nalgebra::{Rotation3, Vector3};

use super::turned_world::vector;

/// Largest way in m off the line along `direction` through where the tool began, and largest turn in rad.
pub(super) fn off_the_line(run: &Run, direction: &Vector3<f64>) -> (f64, f64) {
    let start = &run.instants[0].truth;
    let attitude = |at: &[f64; 3]| Rotation3::new(vector(at));
    run.instants.iter().fold((0.0, 0.0), |(most, turned), at| {
        let way = vector(&at.truth.tcp_position) - vector(&start.tcp_position);
        let turn = (attitude(&at.truth.tcp_rotation) * attitude(&start.tcp_rotation).inverse()).angle();
        (f64::max(most, (way - direction * way.dot(direction)).norm()), f64::max(turned, turn))
    })
}

/// Largest velocity offset beside the direction that gives way at each instant, m/s or rad/s.
pub(super) fn sideways_offset(run: &Run, direction: impl Fn(&Instant) -> Vector3<f64>) -> f64 {
    let beside = run.instants.iter().map(|at| {
        let (offset, direction) = (vector(&at.command.velocity_offset), direction(at));
        (offset - direction * offset.dot(&direction)).norm().max(vector(&at.command.velocity_offset[3..]).norm())
    });
    beside.fold(0.0, f64::max)
}
