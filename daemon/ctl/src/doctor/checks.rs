//! Each check: what was found, whether that is good, and exactly what to change.

use admittance_host::realtime::CPU_DMA_LATENCY;
use ipc_types::resources::Needed;

use super::machine::{Machine, processors};
use super::{Asked, Check, Status};

const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

/// All checks, in the order of what matters most to timing.
pub(crate) fn all(machine: &Machine, asked: &Asked) -> Vec<Check> {
    vec![
        preemption(machine),
        throttling(machine, asked),
        governor(machine),
        isolation(machine, asked),
        processor(machine, asked),
        memory_lock(machine, asked),
        priority(machine, asked),
        wake_up_latency(machine, asked),
        shared_memory(machine),
        root_path(machine),
        shared_files(machine),
        clock_source(machine),
    ]
}

/// Something needed is asked for and missing: refused if the daemon would not start or run, else a
/// warning.
fn missing(is_fatal: bool) -> Status {
    if is_fatal { Status::Refused } else { Status::Warning }
}

fn check(name: &'static str, status: Status, found: impl Into<String>, change: impl Into<String>) -> Check {
    Check { name, status, found: found.into(), change: change.into() }
}

fn ok(name: &'static str, found: impl Into<String>) -> Check {
    check(name, Status::Ok, found, "")
}

fn preemption(machine: &Machine) -> Check {
    let name = "preemption";
    let is_realtime = machine.realtime.as_deref() == Some("1") || machine.kernel_version.contains("PREEMPT_RT");
    if is_realtime {
        return ok(name, "PREEMPT_RT");
    }
    let found = ["PREEMPT_DYNAMIC", "PREEMPT"].into_iter().find(|word| machine.kernel_version.contains(word));
    let change = "install a PREEMPT_RT kernel (Debian: apt install linux-image-rt-amd64)";
    check(name, Status::Warning, found.unwrap_or("no PREEMPT_RT"), change)
}

fn throttling(machine: &Machine, asked: &Asked) -> Check {
    let name = "real-time throttling";
    let Some(text) = &machine.rt_runtime_us else { return ok(name, "none in this kernel") };
    match text.parse::<i64>() {
        Ok(runtime) if runtime < 0 => ok(name, "off"),
        Ok(runtime) => {
            let found = format!("{runtime} us of each second's 1000000 us for real-time threads");
            // Only a thread that never sleeps is affected.
            let status = if asked.spins { Status::Warning } else { Status::Ok };
            let change =
                if asked.spins { "sysctl -w kernel.sched_rt_runtime_us=-1, or control.wait = \"hybrid\"" } else { "" };
            check(name, status, found, change)
        }
        Err(_) => check(name, Status::Warning, text.clone(), "read /proc/sys/kernel/sched_rt_runtime_us: not a number"),
    }
}

fn governor(machine: &Machine) -> Check {
    let name = "CPU governor";
    if machine.governors.is_empty() {
        return ok(name, "no frequency scaling");
    }
    let slow: Vec<String> = machine
        .governors
        .iter()
        .filter(|(_, governor)| governor != "performance")
        .map(|(cpu, governor)| format!("{governor} on {cpu}"))
        .collect();
    if slow.is_empty() {
        return ok(name, "performance");
    }
    check(name, Status::Warning, slow.join(", "), "cpupower frequency-set -g performance")
}

fn isolation(machine: &Machine, asked: &Asked) -> Check {
    let name = "isolated processors";
    let isolated = machine.isolated.clone().unwrap_or_default();
    let list = processors(&isolated).unwrap_or_default();
    let found = if isolated.is_empty() { "none".to_owned() } else { isolated };
    let wanted = asked.cpu;
    let is_well = match wanted {
        Some(cpu) => list.contains(&cpu),
        None => !list.is_empty(),
    };
    if is_well {
        return ok(name, found);
    }
    let cpu = wanted.map_or_else(|| "N".to_owned(), |cpu| cpu.to_string());
    let change = format!("boot with isolcpus={cpu} nohz_full={cpu} rcu_nocbs={cpu}, and set realtime.cpu = {cpu}");
    check(name, Status::Warning, found, change)
}

fn processor(machine: &Machine, asked: &Asked) -> Check {
    let name = "processors";
    let usable = line(machine.status.as_deref(), "Cpus_allowed_list:").or_else(|| machine.online.clone());
    let Some(usable) = usable else { return check(name, Status::Warning, "unknown", "mount /proc and /sys") };
    let list = processors(&usable).unwrap_or_default();
    match asked.cpu {
        Some(cpu) if !list.contains(&cpu) => {
            let change =
                format!("realtime.cpu = {cpu}: choose one of {usable}, or let this process use it (CPUAffinity=)");
            check(name, missing(asked.require_realtime), usable.clone(), change)
        }
        _ if list.len() < 2 => check(
            name,
            Status::Warning,
            usable,
            "use a machine with two processors at least: one is the real-time thread's",
        ),
        _ => ok(name, usable),
    }
}

fn memory_lock(machine: &Machine, asked: &Asked) -> Check {
    let name = "memory lock";
    if has_capability(machine, CAP_IPC_LOCK) {
        return ok(name, "unlimited (CAP_IPC_LOCK)");
    }
    match limit(machine, "Max locked memory").as_deref() {
        Some("unlimited") => ok(name, "unlimited"),
        found => {
            let found = found.map_or_else(|| "unknown".to_owned(), |bytes| format!("{bytes} B"));
            let change =
                "systemd: AmbientCapabilities=CAP_IPC_LOCK; else memlock unlimited in /etc/security/limits.conf";
            check(name, missing(asked.lock_memory && asked.require_realtime), found, change)
        }
    }
}

fn priority(machine: &Machine, asked: &Asked) -> Check {
    let name = "SCHED_FIFO priority";
    if has_capability(machine, CAP_SYS_NICE) {
        return ok(name, "up to 99 (CAP_SYS_NICE)");
    }
    let largest: u32 = limit(machine, "Max realtime priority").and_then(|text| text.parse().ok()).unwrap_or(0);
    // A configuration that asks for nothing passes; without one, a daemon's usual needs are
    // checked.
    let wanted = if asked.priority > 0 { asked.priority } else { 1 };
    if largest >= wanted {
        return ok(name, format!("up to {largest}"));
    }
    let wanted = wanted.max(80);
    let change =
        format!("systemd: AmbientCapabilities=CAP_SYS_NICE; else rtprio {wanted} in /etc/security/limits.conf");
    check(name, missing(asked.priority > 0 && asked.require_realtime), format!("up to {largest}"), change)
}

fn wake_up_latency(machine: &Machine, asked: &Asked) -> Check {
    let name = "idle states";
    match &machine.cpu_dma_latency {
        Ok(()) if asked.cpu_dma_latency => ok(name, format!("{CPU_DMA_LATENCY} can be written")),
        Ok(()) => {
            let found = format!("{CPU_DMA_LATENCY} can be written");
            check(
                name,
                Status::Ok,
                found,
                "realtime.cpu_dma_latency_us = 0 keeps processors awake, at the price of power",
            )
        }
        Err(why) => {
            let change = "udev rule: KERNEL==\"cpu_dma_latency\", GROUP=\"admittanced\", MODE=\"0660\" (deploy/install.sh lays \
                it down); or boot with processor.max_cstate=1";
            let status = missing(asked.cpu_dma_latency && asked.require_realtime);
            check(name, status, format!("{CPU_DMA_LATENCY}: {why}"), change)
        }
    }
}

fn shared_memory(machine: &Machine) -> Check {
    let name = "shared memory";
    let change = "free some, or mount -o remount,size=64M /dev/shm";
    match machine.shared_memory {
        None => check(name, Status::Refused, "/dev/shm is not mounted", "mount -t tmpfs tmpfs /dev/shm"),
        // The daemon does not start then.
        Some(free) if free < Needed::DAEMON.bytes => check(name, Status::Refused, mebibytes(free), change),
        Some(free) => ok(name, mebibytes(free)),
    }
}

fn root_path(machine: &Machine) -> Check {
    let name = "root path";
    match &machine.root_path {
        Ok(found) => ok(name, found.clone()),
        // The daemon does not start then.
        Err(why) => check(name, Status::Refused, why.clone(), "ipc.root_path: a directory of the daemon's user alone"),
    }
}

fn shared_files(machine: &Machine) -> Check {
    let name = "owner of shared memory";
    match &machine.shared_files {
        Ok(()) => ok(name, "nobody else has files of this prefix"),
        Err(why) => check(name, Status::Refused, why.clone(), "rm the file as root, and find out who made it"),
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{} MiB free in /dev/shm", bytes >> 20)
}

fn clock_source(machine: &Machine) -> Check {
    let name = "clock source";
    // Read without a system call.
    const FAST: [&str; 5] =
        ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "riscv_clocksource"];
    match &machine.clock_source {
        Some(source) if FAST.contains(&source.as_str()) => ok(name, source.clone()),
        found => {
            let found = found.clone().unwrap_or_else(|| "unknown".to_owned());
            check(
                name,
                Status::Warning,
                found,
                "boot with clocksource=tsc tsc=reliable, if the processor's TSC is invariant",
            )
        }
    }
}

/// The rest of the line that begins with `key`.
fn line(text: Option<&str>, key: &str) -> Option<String> {
    text?.lines().find_map(|line| Some(line.strip_prefix(key)?.trim().to_owned()))
}

/// The soft limit of /proc/self/limits with this name.
fn limit(machine: &Machine, name: &str) -> Option<String> {
    line(machine.limits.as_deref(), name)?.split_whitespace().next().map(str::to_owned)
}

fn has_capability(machine: &Machine, number: u32) -> bool {
    let mask = line(machine.status.as_deref(), "CapEff:").and_then(|mask| u64::from_str_radix(&mask, 16).ok());
    mask.is_some_and(|mask| mask >> number & 1 == 1)
}

#[cfg(test)]
mod tests;
