//! The UDP socket: datagrams of the robot's address in, answers out.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, SocketAddr, UdpSocket};

use admittance_host::readable::wait_until_readable;
use egm_messages::LARGEST_DATAGRAM;

/// The socket and room for one datagram.
#[derive(Debug)]
pub(crate) struct Link {
    socket: UdpSocket,
    robot: IpAddr,
    /// One byte more than is accepted: what fills it is too long.
    buffer: Box<[u8; LARGEST_DATAGRAM + 1]>,
}

/// A datagram that is looked at, or why it is not.
#[derive(Debug)]
pub(crate) enum Received<'a> {
    /// From the robot's address.
    Datagram(&'a [u8], SocketAddr),
    /// From another one.
    Stranger(SocketAddr),
    /// Longer than any message.
    TooLong,
}

impl Link {
    pub(crate) fn bind(listen: SocketAddr, robot: IpAddr) -> io::Result<Self> {
        let socket = UdpSocket::bind(listen)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, robot, buffer: Box::new([0; LARGEST_DATAGRAM + 1]) })
    }

    pub(crate) fn local_address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Waits for a datagram at most `timeout_ns`; a signal ends the wait as well.
    pub(crate) fn wait(&self, timeout_ns: u64) {
        wait_until_readable(&self.socket, timeout_ns);
    }

    /// Takes a datagram, if there is one.
    pub(crate) fn receive(&mut self) -> io::Result<Option<Received<'_>>> {
        match self.socket.recv_from(&mut self.buffer[..]) {
            Ok((_, from)) if from.ip() != self.robot => Ok(Some(Received::Stranger(from))),
            Ok((length, _)) if length > LARGEST_DATAGRAM => Ok(Some(Received::TooLong)),
            Ok((length, from)) => Ok(Some(Received::Datagram(&self.buffer[..length], from))),
            // What an answer to a port that is closed comes back as: the robot has gone, which its silence says as well.
            Err(error) if matches!(error.kind(), ErrorKind::ConnectionRefused) => Ok(None),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Sends a message; one that cannot be sent is a lost one, which the next replaces.
    pub(crate) fn send(&self, message: &[u8], to: SocketAddr) -> bool {
        self.socket.send_to(message, to).is_ok()
    }
}
