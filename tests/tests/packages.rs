//! `deploy/package.sh`: Debian packages that are sound, and that come, replace an older one, and go, in a systemd of the test's own.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use end_to_end::session::output;
use end_to_end::{Need, Systemd, binaries, needs};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Builds the packages into a directory.
fn build(directory: &Path, version: &[&str]) {
    let programs = binaries();
    let mut script = Command::new(Path::new(ROOT).join("deploy/package.sh"));
    script.arg("--binaries").arg(programs.admittanced.parent().expect("a program is in a directory"));
    script.arg("--archive").arg(&programs.client_archive).args(version).arg(directory);
    // Development builds are large: what matters here is not their size.
    script
        .env("DEBEMAIL", "packages@our-cell.net")
        .env("DPKG_DEB_COMPRESSOR_TYPE", "gzip")
        .env("DPKG_DEB_COMPRESSOR_LEVEL", "1");
    let (code, text) = output(&mut script);
    assert_eq!(code, Some(0), "{text}");
}

/// Files and directories that packages might bring or leave, and users and groups.
fn system(systemd: &Systemd) -> (BTreeSet<String>, String) {
    // The cache of the linker is made anew whenever a library comes or goes.
    let paths = "find /etc /usr /var/lib/admittanced -xdev ! -name '*-' ! -name .pwd.lock 2>/dev/null || true";
    (systemd.run(paths).lines().map(str::to_owned).collect(), systemd.run("cat /etc/passwd /etc/group"))
}

#[test]
fn packages_come_replace_older_ones_and_go() {
    if !needs(Need::Systemd) || !needs(Need::Packages) {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let [old, new] = ["old", "new"].map(|name| directory.path().join(name));
    for (place, version) in [(&old, &["--version", "0.1.9"][..]), (&new, &[])] {
        std::fs::create_dir(place).expect("made");
        build(place, version);
    }
    let names = std::fs::read_dir(&new).expect("readable").map(|entry| entry.expect("listed").path());
    let mut files: Vec<_> = names.collect();
    files.sort();
    assert_eq!(files.len(), 3, "{files:?}");
    let (code, text) = output(Command::new("lintian").args(["--allow-root", "--fail-on", "error"]).args(&files));
    assert_eq!(code, Some(0), "{text}");
    println!("{text}");

    let systemd = Systemd::boot();
    // Packages go below /usr, and dpkg wants to know what is there: both are the machine's, and stay as they are.
    systemd.run(
        "mkdir /srv/changed /srv/work && \
         mount -t overlay overlay -o lowerdir=/usr,upperdir=/srv/changed,workdir=/srv/work /usr && \
         mount -t tmpfs tmpfs /usr/local && mkdir -p /var/lib/dpkg/info /var/lib/dpkg/updates /srv/old /srv/new",
    );
    std::fs::copy("/var/lib/dpkg/status", systemd.path("/var/lib/dpkg/status")).expect("copied");
    for (from, to) in [(&old, "old"), (&new, "new")] {
        for entry in std::fs::read_dir(from).expect("readable") {
            let path = entry.expect("listed").path();
            let name = path.file_name().expect("a file").to_string_lossy().into_owned();
            std::fs::copy(&path, systemd.path(&format!("/srv/{to}/{name}"))).expect("copied");
        }
    }
    let before = system(&systemd);

    systemd.write("/usr/local/share/admittanced/manifest", "");
    let (code, text) = systemd.try_run("dpkg -i /srv/new/admittanced_*.deb");
    assert!(code == Some(1) && text.contains("deploy/install.sh --uninstall"), "{text}");
    systemd.run("rm -r /usr/local/share/admittanced && dpkg --purge admittanced");
    assert_eq!(system(&systemd), before, "what is refused leaves nothing");

    systemd.run("dpkg -i /srv/old/*.deb");
    systemd.run("cp /usr/share/admittanced/robots/planar.toml /etc/admittanced/cell-3.toml");
    assert!(systemd.run("admittancectl validate /etc/admittanced/cell-3.toml").contains("valid"));
    let units = "admittanced@robot.service plant-sim@robot.service admittance-egm@robot.service";
    assert_eq!(systemd.run(&format!("systemd-analyze verify {units}")), "");
    for page in ["man8/admittanced.8", "man1/admittancectl-move.1", "man1/plant-sim.1", "man8/admittance-egm.8"] {
        systemd.run(&format!("test -s /usr/share/man/{page}.gz"));
    }
    for program in ["admittanced", "admittancectl", "admittance-egm", "plant-sim"] {
        for file in [
            format!("bash-completion/completions/{program}"),
            format!("zsh/vendor-completions/_{program}"),
            format!("fish/vendor_completions.d/{program}.fish"),
        ] {
            systemd.run(&format!("test -s /usr/share/{file}"));
        }
    }
    assert_eq!(
        systemd.run("grep -rl /usr/local /usr/lib/systemd/system/admittance* /usr/share/admittanced || true"),
        ""
    );
    systemd.run("systemctl enable --now admittanced@cell-3");
    let daemon = systemd.property("admittanced@cell-3", "MainPID");
    // A robot by EGM beside it, with the files that the package brings.
    systemd.run(
        "cp /usr/share/admittanced/egm/six-joint.toml /etc/admittanced/abb.toml && \
         sed 's/192.168.125.1/127.0.0.1/' /usr/share/admittanced/egm/six-joint.egm.toml > /etc/admittanced/abb.egm.toml",
    );
    systemd.run("systemctl enable --now admittanced@abb admittance-egm@abb");
    let edge = systemd.property("admittance-egm@abb", "MainPID");

    // The daemon holds an arm: it goes on, and whoever answers for the arm restarts it.
    systemd.run("dpkg -i /srv/new/*.deb");
    assert_eq!(systemd.property("admittanced@cell-3", "ActiveState"), "active");
    assert_eq!(systemd.property("admittanced@cell-3", "MainPID"), daemon, "it was restarted");
    assert_eq!(systemd.property("admittance-egm@abb", "ActiveState"), "active");
    assert_eq!(systemd.property("admittance-egm@abb", "MainPID"), edge, "it was restarted");
    let version = systemd.run("dpkg-query --show --showformat='${Version}' admittanced");
    assert_eq!(version, env!("CARGO_PKG_VERSION"));
    systemd.run("systemctl restart admittanced@cell-3");
    systemd.run(
        "printf '#include <admittance_client.h>\\nint main(void) { return (int)admittance_client_abi_version() - 1; }' | \
         cc -x c -o /srv/user - $(pkg-config --cflags --libs admittance_client) && /srv/user",
    );

    systemd.run("dpkg --remove admittanced libadmittance-client-dev libadmittance-client1");
    assert_eq!(systemd.run("grep -lsxE 'admittanced|admittance-egm' /proc/[0-9]*/comm || true"), "", "still running");
    for unit in ["admittanced@cell-3", "admittanced@abb", "admittance-egm@abb"] {
        assert_eq!(systemd.try_run(&format!("systemctl cat {unit}")).0, Some(1), "{unit}");
    }
    assert_eq!(systemd.run("systemctl list-units --all --plain --no-legend 'admittance*'"), "");
    let (paths, users) = system(&systemd);
    let left: Vec<&String> = paths.difference(&before.0).collect();
    let kept = ["", "/abb.egm.toml", "/abb.toml", "/cell-3.toml"].map(|file| format!("/etc/admittanced{file}"));
    assert_eq!(left, kept.iter().chain([&"/var/lib/admittanced".to_owned()]).collect::<Vec<_>>());
    assert!(users.contains("admittanced"), "{users}");

    systemd.run("dpkg --purge admittanced");
    assert_eq!(system(&systemd), before);
}

#[test]
fn what_cannot_be_packed_is_named() {
    let place = tempfile::tempdir().expect("a directory");
    let place = place.path().to_str().expect("text");
    for (arguments, address, code, word) in [
        (&[][..], "me@our-cell.net", 64, "OUTPUT"),
        (&["/no/such"], "me@our-cell.net", 66, "/no/such"),
        (&[place, "--archive"], "me@our-cell.net", 64, "--archive"),
        (&[place, "--archive", "/no/archive.a"], "me@our-cell.net", 66, "/no/archive.a"),
        (&[place, "--archive", "/dev/null"], "me@our-cell.net", 66, "/dev/null"),
        (&[place, "--archive", "/etc/passwd"], "", 64, "DEBEMAIL"),
        (&["--compress", place], "me@our-cell.net", 64, "--compress"),
    ] {
        let mut script = Command::new(Path::new(ROOT).join("deploy/package.sh"));
        let (found, text) = output(script.args(arguments).env("DEBEMAIL", address));
        assert!(found == Some(code) && text.contains(word), "{arguments:?}: {found:?}: {text}");
    }
}
