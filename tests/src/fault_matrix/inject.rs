//! Brings a row's fault about.

use std::process::Command;

use iceoryx2::prelude::{ServiceName, ZeroCopySend};
use ipc_types::{Instance, services};

use super::files::daemon_file;
use super::row::{Disk, Injection, Newcomer, Signal};
use super::run::{Stage, Wrong};
use crate::session::{ctl_command, daemon_command, output, with_keys, write};
use crate::{Child, PATIENCE, binaries};

impl Stage<'_> {
    pub(super) fn inject(&mut self) -> Result<(), Wrong> {
        match self.row.injection {
            Injection::Scripted(_) | Injection::FromStart => {}
            Injection::Signal(who, Signal::Kill) => {
                self.process(who).signal(libc::SIGKILL);
                self.process(who).wait_for_exit(PATIENCE);
            }
            Injection::Signal(who, Signal::Stop) => self.process(who).signal(libc::SIGSTOP),
            Injection::Restart => {
                self.daemon.terminate();
                let code = self.daemon.wait_for_exit(PATIENCE).code();
                if code != Some(0) {
                    return Err(format!("the daemon ends with {code:?}"));
                }
                self.start_daemon();
            }
            Injection::Start(newcomer) => self.start_newcomer(newcomer)?,
            Injection::RemoveRoot => {
                std::fs::remove_dir_all(&self.ipc.settings().root_path).map_err(|error| error.to_string())?;
                self.newcomer = Some(Child::spawn(&mut ctl_command(&self.ipc, "status", &self.config)));
            }
            Injection::Record(disk) => self.record(disk)?,
            Injection::ReplayDamaged => {
                let mut bytes = include_bytes!("../../recordings/force-exceeded.mcap").to_vec();
                let middle = bytes.len() / 2;
                bytes[middle] ^= 1;
                let file = self.ipc.directory().join("damaged.mcap");
                std::fs::write(&file, bytes).map_err(|error| error.to_string())?;
                self.newcomer = Some(Child::spawn(Command::new(&binaries().admittancectl).arg("replay").arg(file)));
            }
            Injection::Request(words) => {
                let mut command = ctl_command(&self.ipc, words[0], &self.config);
                let (code, text) = output(command.args(&words[1..]));
                if code != Some(0) {
                    return Err(format!("{words:?} ends with {code:?}: {text}"));
                }
            }
            Injection::ReloadText(text) => {
                write(&self.ipc, "daemon.toml", text);
                self.reload()?;
            }
            Injection::ReloadKeys(keys) => {
                write(&self.ipc, "daemon.toml", &with_keys(&daemon_file(self.row), keys));
                self.reload()?;
            }
        }
        Ok(())
    }

    fn other_daemon(&self) -> Command {
        let mut command = daemon_command(&self.ipc, &self.config);
        command.args(["--instance", "other"]);
        command
    }

    fn flood(&self) -> Command {
        let settings = self.ipc.settings();
        let mut command = Command::new(&binaries().admittance_lab);
        command.args(["flood", "--seconds", "0.5", "--config"]).arg(&self.config);
        command.arg("--root-path").arg(&settings.root_path).args(["--prefix", &settings.prefix]);
        command
    }

    fn start_newcomer(&mut self, newcomer: Newcomer) -> Result<(), Wrong> {
        let mut command = match newcomer {
            Newcomer::SameInstance => daemon_command(&self.ipc, &self.config),
            Newcomer::ForeignSize => return self.start_beside_foreign::<ShortStateSample>(),
            Newcomer::ForeignVersion => return self.start_beside_foreign::<EarlierStateSample>(),
            Newcomer::FullSharedMemory => with_mount("/dev/shm", "16m", &self.other_daemon()),
            Newcomer::FewDescriptors => in_a_shell("ulimit -n 16", &self.other_daemon()),
            Newcomer::Flood => self.flood(),
        };
        self.newcomer = Some(Child::spawn(&mut command));
        Ok(())
    }

    /// This process is the foreign one.
    fn start_beside_foreign<T: std::fmt::Debug + ZeroCopySend>(&mut self) -> Result<(), Wrong> {
        let node = self.ipc.settings().node("foreign").map_err(|error| error.to_string())?;
        let instance = Instance::new("other").map_err(|error| error.to_string())?;
        let name = ServiceName::new(&services::STATE.service_name(&instance)).map_err(|error| format!("{error:?}"))?;
        let service = node.service_builder(&name).publish_subscribe::<T>().create();
        let _service = service.map_err(|error| format!("the foreign service: {error:?}"))?;
        self.newcomer = Some(Child::spawn(&mut self.other_daemon()));
        self.await_newcomer();
        Ok(())
    }

    fn record(&mut self, disk: Disk) -> Result<(), Wrong> {
        let directory = self.ipc.directory().join("recordings");
        let mut command = ctl_command(&self.ipc, "record", &self.config);
        command.arg(directory.join("contact.mcap"));
        let mut command = match disk {
            Disk::Missing => command,
            Disk::Full => {
                std::fs::create_dir(&directory).map_err(|error| error.to_string())?;
                with_mount(&directory.to_string_lossy(), "64k", &command)
            }
        };
        self.newcomer = Some(Child::spawn(&mut command));
        Ok(())
    }
}

/// The command in a shell that this script has prepared.
fn in_a_shell(script: &str, command: &Command) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-euc", &format!("{script}; exec \"$@\""), "sh"]).arg(command.get_program()).args(command.get_args());
    shell
}

/// The command in its own mount namespace, in which a file system of this size is mounted at
/// `place`.
fn with_mount(place: &str, size: &str, command: &Command) -> Command {
    let script = "mount -t tmpfs -o \"size=$1\" tmpfs \"$2\" && shift 2 && exec \"$@\"";
    let mut mounted = Command::new("unshare");
    mounted.args(["--mount", "--propagation", "private", "--", "sh", "-c", script, "sh", size, place]);
    mounted.arg(command.get_program()).args(command.get_args());
    mounted
}

/// The right name with another size.
#[repr(C)]
#[derive(Debug, ZeroCopySend)]
#[type_name("admittanced.StateSample.v2")]
struct ShortStateSample {
    bytes: [u64; 50],
}

/// The right size of another schema version.
#[repr(C)]
#[derive(Debug, ZeroCopySend)]
#[type_name("admittanced.StateSample.v1")]
struct EarlierStateSample {
    bytes: [u64; 51],
}
