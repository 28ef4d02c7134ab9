//! CLOCK_MONOTONIC: reading it, and waiting for an instant of it.

/// CLOCK_MONOTONIC in ns.
pub fn monotonic_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writing; CLOCK_MONOTONIC exists on every Linux, so the call
    // cannot fail.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Sleeps until CLOCK_MONOTONIC reaches `instant` ns; at once if it has. Signals do not end the
/// sleep.
pub fn sleep_until_ns(instant: u64) {
    let time = libc::timespec {
        tv_sec: (instant / 1_000_000_000) as libc::time_t,
        tv_nsec: (instant % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: `time` is valid for reading, and no remaining time is asked for with an absolute
    // instant.
    while unsafe {
        libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &raw const time, std::ptr::null_mut())
    } == libc::EINTR
    {}
}

/// Times that a spinning thread pauses before it looks again: 0.3 µs on a Xeon of 2023, less on older processors, whose
/// pauses are shorter.
const PAUSES: u32 = 16;

/// Pauses a thread that waits for another, before it looks again. One that looks all the time takes a third of the other
/// hardware thread of its core, which may be the one that computes what it waits for.
pub fn pause() {
    for _ in 0..PAUSES {
        std::hint::spin_loop();
    }
}

/// Spins until CLOCK_MONOTONIC reaches `instant` ns; not by [`pause`], which may end later.
pub fn spin_until_ns(instant: u64) {
    while monotonic_ns() < instant {
        std::hint::spin_loop();
    }
}

/// Sleeps until `spin` ns before `instant`, then spins: exact to below a microsecond where the
/// sleep wakes in time.
pub fn sleep_then_spin_until_ns(instant: u64, spin: u64) {
    sleep_until_ns(instant.saturating_sub(spin));
    spin_until_ns(instant);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waiting_never_ends_early() {
        let start = monotonic_ns();
        sleep_until_ns(start + 2_000_000);
        assert!(monotonic_ns() >= start + 2_000_000);
        let instant = monotonic_ns() + 500_000;
        sleep_then_spin_until_ns(instant, 100_000);
        assert!(monotonic_ns() >= instant);
        sleep_until_ns(0);
    }
}
