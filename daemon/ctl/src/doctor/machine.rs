//! What the kernel says about this machine and this process, unchanged.

use std::fs;
use std::path::Path;

use ipc_types::{IpcSettings, PlaceError, effective_user, user_name};

/// Texts of procfs and sysfs, and a few numbers; `None` where the kernel does not tell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Machine {
    /// `uname -v`: says PREEMPT_RT where it is.
    pub(crate) kernel_version: String,
    /// /sys/kernel/realtime: 1 on PREEMPT_RT.
    pub(crate) realtime: Option<String>,
    /// /proc/sys/kernel/sched_rt_runtime_us.
    pub(crate) rt_runtime_us: Option<String>,
    /// scaling_governor of each processor that has one.
    pub(crate) governors: Vec<(u32, String)>,
    /// /sys/devices/system/cpu/isolated.
    pub(crate) isolated: Option<String>,
    /// /sys/devices/system/cpu/online.
    pub(crate) online: Option<String>,
    /// /proc/self/status: the processors that this process may use, and its capabilities.
    pub(crate) status: Option<String>,
    /// /proc/self/limits.
    pub(crate) limits: Option<String>,
    /// current_clocksource.
    pub(crate) clock_source: Option<String>,
    /// Free bytes of /dev/shm.
    pub(crate) shared_memory: Option<u64>,
    /// Whether /dev/cpu_dma_latency can be written, or why not.
    pub(crate) cpu_dma_latency: Result<(), String>,
    /// Whose the root path is; why it would not be used.
    pub(crate) root_path: Result<String, String>,
    /// Whether all that is in shared memory with the prefix is this user's.
    pub(crate) shared_files: Result<(), String>,
}

/// What can be said of the root path.
fn root_path(settings: &IpcSettings) -> Result<String, String> {
    let path = settings.root_path.display();
    match ipc_types::open_root(&settings.root_path, false) {
        Ok(_) => Ok(format!("{path}, of {} alone", user_name(effective_user()))),
        // systemd or the daemon makes it.
        Err(PlaceError::Absent { .. }) => Ok(format!("{path}: not there yet")),
        Err(error) => Err(error.to_string()),
    }
}

impl Machine {
    /// This one, as this process sees it.
    pub(crate) fn observe(settings: &IpcSettings) -> Self {
        let cpu = Path::new("/sys/devices/system/cpu");
        let online = read(cpu.join("online"));
        let processors = online.as_deref().and_then(processors).unwrap_or_default();
        let governor = |number: u32| Some((number, read(cpu.join(format!("cpu{number}/cpufreq/scaling_governor")))?));
        Self {
            kernel_version: read("/proc/sys/kernel/version").unwrap_or_default(),
            realtime: read("/sys/kernel/realtime"),
            rt_runtime_us: read("/proc/sys/kernel/sched_rt_runtime_us"),
            governors: processors.into_iter().filter_map(governor).collect(),
            isolated: read(cpu.join("isolated")),
            online,
            status: read("/proc/self/status"),
            limits: read("/proc/self/limits"),
            clock_source: read("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
            shared_memory: ipc_types::resources::shared_memory_bytes(),
            cpu_dma_latency: may_write(c"/dev/cpu_dma_latency"),
            root_path: root_path(settings),
            shared_files: settings.check_shared_memory().map_err(|error| error.to_string()),
        }
    }
}

fn read(path: impl AsRef<Path>) -> Option<String> {
    fs::read_to_string(path).ok().map(|text| text.trim().to_owned())
}

/// Asked with access(2), not opened: an open file would change the machine.
fn may_write(path: &std::ffi::CStr) -> Result<(), String> {
    // SAFETY: the path ends in a zero byte, and the call only reads it.
    match unsafe { libc::access(path.as_ptr(), libc::W_OK) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error().to_string()),
    }
}

/// The numbers of a kernel's list, such as "0-3,6"; `None` for anything else.
pub(crate) fn processors(list: &str) -> Option<Vec<u32>> {
    let mut numbers = Vec::new();
    for part in list.trim().split(',').filter(|part| !part.is_empty()) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        numbers.extend(first.parse::<u32>().ok()?..=last.parse().ok()?);
    }
    Some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_processors_are_read() {
        assert_eq!(processors("0-2,5"), Some(vec![0, 1, 2, 5]));
        assert_eq!(processors(""), Some(Vec::new()));
        assert_eq!(processors("all"), None);
    }

    #[test]
    fn this_machine_can_be_read() {
        let instance = ipc_types::Instance::new("robot").unwrap();
        let settings = IpcSettings { root_path: "/tmp/adm-no-such/x".into(), prefix: "no_such_".to_owned(), instance };
        let machine = Machine::observe(&settings);
        assert!(machine.root_path.is_err_and(|why| why.contains("directly in /tmp")));
        assert!(machine.shared_files.is_ok());
        assert!(machine.online.as_deref().and_then(processors).is_some_and(|online| !online.is_empty()));
        assert!(machine.limits.is_some_and(|limits| limits.contains("Max locked memory")));
        assert!(machine.status.is_some_and(|status| status.contains("CapEff:")));
    }
}
