//! The motion controller's end of the service on which other programs lead it.

use ipc_types::services::{self, Access};
use ipc_types::{IpcSettings, Node, Subscriber, TASK_AXES, TwistSample};

use crate::{Lead, LeadLimits, LeadRefusal, OpenError, Rotation};

/// Samples that are taken in one cycle at most: more than wait in the port, so that who floods it does not keep the loop.
const MOST_AT_ONCE: usize = 64;

/// A [`Lead`] with its port. The service is there as long as this is: who wants to lead finds out whether anybody follows.
#[derive(Debug)]
pub struct Led {
    lead: Lead,
    twists: Subscriber<TwistSample>,
    refused: u64,
    _node: Node,
}

impl Led {
    /// Opens the port, in the thread that uses it; `name` is the node's name for tools.
    ///
    /// # Errors
    /// [`OpenError`] says what could not be opened, and why.
    pub fn open(settings: &IpcSettings, name: &str, limits: LeadLimits) -> Result<Self, OpenError> {
        let node = settings.node(name)?;
        let twists = services::twist(&node, &settings.instance, Access::OpenOrCreate)?.subscriber()?;
        Ok(Self { lead: Lead::new(limits), twists, refused: 0, _node: node })
    }

    /// ṗ0 from `now_ns` on, m/s and rad/s, base frame, for a tool that stands so. It does not wait, and allocates nothing.
    /// Why a sample was not used goes to `refused`, with the number of those so far.
    pub fn twist(
        &mut self,
        now_ns: u64,
        tool: &Rotation,
        mut refused: impl FnMut(&LeadRefusal, u64),
    ) -> [f64; TASK_AXES] {
        for _ in 0..MOST_AT_ONCE {
            let Ok(Some(sample)) = self.twists.receive() else { break };
            if let Err(refusal) = self.lead.take(&sample, now_ns) {
                self.refused += 1;
                refused(&refusal, self.refused);
            }
        }
        self.lead.twist(now_ns, tool)
    }

    /// ṗ0 between two state samples: nothing new is taken, since the daemon would not know of it.
    pub fn coast(&mut self, now_ns: u64) -> [f64; TASK_AXES] {
        self.lead.coast(now_ns)
    }

    /// The arm stands, and nobody has led it there: what was asked for before does not count.
    pub fn rest(&mut self) {
        // What waits was asked for before, too.
        for _ in 0..MOST_AT_ONCE {
            let Ok(Some(_)) = self.twists.receive() else { break };
        }
        self.lead.rest();
    }

    /// The arm is held: what is asked for counts on, and ṗ0 begins anew at zero.
    pub fn halt(&mut self) {
        self.lead.halt();
    }
}
