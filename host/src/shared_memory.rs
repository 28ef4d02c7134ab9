//! Space in /dev/shm: running out of it is a SIGBUS in the middle of a cycle, not an error.

/// Free space that the services of one daemon need, with room to spare, in bytes; most of it for
/// records that wait for their readers.
pub const NEEDED_BYTES: u64 = 32 << 20;

/// Free bytes of /dev/shm for this user; `None` where it is not mounted.
pub fn free_bytes() -> Option<u64> {
    // SAFETY: an all-zero statvfs is a valid value, the path ends in a zero byte, and the call only
    // writes to `status`.
    let status = unsafe {
        let mut status: libc::statvfs = std::mem::zeroed();
        (libc::statvfs(c"/dev/shm".as_ptr(), &raw mut status) == 0).then_some(status)
    };
    status.map(|status| status.f_bavail * status.f_frsize)
}
