//! Purity check: the control law, linked into a shared object that has no std and no allocator.
//!
//! `cargo build --locked` in this directory fails as soon as admittance-core, or a crate under it,
//! pulls in std: the compiler then finds two panic handlers, std's and the one below. A global
//! allocator is missing too, so that a crate that uses `alloc` does not build. Generic code is only
//! compiled where it is used: hence these functions.
#![no_std]

use admittance_core::Controller;
use admittance_core::intake::{Event, Sample};
use admittance_core::mpc::ActiveSet;
use admittance_core::quantities::Instant;
use core::panic::PanicInfo;

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

/// A whole cycle of the controller. True if the law answered the sample.
// SAFETY: no other object that this one is linked with has a symbol of this name.
#[unsafe(no_mangle)]
pub fn admittance_purity_step(
    controller: &mut Controller<2, 2, ActiveSet<&'static mut [f64]>, &'static mut [f64]>,
    sample: &Sample<2, 2>,
    now: Instant,
) -> bool {
    controller.step(Event::Sample(sample), now, &mut || false).outcome.fault.is_none()
}

/// Handing over to a controller with other parameters.
// SAFETY: no other object that this one is linked with has a symbol of this name.
#[unsafe(no_mangle)]
pub fn admittance_purity_take_over(
    controller: &mut Controller<2, 2, ActiveSet<&'static mut [f64]>, &'static mut [f64]>,
    old: &Controller<2, 2, ActiveSet<&'static mut [f64]>, &'static mut [f64]>,
) {
    controller.take_over(old);
}
