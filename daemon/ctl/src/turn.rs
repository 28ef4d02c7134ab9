//! Reading in turns what comes without end.

use std::iter;
use std::ops::Deref;

use ipc_types::Subscriber;
use ipc_types::layout::WireSample;

/// Samples of a turn at most: a fraction of a second even for a process that cannot keep up with them.
pub(crate) const TURN: usize = 64;

/// What waits at a subscriber, but a turn of it at most. Where samples come faster than they are dealt with, whoever reads for as long
/// as one waits never sees a signal, an end, or what else there is to do.
pub(crate) fn waiting<T: WireSample>(subscriber: &Subscriber<T>) -> impl Iterator<Item = impl Deref<Target = T>> {
    iter::from_fn(|| subscriber.receive().ok().flatten()).take(TURN)
}
