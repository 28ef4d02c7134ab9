//! `deploy/install.sh`: everything comes, the units are sound, and everything goes; and the
//! commands of docs/operating.md do what it says.

use std::collections::BTreeSet;

use end_to_end::{Need, Systemd, needs, page};

const OPERATING: &str = include_str!("../../docs/operating.md");
/// What a test run has done already.
const BUILD: &str = "cargo build --release --workspace --bins";

/// Files and directories, beside backups that the tools for users leave, and users and groups.
fn system(systemd: &Systemd, root: &str) -> (BTreeSet<String>, String) {
    let paths = format!(
        "cd {root}/ && find etc usr/local var/lib/admittanced ! -name '*-' ! -name .pwd.lock 2>/dev/null || true"
    );
    let users = format!("cat {root}/etc/passwd {root}/etc/group 2>/dev/null || true");
    (systemd.run(&paths).lines().map(str::to_owned).collect(), systemd.run(&users))
}

/// The commands of a section of docs/operating.md, without "sudo", which is for people.
fn commands(section: &str) -> Vec<String> {
    let commands = page::commands(OPERATING, section).into_iter();
    commands.map(|line| line.strip_prefix("sudo ").map_or(line.clone(), str::to_owned)).collect()
}

#[test]
fn the_commands_of_the_page_install_run_and_remove() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = Systemd::boot();
    let before = system(&systemd, "");
    let commands = commands("As a service\n");
    let (mut said, mut was_active) = (String::new(), false);
    for command in commands.iter().filter(|command| *command != BUILD) {
        if command.contains("--uninstall") {
            was_active = systemd.property("admittanced@cell-3", "ActiveState") == "active";
        }
        said += &systemd.run(command);
        if command.contains("systemctl reload") {
            // systemd waits for the signal to be sent, not for what the daemon makes of it.
            systemd.wait_for_entry("-u admittanced@cell-3 --grep='reload: nothing has changed'");
        }
    }
    assert!(commands.len() > 8 && commands.contains(&BUILD.to_owned()), "{commands:?}");
    assert!(
        was_active && said.contains("cell-3.toml: valid") && said.contains("reload: nothing has changed"),
        "{said}"
    );
    // The configuration is the user's; all else has gone, running or not.
    let (paths, users) = system(&systemd, "");
    let left: Vec<&String> = paths.difference(&before.0).collect();
    let (recordings, left): (Vec<&String>, Vec<&String>) = left.iter().partition(|path| path.starts_with("var/"));
    assert_eq!(left, ["etc/admittanced", "etc/admittanced/cell-3.scenario.toml", "etc/admittanced/cell-3.toml"]);
    // A recording of the service's user, which was told no name.
    let [directory, recording] = recordings[..] else { panic!("{recordings:?}") };
    assert_eq!(directory, "var/lib/admittanced");
    assert!(recording.contains("/cell-3-2") && recording.ends_with("Z.mcap"), "{recording}");
    assert_eq!(systemd.run("stat -c '%U %a' /var/lib/admittanced").trim(), "admittanced 750");
    assert!(users.contains("admittanced"), "{users}");
    assert_eq!(systemd.try_run("systemctl cat admittanced@cell-3").0, Some(1));
    let processes = systemd.run("grep -lsx admittanced /proc/[0-9]*/comm || true");
    assert_eq!(processes, "", "still running");
    assert!(!systemd.path("/run/admittanced").exists());

    systemd.run("deploy/install.sh && deploy/install.sh --uninstall --purge");
    assert_eq!(system(&systemd, ""), before);
}

#[test]
fn the_units_are_sound_and_hardened() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = Systemd::boot();
    systemd.run("deploy/install.sh");
    // Pages and completions come from where --help comes from, and name what it names.
    let share = "/usr/local/share";
    systemd.run(&format!("cmp docs/faults.md {share}/admittanced/faults.md"));
    let help = systemd.run("admittancectl --help");
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let commands: Vec<_> =
        commands.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert!(commands.contains(&"status"), "{help}");
    let completion = systemd.run(&format!("cat {share}/bash-completion/completions/admittancectl"));
    assert!(!completion.contains("role-"), "what is hidden is not offered");
    for command in commands {
        systemd.run(&format!("grep -q '^.TH ADMITTANCECTL-' {share}/man/man1/admittancectl-{command}.1"));
        assert!(completion.contains(command), "{command}");
    }
    for (program, page) in [
        ("admittanced", "man8/admittanced.8"),
        ("admittance-egm", "man8/admittance-egm.8"),
        ("plant-sim", "man1/plant-sim.1"),
    ] {
        let page = systemd.run(&format!("cat {share}/man/{page}")).replace("\\-", "-");
        let help = systemd.run(&format!("{program} --help"));
        let options = help.split_whitespace().filter(|word| word.starts_with("--")).map(|word| word.trim_matches(','));
        let offered = systemd
            .run(&format!("cat {share}/bash-completion/completions/{program} {share}/zsh/site-functions/_{program}"));
        for option in options.filter(|option| *option != "--") {
            assert!(page.contains(option) && offered.contains(option), "{program} {option}");
        }
        systemd.run(&format!("test -s {share}/fish/vendor_completions.d/{program}.fish"));
    }
    for unit in ["admittanced@robot.service", "plant-sim@robot.service", "admittance-egm@robot.service"] {
        // It succeeds with unknown keys as well: what it says is what counts.
        assert_eq!(systemd.run(&format!("systemd-analyze verify {unit}")), "", "{unit}");
        let security = format!("systemd-analyze security --offline=true --threshold=20 {unit}");
        println!("{}", systemd.run(&security).lines().last().unwrap_or_default());
    }
    systemd.write("/usr/local/lib/systemd/system/plant-sim@.service.d/wrong.conf", "[Service]\nPrivateTpm=yes\n");
    assert!(systemd.run("systemd-analyze verify plant-sim@robot.service").contains("PrivateTpm"));
}

#[test]
fn another_root_gets_everything_and_is_rid_of_it() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = Systemd::boot();
    systemd.run("mkdir -p /tmp/image/etc/systemd/system /tmp/image/usr/local/bin");
    systemd.run("cd /tmp/image/etc && touch passwd group shadow gshadow");
    let (before, machine) = (system(&systemd, "/tmp/image"), system(&systemd, ""));
    // The second time over the first; a file of an older version goes.
    systemd.run("deploy/install.sh --root /tmp/image");
    systemd.run(
        "cd /tmp/image/usr/local/share/admittanced && touch old && echo /usr/local/share/admittanced/old >>manifest",
    );
    systemd.run("deploy/install.sh --root /tmp/image --binaries target/release");
    let (paths, users) = system(&systemd, "/tmp/image");
    for path in [
        "etc/admittanced",
        "usr/local/bin/admittanced",
        "usr/local/bin/admittancectl",
        "usr/local/bin/plant-sim",
        "usr/local/lib/systemd/system/admittanced@.service",
        "usr/local/lib/systemd/system/plant-sim@.service.d/sandbox.conf",
        "usr/local/lib/systemd/system/admittance-egm@.service.d/udp.conf",
        "usr/local/lib/sysusers.d/admittanced.conf",
        "usr/local/lib/udev/rules.d/60-admittanced.rules",
        "usr/local/share/admittanced/robots/six-joint.toml",
        "usr/local/share/admittanced/scenarios/paper.toml",
        "usr/local/share/admittanced/THREATS.md",
    ] {
        assert!(paths.contains(path), "{path}: {paths:?}");
    }
    assert!(!paths.contains("usr/local/share/admittanced/old"), "{paths:?}");
    assert!(users.contains("admittanced:x:"), "{users}");
    systemd.run("systemctl --root=/tmp/image enable admittanced@cell-3");
    systemd.run("deploy/install.sh --root /tmp/image --uninstall --purge");
    assert_eq!(system(&systemd, "/tmp/image"), before);
    assert_eq!(system(&systemd, ""), machine, "the machine itself is not touched");

    for (arguments, code, word) in [
        ("--uninstal", 64, "--uninstal"),
        ("--purge", 64, "--uninstall"),
        ("--root", 64, "--root"),
        ("--root /no/such", 66, "/no/such"),
        ("--root /tmp/image --binaries /etc", 66, "/etc/admittanced: not there"),
    ] {
        let (found, text) = systemd.try_run(&format!("deploy/install.sh {arguments}"));
        assert_eq!((found, text.contains(word)), (Some(code), true), "{arguments}: {text}");
    }
    assert_eq!(system(&systemd, "/tmp/image"), before);
}
