//! The unit on a machine with another user on it: who that is, is said, and nothing is tried for
//! ever.

use end_to_end::{Need, Systemd, needs, undisturbed};

use crate::units::*;

const NAME: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";

/// A command of the user nobody; whether it succeeded.
fn stranger(systemd: &Systemd, script: &str) -> bool {
    systemd.try_run(&format!("runuser -u nobody -- sh -euc '{script}'")).0 == Some(0)
}

#[test]
fn recordings_are_for_the_service_s_user_and_to_be_read_by_its_group() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[]), &in_the_air());
    systemd.run(&format!("systemctl start {DAEMON}"));
    let directory = "/var/lib/admittanced";
    systemd.run(&format!("runuser -u admittanced -- sh -c 'echo kept >{directory}/run.mcap'"));
    let member = |script: &str| {
        let (code, _) =
            systemd.try_run(&format!("setpriv --reuid=nobody --regid=admittanced --clear-groups sh -euc '{script}'"));
        code == Some(0)
    };
    let read = [format!("ls {directory}"), format!("cat {directory}/run.mcap")];
    let written = [
        format!("echo x >{directory}/other.mcap"),
        format!("echo x >{directory}/run.mcap"),
        format!("rm {directory}/run.mcap"),
        format!("mv {directory} /var/lib/elsewhere"),
        format!("ln -s /etc/passwd {directory}/link.mcap"),
    ];
    for script in &read {
        assert!(member(script) && !stranger(&systemd, script), "{script}");
    }
    for script in &written {
        assert!(!member(script) && !stranger(&systemd, script), "{script}");
    }
    // The daemon has it among the few places that it may write to, and keeps it through a stop.
    systemd.run(&format!("systemctl stop {DAEMON}"));
    assert_eq!(
        systemd.run(&format!("stat -c '%U %a' {directory}; cat {directory}/run.mcap")),
        "admittanced 750\nkept\n"
    );
}

#[test]
fn a_stranger_s_counter_of_nodes_is_given_up_and_the_own_one_is_closed() {
    undisturbed(|| {
        if !needs(Need::Systemd) {
            return;
        }
        // Another prefix than the default is as safe.
        let prefix = ("ipc.prefix", "\"cell3_\"");
        let systemd = installed(&config(&[prefix]), &in_the_air());
        let counter = format!("/dev/shm/cell3_{NAME}");
        for made in ["umask 0; : >", "mkfifo -m 0666 "] {
            assert!(stranger(&systemd, &format!("{made}{counter}")));
            assert_eq!(systemd.try_run(&format!("systemctl start {DAEMON}")).0, Some(1));
            wait_for_state(&systemd, DAEMON, "failed");
            // No permission: another start would not help.
            assert_eq!(
                (systemd.property(DAEMON, "ExecMainStatus"), systemd.number(DAEMON, "NRestarts")),
                ("77".into(), 0)
            );
            systemd.wait_for_entry(&format!("-u {DAEMON} --grep='cell3_.*global_mgmt belongs to nobody'"));
            systemd.run(&format!("rm {counter}; systemctl reset-failed"));
        }

        // Root's tool, before the service: it makes nothing, and says so at once.
        let status = "/usr/local/bin/admittancectl status --instance robot";
        systemd.run("install -d -o admittanced -g admittanced -m 0750 /run/admittanced");
        let (code, text) = systemd.try_run(&format!("{status} 2>&1"));
        assert!(code == Some(77) && text.contains("belongs to admittanced, and this program runs as root"), "{text}");
        assert_eq!(shared_memory(&systemd), []);

        systemd.run(&format!("systemctl start {DAEMON}"));
        let open: Vec<_> = shared_memory(&systemd).into_iter().filter(|(_, mode)| mode & 0o077 != 0).collect();
        assert!(open.is_empty(), "other users have rights: {open:?}");
        assert!(!stranger(&systemd, &format!("truncate -s 0 {counter}")));
        systemd.run(&format!("runuser -u admittanced -- {status}"));
        systemd.run(&format!("systemctl stop {DAEMON}"));
        assert_ended_well(&systemd, DAEMON);
        assert_shared_memory_is_free(&systemd);
    });
}
