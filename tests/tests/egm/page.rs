//! What docs/egm.md has a person type, and what it says of speed.

use std::net::UdpSocket;
use std::path::Path;
use std::process::Command;

use end_to_end::session::output;
use end_to_end::{PrivateIpc, binaries, page, undisturbed};

use crate::cell::{DAEMON, SCENARIO};

const PAGE: &str = include_str!("../../../docs/egm.md");

/// A place that looks like the repository, with a daemon's file that bears a busy machine.
fn place(ipc: &PrivateIpc) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let directory = ipc.directory();
    std::os::unix::fs::symlink(root.join("plant-sim"), directory.join("plant-sim")).expect("linked");
    std::fs::create_dir_all(directory.join("deploy/egm")).expect("made");
    let shipped = "answer_budget_s = 0.002\nmax_sample_age_s = 0.02\n";
    assert!(DAEMON.contains(shipped));
    let patient = "answer_budget_s = 0.0028\nmax_sample_age_s = 0.1\nmax_consecutive_fallbacks = 20\n";
    let daemon = DAEMON.replace(shipped, patient);
    std::fs::write(directory.join("deploy/egm/six-joint.toml"), daemon).expect("written");
    std::fs::copy(root.join("deploy/egm/six-joint.egm.toml"), directory.join("deploy/egm/six-joint.egm.toml"))
        .expect("copied");
}

#[test]
fn the_commands_of_the_rehearsal_touch_slide_stop_and_lift_off() {
    undisturbed(|| {
        let ipc = PrivateIpc::new("egm");
        place(&ipc);
        let port = UdpSocket::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a free port").port();
        let settings = ipc.settings();
        let programs = binaries();
        let meet = format!(" --root-path {} --prefix {}", settings.root_path.display(), settings.prefix);
        // As typed, with what was built for the tests, at a port and in a place of their own.
        let lines = page::commands(PAGE, "Rehearse\n");
        assert!(lines.len() == 6 && lines[4].starts_with("plant-sim --scenario"), "{lines:#?}");
        let script: Vec<String> = lines.iter().map(|line| as_here(line, port, &meet)).collect();
        let script = format!(
            "set -em\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\nadmittanced() {{ exec {} \"$@\"; }}\n\
             admittance-egm() {{ exec {} \"$@\"; }}\nplant-sim() {{ {} \"$@\"; }}\n{}\nwait\n",
            programs.admittanced.display(),
            programs.admittance_egm.display(),
            programs.plant_sim.display(),
            script.join("\n")
        );
        let mut shell = Command::new("bash");
        shell.arg("-c").arg(&script).current_dir(ipc.directory());
        let (code, said) = output(&mut shell);
        println!("{script}\n{said}");
        assert_eq!(code, Some(0), "{said}");
        let peak = said.split("peak normal force ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a peak");
        let peak: f64 = peak.parse().expect("a number");
        assert!(peak > 5.0 && peak <= 150.5, "{peak} N");
        assert!(said.contains("contact losses 1,") && !said.contains("CommTimeout"), "{said}");
    });
}

/// At another port, and in a place of its own.
fn as_here(line: &str, port: u16, meet: &str) -> String {
    let line = line.replace("'s/192.168.125.1/127.0.0.1/'", &format!("'s/192.168.125.1/127.0.0.1/; s/:6510/:{port}/'"));
    let line = line.replace("127.0.0.1:6510", &format!("127.0.0.1:{port}"));
    if line.starts_with("sed") || line.starts_with("kill") {
        return line;
    }
    match line.strip_suffix(" &") {
        Some(line) => format!("{line}{meet} &"),
        None => format!("{line}{meet}"),
    }
}

/// A robot that follows 12 to 20 ms late is safe at slow speeds alone: the page's figures are what its command finds.
#[test]
fn what_limits_says_of_the_shipped_file_is_slow_and_is_what_the_page_has() {
    let text: String = PAGE.split_whitespace().collect::<Vec<_>>().join(" ");
    let told = text.split("`admittancectl limits ").nth(1).and_then(|rest| rest.split('`').next()).expect("a command");
    let mut limits = Command::new(&binaries().admittancectl);
    limits.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).arg("limits").args(told.split(' '));
    // Of the table what the page speaks of.
    limits.args(["--sampling-time-s", "0.004", "--stiffness-n-m", "2e4,6e4", "--json"]);
    let output = limits.output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let recommended = found["recommended"]["speed_m_s"].as_f64().expect("a speed");
    let [on_told, on_harder] = [0, 1].map(|cell| found["cells"][cell]["speed_m_s"].as_f64().expect("a speed"));
    println!("recommended {recommended} m/s; as told {on_told}, three times as hard {on_harder} m/s");
    assert!(recommended < 0.2 && on_harder < 0.2 && on_told > on_harder, "slow: {found:#}");
    for said in [format!("recommends {recommended} m/s at most"), format!("and {on_harder} m/s is all that is safe")] {
        assert!(text.contains(&said), "the page does not have {said:?}");
    }
    let scenario: plant_sim::scenario::Scenario =
        admittance_host::config::parse(SCENARIO, "scenario.toml").expect("valid");
    let touch = -scenario.motion[0].twist[2];
    assert!(touch <= recommended / 4.0, "the scenario touches at {touch} m/s");
}
