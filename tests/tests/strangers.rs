//! What another user of the machine does to the places where the programs meet: nothing hangs, no
//! file of root's is touched, and every program says whose the thing is. Through the real programs;
//! the stranger is "nobody".

use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::session::{
    MPC_PAPER, PAPER_SCENARIO, ctl_command, daemon_command, plant_command, start_daemon, with_keys, write,
};
use end_to_end::{Child, Need, PATIENCE, PrivateIpc, binaries, needs};

/// How iceoryx2's counter of node ids is called after the prefix.
const COUNTER: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";

/// A command of the user nobody; whether it succeeded.
fn stranger(script: &str, path: &Path) -> bool {
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "sh", "-euc", script, "sh"]).arg(path);
    let out = command.output().expect("setpriv is there");
    eprintln!("nobody: {script}: {} {}", out.status, String::from_utf8_lossy(&out.stderr));
    out.status.success()
}

/// The exit code of a program that has to end by itself, and what it says.
fn ended(command: &mut Command) -> (Option<i32>, String) {
    let mut child = Child::spawn(command);
    let code = child.wait_for_exit(PATIENCE).code();
    (code, child.stdout() + &child.stderr())
}

fn counter(ipc: &PrivateIpc) -> PathBuf {
    Path::new("/dev/shm").join(format!("{}{COUNTER}", ipc.settings().prefix))
}

#[test]
fn a_root_path_that_a_stranger_could_take_or_has_taken_is_not_used() {
    if !needs(Need::Root) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let precious = write(&ipc, "precious", "kept");
    let taken = PathBuf::from(format!("/tmp/{}taken", ipc.settings().prefix));
    let daemon = |root_path: &Path| {
        ended(Command::new(&binaries().admittanced).arg("--config").arg(&config).arg("--root-path").arg(root_path))
    };
    // Not there yet, and its name free for all.
    let (code, text) = daemon(&taken);
    assert!(code == Some(77) && text.contains("directly in /tmp, where everyone may take its name"), "{text}");
    assert!(!taken.exists());
    let told = write(&ipc, "taken.toml", &with_keys(MPC_PAPER, &[("ipc.root_path", &format!("{taken:?}"))]));
    let doctor = || ended(Command::new(&binaries().admittancectl).args(["doctor", "--config"]).arg(&told));
    let refused = |text: &str, why: &str| {
        text.lines().any(|line| ["REFUSED", "root path", why].iter().all(|part| line.contains(part)))
    };
    let (code, text) = doctor();
    assert!(code == Some(1) && refused(&text, "directly in /tmp"), "{text}");

    let trap = format!("mkdir -m 0777 \"$1\" \"$1/ipc\"; ln -s {} \"$1/planar.lock\"", precious.display());
    assert!(stranger(&trap, &taken));
    let link = format!("ln -s {} \"$1/ipc/planar.lock\"", precious.display());
    assert!(stranger(&link, &taken));
    for root_path in [taken.clone(), taken.join("ipc")] {
        let (code, text) = daemon(&root_path);
        assert_eq!(code, Some(77), "{text}");
        assert!(text.contains("directly in /tmp") || text.contains("belongs to nobody"), "{text}");
    }
    std::fs::remove_dir_all(&taken).expect("removed");

    // Root's own directory, but open to all; then a link in a directory that was open once.
    let own = ipc.settings().root_path.clone();
    std::fs::DirBuilder::new().mode(0o750).create(&own).expect("made");
    std::fs::set_permissions(ipc.directory(), std::fs::Permissions::from_mode(0o755)).expect("changed");
    std::fs::set_permissions(&own, std::fs::Permissions::from_mode(0o777)).expect("changed");
    assert!(stranger(&format!("ln -s {} \"$1\"", precious.display()), &own.join("planar.lock")));
    let (code, text) = ended(&mut daemon_command(&ipc, &config));
    assert!(code == Some(77) && text.contains("can be written by others than root (mode 0777)"), "{text}");
    std::fs::set_permissions(&own, std::fs::Permissions::from_mode(0o750)).expect("changed");
    let (code, text) = ended(&mut daemon_command(&ipc, &config));
    assert!(code == Some(69) && text.contains("planar.lock is not a plain file"), "{text}");
    assert_eq!(std::fs::read_to_string(&precious).expect("it is there"), "kept");
}

#[test]
fn the_directory_is_closed_before_anything_is_in_it() {
    if !needs(Need::Strace) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let (root_path, trace) = (&ipc.settings().root_path, ipc.directory().join("trace"));
    // Without a mask nothing but the daemon closes it.
    let traced = daemon_command(&ipc, &config);
    let mut command = Command::new("sh");
    command.args(["-c", "umask 0; exec strace -f -e trace=file -o \"$@\"", "sh"]).arg(&trace);
    let mut daemon = Child::spawn(command.arg(traced.get_program()).args(traced.get_args()));
    // Not by opening its services, which needs the directory too.
    let mut owner = String::new();
    daemon.wait_until("the lock is its own", PATIENCE, |_| {
        owner = std::fs::read_to_string(root_path.join("planar.lock")).unwrap_or_default();
        !owner.is_empty()
    });
    let mode = |path: &Path| std::fs::symlink_metadata(path).expect("it is there").mode() & 0o7777;
    assert_eq!(mode(root_path) & 0o7027, 0, "{:o}", mode(root_path));
    assert_eq!(mode(&root_path.join("planar.lock")) & 0o7037, 0);
    // strace itself waits for the daemon's end.
    assert!(Command::new("kill").arg(owner.trim()).status().is_ok_and(|status| status.success()));
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());

    let text = std::fs::read_to_string(&trace).expect("strace wrote it");
    let first = |what: String| text.lines().position(|line| line.contains(&what) && line.ends_with(") = 0"));
    let made = first(format!("mkdir({root_path:?}, 0750"));
    let inside = text.lines().position(|line| line.contains(&format!("\"{}/", root_path.display())));
    assert!(made.is_some() && made < inside, "made by line {made:?}, used from line {inside:?} on:\n{text}");
    assert!(!text.lines().any(|line| line.contains("chmod") && line.contains(&format!("{root_path:?}"))), "{text}");
}

#[test]
fn a_stranger_s_counter_of_nodes_ends_every_program_at_once_with_its_name() {
    if !needs(Need::Root) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let scenario = write(&ipc, "plant.toml", PAPER_SCENARIO);
    // doctor asks the file alone where that is.
    let (root_path, prefix) = (format!("{:?}", ipc.settings().root_path), format!("{:?}", ipc.settings().prefix));
    let keys = [("ipc.root_path", root_path.as_str()), ("ipc.prefix", prefix.as_str())];
    let here = write(&ipc, "here.toml", &with_keys(MPC_PAPER, &keys));
    let sound = "printf '\\0\\0\\12\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0' >\"$1\"; chmod 0666 \"$1\"";
    for made in ["umask 0; : >\"$1\"", "mkfifo -m 0666 \"$1\"", "ln -s /etc/passwd \"$1\"", sound] {
        assert!(stranger(made, &counter(&ipc)));
        let says = format!("{} belongs to nobody, and this program runs as root", counter(&ipc).display());
        for command in [&mut daemon_command(&ipc, &config), &mut plant_command(&ipc, &scenario)] {
            let (code, text) = ended(command);
            assert!(code == Some(77) && text.contains(&says), "{made}: {code:?} {text}");
        }
        let (code, text) = ended(&mut ctl_command(&ipc, "status", &config));
        assert!(code == Some(77) && text.contains(&says), "{made}: {code:?} {text}");
        let (code, text) = ended(Command::new(&binaries().admittancectl).args(["doctor", "--config"]).arg(&here));
        assert!(code == Some(1) && text.contains("REFUSED | owner of shared memory"), "{made}: {code:?} {text}");
        std::fs::remove_file(counter(&ipc)).expect("removed");
    }
    // The next start is an ordinary one.
    let mut daemon = start_daemon(&ipc, &config);
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
}

#[test]
fn a_running_daemon_s_counter_cannot_be_cut_off_whoever_came_first_and_goes_in_the_end() {
    if !needs(Need::Root) {
        return;
    }
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let scenario = write(&ipc, "plant.toml", PAPER_SCENARIO);
    // A tool that comes first makes nothing that the daemon would then not own.
    let (code, text) = ended(&mut ctl_command(&ipc, "status", &config));
    assert!(code == Some(69) && text.contains("is admittanced running"), "{text}");
    assert!(!ipc.settings().root_path.exists() && ipc.shared_memory_files().is_empty());

    let mut daemon = start_daemon(&ipc, &config);
    assert!(!stranger("truncate -s 0 \"$1\"", &counter(&ipc)), "it can be written by anyone");
    // A file of a stranger's beside it keeps no operator from the daemon, only the next start.
    let file = counter(&ipc).with_file_name(format!("{}{}_x", ipc.settings().prefix, "1".repeat(40)));
    assert!(stranger(": >\"$1\"", &file));
    for order in ["status", "disable", "enable"] {
        let (code, text) = ended(&mut ctl_command(&ipc, order, &config));
        assert_eq!(code, Some(0), "{order}: {text}");
    }
    let (code, text) = ended(&mut plant_command(&ipc, &scenario));
    assert!(code == Some(77) && text.contains("belongs to nobody"), "{code:?} {text}");
    std::fs::remove_file(&file).expect("removed");
    assert!(!stranger("rm -f \"$1\"", &counter(&ipc)) && counter(&ipc).exists());
    // One that was open to all for a moment, as plain iceoryx2 makes it, is exchanged.
    std::fs::set_permissions(counter(&ipc), std::fs::Permissions::from_mode(0o666)).expect("changed");
    assert!(stranger("truncate -s 0 \"$1\"", &counter(&ipc)));
    let (code, text) = ended(&mut ctl_command(&ipc, "status", &config));
    assert_eq!(code, Some(0), "{text}");
    assert!(!stranger("truncate -s 0 \"$1\"", &counter(&ipc)));
    let (code, text) = ended(&mut plant_command(&ipc, &scenario));
    assert_eq!(code, Some(0), "{text}");
    daemon.terminate();
    assert_eq!(daemon.wait_for_exit(PATIENCE).code(), Some(0), "{}", daemon.report());
    assert!(ipc.shared_memory_files().is_empty(), "{:?}", ipc.shared_memory_files());
}

#[test]
fn what_the_own_user_has_cut_off_is_given_up_in_time() {
    let ipc = PrivateIpc::new("planar");
    let config = write(&ipc, "daemon.toml", MPC_PAPER);
    let _daemon = start_daemon(&ipc, &config);
    // What a program leaves that is killed between making and sizing a file.
    let services =
        ipc.shared_memory_files().into_iter().filter(|file| file.extension().is_some_and(|e| e == "dynamic"));
    for file in services {
        let empty = file.with_extension("empty");
        std::fs::write(&empty, "").expect("written");
        std::fs::rename(empty, file).expect("exchanged");
    }
    let (code, text) = ended(&mut ctl_command(&ipc, "status", &config));
    assert_eq!(code, Some(69), "{text}");
    assert!(text.contains("shared memory could not be opened within 8 s"), "{text}");
}
