//! The motion controller's ends of the services that it shares with the daemon.

use ipc_types::services::{self, Access};
use ipc_types::{
    CommandSample, Instance, IpcSettings, Listener, Node, NodeError, Notifier, PortError, Publisher, ServiceError,
    StateSample, Subscriber,
};

/// Space for one state sample in shared memory.
pub type Slot = ipc_types::Slot<StateSample>;

/// Publisher of states and subscriber of commands; the node goes last.
#[derive(Debug)]
pub struct Ports {
    states: Publisher<StateSample>,
    arrived: Notifier,
    commands: Subscriber<CommandSample>,
    instance: Instance,
    node: Node,
}

/// Why the ports could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no node.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// A service could not be opened.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// A port could not be made.
    #[error(transparent)]
    Port(#[from] PortError),
}

impl OpenError {
    /// Whether another user could open them.
    pub fn is_permission(&self) -> bool {
        match self {
            Self::Node(node) => node.is_permission(),
            Self::Service(service) => matches!(service, ServiceError::Permission { .. }),
            Self::Port(_) => false,
        }
    }
}

impl Ports {
    /// Opens them; the first process to come creates the services. `name` is the node's name for
    /// tools.
    ///
    /// # Errors
    /// [`OpenError`] says what could not be opened, and why.
    pub fn open(settings: &IpcSettings, name: &str) -> Result<Self, OpenError> {
        let node = settings.node(name)?;
        let (instance, create) = (&settings.instance, Access::OpenOrCreate);
        let state = services::state(&node, instance, create)?;
        let arrival = services::state_arrival(&node, instance, create)?;
        let command = services::command(&node, instance, create)?;
        let (states, arrived, commands) = (state.publisher()?, arrival.notifier()?, command.subscriber()?);
        Ok(Self { states, arrived, commands, instance: instance.clone(), node })
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

    /// A listener that the daemon notifies of each command, for who would rather wait for one than look for it.
    /// It is dropped before these ports: the last to go clears up.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn answers(&self) -> Result<Listener, OpenError> {
        Ok(services::command_arrival(&self.node, &self.instance, Access::OpenOrCreate)?.listener()?)
    }

    /// The node, for further services.
    pub fn node(&self) -> &Node {
        &self.node
    }
}
