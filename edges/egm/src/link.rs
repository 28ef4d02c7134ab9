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
        Ok(Self { socket, robot: robot.to_canonical(), buffer: Box::new([0; LARGEST_DATAGRAM + 1]) })
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
            // To a socket of IPv6 an IPv4 address is a mapped one.
            Ok((_, from)) if from.ip().to_canonical() != self.robot => Ok(Some(Received::Stranger(from))),
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::{Ipv4Addr, Ipv6Addr};

    #[test]
    fn a_robot_is_known_by_its_address_on_a_socket_of_either_kind() {
        let robot = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("bound");
        for any in [IpAddr::from(Ipv4Addr::UNSPECIFIED), IpAddr::from(Ipv6Addr::UNSPECIFIED)] {
            // A machine may be without IPv6.
            let Ok(mut link) = Link::bind(SocketAddr::new(any, 0), Ipv4Addr::LOCALHOST.into()) else { continue };
            let port = link.local_address().expect("bound").port();
            robot.send_to(b"robot", (Ipv4Addr::LOCALHOST, port)).expect("sent");
            link.wait(1_000_000_000);
            let Ok(Some(Received::Datagram(datagram, from))) = link.receive() else { panic!("a stranger on {any}") };
            assert_eq!((datagram, from.port()), (&b"robot"[..], robot.local_addr().expect("bound").port()));
        }
    }
}
