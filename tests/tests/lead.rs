//! `admittancectl move`, daemon and motion controllers that let programs lead them, as real processes: plant-sim by itself,
//! and admittance-egm with the robot that plant-sim emulates.

use std::process::Command;
use std::time::Duration;

use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{
    PAPER_SCENARIO, PATIENT, ctl_command, output, plant_command, start_daemon, wait_for_log, with_keys, write,
};
use end_to_end::{Child, PATIENCE, PrivateIpc, binaries, certain, undisturbed};
use ipc_types::services::{self, Access};
use ipc_types::{Node, Subscriber, TruthSample};

/// A surface and a delay that forgive answers that are late now and then.
const SOFT: [(&str, &str); 2] = [("control.command_delay_s", "0.003"), ("environment.normal_stiffness_n_m", "2e4")];
/// The paper's surface, softer, 2 cm below an arm that nothing moves but who leads it.
const PLANT: [(&str, &str); 5] = [
    ("motion", "[{ duration_s = 120.0, twist = [0.0, 0.0] }]"),
    ("start", "{ joint_position_rad = [1.2167, -1.4492] }"),
    ("surface.stiffness_n_m", "2e4"),
    ("timing.command_delay_s", "0.003"),
    ("twist", "{ linear_limit_m_s = 0.05, angular_limit_rad_s = 0.1, linear_acceleration_m_s2 = 0.5 }"),
];
/// As told above.
const LIMIT_M_S: f64 = 0.05;
/// What the sample waits for, and the ramp from the limit takes: 0.1 s each. Then the arm's own lags.
const COMES_TO_REST_S: f64 = 0.1 + 0.1 + 0.15;
const RESTS_M_S: f64 = 1e-4;
/// f_max in N, and what the linear model may miss of it.
const MOST_N: f64 = 200.5;

/// An arm that waits to be led.
struct Cell {
    truths: Subscriber<TruthSample>,
    seen: Vec<TruthSample>,
    plant: Child,
    daemon: Child,
    config: std::path::PathBuf,
    _node: Node,
    ipc: PrivateIpc,
}

impl Cell {
    /// Daemon and plant-sim, with these keys of the scenario besides.
    fn new(changes: &[(&str, &str)]) -> Self {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &with_keys(MPC_DEFAULT, &[&PATIENT[..], &SOFT].concat()));
        let daemon = start_daemon(&ipc, &config);
        let scenario = write(&ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[&PLANT[..], changes].concat()));
        let plant = Child::spawn(&mut plant_command(&ipc, &scenario));
        Self::of(ipc, config, daemon, plant)
    }

    fn of(ipc: PrivateIpc, config: std::path::PathBuf, daemon: Child, mut plant: Child) -> Self {
        let node = ipc.settings().node("test").expect("a node");
        let mut truths = None;
        plant.wait_until("the plant publishes its truth", PATIENCE, |_| {
            let service = services::truth(&node, &ipc.settings().instance, Access::Open).ok();
            truths = service.and_then(|service| service.subscriber().ok());
            truths.is_some()
        });
        let truths = truths.expect("just opened");
        let mut cell = Self { truths, seen: Vec::new(), plant, daemon, config, _node: node, ipc };
        cell.look_until("the motion has begun", |truth| truth.scenario_time_s > 0.0);
        cell
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = ctl_command(&self.ipc, "move", &self.config);
        command.args(words);
        command
    }

    fn look(&mut self) {
        while let Ok(Some(truth)) = self.truths.receive() {
            self.seen.push(*truth);
        }
        let ended = self.plant.exit_status();
        assert!(ended.is_none(), "the plant ended: {}", self.plant.report());
    }

    /// Sees truths until one is as wanted.
    fn look_until(&mut self, what: &str, is_wanted: impl Fn(&TruthSample) -> bool) {
        let begun = self.seen.len();
        for _ in 0..4000 {
            self.look();
            if self.seen[begun..].iter().any(&is_wanted) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("never: {what}; {}", self.plant.report());
    }

    /// Sees half a second of the plant's time go by.
    fn look_on(&mut self) {
        let now_s = self.seen.last().map_or(0.0, |truth| truth.scenario_time_s);
        self.look_until("time goes on", |truth| truth.scenario_time_s > now_s + 0.5);
    }

    /// Leads with these words to the end of the program, and half a second longer. Its exit code, what it said, and the
    /// truths since.
    fn lead(&mut self, words: &[&str]) -> (Option<i32>, String, Vec<TruthSample>) {
        let (begun, mut leader) = (self.seen.len(), Child::spawn(&mut self.command(words)));
        while leader.exit_status().is_none() {
            self.look();
            std::thread::sleep(Duration::from_millis(5));
        }
        self.look_on();
        let code = leader.wait_for_exit(PATIENCE).code();
        (code, format!("{}{}", leader.stdout(), leader.stderr()), self.seen[begun..].to_vec())
    }
}

fn speed(truth: &TruthSample) -> f64 {
    truth.tcp_twist[..3].iter().map(|value| value * value).sum::<f64>().sqrt()
}

fn fastest(truths: &[TruthSample]) -> f64 {
    truths.iter().map(speed).fold(0.0, f64::max)
}

fn way(truths: &[TruthSample]) -> [f64; 3] {
    let [first, last] = [truths.first(), truths.last()].map(|truth| truth.expect("truths").tcp_position);
    std::array::from_fn(|axis| last[axis] - first[axis])
}

fn rests(truths: &[TruthSample]) -> bool {
    truths.len() > 10 && truths[truths.len() - 10..].iter().all(|truth| speed(truth) < RESTS_M_S)
}

/// From `stamp_ns` on it comes to rest in the time that the page says, and stays so.
fn comes_to_rest(truths: &[TruthSample], stamp_ns: u64) {
    let late_ns = stamp_ns + (COMES_TO_REST_S * 1e9) as u64;
    let late: Vec<TruthSample> = truths.iter().filter(|truth| truth.stamp_ns > late_ns).copied().collect();
    assert!(late.len() > 10 && fastest(&late) < RESTS_M_S, "{} truths, up to {} m/s", late.len(), fastest(&late));
}

#[test]
fn it_leads_for_its_time_as_fast_as_it_may_and_ends_at_rest() {
    undisturbed(|| {
        let mut cell = Cell::new(&[]);
        let (code, said, truths) = cell.lead(&["--twist", "x=0.03", "y=0.01", "--for", "0.5"]);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains("x 0.03 m/s, y 0.01 m/s") && said.contains("now zero: the time is over"), "{said}");
        let [x, y, _] = way(&truths);
        println!("{x:.4} {y:.4} m, at most {:.4} m/s", fastest(&truths));
        assert!((0.012..0.022).contains(&x) && (y / x - 1.0 / 3.0).abs() < 0.03, "{x} m, {y} m");
        assert!((fastest(&truths) - 0.03_f64.hypot(0.01)).abs() < 1e-3 && rests(&truths), "{} m/s", fastest(&truths));
        // Ten times too fast: the same way, at the limit.
        let (code, said, truths) = cell.lead(&["--twist", "x=-0.4", "y=0.3", "--for", "0.4"]);
        assert_eq!(code, Some(0), "{said}");
        let [x, y, _] = way(&truths);
        certain(|| assert!(fastest(&truths) < 1.02 * LIMIT_M_S, "{} m/s", fastest(&truths)));
        assert!((y / x + 0.75).abs() < 0.03 && fastest(&truths) > 0.95 * LIMIT_M_S && rests(&truths), "{x} m, {y} m");
        // The tool's x axis is the last link's direction.
        let joints = truths.last().expect("truths").joint_position;
        let link = joints[0] + joints[1];
        let (code, said, truths) = cell.lead(&["--twist", "x=-0.03", "--frame", "tool", "--for", "0.4"]);
        assert_eq!(code, Some(0), "{said}");
        let [x, y, _] = way(&truths);
        assert!(x < 0.0 && (y / x - link.tan()).abs() < 0.05, "{x} m, {y} m at {link} rad");
        cell.daemon.terminate();
    });
}

#[test]
fn until_contact_it_ends_when_the_daemon_says_so() {
    undisturbed(|| {
        let mut cell = Cell::new(&[]);
        let words = ["--twist", "y=-0.04", "--for", "20", "--until-contact"];
        let (code, said, truths) = cell.lead(&words);
        println!("{said}");
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains("now zero: contact"), "{said}");
        let touched = truths.iter().find(|truth| truth.in_contact == 1).expect("a contact").stamp_ns;
        let peak = truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max);
        assert!(peak < MOST_N, "{peak} N");
        // Nobody pushes any more: at the minimum force the arm stands, as the law has it.
        let last = truths.last().expect("truths");
        assert!(last.in_contact == 1 && last.stamp_ns > touched && last.contact_losses == 0, "{last:?}");
        // In contact there is nothing to wait for.
        let (code, said) = output(&mut cell.command(&words));
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("not moved: the daemon says Contact; accepted with --until-contact: Free"), "{said}");
        // Away from it there is no contact.
        let (code, said, truths) = cell.lead(&["--twist", "y=0.04", "--for", "0.6"]);
        assert_eq!((code, truths.last().expect("truths").in_contact), (Some(0), 0), "{said}");
        let (code, said, truths) = cell.lead(&["--twist", "x=-0.02", "--for", "0.3", "--until-contact"]);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("no contact in that time") && rests(&truths), "{said}");
        cell.daemon.terminate();
    });
}

#[test]
fn however_it_ends_the_arm_comes_to_rest() {
    for (signal, code) in [(libc::SIGINT, Some(1)), (libc::SIGTERM, Some(1)), (libc::SIGKILL, None)] {
        undisturbed(|| {
            let mut cell = Cell::new(&[]);
            let begun = cell.seen.len();
            let mut leader = Child::spawn(&mut cell.command(&["--twist", "x=0.05", "--for", "30"]));
            cell.look_until("it moves", |truth| speed(truth) > 0.04);
            let ended_ns = admittance_host::clock::monotonic_ns();
            leader.signal(signal);
            assert_eq!(leader.wait_for_exit(PATIENCE).code(), code, "{}", leader.report());
            let said = leader.stdout();
            assert!(code.is_none() || said.contains("now zero: ended by a signal"), "{said}");
            cell.look_on();
            certain(|| comes_to_rest(&cell.seen[begun..], ended_ns));
            cell.daemon.terminate();
        });
    }
}

#[test]
fn one_program_leads_and_none_without_daemon_or_follower() {
    undisturbed(|| {
        let mut cell = Cell::new(&[]);
        let mut leader = Child::spawn(&mut cell.command(&["--twist", "x=-0.01", "--for", "60"]));
        cell.look_until("it moves", |truth| speed(truth) > 0.005);
        let (code, said) = output(&mut cell.command(&["--twist", "x=0.01", "--for", "1"]));
        assert_eq!(code, Some(69), "{said}");
        assert!(said.contains("another process already publishes"), "{said}");
        // The daemon goes: so does the leader, with zero.
        cell.daemon.signal(libc::SIGKILL);
        assert_eq!(leader.wait_for_exit(PATIENCE).code(), Some(69), "{}", leader.report());
        assert!(leader.report().contains("admittanced is silent"), "{}", leader.report());
        cell.look_on();
        assert!(rests(&cell.seen));
        let (code, said) = output(&mut cell.command(&["--twist", "x=0.01", "--for", "1"]));
        assert_eq!(code, Some(69), "{said}");
        // A plant whose scenario leads it follows nobody.
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &with_keys(MPC_DEFAULT, &PATIENT));
        let _daemon = start_daemon(&ipc, &config);
        let (code, said) = output(ctl_command(&ipc, "move", &config).args(["--twist", "x=0.01", "--for", "1"]));
        assert_eq!(code, Some(69), "{said}");
        assert!(said.contains("nobody follows") && said.contains("[twist] section"), "{said}");
    });
}

#[test]
fn what_cannot_be_is_named() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_DEFAULT);
    for (words, named) in [
        (&["--twist", "x=fast", "--for", "1"][..], "accepted: AXIS=SPEED"),
        (&["--twist", "x=nan", "--for", "1"], "accepted: AXIS=SPEED"),
        (&["--twist", "v=1", "--for", "1"], "accepted: AXIS=SPEED"),
        (&["--twist", "x=0.1", "x=0.2", "--for", "1"], "x is there twice: accepted: each axis once"),
        (&["--twist", "rz=0.1", "--for", "1"], "--twist: rz: accepted: x y, which the arm controls"),
        (&["--twist", "x=0.1", "--for", "0"], "accepted: seconds above 0, at most 3600"),
        (&["--twist", "x=0.1", "--for", "inf"], "accepted: seconds above 0, at most 3600"),
        (&["--twist", "x=0.1"], "--for <SECONDS>"),
        (&["--for", "1"], "--twist <AXIS=SPEED>"),
        (&["--twist", "x=0.1", "--for", "1", "--frame", "flange"], "base, tool"),
    ] {
        let (code, said) = output(ctl_command(&ipc, "move", &config).args(words));
        assert!(code == Some(64) && said.contains(named), "{words:?}: {code:?}: {said}");
    }
    let scenario = write(&ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[PLANT[4]]));
    let (code, said) = output(&mut plant_command(&ipc, &scenario));
    assert!(code == Some(78) && said.contains("motion[0].twist") && said.contains("zeros with [twist]"), "{said}");
}

/// The robot's own program stands, and the edge's file lets others lead.
#[test]
fn an_abb_robot_is_led_by_the_edge() {
    const DAEMON: &str = include_str!("../../deploy/egm/six-joint.toml");
    const EDGE: &str = include_str!("../../deploy/egm/six-joint.egm.toml");
    const SCENARIO: &str = include_str!("../../plant-sim/scenarios/six-joint-egm.toml");
    const SURFACE_Z_M: f64 = -0.33258;
    let calm = [("realtime.lock_memory", "false"), ("realtime.priority", "0")];
    undisturbed(|| {
        let ipc = PrivateIpc::new("egm");
        let daemon = [
            ("control.answer_budget_s", "0.0028"),
            ("control.max_sample_age_s", "0.1"),
            ("control.max_consecutive_fallbacks", "20"),
            // Where the surface is, nobody knows: told 2 mm too high, the arm would leave it again.
            ("environment.contact", "\"detected\""),
        ];
        let config = write(&ipc, "daemon.toml", &with_keys(DAEMON, &[&daemon[..], &calm].concat()));
        let edge = [
            ("egm.listen", "\"127.0.0.1:0\""),
            ("egm.robot_address", "\"127.0.0.1\""),
            ("twist", "{ linear_limit_m_s = 0.03, angular_limit_rad_s = 0.1 }"),
        ];
        let edge = write(&ipc, "edge.toml", &with_keys(EDGE, &[&edge[..], &calm].concat()));
        let settings = ipc.settings();
        let mut command = Command::new(&binaries().admittance_egm);
        command.arg("--config").arg(&edge).arg("--daemon-config").arg(&config);
        command.arg("--root-path").arg(&settings.root_path);
        command.args(["--prefix", &settings.prefix, "--instance", settings.instance.as_str()]);
        let daemon = start_daemon(&ipc, &config);
        let mut edge = Child::spawn(&mut command);
        wait_for_log(&mut edge, "is led by other programs");
        let log = edge.stderr();
        let port = log.split("on 127.0.0.1:").nth(1).and_then(|rest| rest.split([',', ' ']).next()).expect("a port");
        let scenario = [
            ("motion", "[{ duration_s = 60.0, twist = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }]"),
            ("start", "{ joint_position_rad = [0.3, 1.2, -1.8, 2.2, 1.57, 0.3] }"),
            // 10 mm below where it starts.
            ("surface.point_m", &format!("[-0.48934, -0.33388, {SURFACE_Z_M}]")),
        ];
        let scenario = write(&ipc, "scenario.toml", &with_keys(SCENARIO, &scenario));
        let plant = Child::spawn(plant_command(&ipc, &scenario).args(["--egm", &format!("127.0.0.1:{port}")]));
        let mut cell = Cell::of(ipc, config, daemon, plant);
        let (code, said, truths) = cell.lead(&["--twist", "x=0.02", "rz=0.05", "--for", "0.5"]);
        assert_eq!(code, Some(0), "{said}");
        let [x, y, z] = way(&truths);
        println!("{x:.4} {y:.4} {z:.4} m");
        assert!((0.007..0.015).contains(&x) && y.abs() < 2e-4 && z.abs() < 2e-4 && rests(&truths), "{x} {y} {z} m");
        let (code, said, truths) = cell.lead(&["--twist", "z=-0.02", "--for", "20", "--until-contact"]);
        println!("{said}");
        assert!(code == Some(0) && said.contains("now zero: contact") && !said.contains("contact_point_m"), "{said}");
        let peak = truths.iter().map(|truth| truth.peak_normal_force_n).fold(0.0, f64::max);
        assert!(peak < 150.5 && truths.iter().any(|truth| truth.in_contact == 1) && rests(&truths), "{peak} N");
        // It rests in the surface, at the force that it is told to keep.
        let last = truths.last().expect("truths");
        println!("{peak:.1} N, then {:.1} N", last.normal_force_n);
        assert!(last.in_contact == 1 && (5.0..8.0).contains(&last.normal_force_n), "{} N", last.normal_force_n);
        // Killed: the edge goes on answering the robot, and leads it to rest.
        let begun = cell.seen.len();
        let mut leader = Child::spawn(&mut cell.command(&["--twist", "z=0.03", "--for", "30"]));
        cell.look_until("it moves", |truth| speed(truth) > 0.02);
        let killed_ns = admittance_host::clock::monotonic_ns();
        leader.signal(libc::SIGKILL);
        cell.look_on();
        certain(|| comes_to_rest(&cell.seen[begun..], killed_ns));
        assert!(!cell.plant.stderr().contains("CommTimeout") && edge.exit_status().is_none(), "{}", edge.report());
        edge.terminate();
        assert_eq!(edge.wait_for_exit(PATIENCE).code(), Some(0), "{}", edge.report());
    });
}
