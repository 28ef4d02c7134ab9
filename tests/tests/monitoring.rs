//! docs/monitoring.md as it is typed, on two machines that share nothing but a network: top, status and record work on the far
//! side, nothing that is done there reaches the daemon, and the daemon's timing is what it was.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use admittance_host::clock::monotonic_ns;
use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::namespaces::{Machine, two_machines};
use end_to_end::session::{
    PAPER_SCENARIO, PATIENT, ctl_command, drive_plant_by, output, plant_command, start_daemon, with_keys, write,
};
use end_to_end::{
    Child, Need, PATIENCE, PrivateIpc, binaries, certain, needs, page, python, screen, tunnel, undisturbed,
};
use iceoryx2::prelude::{CallbackProgression, Service as _, ipc};
use ipc_types::{IpcSettings, TruthSample};

const PAGE: &str = include_str!("../../docs/monitoring.md");
/// A thousand samples a second, on a surface and with a delay that forgive answers that are late now and then.
const CYCLE: [(&str, &str); 2] = [("control.sampling_time_s", "0.001"), ("control.answer_budget_s", "0.0009")];
const SOFT: [(&str, &str); 2] = [("control.command_delay_s", "0.003"), ("environment.normal_stiffness_n_m", "2e4")];

fn daemon_file(ipc: &PrivateIpc) -> PathBuf {
    write(ipc, "cell-3.toml", &with_keys(MPC_DEFAULT, &[&PATIENT[..], &SOFT, &CYCLE].concat()))
}

/// A touch after some time of free motion, and then to and fro along the surface.
fn scenario(ipc: &PrivateIpc, approach_s: f64, seconds: u32) -> PathBuf {
    scenario_with(ipc, approach_s, seconds, &[])
}

fn scenario_with(ipc: &PrivateIpc, approach_s: f64, seconds: u32, more: &[(&str, &str)]) -> PathBuf {
    let phase = |(duration_s, twist): (f64, [f64; 2])| format!("{{ duration_s = {duration_s:?}, twist = {twist:?} }}");
    // Along the plane, and 2 mm/s into it.
    // (A scenario has 64 phases at most.)
    let turns = (seconds / 2).min(60);
    let lasts_s = f64::from(seconds) / f64::from(turns);
    let along = (0..turns).map(|turn| (lasts_s, if turn % 2 == 0 { [0.0081, -0.006] } else { [-0.0099, 0.0024] }));
    let phases: Vec<String> =
        std::iter::once((approach_s, [0.0, -0.05 / approach_s])).chain(along).map(phase).collect();
    let motion = format!("[{}]", phases.join(", "));
    let contact_s = format!("{:?}", 0.816 * approach_s);
    let keys = [
        ("motion", motion.as_str()),
        ("start.contact_time_s", contact_s.as_str()),
        ("timing.sampling_time_s", "0.001"),
        ("timing.command_delay_s", "0.003"),
        ("surface.stiffness_n_m", "2e4"),
    ];
    write(ipc, "scenario.toml", &with_keys(PAPER_SCENARIO, &[&keys[..], more].concat()))
}

/// Both sides of the page, with places in shared memory of their own.
struct Sides {
    robots: Machine,
    far: Machine,
    /// What is handed on, on the robot's machine and on the far one.
    relayed: PrivateIpc,
    there: PrivateIpc,
    started: Vec<Child>,
}

impl Sides {
    fn new() -> Self {
        let (robots, far) = two_machines();
        let (relayed, there) = (PrivateIpc::new("cell-3"), PrivateIpc::new("cell-3"));
        Self { robots, far, relayed, there, started: Vec::new() }
    }

    /// A line of the page as it is typed, with what was built for the tests, in this place.
    fn typed(line: &str, place: &IpcSettings, daemon: &IpcSettings) -> String {
        let root = place.root_path.to_string_lossy();
        let tool = |path: &Path| format!("setpriv --pdeathsig KILL {}", path.display());
        let daemons = format!(
            "--instance {} --root-path {} --prefix {}",
            daemon.instance,
            daemon.root_path.display(),
            daemon.prefix
        );
        line.replace("sudo ", "")
            .replace(" -o admittanced", "")
            .replace(" -o \"$USER\"", "")
            .replace("relay --instance cell-3", &format!("relay {daemons}"))
            .replace("/run/admittance-relay", &root)
            .replace("relay_", &place.prefix)
            .replace("exec iox2-", "iox2-")
            .replace("iox2-link-tunnel-zenoh", &tool(&tunnel().expect("it was asked for")))
            .replace("admittancectl ", &format!("{} ", tool(&binaries().admittancectl)))
    }

    /// Runs what the page says for both sides; returns when the far side has diagnostics. Not `aside` where a test asks for more than
    /// what is left of one processor: both machines share it, and the tunnel of the tests is not optimised.
    fn start(&mut self, daemon: &IpcSettings, aside: bool) {
        for (section, side) in [("On the robot's machine\n", 0), ("On the other machine\n", 1)] {
            let (machine, place) = [(&self.robots, &self.relayed), (&self.far, &self.there)][side];
            let lines = page::commands(PAGE, section);
            let is_of_setup = |line: &&String| !line.starts_with("cargo ") && !is_look(line);
            let here = |line: &String| if aside { line.clone() } else { line.replace("$aside ", "") };
            let lines = lines.iter().filter(is_of_setup).map(here);
            let script: Vec<String> = lines.map(|line| Self::typed(&line, place.settings(), daemon)).collect();
            certain(|| assert!(script.iter().any(|line| line.contains("--allow")), "{script:#?}"));
            let text = format!("set -e\ncd {}\n{}\nwait\n", place.directory().display(), script.join("\n"));
            let file = write(place, "page.sh", &text);
            self.started.push(Child::spawn(machine.command(Path::new("sh")).arg(file)));
        }
        for _ in 0..100 {
            if self.look("status", &[]).0 == Some(0) {
                return;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        panic!("nothing comes to the far side: {}", self.report());
    }

    fn report(&mut self) -> String {
        self.started.iter_mut().map(Child::report).collect()
    }

    /// A command of admittancectl on the far side, with what the page tells it.
    fn command(&self, command: &str, words: &[&str]) -> Command {
        let settings = self.there.settings();
        let mut looks = self.far.command(&binaries().admittancectl);
        looks.args([command, "--instance", "cell-3", "--prefix", &settings.prefix]);
        looks.arg("--root-path").arg(&settings.root_path).args(words);
        looks
    }

    fn look(&self, command: &str, words: &[&str]) -> (Option<i32>, String) {
        output(&mut self.command(command, words))
    }

    /// The page's line with this command, on the far side.
    fn of_page(&self, command: &str) -> Command {
        let lines = page::commands(PAGE, "On the other machine\n");
        let line = lines.iter().find(|line| line.starts_with(&format!("admittancectl {command} "))).expect("a line");
        let typed = Self::typed(line, self.there.settings(), self.there.settings());
        let mut shell = self.far.command(Path::new("sh"));
        shell.args(["-c", &format!("cd {} && exec {typed}", self.there.directory().display())]);
        shell
    }
}

/// Whether a line of the page is one that looks at the daemon.
fn is_look(line: &str) -> bool {
    ["status", "top", "record"].iter().any(|command| line.starts_with(&format!("admittancectl {command}")))
}

/// Names of the services in a place.
fn services(place: &IpcSettings) -> Vec<String> {
    let mut names = Vec::new();
    ipc::Service::list(&place.config().expect("a sound place"), |service| {
        names.push(service.static_details.name().to_string());
        CallbackProgression::Continue
    })
    .expect("services can be listed");
    names.sort();
    names
}

/// What one test does the other would time, and two tunnels each are all that two processors bear.
static ALONE: Mutex<()> = Mutex::new(());

#[test]
fn the_far_side_sees_all_and_reaches_nothing() {
    if !needs(Need::Tunnel) {
        return;
    }
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    undisturbed(|| {
        let ipc = PrivateIpc::new("cell-3");
        let file = daemon_file(&ipc);
        let mut daemon = start_daemon(&ipc, &file);
        // For longer than all of this takes on any machine: that samples still come is looked at in the end.
        let mut plant = Child::spawn(&mut plant_command(&ipc, &scenario(&ipc, 15.0, 300)));
        let mut sides = Sides::new();
        sides.start(ipc.settings(), false);

        // What the page types there, line by line; top has a terminal.
        let (code, said) = output(&mut sides.of_page("status"));
        println!("{said}");
        assert!(code == Some(0) && said.contains("read only") && !said.contains("wrench bias"), "{said}");
        let (code, said) = sides.look("status", &["--json"]);
        let status: serde_json::Value = serde_json::from_str(&said).expect("one object");
        assert!(code == Some(0) && status["asked"] == false && status.get("law").is_none(), "{said}");
        assert!(status["cycles"].as_u64().is_some_and(|cycles| cycles > 0), "{said}");
        let (mut top, _terminal) = Child::spawn_on_terminal(&mut sides.of_page("top"));
        top.wait_until("the picture", PATIENCE, |top| top.stdout().contains("Counters"));
        std::thread::sleep(Duration::from_millis(600));
        let (seen, _) = screen(&top);
        println!("{seen}");
        // Its clock is a day ahead.
        assert!(seen.contains("as of 0.") && seen.contains("the last one 0."), "{seen}");
        top.terminate();
        assert_eq!(top.wait_for_exit(PATIENCE).code(), Some(0), "{}", top.report());

        std::fs::copy(&file, sides.there.directory().join("cell-3.toml")).expect("as the page says");
        let (code, said) = output(&mut sides.of_page("record"));
        println!("{said}");
        // How many are lost is the machine's affair, and said.
        let count: u32 = said.lines().find_map(|line| line.split_once(" records;")?.0.parse().ok()).expect("a count");
        assert!(code == Some(0) && count > 1000, "{count} records in 10 s: {said}");
        let recording = sides.there.directory().join("cell-3.mcap");
        let mut replay = Command::new(&binaries().admittancectl);
        let (code, said) = output(replay.arg("replay").arg(&recording));
        assert_eq!(code, Some(0), "{said}");

        // What would command the arm finds nobody there.
        let (before, own) = (own_status(&ipc, &file), services(ipc.settings()));
        for (command, words) in
            [("disable", &[][..]), ("reset", &["--force"]), ("set-force-limit", &["y=1"]), ("set-law", &["damping"])]
        {
            let (code, said) = sides.look(command, words);
            certain(|| {
                let is_refused = code == Some(69) && said.contains("no service admittanced/cell-3/request");
                assert!(is_refused, "{command}: {code:?}, {said}");
            });
        }
        // A motion controller of the same name, with a tunnel that carries what commands: states, commands, twists. What would come
        // of it without a list shows in a place of its own on the robot's machine.
        let place = sides.there.settings();
        let witness = PrivateIpc::new("cell-3");
        let far_end = "listen: { endpoints: [\"tcp/192.168.7.2:7448\"] }";
        let near_end = "connect: { endpoints: [\"tcp/192.168.7.2:7448\"] }";
        let both_ends = format!("connect: {{ endpoints: [\"tcp/192.168.7.1:7447\"] }}, {far_end}");
        let _orders = Child::spawn(&mut tunnel_of_orders(&sides.far, &sides.there, &both_ends));
        let mut stranger = sides.far.command(&binaries().plant_sim);
        // It looks all the time for an answer that does not come. With the other plant's priority they would have more of a processor
        // than the kernel leaves to real-time programs, and both would stand still for 50 ms of each second.
        let at_rest = scenario_with(&sides.there, 1.0, 60, &[("realtime.priority", "0")]);
        stranger.arg("--scenario").arg(at_rest);
        stranger.args(["--instance", "cell-3", "--prefix", &place.prefix]).arg("--root-path").arg(&place.root_path);
        let mut stranger = Child::spawn(&mut stranger);
        let mut without_list = Child::spawn(&mut tunnel_of_orders(&sides.robots, &witness, near_end));
        without_list.wait_until("orders cross where no list keeps them", PATIENCE, |_| {
            services(witness.settings()).contains(&"admittanced/cell-3/command".to_owned())
        });
        std::thread::sleep(Duration::from_secs(2));
        assert!(stranger.exit_status().is_none(), "{}", stranger.report());
        let names = ["admittanced/cell-3/diagnostics", "admittanced/cell-3/record"];
        let crossed = services(sides.relayed.settings());
        certain(|| assert_eq!(services(ipc.settings()), own, "where the daemon is"));
        certain(|| assert_eq!(crossed, names, "nothing else has come across"));
        let after = own_status(&ipc, &file);
        for key in ["enabled", "law", "force_limit"] {
            certain(|| assert_eq!(before[key], after[key], "{key}"));
        }
        // Which a busy machine may change as well.
        for key in ["stop_reason", "rejected_count"] {
            assert_eq!(before[key], after[key], "{key}");
        }
        assert!(after["cycles"].as_u64() > before["cycles"].as_u64(), "{after}");
        assert!(daemon.exit_status().is_none() && plant.exit_status().is_none(), "{}", daemon.report());
        assert!(sides.robots.is_up() && sides.far.is_up(), "{}", sides.report());
    });
}

/// A tunnel in this place of a machine that carries what commands an arm.
fn tunnel_of_orders(machine: &Machine, place: &PrivateIpc, ends: &str) -> Command {
    let settings = place.settings();
    let directory = place.directory().join("orders");
    std::fs::create_dir_all(directory.join("config")).expect("made");
    let file =
        format!("[global]\nroot-path = \"{}\"\nprefix = \"{}\"\n", settings.root_path.display(), settings.prefix);
    std::fs::write(directory.join("config/iceoryx2.toml"), file).expect("written");
    let zenoh = format!("{{ mode: \"peer\", {ends}, scouting: {{ multicast: {{ enabled: false }} }} }}");
    std::fs::write(directory.join("zenoh.json5"), zenoh).expect("written");
    let line = format!(
        "cd {} && exec setpriv --pdeathsig KILL {} --zenoh-config zenoh.json5 --poll 5 --allow 'admittanced/*/command' \
         --allow 'admittanced/*/state*' --allow 'admittanced/*/twist'",
        directory.display(),
        tunnel().expect("it was asked for").display()
    );
    let mut command = machine.command(Path::new("sh"));
    command.args(["-c", &line]);
    command
}

/// What the daemon says where it is.
fn own_status(ipc: &PrivateIpc, file: &Path) -> serde_json::Value {
    let (code, said) = output(ctl_command(ipc, "status", file).arg("--json"));
    assert_eq!(code, Some(0), "{said}");
    serde_json::from_str(&said).expect("one object")
}

/// Who has the processors that the daemon does not, in a turn.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Beside {
    Nobody,
    /// A program that knows no daemon, and keeps the same processor as busy as what watches does.
    Stranger,
    /// Relay, tunnel and a recorder on the far side.
    Watchers,
}

/// A stretch of the run, ns.
struct Turn {
    beside: Beside,
    from_ns: u64,
    until_ns: u64,
}

impl Turn {
    /// The next three seconds, once what was started or ended before has settled.
    fn take(beside: Beside) -> Self {
        std::thread::sleep(Duration::from_millis(700));
        let from_ns = monotonic_ns();
        std::thread::sleep(Duration::from_secs(3));
        Self { beside, from_ns, until_ns: monotonic_ns() }
    }

    /// p50 and p99 of each time in this turn, µs: from the instant of a sample to its answer, and how late the plant itself woke up.
    fn quantiles(&self, truths: &[TruthSample]) -> [[f64; 2]; 2] {
        let these: Vec<&TruthSample> = truths
            .iter()
            .filter(|truth| (self.from_ns..self.until_ns).contains(&truth.stamp_ns) && truth.answer_time_ns > 0)
            .collect();
        assert!(these.len() > 1000, "{} answers in a turn", these.len());
        let times: [fn(&TruthSample) -> u64; 2] =
            [|truth| truth.answer_time_ns.saturating_sub(truth.lateness_ns), |truth| truth.lateness_ns];
        times.map(|time| {
            let mut values: Vec<u64> = these.iter().map(|truth| time(truth)).collect();
            values.sort_unstable();
            [0.5, 0.99].map(|part| values[((values.len() - 1) as f64 * part) as usize] as f64 * 1e-3)
        })
    }
}

/// Relay, two tunnels and a recorder take 60 % of a processor (`top`, 2026-11-25), some megabytes at a time.
const STRANGER: &str = "
import time
memory = bytearray(4 << 20)
while True:
    until = time.monotonic() + 0.003
    while time.monotonic() < until:
        memory = bytearray(memory)
    time.sleep(0.002)
";

/// Nobody, watchers, nobody, a stranger, and so on, and nobody at the end.
fn take_turns(ipc: &PrivateIpc, file: &Path, rounds: usize) -> Vec<Turn> {
    let aside = page::commands(PAGE, "On the robot's machine\n");
    let aside = aside.iter().find_map(|line| line.strip_prefix("aside=")).expect("the page says it").trim_matches('\'');
    std::thread::sleep(Duration::from_secs(2));
    let mut turns = Vec::new();
    for round in 0..rounds {
        turns.push(Turn::take(Beside::Nobody));
        {
            let mut sides = Sides::new();
            sides.start(ipc.settings(), true);
            let recording = ipc.directory().join(format!("far-{round}.mcap"));
            let words = ["--config", &file.to_string_lossy(), &recording.to_string_lossy()];
            let _recorder = Child::spawn(&mut sides.command("record", &words));
            turns.push(Turn::take(Beside::Watchers));
        }
        turns.push(Turn::take(Beside::Nobody));
        let mut stranger = Command::new("sh");
        stranger.args(["-c", &format!("exec {aside} \"$0\" -c \"$1\"")]);
        let _stranger = Child::spawn(stranger.arg(python().expect("it is needed")).arg(STRANGER));
        turns.push(Turn::take(Beside::Stranger));
    }
    turns.push(Turn::take(Beside::Nobody));
    turns
}

/// Lower quartile, median and upper quartile.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|part| values[((values.len() - 1) as f64 * part).round() as usize])
}

/// One daemon and one plant, so that nothing differs but who watches. What a turn differs by from the mean of the two turns of
/// nobody around it is told beside the same of a stranger, and beside what a turn of nobody differs by from those around it;
/// it must not be beyond both.
#[test]
fn timing_with_and_without_the_tunnel() {
    if !needs(Need::Tunnel) || !needs(Need::Python) {
        return;
    }
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    const ROUNDS: usize = 6;
    let ipc = PrivateIpc::new("cell-3");
    let file = daemon_file(&ipc);
    let _daemon = start_daemon(&ipc, &file);
    let mut plant = Child::spawn(&mut plant_command(&ipc, &scenario(&ipc, 1.0, 300)));
    let (truths, turns) = std::thread::scope(|scope| {
        let turns = scope.spawn(|| take_turns(&ipc, &file, ROUNDS));
        let truths = drive_plant_by(ipc.settings(), &mut plant, |plant, _| {
            if turns.is_finished() {
                plant.terminate();
            }
        });
        (truths, turns.join().expect("the turns were taken"))
    });
    let found: Vec<[[f64; 2]; 2]> = turns.iter().map(|turn| turn.quantiles(&truths)).collect();
    let mut slower = Vec::new();
    println!("us, lower quartile, median and upper quartile over {ROUNDS} rounds of turns of 3 s at 1 kHz");
    for (time, name) in ["answer", "plant's lateness"].into_iter().enumerate() {
        for (part, quantile) in ["p50", "p99"].into_iter().enumerate() {
            let value = |turn: usize| found[turn][time][part];
            let of = |beside: Beside| {
                let turns = &turns;
                (0..turns.len()).filter(move |turn| turns[*turn].beside == beside)
            };
            // From the mean of two turns of nobody, so many turns before and after.
            let differences = |beside: Beside, step: usize| -> Vec<f64> {
                let between = of(beside).filter(|turn| (step..found.len() - step).contains(turn));
                between.map(|turn| value(turn) - 0.5 * (value(turn - step) + value(turn + step))).collect()
            };
            let watched = differences(Beside::Watchers, 1);
            let references = [differences(Beside::Stranger, 1), differences(Beside::Nobody, 2)];
            // Every turn slower than every turn of both references: by chance that is one run of ten thousand.
            let least = watched.iter().copied().fold(f64::INFINITY, f64::min);
            if references.iter().flatten().all(|reference| *reference < least) {
                slower
                    .push(format!("{name} {quantile}, us: watchers {watched:?}, a stranger and nobody {references:?}"));
            }
            let [beside_stranger, alone] = references;
            let said = [
                ("nobody", of(Beside::Nobody).map(value).collect()),
                ("watchers", of(Beside::Watchers).map(value).collect()),
                ("watchers change", watched),
                ("a stranger changes", beside_stranger),
                ("changes by itself", alone),
            ];
            for (what, values) in said {
                let shown = quartiles(values).map(|value| format!("{value:7.1}")).join(" ");
                println!("{name:<17} {quantile}  {what:<19}{shown}");
            }
        }
    }
    assert!(slower.is_empty(), "who watches makes the daemon slower than a stranger does: {slower:#?}");
}
