//! A daemon with its own configuration, requests to it, and a plant at rest.

use std::path::{Path, PathBuf};

use end_to_end::closed_loop::MPC_DEFAULT;
use end_to_end::session::{PATIENT, ctl_command, output, plant_command, start_daemon, wait_for_log, with_keys, write};
use end_to_end::{Child, PATIENCE, PrivateIpc};
use serde_json::Value;

const FREE_SCENARIO: &str = include_str!("../../../plant-sim/scenarios/planar-free.toml");

/// A surface and a delay that forgive answers that are late now and then.
const SOFT: [(&str, &str); 2] = [("control.command_delay_s", "0.003"), ("environment.normal_stiffness_n_m", "2e4")];

/// The default profile for a busy machine, with these keys besides.
pub(crate) fn configuration(changes: &[(&str, &str)]) -> String {
    with_keys(MPC_DEFAULT, &[&PATIENT[..], &SOFT, changes].concat())
}

/// A daemon and its directory.
pub(crate) struct Cell {
    pub(crate) ipc: PrivateIpc,
    pub(crate) config: PathBuf,
    pub(crate) daemon: Child,
}

impl Cell {
    pub(crate) fn new(changes: &[(&str, &str)]) -> Self {
        let ipc = PrivateIpc::new("planar");
        let config = write(&ipc, "daemon.toml", &configuration(changes));
        let daemon = start_daemon(&ipc, &config);
        Self { ipc, config, daemon }
    }

    /// A plant that is at rest in free space for half a minute.
    pub(crate) fn at_rest(&self) -> Child {
        let motion = ("motion", "[{ duration_s = 30.0, twist = [0.0, 0.0] }]");
        let text = with_keys(FREE_SCENARIO, &[motion, ("timing.command_delay_s", "0.003")]);
        Child::spawn(&mut plant_command(&self.ipc, &write(&self.ipc, "rest.toml", &text)))
    }

    pub(crate) fn ask(&self, words: &[&str]) -> (Option<i32>, String) {
        ask(&self.ipc, &self.config, words)
    }

    /// Carried out, with this in the answer.
    pub(crate) fn done(&self, words: &[&str], expected: &str) {
        let (code, text) = self.ask(words);
        assert_eq!((code, text.contains(expected)), (Some(0), true), "{words:?}: {text} lacks {expected:?}");
    }

    /// Refused with the exit code 1, with all of this in the answer.
    pub(crate) fn refused(&self, words: &[&str], expected: &[&str]) {
        let (code, text) = self.ask(words);
        assert_eq!(code, Some(1), "{words:?}: {text}");
        assert!(expected.iter().all(|expected| text.contains(expected)), "{words:?}: {text} lacks one of {expected:?}");
    }

    pub(crate) fn status(&self) -> Value {
        let (code, text) = self.ask(&["status", "--json"]);
        assert_eq!(code, Some(0), "{text}");
        serde_json::from_str(&text).expect("one JSON object")
    }

    pub(crate) fn wait_for_mode(&mut self, mode: &str) {
        let (ipc, config) = (&self.ipc, &self.config);
        self.daemon.wait_until(mode, PATIENCE, |_| {
            let (_, text) = ask(ipc, config, &["status", "--json"]);
            text.contains(&format!("\"mode\":\"{mode}\""))
        });
    }

    pub(crate) fn record(&self) -> (Child, PathBuf) {
        let file = self.ipc.directory().join("record.mcap");
        let mut recorder = Child::spawn(ctl_command(&self.ipc, "record", &self.config).arg(&file));
        wait_for_log(&mut recorder, "recording admittanced/planar");
        (recorder, file)
    }
}

fn ask(ipc: &PrivateIpc, config: &Path, words: &[&str]) -> (Option<i32>, String) {
    output(ctl_command(ipc, words[0], config).args(&words[1..]))
}
