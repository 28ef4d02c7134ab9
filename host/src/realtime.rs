//! Scheduling of a real-time process: memory lock, idle states, prefaulted stack, SCHED_FIFO,
//! affinity, timer slack. Each step is reported; one that the system refuses says what to change.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::os::fd::IntoRawFd;

use crate::config_section;

config_section! {
    /// How a real-time thread runs. What the system refuses is a warning, unless require_realtime
    /// is set.
    pub struct RealtimeSection {
        /// Lock all memory, so that no page fault delays a cycle.
        lock_memory: bool = false;
        /// SCHED_FIFO priority; 0 leaves the scheduling as it is.
        priority: u32 = 0, unit "1", range 0..=98;
        /// Processor to run on; any when absent.
        cpu: Option<u32>, unit "1", range 0..=1023;
        /// Keeps every processor out of idle states that take longer than this to wake from, as
        /// long as the process lives; 0 keeps them from sleeping at all. The system's setting
        /// applies when absent.
        cpu_dma_latency_us: Option<u32>, unit "us", range 0..=10000;
        /// Whether a refused step is an error.
        require_realtime: bool = false;
    }
}

/// What became of one step.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StepOutcome {
    /// Done.
    Done,
    /// Not asked for.
    NotRequested,
    /// The system refused: why, and what to change.
    Refused(String),
}

/// One step of the set-up.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StepReport {
    /// What was to be done.
    pub step: String,
    /// What became of it.
    pub outcome: StepOutcome,
}

/// Stack that is touched beforehand, in bytes.
const PREFAULTED_STACK: usize = 256 * 1024;

/// Where the kernel takes how long processors may take to wake. The request holds while the file is
/// open.
pub const CPU_DMA_LATENCY: &str = "/dev/cpu_dma_latency";

/// Makes process and calling thread real-time as the section asks: memory, idle states, and
/// [`apply_to_thread`]. Call it when shared memory is mapped, so that the lock makes it present.
pub fn go_real_time(section: &RealtimeSection) -> Vec<StepReport> {
    let mut reports = vec![lock_memory(section), limit_wake_up_latency(section.cpu_dma_latency_us)];
    reports.extend(apply_to_thread(section));
    reports
}

/// Locks the process's memory, present and future, if asked to. Call it when shared memory is
/// mapped.
pub fn lock_memory(section: &RealtimeSection) -> StepReport {
    let step = "lock memory".to_owned();
    if !section.lock_memory {
        return StepReport { step, outcome: StepOutcome::NotRequested };
    }
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: `limit` is valid for writing.
    unsafe { libc::getrlimit(libc::RLIMIT_MEMLOCK, &raw mut limit) };
    if limit.rlim_cur != libc::RLIM_INFINITY && !may_lock_without_limit() {
        // The lock itself could succeed, and a later allocation then fail.
        let kib = limit.rlim_cur / 1024;
        let why = format!("RLIMIT_MEMLOCK is {kib} KiB: make LimitMEMLOCK infinity or give CAP_IPC_LOCK");
        return StepReport { step, outcome: StepOutcome::Refused(why) };
    }
    // SAFETY: mlockall takes flags only.
    let outcome = checked(unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) }).map_err(|error| {
        let kib = limit.rlim_cur / 1024;
        format!("{error}; RLIMIT_MEMLOCK is {kib} KiB: raise LimitMEMLOCK or give CAP_IPC_LOCK")
    });
    StepReport { step, outcome: outcome.map_or_else(StepOutcome::Refused, |()| StepOutcome::Done) }
}

/// Asks the kernel for idle states that wake within so many microseconds, until the process ends.
pub fn limit_wake_up_latency(latency_us: Option<u32>) -> StepReport {
    let Some(latency) = latency_us else {
        return StepReport { step: "limit wake-up latency".to_owned(), outcome: StepOutcome::NotRequested };
    };
    let request = || -> io::Result<()> {
        let mut file = OpenOptions::new().write(true).open(CPU_DMA_LATENCY)?;
        file.write_all(&(latency as i32).to_ne_bytes())?;
        // Closing it would end the request, which must last as long as the process.
        let _ = file.into_raw_fd();
        Ok(())
    };
    let outcome = request().map_or_else(
        |error| {
            let change = "let this user write it (a udev rule), or leave realtime.cpu_dma_latency_us out";
            StepOutcome::Refused(format!("{CPU_DMA_LATENCY}: {error}; {change}"))
        },
        |()| StepOutcome::Done,
    );
    StepReport { step: format!("limit wake-up latency to {latency} us"), outcome }
}

/// Whether this process has CAP_IPC_LOCK, for which RLIMIT_MEMLOCK does not count.
fn may_lock_without_limit() -> bool {
    const CAP_IPC_LOCK: u32 = 14;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    effective
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .is_some_and(|mask| mask >> CAP_IPC_LOCK & 1 == 1)
}

/// Makes the calling thread real-time as the section asks: stack, timer slack, affinity,
/// SCHED_FIFO.
pub fn apply_to_thread(section: &RealtimeSection) -> Vec<StepReport> {
    let mut reports = Vec::new();
    let mut report = |step: String, requested: bool, outcome: &dyn Fn() -> Result<(), String>| {
        let outcome = match requested.then(outcome) {
            None => StepOutcome::NotRequested,
            Some(Ok(())) => StepOutcome::Done,
            Some(Err(why)) => StepOutcome::Refused(why),
        };
        reports.push(StepReport { step, outcome });
    };
    let real_time = section.priority > 0;
    report(format!("prefault {} KiB of stack", PREFAULTED_STACK / 1024), real_time || section.lock_memory, &|| {
        prefault_stack();
        Ok(())
    });
    report("timer slack 1 ns".to_owned(), real_time, &|| {
        // SAFETY: PR_SET_TIMERSLACK takes a number.
        checked(unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64) }).map_err(|error| error.to_string())
    });
    let cpu = section.cpu.unwrap_or(0) as usize;
    report(format!("run on processor {cpu}"), section.cpu.is_some(), &|| {
        // SAFETY: an all-zero cpu_set_t is the empty set; CPU_SET stays in bounds, since the
        // section's range ends at 1023.
        let set = unsafe {
            let mut set: libc::cpu_set_t = std::mem::zeroed();
            libc::CPU_SET(cpu, &mut set);
            set
        };
        // SAFETY: `set` is valid for reading over the size given; 0 is the calling thread.
        checked(unsafe { libc::sched_setaffinity(0, size_of_val(&set), &raw const set) })
            .map_err(|error| format!("{error}; realtime.cpu must be a processor that this process may use"))
    });
    let priority = section.priority;
    report(format!("SCHED_FIFO priority {priority}"), real_time, &|| {
        let parameters = libc::sched_param { sched_priority: priority as libc::c_int };
        // SAFETY: `parameters` is valid for reading; 0 is the calling thread.
        checked(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) })
            .map_err(|error| format!("{error}; give CAP_SYS_NICE or raise LimitRTPRIO to {priority}"))
    });
    reports
}

/// Has the kernel kill this process when its parent thread ends: for processes that a demo or a
/// test starts.
pub fn die_with_parent() -> io::Result<()> {
    // SAFETY: PR_SET_PDEATHSIG takes a signal number.
    checked(unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) })
}

fn checked(result: libc::c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

#[inline(never)]
fn prefault_stack() {
    let mut stack = [0_u8; PREFAULTED_STACK];
    for page in stack.chunks_mut(4096) {
        page[0] = std::hint::black_box(1);
    }
    std::hint::black_box(&stack);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn section() -> RealtimeSection {
        RealtimeSection {
            lock_memory: false,
            priority: 0,
            cpu: None,
            cpu_dma_latency_us: None,
            require_realtime: false,
        }
    }

    #[test]
    fn nothing_asked_nothing_done() {
        let reports = go_real_time(&section());
        assert!(reports.len() > 5, "{reports:?}");
        assert!(reports.iter().all(|report| report.outcome == StepOutcome::NotRequested), "{reports:?}");
    }

    #[test]
    fn the_request_for_idle_states_lasts() {
        let report = limit_wake_up_latency(Some(1234));
        match report.outcome {
            StepOutcome::Done => {
                let open = std::fs::read_dir("/proc/self/fd").expect("procfs").flatten();
                let targets: Vec<_> = open.filter_map(|entry| std::fs::read_link(entry.path()).ok()).collect();
                assert!(targets.iter().any(|target| target.as_os_str() == CPU_DMA_LATENCY), "{targets:?}");
            }
            StepOutcome::Refused(why) => assert!(why.contains(CPU_DMA_LATENCY) && why.contains("realtime."), "{why}"),
            StepOutcome::NotRequested => panic!("it was asked for"),
        }
        assert!(report.step.contains("1234 us"), "{}", report.step);
    }

    #[test]
    fn a_refused_step_says_what_to_change() {
        let reports = std::thread::spawn(|| apply_to_thread(&RealtimeSection { cpu: Some(1023), ..section() }))
            .join()
            .expect("the thread ends");
        let refused = reports.iter().find(|report| report.step.contains("1023")).expect("a report on the processor");
        assert!(matches!(&refused.outcome, StepOutcome::Refused(why) if why.contains("realtime.cpu")), "{refused:?}");
    }
}
