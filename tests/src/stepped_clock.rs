//! A wall clock that somebody sets.

use std::time::Instant;

/// CLOCK_REALTIME is off by some seconds while this lives.
#[derive(Debug)]
pub struct SteppedClock {
    before: i128,
    since: Instant,
}

fn realtime_ns() -> i128 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writing.
    unsafe { libc::clock_gettime(libc::CLOCK_REALTIME, &raw mut time) };
    i128::from(time.tv_sec) * 1_000_000_000 + i128::from(time.tv_nsec)
}

fn set_realtime_ns(time: i128) -> bool {
    let time = libc::timespec {
        tv_sec: (time / 1_000_000_000) as libc::time_t,
        tv_nsec: (time % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: `time` is valid for reading.
    unsafe { libc::clock_settime(libc::CLOCK_REALTIME, &raw const time) == 0 }
}

impl SteppedClock {
    /// Steps it by so many seconds; `None` where it cannot be set.
    pub fn by_seconds(step: i128) -> Option<Self> {
        let (before, since) = (realtime_ns(), Instant::now());
        set_realtime_ns(before + step * 1_000_000_000).then_some(Self { before, since })
    }
}

impl Drop for SteppedClock {
    fn drop(&mut self) {
        set_realtime_ns(self.before + self.since.elapsed().as_nanos() as i128);
    }
}
