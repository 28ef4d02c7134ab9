//! Purity check: the control law, linked into a shared object that has no std and no allocator.
//!
//! `cargo build --locked` in this directory fails as soon as admittance-core, or a crate under it, pulls in std: the
//! compiler then finds two panic handlers, std's and the one below. A global allocator is missing too, so that a crate
//! that uses `alloc` does not build. Generic code is only compiled where it is used, hence the function at the end.
#![no_std]

use admittance_core::controller::{Controller, Event};
use admittance_core::qp::ActiveSet;
use admittance_core::robot::{Chain, Joint, Pose, right_inverse};
use admittance_core::sample::Sample;
use core::panic::PanicInfo;
use nalgebra::{Matrix3, Vector2, Vector3};

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

/// Joint velocity of a planar arm with two links of 1 m, in rad/s, for a TCP velocity of 1 m/s along y; NaN at a singular
/// pose. `q1` and `q2` in rad. Returns the second joint's.
// SAFETY: no other object that this one is linked with has a symbol of this name.
#[unsafe(no_mangle)]
pub extern "C" fn admittance_purity_planar(q1: f64, q2: f64) -> f64 {
    let base = Joint { origin: Vector3::zeros(), rotation: Matrix3::identity(), axis: Vector3::z() };
    let elbow = Joint { origin: Vector3::x(), ..base };
    let tool = Pose { position: Vector3::x(), rotation: Matrix3::identity() };
    let Ok(chain) = Chain::<2>::new([base, elbow], tool) else {
        return f64::NAN;
    };
    let jacobian = chain.kinematics(&Vector2::new(q1, q2)).task_jacobian::<2>();
    right_inverse(&jacobian, 1e-4).map_or(f64::NAN, |inverse| inverse.joint_velocity(&Vector2::y())[1])
}

/// A whole cycle of the controller. True if the law answered the sample.
// SAFETY: no other object that this one is linked with has a symbol of this name.
#[unsafe(no_mangle)]
pub fn admittance_purity_step(
    controller: &mut Controller<2, 2, ActiveSet<&'static mut [f64]>, &'static mut [f64]>,
    sample: &Sample<2, 2>,
    now: u64,
) -> bool {
    controller.step(Event::Sample(sample), now, &mut || false).fault.is_none()
}
