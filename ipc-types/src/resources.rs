//! What a program finds on the machine before it connects: a full /dev/shm is a SIGBUS in the
//! middle of a cycle, and too few file descriptors fail wherever the last one went. Both are looked
//! for first, and said by name.

/// What a program takes, with room to spare.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needed {
    /// Bytes of /dev/shm.
    pub bytes: u64,
    /// File descriptors beside those that are open.
    pub descriptors: u64,
}

impl Needed {
    /// The daemon: most of it for records that wait for their readers, and a few descriptors for
    /// each client and reader that the services allow.
    pub const DAEMON: Self = Self { bytes: 32 << 20, descriptors: 192 };
    /// plant-sim: most of it for truths that wait for their readers.
    pub const PLANT: Self = Self { bytes: 8 << 20, descriptors: 64 };
    /// A tool, or any other client.
    pub const TOOL: Self = Self { bytes: 1 << 20, descriptors: 32 };

    /// Whether it is there.
    ///
    /// # Errors
    /// [`Lacking`], with what is there.
    pub fn check(self) -> Result<(), Lacking> {
        let free = shared_memory_bytes().ok_or(Lacking::NoSharedMemory)?;
        if free < self.bytes {
            return Err(Lacking::SharedMemory { free, needed: self.bytes });
        }
        let limit = descriptor_limit();
        // One more is open while they are counted.
        let open = std::fs::read_dir("/proc/self/fd").map_or(limit, |open| (open.count() as u64).saturating_sub(1));
        let left = limit.saturating_sub(open);
        if left < self.descriptors {
            return Err(Lacking::Descriptors { left, limit, needed: self.descriptors });
        }
        Ok(())
    }
}

/// What a program cannot run without.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Lacking {
    /// There is no /dev/shm.
    #[error("/dev/shm is not mounted: shared memory needs it")]
    NoSharedMemory,
    /// Too little of it is free.
    #[error("/dev/shm is full: it has {free} bytes free, accepted: at least {needed}; free some, or enlarge it")]
    SharedMemory {
        /// Bytes that are free.
        free: u64,
        /// Bytes that are needed.
        needed: u64,
    },
    /// Too few files may be open at the same time.
    #[error(
        "too few file descriptors: {left} of {limit} are left, accepted: at least {needed}; raise the limit (ulimit -n, \
         LimitNOFILE=)"
    )]
    Descriptors {
        /// Descriptors that may still be opened.
        left: u64,
        /// All that this process may have.
        limit: u64,
        /// Descriptors that are needed.
        needed: u64,
    },
}

/// Free bytes of /dev/shm for this user; `None` where it is not mounted.
pub fn shared_memory_bytes() -> Option<u64> {
    // SAFETY: an all-zero statvfs is a valid value, the path ends in a zero byte, and the call only
    // writes to `status`.
    let status = unsafe {
        let mut status: libc::statvfs = std::mem::zeroed();
        (libc::statvfs(c"/dev/shm".as_ptr(), &raw mut status) == 0).then_some(status)
    };
    status.map(|status| status.f_bavail.saturating_mul(status.f_frsize))
}

/// Most files that this process may have open.
fn descriptor_limit() -> u64 {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: `limit` is valid for writing; with a resource that exists the call cannot fail.
    unsafe { libc::getrlimit(libc::RLIMIT_NOFILE, &raw mut limit) };
    limit.rlim_cur
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lacking_is_named_with_what_is_there() {
        assert_eq!(Needed { bytes: 0, descriptors: 1 }.check(), Ok(()));
        let error = Needed { bytes: u64::MAX, descriptors: 0 }.check().unwrap_err().to_string();
        assert!(error.starts_with("/dev/shm is full: it has ") && error.contains("at least 18446744073709551615"));
        let error = Needed { bytes: 0, descriptors: u64::MAX }.check().unwrap_err().to_string();
        let limit = descriptor_limit();
        assert!(error.starts_with("too few file descriptors: ") && error.contains(&format!(" of {limit} ")), "{error}");
    }
}
