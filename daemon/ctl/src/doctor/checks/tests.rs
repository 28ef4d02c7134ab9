use super::*;

/// A user without rights on a desktop.
fn desktop() -> Machine {
    Machine {
        kernel_version: "#1 SMP PREEMPT_DYNAMIC Debian 6.1.0".to_owned(),
        realtime: None,
        rt_runtime_us: Some("950000".to_owned()),
        governors: vec![(0, "performance".to_owned()), (1, "powersave".to_owned())],
        isolated: Some(String::new()),
        online: Some("0-3".to_owned()),
        status: Some("Name:\tx\nCapEff:\t0000000000000000\nCpus_allowed_list:\t0-1\n".to_owned()),
        limits: Some(
            "Limit                     Soft Limit           Hard Limit           Units     \n\
             Max locked memory         8388608              8388608              bytes     \n\
             Max realtime priority     0                    0                    \n"
                .to_owned(),
        ),
        clock_source: Some("hpet".to_owned()),
        shared_memory: Some(1 << 30),
        cpu_dma_latency: Err("Permission denied (os error 13)".to_owned()),
        root_path: Ok("/run/admittanced, of admittanced alone".to_owned()),
        shared_files: Ok(()),
    }
}

/// One that was tuned, and a user with the rights.
fn tuned() -> Machine {
    Machine {
        kernel_version: "#1 SMP PREEMPT_RT Debian 6.1.0".to_owned(),
        rt_runtime_us: Some("-1".to_owned()),
        governors: Vec::new(),
        isolated: Some("1-3".to_owned()),
        status: Some("CapEff:\t0000000000804000\nCpus_allowed_list:\t0-3\n".to_owned()),
        clock_source: Some("tsc".to_owned()),
        cpu_dma_latency: Ok(()),
        ..desktop()
    }
}

fn demanding() -> Asked {
    Asked { lock_memory: true, priority: 85, cpu: Some(3), cpu_dma_latency: true, require_realtime: true, spins: true }
}

fn with(checks: &[Check], status: Status) -> Vec<&str> {
    checks.iter().filter(|check| check.status == status).map(|check| check.name).collect()
}

#[test]
fn a_tuned_machine_is_well_whatever_is_asked() {
    for asked in [Asked::default(), demanding()] {
        let checks = all(&tuned(), &asked);
        assert_eq!(with(&checks, Status::Ok).len(), checks.len(), "{checks:?}");
    }
}

#[test]
fn without_a_configuration_nothing_is_refused_and_every_warning_says_what_to_change() {
    let checks = all(&desktop(), &Asked::default());
    assert_eq!(
        with(&checks, Status::Warning),
        [
            "preemption",
            "CPU governor",
            "isolated processors",
            "memory lock",
            "SCHED_FIFO priority",
            "idle states",
            "clock source"
        ]
    );
    assert_eq!(with(&checks, Status::Refused), Vec::<&str>::new());
    for check in checks.iter().filter(|check| check.status != Status::Ok) {
        assert!(!check.change.is_empty() && !check.found.is_empty(), "{check:?}");
    }
    let governor = checks.iter().find(|check| check.name == "CPU governor").expect("it is checked");
    assert_eq!(governor.found, "powersave on 1");
}

#[test]
fn what_a_configuration_requires_is_refused_where_it_is_not_granted() {
    let checks = all(&desktop(), &demanding());
    let refused = ["processors", "memory lock", "SCHED_FIFO priority", "idle states"];
    assert_eq!(with(&checks, Status::Refused), refused);
    let throttling = checks.iter().find(|check| check.name == "real-time throttling").expect("it is checked");
    assert!(throttling.status == Status::Warning && throttling.change.contains("sched_rt_runtime_us=-1"));
    // Without require_realtime the daemon warns and goes on.
    let lenient = Asked { require_realtime: false, ..demanding() };
    assert_eq!(with(&all(&desktop(), &lenient), Status::Refused), Vec::<&str>::new());
}

#[test]
fn a_full_shared_memory_is_refused_for_everyone() {
    for shared_memory in [None, Some(Needed::DAEMON.bytes - 1)] {
        let checks = all(&Machine { shared_memory, ..tuned() }, &Asked::default());
        assert_eq!(with(&checks, Status::Refused), ["shared memory"]);
    }
}

#[test]
fn a_place_that_is_not_the_user_s_alone_is_refused() {
    let why = || Err("/run/admittanced belongs to nobody".to_owned());
    let checks = all(&Machine { root_path: why(), ..tuned() }, &Asked::default());
    assert_eq!(with(&checks, Status::Refused), ["root path"]);
    let checks = all(&Machine { shared_files: why().map(|_: String| ()), ..tuned() }, &Asked::default());
    assert_eq!(with(&checks, Status::Refused), ["owner of shared memory"]);
}

#[test]
fn limits_count_without_capabilities() {
    let limits = "Max locked memory         unlimited            unlimited            bytes     \n\
                  Max realtime priority     90                   90                   \n";
    let machine = Machine { limits: Some(limits.to_owned()), ..desktop() };
    let asked = Asked { cpu: None, cpu_dma_latency: false, spins: false, ..demanding() };
    assert_eq!(with(&all(&machine, &asked), Status::Refused), Vec::<&str>::new());
    let too_high = Asked { priority: 95, ..asked };
    assert_eq!(with(&all(&machine, &too_high), Status::Refused), ["SCHED_FIFO priority"]);
}
