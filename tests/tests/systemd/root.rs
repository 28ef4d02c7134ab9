//! Root beside the service.

use end_to_end::{Need, needs};

use crate::units::*;

#[test]
fn root_is_told_to_run_as_the_services_user_at_once() {
    if !needs(Need::Systemd) {
        return;
    }
    let systemd = installed(&config(&[]), &in_the_air());
    systemd.run(&format!("systemctl start {PLANT}"));
    entry_of_this_process(&systemd, "MODE=Free");
    let programs = [
        "admittancectl status --instance robot",
        "admittancectl reset --instance robot",
        "admittancectl record /tmp/root.mcap --instance robot",
        "plant-sim --scenario /etc/admittanced/robot.scenario.toml --instance robot --root-path /run/admittanced \
         --prefix admittanced_",
        "admittanced --config /etc/admittanced/robot.toml --instance other",
    ];
    for command in programs {
        let (code, text) = systemd.try_run(command);
        let program = command.split(' ').next().unwrap_or_default();
        assert_eq!(code, Some(77), "{command}: {text}");
        let expected = format!(
            "{program}: /run/admittanced belongs to admittanced, and this program runs as root: run it as that user \
             (runuser -u admittanced)"
        );
        assert!(text.starts_with(&expected), "{command}: {text}");
    }
    // Nothing of root's is left where the service could not remove it.
    assert_eq!(systemd.run("find /run/admittanced /dev/shm -user root ! -path /dev/shm"), "");
    assert_eq!(systemd.number(DAEMON, "NRestarts"), 0);
}
