//! The motion controller's ends of the services that it shares with the daemon.

use ipc_types::services::{self, Access};
use ipc_types::{CommandSample, IpcSettings, Node, Notifier, Publisher, StateSample, Subscriber};

/// Space for one state sample in shared memory.
pub type Slot = ipc_types::Slot<StateSample>;

/// Publisher of states and subscriber of commands; the node goes last.
#[derive(Debug)]
pub struct Ports {
    states: Publisher<StateSample>,
    arrived: Notifier,
    commands: Subscriber<CommandSample>,
    node: Node,
}

impl Ports {
    /// Opens them; the first process to come creates the services. `name` is the node's name for
    /// tools.
    ///
    /// # Errors
    /// A sentence that says what could not be opened, and why.
    pub fn open(settings: &IpcSettings, name: &str) -> Result<Self, String> {
        let text = |error: &dyn std::fmt::Display| error.to_string();
        let node = settings.node(name).map_err(|e| text(&e))?;
        let (instance, create) = (&settings.instance, Access::OpenOrCreate);
        let state = services::state(&node, instance, create).map_err(|e| text(&e))?;
        let arrival = services::state_arrival(&node, instance, create).map_err(|e| text(&e))?;
        let command = services::command(&node, instance, create).map_err(|e| text(&e))?;
        Ok(Self {
            states: state.publisher().map_err(|e| text(&e))?,
            arrived: arrival.notifier().map_err(|e| text(&e))?,
            commands: command.subscriber().map_err(|e| text(&e))?,
            node,
        })
    }

    /// Space for the next state sample; `None` if there is none. It allocates, so do not call it
    /// between measuring and publishing.
    pub fn loan(&self) -> Option<Slot> {
        self.states.loan_uninit().ok()
    }

    /// Publishes a state sample; [`Self::notify`] afterwards. It is no failure if no daemon runs yet.
    pub fn send(&self, slot: Slot, sample: &StateSample) {
        let _ = slot.write_payload(*sample).send();
    }

    /// Wakes the daemon: after each sample that was sent. Without it the daemon finds the sample
    /// when it looks for the next time, and answers late.
    pub fn notify(&self) {
        let _ = self.arrived.notify();
    }

    /// The newest command that has not been taken yet. It does not wait.
    pub fn command(&self) -> Option<CommandSample> {
        self.commands.receive().ok().flatten().map(|command| *command)
    }

    /// The node, for further services.
    pub fn node(&self) -> &Node {
        &self.node
    }
}
