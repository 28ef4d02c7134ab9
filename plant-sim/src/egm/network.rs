//! The network between robot and edge: a UDP socket, and what becomes of datagrams on the way.

use std::collections::VecDeque;
use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use admittance_core::quantities::Span;
use admittance_host::clock::{monotonic_ns, sleep_until_ns};
use admittance_host::readable::wait_until_readable;
use egm_messages::LARGEST_DATAGRAM;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::egm_section::EgmSection;

/// Datagrams that are taken at once; a flood is not taken to its end.
const MOST_AT_ONCE: usize = 64;

#[derive(Debug)]
pub(super) struct Network {
    socket: UdpSocket,
    edge: SocketAddr,
    way: EgmSection,
    random: ChaCha8Rng,
    /// Of each direction the datagram that is overtaken.
    held_out: Option<Vec<u8>>,
    held_in: Option<Vec<u8>>,
    arrived: VecDeque<Vec<u8>>,
    taken: Vec<u8>,
    is_drained: bool,
}

impl Network {
    pub(super) fn open(way: &EgmSection, edge: SocketAddr) -> io::Result<Self> {
        let any = match edge {
            SocketAddr::V4(_) => SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)),
            SocketAddr::V6(_) => SocketAddr::from((Ipv6Addr::UNSPECIFIED, 0)),
        };
        let socket = UdpSocket::bind(any)?;
        socket.set_nonblocking(true)?;
        Ok(Self {
            socket,
            edge,
            way: way.clone(),
            random: ChaCha8Rng::seed_from_u64(way.seed),
            held_out: None,
            held_in: None,
            arrived: VecDeque::new(),
            taken: Vec::new(),
            is_drained: false,
        })
    }

    /// Sends a datagram, as the network lets it through.
    pub(super) fn send(&mut self, datagram: &[u8]) {
        if self.way.jitter_s > 0.0 {
            let late_s = self.way.jitter_s * self.random.random::<f64>();
            sleep_until_ns(monotonic_ns() + Span::from_seconds(late_s).nanoseconds());
        }
        let mut held = self.held_out.take();
        for datagram in self.passed(datagram, &mut held) {
            // Nobody there is no failure: robots send on as well.
            let _ = self.socket.send_to(&datagram, self.edge);
        }
        self.held_out = held;
    }

    /// Waits for a datagram at most until `until_ns`, without taking it: when it was there; `None` without one, and where
    /// one was there already.
    pub(super) fn await_datagram(&self, until_ns: u64) -> Option<u64> {
        let timeout_ns = until_ns.saturating_sub(monotonic_ns());
        let is_readable = |timeout_ns| wait_until_readable(&self.socket, timeout_ns);
        (!is_readable(0) && is_readable(timeout_ns)).then(monotonic_ns)
    }

    /// The next datagram that has come from the edge; `None` ends a round.
    pub(super) fn receive(&mut self) -> Option<&[u8]> {
        if !std::mem::replace(&mut self.is_drained, true) {
            self.drain();
        }
        match self.arrived.pop_front() {
            Some(datagram) => self.taken = datagram,
            None => {
                self.is_drained = false;
                return None;
            }
        }
        Some(&self.taken)
    }

    fn drain(&mut self) {
        let mut buffer = [0; LARGEST_DATAGRAM];
        for _ in 0..MOST_AT_ONCE {
            let Ok((length, from)) = self.socket.recv_from(&mut buffer) else { return };
            if from.port() != self.edge.port() {
                continue;
            }
            let mut held = self.held_in.take();
            let passed = self.passed(&buffer[..length], &mut held);
            self.held_in = held;
            self.arrived.extend(passed);
        }
    }

    /// What comes out of the network where this goes in; `held` is the one before, if this overtakes it.
    fn passed(&mut self, datagram: &[u8], held: &mut Option<Vec<u8>>) -> Vec<Vec<u8>> {
        let mut passed = Vec::new();
        let is_lost = self.random.random::<f64>() < self.way.lost;
        let is_held = self.random.random::<f64>() < self.way.reordered;
        let is_twice = self.random.random::<f64>() < self.way.duplicated;
        let overtaken = held.take();
        if !is_lost {
            if is_held {
                *held = Some(datagram.to_vec());
            } else {
                passed.push(datagram.to_vec());
            }
            if is_twice {
                passed.push(datagram.to_vec());
            }
        }
        passed.extend(overtaken);
        passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(lost: f64, duplicated: f64, reordered: f64) -> Network {
        let way = EgmSection {
            comm_timeout_s: 1.0,
            clock_drift_ppm: 0.0,
            lost,
            duplicated,
            reordered,
            jitter_s: 0.0,
            seed: 7,
        };
        Network::open(&way, SocketAddr::from((Ipv4Addr::LOCALHOST, 9))).expect("a socket")
    }

    fn through(network: &mut Network, count: u8) -> Vec<u8> {
        let mut held = None;
        (0..count).flat_map(|number| network.passed(&[number], &mut held)).map(|datagram| datagram[0]).collect()
    }

    #[test]
    fn datagrams_are_lost_doubled_and_overtaken_as_told() {
        assert_eq!(through(&mut network(0.0, 0.0, 0.0), 5), [0, 1, 2, 3, 4]);
        assert_eq!(through(&mut network(1.0, 1.0, 1.0), 5), [0; 0]);
        assert_eq!(through(&mut network(0.0, 1.0, 0.0), 3), [0, 0, 1, 1, 2, 2]);
        let mixed = through(&mut network(0.2, 0.1, 0.3), 200);
        assert!(mixed.windows(2).any(|pair| pair[0] > pair[1]), "{mixed:?}");
        let mut once = mixed.clone();
        once.sort_unstable();
        once.dedup();
        assert!((130..190).contains(&once.len()) && once.len() < mixed.len(), "{mixed:?}");
    }
}
